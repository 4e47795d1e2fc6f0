"""Bands about a model's force and about the energy of its cycles, and their scores.

Parameter bands are quantiles of posterior draws, prediction bands are quantiles of errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from mrwork.base.arguments import (
    AnyNumbers,
    Level,
    May,
    NotNegative,
    Positive,
    Samples,
    Shape,
    Share,
    checked,
)
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import SettingError
from mrwork.records import DamperTest
from mrwork.records.motion import whole_cycles
from mrwork.uncertainty.bands.prediction import Prediction

# Share of a width by which it varies.
_VARIES = 0.02
# Bins in which quantiles are looked for.
_HISTOGRAM = 4096

_ALONG = Shape(("n",))


@checked
@array_dataclass(repr=False)
class Band(Summarised):
    """Limits that are to contain a share `level` of measurements, shape (n,); `basis` is their origin in words."""

    level: Level
    lower: Annotated[AnyNumbers, _ALONG]
    upper: Annotated[AnyNumbers, _ALONG]
    basis: str

    @property
    def half_width_in_words(self) -> str:
        """Half the width, or "from ... to ..." where it varies."""
        least, most = (0.5 * float(end(self.upper - self.lower)) for end in (np.min, np.max))
        if most - least > _VARIES * most:
            return f"from {least:.3g} to {most:.3g}"
        return f"{0.5 * float(np.mean(self.upper - self.lower)):.4g}"

    @classmethod
    @checked
    def about(
        cls,
        centre: Annotated[Floats, _ALONG],
        half: Annotated[AnyNumbers, _ALONG] | Annotated[float, May.BE_INFINITE],
        *,
        level: Level,
        basis: str = "",
    ) -> Band:
        """Prediction band of half width `half` about a centre, shape (n,)."""
        return cls(level=level, lower=centre - half, upper=centre + half, basis=basis)


@dataclass(frozen=True, slots=True, kw_only=True)
class BandScore:
    """Score of a band on measurements that it was not calibrated on.

    `coverage` is the share of measurements inside. `interval_score` is the mean of the width plus 2/(1 - level) times
    the distance of measurements outside: lower is better, and the true quantiles have the least expectation (Winkler
    1972; Gneiting and Raftery 2007, eq. 43). `width` and `interval_score` are in the unit of `per`.
    """

    coverage: Share
    interval_score: NotNegative
    width: NotNegative


@checked
def score(band: Band, measured: Samples, *, per: Positive = 1.0) -> BandScore:
    """Score a band on measurements, shape (n,); widths are divided by `per`, such as the standard deviation."""
    if measured.size != band.lower.size:
        raise SettingError(
            f"`measured` has {measured.size} samples; give one for each of the {band.lower.size} of the band"
        )
    width = band.upper - band.lower
    outside = np.maximum(band.lower - measured, 0.0) + np.maximum(measured - band.upper, 0.0)
    return BandScore(
        coverage=float(np.mean(outside == 0.0)),
        interval_score=float(np.mean(width + 2.0 / (1.0 - band.level) * outside)) / per,
        width=float(np.mean(width)) / per,
    )


def weighted_quantile(values: Floats, weights: Floats, level: float) -> float:
    """Smallest of the values, shape (n,), none negative, up to which lies a share `level` of the weights, of sum 1."""
    wanted = level * (1.0 - 1e-12)
    largest = float(values.max())
    bins = np.zeros(values.size, dtype=np.intp)
    if 0.0 < largest < np.inf:
        bins = np.minimum((values * (_HISTOGRAM / largest)).astype(np.intp), _HISTOGRAM - 1)
    share = np.cumsum(np.bincount(bins, weights=weights))
    inside = min(int(np.searchsorted(share, wanted)), share.size - 1)
    below = float(share[inside - 1]) if inside else 0.0
    within = np.flatnonzero(bins == inside)
    order = within[np.argsort(values[within], kind="stable")]
    index = np.searchsorted(below + np.cumsum(weights[order]), wanted)
    return float(values[order[min(int(index), order.size - 1)]])


def pooled_quantile(scores: Sequence[Floats], level: float) -> float:
    """Quantile `level` of the errors of several tests, each test with equal weight."""
    return weighted_quantile(np.concatenate(scores), _equal_weights(scores), level)


def next_test_quantile(scores: Sequence[Floats], level: float) -> float:
    """Quantile `level` of the errors of a further test, estimated from the errors of several tests.

    A further test may have larger errors than all known ones, the more so the fewer are known. Each test is therefore
    left out in turn, and the level of the pooled quantile of the others is chosen so that it covers `level` of the
    errors of the tests left out, on average. (The bound of hierarchical conformal prediction, Lee, Barber and Willett,
    JRSS B 87, 2025, holds for every distribution, but is infinite for fewer than nine tests at 90 %.) For a single test
    its own quantile is returned.
    """
    if not 0.0 < level < 1.0:
        raise SettingError(f"the level of a band lies between 0 and 1, got {level:g}")
    if len(scores) == 1:
        return pooled_quantile(scores, level)
    values, weights = np.concatenate(scores), _equal_weights(scores)
    order = np.argsort(values, kind="stable")
    share = np.concatenate([[0.0], np.cumsum(weights[order])])
    of_all = share[np.searchsorted(values[order], values, side="left")]
    of_own = np.concatenate(
        [np.searchsorted(np.sort(of_test), of_test, side="left") / of_test.size for of_test in scores]
    )
    # Level of the others' quantile that covers each error: the share of smaller errors among the others.
    n_tests = len(scores)
    needed = np.clip((n_tests * of_all - of_own) / (n_tests - 1), 0.0, 1.0) + 1e-12
    return weighted_quantile(values, weights, min(weighted_quantile(needed, weights, level), 1.0))


def _equal_weights(scores: Sequence[Floats]) -> Floats:
    return np.concatenate([np.full(of_test.size, 1.0 / (of_test.size * len(scores))) for of_test in scores])


def energy_of_cycles(test: DamperTest, force: Floats) -> Floats:
    """Dissipated energy [J] of the counted cycles of a test with this force [N], (n_time,), shape (n_cycles,)."""
    # Over a whole cycle the rectangle rule is as accurate as the trapezoidal rule.
    energy = [
        float(force[cycle] @ test.velocity[cycle]) * test.dt
        for cycle in whole_cycles(test.displacement)
        if cycle.start >= test.n_settle
        and not any(begin < cycle.stop and cycle.start < end for begin, end in test.uncompared)
    ]
    return np.array(energy)


def _scale_of_energy(prediction: Prediction) -> float:
    """Scale of the error of the energy [J]: a cycle with the standard deviations of force and displacement."""
    stroke = float(np.std(prediction.test.displacement[prediction.test.counted]))
    return 2.0 * np.pi * prediction.deviation * stroke


def energy_errors(prediction: Prediction) -> Floats:
    """Absolute error of the energy of each cycle in its scale, shape (n_cycles,)."""
    measured, model = (
        energy_of_cycles(prediction.test, force) for force in (prediction.test.force, prediction.model_force)
    )
    return np.asarray(np.abs(measured - model) / _scale_of_energy(prediction))


def energy_band(prediction: Prediction, scores: Sequence[Floats], level: float) -> Band:
    """Prediction band of the energy, (n_cycles,), from the `energy_errors` of tests that the fit has not seen."""
    half = next_test_quantile(scores, level) * _scale_of_energy(prediction)
    basis = f"calibrated on the cycles of {len(scores)} tests"
    return Band.about(
        energy_of_cycles(prediction.test, prediction.model_force), half, level=level, basis=basis
    )
