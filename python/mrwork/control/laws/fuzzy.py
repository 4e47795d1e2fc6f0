"""Fuzzy law with five sets, as a table: share of the largest command over deformation and rate; and its settings."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from mrwork.base.arguments import checked
from mrwork.base.keys import key
from mrwork.base.values import Floats
from mrwork.control.laws.law_problem import Design, DesignProblem, LawSettings, Span

# Centres of triangles of half-width 0.5 over [-1, 1]; values beyond belong to the outermost set.
INPUT_SETS = {"NL": -1.0, "NS": -0.5, "ZE": 0.0, "PS": 0.5, "PL": 1.0}

# Centres of triangles of half-width 0.25. The outermost extend beyond [0, 1], so that their centroids are 0 and 1.
OUTPUT_SETS = {"ZE": 0.0, "S": 0.25, "M": 0.5, "L": 0.75, "VL": 1.0}

# Rows: deformation NL to PL. Columns: rate NL to PL. The command grows with deformation and rate while the deformation
# increases, and is small while it decreases. Inputs, sets and inference follow the literature; the rules, which differ
# from paper to paper, are our own.
RULES = (
    ("VL", "L", "M", "S", "ZE"),
    ("L", "M", "S", "ZE", "S"),
    ("M", "S", "ZE", "S", "M"),
    ("S", "ZE", "S", "M", "L"),
    ("ZE", "S", "M", "L", "VL"),
)

_UNIVERSE = np.linspace(-0.25, 1.25, 1201)


@cache
def fuzzy_table() -> tuple[Floats, Floats]:
    """Points along each scaled input, and the share of the largest command, shape (n, n): rows by deformation.

    Inputs are divided by their scales and clipped to [-1, 1]; between the points the share is interpolated bilinearly.
    The centres of the sets are among the points. Both are read-only, the same for all scales.
    """
    points = np.linspace(-1.0, 1.0, 41)
    share = np.array([infer(deformation, points) for deformation in points])
    points.flags.writeable = share.flags.writeable = False
    return points, share


def infer(deformation: ArrayLike, rate: ArrayLike) -> Floats:
    """Share of the largest command for scaled inputs, by Mamdani's inference.

    The strength of a rule is the smaller membership of its two inputs; it clips the output set. The clipped sets are
    combined by their maximum, and the result is the centroid of the area (Mamdani & Assilian, Int. J. Man-Machine
    Studies 7(1), 1975, 1-13).
    """
    first, second = np.broadcast_arrays(
        np.asarray(deformation, dtype=np.float64), np.asarray(rate, dtype=np.float64)
    )
    of_deformation, of_rate = memberships(first), memberships(second)
    aggregated = np.zeros((*first.shape, _UNIVERSE.size))
    for row, consequents in enumerate(RULES):
        for column, consequent in enumerate(consequents):
            strength = np.minimum(of_deformation[..., row], of_rate[..., column])
            output = np.maximum(0.0, 1.0 - np.abs(_UNIVERSE - OUTPUT_SETS[consequent]) / 0.25)
            aggregated = np.maximum(aggregated, np.minimum(strength[..., None], output))
    area = np.trapezoid(aggregated, _UNIVERSE, axis=-1)
    moment = np.trapezoid(aggregated * _UNIVERSE, _UNIVERSE, axis=-1)
    # Only rounding of the integrals can leave the range.
    return np.asarray(np.clip(moment / area, 0.0, 1.0), dtype=np.float64)


def memberships(value: ArrayLike) -> Floats:
    """Membership of a scaled input in each of the five sets, shape (..., 5); the sum is 1."""
    clipped = np.clip(np.asarray(value, dtype=np.float64), -1.0, 1.0)
    centres = np.array(list(INPUT_SETS.values()))
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(clipped[..., None] - centres) / 0.5), dtype=np.float64)


@checked
class FuzzySettings(LawSettings):
    """Scales of the inputs of the fuzzy controller."""

    deformation: float = key(
        "scale of the damper displacement",
        unit="m",
        above=0.0,
        span=Span(lower=0.1, upper=100.0, of=(("stroke", 1.0),)),
    )
    rate: float = key(
        "scale of the damper velocity",
        unit="m/s",
        above=0.0,
        span=Span(lower=0.01, upper=10.0, of=(("rate", 1.0),)),
    )

    def design(self, problem: DesignProblem) -> Design:
        """Scales of the inputs and the table of commands."""
        return Design(
            gains={
                "deformation_scale": problem.each(self.deformation),
                "rate_scale": problem.each(self.rate),
            },
            tables={"shares": fuzzy_table()[1].ravel()},
        )
