"""How many independent samples the residuals of a record are worth.

One rule for all who ask: the tempering of a posterior, profiles, verdicts, plans, blocks of a cross-validation and the
residual tests of a report. It is n / tau with the integrated autocorrelation time tau, summed over the initial
monotone sequence of Geyer (1992). Sums of adjacent correlations fall with the lag in theory: one that rises is
chance, and counts as no more than the least before it. His initial positive sequence, the other candidate, counts such
sums in full, and so took residuals that are nearly white for a third less than they are worth.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.errors import SettingError
from mrwork.records import DamperTest


def autocorrelation_time(residual: ArrayLike) -> float:
    """Integrated autocorrelation time of a series, shape (n_time,), in samples; 1 where samples are independent.

    `tau = 1 + 2 sum_k rho_k` over the initial monotone sequence: pairs `rho_2m + rho_2m+1`, each no larger than those
    before it, until the first that is not positive (Geyer, Statistical Science 7, 1992, 473-483). The correlation is
    about zero, not about the mean: a mean that a model leaves is its error. Samples that alternate count as
    independent, no better.

    A residual that repeats with the excitation is cut at its first change of sign, so each cycle counts anew although
    it tells the same: the time is a lower limit there.

    Raises
    ------
    SettingError
        Where the series is not one row of finite numbers.
    """
    series = np.asarray(residual, dtype=np.float64)
    if series.ndim != 1 or series.size == 0 or not np.all(np.isfinite(series)):
        raise SettingError(
            f"`residual` has shape {series.shape}; one row of finite numbers is expected, test by test"
        )
    n_time = series.size
    # Padded, so that the end does not meet the beginning.
    spectrum = np.fft.rfft(series, 2 * n_time)
    covariance = np.fft.irfft(np.abs(spectrum) ** 2, 2 * n_time)[:n_time]
    if covariance[0] == 0.0:
        return 1.0
    rho = covariance / covariance[0]
    pairs = rho[: n_time - n_time % 2].reshape(-1, 2).sum(axis=1)
    negative = np.flatnonzero(pairs <= 0.0)
    positive = pairs[: negative[0]] if negative.size else pairs
    return max(2.0 * float(np.minimum.accumulate(positive).sum()) - 1.0, 1.0)


def effective_samples(residuals: Iterable[ArrayLike]) -> float:
    """Effective number of samples of all tests together, from the residuals of each, shape (n_counted,)."""
    return float(sum(np.size(each) / autocorrelation_time(each) for each in residuals))


def residuals_by_test(
    residuals: NDArray[np.float64], tests: Sequence[DamperTest]
) -> tuple[NDArray[np.float64], ...]:
    """Residuals of an objective, shape (..., n_residuals), cut into those of its tests, shape (..., n_counted)."""
    ends = np.cumsum([test.n_time - test.n_settle for test in tests])
    return tuple(np.split(residuals, ends[:-1], axis=-1))
