"""What a law of the user receives at a control sample."""

from __future__ import annotations

from dataclasses import fields
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass

# A run with larger readings [m, m/s, N] diverges, and a law may overflow on them.
_LARGEST_READING = 1e30


@array_dataclass(repr=False)
class RunningRms(Summarised):
    """Running root mean squares of the readings of a law in Python, in the shapes and units of `LoopSample`.

    The mean of the squares fades: `s = a s + (1 - a) y^2` at each sample, `a = exp(-Ts / rms_time)`, from zero on. A
    reading that is not finite leaves it as it is.
    """

    _units: ClassVar[dict[str, str]] = {
        "deformation": "m",
        "rate": "m/s",
        "force": "N",
        "acceleration": "m/s^2",
        "ground_acceleration": "m/s^2",
        "drift": "m",
    }

    deformation: Floats
    rate: Floats
    force: Floats
    acceleration: Floats
    ground_acceleration: Floats
    drift: Floats


@array_dataclass(repr=False)
class LoopSample(Summarised):
    """Input of a law in Python at a control sample, one row per run.

    Attributes
    ----------
    time, sample_time
        Time from the start of the motions, and from sample to sample [s].
    candidate, motion
        Index of the candidate and of the motion of each run, shape (n_runs,).
    displacement, velocity
        Of the coordinates relative to the ground, true or estimated by the observer, shape (n_runs, n) [m, m/s].
    deformation, rate, force
        Elongation of each device, its rate, and the force with which it resists, shape (n_runs, n_devices) [m, m/s, N].
    acceleration
        Absolute accelerations of the floors as their sensors read them, shape (n_runs, n_floors) [m/s^2].
    ground_acceleration
        Acceleration of the ground as its sensor reads it, shape (n_runs,) [m/s^2]; of a record finer than the
        integration step the mean over the step before.
    ground_velocity
        Its integral from rest, shape (n_runs,) [m/s]: coordinates that are moved by the ground have this velocity more
        than that relative to it.
    drift
        Drifts of the storeys with a sensor, in the order of the hardware, shape (n_runs, n_measured_storeys) [m].
    largest
        Largest command of each device, shape (n_devices,) [A or V]; of an actuator its largest force [N].
    rms
        Running root mean squares of the readings, where the law has an `rms_time`; otherwise `None`.
    """

    _units: ClassVar[dict[str, str]] = {
        "time": "s",
        "sample_time": "s",
        "displacement": "m",
        "velocity": "m/s",
        **RunningRms._units,
        "ground_velocity": "m/s",
        "largest": "A, V or N",
    }

    time: float
    sample_time: float
    candidate: NDArray[np.intp]
    motion: NDArray[np.intp]
    displacement: Floats
    velocity: Floats
    deformation: Floats
    rate: Floats
    force: Floats
    acceleration: Floats
    ground_acceleration: Floats
    ground_velocity: Floats
    drift: Floats
    largest: Floats
    rms: RunningRms | None = None

    @property
    def state(self) -> Floats:
        """Displacements and velocities, shape (n_runs, 2n)."""
        return np.hstack([self.displacement, self.velocity])

    @property
    def is_physical(self) -> NDArray[np.bool_]:
        """Whether every reading of a run is a number that a building can have, shape (n_runs,)."""
        measured = (self.deformation, self.rate, self.force, self.acceleration, self.drift)
        readings = np.hstack([self.state, *measured, self.ground_acceleration[:, None]])
        return np.asarray((np.abs(readings) < _LARGEST_READING).all(axis=1))


READINGS: Final = {
    entry.name: LoopSample._units[entry.name]
    for entry in fields(LoopSample)
    if entry.name in LoopSample._units and entry.name not in ("time", "sample_time", "largest")
}
"""Readings of a `LoopSample` with their units, in its order, which is that of an `Ask`."""
RMS_READINGS: Final = tuple(entry.name for entry in fields(RunningRms))
"""Readings of which there are running root mean squares."""
