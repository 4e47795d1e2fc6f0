"""Hardware of the loop between building and damper: sampling, delay, sensors, rate limit, faults."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Annotated, ClassVar, Literal

from mrwork.arguments import May, NotNegative, Positive, Within, checked
from mrwork.errors import InvalidSettingError, SettingError
from mrwork.summary import Summarised, Summary

LoopSignal = Literal["acceleration", "deformation", "force", "command"]
Feedback = Literal["state", "observer"]

# The seed is the upper half of the number of a random stream, the motion the lower.
_SEEDS = 2**32
# Larger numbers are mistakes of unit; the first leaves room for the additional steps of stiff dampers.
_MOST_STEPS = 10_000
_LONGEST_DELAY = 1_000_000
# Settings of the sensors that only the observer reads.
_OF_OBSERVER = ("measured_floors", "acceleration_noise", "acceleration_resolution")
_NO_EFFECT = (
    "has no effect with feedback of the state, which needs no accelerations; leave it out, or set `feedback` to "
    "'observer'"
)


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A fault of a signal from `start` to `end` [s].

    `index` counts from 0, floors for an acceleration and devices otherwise. During the fault the signal has `value`:
    "hold" for the last value before it, or a number; `math.nan` is a sensor without signal.

    Raises
    ------
    SettingError
        If there is no such channel, or a number is out of range.
    """

    _made_by: ClassVar[str] = "mr.closed_loop.Fault(channel=...)"

    channel: LoopSignal
    index: Annotated[int, Within(least=0)] = 0
    start: float = 0.0
    end: float = math.inf
    value: Annotated[float, May.BE_NAN, May.BE_INFINITE] | Literal["hold"] = "hold"

    def __post_init__(self) -> None:
        if not 0.0 <= self.start <= self.end:
            raise SettingError(
                f"a fault lasts from {self.start} s to {self.end} s; give times from 0, in their order"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledFault:
    """A fault from sample `start` up to `end`; `value` is `None` if the last one before is held."""

    channel: LoopSignal
    index: int
    start: int
    end: int
    value: float | None


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Hardware(Summarised):
    """Sampling, delay, feedback and sensors of the loop.

    Parameters
    ----------
    sample_time
        Time between two commands [s]; the result of an on/off law depends on it.
    step
        Longest integration step [s]; a sample is divided into the smallest number of equal steps that are not longer.
        Stiff dampers take more steps.
    delay
        Time from a measurement to its command [s], a whole number of integration steps.
    command_rate
        Largest rate of the command [A/s or V/s].
    feedback
        "state": laws receive the true displacements and velocities, and deformations and forces from their sensors.
        "observer": a Kalman filter estimates the state from the accelerations of `measured_floors` and the
        deformations and forces of the devices.
    measured_floors
        Floors with an accelerometer, from 0; all by default.
    noise_ratio
        S_ag/S_v in the design of the observer.
    acceleration_noise, deformation_noise, force_noise
        Standard deviations of the white noise of the sensors [m/s^2, m, N]; that of accelerations is for the observer.
    acceleration_resolution, deformation_resolution, force_resolution
        Quantisation of the sensors [m/s^2, m, N]; none if zero.
    seed
        Seed of the noise; it is the same for all laws and candidates under the same motion.
    """

    _made_by: ClassVar[str] = "mr.Hardware(sample_time=...)"

    sample_time: Positive = 1e-3
    step: Positive = 5e-4
    delay: NotNegative = 0.0
    command_rate: Positive = math.inf
    feedback: Feedback = "state"
    measured_floors: tuple[Annotated[int, Within(least=0)], ...] | None = None
    noise_ratio: Positive = 50.0
    acceleration_noise: NotNegative = 0.0
    deformation_noise: NotNegative = 0.0
    force_noise: NotNegative = 0.0
    acceleration_resolution: NotNegative = 0.0
    deformation_resolution: NotNegative = 0.0
    force_resolution: NotNegative = 0.0
    seed: int = 0
    faults: tuple[Fault, ...] = ()

    def __post_init__(self) -> None:
        if not 0 <= self.seed < _SEEDS:
            raise SettingError(f"`seed` is {self.seed}; give a whole number from 0 to 2^32 - 1")
        if self.sample_time / self.step > _MOST_STEPS or self.delay / self.sample_time > _LONGEST_DELAY:
            raise SettingError(
                f"`step` is {self.step} s and `delay` {self.delay} s for samples of {self.sample_time} s; give at most "
                f"{_MOST_STEPS} steps to a sample, and {_LONGEST_DELAY} samples of delay"
            )
        if abs(self.delay / self._step - self.delay_steps) > 1e-6:
            raise SettingError(
                f"`delay` is {self.delay} s, which is not a whole number of integration steps of {self._step:g} s; "
                f"give a multiple of them, or a finer `step`"
            )
        floors = self.measured_floors or ()
        if len(set(floors)) < len(floors):
            raise InvalidSettingError(
                "measured_floors", f"`measured_floors` are {list(floors)}; give each once"
            )
        if self.feedback == "state":
            for name in _OF_OBSERVER:
                if getattr(self, name):
                    raise InvalidSettingError(name, f"`{name}` {_NO_EFFECT}")
            if any(fault.channel == "acceleration" for fault in self.faults):
                raise SettingError(f"a fault of the accelerations {_NO_EFFECT}")

    @property
    def steps(self) -> int:
        """Integration steps per sample."""
        return max(1, math.ceil(self.sample_time / self.step * (1.0 - 1e-9)))

    @property
    def delay_steps(self) -> int:
        """Integration steps of the delay."""
        return round(self.delay / self._step)

    @property
    def sensors(self) -> list[list[float]]:
        """Noise and resolution of accelerations, deformations and forces."""
        return [
            [self.acceleration_noise, self.acceleration_resolution],
            [self.deformation_noise, self.deformation_resolution],
            [self.force_noise, self.force_resolution],
        ]

    @property
    def _step(self) -> float:
        return self.sample_time / self.steps

    @property
    def sampled_faults(self) -> list[SampledFault]:
        """The faults in samples."""
        return [
            SampledFault(
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
