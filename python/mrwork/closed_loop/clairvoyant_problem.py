"""The problem of a non-causal optimum: score of a command history in the loop, and its twin for gradients."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mrwork.buildings.devices import Device
from mrwork.buildings.matrices import Building
from mrwork.closed_loop.evaluation import SCORE, criterion
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.prescribed import PrescribedCommands, samples_of, simulate_prescribed
from mrwork.closed_loop.responses import Responses, axis_of
from mrwork.closed_loop.simulate import simulate_loop
from mrwork.control.laws import ControlLaw
from mrwork.errors import SettingError
from mrwork.motions.ground_motion import GroundMotion
from mrwork.values import holds_arrays

if TYPE_CHECKING:
    from mrwork.twins.loop.prescribed import PrescribedLoop

Floats = NDArray[np.float64]

# Longest step of the twin [s], and the difference of its criteria from those of the loop above which it is halved.
_LONGEST_STEP = 2e-3
_AGREEMENT = 2e-3


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class ClairvoyantProblem:
    """Score of commands over intervals, for a building with devices under one motion.

    Attributes
    ----------
    interval
        Interval over which a command is held [s].
    floors, storeys
        Indices of the floors and storeys that count in the score; all by default.
    """

    building: Building
    devices: tuple[Device, ...]
    motion: GroundMotion
    hardware: Hardware
    interval: float
    floors: tuple[int, ...] | None = None
    storeys: tuple[int, ...] | None = None
    threads: int = 0
    _at_rest: Floats = field(init=False, repr=False)
    _steps: int = field(init=False, repr=False)
    _twin: PrescribedLoop | None = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        samples_of(self.interval, self.hardware.sample_time)
        if self.building.elements:
            raise SettingError(
                f"{self.building.name} has {self.building.elements[0].name}, and the gradients of a clairvoyant are "
                "those of a building without passive elements; leave the clairvoyant out, or the element"
            )
        for device in self.devices:
            if not device.spec.follows_command:
                raise SettingError(
                    f"{device.name}: no parameter of {device.spec.name} depends on the command, so there is no command "
                    "to be chosen; give a damper with current laws"
                )
            if len(device.draws) > 1:
                raise SettingError(
                    f"{device.name} has {len(device.draws)} draws of its parameters; give one, as their mean"
                )
        # Nothing is measured.
        object.__setattr__(
            self,
            "hardware",
            Hardware(
                sample_time=self.hardware.sample_time,
                step=self.hardware.step,
                delay=self.hardware.delay,
                command_rate=self.hardware.command_rate,
                faults=tuple(fault for fault in self.hardware.faults if fault.channel == "command"),
            ),
        )
        passive = self._constants(np.zeros(1))
        object.__setattr__(self, "_at_rest", self._criteria(passive)[0])
        if not (np.isfinite(self._at_rest).all() and (self._at_rest > 0.0).all()):
            raise SettingError(
                f"{self.motion.name}: the run at i = 0 did not finish or has no response, so there is no score"
            )
        object.__setattr__(self, "_steps", int(passive.steps[0]))

    @property
    def largest(self) -> Floats:
        """Largest command of each device, shape (n_devices,)."""
        return np.array([device.largest_command for device in self.devices])

    @property
    def n_intervals(self) -> int:
        """Number of commands of each device."""
        return max(1, math.ceil(self.motion.duration / self.interval * (1.0 - 1e-9)))

    @property
    def twin(self) -> PrescribedLoop:
        """The loop in JAX, with the longest step at which its criteria are those of the loop within 0.2 %."""
        if self._twin is None:
            object.__setattr__(self, "_twin", self._agreeing_twin())
        assert self._twin is not None
        return self._twin

    def constant(self, share: float) -> Floats:
        """A constant share of the largest command, shape (n_intervals, n_devices)."""
        return np.tile(share * self.largest, (self.n_intervals, 1))

    def fitted(self, commands: PrescribedCommands) -> Floats:
        """Commands with the intervals of this problem, within the range of the devices; cut or held at the end."""
        if abs(commands.interval - self.interval) > 1e-9 or commands.command.shape[1] != len(self.devices):
            raise SettingError(
                f"a start has commands of {commands.interval:g} s for {commands.command.shape[1]} devices; give "
                f"{self.interval:g} s and {len(self.devices)} devices"
            )
        missing = max(0, self.n_intervals - len(commands.command))
        held = np.pad(commands.command, ((0, missing), (0, 0)), mode="edge")[: self.n_intervals]
        return np.clip(held, 0.0, self.largest)

    def simulate(self, commands: Floats, *, histories: bool = False, step_factor: int = 1) -> Responses:
        """The run of the loop with these commands."""
        return simulate_prescribed(
            self.building,
            self.devices,
            PrescribedCommands(interval=self.interval, command=commands),
            self.motion,
            self.hardware,
            histories=histories,
            step_factor=step_factor,
            threads=self.threads,
        )

    def criteria_of(self, run: Responses) -> Floats:
        """Criteria of the score, in its order, shape (4,)."""
        return np.asarray(self._criteria(run)[0])

    def ratios_of(self, run: Responses) -> Floats:
        """Criteria of the score over their values at i = 0, shape (4,)."""
        return np.asarray(self.criteria_of(run) / self._at_rest)

    def score(self, commands: Floats) -> float:
        """Score of commands in the loop; infinite if the run does not finish."""
        return float(self.ratios_of(self.simulate(commands)).mean())

    def constant_scores(self, shares: Floats) -> Floats:
        """Scores of constant shares of the largest command, shape (n_shares,)."""
        return np.asarray((self._criteria(self._constants(shares)) / self._at_rest).mean(axis=1))

    def _constants(self, shares: Floats) -> Responses:
        law = ControlLaw(name="passive", gains={"command": np.outer(shares, self.largest)})
        hardware = replace(self.hardware, faults=())
        return simulate_loop(self.building, self.devices, law, [self.motion], hardware, threads=self.threads)

    def _criteria(self, run: Responses) -> Floats:
        """Criteria of the score of each run, shape (n_runs, 4)."""
        counted = {"floor": self.floors, "storey": self.storeys}
        columns = []
        for name in SCORE:
            quantity = criterion(name).quantity
            values, places = np.asarray(getattr(run, quantity)), counted[axis_of(quantity)]
            columns.append((values if places is None else values[:, list(places)]).max(axis=1))
        return np.stack(columns, axis=-1)

    def _agreeing_twin(self) -> PrescribedLoop:
        """The twin with the longest step at which it agrees with the loop; at least the step of the loop."""
        tried = self.constant(0.5)
        expected = self.ratios_of(self._constants(np.array([0.5])))
        shortest = self.hardware.sample_time / self._steps
        count = math.ceil(self.interval / _LONGEST_STEP * (1.0 - 1e-9))
        # A command arrives at a step.
        while (
            self.interval / count > shortest
            and abs(math.remainder(self.hardware.delay, self.interval / count)) > 1e-9
        ):
            count += 1
        while True:
            twin = self._twin_of(self.interval / count)
            worst = float(np.max(np.abs(twin.ratios(tried) / expected - 1.0)))
            if worst < _AGREEMENT:
                return twin
            if self.interval / count <= shortest * (1.0 + 1e-9):
                raise SettingError(
                    f"{self.motion.name}: the criteria of the twin differ from those of the loop by "
                    f"{100.0 * worst:.2g} % at the step of the loop; give the hardware a shorter `step`"
                )
            count *= 2

    def _twin_of(self, step: float) -> PrescribedLoop:
        # JAX takes a second to load, and no verb needs it unless a clairvoyant is asked for.
        from mrwork.twins.loop.prescribed import CriteriaAtRest, prescribed_loop

        return prescribed_loop(
            matrices={
                name: np.asarray(getattr(self.building, name), dtype=np.float64)
                for name in ("mass", "damping", "stiffness", "influence")
            }
            | {
                "floors": _rows(self.building.floors, self.floors),
                "storeys": _rows(self.building.storeys, self.storeys),
            },
            devices=[
                (device.spec, device.draws[0], np.asarray(device.row), device.count, device.differential)
                for device in self.devices
            ],
            acceleration=self.motion.acceleration,
            dt=self.motion.dt,
            duration=self.motion.duration,
            step_time=step,
            interval=self.interval,
            delay=self.hardware.delay,
            scales=CriteriaAtRest(*map(float, self._at_rest)),
        )


def _rows(rows: Floats, chosen: tuple[int, ...] | None) -> Floats:
    found = np.asarray(rows, dtype=np.float64)
    return found if chosen is None else found[list(chosen)]
