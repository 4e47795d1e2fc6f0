"""Frequency and damping of a mode from a record of free vibration.

Two ways, `fourier_peak` and `logarithmic_decrement`, check each other. Their standard errors are those of noise on a
mode that decays as it should; where the ground still moves, or frequency and damping change with amplitude, the two
disagree by more than that.
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
