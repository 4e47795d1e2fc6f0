"""Simulate buildings in closed loop: candidates x motions x draws of the dampers in one call of the core."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import nullcontext
from dataclasses import replace
from time import perf_counter
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.base.arguments import May, Threads, Whole, checked
from mrwork.base.remark import Remark
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass
from mrwork.buildings.device import Device as Device
from mrwork.buildings.device import elongation_rows
from mrwork.buildings.groups import (
    commanded,
    device_groups,
    refuse_order,
    refuse_rate,
    sends_forces,
    sends_shares,
)
from mrwork.buildings.plane_building import Building
from mrwork.closed_loop.core_loop import (
    CoreLoop,
    LoopOfRuns,
    RunsOfLoop,
    Simulator,
    respond_alone,
    theta_of,
    with_actuators,
)
from mrwork.closed_loop.evaluation import criteria
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.laws_of_users import IN_PYTHON, law_in_loop, loop_shape, recorded_for
from mrwork.closed_loop.observer import estimates_absolute, loop_observer
from mrwork.closed_loop.process_law import ProcessLaw
from mrwork.closed_loop.responses import (
    History,
    Responses,
    columns_by_name,
    command_unit_of,
    history_signals,
    run_quantities,
)
from mrwork.closed_loop.rows_law import RowsLaw
from mrwork.closed_loop.user_law import UserLaw
from mrwork.control.laws.control_law import ControlLaw, refuse_units
from mrwork.control.laws.gain_conventions import gain_remarks
from mrwork.control.laws.law_settings import SETTINGS
from mrwork.control.linear.plant import plant_of
from mrwork.dampers.simulation import Outcome, StepFactor
from mrwork.dampers.spec import DamperSpec, by_parameter
from mrwork.errors import MrworkWarning, SettingError
from mrwork.motions.ground_motion import GroundMotion, refuse_floors
from mrwork.store.codec import digest_of, plain
from mrwork.workers.engine import Workers, cut_into_chunks, present_workers
from mrwork.workers.kept_chunks import KeptChunks


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
    law: ControlLaw | UserLaw | ProcessLaw,
    motions: Sequence[GroundMotion],
    hardware: Hardware | None = None,
    *,
    histories: bool = False,
    step_factor: StepFactor = 1,
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
    measurements at its sample times. Ideal actuators replace the dampers if the law commands forces, without the rate
    of their drivers; actuators of one's own are `mr.buildings.ideal_actuator`.

    Parameters
    ----------
    devices
        One or more, each with a model, parameters, laws and unit of the command of its own; see `Device`. Those that
        hold a command or follow none come last; gains and commands of the law are of the others.
    law
        A law of the registry with its gains, or a law in Python or outside of it; one outside, or in Python where it
        cannot be recorded, takes one thread.
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
    user, law = law_in_loop(law, commanded(devices), 2 * building.n_coordinates)
    if not devices:
        raise SettingError(
            "a closed loop has at least one device; without dampers, simulate a device of zero force"
        )
    refuse_order(devices)
    actuators = law.spec.commands_force
    driven, devices, hardware = with_actuators(devices, law, hardware)
    refuse_rate(devices, hardware.command_rate, "command_rate")
    if not motions:
        raise SettingError("no ground motion was given; give at least one")
    for each in motions:
        refuse_floors(each, building.floor_names)
    n_states = 2 * len(building.check().mass)
    gains = law.gain_rows(len(driven), n_states)
    if user is None and not (sends_forces(devices) and gains.size and not gains.any()):
        refuse_units(law.spec, devices)
    shaping, counts = _core_shaping(law, shaping), {"gains": len(gains)}
    slope = math.inf
    if shaping is not None:
        slope, counts["`shaping`"] = float(shaping[:, 1].min()), len(shaping)
        refuse_rate(devices, slope, "command_slope")
    name, is_idle = law.name if user is None else user.in_words, gains.size and not gains.any()
    if not (actuators or devices[0].spec.follows_command or (is_idle and user is None)):
        raise SettingError(
            f"{name} commands {devices[0].name}, a {devices[0].spec.name} of which no parameter depends on the "
            "command: it would have no effect; give the model current laws, or simulate the passive damper with the "
            "law passive and a command of zero"
        )
    _check_commands(law, driven)
    theta = theta_of(devices)
    n_draws = len(theta[-1])
    factors: Floats | None = None
    if largest_commands is not None:
        factors = _command_factors(law, hardware, driven, largest_commands, slope, histories=histories)
        factors = np.hstack([factors, np.ones((len(factors), len(devices) - len(driven)))])
        counts["`largest_commands`"] = len(factors)
        theta = tuple(
            _stretch_theta(devices[group[0]].spec, parameters, factors[:, group])
            for group, parameters in zip(device_groups(devices), theta, strict=True)
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
    varied, places = _distinct(variation.buildings, building)
    if not varied and building.site_stiffness is not building.stiffness:
        # The law's own building stays elastic.
        varied = [building]
    changes = variation.changes
    if changes is not None and len(gains) > 1:
        raise SettingError(f"the gains are of {len(gains)} candidates; give changes of the gains of one")
    observer, is_absolute = None, estimates_absolute(law, motions, hardware)
    if hardware.feedback != "state":
        observer = loop_observer(nominal or building, devices, hardware, is_absolute=is_absolute)
    if isinstance(user, RowsLaw):
        rows = np.broadcast_to(user.settings, (n_candidates, user.settings.shape[1]))
        user = replace(user, settings=rows)
    recorded, settings, reason = recorded_for(user, loop_shape(building, driven, hardware))
    asked = None if recorded is not None else user
    shapes = {gain.name: gain.shape_for(len(driven), n_states) for gain in law.spec.gains}
    zeros = {name: np.zeros(shape) for name, shape in shapes.items() if name in law.gains}
    loop = LoopOfRuns(
        building=building,
        varied=tuple((each.damping, each.site_stiffness) for each in varied),
        devices=tuple(devices),
        # As its candidates share it: with gains of zero, which belong to no candidate.
        law=replace(law, gains=zeros, weights=None, margins=None, notes=()),
        hardware=hardware,
        observer=observer,
        motions=tuple(motions),
        step_factor=step_factor,
        own=recorded,
        estimates_absolute=is_absolute,
    )
    # Every candidate under every motion with every realisation, the last varying fastest.
    shape = n_candidates, len(motions), len(variation)
    candidate, motion, realisation = np.indices(shape, dtype=np.uint32).reshape(3, -1)
    draw = realisation if n_draws > 1 else np.zeros_like(realisation)
    if len(theta[0]) > n_draws:
        # Each candidate has draws of its own, with its scale of the command.
        draw = candidate * np.uint32(n_draws) + draw
    late = np.round(variation.delay / (hardware.sample_time / hardware.steps)).astype(np.uint32)
    # The noise of a run depends on its motion and realisation only: candidates have equal noise.
    numbers = np.array(range(len(motions)) if motion_numbers is None else motion_numbers, dtype=np.uint64)
    seeds = np.uint64(hardware.seed) + variation.seed.astype(np.uint64)
    runs = RunsOfLoop(
        runs=np.column_stack(
            [candidate, motion, draw, np.array(places, dtype=np.uint32)[realisation], late[realisation]]
        ),
        streams=numbers[motion] + seeds[realisation] * np.uint64(2**32),
        gains=gains,
        settings=settings,
        shaping=shaping,
        theta=theta,
    )
    law_remarks: tuple[Remark, ...] = ()
    if isinstance(user, RowsLaw) and reason:
        law_remarks = (IN_PYTHON.remark(user.formula.name, reason),)
    # A design has looked at its own gain.
    if SETTINGS[law.name].is_regulator and law.margins is None and len(gains) == 1:
        plant = plant_of(building, elongation_rows(building, driven))
        gain = np.reshape(law.gains["gain"], (len(driven), n_states))
        law_remarks = tuple(gain_remarks(plant, gain, sample_time=hardware.sample_time))
    core, workers = loop.core(), present_workers()
    if workers is None or histories or asked is not None or changes is not None:
        simulate = core.simulator(runs, histories=histories, threads=threads, changes=changes)
        parts, order = _respond_here(loop, runs, simulate, asked, on_progress)
        if isinstance(user, ProcessLaw):
            law_remarks = user.round_trips.remarks
    else:
        parts, order = _respond_elsewhere(workers, loop, runs, on_progress), np.arange(len(runs.runs))
    responses = _responses(core, runs, parts, order, varied or [building], factors)
    if recorded is not None and isinstance(user, RowsLaw):
        _blame(user, core, runs, responses)
    return replace(responses, law_remarks=law_remarks)


def _blame(user: RowsLaw, core: CoreLoop, runs: RunsOfLoop, responses: Responses) -> None:
    """Refuse a law that made no number of numbers: the function itself is asked in the first run that failed safe."""
    failed = np.flatnonzero(np.ravel(responses.outcome) == Outcome.FAILED_SAFE)[:1]
    if len(failed):
        loop = replace(core.loop, own=None)
        driven = loop.devices[: loop.n_commanded]
        with user.at_work(driven, loop.hardware.sample_time) as ask_of:
            replace(core, loop=loop).simulator(runs, threads=1)(failed, ask_of(runs.runs[failed, :3]))


def _distinct(buildings: Sequence[Building], building: Building) -> tuple[list[Building], list[int]]:
    """Distinct ones of the buildings of realisations, none if all are `building`, and the index of each one's own."""
    if all(own is building for own in buildings):
        return [], [0] * len(buildings)
    distinct = list({id(own): own for own in buildings}.values())
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
    return distinct, [places[id(own)] for own in buildings]


def _respond_here(
    loop: LoopOfRuns,
    runs: RunsOfLoop,
    simulate: Simulator,
    user: RowsLaw | ProcessLaw | None,
    on_progress: Callable[[int, int], None] | None,
) -> tuple[list[Any], NDArray[np.intp]]:
    """Runs in this process part by part, and the order in which they were simulated."""
    order = np.arange(len(runs.runs))
    if user is None:
        # Runs that last equally long share lanes: side by side, so that they are in one call of the core.
        seconds = np.array([motion.duration for motion in loop.motions])
        order = np.argsort(seconds[runs.runs[:, 1]], kind="stable")
    parts = []
    most = _RUNS_AT_A_TIME if user is None else user.most_at_once
    done, count = 0, most if on_progress is None else min(_FEWEST_RUNS, most)
    driven, sample_time = loop.devices[: loop.n_commanded], loop.hardware.sample_time
    with nullcontext() if user is None else user.at_work(driven, sample_time) as ask_of:
        while done < len(order):
            part, began = order[done : done + count], perf_counter()
            parts.append(simulate(part, None if ask_of is None else ask_of(runs.runs[part, :3])))
            done += len(part)
            if on_progress is not None:
                on_progress(done, len(order))
                blocks = count / _FEWEST_RUNS * _BLOCK_SECONDS / max(perf_counter() - began, 1e-6)
                count = min(most, _FEWEST_RUNS * int(min(max(blocks, 1.0), _RUNS_AT_A_TIME / _FEWEST_RUNS)))
    return parts, order


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
        arrays = runs.runs, runs.streams, runs.gains, runs.settings, runs.shaping, *runs.theta
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
    return [(*finished[number], None, None) for number in range(len(chunks))]


def _responses(
    core: CoreLoop,
    runs: RunsOfLoop,
    parts: Sequence[Any],
    order: NDArray[np.intp],
    buildings: Sequence[Building],
    factors: Floats | None,
) -> Responses:
    """The responses of runs of these buildings that were simulated in this order."""
    loop, at = core.loop, np.argsort(order)
    summary, outcome, steps = (np.concatenate([part[index] for part in parts])[at] for index in range(3))
    slopes: Sequence[Floats] = ()
    if parts[0][4] is not None:
        slopes = [*np.moveaxis(np.concatenate([part[4] for part in parts])[at], 1, 0)]
    rows = None if parts[0][3] is None else [history for part in parts for history in part[3]]
    candidates, motions, places = runs.runs[:, 0], loop.motions, runs.runs[:, 3]
    springs = np.array([building.storey_springs for building in buildings])

    def by_name(columns: Floats) -> dict[str, Floats]:
        """Quantities of the runs, or their slopes, of columns of the core."""
        numbers = columns_by_name(columns, run_quantities(), core.building.summary_layout)
        numbers |= _shears(loop.building, numbers, springs[places], len(buildings))
        if loop.n_commanded < len(loop.devices):
            # Devices that no law commands count in no criterion of the command.
            of_law = np.arange(len(loop.devices)) < loop.n_commanded
            names = {criterion.quantity for criterion in criteria() if criterion.of_command}
            numbers |= {name: np.where(of_law, numbers[name], np.nan) for name in names}
        if factors is not None:
            numbers |= {name: numbers[name] * factors[candidates] for name in _COMMANDS}
        return numbers

    return Responses(
        shape=(len(runs.gains), len(motions), len(candidates) // (len(runs.gains) * len(motions))),
        outcome=outcome,
        steps=steps,
        histories=None
        if rows is None
        else tuple(
            History(
                time=np.arange(len(rows[run]), dtype=np.float64) * loop.hardware.sample_time,
                numbers=columns_by_name(rows[run], history_signals(), core.building.history_layout),
            )
            for run in at
        ),
        devices=() if sends_forces(loop.devices) else loop.devices,
        command_unit=command_unit_of(loop.devices),
        seconds=tuple(motion.duration for motion in motions),
        motions=tuple(motion.name for motion in motions),
        numbers=by_name(summary),
        slopes=tuple(map(by_name, slopes)),
    )


def _shears(
    building: Building, numbers: Mapping[str, Floats], springs: Floats, n_buildings: int
) -> dict[str, Floats]:
    """Shears of a run that the core does not know, and NaN for what of them the building does not say."""
    is_chain, is_linear = bool(building.unit_drifts.any()), all(each.is_linear for each in building.elements)
    flags = {
        "peak_storey_shear": is_chain,
        "peak_frame_shear": bool(building.storey_springs.any()) and (is_linear or n_buildings < 2),
        "storey_energy": is_chain,
        "peak_overturning": is_chain and bool(building.heights.size),
    }
    drifts = numbers["peak_drift"]
    # A stroke has no spring, also in a run without an end.
    shears = np.multiply(drifts, springs, out=np.zeros_like(drifts), where=springs > 0.0)
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
    if histories or hardware.changes_command or math.isfinite(slope):
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
