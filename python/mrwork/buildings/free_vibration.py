"""Frequency and damping of a mode from a free-vibration record: peak of the Fourier spectrum, logarithmic decrement.

`fourier_peak` and `logarithmic_decrement` are independent methods that check each other. Their standard errors hold
for white noise on an exponentially decaying mode. Where the ground still moves, or frequency and damping change with
amplitude, the two differ by more than that.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Final, Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import NotNegative, Positive, checked
from mrwork.base.hints import Within
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats
from mrwork.errors import RecordError, SettingError

_FEWEST: Final = 16


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class ModeEstimate(Summarised):
    """Natural frequency [Hz] and damping ratio of a mode, with their standard errors.

    `n_extremes` is the number of extremes that `logarithmic_decrement` used, zero for `fourier_peak`.
    """

    _units: ClassVar[Mapping[str, str]] = {"frequency": "Hz", "frequency_error": "Hz"}

    method: Literal["fourier", "decrement"]
    frequency: float
    frequency_error: float
    damping_ratio: float
    damping_ratio_error: float
    n_extremes: int = 0

    @property
    def decay(self) -> float:
        """Decay rate sigma [1/s] of `exp(-sigma t)`."""
        return 2.0 * np.pi * self.frequency * self.damping_ratio

    @property
    def decrement(self) -> float:
        """Logarithmic decrement: logarithm of the ratio of two successive peaks of the same sign."""
        return 2.0 * np.pi * self.damping_ratio / float(np.sqrt(1.0 - self.damping_ratio**2))


@checked
def mode_estimate(
    method: Literal["fourier", "decrement"],
    *,
    omega: Positive,
    omega_error: NotNegative,
    decay: float,
    decay_error: NotNegative,
    n_extremes: Annotated[int, Within(least=0)] = 0,
) -> ModeEstimate:
    """Return an estimate from the damped circular frequency [rad/s] and the decay rate [1/s], with standard errors.

    `omega_n^2 = omega_d^2 + sigma^2`, `zeta = sigma / omega_n`; errors to first order, for independent estimates.
    """
    natural = float(np.hypot(omega, decay))
    return ModeEstimate(
        method=method,
        frequency=natural / (2.0 * np.pi),
        frequency_error=float(np.hypot(omega * omega_error, decay * decay_error)) / natural / (2.0 * np.pi),
        damping_ratio=decay / natural,
        damping_ratio_error=float(np.hypot(omega**2 * decay_error, omega * decay * omega_error)) / natural**3,
        n_extremes=n_extremes,
    )


def _record_in_band(
    signal: Floats, dt: float, band: tuple[float, float] | None
) -> tuple[Floats, tuple[float, float]]:
    """Check a record and a band; return the record as an array and the band [Hz] to search for a mode."""
    if signal.ndim != 1 or signal.size < _FEWEST:
        raise RecordError(
            f"free vibration: a record of {signal.size} samples; give one column of {_FEWEST} or more"
        )
    if np.ptp(signal) == 0.0:
        raise RecordError("free vibration: the record is constant; check which column was read")
    highest = 0.5 / dt
    # A peak is separable from the offset only if the record holds at least two periods.
    low, high = band if band is not None else (2.0 / (dt * signal.size), highest)
    if not 0.0 < low < high <= highest:
        raise SettingError(
            f"free vibration: the band is {low:g} to {high:g} Hz; give one between 0 and {highest:g} Hz, "
            "half the sampling frequency"
        )
    return signal, (low, high)


# Zero padding: points of the padded spectrum per independent point. The peak is then refined exactly.
_PADDING: Final = 8
# Least ratio of the power of a peak to that of the noise; the highest of ten thousand noise points has about ten.
_CLEAR: Final = 25.0


@checked
def fourier_peak(signal: Floats, *, dt: Positive, band: tuple[float, float] | None = None) -> ModeEstimate:
    """Estimate frequency and damping of the mode with the highest peak in a band, from that peak and its width.

    Near its peak, the spectrum of `exp(-sigma t) cos(omega_d t)` cut off at time T is
    `|(1 - exp(-(sigma + i d) T)) / (sigma + i d)|`, where d is the distance from omega_d. Its width at half power is
    2 sigma for a long record. Here sigma is solved from the width for the actual T, so the width due to a short record
    is not mistaken for damping. Standard errors are first-order errors for white noise at the level of the spectrum
    beside the peak.

    Parameters
    ----------
    signal
        Record from the release on, shape (n_time,), in any unit; its mean is subtracted.
    dt
        Sampling step [s].
    band
        Band [Hz] to search for the peak; by default all frequencies with at least two periods in the record.

    Raises
    ------
    RecordError
        If the record has no peak in the band, or its length alone explains the width of the peak.
    SettingError
        If the step or the band is invalid.
    """
    signal, (low, high) = _record_in_band(signal, dt, band)
    spectrum = _FourierIntegral(signal - signal.mean(), dt)
    padded = 1 << int(np.ceil(np.log2(_PADDING * signal.size)))
    frequency = np.fft.rfftfreq(padded, dt)
    power = np.abs(np.fft.rfft(spectrum.signal, padded)) ** 2
    inside = np.flatnonzero((frequency >= low) & (frequency <= high))
    if inside.size < 3:
        raise RecordError(
            f"free vibration: the spectrum has fewer than three points from {low:g} to {high:g} Hz; widen the band"
        )
    top = int(inside[power[inside].argmax()])
    if top in (inside[0], inside[-1]):
        raise RecordError(
            f"free vibration: the spectrum is highest at {frequency[top]:g} Hz, an end of the band; "
            "give a band around a peak"
        )
    omega, decay, sides = _peak_at(
        spectrum, 2.0 * np.pi * np.asarray(frequency, dtype=np.float64), power, top
    )
    # The image peak at -omega_d leaks over by zeta / 2 of the height; it is removed before the refinement.
    alone = spectrum.without_image(omega, decay)
    omega, sides = alone.refine_peak(omega, sides)
    decay = _rate(sides, spectrum.duration, omega)
    width = sides[1] - sides[0]
    noise = alone.noise(omega, decay, width)
    hertz = omega / (2.0 * np.pi)
    if alone.power(omega) < _CLEAR * noise**2 * signal.size:
        raise RecordError(
            f"free vibration: the highest peak in the band, at {hertz:g} Hz, does not stand out from the noise "
            "beside it; give a band around a mode"
        )
    if alone.projected_power(omega, -decay) > alone.projected_power(omega, decay):
        raise RecordError(
            f"free vibration: the motion at {hertz:g} Hz grows instead of decaying; give the record from the release on"
        )
    omega_error, width_error = alone.errors(omega, sides, noise)
    step = 1e-4 * width
    wider, narrower = _decay(width + step, spectrum.duration), _decay(width - step, spectrum.duration)
    slope = 0.5 if wider is None or narrower is None else (wider - narrower) / (2.0 * step)
    return mode_estimate(
        "fourier", omega=omega, omega_error=omega_error, decay=decay, decay_error=slope * width_error
    )


def _peak_at(
    spectrum: _FourierIntegral, grid: Floats, power: Floats, top: int
) -> tuple[float, float, tuple[float, float]]:
    """Peak near a point of the padded spectrum, decay rate from its width, and its two half-power frequencies."""
    half = power[top] / 2.0
    below, above = np.flatnonzero(power[:top] < half), top + np.flatnonzero(power[top:] < half)
    if not (below.size and above.size):
        raise RecordError(
            f"free vibration: the peak at {grid[top] / (2.0 * np.pi):g} Hz does not fall to half its power beside it; "
            "the record is too short or the damping too large"
        )
    rough = (float(grid[below[-1]]), float(grid[above[0]]))
    omega, sides = spectrum.refine_peak(float(grid[top]), rough)
    return omega, _rate(sides, spectrum.duration, omega), sides


def _rate(sides: tuple[float, float], duration: float, omega: float) -> float:
    decay = _decay(sides[1] - sides[0], duration)
    if decay is None:
        raise RecordError(
            f"free vibration: the peak at {omega / (2.0 * np.pi):g} Hz is no wider than {duration:g} s of any "
            "steady sine make it; give a longer record, damping does not show yet"
        )
    return decay


class _FourierIntegral:
    """Fourier integral of a record at any circular frequency, and the effect of noise on its peak."""

    def __init__(self, signal: Floats | NDArray[np.complex128], dt: float) -> None:
        self.signal = signal
        self.dt = dt
        self.time = dt * np.arange(signal.size)
        self.duration = dt * signal.size

    def power(self, omega: float) -> float:
        return float(np.abs(self._terms(omega).sum()) ** 2)

    def refine_peak(self, omega: float, sides: tuple[float, float]) -> tuple[float, tuple[float, float]]:
        """Exact peak and half-power points from an initial guess of each."""
        from scipy.optimize import brentq, minimize_scalar

        near = 0.25 * (sides[1] - sides[0])
        search = minimize_scalar(
            lambda w: -self.power(w), bounds=(omega - near, omega + near), options={"xatol": 1e-6 * near}
        )
        peak = float(search.x)
        half = self.power(peak) / 2.0
        low, high = (
            float(brentq(lambda w: self.power(w) - half, peak, self._beyond(peak, side, half)))
            for side in sides
        )
        return peak, (low, high)

    def _beyond(self, peak: float, side: float, half: float) -> float:
        """A frequency on one side of the peak with less than half its power."""
        for reach in (1.0, 1.1, 1.25, 1.5):
            if self.power(peak + reach * (side - peak)) < half:
                return peak + reach * (side - peak)
        raise RecordError(
            f"free vibration: the peak at {peak / (2.0 * np.pi):g} Hz is not clear of another; give a band around it"
        )

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


def _decay(width: float, duration: float) -> float | None:
    """Decay rate that gives this half-power width for a record of `duration`; `None` if no rate gives one so narrow."""

    def excess(decay: float) -> float:
        s = np.array([decay, decay + 0.5j * width])
        top, side = np.abs(-np.expm1(-s * duration) / s)
        return float((side / top) ** 2 - 0.5)

    from scipy.optimize import brentq

    # The width increases with the decay rate, from that of a steady sine to at most twice the rate.
    smallest = 1e-9 / duration
    return float(brentq(excess, smallest, width)) if excess(smallest) < 0.0 < excess(width) else None


# Half width of the parabola fit around an extreme, in periods.
_STRETCH: Final = 1.0 / 8.0
_FEWEST_EXTREMES: Final = 5
_FILTER_ORDER: Final = 3
# Least lower end of a band per half the sampling frequency; below it, the filter is singular to rounding.
_LOWEST: Final = 1e-6
# Settling time of the filter at the ends of the record, in inverse band widths; the rest is below 0.1 %.
_SETTLING: Final = 3.0


@checked
def logarithmic_decrement(
    signal: Floats,
    *,
    dt: Positive,
    band: tuple[float, float] | None = None,
    smallest: Annotated[float, Within(least=0.0, below=1.0)] = 0.05,
) -> ModeEstimate:
    """Estimate frequency and damping of a mode from the extremes of its free vibration.

    The extreme k at time t_k is `offset + (-1)^k a exp(-sigma t_k)`; offset, a and sigma are fitted together. This
    gives the logarithmic decrement `2 pi sigma / omega_d` from all extremes at once, with less weight on those close to
    the noise. The times follow `t_k = t_0 + k pi / omega_d`. Standard errors are those of the two fits.

    Parameters
    ----------
    signal
        Record from the release on, shape (n_time,), in any unit.
    dt
        Sampling step [s].
    band
        Pass band [Hz] around the mode, if the record contains other modes. The filter runs forwards and backwards and
        has no phase shift; its transients at both ends of the record are not used.
    smallest
        Extremes smaller than this fraction of the largest are not used.

    Raises
    ------
    RecordError
        If the record has no peak, or fewer than five clear extremes.
    SettingError
        If the step or the band is invalid.
    """
    signal, limits = _record_in_band(signal, dt, band)
    start = fourier_peak(signal, dt=dt, band=band)
    period = 1.0 / start.frequency
    margin = 0.0
    if band is not None:
        from scipy.signal import butter, sosfiltfilt

        nyquist = 0.5 / dt
        if limits[0] < _LOWEST * nyquist:
            raise SettingError(
                f"free vibration: the band begins at {limits[0]:g} Hz, which no filter of samples every {dt:g} s can "
                f"tell from 0; give {_LOWEST * nyquist:.2g} Hz or more"
            )
        sections = butter(
            _FILTER_ORDER,
            (limits[0], min(limits[1], 0.999 * nyquist)),
            btype="bandpass",
            fs=1.0 / dt,
            output="sos",
        )
        signal = sosfiltfilt(sections, signal - signal.mean())
        margin = _SETTLING / (limits[1] - limits[0])
    times, values = _extremes(signal, dt, start, period, margin)
    kept = _n_clear(values, smallest)
    times, values = times[:kept], values[:kept]
    if kept < _FEWEST_EXTREMES:
        raise RecordError(
            f"free vibration: {kept} extremes of the mode at {start.frequency:g} Hz stand out; "
            f"{_FEWEST_EXTREMES} are needed, give a longer or quieter record"
        )
    sides = np.sign(values[0] - values[1]) * (-1.0) ** np.arange(kept)

    def envelope(time: Floats, offset: float, amplitude: float, decay: float) -> Floats:
        return np.asarray(offset + sides * amplitude * np.exp(-decay * time))

    first = (0.0, float(np.ptp(values)) / 2.0, start.decay)
    from scipy.optimize import curve_fit

    fitted, covariance = curve_fit(envelope, times - times[0], values, p0=first)
    residuals = values - envelope(times - times[0], *fitted)
    decay, decay_error = (
        float(fitted[2]),
        float(np.sqrt(covariance[2, 2])) * _correlation_factor(sides * residuals),
    )
    if decay <= 0.0:
        raise RecordError(
            f"free vibration: the extremes of the mode at {start.frequency:g} Hz do not decay; give the record from "
            "the release until it is at rest"
        )
    weights = np.exp(-decay * (times - times[0]))
    (half_period, _), spread = np.polyfit(np.arange(kept), times, 1, w=weights, cov=True)
    late = (times - np.polyval((half_period, _), np.arange(kept))) * weights
    omega = np.pi / half_period
    omega_error = omega / half_period * float(np.sqrt(spread[0, 0])) * _correlation_factor(late)
    return mode_estimate(
        "decrement",
        omega=float(omega),
        omega_error=float(omega_error),
        decay=decay,
        decay_error=decay_error,
        n_extremes=kept,
    )


def _extremes(
    signal: Floats, dt: float, start: ModeEstimate, period: float, margin: float
) -> tuple[Floats, Floats]:
    """Times and values of the extremes: expected from the phase of the mode, refined by a parabola fit."""
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
    earliest, latest = max(margin, reach), time[-1] - max(margin, reach)
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


def _n_clear(values: Floats, smallest: float) -> int:
    """Number of extremes before the first that is too small or not alternating."""
    if values.size < 2:
        return int(values.size)
    swings = np.diff(values)
    alternating = np.append(True, np.sign(swings[1:]) == -np.sign(swings[:-1]))
    large = np.abs(swings) >= smallest * np.abs(swings).max()
    clear = alternating & large
    return int(clear.size if clear.all() else clear.argmin()) + 1


def _correlation_factor(residuals: Floats) -> float:
    """Factor on a standard error for correlated residuals (narrow-band noise), from their lag-one correlation."""
    power = float(residuals @ residuals)
    if power == 0.0 or residuals.size < 3:
        return 1.0
    neighbours = float(residuals[1:] @ residuals[:-1]) / power
    correlation = min(max(neighbours, 0.0), 0.9)
    return float(np.sqrt((1.0 + correlation) / (1.0 - correlation)))
