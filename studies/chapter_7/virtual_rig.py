"""The virtual rig: a shake table, the frame with its damper, sensors and the controller's hardware.

What stands here is the truth of the study. Identification and prediction see what the sensors record, the motions that
were commanded, and the settings of the hardware, nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

import mrwork as mr
from mrwork.closed_loop import UserLaw
from mrwork.motions import ShakeTable
from studies.former.arrays import Floats
from studies.former.damper import driven

TABLE = ShakeTable()
"""Our definition of a table of medium size."""
FRAME = mr.building("frame")
LARGEST_CURRENT = 0.5
"""Of the driver in the tests [A]."""
DRIVER_RATE = 190.0
"""Rate at which the current follows the command [1/s]."""
LAWS = {"c": "linear", "k": "linear", "alpha": "quadratic", "delta": "linear", "f0": "linear"}
"""Current laws of the published RD-1005-3, as functions; their coefficients are the truth."""
NO_DAMPER = mr.ControlLaw(name="active", gains={"gain": [[0.0, 0.0]]})


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """A sensor with white noise and a resolution, both in the unit of its signal, and a calibrated gain that errs."""

    noise: float
    resolution: float
    gain: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensors:
    """Sensors of displacement [m], acceleration [m/s^2], of frame and table alike, force [N] and current [A]."""

    displacement: Sensor = Sensor(noise=2e-5, resolution=1e-5, gain=1.003)
    acceleration: Sensor = Sensor(noise=0.02, resolution=0.005, gain=0.995)
    force: Sensor = Sensor(noise=5.0, resolution=1.0, gain=1.01)
    current: Sensor = Sensor(noise=5e-3, resolution=1e-3, gain=1.005)


SENSORS = Sensors()
NO_GAIN_ERRORS = Sensors(
    **{name: replace(getattr(SENSORS, name), gain=1.0) for name in Sensors.__dataclass_fields__}
)
"""The same noise and resolution with true gains."""
HARDWARE = mr.Hardware(
    sample_time=1e-3,
    step=5e-4,
    delay=1e-3,
    feedback="observer",
    deformation_noise=SENSORS.displacement.noise,
    deformation_resolution=SENSORS.displacement.resolution,
    acceleration_noise=SENSORS.acceleration.noise,
    acceleration_resolution=SENSORS.acceleration.resolution,
    force_noise=SENSORS.force.noise,
    force_resolution=SENSORS.force.resolution,
    seed=7,
)
"""Of the controller: 1 kHz, a delay of one sample; noise and resolution of the rig's sensors, with true gains."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rig:
    """A frame, its damper and the controller's hardware: the true one, or one that was identified."""

    frame: mr.Building
    damper: mr.Device
    hardware: mr.Hardware


@dataclass(frozen=True, slots=True, kw_only=True)
class Signals:
    """Signals of a test at the samples of the controller, each of shape (n_time,).

    Displacement relative to the table [m], absolute acceleration of the frame and acceleration of the table [m/s^2],
    force of the damper [N], current [A].
    """

    time: Floats
    table: Floats
    displacement: Floats
    acceleration: Floats
    force: Floats
    current: Floats

    @property
    def step(self) -> float:
        """Time between samples [s]."""
        return float(self.time[1] - self.time[0])

    def part(self, first: int, last: int) -> Signals:
        """The samples from `first` up to `last`."""
        return Signals(**{each.name: getattr(self, each.name)[first:last] for each in fields(self)})

    def last(self, count: int) -> Signals:
        """The last `count` samples."""
        return self.part(self.time.size - count, self.time.size)


def true_rig() -> Rig:
    """The frame of 300 kg with one RD-1005-3."""
    return Rig(frame=FRAME, damper=rd_1005_3(), hardware=HARDWARE)


def rd_1005_3() -> mr.Device:
    """The published static hysteretic model with the lag of its driver."""
    theta = mr.damper("static_hysteretic").preset("kwok2006").theta
    return damper_of(theta, rate=DRIVER_RATE)


def other_damper() -> mr.Device:
    """A Bouc-Wen damper of like size, which the static hysteretic model does not contain; the numbers are ours."""
    coefficients = {
        "c": (1200.0, 1500.0),
        "k": 4000.0,
        "x0": -0.014,
        "k_w": (40.0, 900.0, -230.0),
        "rho": 1500.0,
        "sigma": 0.8,
        "n": 1.3,
    }
    return _device("Bouc-Wen damper", *driven("normalised_bouc_wen", coefficients, rate=DRIVER_RATE))


def damper_of(theta: object, *, rate: float) -> mr.Device:
    """One damper between table and frame: coefficients of its current laws, and the rate of its driver [1/s]."""
    spec = mr.damper("static_hysteretic").with_current_laws(LAWS, unit="A", lagged=True)
    return _device("RD-1005-3", spec, np.append(np.asarray(theta, dtype=np.float64), rate))


def _device(name: str, spec: mr.DamperSpec, theta: Floats) -> mr.Device:
    row = FRAME.storeys[0]
    return mr.Device(name=name, spec=spec, theta=theta, row=row, largest_command=LARGEST_CURRENT)


def signals_of(
    rig: Rig,
    law: mr.ControlLaw | UserLaw,
    motions: list[mr.GroundMotion],
    *,
    observer_frame: mr.Building | None = None,
    threads: int = 0,
) -> list[Signals]:
    """Signals of the rig under each motion of the table, as they are; the observer takes it for `observer_frame`."""
    responses = mr.simulate_loop(
        rig.frame,
        [rig.damper],
        law,
        motions,
        rig.hardware,
        histories=True,
        nominal=observer_frame,
        threads=threads,
    )
    histories = responses.histories
    assert histories is not None
    return [
        Signals(
            time=each.time,
            table=each.ground_acceleration,
            displacement=each.drift[:, 0],
            acceleration=each.acceleration[:, 0],
            force=each.force[:, 0],
            current=each.current[:, 0],
        )
        for each in histories
    ]


def recorded(signals: Signals, rng: np.random.Generator, sensors: Sensors = SENSORS) -> Signals:
    """What the sensors make of signals."""

    def seen(values: Floats, sensor: Sensor) -> Floats:
        noisy = sensor.gain * values + sensor.noise * rng.standard_normal(values.size)
        return np.asarray(sensor.resolution * np.round(noisy / sensor.resolution))

    return replace(
        signals,
        table=seen(signals.table, sensors.acceleration),
        displacement=seen(signals.displacement, sensors.displacement),
        acceleration=seen(signals.acceleration, sensors.acceleration),
        force=seen(signals.force, sensors.force),
        current=seen(signals.current, sensors.current),
    )
