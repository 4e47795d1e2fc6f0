"""Frequency and damping of a mode from a free-vibration record: the estimate, and the peak of the Fourier spectrum.

`fourier_peak` and `logarithmic_decrement` are independent methods that check each other. Their standard errors hold
for white noise on an exponentially decaying mode. Where the ground still moves, or frequency and damping change with
amplitude, the two differ by more than that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError, SettingError

Floats = NDArray[np.float64]

_FEWEST: Final = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class ModeEstimate:
    """Natural frequency [Hz] and damping ratio of a mode, with their standard errors.

    `decay` is the rate sigma [1/s] of `exp(-sigma t)`, so that frequency and decay give the logarithmic decrement.
    """

    method: Literal["fourier", "decrement"]
    frequency: float
    frequency_error: float
    damping_ratio: float
    damping_ratio_error: float
    n_extremes: int = 0

    @property
    def decay(self) -> float:
        """Rate of decay [1/s]."""
        return 2.0 * np.pi * self.frequency * self.damping_ratio

    @property
    def decrement(self) -> float:
        """Logarithmic decrement: the logarithm of one peak over the next of the same side."""
        return 2.0 * np.pi * self.damping_ratio / float(np.sqrt(1.0 - self.damping_ratio**2))


def mode_estimate(
    method: Literal["fourier", "decrement"],
    *,
    omega: float,
    omega_error: float,
    decay: float,
    decay_error: float,
    n_extremes: int = 0,
) -> ModeEstimate:
    """Return an estimate from the damped circular frequency and the rate of decay, both in [rad/s] with errors.

    `omega_n^2 = omega_d^2 + sigma^2`, `zeta = sigma / omega_n`; errors to first order, the two taken as independent.
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


def checked(
    signal: Floats, dt: float, band: tuple[float, float] | None
) -> tuple[Floats, tuple[float, float]]:
    """Return the record as an array, and the band [Hz] in which a mode is looked for.

    Raises
    ------
    RecordError
        Where the record is short, constant, or has a value that is not finite.
    SettingError
        Where the step is not positive, or the band does not lie between zero and half the sampling frequency.
    """
    signal = np.asarray(signal, dtype=np.float64)
    if signal.ndim != 1 or signal.size < _FEWEST:
        raise RecordError(
            f"free vibration: a record of {signal.size} samples; give one column of {_FEWEST} or more"
        )
    if not np.isfinite(signal).all():
        first = int(np.flatnonzero(~np.isfinite(signal))[0])
        raise RecordError(f"free vibration: sample {first} is not a finite number; cut it off or repair it")
    if np.ptp(signal) == 0.0:
        raise RecordError("free vibration: the record is constant; check which column was read")
    if not (np.isfinite(dt) and dt > 0.0):
        raise SettingError(f"free vibration: the step is {dt} s; give a positive number")
    highest = 0.5 / dt
    # Two periods in the record are the least that a peak can be told from the offset by.
    low, high = band if band is not None else (2.0 / (dt * signal.size), highest)
    if not 0.0 < low < high <= highest:
        raise SettingError(
            f"free vibration: the band is {low:g} to {high:g} Hz; give one between 0 and {highest:g} Hz, "
            "half the sampling frequency"
        )
    return signal, (low, high)


# Points of the padded spectrum for each independent one; the peak is then found exactly.
_PADDING: Final = 8
# Of the power of a peak over that of the noise: among ten thousand points of noise the highest has about ten times it.
_CLEAR: Final = 25.0


def fourier_peak(signal: Floats, *, dt: float, band: tuple[float, float] | None = None) -> ModeEstimate:
    """Frequency and damping of the mode with the highest peak in a band, from that peak and its width.

    The spectrum of `exp(-sigma t) cos(omega_d t)`, cut off at the time T, is near its peak
    `|(1 - exp(-(sigma + i d) T)) / (sigma + i d)|`, d the distance from omega_d. Its width at half power is 2 sigma for
    a long record; here sigma is solved from the width with T, so a short record does not pass for damping. Standard
    errors are those that white noise as strong as the spectrum beside the peak gives, to first order.

    Parameters
    ----------
    signal
        From the release on, shape (n_time,), in any unit; its mean is taken off.
    dt
        Step [s].
    band
        Where the peak is looked for [Hz]; by default all frequencies of which the record has two periods.

    Raises
    ------
    RecordError
        Where the record has no peak in the band, or is so short that its length alone makes the peak as wide as it is.
    SettingError
        Where step or band cannot be.
    """
    signal, (low, high) = checked(signal, dt, band)
    spectrum = _FourierIntegral(signal - signal.mean(), dt)
    padded = 1 << int(np.ceil(np.log2(_PADDING * signal.size)))
    frequency = np.fft.rfftfreq(padded, dt)
    power = np.abs(np.fft.rfft(spectrum.signal, padded)) ** 2
    inside = np.flatnonzero((frequency >= low) & (frequency <= high))
    if inside.size < 3:
        raise RecordError(
            f"free vibration: the record tells nothing between {low:g} and {high:g} Hz; widen the band"
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
    # The peak at minus omega_d reaches over, by zeta / 2 of the height; taken off, the other stands alone.
    alone = spectrum.without_image(omega, decay)
    omega, sides = alone.refined(omega, sides)
    decay = _rate(sides, spectrum.duration, omega)
    width = sides[1] - sides[0]
    noise = alone.noise(omega, decay, width)
    hertz = omega / (2.0 * np.pi)
    if alone.power(omega) < _CLEAR * noise**2 * signal.size:
        raise RecordError(
            f"free vibration: what is highest in the band, at {hertz:g} Hz, does not stand out of what lies beside it; "
            "give a band around a mode"
        )
    if alone.likeness(omega, -decay) > alone.likeness(omega, decay):
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
    """Peak near a point of the padded spectrum, the decay by its width, and where it has half its power."""
    half = power[top] / 2.0
    below, above = np.flatnonzero(power[:top] < half), top + np.flatnonzero(power[top:] < half)
    if not (below.size and above.size):
        raise RecordError(
            f"free vibration: the peak at {grid[top] / (2.0 * np.pi):g} Hz does not fall to half its power beside it; "
            "the record is too short or the damping too large"
        )
    rough = (float(grid[below[-1]]), float(grid[above[0]]))
    omega, sides = spectrum.refined(float(grid[top]), rough)
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
    """Fourier integral of a record at any circular frequency, and what noise makes of it."""

    def __init__(self, signal: NDArray[np.float64] | NDArray[np.complex128], dt: float) -> None:
        self.signal = signal
        self.dt = dt
        self.time = dt * np.arange(signal.size)
        self.duration = dt * signal.size

    def power(self, omega: float) -> float:
        return float(np.abs(self._terms(omega).sum()) ** 2)

    def refined(self, omega: float, sides: tuple[float, float]) -> tuple[float, tuple[float, float]]:
        """Peak and points of half power, exactly, from a guess of each."""
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
        """A point on this side of the peak with less than half its power."""
        for reach in (1.0, 1.1, 1.25, 1.5):
            if self.power(peak + reach * (side - peak)) < half:
                return peak + reach * (side - peak)
        raise RecordError(
            f"free vibration: the peak at {peak / (2.0 * np.pi):g} Hz is not clear of another; give a band around it"
        )

    def without_image(self, omega: float, decay: float) -> _FourierIntegral:
        """The record less the half of the mode that turns backwards, and less its offset."""
        turning = np.exp((-decay + 1j * omega) * self.time)
        shapes = np.stack([turning.real, turning.imag, np.ones_like(self.time)], axis=1)
        cosine, sine, offset = np.linalg.lstsq(shapes, self.signal.real)[0]
        backwards = (cosine + 1j * sine) / 2.0 * turning.conj()
        return _FourierIntegral(self.signal - backwards - offset, self.dt)

    def likeness(self, omega: float, decay: float) -> float:
        """Power of the record along a motion that decays at this rate: the spectrum alone does not tell its sign."""
        turning = np.exp((-decay + 1j * omega) * self.time)
        return float(np.abs(turning.conj() @ self.signal) ** 2 / (turning.conj() @ turning).real)

    def noise(self, omega: float, decay: float, width: float) -> float:
        """Standard deviation of white noise as strong as the spectrum beside the peak, the mode itself taken off."""
        turning = np.exp((-decay + 1j * omega) * self.time)
        left = self.signal - turning * (turning.conj() @ self.signal) / (turning.conj() @ turning)
        frequency = 2.0 * np.pi * np.fft.fftfreq(self.signal.size, self.dt)
        power = np.abs(np.fft.fft(left)) ** 2
        off_peak = (np.abs(frequency - omega) > 3.0 * width) & (frequency > 0.0)
        beside = off_peak & (frequency > 0.5 * omega) & (frequency < 2.0 * omega)
        # The power of noise is exponentially distributed; its median leaves out the peaks of other modes.
        level = float(np.median(power[beside if beside.sum() > 10 else off_peak])) / np.log(2.0)
        return float(np.sqrt(level / self.signal.size))

    def errors(self, omega: float, sides: tuple[float, float], noise: float) -> tuple[float, float]:
        """Standard errors of peak and width: each is, to first order, a weighted sum of the samples' noise."""
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
    """Rate of decay whose peak, cut off at `duration`, has this width at half power; `None` where none is so narrow."""

    def excess(decay: float) -> float:
        s = np.array([decay, decay + 0.5j * width])
        top, side = np.abs(-np.expm1(-s * duration) / s)
        return float((side / top) ** 2 - 0.5)

    from scipy.optimize import brentq

    # The width grows with the decay, from that of a steady sine up to twice the decay and never beyond.
    smallest = 1e-9 / duration
    return float(brentq(excess, smallest, width)) if excess(smallest) < 0.0 < excess(width) else None
