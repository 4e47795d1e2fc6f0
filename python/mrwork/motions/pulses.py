"""Simple motions for tests: sine, sweep, half sine, Ricker pulse."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError
from mrwork.motions.ground_motion import GroundMotion


def sine(*, amplitude: float, frequency: float, cycles: float, dt: float = 0.001) -> GroundMotion:
    """Sine of acceleration: `amplitude` [m/s^2], `frequency` [Hz], so many cycles, from zero."""
    time = _time(cycles / _positive("frequency", frequency), dt)
    acceleration = amplitude * np.sin(2.0 * np.pi * frequency * time)
    return _motion(f"sine {frequency:g} Hz", dt, acceleration)


def sine_sweep(
    *, amplitude: float, start: float, end: float, duration: float, dt: float = 0.001
) -> GroundMotion:
    """Sine of acceleration whose frequency runs evenly from `start` to `end` [Hz] in `duration` [s]."""
    time = _time(duration, dt)
    phase = 2.0 * np.pi * (_positive("start", start) * time + 0.5 * (end - start) / duration * time**2)
    return _motion(f"sweep {start:g} to {end:g} Hz", dt, amplitude * np.sin(phase))


def half_sine(*, amplitude: float, width: float, rest: float = 0.0, dt: float = 0.001) -> GroundMotion:
    """One half wave of acceleration, `width` [s] long, then `rest` [s] of nothing."""
    time = _time(_positive("width", width) + rest, dt)
    acceleration = np.where(time <= width, amplitude * np.sin(np.pi * time / width), 0.0)
    return _motion(f"half sine {width:g} s", dt, acceleration)


def ricker(*, amplitude: float, frequency: float, dt: float = 0.001) -> GroundMotion:
    """Ricker pulse of acceleration, `amplitude (1 - 2 u) exp(-u)` with `u = (pi frequency (t - t_0))^2`.

    It lasts three periods about t_0; velocity and displacement come back to zero (N. Ricker, Geophysics 18, 1953).
    """
    half = 1.5 / _positive("frequency", frequency)
    time = _time(2.0 * half, dt)
    u = (np.pi * frequency * (time - half)) ** 2
    return _motion(f"Ricker {frequency:g} Hz", dt, amplitude * (1.0 - 2.0 * u) * np.exp(-u))


def _time(duration: float, dt: float) -> NDArray[np.float64]:
    if not (math.isfinite(duration) and 0.0 < dt <= duration):
        raise SettingError(f"pulse of {duration} s every {dt} s; give a positive step below the duration")
    return dt * np.arange(round(duration / dt) + 1, dtype=np.float64)


def _positive(name: str, value: float) -> float:
    if not (math.isfinite(value) and value > 0.0):
        raise SettingError(f"{name} of a pulse is {value}; give a positive number")
    return value


def _motion(name: str, dt: float, acceleration: NDArray[np.float64]) -> GroundMotion:
    return GroundMotion(name=name, dt=dt, acceleration=acceleration, source="computed")
