"""Frequency and damping of a mode from a free-vibration record: peak of the Fourier spectrum, logarithmic decrement.

The two methods are independent and check each other. Their standard errors hold for white noise on one exponentially
decaying mode. Where the ground still moves, or frequency and damping change with amplitude, the two differ by more than
that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, curve_fit, minimize_scalar

from mrwork.errors import RecordError
from studies.former.arrays import Floats

# Zero padding: points of the padded spectrum per independent point. The peak is then refined exactly.
_PADDING = 8
# Least ratio of the power of a peak to that of the noise; the highest of ten thousand noise points has about ten.
_CLEAR = 25.0
# Half width of the parabola fit around an extreme, in periods.
_STRETCH = 1.0 / 8.0
_FEWEST_EXTREMES = 5
# Extremes smaller than this fraction of the largest are not used.
_SMALLEST = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class ModeEstimate:
    """Natural frequency [Hz] and damping ratio of a mode, with their standard errors.

    `n_extremes` is the number of extremes that `logarithmic_decrement` used, zero for `fourier_peak`.
    """

    frequency: float
    frequency_error: float
    damping_ratio: float
    damping_ratio_error: float
    n_extremes: int = 0

    @classmethod
    def of(
        cls, omega: float, omega_error: float, decay: float, decay_error: float, n_extremes: int = 0
    ) -> ModeEstimate:
        """The estimate of a damped circular frequency [rad/s] and a decay rate [1/s], with standard errors.

        `omega_n^2 = omega_d^2 + sigma^2`, `zeta = sigma / omega_n`; errors to first order, for independent estimates.
        """
        natural = float(np.hypot(omega, decay))
        return cls(
            frequency=natural / (2.0 * np.pi),
            frequency_error=float(np.hypot(omega * omega_error, decay * decay_error))
            / natural
            / (2.0 * np.pi),
            damping_ratio=decay / natural,
            damping_ratio_error=float(np.hypot(omega**2 * decay_error, omega * decay * omega_error))
            / natural**3,
            n_extremes=n_extremes,
        )

    @property
    def decay(self) -> float:
        """Decay rate sigma [1/s] of `exp(-sigma t)`."""
        return 2.0 * np.pi * self.frequency * self.damping_ratio


def fourier_peak(signal: Floats, *, dt: float) -> ModeEstimate:
    """Estimate frequency and damping of the mode with the highest peak, from that peak and its width.

    Near its peak, the spectrum of `exp(-sigma t) cos(omega_d t)` cut off at time T is
    `|(1 - exp(-(sigma + i d) T)) / (sigma + i d)|`, where d is the distance from omega_d. Its width at half power is
    2 sigma for a long record. Here sigma is solved from the width for the actual T, so the width due to a short record
    is not mistaken for damping. Standard errors are first-order errors for white noise at the level of the spectrum
    beside the peak.
    """
    spectrum = _FourierIntegral(signal - signal.mean(), dt)
    padded = 1 << int(np.ceil(np.log2(_PADDING * signal.size)))
    frequency = np.fft.rfftfreq(padded, dt)
    power = np.abs(np.fft.rfft(spectrum.signal, padded)) ** 2
    # A peak is separable from the offset only if the record holds at least two periods.
    lowest = int(np.argmax(frequency >= 2.0 / (dt * signal.size)))
    top = lowest + int(power[lowest:].argmax())
    half = power[top] / 2.0
    below, above = np.flatnonzero(power[:top] < half), top + np.flatnonzero(power[top:] < half)
    if not (below.size and above.size):
        raise RecordError(f"free vibration: no peak about {frequency[top]:g} Hz falls to half its power")
    omega, sides = spectrum.refine_peak(
        *(2.0 * np.pi * float(frequency[place]) for place in (top, below[-1], above[0]))
    )
    # The image peak at -omega_d leaks over by zeta / 2 of the height; it is removed before the refinement.
    alone = spectrum.without_image(omega, _rate(sides, spectrum.duration))
    omega, sides = alone.refine_peak(omega, *sides)
    decay = _rate(sides, spectrum.duration)
    width = sides[1] - sides[0]
    noise = alone.noise(omega, decay, width)
    if alone.power(omega) < _CLEAR * noise**2 * signal.size:
        raise RecordError("free vibration: the highest peak does not stand out from the noise beside it")
    if alone.projected_power(omega, -decay) > alone.projected_power(omega, decay):
        raise RecordError("free vibration: the motion grows instead of decaying")
    omega_error, width_error = alone.errors(omega, sides, noise)
    step = 1e-4 * width
    wider, narrower = _decay(width + step, spectrum.duration), _decay(width - step, spectrum.duration)
    slope = 0.5 if wider is None or narrower is None else (wider - narrower) / (2.0 * step)
    return ModeEstimate.of(omega, omega_error, decay, slope * width_error)


class _FourierIntegral:
    """Fourier integral of a record at any circular frequency, and the effect of noise on its peak."""

    def __init__(self, signal: Floats | NDArray[np.complex128], dt: float) -> None:
        self.signal = signal
        self.dt = dt
        self.time = dt * np.arange(signal.size)
        self.duration = dt * signal.size

    def power(self, omega: float) -> float:
        return float(np.abs(self._terms(omega).sum()) ** 2)

    def refine_peak(self, omega: float, lower: float, upper: float) -> tuple[float, tuple[float, float]]:
        """Exact peak and half-power points from an initial guess of each."""
        near = 0.25 * (upper - lower)
        search = minimize_scalar(
            lambda w: -self.power(w), bounds=(omega - near, omega + near), options={"xatol": 1e-6 * near}
        )
        peak = float(search.x)
        half = self.power(peak) / 2.0
        low, high = (
            float(brentq(lambda w: self.power(w) - half, peak, self._beyond(peak, side, half)))
            for side in (lower, upper)
        )
        return peak, (low, high)

    def _beyond(self, peak: float, side: float, half: float) -> float:
        """A frequency on one side of the peak with less than half its power."""
        for reach in (1.0, 1.1, 1.25, 1.5):
            if self.power(peak + reach * (side - peak)) < half:
                return peak + reach * (side - peak)
        raise RecordError(f"free vibration: the peak at {peak / (2.0 * np.pi):g} Hz is not clear of another")

    def without_image(self, omega: float, decay: float) -> _FourierIntegral:
        """The record without its offset and without the negative-frequency half of the mode."""
        turning = np.exp((-decay + 1j * omega) * self.time)
        shapes = np.stack([turning.real, turning.imag, np.ones_like(self.time)], axis=1)
        cosine, sine, offset = np.linalg.lstsq(shapes, self.signal.real)[0]
        backwards = (cosine + 1j * sine) / 2.0 * turning.conj()
        return _FourierIntegral(self.signal - backwards - offset, self.dt)

    def projected_power(self, omega: float, decay: float) -> float:
        """Power of the record projected on a motion of this decay rate; the spectrum alone does not give its sign."""
        turning = np.exp((-decay + 1j * omega) * self.time)
        return float(np.abs(turning.conj() @ self.signal) ** 2 / (turning.conj() @ turning).real)

    def noise(self, omega: float, decay: float, width: float) -> float:
        """Standard deviation of white noise at the level of the spectrum beside the peak, without the mode itself."""
        turning = np.exp((-decay + 1j * omega) * self.time)
        left = self.signal - turning * (turning.conj() @ self.signal) / (turning.conj() @ turning)
        frequency = 2.0 * np.pi * np.fft.fftfreq(self.signal.size, self.dt)
        power = np.abs(np.fft.fft(left)) ** 2
        off_peak = (np.abs(frequency - omega) > 3.0 * width) & (frequency > 0.0)
        beside = off_peak & (frequency > 0.5 * omega) & (frequency < 2.0 * omega)
        # The power of noise is exponentially distributed; the median is robust against the peaks of other modes.
        level = float(np.median(power[beside if beside.sum() > 10 else off_peak])) / np.log(2.0)
        return float(np.sqrt(level / self.signal.size))

    def errors(self, omega: float, sides: tuple[float, float], noise: float) -> tuple[float, float]:
        """Standard errors of peak and width, each to first order a weighted sum of the noise of the samples."""
        terms = self._terms(omega)
        phases = np.exp(-1j * omega * self.time)
        value, slope, bend = terms.sum(), (-1j * self.time * terms).sum(), (-(self.time**2) * terms).sum()
        curvature = 2.0 * (bend * value.conj() + slope * slope.conj()).real
        lifted = 2.0 * (value.conj() * phases).real
        moved = -2.0 * (slope.conj() * phases + value.conj() * (-1j * self.time * phases)).real / curvature
        widened = np.zeros_like(self.time)
        for side, sign in zip(sides, (-1.0, 1.0), strict=True):
            there = self._terms(side)
            steepness = 2.0 * ((-1j * self.time * there).sum() * there.sum().conj()).real
            raised = 2.0 * (there.sum().conj() * np.exp(-1j * side * self.time)).real
            widened += sign * (lifted / 2.0 - raised) / steepness
        return noise * float(np.linalg.norm(moved)), noise * float(np.linalg.norm(widened))

    def _terms(self, omega: float) -> NDArray[np.complex128]:
        return np.asarray(self.signal * np.exp(-1j * omega * self.time), dtype=np.complex128)


def _rate(sides: tuple[float, float], duration: float) -> float:
    decay = _decay(sides[1] - sides[0], duration)
    if decay is None:
        raise RecordError("free vibration: the record is too short, its damping does not show yet")
    return decay


def _decay(width: float, duration: float) -> float | None:
    """Decay rate that gives this half-power width for a record of `duration`; `None` if no rate gives one so narrow."""

    def excess(decay: float) -> float:
        s = np.array([decay, decay + 0.5j * width])
        top, side = np.abs(-np.expm1(-s * duration) / s)
        return float((side / top) ** 2 - 0.5)

    # The width increases with the decay rate, from that of a steady sine to at most twice the rate.
    smallest = 1e-9 / duration
    return float(brentq(excess, smallest, width)) if excess(smallest) < 0.0 < excess(width) else None


def logarithmic_decrement(signal: Floats, *, dt: float) -> ModeEstimate:
    """Estimate frequency and damping of a mode from the extremes of its free vibration.

    The extreme k at time t_k is `offset + (-1)^k a exp(-sigma t_k)`; offset, a and sigma are fitted together. This
    gives the logarithmic decrement `2 pi sigma / omega_d` from all extremes at once, with less weight on those close to
    the noise. The times follow `t_k = t_0 + k pi / omega_d`. Standard errors are those of the two fits.
    """
    start = fourier_peak(signal, dt=dt)
    times, values = _extremes(signal, dt, start)
    kept = _n_clear(values)
    times, values = times[:kept], values[:kept]
    if kept < _FEWEST_EXTREMES:
        raise RecordError(f"free vibration: {kept} extremes stand out, {_FEWEST_EXTREMES} are needed")
    sides = np.sign(values[0] - values[1]) * (-1.0) ** np.arange(kept)

    def envelope(time: Floats, offset: float, amplitude: float, decay: float) -> Floats:
        return np.asarray(offset + sides * amplitude * np.exp(-decay * time))

    first = (0.0, float(np.ptp(values)) / 2.0, start.decay)
    fitted, covariance = curve_fit(envelope, times - times[0], values, p0=first)
    residuals = values - envelope(times - times[0], *fitted)
    decay = float(fitted[2])
    decay_error = float(np.sqrt(covariance[2, 2])) * _correlation_factor(sides * residuals)
    weights = np.exp(-decay * (times - times[0]))
    (half_period, offset), spread = np.polyfit(np.arange(kept), times, 1, w=weights, cov=True)
    late = (times - np.polyval((half_period, offset), np.arange(kept))) * weights
    omega = float(np.pi / half_period)
    omega_error = omega / half_period * float(np.sqrt(spread[0, 0])) * _correlation_factor(late)
    return ModeEstimate.of(omega, float(omega_error), decay, decay_error, n_extremes=kept)


def _extremes(signal: Floats, dt: float, start: ModeEstimate) -> tuple[Floats, Floats]:
    """Times and values of the extremes: expected from the phase of the mode, refined by a parabola fit."""
    period = 1.0 / start.frequency
    time = dt * np.arange(signal.size)
    omega = 2.0 * np.pi * np.sqrt(1.0 - start.damping_ratio**2) / period
    decaying = np.exp(-start.decay * time)
    shapes = np.stack(
        [decaying * np.cos(omega * time), decaying * np.sin(omega * time), np.ones_like(time)], axis=1
    )
    cosine, sine, _ = np.linalg.lstsq(shapes, signal)[0]
    # The zeros of the derivative of exp(-sigma t) cos(omega t - phase) are half a period apart.
    first = (np.arctan2(sine, cosine) - np.arctan2(start.decay, omega)) / omega
    reach = _STRETCH * period
    earliest, latest = reach, time[-1] - reach
    numbers = np.arange(
        np.ceil((earliest - first) / (period / 2.0)), np.floor((latest - first) / (period / 2.0)) + 1
    )
    times, values = [], []
    for middle in first + numbers * np.pi / omega:
        around = np.abs(time - middle) <= reach
        if around.sum() < 3 or not earliest <= middle <= latest:
            continue
        bend, slope, value = np.polyfit(time[around] - middle, signal[around], 2)
        moved = np.clip(-slope / (2.0 * bend), -reach, reach) if bend else 0.0
        times.append(middle + moved)
        # The value at the vertex would be biased outwards by noise, most for small extremes, and the decay too slow.
        values.append(value)
    return np.array(times), np.array(values)


def _n_clear(values: Floats) -> int:
    """Number of extremes before the first that is too small or not alternating."""
    if values.size < 2:
        return int(values.size)
    swings = np.diff(values)
    alternating = np.append(True, np.sign(swings[1:]) == -np.sign(swings[:-1]))
    clear = alternating & (np.abs(swings) >= _SMALLEST * np.abs(swings).max())
    return int(clear.size if clear.all() else clear.argmin()) + 1


def _correlation_factor(residuals: Floats) -> float:
    """Factor on a standard error for correlated residuals (narrow-band noise), from their lag-one correlation."""
    power = float(residuals @ residuals)
    if power == 0.0 or residuals.size < 3:
        return 1.0
    neighbours = float(residuals[1:] @ residuals[:-1]) / power
    correlation = min(max(neighbours, 0.0), 0.9)
    return float(np.sqrt((1.0 + correlation) / (1.0 - correlation)))
