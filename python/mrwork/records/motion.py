"""Properties of a sampled motion: dominant frequency, band, smoothed derivatives, cycles and turning points."""

from __future__ import annotations

from collections.abc import Callable
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
# Longer windows to either side are applied by Fourier transform.
_LONG: Final = 16


# A record has tens of windows at most, each with several derivatives.
@lru_cache(maxsize=128)
def _fit(window: int) -> Floats:
    """Coefficients of the polynomial fitted to unit samples, shape (n_coefficients, window), over [-1, 1]: quintics.

    Five samples have a cubic. Row d, times d! and divided by the half width to the power d, gives the derivatives at
    the centre (Savitzky, Golay, Analytical Chemistry 36, 1964, 1627-1639).
    """
    n_coefficients = min(_ORDER, window - 2) + 1
    powers = np.vander(np.linspace(-1.0, 1.0, window), n_coefficients, increasing=True)
    orthonormal, triangle = np.linalg.qr(powers)
    coefficients = np.linalg.solve(triangle, orthonormal.T)
    coefficients.setflags(write=False)
    return coefficients


def weights(window: int, *, derivative: int = 0, step: float = 1.0) -> Floats:
    """Savitzky-Golay weights of a derivative at the centre, shape (window,), to convolve with the signal."""
    return _fit(window)[derivative, ::-1] * (factorial(derivative) / (window // 2 * step) ** derivative)


def savitzky_golay(
    signal: Floats, window: int, *, derivative: int = 0, step: float = 1.0, part: slice = slice(None)
) -> Floats:
    """Savitzky-Golay derivative of a signal, shape (n_time,): quintics fitted to `window` samples each, cubics to five.

    Near the ends, the polynomial of the outermost window is used. `part`: samples of the result, if not all are wanted.
    In NumPy because `scipy.signal` takes a second to load.
    """
    half, (begin, end, _) = window // 2, part.indices(signal.size)
    last_window, last_inner = signal.size - window, signal.size - half
    inner = max(begin, half), min(end, last_inner)
    result = np.empty(end - begin)
    weight = weights(window, derivative=derivative, step=step)
    # In pairs, so that the odd derivative of a constant is exactly zero.
    pair = np.subtract if derivative % 2 else np.add
    if half > _LONG:
        size = 1 << (min(end - begin + window, max(_BLOCK, 4 * window)) - 1).bit_length()
        transform = np.fft.rfft(weight, size)
        for first in range(*inner, size - 2 * half):
            last = min(first + size - 2 * half, inner[1])
            block = signal[first - half : last + half]
            product = np.fft.irfft(np.fft.rfft(block - block[0], size) * transform, size)
            level = block[0] * (derivative == 0)
            result[first - begin : last - begin] = product[2 * half : block.size] + level
    for first in range(*inner, _BLOCK) if half <= _LONG else ():
        last = min(first + _BLOCK, inner[1])
        block = weight[half] * signal[first:last]
        for by in range(half, 0, -1):
            block += weight[half + by] * pair(signal[first - by : last - by], signal[first + by : last + by])
        result[first - begin : last - begin] = block
    for outermost, first, last in ((0, begin, min(end, half)), (last_window, max(begin, last_inner), end)):
        if first < last:
            fitted = _fit(window) @ signal[outermost : outermost + window]
            at = (np.arange(first, last) - outermost - half) / half
            values = np.polyval(np.polyder(fitted[::-1], derivative), at)
            result[first - begin : last - begin] = values / (half * step) ** derivative
    return result


# Half widths of the windows that are tried, and of those that they are compared with: of samples, and of means of
# 2, 4, 8, ... of them.
_OF_SAMPLES: Final[tuple[tuple[int, int], ...]] = ((2, 3), (4, 3), (5, 4), (6, 4), (8, 5), (10, 7), (12, 8))
_OF_MEANS: Final[tuple[tuple[int, int], ...]] = ((8, 5), (10, 7), (12, 8))
_LONGEST_WINDOW: Final = 32768
# Samples, or means, of the shortest stretch for which these are tried.
_CELL: Final = 8
# A squared difference beyond noise and this multiple of it is a bias that all longer windows have, too.
_FAR_BEYOND: Final = 6.0
# Ratio of the squared bias to the squared difference from a shorter window: 1.4 of a sine, 5 where the velocity jumps.
_BIAS: Final = 1.5
# Power of the length of windows with which their squared bias grows at most: that of a smooth motion.
_BIAS_POWER: Final = 12
# Steps from one window that is tried to the next.
_STEPS: Final = 4
_DIFFERENCES: Final = 6


def robust_deviation(noise: Floats) -> float:
    """Standard deviation of normal noise about zero, by the median of its sizes, which passes over jumps."""
    return 1.4826 * float(np.median(np.abs(noise)))


def fit_residual(columns: Floats, values: Floats) -> Floats:
    """What least squares of columns, shape (n, n_columns), leave of values, shape (n,)."""
    return np.asarray(values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0])


class _Comparison(NamedTuple):
    """Derivatives over windows of `half` samples to either side, less those of another window, per sample.

    `weights`: of the first samples of a record, up to the first with whole windows, shape (n_rows, window). `noise`:
    variances of the difference and of the derivative itself if the noise is white, with unit variance, shape
    (2, n_rows). `correlated`: samples over which the squares of the difference are correlated.
    """

    weights: Floats
    noise: Floats
    correlated: float


@lru_cache(maxsize=len({*_OF_SAMPLES, *_OF_MEANS}))
def _comparison(half: int, other: int) -> _Comparison:
    longest = max(half, other)

    def slopes(half: int) -> Floats:
        fit = _fit(2 * half + 1)
        powers = np.vander(np.linspace(-1.0, 0.0, half + 1), fit.shape[0] - 1, increasing=True)
        fitted = powers * np.arange(1.0, fit.shape[0]) / half @ fit[1:]
        wide = np.zeros((longest + 1, 2 * longest + 1))
        for row in range(longest + 1):
            wide[row, row - min(row, half) :][: 2 * half + 1] = fitted[min(row, half)]
        return wide

    derivative = slopes(half)
    difference = derivative - slopes(other)
    inner = difference[longest]
    return _Comparison(
        weights=difference,
        noise=np.sum(np.array([difference, derivative]) ** 2, axis=2),
        correlated=float(np.sum(np.correlate(inner, inner, "full") ** 2) / (inner @ inner) ** 2),
    )


def _compare(means: Floats, half: int, other: int) -> Floats:
    """Means over cells, shape (3, n_cells): of the squared difference from the other window, and of `noise`."""
    of = _comparison(half, other)
    longest = of.weights.shape[0] - 1
    # Every second sample; the last cell is filled by reflection.
    at = np.arange(0, means.size + -means.size % _CELL, 2)
    row = np.minimum(at, np.abs(means.size - 1 - at)).clip(max=longest).reshape(-1, _CELL // 2)
    begin, end = -(-longest // 2), -(-(means.size - longest) // 2)
    squares = np.zeros(at.size)
    squares[:begin] = of.weights[row.flat[:begin]] @ means[: 2 * longest + 1]
    squares[end:] = of.weights[row.flat[end:]] @ means[: -2 * longest - 2 : -1]
    for first in range(begin, end, _BLOCK):
        block = squares[first : min(first + _BLOCK, end)]
        for by in range(1, longest + 1):
            later, earlier = (means[2 * first + side :: 2][: block.size] for side in (by, -by))
            block += of.weights[longest, longest + by] * (later - earlier)
    squares **= 2
    result = np.empty((3, row.shape[0]))
    result[0] = squares.reshape(row.shape) @ np.full(row.shape[1], 1.0 / row.shape[1])
    result[1:] = of.noise[:, longest:]
    for cells in (slice(0, longest), slice(-longest, None)):
        result[1:, cells] = of.noise[:, row[cells]].mean(axis=2)
    return result


def _means_and_noise(displacement: Floats) -> tuple[Floats, int, float]:
    """The samples, or means over the repeats of a channel that repeats its values, how many, and their noise variance.

    The noise is seen in sixth differences, where the channel does not stand still. Of a channel whose readings are
    multiples of a quantum, it is that of rounding at least; its quantum is the least change of the size of its steps.
    """
    changes = np.flatnonzero(np.diff(displacement))
    span = int(np.median(np.diff(changes))) if changes.size > 1 else 1
    means = displacement[: displacement.size // span * span].reshape(-1, span).mean(axis=1)
    steps = np.diff(means)
    moving = steps[_DIFFERENCES // 2 : means.size - _DIFFERENCES // 2] != 0.0
    rough = np.abs(np.diff(means, _DIFFERENCES))[moving] / np.sqrt(comb(2 * _DIFFERENCES, _DIFFERENCES))
    variance = float(np.mean(rough**2)) if rough.size else 0.0
    if span == 1 and rough.size:
        bends = np.abs(np.diff(np.abs(steps[steps != 0.0])))
        quanta = bends[bends > 8.0 * np.spacing(np.max(np.abs(means)))]
        quantum = float(np.min(quanta, initial=np.inf))
        is_quantised = quanta.size > 0 and np.allclose(
            quanta / quantum, np.rint(quanta / quantum), rtol=0.0, atol=0.01
        )
        of_rounding = min(variance, quantum**2 / 12.0) if is_quantised else 0.0
        mostly_still = is_quantised and np.count_nonzero(steps) < steps.size // 2
        variance = max(0.0 if mostly_still else robust_deviation(rough) ** 2, of_rounding)
    return means, span, max(variance, float(np.spacing(np.ptp(displacement))) ** 2)


def _windows_between(
    halves: NDArray[np.intp], bias: Floats, noise: Floats
) -> tuple[NDArray[np.intp], Floats]:
    """Windows of `halves` samples to either side, shape (n,), and between these, and their mean square errors.

    `bias`, `noise`: squared bias and noise, shape (n, n_cells). A bias is at least what that of the next longer window
    tells of it, with the steepest growth that a motion can have. None lies between the cubics of the shortest window
    and the quintics of the next.
    """
    for row in range(halves.size - 2, -1, -1):
        steepest = (halves[row + 1] / halves[row]) ** _BIAS_POWER
        bias[row] = np.maximum(bias[row], bias[row + 1] / steepest)
    place = np.append(0, np.arange(_STEPS, _STEPS * (halves.size - 1) + 1)) / _STEPS
    below, above = np.floor(place).astype(np.intp), np.ceil(place).astype(np.intp)
    between = np.exp(np.interp(place, np.arange(halves.size), np.log(halves))).round()
    share = (place - below)[:, np.newaxis]
    to_above = (between / halves[above])[:, np.newaxis]
    to_below = (between / halves[below])[:, np.newaxis]
    least = bias[above] * to_above**_BIAS_POWER
    bias = np.maximum(bias[below] ** (1.0 - share) * bias[above] ** share, least)
    return 2 * between.astype(np.intp) + 1, _BIAS * bias + noise[below] / to_below**3


def best_windows(displacement: Floats) -> NDArray[np.intp]:
    """Windows with the least mean square error of the velocity, shape (n_time,), of a displacement of that shape.

    The record is halved into stretches, these again, and so on, wherever the halves have less error together. That of a
    stretch is the bias and the noise of its best window, and the standard error of the noise, which keeps stretches
    together whose windows differ by chance. The squared bias is the mean square difference from a shorter window,
    beyond that of noise. Windows are no longer than three times the stretch.
    """
    means, span, variance = _means_and_noise(displacement)
    if means.size < 4 * _OF_SAMPLES[1][0] + 2:
        return np.full(displacement.size, 5, dtype=np.intp)
    shortest = _CELL * span
    table, halves, correlated = np.empty((3, 0, -(-means.size // _CELL))), list[int](), list[float]()
    chosen = np.empty(table.shape[2], dtype=np.intp)
    tried, length, least = _OF_SAMPLES, shortest, np.full(table.shape[2], np.inf)
    while True:
        for half, other in tried:
            if means.size < 4 * half + 2 or half * span > _LONGEST_WINDOW:
                break
            cells = _compare(means, half, other) * np.array([[1.0], [variance], [variance]]) / span**2
            cells = np.pad(cells, ((0, 0), (0, table.shape[2] - cells.shape[1])), "edge")
            table = np.concatenate([table, cells[:, np.newaxis]], axis=1)
            halves.append(half * span)
            correlated.append(_comparison(half, other).correlated * span)
        squares, difference, noise = table
        error = np.sqrt(2.0 / length * np.array(correlated))[:, np.newaxis]
        bias = squares - difference
        # The bias of cubics over five samples is not that of quintics.
        held = np.maximum.accumulate(np.where(bias > _FAR_BEYOND * difference, bias, 0.0)[1:], axis=0)
        bias[1:] = np.maximum(bias[1:], held)
        bias = bias.clip(min=0.0)
        windows, risk = _windows_between(np.array(halves), bias, noise * (1.0 + error))
        best = np.argmin(risk, axis=0)
        risks = length * risk[best, np.arange(best.size)]
        better = np.repeat(risks <= least, length // shortest)[: chosen.size]
        longer = np.repeat(windows[best], length // shortest)[: chosen.size]
        chosen = np.where(better, longer, chosen)
        if risks.size == 1:
            cell = np.arange(displacement.size) // shortest
            return np.asarray(chosen[cell.clip(max=chosen.size - 1)])
        least = np.add.reduceat(np.minimum(risks, least), np.arange(0, risks.size, 2))
        table = np.pad(table, ((0, 0), (0, 0), (0, risks.size % 2)), "edge")
        table = 0.5 * (table[:, :, ::2] + table[:, :, 1::2])
        means = 0.5 * (means[: means.size // 2 * 2 : 2] + means[1::2])
        variance, span, length, tried = 0.5 * variance, 2 * span, 2 * length, _OF_MEANS


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


@array_dataclass()
class Differentiator:
    """How velocity and acceleration follow from a displacement: quintic Savitzky-Golay filters over `windows`.

    `windows`: samples of the window about each sample, shape (n_time,). Samples are `dt` [s] apart.
    """

    windows: NDArray[np.intp]
    dt: float

    @classmethod
    def of(cls, displacement: Floats, dt: float) -> Differentiator:
        """That of a displacement, shape (n_time,), of at least 5 samples: see `best_windows`."""
        return cls(windows=best_windows(displacement), dt=dt)

    @property
    def window(self) -> int:
        """Harmonic mean of the windows: as many windows of this length have place in the record."""
        return round(1.0 / float(np.mean(1.0 / self.windows)))

    @property
    def in_words(self) -> str:
        """Kind of the filter and length of its windows, in samples and milliseconds."""
        ends = np.unique([self.windows.min(), self.windows.max()]).tolist()
        samples = " to ".join(f"{window}" for window in ends)
        times = " to ".join(f"{1e3 * window * self.dt:.3g}" for window in ends)
        return f"a quintic Savitzky-Golay filter over {samples} samples ({times} ms)"

    def smooth(self, signal: Floats) -> Floats:
        """The smoothed signal, of the same shape."""
        return self.derivative(signal, order=0)

    def derivative(self, signal: Floats, order: int = 1) -> Floats:
        """Time derivative of the smoothed signal, of the same shape, in its unit per s^`order`."""
        result = np.empty_like(signal)
        # No stretch is shorter than a cell.
        for window in np.unique(self.windows[::_CELL]).tolist():
            samples = np.flatnonzero(self.windows == window)
            # Close stretches with one window are filtered together.
            apart = 1 + np.flatnonzero(np.diff(samples) > _BLOCK // 4)
            for at in np.split(samples, apart):
                part = slice(int(at[0]), int(at[-1]) + 1)
                filtered = savitzky_golay(signal, window, derivative=order, step=self.dt, part=part)
                result[at] = filtered[at - at[0]]
        return result

    def noise(self, removed: Floats) -> float:
        """Standard deviation of the white noise of a signal, estimated from the part that `smooth` removed."""
        # A least-squares smoother with centre weight c0 removes the fraction 1 - c0 of the variance of the noise.
        left = self._mean(lambda window: weights(window)[window // 2])
        return float(np.sqrt(np.var(removed) / (1.0 - left)))

    def noise_gain(self, order: int) -> float:
        """Standard deviation of `derivative` (order 0: `smooth`) per unit standard deviation of white noise."""
        squares = self._mean(lambda window: np.sum(weights(window, derivative=order, step=self.dt) ** 2))
        return float(np.sqrt(squares))

    def _mean(self, of: Callable[[int], float]) -> float:
        """Mean over the samples of a number for each window."""
        windows, counts = np.unique(self.windows, return_counts=True)
        return float(np.average([of(window) for window in windows.tolist()], weights=counts))


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
    """Smooth a displacement with step `dt` [s], and differentiate it.

    The acceleration is the derivative of the velocity: the second derivative of the polynomials, whose windows suit the
    first, is too small by 0.3 to 1.2 % on sines of 0.5 to 4 Hz with noise of 5 um, and so were masses too large.
    """
    differentiator = Differentiator.of(displacement, dt)
    velocity = differentiator.derivative(displacement)
    return SmoothMotion(
        displacement=differentiator.smooth(displacement),
        velocity=velocity,
        acceleration=differentiator.derivative(velocity),
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


def crossing_instants(displacement: Floats) -> Floats:
    """Instants of the upward crossings in samples, shape (n_crossings,), each interpolated between two samples."""
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
