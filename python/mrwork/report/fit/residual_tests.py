"""Tests of residuals: whiteness, constant variance, and the share that repeats in every cycle."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.identification.autocorrelation import effective_samples
from mrwork.records.motion import whole_cycles
from mrwork.report.comparison import Comparison
from mrwork.uncertainty.bands.prediction import has_regular_cycles

Array = NDArray[np.float64]

# Lags of the Ljung-Box test, and the significance level of both tests.
LAGS = 10
LEVEL = 0.01
# Phases of a cycle at which residuals are compared from cycle to cycle, and the least number of cycles for that.
_PHASES = 256
_LEAST_CYCLES = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class ResidualTests:
    """Statistics of the residuals of one test, without units; NaN where one cannot be computed.

    `ljung_box_p` is the p-value of the test of Ljung and Box (Biometrika 65, 1978, 297-303) for white noise,
    `breusch_pagan_p` that of the test of Breusch and Pagan (Econometrica 47, 1979, 1287-1294; Koenker's version) for a
    variance that does not depend on speed and stroke, in which the `n_time` residuals count as `n_effective`.
    `fast_to_slow` is the RMS residual in the faster half of the samples over that in the slower half, `excess` the
    excess kurtosis, 0 for normal residuals. `repeating` is the share of the mean square that repeats in every cycle.
    """

    lag_one: float
    ljung_box_p: float
    breusch_pagan_p: float
    fast_to_slow: float
    excess: float
    repeating: float
    n_time: int
    n_effective: float

    @property
    def is_white(self) -> bool:
        """Whether the Ljung-Box test does not reject white noise."""
        return not self.ljung_box_p < LEVEL

    @property
    def has_constant_variance(self) -> bool:
        """Whether the Breusch-Pagan test does not reject a constant variance."""
        return not self.breusch_pagan_p < LEVEL


def residual_tests(comparison: Comparison) -> ResidualTests:
    """Test the residuals of the samples that count."""
    test = comparison.test
    counted = test.counted
    residual = comparison.residual[counted]
    rho = autocorrelation(residual, LAGS)
    n_effective = effective_samples([residual])
    speed = np.abs(test.velocity[counted])
    stroke = np.abs(test.displacement[counted] - np.mean(test.displacement[counted]))
    centred = residual - residual.mean()
    varies = residual.size > 2 * LAGS and float(np.var(residual)) > 0.0
    return ResidualTests(
        lag_one=float(rho[1]) if varies else np.nan,
        ljung_box_p=_ljung_box(rho, residual.size) if varies else np.nan,
        breusch_pagan_p=_breusch_pagan(centred**2, np.stack([speed, stroke], axis=1), n_effective)
        if varies
        else np.nan,
        fast_to_slow=_fast_to_slow(centred, speed) if varies else np.nan,
        excess=_excess_kurtosis(residual) if varies else np.nan,
        repeating=_repeating(comparison),
        n_time=residual.size,
        n_effective=n_effective,
    )


def autocorrelation(residual: Array, lags: int) -> Array:
    """Autocorrelation about the mean at lags 0 to `lags`, shape (lags + 1,)."""
    centred = residual - residual.mean()
    spectrum = np.abs(np.fft.rfft(centred, 2 * centred.size)) ** 2
    covariance = np.fft.irfft(spectrum, 2 * centred.size)[: lags + 1]
    return np.asarray(covariance / (covariance[0] or 1.0))


def _ljung_box(rho: Array, n_time: int) -> float:
    lag = np.arange(1, LAGS + 1)
    statistic = n_time * (n_time + 2) * float(np.sum(rho[1:] ** 2 / (n_time - lag)))
    return chi_squared_beyond(statistic, LAGS)


def _breusch_pagan(squared: Array, over: Array, n_effective: float) -> float:
    """Under constant variance, n R^2 of a regression of the squared residuals is chi-squared."""
    design = np.column_stack([np.ones(squared.size), over / over.max(axis=0)])
    left = squared - design @ np.linalg.lstsq(design, squared, rcond=None)[0]
    explained = 1.0 - float(np.var(left)) / float(np.var(squared))
    return chi_squared_beyond(n_effective * max(explained, 0.0), over.shape[1])


def chi_squared_beyond(statistic: float, degrees: int) -> float:
    """Survival function of chi-squared with these degrees of freedom, a whole number.

    A finite sum (Abramowitz and Stegun, 26.4.4 and 26.4.5); loading `scipy.special` takes a fifth of a second.
    """
    half = 0.5 * statistic
    order = 0.5 * (degrees % 2)
    beyond = math.erfc(math.sqrt(half)) if degrees % 2 else 0.0
    # exp(-half) half^order / gamma(order + 1), summed over order = 1/2, 3/2, ... or 0, 1, ... below degrees / 2.
    term = math.exp(-half) * half**order / math.gamma(order + 1.0)
    while order < 0.5 * degrees:
        beyond += term
        order += 1.0
        term *= half / order
    return beyond


def _excess_kurtosis(values: Array) -> float:
    """Fourth central moment over the squared second, less the 3 of a normal distribution."""
    squares = (values - values.mean()) ** 2
    return float(np.mean(squares**2) / np.mean(squares) ** 2 - 3.0)


def _fast_to_slow(centred: Array, speed: Array) -> float:
    fast = speed > np.median(speed)
    slow = float(np.mean(centred[~fast] ** 2))
    return float(np.sqrt(np.mean(centred[fast] ** 2) / slow)) if fast.any() and slow > 0.0 else np.nan


def _repeating(comparison: Comparison) -> float:
    """Variance between phases of the cycle, corrected for the scatter from cycle to cycle, as a share of both."""
    test = comparison.test
    counted = test.counted
    cycles = whole_cycles(test.displacement[counted])
    if len(cycles) < _LEAST_CYCLES or not has_regular_cycles(test):
        return np.nan
    residual = comparison.residual[counted]
    phases = np.linspace(0.0, 1.0, _PHASES, endpoint=False)
    # The nearest samples: interpolation between two would reduce the noise.
    rows = np.array(
        [residual[np.rint(cycle.start + phases * (cycle.stop - cycle.start)).astype(int)] for cycle in cycles]
    )
    scatter = float(np.mean(np.var(rows, axis=0, ddof=1)))
    common = float(np.mean(rows.mean(axis=0) ** 2)) - scatter / len(rows)
    total = max(common, 0.0) + scatter
    return max(common, 0.0) / total if total > 0.0 else np.nan
