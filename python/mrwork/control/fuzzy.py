"""A fuzzy controller of five sets, tabulated: the share of the largest command by deformation and rate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.errors import SettingError

Floats = NDArray[np.float64]

# Triangles a half apart over [-1, 1]; what lies beyond belongs wholly to the outermost.
INPUT_SETS = {"NL": -1.0, "NS": -0.5, "ZE": 0.0, "PS": 0.5, "PL": 1.0}

# Triangles a quarter apart. The outermost reach beyond [0, 1], so that one of them alone gives 0 or 1 exactly.
OUTPUT_SETS = {"ZE": 0.0, "S": 0.25, "M": 0.5, "L": 0.75, "VL": 1.0}

# Rows: deformation NL to PL. Columns: its rate NL to PL. On the way out resist, the more the further and the faster;
# on the way back yield, and let the building's own stiffness bring it home. The table is ours: inputs, sets and
# inference are those of the literature, its tables differ from paper to paper.
RULES = (
    ("VL", "L", "M", "S", "ZE"),
    ("L", "M", "S", "ZE", "S"),
    ("M", "S", "ZE", "S", "M"),
    ("S", "ZE", "S", "M", "L"),
    ("ZE", "S", "M", "L", "VL"),
)

_UNIVERSE = np.linspace(-0.25, 1.25, 1201)


@dataclass(frozen=True, slots=True, kw_only=True)
class FuzzyTable:
    """Share of the largest command, shape (n, n): rows by deformation, columns by rate, each over [-1, 1].

    Inputs are in units of `deformation_scale` [m] and `rate_scale` [m/s] and are clipped to [-1, 1]; between the
    `points`, shape (n,), evenly spaced, the share is interpolated bilinearly.
    """

    points: Floats
    share: Floats
    deformation_scale: float
    rate_scale: float


def fuzzy_table(*, deformation_scale: float, rate_scale: float, n_points: int = 41) -> FuzzyTable:
    """Tabulate the controller.

    Parameters
    ----------
    deformation_scale, rate_scale
        What counts as large: peak deformation [m] and rate [m/s] to be expected of the device.
    n_points
        Along each input, odd, 5 or more: then the centres of the sets are not cut.

    Raises
    ------
    SettingError
        Where a scale is not positive, or the number of points is even or too small.

    Examples
    --------
    >>> from mrwork.control.fuzzy import fuzzy_table
    >>> fuzzy_table(deformation_scale=0.01, rate_scale=0.2).share.shape
    (41, 41)
    """
    if not (np.isfinite([deformation_scale, rate_scale]).all() and min(deformation_scale, rate_scale) > 0.0):
        raise SettingError(
            f"the scales of the fuzzy controller are {deformation_scale} m and {rate_scale} m/s; "
            f"give positive numbers"
        )
    if n_points < 5 or n_points % 2 == 0:
        raise SettingError(f"`n_points` is {n_points}; give an odd number, 5 or more")
    points = np.linspace(-1.0, 1.0, n_points)
    rows = [infer(points[row], points) for row in range(n_points)]
    return FuzzyTable(
        points=points, share=np.array(rows), deformation_scale=deformation_scale, rate_scale=rate_scale
    )


def infer(deformation: ArrayLike, rate: ArrayLike) -> Floats:
    """Share of the largest command for scaled inputs, by Mamdani's inference.

    A rule holds as far as the lesser of its two sets; it cuts its output set there; of all rules the larger is taken,
    and of the area below, the centroid (Mamdani & Assilian, Int. J. Man-Machine Studies 7(1), 1975, 1-13).

    Parameters
    ----------
    deformation, rate
        In units of their scales, of shapes that broadcast.

    Returns
    -------
    NDArray
        In [0, 1], of their common shape.
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
    # Rounding of the integrals is all that could leave the range.
    return np.asarray(np.clip(moment / area, 0.0, 1.0), dtype=np.float64)


def memberships(value: ArrayLike) -> Floats:
    """How far a scaled input belongs to each of the five sets, shape (..., 5); they add up to 1."""
    clipped = np.clip(np.asarray(value, dtype=np.float64), -1.0, 1.0)
    centres = np.array(list(INPUT_SETS.values()))
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(clipped[..., None] - centres) / 0.5), dtype=np.float64)
