"""Tests of the residuals of a fit: white noise, also at steps and reversals, constant variance, what repeats."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from operator import attrgetter

import numpy as np
import scipy
from numpy.typing import NDArray

from mrwork.base.values import Floats
from mrwork.dampers.command import steps_of_command
from mrwork.identification.covariance import effective_samples
from mrwork.records import DamperTest
from mrwork.records.motion import regular_cycles, reversals

# Lags of the Ljung-Box test, and the significance level of both tests.
LAGS = 10
LEVEL = 0.01
# Samples of the windows after steps of the command and around reversals: a wrong sample to the lag of a slow coil.
WINDOWS = (1, 4, 16, 64)
# Windows with more than this share of the samples are not compared with the rest, nor those with fewer degrees of
# freedom, whose scores do not follow F.
_MOST_OF_SAMPLES = 0.5
_LEAST_FREEDOM = 3.0
# Phases of a cycle at which residuals are compared from cycle to cycle, and the least number of cycles for that.
_PHASES = 256
_LEAST_CYCLES = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Excess:
    """Root mean square of the residuals in some windows over that elsewhere, and the p-value of white noise.

    NaN where there are no such windows.
    """

    ratio: float = math.nan
    p: float = math.nan

    @property
    def is_found(self) -> bool:
        """Whether white noise is rejected because the residuals in the windows are too large."""
        return self.p < LEVEL and self.ratio > 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ResidualTests:
    """Statistics of the residuals of one test, without units; NaN where one cannot be computed.

    `ljung_box_p` is the p-value of the test of Ljung and Box (Biometrika 65, 1978, 297-303) for white noise,
    `breusch_pagan_p` of the test of Breusch and Pagan (Econometrica 47, 1979, 1287-1294; Koenker's version) for a
    variance that does not depend on speed and stroke, in which the `n_time` residuals count as `n_effective`.
    `fast_to_slow` is the RMS residual in the faster half of the samples over that in the slower half, `excess` the
    excess kurtosis, 0 for normal residuals. `repeating` is the share of the mean square that repeats in every cycle.
    `after_steps` of the command and `at_reversals` of the motion the residuals are compared with those elsewhere: a
    spike of a sample hardly shows in an autocorrelation.
    """

    lag_one: float = math.nan
    ljung_box_p: float = math.nan
    breusch_pagan_p: float = math.nan
    fast_to_slow: float = math.nan
    excess: float = math.nan
    repeating: float
    n_time: int
    n_effective: float
    after_steps: Excess = Excess()
    at_reversals: Excess = Excess()

    @property
    def is_white(self) -> bool:
        """Whether the Ljung-Box test does not reject white noise."""
        return not self.ljung_box_p < LEVEL

    @property
    def has_constant_variance(self) -> bool:
        """Whether the Breusch-Pagan test does not reject a constant variance."""
        return not self.breusch_pagan_p < LEVEL


def residual_tests(test: DamperTest, residual: Floats) -> ResidualTests:
    """Tests of the residuals of the samples that count, shape (n_counted,)."""
    counted, n_effective = test.counted, effective_samples([residual])
    repeating = _repeated_share(test, residual)
    tests = ResidualTests(repeating=repeating, n_time=residual.size, n_effective=n_effective)
    if residual.size <= 2 * LAGS or not float(np.var(residual)) > 0.0:
        return tests
    rho = autocorrelation(residual, LAGS)
    speed = np.abs(test.velocity[counted])
    stroke = np.abs(test.displacement[counted] - np.mean(test.displacement[counted]))
    centred = residual - residual.mean()
    after_steps, at_reversals = _excesses(test, centred, n_effective / residual.size)
    return replace(
        tests,
        lag_one=float(rho[1]),
        ljung_box_p=_ljung_box(rho, residual.size),
        breusch_pagan_p=_breusch_pagan(centred**2, np.stack([speed, stroke], axis=1), n_effective),
        fast_to_slow=_fast_to_slow(centred, speed),
        excess=_excess_kurtosis(residual),
        after_steps=after_steps,
        at_reversals=at_reversals,
    )


def _excesses(test: DamperTest, centred: Floats, share: float) -> tuple[Excess, Excess]:
    """Excess of the counted residuals after steps of the command, and at reversals; `share` of them is independent.

    Windows of several lengths are compared with the rest by the Savage scores of the squared residuals, -ln of the
    share of larger ones, which no heavy tail of the noise misleads. The most significant window stands for them all,
    with its p-value times the number of comparisons (Bonferroni).
    """
    squared = centred**2
    rank = np.empty(squared.size)
    rank[np.argsort(squared)] = np.arange(squared.size)
    scores = -np.log1p(-(rank + 0.5) / squared.size)
    steps = np.concatenate([np.empty(0, np.intp), *(steps_of_command(signal) for signal, _ in test.commands)])
    turns = reversals(test.velocity)
    compared = [
        [
            excess
            for width in WINDOWS
            for inside in [_windows(starts - about * (width // 2), width, test)[test.counted]]
            if (excess := _excess(squared, scores, inside, share)) is not None
        ]
        for starts, about in ((steps, 0), (turns, 1))
    ]
    count = sum(map(len, compared))
    after, at = (min(excesses, key=attrgetter("p"), default=Excess()) for excesses in compared)
    return replace(after, p=min(count * after.p, 1.0)), replace(at, p=min(count * at.p, 1.0))


def _windows(starts: NDArray[np.intp], width: int, test: DamperTest) -> NDArray[np.bool_]:
    """Whether each sample of a test is in one of the windows of this width, shape (n_time,)."""
    samples = (starts[:, None] + np.arange(width)).ravel()
    inside = np.zeros(test.n_time, dtype=bool)
    inside[samples[(samples >= 0) & (samples < test.n_time)]] = True
    return inside


def _excess(squared: Floats, scores: Floats, inside: NDArray[np.bool_], share: float) -> Excess | None:
    """Excess of the residuals inside over those outside; `None` where they cannot be compared.

    The ratio of the mean `scores` inside and outside is nearly F under white noise of any distribution: the scores
    follow an exponential variable, half a chi-squared one of two degrees of freedom.
    """
    if not inside.any() or np.mean(inside) > _MOST_OF_SAMPLES or not np.any(squared[~inside]):
        return None
    freedom = 2.0 * share * np.array([np.count_nonzero(inside), np.count_nonzero(~inside)])
    if freedom[0] < _LEAST_FREEDOM:
        return None
    ratio = float(np.mean(scores[inside]) / np.mean(scores[~inside]))
    return Excess(
        ratio=math.sqrt(float(np.mean(squared[inside]) / np.mean(squared[~inside]))),
        p=float(scipy.special.fdtrc(float(freedom[0]), float(freedom[1]), ratio)),
    )


def autocorrelation(residual: Floats, lags: int) -> Floats:
    """Autocorrelation about the mean at lags 0 to `lags`, shape (lags + 1,)."""
    centred = residual - residual.mean()
    spectrum = np.abs(np.fft.rfft(centred, 2 * centred.size)) ** 2
    covariance = np.fft.irfft(spectrum, 2 * centred.size)[: lags + 1]
    return np.asarray(covariance / (covariance[0] or 1.0))


def _ljung_box(rho: Floats, n_time: int) -> float:
    lag = np.arange(1, LAGS + 1)
    statistic = n_time * (n_time + 2) * float(np.sum(rho[1:] ** 2 / (n_time - lag)))
    return float(scipy.special.chdtrc(LAGS, statistic))


def _breusch_pagan(squared: Floats, over: Floats, n_effective: float) -> float:
    """Under constant variance, n R^2 of a regression of the squared residuals is chi-squared."""
    design = np.column_stack([np.ones(squared.size), over / over.max(axis=0)])
    left = squared - design @ np.linalg.lstsq(design, squared, rcond=None)[0]
    explained = 1.0 - float(np.var(left)) / float(np.var(squared))
    return float(scipy.special.chdtrc(over.shape[1], n_effective * max(explained, 0.0)))


def _excess_kurtosis(values: Floats) -> float:
    squares = (values - values.mean()) ** 2
    return float(np.mean(squares**2) / np.mean(squares) ** 2 - 3.0)


def _fast_to_slow(centred: Floats, speed: Floats) -> float:
    fast = speed > np.median(speed)
    slow = float(np.mean(centred[~fast] ** 2))
    return float(np.sqrt(np.mean(centred[fast] ** 2) / slow)) if fast.any() and slow > 0.0 else np.nan


def _repeated_share(test: DamperTest, residual: Floats) -> float:
    """Variance between phases of the cycle, corrected for the scatter from cycle to cycle, as a share of both."""
    cycles = regular_cycles(test.displacement[test.counted])
    if len(cycles) < _LEAST_CYCLES:
        return np.nan
    phases = np.linspace(0.0, 1.0, _PHASES, endpoint=False)
    # The nearest samples: interpolation between two would reduce the noise.
    rows = np.array(
        [residual[np.rint(cycle.start + phases * (cycle.stop - cycle.start)).astype(int)] for cycle in cycles]
    )
    scatter = float(np.mean(np.var(rows, axis=0, ddof=1)))
    common = float(np.mean(rows.mean(axis=0) ** 2)) - scatter / len(rows)
    total = max(common, 0.0) + scatter
    return max(common, 0.0) / total if total > 0.0 else np.nan
