"""Properties of a sampled motion: dominant frequency, band, smoothed derivatives, cycles and turning points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from math import comb, factorial
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats, array_dataclass

# Quintics have half the error of cubics on smooth motions, each at its best window, and the same at corners.
_ORDER: Final = 5
# Samples that stay in the processor's cache while all weights are applied.
_BLOCK: Final = 8192
# Longer windows to either side are applied by Fourier transform; a motion so noisy does not stand still exactly.
_LONG: Final = 128


def _powers(at: Floats) -> tuple[Floats, Floats]:
    """Powers of positions in a window, shape (window, n_powers), and their exponents: five samples have a cubic."""
    exponents = np.arange(min(_ORDER, at.size - 2) + 1.0)
    return at[:, np.newaxis] ** exponents, exponents


# Tests of one rig have few windows and steps, and each has several derivatives.
@lru_cache(maxsize=16)
def weights(window: int, *, derivative: int = 0, step: float = 1.0) -> Floats:
    """Savitzky-Golay weights of a derivative at the centre of a window, shape (window,), to convolve with the signal.

    Least-norm solution of the conditions that quintics (over five samples, cubics) are differentiated exactly
    (Savitzky, Golay, Analytical Chemistry 36, 1964, 1627-1639).
    """
    powers, exponents = _powers(np.linspace(1.0, -1.0, window))
    wanted = np.where(
        exponents == derivative, factorial(derivative) / (window // 2 * step) ** derivative, 0.0
    )
    solution = np.asarray(np.linalg.lstsq(powers.T, wanted, rcond=None)[0])
    solution.setflags(write=False)
    return solution


def savitzky_golay(signal: Floats, window: int, *, derivative: int = 0, step: float = 1.0) -> Floats:
    """Savitzky-Golay derivative of a signal, shape (n_time,): quintics fitted to `window` samples each, cubics to five.

    Near the ends, the polynomial of the outermost window is used. In NumPy because `scipy.signal` takes a second to
    load.
    """
    half = window // 2
    n_inner = signal.size - 2 * half
    weight = weights(window, derivative=derivative, step=step)
    # In pairs, so that the odd derivative of a constant is exactly zero.
    pair = np.subtract if derivative % 2 else np.add
    result = np.empty_like(signal)
    if half > _LONG:
        mean, size = signal.mean(), 1 << (signal.size - 1).bit_length()
        product = np.fft.rfft(signal - mean, size) * np.fft.rfft(weight, size)
        result[half:-half] = np.fft.irfft(product, size)[2 * half : signal.size] + mean * (derivative == 0)
    for begin in range(half, half + n_inner if half <= _LONG else 0, _BLOCK):
        end = min(begin + _BLOCK, half + n_inner)
        inner = weight[half] * signal[begin:end]
        for by in range(half, 0, -1):
            inner += weight[half + by] * pair(signal[begin - by : end - by], signal[begin + by : end + by])
        result[begin:end] = inner
    at = np.linspace(-1.0, 1.0, window)
    order = _powers(at)[1].size - 1

    def beyond(outermost: Floats, at_which: Floats) -> Floats:
        polynomial = np.polyder(np.polyfit(at, outermost, order), derivative)
        return np.asarray(np.polyval(polynomial, at_which) / (half * step) ** derivative)

    result[:half] = beyond(signal[:window], at[:half])
    result[signal.size - half :] = beyond(signal[-window:], at[window - half :])
    return result


# Half widths of windows that are compared with two thirds of themselves: of samples, and of means of 2, 4, 8, ... .
_OF_SAMPLES: Final[tuple[int, ...]] = (3, 6, 9, 12, 15)
_OF_MEANS: Final[tuple[int, ...]] = (9, 12, 15)
# A difference between windows is bias if it exceeds the noise of the derivative far, or it and the next two exceed that
# and a multiple of their standard error, and grow with the least power of the window: those of coloured noise fall.
_SIGNIFICANT: Final = 5.0
_FAR_BEYOND: Final = 30.0
_LEAST_GROWTH: Final = 0.5
_POWERS: Final = (1.0, 2.0 * (_ORDER + 1))
_MAD_TO_DEVIATION: Final = 1.4826
_DIFFERENCES: Final = 6
_WINDOWS_TRIED: Final = 400
# Ratio of the variances of the derivatives by cubics over five samples and by quintics over seven.
_CUBIC_NOISE: Final = 0.772


class _Shortened(NamedTuple):
    """Derivative over a window of `half` samples to either side, less that over two thirds of it, per sample.

    `inner`: weights within a record, shape (2 half + 1,). `ends`: those of its first `half` samples. Of white noise of
    unit variance, at an inner sample and summed over an end: `variance`, sum of its squared covariances, and variance
    `noise` of the derivative itself.
    """

    inner: Floats
    ends: Floats
    variance: Floats
    covariance: Floats
    noise: Floats


@lru_cache(maxsize=len({*_OF_SAMPLES, *_OF_MEANS}))
def _shortened(half: int) -> _Shortened:
    def slopes(half: int) -> Floats:
        at = np.linspace(-1.0, 1.0, 2 * half + 1)
        powers, exponents = _powers(at)
        rows = exponents * at[: half + 1, np.newaxis] ** (exponents - 1.0).clip(min=0.0) / half
        return np.asarray(rows @ np.linalg.pinv(powers))

    longer, shorter = slopes(half), slopes(half - half // 3)
    rows = longer.copy()
    for row in range(half + 1):
        from_end = min(row, shorter.shape[0] - 1)
        rows[row, row - from_end :][: shorter.shape[1]] -= shorter[from_end]
    ends, inner = rows[:half], rows[half]
    return _Shortened(
        inner=inner,
        ends=ends,
        variance=np.array([inner @ inner, np.sum(ends**2)]),
        covariance=np.array([np.sum(np.correlate(inner, inner, "full") ** 2), np.sum((ends @ ends.T) ** 2)]),
        noise=np.array([longer[half] @ longer[half], np.sum(longer[:half] ** 2)]),
    )


def _bias_and_noise(displacement: Floats) -> Floats:
    """Half widths, mean square difference from two thirds beyond noise, its error, noise; shape (4, n_windows).

    The noise is seen in sixth differences: of the samples, or of means over the repeats of a channel that repeats its
    values, as one that is quantised or held. All is per sample, without the step.
    """
    changes = np.flatnonzero(np.diff(displacement))
    span = int(np.median(np.diff(changes))) if changes.size > 1 else 1
    means = displacement[: displacement.size // span * span].reshape(-1, span).mean(axis=1)
    rough = np.abs(np.diff(means, _DIFFERENCES)) if means.size > _DIFFERENCES else np.zeros(1)
    level = _MAD_TO_DEVIATION * float(np.median(rough)) if span == 1 else 0.0
    level = level or float(np.sqrt(np.mean(rough**2)))
    rounding = float(np.finfo(np.float64).eps * np.ptp(displacement))
    variance = max(level**2 / comb(2 * _DIFFERENCES, _DIFFERENCES), rounding**2)
    windows, halves = list[tuple[float, ...]](), _OF_SAMPLES
    while True:
        for half in halves:
            n_inner = means.size - 2 * half
            if n_inner < 2 * half + 2:
                return np.array(windows).reshape(-1, 4).T
            of = _shortened(half)
            counts, every = np.array([n_inner, 2]), max(half // 4, 1)
            seen = np.zeros(-(-n_inner // every))
            for by in range(1, half + 1):
                later, earlier = (means[half + side : half + side + n_inner : every] for side in (by, -by))
                seen += of.inner[half + by] * (later - earlier)
            at_ends = [of.ends @ end[: 2 * half + 1] for end in (means, means[::-1])]
            square = n_inner * float(np.mean(seen**2)) + float(np.sum(np.square(at_ends)))
            beyond = square - variance * float(counts @ of.variance)
            error = variance * float(np.sqrt(2.0 * counts @ of.covariance))
            per_sample = 1.0 / (means.size * span**2)
            noise = variance * float(counts @ of.noise)
            windows.append((half * span, beyond * per_sample, error * per_sample, noise * per_sample))
        means = 0.5 * (means[: means.size // 2 * 2 : 2] + means[1::2])
        variance, span, halves = 0.5 * variance, 2 * span, _OF_MEANS


def best_window(displacement: Floats) -> int:
    """Window with the least mean square error of the velocity of a displacement, shape (n_time,): bias and noise.

    The squared bias is the mean square difference from the derivative over two thirds of the window, beyond noise,
    times 1 + 4.4 / p. That is the ratio, within 15 %, of velocities whose spectrum falls as f^-(p+1) and whose bias
    grows as window^p: 1 where the velocity jumps, 12 of a sine. Shorter windows than the first of significant bias have
    that of this power law.
    """
    half, beyond, error, noise = _bias_and_noise(displacement)
    if half.size < 4:
        return 5
    log_half, log_beyond = np.log(half), np.log(beyond.clip(min=np.finfo(np.float64).tiny))
    significant = beyond > np.maximum(_SIGNIFICANT * error, noise)
    grows = log_beyond[3:] - log_beyond[1:-2] > _LEAST_GROWTH * (log_half[3:] - log_half[1:-2])
    from_here = significant & (beyond > _FAR_BEYOND * noise)
    from_here[1:-2] |= significant[1:-2] & significant[2:-1] & significant[3:] & grows
    # The window of two thirds of the first one has cubics, which differ from its quintics by their own bias.
    if not from_here[1:-2].any():
        return 5 if from_here[0] else 2 * int(half[-1]) + 1
    first = 1 + int(np.argmax(from_here[1:-2]))
    # A bias stays with all longer windows; once the motion is gone from both windows, they differ less.
    log_bias = np.maximum.accumulate(log_beyond[first:])
    steps = log_half[first + 1 : first + 3] - log_half[first]
    power = float(np.clip(np.max((log_bias[1:3] - log_bias[0]) / steps), *_POWERS))
    tried = np.unique(np.geomspace(half[0], half[-1], _WINDOWS_TRIED).round())
    shorter = (log_half[first] - np.log(tried)).clip(min=0.0)
    bias = np.exp(np.interp(np.log(tried), log_half[first:], log_bias) - power * shorter)
    risk = (1.0 + 4.4 / power) * bias + np.exp(np.interp(np.log(tried), log_half, np.log(noise)))
    of_cubics = (1.0 + 4.4 / power) * max(beyond[0], 0.0) + _CUBIC_NOISE * noise[0]
    return 2 * int(tried[np.argmin(risk)] if risk.min() < of_cubics else half[0] * 2.0 / 3.0) + 1


_BAND_POWER: Final = 0.999


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
    """How velocity and acceleration follow from a displacement: quintic Savitzky-Golay filter over `window` samples.

    Samples are `dt` [s] apart.
    """

    window: int
    dt: float

    @classmethod
    def of(cls, displacement: Floats, dt: float) -> Differentiator:
        """That of a displacement, shape (n_time,), of at least 5 samples: see `best_window`."""
        return cls(window=best_window(displacement), dt=dt)

    @property
    def in_words(self) -> str:
        """Kind of the filter and length of its window, in samples and milliseconds."""
        return f"a quintic Savitzky-Golay filter over {self.window} samples ({1e3 * self.window * self.dt:.3g} ms)"

    def smooth(self, signal: Floats) -> Floats:
        """The smoothed signal, of the same shape."""
        return savitzky_golay(signal, self.window)

    def derivative(self, signal: Floats, order: int = 1) -> Floats:
        """Time derivative of the smoothed signal, of the same shape, in its unit per s^`order`."""
        return savitzky_golay(signal, self.window, derivative=order, step=self.dt)

    def noise(self, removed: Floats) -> float:
        """Standard deviation of the white noise of a signal, estimated from the part that `smooth` removed."""
        # A least-squares smoother with centre weight c0 removes the fraction 1 - c0 of the variance of the noise.
        return float(np.sqrt(np.var(removed) / (1.0 - self._weights(0)[self.window // 2])))

    def noise_gain(self, order: int) -> float:
        """Standard deviation of `derivative` (order 0: `smooth`) per unit standard deviation of white noise."""
        return float(np.sqrt(np.sum(self._weights(order) ** 2)))

    def _weights(self, order: int) -> Floats:
        return weights(self.window, derivative=order, step=self.dt)


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
    differentiator = Differentiator.of(displacement, dt)
    return SmoothMotion(
        displacement=differentiator.smooth(displacement),
        velocity=differentiator.derivative(displacement),
        acceleration=differentiator.derivative(displacement, order=2),
        frequency=spectrum(displacement, dt).dominant,
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
