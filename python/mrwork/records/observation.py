"""Observation model: how the recorded force follows from the force of the damper."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import AnyNumbers, Positive, checked
from mrwork.errors import SettingError

RANGES: Final = {
    "delay_seconds": (-1e6, 1e6, "s"),
    "lowpass_hz": (1e-3, 1e6, "Hz"),
    "average_seconds": (0.0, 1e6, "s"),
    "gain": (-1e6, 1e6, ""),
    "offset": (-1e9, 1e9, "N"),
}
"""Least and largest value of each effect, with its unit."""


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """Effects of rig and processing on the recorded force, in this order; the default has no effect.

    Delay of `delay_seconds`; causal second-order Butterworth low-pass filter at `lowpass_hz` (0 for none); centred
    moving average over `average_seconds`; factor `gain`; `offset` [N]. The model is applied to simulated forces
    before the comparison, never to the record.
    """

    delay_seconds: float = 0.0
    lowpass_hz: float = 0.0
    average_seconds: float = 0.0
    gain: float = 1.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        """Check the settings."""
        for name, (least, most, unit) in RANGES.items():
            value = getattr(self, name)
            none = name == "lowpass_hz" and value == 0.0
            if not (least <= value <= most or none) or (name == "gain" and value == 0.0):
                other = {"lowpass_hz": "0 for none, or ", "gain": "not 0, and "}.get(name, "")
                allowed = f"{other}from {least:g} to {most:g} {unit}".rstrip()
                raise SettingError(f"{name} of an observation is {value:g}; give {allowed}")

    @property
    def in_words(self) -> str:
        """Description in words; empty for the default."""
        parts = [
            (self.delay_seconds, f"late by {self.delay_seconds:.3g} s"),
            (self.lowpass_hz, f"low-passed at {self.lowpass_hz:.3g} Hz"),
            (self.average_seconds, f"averaged over {self.average_seconds:.3g} s"),
            (self.gain - 1.0, f"times {self.gain:.4g}"),
            (self.offset, f"offset by {self.offset:.4g} N"),
        ]
        return ", ".join(text for value, text in parts if value != 0.0)

    @checked
    def reach(self, dt: Positive) -> tuple[int, int]:
        """Numbers of samples at the start and at the end of a record for which the force beyond it would be needed.

        `observe` holds the force constant there, and truncates the window of the average.
        """
        half, delay = 0.5 * self.average_seconds / dt, self.delay_seconds / dt
        before, after = half + max(delay, 0.0), half + max(-delay, 0.0)
        return ceil(before - _ROUNDING), ceil(after - _ROUNDING)

    @checked
    def observe(self, force: AnyNumbers, dt: Positive) -> NDArray[np.float64]:
        """Recorded force for a damper force [N], shape (..., n_time), sampled every `dt` [s]."""
        if force.ndim < 1 or force.shape[-1] < 2:
            raise SettingError(f"`force` has shape {force.shape}; give two samples or more")
        observed = force
        if self.delay_seconds != 0.0:
            observed = delayed(observed, self.delay_seconds / dt)
        if self.lowpass_hz > 0.0:
            observed = _low_passed(observed, self.lowpass_hz, dt)
        if self.average_seconds > 0.0:
            observed = averaged(observed, self.average_seconds / dt)
        if self.gain != 1.0:
            observed = self.gain * observed
        return observed + self.offset if self.offset != 0.0 else observed


AS_IT_IS = Observation()
# Length of a moving average [samples] below which it changes less than its sums are rounded.
_SHORTEST = 1e-3
# Samples by which a window may exceed a whole number of them by rounding.
_ROUNDING = 1e-6
# Least corner of a filter per sampling frequency, below which its equations are singular to rounding.
_LOWEST = 1e-7


def delayed(signal: NDArray[np.float64], samples: float) -> NDArray[np.float64]:
    """Delay a signal, shape (..., n_time), by `samples`, linear in between; the ends are held constant."""
    last = signal.shape[-1] - 1
    place = np.clip(np.arange(last + 1) - samples, 0.0, last)
    before = np.minimum(np.floor(place).astype(int), last - 1)
    share = place - before
    return np.asarray(signal[..., before] * (1.0 - share) + signal[..., before + 1] * share)


def averaged(signal: NDArray[np.float64], samples: float) -> NDArray[np.float64]:
    """Moving average of a signal, shape (..., n_time), linear between samples, over a centred window of `samples`.

    At the ends, the window is truncated to the record.
    """
    if samples < _SHORTEST:
        return signal
    last = signal.shape[-1] - 1
    middles = 0.5 * (signal[..., 1:] + signal[..., :-1])
    integral = np.concatenate([np.zeros((*signal.shape[:-1], 1)), np.cumsum(middles, axis=-1)], axis=-1)

    def integral_at(place: NDArray[np.float64]) -> NDArray[np.float64]:
        before = np.minimum(np.floor(place).astype(int), last - 1)
        share = place - before
        slope = signal[..., before + 1] - signal[..., before]
        return np.asarray(integral[..., before] + share * (signal[..., before] + 0.5 * share * slope))

    start = np.clip(np.arange(last + 1) - 0.5 * samples, 0.0, last)
    end = np.clip(np.arange(last + 1) + 0.5 * samples, 0.0, last)
    return np.asarray((integral_at(end) - integral_at(start)) / (end - start))


def _low_passed(signal: NDArray[np.float64], corner_hz: float, dt: float) -> NDArray[np.float64]:
    # scipy.signal is slow to load and rarely needed.
    from scipy.signal import butter, lfilter, lfilter_zi

    if corner_hz * dt >= 0.5:
        return signal
    if corner_hz * dt < _LOWEST:
        raise SettingError(
            f"a low-pass filter at {corner_hz:g} Hz has no effect in a step of {dt:g} s; give a higher frequency"
        )
    numerator, denominator = butter(2, 2.0 * corner_hz * dt)
    start = lfilter_zi(numerator, denominator) * signal[..., :1]
    return np.asarray(lfilter(numerator, denominator, signal, axis=-1, zi=start)[0])
