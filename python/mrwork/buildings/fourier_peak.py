"""Frequency and damping of a mode from the peak that its free vibration leaves in the Fourier spectrum."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.buildings.free_vibration import ModeEstimate, checked, mode_estimate
from mrwork.errors import RecordError

Floats = NDArray[np.float64]

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
    spectrum = _Spectrum(signal - signal.mean(), dt)
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
    spectrum: _Spectrum, grid: Floats, power: Floats, top: int
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


class _Spectrum:
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

    def without_image(self, omega: float, decay: float) -> _Spectrum:
        """The record less the half of the mode that turns backwards, and less its offset."""
        turning = np.exp((-decay + 1j * omega) * self.time)
        shapes = np.stack([turning.real, turning.imag, np.ones_like(self.time)], axis=1)
        cosine, sine, offset = np.linalg.lstsq(shapes, self.signal.real)[0]
        backwards = (cosine + 1j * sine) / 2.0 * turning.conj()
        return _Spectrum(self.signal - backwards - offset, self.dt)

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
