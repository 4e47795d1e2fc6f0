"""Savitzky-Golay filter in NumPy: `scipy.signal`, which has it too, takes a second to load.

The sums run in the order of SciPy's, so that both give the same bits.
"""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def weights(window: int, order: int, *, derivative: int = 0, step: float = 1.0) -> Array:
    """Weights of a derivative at the centre of a window, shape (window,), to be convolved with the signal.

    The least-norm solution of the conditions that polynomials up to `order` are differentiated exactly (Savitzky,
    Golay, Analytical Chemistry 36, 1964, 1627-1639).
    """
    half = window // 2
    powers = np.arange(half, -half - 1.0, -1.0) ** np.arange(order + 1.0)[:, None]
    wanted = np.zeros(order + 1)
    wanted[derivative] = factorial(derivative) / step**derivative
    return np.asarray(np.linalg.lstsq(powers, wanted, rcond=None)[0])


def savitzky_golay(
    signal: Array, window: int, order: int, *, derivative: int = 0, step: float = 1.0
) -> Array:
    """Derivative of a signal, shape (n_time,), from polynomials of `order` fitted to `window` samples about each.

    Half a window from either end it is that of the polynomial of the outermost window. `window` is odd, above `order`
    and at most n_time.
    """
    half = window // 2
    result = np.empty_like(signal)
    result[half : signal.size - half] = _inner_sums(
        signal, weights(window, order, derivative=derivative, step=step)
    )
    at = np.arange(float(window))

    def beyond(outermost: Array, at_which: Array) -> Array:
        polynomial = np.polyder(np.polyfit(at, outermost, order), derivative)
        return np.asarray(np.polyval(polynomial, at_which) / step**derivative)

    result[:half] = beyond(signal[:window], at[:half])
    result[signal.size - half :] = beyond(signal[-window:], at[window - half :])
    return result


def _inner_sums(signal: Array, weights: Array) -> Array:
    """Convolution of a signal with as many weights as a window has, wherever the whole window lies within it."""
    half = weights.size // 2
    n_inner = signal.size - 2 * half
    along = weights[::-1]

    def shifted(by: int) -> Array:
        return signal[half + by : half + by + n_inner]

    # Weights that are even or odd to rounding are taken as such, as in `scipy.ndimage.correlate1d`.
    if np.all(np.abs(weights - along) <= np.finfo(float).eps):
        total = shifted(0) * along[half]
        for by in range(-half, 0):
            total += (shifted(by) + shifted(-by)) * along[half + by]
    elif np.all(np.abs(weights + along)[:half] <= np.finfo(float).eps):
        total = shifted(0) * along[half]
        for by in range(-half, 0):
            total += (shifted(by) - shifted(-by)) * along[half + by]
    else:
        total = shifted(half) * along[-1]
        for by in range(-half, half):
            total += shifted(by) * along[half + by]
    return np.asarray(total)
