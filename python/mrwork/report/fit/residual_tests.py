"""Tests of residuals: whiteness, constant variance, and the share that repeats in every cycle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.records.motion import whole_cycles
from mrwork.report.comparison import Comparison
from mrwork.uncertainty.autocorrelation import effective_samples
from mrwork.uncertainty.bands.prediction import has_regular_cycles

Array = NDArray[np.float64]

# Lags of the Ljung-Box test, and the significance level of both tests.
LAGS = 10
LEVEL = 0.01
# Phases of a cycle at which residuals are compared from cycle to cycle, and the least number of cycles for that.
_PLACES = 256
_LEAST_CYCLES = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class ResidualTests:
    """Statistics of the residuals of one test, without units; NaN where one cannot be computed.

    `white_p` is the probability of so much autocorrelation in white noise (Ljung and Box, Biometrika 65, 1978,
    297-303), `even_p` that of squared residuals so different over speed and stroke in noise of one size (Breusch and
    Pagan, Econometrica 47, 1979, 1287-1294, as Koenker has it), the `n_time` residuals counted as `n_effective`.
    `fast_to_slow` is the RMS residual in the faster half of the samples over that in the slower half, `excess` the
    excess kurtosis, 0 for normal residuals. `repeating` is the share of the mean square that every cycle has alike.
    """

    lag_one: float
    white_p: float
    even_p: float
    fast_to_slow: float
    excess: float
    repeating: float
    n_time: int
    n_effective: float

    @property
    def is_white(self) -> bool:
        """Whether the Ljung-Box test does not reject white noise."""
        return not self.white_p < LEVEL

    @property
    def is_even(self) -> bool:
        """Whether the Breusch-Pagan test does not reject a constant variance."""
        return not self.even_p < LEVEL


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
        white_p=_ljung_box(rho, residual.size) if varies else np.nan,
        even_p=_breusch_pagan(centred**2, np.stack([speed, stroke], axis=1), n_effective)
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
    return _chi_squared_beyond(statistic, LAGS)


def _breusch_pagan(squared: Array, over: Array, n_effective: float) -> float:
    """A regression explains a share R^2 of the squared residuals: n R^2 is chi-squared where it should be none."""
    design = np.column_stack([np.ones(squared.size), over / over.max(axis=0)])
    left = squared - design @ np.linalg.lstsq(design, squared, rcond=None)[0]
    explained = 1.0 - float(np.var(left)) / float(np.var(squared))
    return _chi_squared_beyond(n_effective * max(explained, 0.0), over.shape[1])


def _chi_squared_beyond(statistic: float, degrees: int) -> float:
    """Probability that chi-squared with so many degrees of freedom is larger."""
    from scipy.special import chdtrc  # `scipy.stats` takes four times as long to load

    return float(chdtrc(degrees, statistic))


def _excess_kurtosis(values: Array) -> float:
    """Fourth central moment over the squared second, less the 3 of a normal distribution."""
    squares = (values - values.mean()) ** 2
    return float(np.mean(squares**2) / np.mean(squares) ** 2 - 3.0)


def _fast_to_slow(centred: Array, speed: Array) -> float:
    fast = speed > np.median(speed)
    slow = float(np.mean(centred[~fast] ** 2))
    return float(np.sqrt(np.mean(centred[fast] ** 2) / slow)) if fast.any() and slow > 0.0 else np.nan


def _repeating(comparison: Comparison) -> float:
    """Variance between places of the cycle, corrected for the scatter from cycle to cycle, as a share of both."""
    test = comparison.test
    counted = test.counted
    cycles = whole_cycles(test.displacement[counted])
    if len(cycles) < _LEAST_CYCLES or not has_regular_cycles(test):
        return np.nan
    residual = comparison.residual[counted]
    places = np.linspace(0.0, 1.0, _PLACES, endpoint=False)
    # The nearest samples: between two of them noise would be smaller than it is.
    rows = np.array(
        [residual[np.rint(cycle.start + places * (cycle.stop - cycle.start)).astype(int)] for cycle in cycles]
    )
    scatter = float(np.mean(np.var(rows, axis=0, ddof=1)))
    common = float(np.mean(rows.mean(axis=0) ** 2)) - scatter / len(rows)
    total = max(common, 0.0) + scatter
    return max(common, 0.0) / total if total > 0.0 else np.nan
