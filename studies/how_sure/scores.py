"""Scores of bands on tests left out, and the half width of a next test by random effects.

Each test's errors are Gaussian about its own size, sizes lognormal from test to test.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm, t

from mrwork.uncertainty import Band, Prediction, score

LEVEL = 0.9


@dataclass(frozen=True, slots=True, kw_only=True)
class BandScore:
    """One band on one test left out; width and interval score per deviation of the measured force."""

    way: str
    test: str
    coverage: float
    width: float
    interval_score: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ScoreRow:
    """One way over all tests left out: means, and the least coverage of a test."""

    way: str
    n_tests: int
    coverage: float
    least: float
    width: float
    interval_score: float


def outcome(way: str, prediction: Prediction, band: Band) -> BandScore:
    judged = score(band, prediction.measured, per=float(np.std(prediction.measured)))
    return BandScore(
        way=way,
        test=prediction.test.name,
        coverage=judged.coverage,
        width=judged.width,
        interval_score=judged.interval_score,
    )


def table(outcomes: Iterable[BandScore]) -> tuple[ScoreRow, ...]:
    """Rows in the order in which their ways first appear."""
    groups: dict[str, list[BandScore]] = {}
    for each in outcomes:
        groups.setdefault(each.way, []).append(each)
    return tuple(
        ScoreRow(
            way=way,
            n_tests=len(group),
            coverage=float(np.mean([each.coverage for each in group])),
            least=min(each.coverage for each in group),
            width=float(np.mean([each.width for each in group])),
            interval_score=float(np.mean([each.interval_score for each in group])),
        )
        for way, group in groups.items()
    )


def lines(title: str, rows: Sequence[ScoreRow]) -> str:
    width = max(len(row.way) for row in rows)
    head = f"{title}\n  {'way':<{width}}  tests  coverage  least   width  score"
    body = [
        f"  {row.way:<{width}}  {row.n_tests:5d}  {100 * row.coverage:6.1f} %  {100 * row.least:5.1f}  "
        f"{row.width:6.3f} {row.interval_score:6.3f}"
        for row in rows
    ]
    return "\n".join([head, *body])


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
