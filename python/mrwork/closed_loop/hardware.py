"""What stands between the building and the damper's coil: sampling, delay, sensors, limits, faults."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Literal, get_args

from mrwork.errors import SettingError
from mrwork.summary import Summarised, Summary

Channel = Literal["acceleration", "deformation", "force", "command"]
Feedback = Literal["state", "observer"]

# The seed has the upper half of a stream's number, the motion the lower.
_SEEDS = 2**32
# Beyond these a number was meant in another unit; the first still leaves room for what stiff dampers ask for.
_MOST_STEPS = 10_000
_LONGEST_DELAY = 1_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A signal that is broken from `start` to `end` [s].

    `index` counts floors for an acceleration, devices otherwise, from 0. Meanwhile the signal has `value`: "hold" for
    the last one before, or a number; `math.nan` is a sensor that gives none.

    Raises
    ------
    SettingError
        Where there is no such channel, or a number makes no sense.
    """

    channel: Channel
    index: int = 0
    start: float = 0.0
    end: float = math.inf
    value: float | Literal["hold"] = "hold"

    def __post_init__(self) -> None:
        channels = get_args(Channel)
        if self.channel not in channels:
            raise SettingError(f"a fault is in {', '.join(channels)}, not in {self.channel!r}")
        if self.index < 0:
            raise SettingError(f"the index of a fault is {self.index}; count from 0")
        if not 0.0 <= self.start <= self.end:
            raise SettingError(
                f"a fault lasts from {self.start} s to {self.end} s; give times from 0, in their order"
            )
        if isinstance(self.value, str) and self.value != "hold":
            raise SettingError(f'the value of a fault is {self.value!r}; give "hold" or a number')


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Hardware(Summarised):
    """How the loop is run.

    Parameters
    ----------
    sample_time
        From one command to the next [s]; on/off laws give reproducible numbers only at a stated one.
    step
        Longest integration step [s]; a sample has the fewest equal steps that are no longer. Stiff dampers take
        more of their own accord.
    delay
        From a measurement until its command is sent [s], in whole integration steps.
    command_rate
        How fast the command may change [A/s or V/s].
    feedback
        "state": laws see displacements and velocities as they are, deformation and force through their sensors.
        "observer": a Kalman filter estimates the state from the accelerations of `measured_floors` and the devices'
        deformations and forces.
    measured_floors
        Floors with an accelerometer, from 0; all where `None`.
    noise_ratio
        S_ag/S_v of the observer's design.
    acceleration_noise, deformation_noise, force_noise
        Standard deviations of the sensors' white noise [m/s^2, m, N].
    acceleration_resolution, deformation_resolution, force_resolution
        Widths of their steps; none where zero.
    seed
        Of the noise: all laws and candidates have the same under the same motion.
    """

    sample_time: float = 1e-3
    step: float = 5e-4
    delay: float = 0.0
    command_rate: float = math.inf
    feedback: Feedback = "state"
    measured_floors: tuple[int, ...] | None = None
    noise_ratio: float = 50.0
    acceleration_noise: float = 0.0
    deformation_noise: float = 0.0
    force_noise: float = 0.0
    acceleration_resolution: float = 0.0
    deformation_resolution: float = 0.0
    force_resolution: float = 0.0
    seed: int = 0
    faults: tuple[Fault, ...] = ()

    def __post_init__(self) -> None:
        for name in ("sample_time", "step", "command_rate", "noise_ratio"):
            value = getattr(self, name)
            if not value > 0.0 or (math.isinf(value) and name != "command_rate"):
                raise SettingError(f"`{name}` is {value}; give a positive number")
        for quantity in ("acceleration", "deformation", "force"):
            for name in (f"{quantity}_noise", f"{quantity}_resolution"):
                value = getattr(self, name)
                if not 0.0 <= value < math.inf:
                    raise SettingError(f"`{name}` is {value}; give zero or a positive number")
        if not 0 <= self.seed < _SEEDS:
            raise SettingError(f"`seed` is {self.seed}; give a whole number from 0 to 2^32 - 1")
        if not 0.0 <= self.delay < math.inf:
            raise SettingError(f"`delay` is {self.delay} s; give zero or a positive number")
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

    def fault_rows(self) -> list[tuple[str, int, int, int, float | None]]:
        """The faults in samples; no value where the last one before is held."""
        return [
            (
                fault.channel,
                fault.index,
                self._sample(fault.start),
                self._sample(fault.end),
                None if fault.value == "hold" else float(fault.value),
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
            notes=("What is not listed has its default.",),
        )
