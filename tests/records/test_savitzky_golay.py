"""The Savitzky-Golay filter agrees with that of SciPy, also block by block."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import savgol_coeffs, savgol_filter

from mrwork.records.motion import savitzky_golay, weights


@pytest.mark.parametrize("derivative", [0, 1, 2])
@pytest.mark.parametrize("window", [5, 7, 21, 101, 301])
def test_it_is_the_filter_of_scipy(window: int, derivative: int) -> None:
    # 1/300 s gives weights whose halves differ by more than rounding, and are then summed in another order. The bits
    # agree with the same LAPACK; another one may change the last digits.
    for step in (1.0, 1e-3, 1.0 / 300.0):
        expected = savgol_coeffs(window, 3, deriv=derivative, delta=step)
        found = weights(window, 3, derivative=derivative, step=step)
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-13 * np.abs(expected).max())
        for n_time in (window, window + 1, 1000):
            signal = 1e-3 * np.cumsum(np.random.default_rng(n_time).standard_normal(n_time))
            expected = savgol_filter(signal, window, 3, deriv=derivative, delta=step)
            found = savitzky_golay(signal, window, 3, derivative=derivative, step=step)
            np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max())


def test_polynomials_of_its_order_are_differentiated_exactly_up_to_the_ends() -> None:
    time = 0.01 * np.arange(50)
    for derivative in range(3):
        np.testing.assert_allclose(
            savitzky_golay(np.polyval([2.0, -1.0, 0.5, 3.0], time), 9, 3, derivative=derivative, step=0.01),
            np.polyval(np.polyder([2.0, -1.0, 0.5, 3.0], derivative), time),
            rtol=1e-9,
            atol=1e-9,
        )


def test_a_long_signal_gets_the_bits_of_its_parts() -> None:
    # The sums are formed block by block; 20000 samples are several blocks.
    signal = np.cumsum(np.random.default_rng(1).standard_normal(20_000))
    whole = savitzky_golay(signal, 31, 3, derivative=1)
    for first in (0, 5000, 13_000):
        part = savitzky_golay(signal[first : first + 7000], 31, 3, derivative=1)
        np.testing.assert_array_equal(part[15:-15], whole[first + 15 : first + 6985])
