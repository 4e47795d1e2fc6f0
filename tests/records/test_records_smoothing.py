"""A moving average is detected with its window, others have no remark; the filter agrees with that of SciPy."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import savgol_coeffs, savgol_filter

import mrwork as mr
from mrwork.records.checks import detect_average, detect_smoothing
from mrwork.records.motion import Differentiator, savitzky_golay, smooth_motion, weights
from mrwork.records.reading import SYNTHETIC_TESTS, synthetic_test

Samples = NDArray[np.float64]


def averaged(samples: NDArray[np.float64], n_window: int) -> NDArray[np.float64]:
    return np.convolve(samples, np.full(n_window, 1.0 / n_window), mode="valid")


@pytest.mark.parametrize("name", SYNTHETIC_TESTS)
@pytest.mark.parametrize("n_window", [4, 7, 20, 50, 90])
def test_the_window_of_a_moving_average_is_found_to_the_sample(name: str, n_window: int) -> None:
    test = synthetic_test(name)
    smoothed = replace(
        test,
        displacement=averaged(test.displacement, n_window),
        velocity=test.velocity[n_window - 1 :],
        force=averaged(test.force, n_window),
    )
    found = detect_smoothing(smoothed)
    assert found is not None
    assert found.window_seconds == n_window * test.dt
    assert found.channels == ("force", "displacement")


def test_rounding_after_the_average_does_not_hide_it() -> None:
    test = synthetic_test("spencer1997")
    force = 0.05 * np.round(averaged(test.force, 40) / 0.05)
    assert detect_average(force) == 40


def test_a_long_record_of_any_length_is_searched() -> None:
    # 99 991 is a prime number; the last samples are left out, so that the transform is fast.
    noise = np.random.default_rng(3).standard_normal(99_991 + 2 + 49)
    assert detect_average(averaged(noise, 50)) == 50
    assert detect_average(noise) is None


def test_only_the_channel_that_was_averaged_is_named() -> None:
    test = synthetic_test("rd1005_1a")
    found = detect_smoothing(replace(test, force=averaged(np.pad(test.force, (15, 15), mode="wrap"), 31)))
    assert found is not None
    assert found.channels == ("force",)


@pytest.mark.parametrize("n_time", [300, 2000, 9000])
@pytest.mark.parametrize("colour", ["white", "red", "low-pass", "square wave"])
def test_noise_of_any_colour_raises_no_alarm(colour: str, n_time: int) -> None:
    from scipy.signal import butter, lfilter

    rng = np.random.default_rng(n_time)
    for _ in range(10):
        white = rng.standard_normal(n_time)
        samples = {
            "white": white,
            "red": np.cumsum(white),
            "low-pass": lfilter(*butter(4, 0.3), white) + 1e-5 * rng.standard_normal(n_time),
            "square wave": np.tanh(5.0 * np.sin(0.11 * np.arange(n_time))) + 0.01 * white,
        }[colour]
        assert detect_average(samples) is None


def test_a_record_too_short_to_tell_is_left_alone() -> None:
    assert detect_average(np.random.default_rng(0).standard_normal(12)) is None


def test_an_arc_without_noise_has_no_moving_average() -> None:
    time = 0.01 * np.arange(150)
    test = mr.test_from_arrays(
        name="line", time=time, displacement=0.01 * np.sin(6.0 * time), force=np.arange(150.0)
    )
    assert test.smoothing is None


@pytest.mark.parametrize("derivative", [0, 1, 2])
@pytest.mark.parametrize("window", [5, 7, 21, 101, 301])
def test_it_is_the_filter_of_scipy(window: int, derivative: int) -> None:
    # 1/300 s gives weights whose halves differ by more than rounding, and are then summed in another order. SciPy
    # solves for fifth powers of the sample's number, which loses digits with the window; the next test is exact.
    order, tolerance = 3 if window == 5 else 5, 1e-11 * max(1.0, window / 21.0) ** 5
    for step in (1.0, 1e-3, 1.0 / 300.0):
        expected = savgol_coeffs(window, order, deriv=derivative, delta=step)
        found = weights(window, derivative=derivative, step=step)
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=tolerance * np.abs(expected).max())
        for n_time in (window, window + 1, 1000):
            signal = 1e-3 * np.cumsum(np.random.default_rng(n_time).standard_normal(n_time))
            expected = savgol_filter(signal, window, order, deriv=derivative, delta=step)
            found = savitzky_golay(signal, window, derivative=derivative, step=step)
            np.testing.assert_allclose(found, expected, rtol=0.0, atol=tolerance * np.abs(expected).max())


def test_polynomials_of_its_order_are_differentiated_exactly_up_to_the_ends() -> None:
    time, quintic = 0.002 * np.arange(500), [4.0, -3.0, 2.0, -1.0, 0.5, 3.0]
    for derivative, window in product(range(3), (9, 301)):
        np.testing.assert_allclose(
            savitzky_golay(np.polyval(quintic, time), window, derivative=derivative, step=0.002),
            np.polyval(np.polyder(quintic, derivative), time),
            rtol=1e-7,
            atol=1e-7,
        )


def test_a_long_signal_gets_the_bits_of_its_parts() -> None:
    # The sums are formed block by block; 20000 samples are several blocks.
    signal = np.cumsum(np.random.default_rng(1).standard_normal(20_000))
    whole = savitzky_golay(signal, 31, derivative=1)
    for first in (0, 5000, 13_000):
        part = savitzky_golay(signal[first : first + 7000], 31, derivative=1)
        np.testing.assert_array_equal(part[15:-15], whole[first + 15 : first + 6985])


TAU = 2.0 * np.pi


def of_sines(t: Samples, *parts: tuple[float, float]) -> tuple[Samples, Samples]:
    """Displacement and velocity of amplitudes [m] and frequencies [Hz]."""
    moved = np.array([a * np.sin(TAU * f * t) for a, f in parts]).sum(axis=0)
    return moved, np.array([a * TAU * f * np.cos(TAU * f * t) for a, f in parts]).sum(axis=0)


def of_sweep(t: Samples) -> tuple[Samples, Samples]:
    phase = TAU * (0.2 * t + 0.2 * t**2)
    return 5e-3 * np.sin(phase), 5e-3 * TAU * (0.2 + 0.4 * t) * np.cos(phase)


def of_drop(t: Samples) -> tuple[Samples, Samples]:
    s = np.maximum(t - 0.2, 0.0)
    waves, slopes = (
        np.cos(15.0 * s) + 0.4 * np.sin(15.0 * s),
        6.0 * np.cos(15.0 * s) - 15.0 * np.sin(15.0 * s),
    )
    return 0.15 * (1.0 - np.exp(-6.0 * s) * waves), 0.15 * np.exp(-6.0 * s) * (6.0 * waves - slopes)


def of_steps(t: Samples) -> tuple[Samples, Samples]:
    """A slow large motion, then a fast small one."""
    slow, fast = of_sines(t, (0.025, 0.2)), of_sines(t - 10.0, (5e-4, 5.0))
    return np.where(t < 10.0, slow[0], fast[0]), np.where(t < 10.0, slow[1], fast[1])


def of_ramp(t: Samples) -> tuple[Samples, Samples]:
    """20 mm at 100 mm/s, and rest for most of the time."""
    return np.interp(t, [1.0, 1.2], [0.0, 0.02]), np.where((t >= 1.0) & (t < 1.2), 0.1, 0.0)


WITH_TRUTH: dict[str, Callable[[Samples], tuple[Samples, Samples]]] = {
    "sine": lambda t: of_sines(t, (0.02, 0.5)),
    "slow and fast at once": lambda t: of_sines(t, (0.025, 0.1), (7e-4, 5.0)),
    "slow, then fast": of_steps,
    "sweep": of_sweep,
    "drop": of_drop,
    "ramp": of_ramp,
}


def errors(
    motion: str, rate: int, noise: float, quantum: float, part: slice = slice(None)
) -> tuple[float, float]:
    """Root mean square errors of the velocity that is derived, and of that by the best cubic window."""
    time = np.arange(0.0, 12.0, 1.0 / rate)
    displacement, velocity = WITH_TRUTH[motion](time)
    displacement = displacement + noise * np.random.default_rng(rate).standard_normal(time.size)
    displacement = quantum * np.round(displacement / quantum)
    windows = np.unique(2 * np.geomspace(2, time.size / 8, 30).round().astype(int) + 1)
    cubics = (savgol_filter(displacement, window, 3, deriv=1, delta=1.0 / rate) for window in windows)
    derived = Differentiator.of(displacement, 1.0 / rate).derivative(displacement)
    left = [np.sqrt(np.mean((each - velocity)[part] ** 2)) for each in (derived, *cubics)]
    return float(left[0]), float(min(left[1:]))


@pytest.mark.parametrize("motion", WITH_TRUTH)
@pytest.mark.parametrize(
    ("rate", "noise", "quantum"),
    [(200, 1e-5, 1e-7), (1000, 2e-6, 1e-7), (1000, 1e-4, 1e-7), (1000, 0.0, 1e-5), (1000, 0.0, 4.7e-5)],
)
def test_its_velocity_is_about_as_good_as_that_of_the_best_cubic_window(
    motion: str, rate: int, noise: float, quantum: float
) -> None:
    derived, least = errors(motion, rate, noise, quantum)
    # Noise of rounding is not white.
    assert derived <= (1.03 if noise > 0.0 else 1.1) * least


@pytest.mark.parametrize("part", [slice(200, 9500), slice(10_500, 11_800)])
def test_each_part_of_a_record_has_about_the_velocity_of_its_own_best_window(part: slice) -> None:
    derived, least = errors("slow, then fast", 1000, 1e-5, 1e-7, part)
    assert derived <= least


@pytest.mark.parametrize(("frequency", "rate"), [(0.5, 50.0), (1.0, 500.0), (2.5, 500.0), (4.0, 1000.0)])
def test_the_acceleration_is_as_large_as_that_of_the_motion(frequency: float, rate: float) -> None:
    omega, time = 2.0 * np.pi * frequency, np.arange(0.0, 4.0 / frequency, 1.0 / rate)
    displacement = 0.008 * np.sin(omega * time)
    noise = 5e-6 * np.random.default_rng(0).standard_normal(time.size)
    inner = slice(time.size // 8, -(time.size // 8))
    true = -(omega**2) * displacement[inner]
    derived = smooth_motion(displacement + noise, 1.0 / rate).acceleration[inner]
    # A force m a is as wrong as this, and a mass that is found by it.
    assert derived @ true / (true @ true) == pytest.approx(1.0, abs=2e-3)
    assert np.std(derived - true) < 0.006 * np.std(true)
