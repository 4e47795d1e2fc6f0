"""Effective number of independent samples among the residuals of a record.

One rule is used everywhere: standard errors, tempering of a posterior, profiles, verdicts, plans, blocks of a
cross-validation and the residual tests of a report. It is n / tau with the integrated autocorrelation time tau, summed
over the initial monotone sequence of Geyer (1992). In theory the sums of adjacent correlations decrease with the lag;
one that increases is chance, and counts as the least before it. Geyer's initial positive sequence counts such sums in
full, and estimated a third too few samples for nearly white residuals.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.errors import SettingError
from mrwork.records import DamperTest


def autocorrelation_time(residual: ArrayLike) -> float:
    """Integrated autocorrelation time of a series, shape (n_time,), in samples; 1 for independent samples.

    `tau = 1 + 2 sum_k rho_k` over the initial monotone sequence: pairs `rho_2m + rho_2m+1`, each no larger than those
    before it, until the first that is not positive (Geyer, Statistical Science 7, 1992, 473-483). The correlation is
    about zero, not about the mean, because the mean residual is model error. Alternating samples count as
    independent, not as more.

    The sum for a residual that repeats with the excitation ends at its first change of sign, so that repeated cycles
    count as independent: the time is a lower limit there.
    """
    series = np.asarray(residual, dtype=np.float64)
    if series.ndim != 1 or series.size == 0 or not np.all(np.isfinite(series)):
        raise SettingError(
            f"`residual` has shape {series.shape}; one row of finite numbers is expected, test by test"
        )
    n_time = series.size
    # Zero-padded, so that the correlation is not circular.
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
    """Effective number of samples of all tests, from the residuals of each, shape (n_counted,)."""
    return float(sum(np.size(each) / autocorrelation_time(each) for each in residuals))


def residuals_by_test(
    residuals: NDArray[np.float64], tests: Sequence[DamperTest]
) -> tuple[NDArray[np.float64], ...]:
    """Residuals of an objective, shape (..., n_residuals), divided into those of its tests, shape (..., n_counted)."""
    ends = np.cumsum([test.n_counted for test in tests])
    return tuple(np.split(residuals, ends[:-1], axis=-1))
