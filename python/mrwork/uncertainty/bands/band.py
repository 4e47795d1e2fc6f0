"""A band about a model's prediction, and how well a band did."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

BandKind = Literal["parameter", "prediction"]
"""A parameter band holds the model's own force for the parameters that the data allow: it shrinks with more data, and
no measurement need lie in it. A prediction band is to hold the given share of measurements."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """Lower and upper end, shape (n,), meant to hold a share `level`; `basis` says what it rests on, in words."""

    kind: BandKind
    level: float
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    basis: str


@dataclass(frozen=True, slots=True, kw_only=True)
class BandScore:
    """How a band did on measurements that it did not know.

    `coverage` is the share of them inside. `interval_score` is the width plus 2/(1 - level) times the distance of those
    outside, averaged: the lower the better, and lowest in expectation for the true quantiles (Winkler 1972;
    Gneiting and Raftery 2007, eq. 43). `width` and `interval_score` are in the unit of `per`.
    """

    coverage: float
    interval_score: float
    width: float


def score(band: Band, measured: NDArray[np.float64], *, per: float = 1.0) -> BandScore:
    """Judge a band by measurements, shape (n,); `per` is what widths are divided by, such as their deviation."""
    width = band.upper - band.lower
    outside = np.maximum(band.lower - measured, 0.0) + np.maximum(measured - band.upper, 0.0)
    return BandScore(
        coverage=float(np.mean(outside == 0.0)),
        interval_score=float(np.mean(width + 2.0 / (1.0 - band.level) * outside)) / per,
        width=float(np.mean(width)) / per,
    )
