"""How many independent samples correlated residuals are worth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def independent_samples(residual: NDArray[np.float64]) -> float:
    """Effective number of independent samples in `residual`, shape (n_time,).

    n / tau with tau = 1 + 2 sum of the autocorrelations, summed in pairs as long as these are positive and fall: the
    initial monotone sequence of Geyer (1992). Residuals are taken about zero, where those of a right model are.
    """
    n_time = residual.size
    spectrum = np.fft.rfft(residual, 2 * n_time)
    covariance = np.fft.irfft(np.abs(spectrum) ** 2)[:n_time]
    if covariance[0] <= 0.0:
        return float(n_time)
    rho = covariance / covariance[0]
    pairs = rho[: n_time - n_time % 2].reshape(-1, 2).sum(axis=1)
    negative = np.flatnonzero(pairs <= 0.0)
    positive = pairs[: negative[0]] if negative.size else pairs
    tau = 2.0 * float(np.minimum.accumulate(positive).sum()) - 1.0
    return float(np.clip(n_time / max(tau, 1.0), 1.0, n_time))
