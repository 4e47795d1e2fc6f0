"""Hardware of the loop between building and damper: sampling, delay, sensors, rate limit, faults.

Its fields are also the keys of [hardware] in a study file, where floors and dampers count from 1.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from types import SimpleNamespace
from typing import Annotated, Any, ClassVar, Literal

from mrwork.base.arguments import May, checked
from mrwork.base.hints import Within
from mrwork.base.keys import key, optional, positive
from mrwork.base.summary import Summarised, Summary
from mrwork.errors import InvalidSettingError, SettingError

LoopSignal = Literal["acceleration", "deformation", "force", "command", "ground_acceleration", "drift"]
Feedback = Literal["state", "observer"]

# Larger numbers are mistakes of unit; the first leaves room for the additional steps of stiff dampers.
_MOST_STEPS_OF_SAMPLE = 10_000
_LONGEST_DELAY = 1_000_000
_LONGEST_PREVIEW = 2.0
# Usual samples and delays [s].
_DELAYS = (1e-6, 0.1)
# Settings of the sensors that only the observer reads.
_OF_OBSERVER = ("measured_floors", "known_ground", "kinematic")
_ACCELEROMETERS = ("acceleration_noise", "acceleration_resolution")
_OF_DRIFTS = ("drift_noise", "drift_resolution")
_UNREAD = (
    "has no effect with feedback of the state and laws that read no accelerations; leave it out, or set `feedback` to "
    "'observer'"
)


@checked
class Fault:
    """A temporary fault of a signal: a sensor of a floor, storey, damper or the ground, or the command of a damper.

    `index` counts floors for an acceleration, storeys for a drift and devices otherwise; the ground has one sensor.
    During the fault the signal has `value`: "hold" for the last value before it, or a number; `math.nan` is a sensor
    without signal.

    Raises
    ------
    SettingError
        If there is no such channel, or a number is out of range.
    """

    _made_by: ClassVar[str] = "mr.closed_loop.Fault(channel=...)"

    channel: LoopSignal = key("signal that fails", named="signal")
    index: int = key(
        "number of the floor, storey or damper, from 1, lowest first",
        default=0,
        least=0,
        from_one=True,
        named="number",
    )
    start: float = key("start of the fault", unit="s", default=0.0, least=0.0)
    end: float = key("end of the fault", unit="s", default=math.inf, least=0.0)
    value: Annotated[float, May.BE_INFINITE, May.BE_NAN] | Literal["hold"] = key(
        "value during the fault, may be nan; by default the last one before it", default="hold"
    )

    def __post_init__(self) -> None:
        if self.start >= self.end:
            raise SettingError(
                f"a fault lasts from {self.start} s to {self.end} s; give an end after its start"
            )
        if self.channel == "ground_acceleration" and self.index:
            raise InvalidSettingError(
                "index", "the ground has one sensor of its acceleration; leave its number out"
            )


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Hardware(Summarised):
    """The loop between building and dampers: sampling, delay, feedback, sensors, limit of the command's rate, faults.

    The result of an on/off law depends on the sample time. Stiff dampers take more integration steps than `step` asks
    for. With feedback of the state, laws receive the true displacements and velocities, and deformations, forces and
    the acceleration of the ground from their sensors; with feedback of the observer, a Kalman filter estimates the
    state from the accelerations of the measured floors, the deformations and forces of the devices, and the drifts of
    the measured storeys. Noise is white; its seed is the same for all laws and candidates under the same motion.

    Of a ground record whose interval is shorter than an integration step, by more than a thousandth, the step takes the
    line with the mean and the first moment of the samples in it, and sensors of the ground read the mean over the step
    before. Other records are read at start, middle and end of each step.
    """

    _made_by: ClassVar[str] = "mr.Hardware(sample_time=...)"

    sample_time: float = positive("time between two commands", unit="s", default=1e-3, usual=_DELAYS)
    step: float = positive(
        "longest integration step; a sample is the smallest whole number of equal steps that are not longer",
        unit="s",
        default=5e-4,
    )
    delay: float = key(
        "time from a measurement to its command, a whole number of steps",
        unit="s",
        default=0.0,
        least=0.0,
        usual=_DELAYS,
    )
    command_rate: float = positive(
        "largest rate of the command, of actuators of the force", unit="A/s or V/s or N/s", default=math.inf
    )
    feedback: Feedback = key(
        "feedback of the law: the true state, or the estimate of an observer", default="state"
    )
    measured_floors: tuple[int, ...] | None = optional(
        "floors with an accelerometer for the observer, from 1; all by default", least=0, from_one=True
    )
    measured_storeys: tuple[int, ...] = key(
        "storeys with a sensor of their drift, from 1, for the observer and laws in Python; none by default",
        default=(),
        least=0,
        from_one=True,
    )
    known_ground: bool = key(
        "whether the observer takes the acceleration of the ground from its sensor, which it otherwise estimates",
        default=False,
    )
    kinematic: bool = key(
        "whether the observer integrates the accelerations of all floors and of the ground, corrected by the drifts of "
        "the measured storeys, and knows nothing else of the frame: for frames that yield",
        default=False,
    )
    noise_ratio: float = positive(
        "intensity of ground over sensor noise, S_ag/S_v, in the design of the observer", default=50.0
    )
    acceleration_noise: float = key(
        "standard deviation of the noise, for the observer and laws that read accelerations",
        unit="m/s2",
        default=0.0,
        least=0.0,
    )
    deformation_noise: float = key("standard deviation of the noise", unit="m", default=0.0, least=0.0)
    drift_noise: float = key(
        "standard deviation of the noise, of the measured storeys", unit="m", default=0.0, least=0.0
    )
    force_noise: float = key("standard deviation of the noise", unit="N", default=0.0, least=0.0)
    acceleration_resolution: float = key("quantisation, for the same", unit="m/s2", default=0.0, least=0.0)
    deformation_resolution: float = key("quantisation", unit="m", default=0.0, least=0.0)
    drift_resolution: float = key("quantisation, of the same", unit="m", default=0.0, least=0.0)
    force_resolution: float = key("quantisation", unit="N", default=0.0, least=0.0)
    ground_acceleration_noise: float = key(
        "standard deviation of the noise, for laws that read it", unit="m/s2", default=0.0, least=0.0
    )
    ground_acceleration_resolution: float = key(
        "quantisation, for laws that read it", unit="m/s2", default=0.0, least=0.0
    )
    ground_preview: float = key(
        "time for which a law that forecasts the ground acceleration is told it ahead: a bound, no sensor tells it",
        unit="s",
        default=0.0,
        least=0.0,
        most=_LONGEST_PREVIEW,
    )
    seed: Annotated[int, Within(least=0, most=2**32 - 1)] = 0
    faults: tuple[Fault, ...] = key("faults", default=(), named="fault")

    def __post_init__(self) -> None:
        for name, sentence in self._mistakes():
            raise InvalidSettingError(name, sentence)

    def _mistakes(self) -> Iterator[tuple[str | tuple[()], str]]:
        if (
            self.sample_time / self.step > _MOST_STEPS_OF_SAMPLE
            or self.delay / self.sample_time > _LONGEST_DELAY
        ):
            yield (
                (),
                f"`step` is {self.step} s and `delay` {self.delay} s for samples of {self.sample_time} s; give at most "
                f"{_MOST_STEPS_OF_SAMPLE} steps to a sample, and {_LONGEST_DELAY} samples of delay",
            )
        if abs(self.delay / self._step - self.delay_steps) > 1e-6:
            yield (
                (),
                f"`delay` is {self.delay} s, which is not a whole number of integration steps of {self._step:g} s; "
                "give a multiple of them, or a finer `step`",
            )
        for name in ("measured_floors", "measured_storeys"):
            places = getattr(self, name) or ()
            if len(set(places)) < len(places):
                yield name, f"`{name}` are {list(places)}; give each once"
        storeys = self.measured_storeys
        for name in (name for name in _OF_DRIFTS if getattr(self, name) and not storeys):
            yield name, f"`{name}` is of sensors that no storey has; give `measured_storeys`, or leave it out"
        for fault in self.faults:
            if fault.channel == "drift" and fault.index not in storeys:
                yield (
                    "faults",
                    f"a fault is of the drift of storey {fault.index + 1}, which no sensor measures; give it in "
                    "`measured_storeys`",
                )
        if self.kinematic and not storeys:
            yield (
                "kinematic",
                "`kinematic` corrects what it integrates by measured drifts; give `measured_storeys`, all of them",
            )
        for name in (name for name in _OF_OBSERVER if getattr(self, name) and self.feedback == "state"):
            yield (
                name,
                f"`{name}` has no effect with feedback of the state, which needs no accelerations; leave it out, or "
                "set `feedback` to 'observer'",
            )

    @property
    def steps(self) -> int:
        """Integration steps per sample."""
        return max(1, math.ceil(self.sample_time / self.step * (1.0 - 1e-9)))

    @property
    def delay_steps(self) -> int:
        """The delay in integration steps of the loop, to the nearest whole one."""
        return round(self.delay / self._step)

    @property
    def changes_command(self) -> bool:
        """Whether a limited rate or faults change a command after the law has sent it."""
        return math.isfinite(self.command_rate) or any(fault.channel == "command" for fault in self.faults)

    @property
    def sensors(self) -> list[list[float]]:
        """Noise and resolution of accelerations, deformations, drifts, forces and the ground's acceleration."""
        signals = "acceleration", "deformation", "drift", "force", "ground_acceleration"
        return [[getattr(self, f"{of}_noise"), getattr(self, f"{of}_resolution")] for of in signals]

    @property
    def observes_ground(self) -> bool:
        """Whether the observer takes the acceleration of the ground from its sensor."""
        return self.known_ground or self.kinematic

    @property
    def _step(self) -> float:
        return self.sample_time / self.steps

    @property
    def sampled_faults(self) -> list[Any]:
        """The faults for the core: from sample `start` up to `end`, with no `value` where the last one is held."""
        return [
            SimpleNamespace(
                channel=fault.channel,
                index=fault.index,
                start=self._sample(fault.start),
                end=self._sample(fault.end),
                value=None if fault.value == "hold" else float(fault.value),
            )
            for fault in self.faults
        ]

    def _sample(self, time: float) -> int:
        most = 2**62
        return most if math.isinf(time) else min(most, math.ceil(time / self.sample_time * (1.0 - 1e-9)))

    def _summary(self) -> Summary:
        return Summary(
            title="Hardware of the loop",
            facts=[
                (field.name.replace("_", " "), str(getattr(self, field.name)))
                for field in fields(self)
                if getattr(self, field.name) != field.default
            ],
            notes=("Settings that are not listed have their defaults.",),
        )


def refuse_unread(hardware: Hardware, *, accelerations: bool, forecasts: bool, drifts: bool = False) -> None:
    """Refuse settings of accelerometers, drift sensors and a preview of the ground that nothing reads."""
    if hardware.ground_preview and not forecasts:
        raise InvalidSettingError(
            "ground_preview",
            "`ground_preview` has no effect on laws that do not forecast the ground; leave it out, or add a "
            "predictive_rollout",
        )
    if hardware.feedback == "observer":
        return
    if hardware.measured_storeys and not drifts:
        raise InvalidSettingError(
            "measured_storeys",
            "`measured_storeys` have no effect with feedback of the state and laws that read no drifts; leave them "
            "out, or set `feedback` to 'observer'",
        )
    if accelerations:
        return
    for name in _ACCELEROMETERS:
        if getattr(hardware, name):
            raise InvalidSettingError(name, f"`{name}` {_UNREAD}")
    if any(fault.channel == "acceleration" for fault in hardware.faults):
        raise SettingError(f"a fault of the accelerations {_UNREAD}")
