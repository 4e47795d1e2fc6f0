"""How many independent samples a record's residuals are worth."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.errors import SettingError
from mrwork.records import DamperTest


def autocorrelation_time(residual: ArrayLike) -> float:
    """Integrated autocorrelation time of a series, shape (n_time,), in samples; 1 where samples are independent.

    `tau = 1 + 2 sum_k rho_k` over the initial positive sequence: pairs `rho_2m + rho_2m+1`, until the first that is not
    positive (Geyer, Statistical Science 7, 1992, 473-483). The correlation is about zero, not about the mean: a mean
    that a model leaves is its error. Samples that alternate count as independent, no better.

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
    covariance = np.fft.irfft(spectrum.real**2 + spectrum.imag**2, 2 * n_time)[:n_time]
    if covariance[0] == 0.0:
        return 1.0
    rho = covariance / covariance[0]
    pairs = rho[0 : n_time // 2 * 2 : 2] + rho[1::2]
    positive = pairs > 0.0
    length = len(pairs) if positive.all() else int(np.argmin(positive))
    return max(2.0 * float(pairs[:length].sum()) - 1.0, 1.0)


def effective_samples(residuals: Iterable[ArrayLike]) -> float:
    """Effective number of samples of all tests together, from the residuals of each, shape (n_counted,)."""
    return float(sum(np.size(each) / autocorrelation_time(each) for each in residuals))


def residuals_by_test(
    residuals: NDArray[np.float64], tests: Sequence[DamperTest]
) -> tuple[NDArray[np.float64], ...]:
    """Residuals of an objective, shape (..., n_residuals), cut into those of its tests, shape (..., n_counted)."""
    ends = np.cumsum([test.n_time - test.n_settle for test in tests])
    return tuple(np.split(residuals, ends[:-1], axis=-1))
