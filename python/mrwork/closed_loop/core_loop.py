"""A call of the loop as values for any process, and as the core takes it: what its runs share, and these runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork import _rust
from mrwork.base.values import Floats, array_dataclass
from mrwork.buildings.device import Device, as_actuators, elongation_rows, sprung_rows
from mrwork.buildings.groups import commanded, device_groups, sends_forces
from mrwork.buildings.plane_building import Building
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.observer import core_observer
from mrwork.closed_loop.recorded_law import RecordedLaw
from mrwork.control.laws.control_law import ControlLaw
from mrwork.control.laws.counterpart import is_curve
from mrwork.control.linear.lqr import Observer
from mrwork.errors import SettingError
from mrwork.motions.ground_motion import GroundMotion

Places = slice | NDArray[np.intp]
Simulator = Callable[..., Any]
"""Takes places of runs, and a law in Python as the core asks it; returns what `_rust.respond` does."""

# Seconds of the factors of the mass matrix and of the bounds on the frequencies, per coordinate cubed.
_SECONDS = 3e-9
# They are ready in ten seconds.
_MOST_COORDINATES = 1500


@array_dataclass()
class RunsOfLoop:
    """Runs of a loop: candidate, motion, draw, building and delay of each, shape (n_runs, 5), with its stream of noise.

    `gains` (n_candidates, n_gains), `settings` of a law of the user on a tape (n_candidates, n_settings), `shaping`
    (n_candidates, 2) or `None`, `theta` of each group of devices (n_draws, n_devices, n_columns).
    """

    runs: NDArray[np.uint32]
    streams: NDArray[np.uint64]
    gains: Floats
    settings: Floats
    shaping: Floats | None
    theta: tuple[Floats, ...]

    def part(self, which: slice) -> RunsOfLoop:
        """Some of the runs, with the candidates and the draws from their first to their last ones."""
        runs = self.runs[which].copy()
        candidates, draws = (slice(int(ids.min()), int(ids.max()) + 1) for ids in (runs[:, 0], runs[:, 2]))
        runs[:, 0] -= np.uint32(candidates.start)
        runs[:, 2] -= np.uint32(draws.start)
        return RunsOfLoop(
            runs=runs,
            streams=self.streams[which],
            gains=self.gains[candidates],
            settings=self.settings[candidates],
            shaping=None if self.shaping is None else self.shaping[candidates],
            theta=tuple(parameters[draws] for parameters in self.theta),
        )


@array_dataclass()
class LoopOfRuns:
    """What the runs of a call share, in values that can be sent to another process; designs are made already.

    The gains of `law` are zeros, `varied` are pairs of damping and stiffness.
    """

    building: Building
    varied: tuple[tuple[Floats, Floats], ...]
    devices: tuple[Device, ...]
    law: ControlLaw
    hardware: Hardware
    observer: Observer | None
    motions: tuple[GroundMotion, ...]
    step_factor: int
    # A law of the user, which commands instead of `law`.
    own: RecordedLaw | None = None
    # Whether the observer estimates absolute velocities.
    estimates_absolute: bool = False

    @property
    def n_commanded(self) -> int:
        """Number of devices that the law commands, which are the first ones."""
        return len(commanded(self.devices))

    def _reads_absolute(self, motion: GroundMotion) -> bool:
        """Whether the state of the law has absolute velocities: no estimate of relative ones gives them."""
        known = self.observer is None or self.estimates_absolute
        return known and self.law.reads_absolute(motion)

    def core(self) -> CoreLoop:
        """The same for the core, which is made anew in each process."""
        building = _core_building(self.building, self.devices, self.varied)
        return CoreLoop(
            loop=self,
            building=building,
            observer=None
            if self.observer is None
            else core_observer(
                self.observer,
                self.building,
                self.devices,
                self.hardware,
                is_absolute=self.estimates_absolute,
            ),
            waves=[
                (
                    motion.dt,
                    *map(np.ascontiguousarray, (motion.acceleration, motion.forces)),
                    self._reads_absolute(motion),
                )
                for motion in self.motions
            ],
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CoreLoop:
    """What the runs of a call share, as the core takes it."""

    loop: LoopOfRuns
    building: _rust.Building
    observer: _rust.Observer | None
    # Time step, acceleration, and forces on floors of each motion.
    waves: list[Any]

    def simulator(
        self, runs: RunsOfLoop, *, histories: bool = False, threads: int = 0, changes: Floats | None = None
    ) -> Simulator:
        """A function that simulates the runs at some places."""
        loop = self.loop
        law, n = loop.law, loop.n_commanded
        dampers = core_dampers(loop.devices, runs.theta)
        controller = core_controller(law, runs.gains, runs.shaping)
        own = None if loop.own is None else core_own_law(loop.own, runs.settings)

        def simulate(places: Places, outside: Any = None) -> Any:
            return _rust.respond(
                self.building,
                dampers,
                controller,
                loop.hardware,
                self.waves,
                np.ascontiguousarray(runs.runs[places]),
                runs.streams[places],
                observer=self.observer,
                histories=histories,
                step_factor=loop.step_factor,
                threads=threads,
                outside=outside,
                changes=None if changes is None else changes[None],
                n_commanded=n,
                own=own,
            )

        return simulate


def with_actuators(
    devices: Sequence[Device], law: ControlLaw, hardware: Hardware
) -> tuple[tuple[Device, ...], Sequence[Device], Hardware]:
    """The commanded devices, all, and the hardware: actuators in the places of dampers where a law commands forces."""
    driven = commanded(devices)
    if not law.spec.commands_force:
        return driven, devices, hardware
    if not sends_forces(devices):
        # Its rate is one of the drivers of dampers.
        hardware = replace(hardware, command_rate=math.inf)
    driven = as_actuators(driven, law.largest_force)
    return driven, (*driven, *devices[len(driven) :]), hardware


def respond_alone(core: CoreLoop, runs: RunsOfLoop) -> list[NDArray[Any]]:
    """Runs of a loop in a process of their own, on one thread: summaries, outcomes, steps, without histories."""
    return list(core.simulator(runs, threads=1)(slice(None))[:3])


def theta_of(devices: Sequence[Device]) -> tuple[Floats, ...]:
    """Parameters of each group of devices, shape (n_draws, n_devices of the group, n_columns)."""
    n_draws = max(len(device.draws) for device in devices)
    if any(len(device.draws) not in (1, n_draws) for device in devices):
        counts = ", ".join(str(len(device.draws)) for device in devices)
        raise SettingError(f"the devices have {counts} draws; give the same number for each device, or one")
    return tuple(
        np.stack(
            [
                np.broadcast_to(devices[member].draws, (n_draws, len(devices[member].spec.parameters)))
                for member in group
            ],
            axis=1,
        )
        for group in device_groups(devices)
    )


def core_dampers(devices: Sequence[Device], theta: Sequence[Floats]) -> list[_rust.Dampers]:
    """Devices for the core, with parameters (n_draws, n_devices of the group, n_columns) of each group."""
    groups = [[devices[member] for member in group] for group in device_groups(devices)]
    return [
        _rust.Dampers(
            model=group[0].spec.core_name,
            laws=[*map(str, group[0].spec.laws)],
            rates=group[0].spec.n_rates,
            theta=np.ascontiguousarray(parameters),
            counts=[float(device.count) for device in group],
            differential=[device.differential for device in group],
            ranges=[_range_of(device) for device in group],
        )
        for group, parameters in zip(groups, theta, strict=True)
    ]


def core_controller(law: ControlLaw, gains: Floats, shaping: Floats | None) -> _rust.Controller:
    """A law for the core, with gains (n_candidates, n_gains) and perhaps shaping, (n_candidates, 2)."""
    curve = None
    if law.curve is not None:
        spec, theta = law.curve
        if not is_curve(spec):
            raise SettingError(
                f"the curve of {law.name} is a {spec.name}; give a static_hysteretic with current laws"
            )
        numbers = np.ascontiguousarray(theta, dtype=np.float64)
        curve = _rust.ForceCurve([*map(str, spec.laws)], numbers, spec.n_rates)
    rows = np.ascontiguousarray(gains)
    return _rust.Controller(law.name, rows, law.table_rows(), curve, shaping, _core_model(law))


def core_own_law(law: RecordedLaw, settings: Floats) -> _rust.LawTape:
    """A law of the user for the core, with settings (n_candidates, n_settings)."""
    return _rust.LawTape(law.tape, law.inputs, law.start, law.names, np.ascontiguousarray(settings))


def _range_of(device: Device) -> tuple[float, float]:
    """Smallest and largest command, of an actuator forces; twice the command that a device holds."""
    if device.command is not None:
        return float(device.command), float(device.command)
    if device.is_actuator:
        # Without a limit, an unstable loop overflows and ends as diverged before this one.
        most = min(float(device.largest_command), 1e300)
        return -most, most
    return 0.0, float(device.largest_command)


def _core_building(
    building: Building,
    devices: Sequence[Device],
    varied: Sequence[tuple[Floats, Floats]] = (),
    *,
    stiffness: Floats | None = None,
) -> _rust.Building:
    n = building.n_coordinates
    if n > _MOST_COORDINATES:
        raise SettingError(
            f"{building.name} has {n:,} coordinates, of which the equations of a loop would take about "
            f"{_SECONDS * n**3:.0f} s to prepare; reduce it to at most {_MOST_COORDINATES:,}, as by "
            "`mr.buildings.modal_truncation`"
        )
    try:
        return _rust.Building(
            mass=building.mass,
            damping=building.damping,
            stiffness=building.stiffness if stiffness is None else stiffness,
            influence=building.influence,
            floors=building.floors,
            storeys=building.storeys,
            unit_drifts=building.unit_drifts,
            heights=building.heights if building.heights.size else np.zeros(len(building.storeys)),
            storey_springs=building.storey_springs,
            devices=elongation_rows(building, devices),
            sprung=sprung_rows(building, devices),
            elements=building.elements,
            varied=varied,
        )
    except SettingError as error:
        raise SettingError(f"{building.name}: {error}") from error


def _core_model(law: ControlLaw) -> _rust.LoopModel | None:
    """The loop model inside the law, `None` if it has none; strokes of additions are no drifts."""
    if law.model is None:
        return None
    building, devices = law.model.building, law.model.devices
    drifting = replace(
        building,
        storeys=building.drifts,
        storey_names=building.drift_names,
        heights=building.of_drifts(building.heights),
        isolators=(),
        loads=np.empty(0),
        n_strokes=0,
    )
    core = _core_building(drifting, devices, stiffness=building.site_stiffness)
    first_draws = [theta[:1] for theta in theta_of(devices)]
    return _rust.LoopModel(core, core_dampers(devices, first_draws))
