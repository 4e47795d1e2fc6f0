"""Properties of a sampled motion: dominant frequency, band, smoothed derivatives, cycles and turning points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from math import factorial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats, array_dataclass


# Tests of one rig have few windows and steps, and each has several derivatives.
@lru_cache(maxsize=16)
def weights(window: int, order: int, *, derivative: int = 0, step: float = 1.0) -> Floats:
    """Savitzky-Golay weights of a derivative at the centre of a window, shape (window,), to convolve with the signal.

    Least-norm solution of the conditions that polynomials up to `order` are differentiated exactly (Savitzky,
    Golay, Analytical Chemistry 36, 1964, 1627-1639).
    """
    half = window // 2
    powers = np.arange(half, -half - 1.0, -1.0) ** np.arange(order + 1.0)[:, None]
    wanted = np.zeros(order + 1)
    wanted[derivative] = factorial(derivative) / step**derivative
    solution = np.asarray(np.linalg.lstsq(powers, wanted, rcond=None)[0])
    solution.setflags(write=False)
    return solution


def savitzky_golay(
    signal: Floats, window: int, order: int, *, derivative: int = 0, step: float = 1.0
) -> Floats:
    """Savitzky-Golay derivative of a signal, shape (n_time,): polynomials of `order` fitted to `window` samples each.

    Near the ends, the polynomial of the outermost window is used. In NumPy because `scipy.signal` takes a second to
    load.
    """
    half = window // 2
    n_inner = signal.size - 2 * half
    weight = weights(window, order, derivative=derivative, step=step)
    # In pairs, so that the odd derivative of a constant is exactly zero.
    pair = np.subtract if derivative % 2 else np.add
    inner = weight[half] * signal[half : half + n_inner]
    for by in range(half, 0, -1):
        inner += weight[half + by] * pair(signal[half - by :][:n_inner], signal[half + by :][:n_inner])
    result = np.empty_like(signal)
    result[half : signal.size - half] = inner
    at = np.arange(float(window))

    def beyond(outermost: Floats, at_which: Floats) -> Floats:
        polynomial = np.polyder(np.polyfit(at, outermost, order), derivative)
        return np.asarray(np.polyval(polynomial, at_which) / step**derivative)

    result[:half] = beyond(signal[:window], at[:half])
    result[signal.size - half :] = beyond(signal[-window:], at[window - half :])
    return result


_ORDER: Final = 3
_BAND_POWER: Final = 0.999
# A cubic Savitzky-Golay derivative over a window of half width m [s] has a relative error of (omega m)^4 / 504 for
# a sine of angular frequency omega. A window of 0.15 periods (omega m = 0.47) keeps that below 1e-4.
_WINDOW_PERIODS: Final = 0.15


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionBand:
    """Dominant frequency (largest Fourier component), and band edge below which 99.9 % of the power lies [Hz]."""

    dominant: float
    band_edge: float


def spectrum(displacement: Floats, dt: float) -> MotionBand:
    """Dominant frequency and band edge of a displacement, shape (n_time,), sampled every `dt` [s]."""
    # The Hann taper reduces spectral leakage in records with incomplete cycles.
    tapered = (displacement - displacement.mean()) * np.hanning(displacement.size)
    power = np.abs(np.fft.rfft(tapered)) ** 2
    power[0] = 0.0
    frequency = np.fft.rfftfreq(displacement.size, dt)
    share = np.cumsum(power) / power.sum()
    return MotionBand(
        dominant=float(frequency[1 + int(np.argmax(power[1:]))]),
        band_edge=float(frequency[int(np.searchsorted(share, _BAND_POWER))]),
    )


@dataclass(frozen=True, slots=True)
class Differentiator:
    """How velocity and acceleration follow from a displacement: cubic Savitzky-Golay filter over `window` samples.

    Samples are `dt` [s] apart. The window covers 0.15 periods of the band edge, but at least 5 samples: the longest
    window, with the least noise, for which the derivative within the band of the motion is accurate to 1e-4.
    """

    window: int
    dt: float

    @classmethod
    def of(cls, displacement: Floats, dt: float, band: MotionBand | None = None) -> Differentiator:
        """That of a displacement, shape (n_time,), of at least 5 samples, whose band may be known."""
        edge = (band or spectrum(displacement, dt)).band_edge
        half = int(0.5 * _WINDOW_PERIODS / (edge * dt))
        return cls(window=2 * min(max(half, 2), (displacement.size - 1) // 2) + 1, dt=dt)

    @property
    def in_words(self) -> str:
        """Kind of the filter and length of its window, in samples and milliseconds."""
        return (
            f"a cubic Savitzky-Golay filter over {self.window} samples ({1e3 * self.window * self.dt:.3g} ms)"
        )

    def smooth(self, signal: Floats) -> Floats:
        """The smoothed signal, of the same shape."""
        return savitzky_golay(signal, self.window, _ORDER)

    def derivative(self, signal: Floats, order: int = 1) -> Floats:
        """Time derivative of the smoothed signal, of the same shape, in its unit per s^`order`."""
        return savitzky_golay(signal, self.window, _ORDER, derivative=order, step=self.dt)

    def noise(self, removed: Floats) -> float:
        """Standard deviation of the white noise of a signal, estimated from the part that `smooth` removed."""
        # A least-squares smoother with centre weight c0 removes the fraction 1 - c0 of the variance of the noise.
        return float(np.sqrt(np.var(removed) / (1.0 - self._weights(0)[self.window // 2])))

    def noise_gain(self, order: int) -> float:
        """Standard deviation of `derivative` (order 0: `smooth`) per unit standard deviation of white noise."""
        return float(np.sqrt(np.sum(self._weights(order) ** 2)))

    def _weights(self, order: int) -> Floats:
        return weights(self.window, _ORDER, derivative=order, step=self.dt)


@array_dataclass()
class SmoothMotion:
    """Smoothed motion: displacement [m], velocity [m/s], acceleration [m/s^2], shape (n_time,).

    `frequency` is the dominant frequency [Hz].
    """

    displacement: Floats
    velocity: Floats
    acceleration: Floats
    frequency: float
    differentiator: Differentiator


def smooth_motion(displacement: Floats, dt: float) -> SmoothMotion:
    """Smooth a displacement with step `dt` [s], and differentiate it."""
    band = spectrum(displacement, dt)
    differentiator = Differentiator.of(displacement, dt, band)
    return SmoothMotion(
        displacement=differentiator.smooth(displacement),
        velocity=differentiator.derivative(displacement),
        acceleration=differentiator.derivative(displacement, order=2),
        frequency=band.dominant,
        differentiator=differentiator,
    )


# A crossing counts only after the displacement was beyond this fraction of its standard deviation on the other side,
# so that noise around the mean does not count as cycles.
_DEAD_BAND: Final = 0.5
# A reversal counts only between velocities beyond this share of the largest.
_LEAST_SPEED: Final = 0.05
# Turning points closer than this fraction of the peak-to-peak displacement are ignored.
_LEAST_STROKE: Final = 0.5


def upward_crossings(displacement: Floats) -> NDArray[np.intp]:
    """Samples of the upward crossings of the mean displacement, shape (n_crossings,)."""
    centred = displacement - np.mean(displacement)
    side = np.where(np.abs(centred) < _DEAD_BAND * np.std(centred), 0.0, np.sign(centred))
    decided = np.flatnonzero(side)
    turns = decided[1:][(side[decided[:-1]] < 0) & (side[decided[1:]] > 0)]
    upward = np.flatnonzero((centred[:-1] < 0) & (centred[1:] >= 0)) + 1
    if turns.size == 0 or upward.size == 0:
        return np.empty(0, dtype=np.intp)
    nearest = np.searchsorted(upward, turns, side="right") - 1
    return upward[nearest[nearest >= 0]]


def cycle_lengths(displacement: Floats) -> Floats:
    """Lengths of the complete cycles, shape (n_cycles,), in samples: crossings are interpolated between two of them."""
    return np.diff(_crossing_instants(displacement))


def half_cycle_lengths(displacement: Floats) -> Floats:
    """Lengths between crossings of either direction, shape (n_half_cycles,), in samples."""
    return np.diff(np.sort(np.append(_crossing_instants(displacement), _crossing_instants(-displacement))))


def _crossing_instants(displacement: Floats) -> Floats:
    crossings = upward_crossings(displacement)
    centred = displacement - np.mean(displacement)
    after = centred[crossings]
    return np.asarray(crossings - after / (after - centred[crossings - 1]))


def whole_cycles(displacement: Floats) -> tuple[slice, ...]:
    """Samples of each complete cycle, from one upward crossing to the next."""
    return tuple(slice(int(first), int(last)) for first, last in pairwise(upward_crossings(displacement)))


def regular_cycles(displacement: Floats) -> tuple[slice, ...]:
    """The whole cycles of a periodic motion, equal within 5 % in length and 20 % in stroke; none of any other."""
    cycles = whole_cycles(displacement)
    if len(cycles) < 2:
        return ()
    lengths = np.array([cycle.stop - cycle.start for cycle in cycles])
    strokes = np.array([np.ptp(displacement[cycle]) for cycle in cycles])
    # Either end of a cycle may be off by one sample.
    regular = np.ptp(lengths) <= 0.05 * lengths.mean() + 2 and np.ptp(strokes) <= 0.2 * strokes.mean()
    return cycles if regular else ()


def turning_points(displacement: Floats, velocity: Floats) -> tuple[Floats, Floats]:
    """Turning points between strokes of at least half the peak-to-peak displacement, shape (n_turns,).

    Returned are the instants of zero velocity, in fractional samples, and the signs of the velocity before.
    """
    # Of the signs, because a product of tiny numbers is zero.
    side = np.sign(velocity)
    before = np.flatnonzero((side[:-1] != 0.0) & (side[:-1] * side[1:] <= 0.0))
    turn = before + velocity[before] / (velocity[before] - velocity[before + 1])
    stroke = np.diff(np.interp(turn, np.arange(displacement.size), displacement))
    wide = np.abs(stroke) > _LEAST_STROKE * np.ptp(displacement)
    chosen = np.flatnonzero(wide[:-1] & wide[1:]) + 1
    return turn[chosen], np.sign(velocity[before[chosen]])


def reversals(velocity: Floats) -> NDArray[np.intp]:
    """Samples at which the motion reverses, shape (n_reversals,): midway between velocities of either sign [m/s]."""
    moving = np.flatnonzero(np.abs(velocity) > _LEAST_SPEED * np.max(np.abs(velocity), initial=0.0))
    turns = np.flatnonzero(np.diff(np.sign(velocity[moving])))
    return np.asarray((moving[turns] + moving[turns + 1] + 1) // 2)
