"""Scores of bands on tests left out, and the half width of a next test by random effects.

Each test's errors are Gaussian about its own size, sizes lognormal from test to test.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm, t

from mrwork.report import Table
from mrwork.uncertainty import Band, Prediction
from mrwork.uncertainty import score as score_of
from studies.former.table import Cell, table_of

LEVEL = 0.9


@dataclass(frozen=True, slots=True, kw_only=True)
class BandScore:
    """One band on one test left out; width and interval score per deviation of the measured force."""

    way: str
    test: str
    coverage: float
    width: float
    interval_score: float


def outcome(way: str, prediction: Prediction, band: Band) -> BandScore:
    judged = score_of(band, prediction.measured, per=float(np.std(prediction.measured)))
    return BandScore(
        way=way,
        test=prediction.test.name,
        coverage=judged.coverage,
        width=judged.width,
        interval_score=judged.interval_score,
    )


def score_table(title: str, scores: Iterable[BandScore]) -> Table:
    """A row for each way, in the order in which they first appear: means over its tests, and the least coverage."""
    groups: dict[str, list[BandScore]] = {}
    for score in scores:
        groups.setdefault(score.way, []).append(score)

    def mean(of: str, form: str, factor: float = 1.0) -> Cell:
        return lambda group: form.format(factor * np.mean([getattr(score, of) for score in group]))

    return table_of(
        title,
        "way",
        groups,
        {
            "tests": lambda group: str(len(group)),
            "coverage": mean("coverage", "{:.1f} %", 100.0),
            "least": lambda group: f"{100.0 * min(score.coverage for score in group):.1f}",
            "width": mean("width", "{:.3f}"),
            "score": mean("interval_score", "{:.3f}"),
        },
    )


# Quantiles of the size over which the mixture is averaged.
_NODES = (np.arange(400) + 0.5) / 400


def next_test_half_width(sizes: np.ndarray, level: float) -> float:
    """Half width that holds `level` of the errors of one more test, from the root mean squares of K tests.

    The size of the next is exp of Student's t with K - 1 degrees of freedom about the mean logarithm, its spread
    widened by sqrt(1 + 1/K): the prediction of a normal sample.
    """
    logs = np.log(sizes)
    spread = np.std(logs, ddof=1) * np.sqrt(1.0 + 1.0 / len(logs))
    size = np.exp(np.mean(logs) + spread * t.ppf(_NODES, len(logs) - 1))
    return float(
        brentq(lambda half: np.mean(2.0 * norm.cdf(half / size) - 1.0) - level, 1e-6, 100.0 * sizes.max())
    )


def random_size_outcome(prediction: Prediction, others: Sequence[Prediction]) -> BandScore:
    """A band of constant width, by random sizes of the errors of the other tests."""
    sizes = np.array([np.sqrt(np.mean(other.residual**2)) / other.deviation for other in others])
    half = prediction.deviation * next_test_half_width(sizes, LEVEL)
    band = Band.about(prediction.force, half, level=LEVEL, basis="")
    return outcome("random size per test, all other tests", prediction, band)
