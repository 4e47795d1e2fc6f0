"""Simulate buildings in closed loop: candidates x motions x draws of the dampers in one call of the core."""

from __future__ import annotations

import json
import math
import warnings
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork import _rust
from mrwork.base.arguments import May, Threads, Whole, checked
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass
from mrwork.buildings.device import Device as Device
from mrwork.buildings.device import elongation_rows
from mrwork.buildings.groups import (
    commanded,
    groups_of,
    refuse_order,
    refuse_rate,
    sends_shares,
)
from mrwork.buildings.plane_building import Building
from mrwork.closed_loop.evaluation import criteria
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.own_runs import beyond_twin
from mrwork.closed_loop.responses import History, Responses, columns_by_name, history_signals, run_quantities
from mrwork.closed_loop.user_law import UserLaw
from mrwork.control.laws.control_law import ControlLaw, refuse_units
from mrwork.control.laws.counterpart import is_curve
from mrwork.control.linear.lqr import Observer, kinematic_observer_of, observer_of
from mrwork.control.linear.plant import Plant, accelerations, deformations, drifts, plant_of, stack_outputs
from mrwork.dampers.simulation import core_refusals
from mrwork.dampers.spec import DamperSpec, by_parameter
from mrwork.errors import MrworkWarning, SettingError
from mrwork.motions.ground_motion import GroundMotion
from mrwork.store.codec import digest_of, plain
from mrwork.workers.engine import Workers, cut_into_chunks, present_workers
from mrwork.workers.kept_chunks import KeptChunks

# Seconds of the factors of the mass matrix and of the bounds on the frequencies, per coordinate cubed.
_SECONDS = 3e-9
# They are ready in ten seconds.
_MOST_COORDINATES = 1500


def _theta_of(devices: Sequence[Device]) -> tuple[Floats, ...]:
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
        for group in groups_of(devices)
    )


def _core_dampers(devices: Sequence[Device], theta: Sequence[Floats]) -> list[_rust.Dampers]:
    groups = [[devices[member] for member in group] for group in groups_of(devices)]
    return [
        _rust.Dampers(
            model=group[0].spec.name,
            laws=[*map(str, group[0].spec.laws)],
            lagged=group[0].spec.lagged,
            theta=np.ascontiguousarray(parameters),
            counts=[float(device.count) for device in group],
            differential=[device.differential for device in group],
            ranges=[_range_of(device) for device in group],
        )
        for group, parameters in zip(groups, theta, strict=True)
    ]


def _range_of(device: Device) -> tuple[float, float]:
    """Smallest and largest command; twice the command that a device holds."""
    if device.command is not None:
        return float(device.command), float(device.command)
    return 0.0, float(device.largest_command)


def _stretch_theta(spec: DamperSpec, theta: Floats, factors: Floats) -> Floats:
    """Parameters of dampers that follow `factors` times the command, for each candidate and draw.

    Of `theta` (n_draws, n_devices, n_columns) and `factors` (n_candidates, n_devices) follow rows of shape
    (n_candidates * n_draws, n_devices, n_columns); draws vary fastest.
    """
    stretched = np.repeat(theta[None], len(factors), axis=0)
    for candidate, device in np.ndindex(*factors.shape):
        *blocks, rest = by_parameter(spec, theta[:, device])
        rescaled = (
            law.rescale_command(block, float(factors[candidate, device]))
            for (parameter, law), block in zip(spec.law_pairs, blocks, strict=True)
        )
        stretched[candidate, :, device] = np.concatenate([*rescaled, rest], axis=-1)
    return stretched.reshape(-1, *theta.shape[1:])


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
            elements=building.elements,
            varied=varied,
        )
    except ValueError as error:
        raise SettingError(f"{building.name}: {error}") from error


def _core_curve(law: ControlLaw) -> _rust.ForceCurve | None:
    """The static damper model inside the law; `None` if it has none."""
    if law.curve is None:
        return None
    spec, theta = law.curve
    if not is_curve(spec):
        raise SettingError(
            f"the curve of {law.name} is a {spec.name}; give a static_hysteretic with current laws"
        )
    return _rust.ForceCurve(
        [*map(str, spec.laws)], np.ascontiguousarray(theta, dtype=np.float64), spec.lagged
    )


def _core_model(law: ControlLaw) -> _rust.LoopModel | None:
    """The loop model inside the law, `None` if it has none; strokes of additions are no drifts."""
    if law.model is None:
        return None
    building, devices = law.model.building, law.model.devices
    drifting = replace(
        building,
        storeys=building.drifts,
        storey_names=building.drift_names,
        heights=building.drift_heights,
        loads=np.empty(0),
        n_strokes=0,
    )
    core = _core_building(drifting, devices, stiffness=building.site_stiffness)
    first_draws = [theta[:1] for theta in _theta_of(devices)]
    return _rust.LoopModel(core, _core_dampers(devices, first_draws))


@array_dataclass()
class RunsOfLoop:
    """Runs of a loop: candidate, motion, draw, building and delay of each, shape (n_runs, 5), with its stream of noise.

    `gains` (n_candidates, n_gains), `shaping` (n_candidates, 2) or `None`, `theta` of
    each group of devices (n_draws, n_devices, n_columns).
    """

    runs: NDArray[np.uint32]
    streams: NDArray[np.uint64]
    gains: Floats
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
            shaping=None if self.shaping is None else self.shaping[candidates],
            theta=tuple(parameters[draws] for parameters in self.theta),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Core:
    """What the runs of a call share, as the core takes it."""

    loop: LoopOfRuns
    building: _rust.Building
    observer: _rust.Observer | None
    # Pairs of a time step and an acceleration.
    waves: list[Any]

    def driven(self, runs: RunsOfLoop) -> RunsOfLoop | tuple[list[_rust.Dampers], _rust.Controller]:
        """Dampers and controller of the runs' draws and candidates; with dampers of the user the runs themselves."""
        law, devices, n = self.loop.law, self.loop.devices, self.loop.n_commanded
        if self.loop.is_own:
            return runs
        actuators = partial(
            _rust.Dampers,
            model="ideal_actuator",
            laws=["linear"],
            theta=np.tile([0.0, 1.0], (1, n, 1)),
            counts=[1.0] * n,
            differential=[False] * n,
            # No limit: an unstable loop overflows and ends as diverged before it.
            ranges=[(-1e300, 1e300)] * n,
        )
        with core_refusals():
            return (
                [actuators(), *_core_dampers(devices[n:], runs.theta[1:])]
                if law.spec.commands_force
                else _core_dampers(devices, runs.theta),
                _rust.Controller(
                    law.name,
                    np.ascontiguousarray(runs.gains),
                    law.table_rows(),
                    _core_curve(law),
                    runs.shaping,
                    _core_model(law),
                ),
            )


@array_dataclass()
class LoopOfRuns:
    """What the runs of a call share, in values that can be sent to another process; designs are made already.

    The gains of `law` are zeros, `varied` are pairs of damping and stiffness, and the observer, if
    there is one, measures the accelerations of `floors`.
    """

    building: Building
    varied: tuple[tuple[Floats, Floats], ...]
    devices: tuple[Device, ...]
    law: ControlLaw
    hardware: Hardware
    floors: tuple[int, ...]
    observer: Observer | None
    motions: tuple[GroundMotion, ...]
    step_factor: int

    @property
    def n_commanded(self) -> int:
        """Number of devices that the law commands, which are the first ones."""
        return len(commanded(self.devices))

    @property
    def is_own(self) -> bool:
        """Whether some of its dampers are models of the user, which the core does not have."""
        return (
            any(device.spec.own is not None for device in self.devices) and not self.law.spec.commands_force
        )

    def core(self) -> _Core:
        """The same for the core, which is made anew in each process."""
        building = _core_building(self.building, self.devices, self.varied)
        with core_refusals():
            return _Core(
                loop=self,
                building=building,
                observer=None
                if self.observer is None
                else _core_observer(self.observer, self.floors, len(self.devices), self.hardware),
                waves=[(motion.dt, np.ascontiguousarray(motion.acceleration)) for motion in self.motions],
            )


def _respond(
    core: _Core,
    driven: RunsOfLoop | tuple[list[_rust.Dampers], _rust.Controller],
    runs: NDArray[np.uint32],
    streams: NDArray[np.uint64],
    *,
    histories: bool = False,
    threads: int = 0,
    outside: Any = None,
    changes: Floats | None = None,
) -> Any:
    if isinstance(driven, RunsOfLoop):
        return _respond_by_twin(core, driven, runs, histories=histories)
    dampers, controller = driven
    with core_refusals():
        return _rust.respond(
            core.building,
            dampers,
            controller,
            core.loop.hardware,
            core.waves,
            np.ascontiguousarray(runs),
            streams,
            observer=core.observer,
            histories=histories,
            step_factor=core.loop.step_factor,
            threads=threads,
            outside=outside,
            changes=None if changes is None else changes[None],
            n_commanded=core.loop.n_commanded,
        )


def _respond_by_twin(core: _Core, loop_runs: RunsOfLoop, runs: NDArray[np.uint32], *, histories: bool) -> Any:
    """Runs with dampers of the user, in the form of `_rust.respond`."""
    # JAX is needed for these dampers only.
    from mrwork.twins.loop import MATRICES, LoopDevice, believed_devices
    from mrwork.twins.own_loop import OwnLoop, OwnRuns, respond

    loop, law, hardware = core.loop, core.loop.law, core.loop.hardware
    gains, start = {}, 0
    for gain in law.spec.gains:
        shape = gain.shape_for(loop.n_commanded, 2 * loop.building.n_coordinates)
        columns = loop_runs.gains[:, start : start + math.prod(shape)]
        gains[gain.name] = columns.reshape(len(loop_runs.gains), *shape)
        start += columns.shape[1]
    devices = tuple(LoopDevice.of(device) for device in loop.devices)
    layouts = core.building.summary_layout, core.building.history_layout
    own_loop = OwnLoop(
        matrices={name: np.asarray(getattr(loop.building, name), dtype=np.float64) for name in MATRICES},
        varied=loop.varied,
        devices=devices,
        believed=believed_devices(devices[: loop.n_commanded], law.curve),
        ranges=np.array([_range_of(device) for device in loop.devices]),
        n_commanded=loop.n_commanded,
        law=law.name,
        motions=core.waves,
        sample_time=hardware.sample_time,
        steps=hardware.steps,
        delay=hardware.delay_steps,
        command_rate=hardware.command_rate,
        step_factor=loop.step_factor,
        widths=(sum(count for _, count in layouts[0]), sum(count for _, count in layouts[1])),
    )
    theta = tuple(theta[:, index] for theta in loop_runs.theta for index in range(theta.shape[1]))
    return respond(own_loop, OwnRuns(runs, gains, loop_runs.shaping, theta), histories=histories)


def respond_alone(core: _Core, runs: RunsOfLoop) -> list[NDArray[Any]]:
    """Runs of a loop in a process of their own, on one thread: summaries, outcomes, steps, without histories."""
    return list(_respond(core, core.driven(runs), runs.runs, runs.streams, threads=1)[:3])


def _respond_elsewhere(
    workers: Workers, loop: LoopOfRuns, runs: RunsOfLoop, on_progress: Callable[[int, int], None] | None
) -> list[Any]:
    """Runs of a loop by workers, in chunks that depend on their samples alone."""
    samples = np.array([motion.duration for motion in loop.motions]) / loop.hardware.sample_time
    costs = samples[runs.runs[:, 1]] * loop.hardware.steps * loop.step_factor
    # A call of few runs is cut finer, so that more than one worker has a part; full lanes are the fastest.
    fine = max(costs.sum() * loop.building.n_coordinates / _CHUNKS, _CHUNK_STEPS / _FINEST)
    least, block = min(_CHUNK_STEPS, fine) / loop.building.n_coordinates, _FEWEST_RUNS
    while block > 1 and block * costs.mean() > least:
        block //= 2
    blocks = cut_into_chunks(np.add.reduceat(costs, np.arange(0, len(costs), block)).tolist(), least)
    chunks = [slice(chunk.start * block, min(chunk.stop * block, len(costs))) for chunk in blocks]
    kept_chunks, finished = None, dict[int, list[NDArray[Any]]]()
    if workers.journal is not None:
        arrays = runs.runs, runs.streams, runs.gains, runs.shaping, *runs.theta
        kept_chunks = KeptChunks.beside(workers.journal, digest_of(json.dumps(plain(loop)), *arrays))
        finished = kept_chunks.recall(len(chunks))
    missing = [number for number in range(len(chunks)) if number not in finished]
    done = sum(chunks[number].stop - chunks[number].start for number in finished)

    def count(index: int, future: Future[list[NDArray[Any]]]) -> None:
        nonlocal done
        number = missing[index]
        done += chunks[number].stop - chunks[number].start
        if kept_chunks is not None and future.exception() is None:
            kept_chunks.keep(number, future.result())
        if on_progress is not None:
            on_progress(done, len(runs.runs))

    parts = [(runs.part(chunks[number]),) for number in missing]
    futures = workers.futures(LoopOfRuns.core, respond_alone, loop, parts, on_done=count)
    finished |= {number: future.result() for number, future in zip(missing, futures, strict=True)}
    return [(*finished[number], None) for number in range(len(chunks))]


def _core_observer(
    observer: Observer, floors: Sequence[int], n_devices: int, hardware: Hardware
) -> _rust.Observer:
    return _rust.Observer(
        accelerations=list(floors),
        deformations=range(n_devices),
        transition=np.ascontiguousarray(observer.Ad),
        input=np.ascontiguousarray(observer.Bd),
        gain=np.ascontiguousarray(observer.gain),
        output=np.ascontiguousarray(observer.C),
        direct=np.ascontiguousarray(observer.D),
        ground=np.ascontiguousarray(observer.Ed) if hardware.observes_ground else None,
        direct_ground=np.ascontiguousarray(observer.G) if hardware.observes_ground else None,
    )


def loop_observer(
    building: Building, devices: Sequence[Device], hardware: Hardware, floors: Sequence[int]
) -> Observer:
    """The observer of a loop: accelerations of these floors, deformations of all devices, drifts that are measured."""
    for noun, rows, measured in (
        ("storeys", building.storeys, hardware.measured_storeys), ("floors", building.floors, floors)
    ):  # fmt: skip
        if unknown := [index for index in measured if index >= len(rows)]:
            raise SettingError(
                f"{building.name} has {len(rows)} {noun}, counted from 0; {unknown} do not exist"
            )
    rows, names = elongation_rows(building, devices), [device.name for device in devices]
    asked = building, rows.tolist(), names, list(floors), replace(hardware, seed=0, faults=())
    for key, observer in _OBSERVERS:
        if key == asked:
            return observer
    observer = _design_observer(plant_of(building, rows, names), hardware, floors)
    if not hardware.kinematic and any(element.in_stiffness for element in building.elements):
        warnings.warn(
            f"the observer of {building.name} goes by its elastic stiffness, and is wrong once a storey yields; set "
            "`kinematic` of the hardware, with sensors of all drifts",
            MrworkWarning,
            stacklevel=3,
        )
    _OBSERVERS.append((asked, observer))
    return observer


# Loops of a study share the observer, which takes seconds for hundreds of floors.
_OBSERVERS: deque[tuple[tuple[Building, list[Any], list[str], list[int], Hardware], Observer]] = deque(
    maxlen=4
)


def _design_observer(plant: Plant, hardware: Hardware, floors: Sequence[int]) -> Observer:
    devices = plant.device_names
    accelerated = stretched = 1.0 / hardware.noise_ratio
    if hardware.observes_ground:
        # What is left to the filter is the error of the sensors: of an elongation or a drift the error of the
        # acceleration that goes with it in the first mode.
        stretched /= (2.0 * np.pi * float(plant.building.frequencies[0])) ** 4
    if hardware.kinematic:
        if list(floors) != list(range(plant.n_coordinates)):
            raise SettingError(
                f"a kinematic observer integrates the accelerations of all floors, and `measured_floors` are "
                f"{list(floors)}, counted from 0; leave `measured_floors` out"
            )
        storeys = hardware.measured_storeys
        return kinematic_observer_of(plant.building, len(devices), storeys, hardware.sample_time, stretched)
    of_floors, of_storeys = accelerations(plant), drifts(plant)
    chosen = of_floors.select([of_floors.names[floor] for floor in floors])
    sensed = of_storeys.select([of_storeys.names[storey] for storey in hardware.measured_storeys])
    noise = np.full(len(floors) + len(devices) + len(hardware.measured_storeys), stretched)
    noise[: len(floors)] = accelerated
    return observer_of(
        plant,
        stack_outputs(chosen, deformations(plant), sensed),
        hardware.sample_time,
        noise_intensity=noise,
    )


@checked
@array_dataclass(repr=False)
class LoopVariation(Summarised):
    """Realisations of a loop: each is one draw of its dampers with a building, a delay and noise of its own.

    Attributes
    ----------
    buildings
        The building of each realisation; it may have other stiffness and damping only.
    delay
        Delay beyond the delay of the hardware, rounded to its integration steps, shape (n,) [s].
    seed
        Added to the seed of the sensor noise, shape (n,).
    changes
        Directions in the gains of one candidate, shape (n_directions, n_gains), along each of which the responses have
        slopes; `None` for none.
    """

    buildings: tuple[Building, ...]
    delay: Floats
    seed: NDArray[np.int64]
    changes: Floats | None = None

    def __len__(self) -> int:
        """Number of realisations."""
        return len(self.buildings)

    @checked
    def distinct_from(self, building: Building) -> tuple[list[Building], list[int]]:
        """Distinct buildings, none if all are `building`, and the index of each realisation's own."""
        if all(own is building for own in self.buildings):
            return [], [0] * len(self)
        distinct = list({id(own): own for own in self.buildings}.values())
        for own in distinct:
            same = all(
                np.array_equal(getattr(own, name), getattr(building, name))
                for name in ("mass", "influence", "floors", "storeys")
            )
            if not (same and own.elements == building.elements and np.array_equal(own.loads, building.loads)):
                raise SettingError(
                    f"{own.name} is no realisation of {building.name}: it may differ in stiffness and damping only; "
                    "simulate it in a call of its own"
                )
        places = {id(own): index for index, own in enumerate(distinct)}
        return distinct, [places[id(own)] for own in self.buildings]


# Runs of a call of the core, which reports nothing before its end: a few, then so many as take some time [s].
_RUNS_AT_A_TIME = 4096
_FEWEST_RUNS = 64
_BLOCK_SECONDS = 1.0
# Integration steps times coordinates of a chunk that another process works on: the better part of a second on one
# thread; down to this part of it where a call would have fewer chunks.
_CHUNK_STEPS = 3e7
_CHUNKS, _FINEST = 16, 8.0
# Quantities in proportion to the command.
_COMMANDS = ("peak_current", "mean_current", "rms_current", "command_travel")


@checked
def simulate_loop(
    building: Building,
    devices: Sequence[Device],
    law: ControlLaw | UserLaw,
    motions: Sequence[GroundMotion],
    hardware: Hardware | None = None,
    *,
    histories: bool = False,
    step_factor: int = 1,
    nominal: Building | None = None,
    largest_commands: ArrayLike | None = None,
    shaping: Annotated[ArrayLike, May.BE_INFINITE] | None = None,
    variation: LoopVariation | None = None,
    motion_numbers: Sequence[Whole] | None = None,
    threads: Threads = 0,
    on_progress: Callable[[int, int], None] | None = None,
) -> Responses:
    """Simulate every candidate of the law under every motion with every draw of the dampers.

    Building, dampers and driver are integrated as one system by the classical Runge-Kutta method; the law receives
    measurements at its sample times. Ideal actuators replace the dampers if the law commands forces.

    Parameters
    ----------
    devices
        One or more, each with a model, parameters, laws and unit of the command of its own; see `Device`. Those that
        hold a command or follow none come last; gains and commands of the law are of the others.
    law
        A law of the registry with its gains, or a law in Python, which takes one thread.
    histories
        Whether to keep the history of every run.
    step_factor
        Multiplies the number of steps of every run: 2 halves the step, to check convergence.
    nominal
        The building for which the observer is designed, if there is one; by default the building itself.
    largest_commands
        Largest command of each candidate, shape (n_candidates,), up to the largest of the devices, of which each gets
        its own at most, for laws that send a share of the largest command; itself a share where devices follow commands
        in A and in V. Dampers then follow the scaled command, so results agree to rounding with devices of that
        largest command.
    shaping
        Dead zone [m/s] and slope [A/s or V/s] of the command of each candidate, shape (n_candidates, 2), instead of
        the shaping of the law.
    variation
        Realisations of building, delay and noise, as many as there are draws of the dampers, or any number with one.
    motion_numbers
        Numbers of the motions among all of a study, on which the noise of sensors depends; by default their places.
    threads
        Threads to use, 0 for all.
    on_progress
        Called with the number of runs done and their total.

    Raises
    ------
    SettingError
        If devices, law and building do not match, a constant command is negative or above the largest one, or the
        law sends a command to dampers that follow none.

    Examples
    --------
    >>> from mrwork.closed_loop.simulate import simulate_loop
    >>> passive_on = ControlLaw(name="passive", gains={"command": [2.25]})  # doctest: +SKIP
    >>> simulate_loop(building, [device], passive_on, [motion]).peak_drift.shape  # doctest: +SKIP
    (1, 3)
    """
    hardware = Hardware() if hardware is None else hardware
    user = law if isinstance(law, UserLaw) else None
    if isinstance(law, UserLaw):
        law = law.placeholder(commanded(devices))
    if not devices:
        raise SettingError(
            "a closed loop has at least one device; without dampers, simulate a device of zero force"
        )
    refuse_order(devices)
    refuse_rate(devices, hardware.command_rate, "command_rate")
    if not motions:
        raise SettingError("no ground motion was given; give at least one")
    driven = commanded(devices)
    if user is None:
        refuse_units(law.spec, devices)
    n_states = 2 * len(building.check().mass)
    gains = law.gain_rows(len(driven), n_states)
    shaping, counts = _core_shaping(law, shaping), {"gains": len(gains)}
    if shaping is not None:
        refuse_rate(devices, float(shaping[:, 1].min()), "command_slope")
        counts["`shaping`"] = len(shaping)
    actuators = law.spec.commands_force
    if not (actuators or devices[0].spec.follows_command or (gains.size and not gains.any())):
        raise SettingError(
            f"{law.name} commands {devices[0].name}, a {devices[0].spec.name} of which no parameter depends on the "
            "command: it would have no effect; give the model current laws, or simulate the passive damper with the "
            "law passive and a command of zero"
        )
    _check_commands(law, driven)
    name = law.name if user is None else f"{user.name} in Python"
    if lacking := beyond_twin(building, devices, hardware, name):
        raise SettingError(lacking)
    theta = _theta_of(devices)
    if actuators:
        beside = devices[len(driven) :]
        theta = (np.empty((1, len(driven), 0)), *(_theta_of(beside) if beside else ()))
    n_draws = len(theta[-1])
    factors: Floats | None = None
    if largest_commands is not None:
        slope = math.inf if shaping is None else float(shaping[:, 1].min())
        factors = _command_factors(law, hardware, driven, largest_commands, slope, histories=histories)
        factors = np.hstack([factors, np.ones((len(factors), len(devices) - len(driven)))])
        counts["`largest_commands`"] = len(factors)
        theta = tuple(
            _stretch_theta(devices[group[0]].spec, parameters, factors[:, group])
            for group, parameters in zip(groups_of(devices), theta, strict=True)
        )
    n_candidates = max(counts.values())
    if not n_candidates or {*counts.values()} - {1, n_candidates}:
        listed = ", ".join(f"{count} of {name}" for name, count in counts.items())
        raise SettingError(f"the candidates are {listed}; give as many of each, or one")
    gains = np.ascontiguousarray(np.broadcast_to(gains, (n_candidates, gains.shape[1])))
    if shaping is not None:
        shaping = np.ascontiguousarray(np.broadcast_to(shaping, (n_candidates, 2)))
    if variation is None:
        still = np.zeros(n_draws)
        variation = LoopVariation(buildings=(building,) * n_draws, delay=still, seed=still.astype(np.int64))
    if n_draws not in (1, len(variation)):
        raise SettingError(
            f"the devices have {n_draws} draws, and there are {len(variation)} realisations; give as many of both, or "
            "one draw"
        )
    varied, places = variation.distinct_from(building)
    if not varied and building.site_stiffness is not building.stiffness:
        # The law's own building stays elastic.
        varied = [building]
    changes = variation.changes
    if changes is not None and len(gains) > 1:
        raise SettingError(f"the gains are of {len(gains)} candidates; give changes of the gains of one")
    late = np.round(variation.delay / (hardware.sample_time / hardware.steps))
    floors, observer = hardware.measured_floors, None
    if floors is None:
        floors = tuple(range(len((nominal or building).floors)))
    if hardware.feedback != "state":
        with core_refusals():
            observer = loop_observer(nominal or building, devices, hardware, floors)
    shapes = {gain.name: gain.shape_for(len(driven), n_states) for gain in law.spec.gains}
    zeros = {name: np.zeros(shape) for name, shape in shapes.items() if name in law.gains}
    call = _Call(
        loop=LoopOfRuns(
            building=building,
            varied=tuple((each.damping, each.site_stiffness) for each in varied),
            devices=tuple(devices),
            # As its candidates share it: with gains of zero, which belong to no candidate.
            law=replace(law, gains=zeros, weights=None, margins=None, notes=()),
            hardware=hardware,
            floors=floors,
            observer=observer,
            motions=tuple(motions),
            step_factor=step_factor,
        ),
        user=user,
        gains=gains,
        shaping=shaping,
        factors=factors,
        theta=theta,
        n_draws=n_draws,
        springs=[each.storey_springs for each in varied],
        places=np.array(places, dtype=np.uint32),
        late=late.astype(np.uint32),
        streams=np.array(range(len(motions)) if motion_numbers is None else motion_numbers, dtype=np.uint64),
        seeds=np.uint64(hardware.seed) + variation.seed.astype(np.uint64),
        changes=changes,
    )
    runs, core, workers = call.runs(), call.loop.core(), present_workers()
    if workers is None or histories or user is not None or changes is not None:
        parts, order = call.respond(core, runs, histories, threads, on_progress)
    else:
        parts, order = _respond_elsewhere(workers, call.loop, runs, on_progress), np.arange(len(runs.runs))
    return call.responses(core.building, parts, order)


@array_dataclass()
class _Call:
    """A call of `simulate_loop` that was checked: what its runs share, its candidates and its realisations.

    `gains`, `shaping` and `theta` go into `RunsOfLoop`; `factors` are the largest commands of the candidates over the
    largest of the devices, `None` for these. `streams` are numbers of the motions. Each realisation has the building at
    its place, of which there are `springs` of the storeys, a further delay in integration steps and a seed.
    """

    loop: LoopOfRuns
    user: UserLaw | None
    gains: Floats
    shaping: Floats | None
    factors: Floats | None
    theta: tuple[Floats, ...]
    n_draws: int
    springs: Sequence[Floats]
    places: NDArray[np.uint32]
    late: NDArray[np.uint32]
    streams: NDArray[np.uint64]
    seeds: NDArray[np.uint64]
    changes: Floats | None

    @property
    def shape(self) -> tuple[int, int, int]:
        """Numbers of candidates, motions and realisations."""
        return len(self.gains), len(self.streams), len(self.places)

    def runs(self) -> RunsOfLoop:
        """Every candidate under every motion with every realisation, the last varying fastest."""
        candidate, motion, realisation = np.indices(self.shape, dtype=np.uint32).reshape(3, -1)
        draw = realisation if self.n_draws > 1 else np.zeros_like(realisation)
        if len(self.theta[0]) > self.n_draws:
            # Each candidate has draws of its own, with its scale of the command.
            draw = candidate * np.uint32(self.n_draws) + draw
        places, late = self.places[realisation], self.late[realisation]
        return RunsOfLoop(
            runs=np.column_stack([candidate, motion, draw, places, late]),
            # The noise of a run depends on its motion and realisation only: candidates have equal noise.
            streams=self.streams[motion] + self.seeds[realisation] * np.uint64(2**32),
            gains=self.gains,
            shaping=self.shaping,
            theta=self.theta,
        )

    def respond(
        self,
        core: _Core,
        runs: RunsOfLoop,
        histories: bool,
        threads: int,
        on_progress: Callable[[int, int], None] | None,
    ) -> tuple[list[Any], NDArray[np.intp]]:
        """Runs in this process part by part, and the order in which they were simulated."""
        loop, equipped, order = self.loop, core.driven(runs), np.arange(len(runs.runs))
        if self.user is None:
            # Runs that last equally long share lanes: side by side, so that they are in one call of the core.
            seconds = np.array([motion.duration for motion in loop.motions])
            order = np.argsort(seconds[runs.runs[:, 1]], kind="stable")
        parts = []
        done, count = 0, _RUNS_AT_A_TIME if on_progress is None else _FEWEST_RUNS
        while done < len(order):
            part = order[done : done + count]
            began, outside = perf_counter(), None
            if self.user is not None:
                driven = loop.devices[: loop.n_commanded]
                outside = self.user.asked(runs.runs[part, :3], driven, loop.hardware.sample_time)
            parts.append(
                _respond(
                    core,
                    equipped,
                    runs.runs[part],
                    runs.streams[part],
                    histories=histories,
                    threads=threads,
                    outside=outside,
                    changes=self.changes,
                )
            )
            done += len(part)
            if on_progress is not None:
                on_progress(done, len(order))
                blocks = count / _FEWEST_RUNS * _BLOCK_SECONDS / max(perf_counter() - began, 1e-6)
                count = _FEWEST_RUNS * int(min(max(blocks, 1.0), _RUNS_AT_A_TIME / _FEWEST_RUNS))
        return parts, order

    def responses(self, building: _rust.Building, parts: list[Any], order: NDArray[np.intp]) -> Responses:
        """The responses of runs that were simulated in this order."""
        loop, places, histories, slopes = self.loop, np.argsort(order), None, []
        summary, outcome, steps = (
            np.concatenate([part[index] for part in parts])[places] for index in range(3)
        )
        if self.changes is not None:
            slopes = [*np.moveaxis(np.concatenate([part[4] for part in parts])[places], 1, 0)]
        if parts[0][3] is not None:
            layout, rows = building.history_layout, [history for part in parts for history in part[3]]
            histories = tuple(
                History(
                    time=np.arange(len(rows[run]), dtype=np.float64) * loop.hardware.sample_time,
                    numbers=columns_by_name(rows[run], history_signals(), layout),
                )
                for run in places
            )
        candidate, _, realisation = np.indices(self.shape).reshape(3, -1)

        def by_name(columns: Floats) -> dict[str, Floats]:
            """Quantities of the runs, or their slopes, of columns of the core."""
            numbers = columns_by_name(columns, run_quantities(), building.summary_layout)
            numbers |= _shears(loop.building, numbers, self.springs, self.places[realisation])
            if loop.n_commanded < len(loop.devices):
                # Devices that no law commands count in no criterion of the command.
                of_law = np.arange(len(loop.devices)) < loop.n_commanded
                names = {criterion.quantity for criterion in criteria() if criterion.of_command}
                numbers |= {name: np.where(of_law, numbers[name], np.nan) for name in names}
            if self.factors is not None:
                numbers |= {name: numbers[name] * self.factors[candidate] for name in _COMMANDS}
            return numbers

        return Responses(
            shape=self.shape,
            outcome=outcome,
            steps=steps,
            histories=histories,
            devices=() if loop.law.spec.commands_force else loop.devices,
            seconds=tuple(motion.duration for motion in loop.motions),
            motions=tuple(motion.name for motion in loop.motions),
            numbers=by_name(summary),
            slopes=tuple(map(by_name, slopes)),
        )


def _shears(
    building: Building,
    numbers: Mapping[str, Floats],
    varied: Sequence[Floats],
    places: NDArray[np.uint32],
) -> dict[str, Floats]:
    """Shears of a run that the core does not know, and NaN for what of them the building does not say."""
    springs, is_chain = building.storey_springs, bool(building.unit_drifts.any())
    is_linear = all(element.is_linear for element in building.elements)
    stiffness = np.array(varied)[places] if varied else springs
    flags = {
        "peak_storey_shear": is_chain,
        "peak_frame_shear": bool(springs.any()) and (is_linear or len(varied) < 2),
        "storey_energy": is_chain,
        "peak_overturning": is_chain and bool(building.heights.size),
    }
    drifts = numbers["peak_drift"]
    # A stroke has no spring, also in a run without an end.
    shears = np.multiply(drifts, stiffness, out=np.zeros_like(drifts), where=stiffness > 0.0)
    linear = {"peak_frame_shear": shears} if is_linear else {}
    return linear | {
        name: np.full_like(numbers[name], np.nan) for name, is_known in flags.items() if not is_known
    }


def _core_shaping(law: ControlLaw, values: ArrayLike | None) -> Floats | None:
    """Dead zone and slope of the command, shape (1 or n_candidates, 2); `None` for no shaping."""
    if values is None:
        return None if law.shaping is None else np.array([law.shaping])
    shaping = np.asarray(values, dtype=np.float64)
    if shaping.ndim != 2 or shaping.shape[1] != 2 or not len(shaping):
        raise SettingError(
            f"`shaping` has shape {shaping.shape}; give (n_candidates, 2), a dead zone and a slope for each candidate"
        )
    return shaping


def _check_commands(law: ControlLaw, devices: Sequence[Device]) -> None:
    """Warn of constant commands outside the range of the devices' drivers."""
    for gain in law.spec.gains:
        if not gain.is_command:
            continue
        shape = gain.shape_for(len(devices), 0)
        commands = np.asarray(law.gains[gain.name], dtype=np.float64).reshape(-1, *shape)
        for device, column in zip(devices, np.moveaxis(commands, 1, 0), strict=True):
            # Largest commands that are shares of others are rounded.
            wrong = (column < 0.0) | (column > device.largest_command * (1.0 + 1e-9))
            if wrong.any():
                warnings.warn(
                    f"`{gain.name}` of {law.name} is {column[wrong][0]:g} for {device.name}, whose driver gives 0 to "
                    f"{device.largest_command:g} and no more; give a command within it, or a larger `largest_command` "
                    "of the device",
                    MrworkWarning,
                    stacklevel=3,
                )


def _command_factors(
    law: ControlLaw,
    hardware: Hardware,
    devices: Sequence[Device],
    largest_commands: ArrayLike,
    slope: float,
    *,
    histories: bool,
) -> Floats:
    """Largest command of each candidate over the largest of each device, shape (n_candidates, n_devices)."""
    if not law.spec.sends_share:
        raise SettingError(
            f"{law.name} sends commands that are no share of the largest one; simulate devices of that largest command"
        )
    faulty = any(fault.channel == "command" for fault in hardware.faults)
    limited = np.isfinite(min(hardware.command_rate, slope))
    if histories or faulty or limited:
        raise SettingError(
            "largest commands of candidates go with neither histories nor a rate limit or faults of the command; "
            "simulate devices of that largest command"
        )
    limit = np.ravel(np.asarray(largest_commands, dtype=np.float64))
    largest = [1.0 if sends_shares(devices) else device.largest_command for device in devices]
    factors: Floats = limit[:, None] / np.array(largest)
    # A device of a smaller driver gets what that gives.
    if not (factors > 0.0).all() or not (factors.min(axis=1) <= 1.0).all():
        raise SettingError(
            f"`largest_commands` are from {limit.min():g} to {limit.max():g}; give one for each candidate, positive "
            "and up to the largest of the devices"
        )
    return np.minimum(factors, 1.0)
