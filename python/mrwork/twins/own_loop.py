"""Loops with dampers of the user in batches, by the loop in JAX, with the stepping rule and the results of the core.

Integration steps follow from the building, from the slopes of the force, and from the relaxation of the states along
the run itself, which is simulated again with more of them until they suffice. Steps, samples and delays are counted at
run time, and runs and motions are padded to powers of two, so that few shapes are compiled.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache, partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from mrwork import _rust
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.parameters import MOST_SUBSTEPS
from mrwork.dampers.simulation import Outcome
from mrwork.twins.loop import (
    STRETCH,
    Devices,
    LoopDevice,
    LoopPlant,
    LoopResult,
    LoopRun,
    simulate,
    with_theta,
)
from mrwork.twins.loop_ground import half_steps, stage_values
from mrwork.twins.loop_laws import LAWS, Gains
from mrwork.twins.models import on_processor, parameters_at, twin_of
from mrwork.twins.own_batches import MOST_NUMBERS, computed, power_of_two
from mrwork.twins.own_stepping import FINER, N_LEVELS, RESOLUTION

# As LARGEST_DISPLACEMENT of `respond.rs` [m], and the velocities, displacements and differences of `slopes.rs` by which
# slopes of the force are looked for.
_LARGEST_DISPLACEMENT = 1e3
_VELOCITIES = (0.0, 1e-3, -1e-3, 1e-2, -1e-2, 0.1, -0.1, 0.5, -0.5)
_DISPLACEMENTS = (0.0, 1e-4, -1e-4, 1e-2, -1e-2)
_SHIFT = 1e-7
# A run that is not finite is tried so many times with finer steps.
_TRIES = 3
# Fewest runs, samples and values of the ground that are compiled apart; samples are whole stretches.
_FEWEST_RUNS, _FEWEST_SAMPLES, _FEWEST_VALUES = 4, 32 * STRETCH, 1 << 17


@array_dataclass()
class OwnLoop:
    """Shared data of the runs of a call: building, dampers, law, hardware and motions, (step [s], acceleration).

    `matrices` are the arguments of `LoopPlant.of`, `varied` damping and stiffness of realisations of the building,
    `believed` the dampers of the law, which commands the first `n_commanded`; `ranges` are smallest and largest
    commands, equal of a damper that holds one, shape (n_devices, 2). `sample_time` and `command_rate` belong to the
    hardware, `steps` its integration steps of a sample, in which the `delay` is counted. `widths` are the numbers of a
    summary and of a row of a history.
    """

    matrices: Mapping[str, Floats]
    varied: Sequence[tuple[Floats, Floats]]
    devices: Devices
    believed: Devices | None
    ranges: Floats
    n_commanded: int
    law: str
    motions: Sequence[tuple[float, Floats]]
    sample_time: float
    steps: int
    delay: int
    command_rate: float
    step_factor: int
    widths: tuple[int, int]

    @property
    def n_samples(self) -> list[int]:
        """Number of control samples of each motion, one at least."""
        durations = [dt * (len(acceleration) - 1) for dt, acceleration in self.motions]
        return [max(math.floor(duration / self.sample_time * (1.0 + 1e-12)), 1) for duration in durations]


class OwnRuns(NamedTuple):
    """Runs: candidate, motion, draw, building and delay of each, shape (n_runs, 5), and the numbers of candidates.

    `gains` by name, shape (n_candidates, ...); `shaping` (n_candidates, 2), dead zone and slope; `theta`
    (n_draws, n_columns) of each device.
    """

    runs: NDArray[np.uint32]
    gains: Mapping[str, Floats]
    shaping: Floats | None
    theta: Sequence[Floats]


@on_processor()
def respond(
    loop: OwnLoop, given: OwnRuns, *, histories: bool = False
) -> tuple[Floats, NDArray[np.uint8], NDArray[np.uint32], list[Floats] | None]:
    """Summaries of runs, outcomes, steps of a sample and rows of histories, as of `_rust.respond`.

    Each run has as many steps as it wants.
    """
    runs, samples = given.runs, loop.n_samples
    plants = [
        LoopPlant.of({**loop.matrices, "damping": damping, "stiffness": stiffness})
        for damping, stiffness in loop.varied or [(loop.matrices["damping"], loop.matrices["stiffness"])]
    ]
    fastest = [_fastest(plant) for plant in plants]
    additions = _additions(loop, given.theta)
    summary = np.full((len(runs), loop.widths[0]), np.inf)
    outcome = np.full(len(runs), Outcome.UNRESOLVED, dtype=np.uint8)
    steps = np.zeros(len(runs), dtype=np.uint32)
    # A row for each sample, and one for the end of the last.
    rows = [np.full((samples[run[1]] + 1, loop.widths[1]), np.inf) for run in runs] if histories else None
    tries = np.zeros(len(runs), dtype=np.int64)
    bounds = [math.hypot(fastest[run[3]], additions[run[2]][0]) + additions[run[2]][1] for run in runs]
    pending = {
        run: wanted * loop.step_factor
        for run, bound in enumerate(bounds)
        if (wanted := _steps_for(loop, bound))
    }
    while pending:
        finer: dict[int, int] = {}
        for motion_index, count, members in _groups(
            pending, runs, loop.widths[1] * max(samples) if histories else 0
        ):
            numbers, result = _run_group(
                loop, plants, given, members, motion_index, count, histories=histories
            )
            displacements = numbers[:, : len(loop.matrices["floors"])]
            bounded = np.isfinite(numbers).all(axis=1)
            bounded &= np.all(displacements < _LARGEST_DISPLACEMENT, axis=1)
            for index, (run, finite) in enumerate(zip(members, bounded.tolist(), strict=True)):
                tries[run] += not finite
                wanted = _steps_after(loop, count, float(result.bound[index]), 0 if finite else tries[run])
                if wanted > count:
                    finer[run] = wanted
                elif wanted:
                    failed = Outcome.FAILED_SAFE if result.invalid[index] else Outcome.FINISHED
                    outcome[run], steps[run] = failed if finite else Outcome.DIVERGED, count
                    if finite:
                        summary[run] = numbers[index]
                    if rows is not None:
                        rows[run][:] = result.rows[index]
        pending = finer
    return summary, outcome, steps, rows


def _steps_for(loop: OwnLoop, bound: float) -> int:
    """Steps of a sample for a rate [1/s]: the steps of the hardware times a power of two; 0 beyond the most."""
    wanted, steps = loop.sample_time * bound / RESOLUTION, loop.steps
    if not math.isfinite(wanted):
        return 0
    while steps < wanted:
        steps *= 2
    return steps if steps <= MOST_SUBSTEPS * loop.steps else 0


def _steps_after(loop: OwnLoop, count: int, bound: float, tries: int) -> int:
    """Steps that a run needs after one with `count` steps: as many where they suffice, 0 where no number does.

    `bound` bounds the rates of its states [1/s], `tries` counts runs that were not finite.
    """
    finer, twins = FINER * count, [twin_of(device.spec) for device in loop.devices if device.spec.n_states]
    possible = finer <= MOST_SUBSTEPS * loop.steps * loop.step_factor
    if tries:
        return finer if possible and tries <= _TRIES else count
    wanted = _steps_for(loop, bound) * loop.step_factor
    # Far from resolved, a run has no bound of its own to be trusted.
    if any(twin.relaxation is None for twin in twins) and not 0 < wanted <= finer:
        return finer if possible else 0
    return wanted


def _groups(
    pending: Mapping[int, int], runs: NDArray[np.uint32], numbers: int
) -> Iterator[tuple[int, int, list[int]]]:
    """Motion, steps of a sample and runs that are simulated together, each with so many `numbers` of a history."""
    groups: dict[tuple[int, int], list[int]] = {}
    for run, count in pending.items():
        groups.setdefault((int(runs[run, 1]), count), []).append(run)
    at_once = max(_FEWEST_RUNS, int(MOST_NUMBERS / max(numbers, 1)))
    for (motion_index, count), members in groups.items():
        for start in range(0, len(members), at_once):
            yield motion_index, count, members[start : start + at_once]


def _fastest(plant: LoopPlant) -> float:
    """The larger of the largest natural frequency [rad/s] and the largest eigenvalue of M^-1 C [1/s]."""
    stiffest, dampest = (
        float(np.abs(np.linalg.eigvals(np.asarray(matrix))).max())
        for matrix in (plant.stiffness_per_mass, plant.damping_per_mass)
    )
    return max(math.sqrt(stiffest), dampest)


def _additions(loop: OwnLoop, theta: Sequence[Floats]) -> list[tuple[float, float]]:
    """Frequency [rad/s] and decay [1/s] that the dampers of each draw add to the building, as `resolution.rs`."""
    inverse = np.linalg.inv(loop.matrices["mass"])
    added = np.zeros((len(theta[0]), 2))
    for index, device in enumerate(loop.devices):
        least, most = loop.ranges[index].tolist()
        levels = np.linspace(least, most, N_LEVELS if device.spec.follows_command else 1)
        slopes = computed(partial(_steepest, device, theta[index], levels))
        dampers = device.count * (2.0 if device.differential else 1.0)
        added += dampers * np.asarray(slopes) * (np.asarray(device.row) @ inverse @ np.asarray(device.row))
    return [(math.sqrt(stiffening), decay) for stiffening, decay in added.tolist()]


@jax.jit
def _steepest(device: LoopDevice, theta: Array, levels: Array) -> Array:
    """Largest slopes of the force over displacement and velocity, shape (n_draws, 2)."""
    force, rest = twin_of(device.spec).force, jnp.zeros(device.spec.n_states)
    at = jnp.array([(x, v) for x in _DISPLACEMENTS for v in _VELOCITIES])

    def slopes(row: Array, level: Array, motion: Array) -> Array:
        p, (x, v) = parameters_at(device.spec, row, level), motion
        here = force(p, rest, x, v)
        moved = jnp.stack([force(p, rest, x + _SHIFT, v), force(p, rest, x, v + _SHIFT)])
        return jnp.abs(moved - here) / _SHIFT

    every = jax.vmap(jax.vmap(jax.vmap(slopes, (None, None, 0)), (None, 0, None)), (0, None, None))
    return jnp.max(every(theta, levels, at), axis=(1, 2))


class _Own(NamedTuple):
    """Data in which runs of a group differ, with a leading axis; without varied buildings all share one plant."""

    plant: LoopPlant
    gains: Gains
    theta: tuple[Array, ...]
    dead_zone: Array
    furthest: Array
    delay: Array


@lru_cache(maxsize=32)
def _ground(acceleration: bytes, dt: float, step: float, n_steps: int) -> tuple[Floats, Floats]:
    """The ground of the steps, padded, and the record at their starts and at the end."""
    values = stage_values(np.frombuffer(acceleration), dt, step, n_steps).ravel()
    padding = power_of_two(len(values), _FEWEST_VALUES) - len(values)
    return np.pad(values, (0, padding)), half_steps(np.frombuffer(acceleration), dt, step, n_steps)[::2]


def _run_group(
    loop: OwnLoop,
    plants: Sequence[LoopPlant],
    batch: OwnRuns,
    members: Sequence[int],
    motion_index: int,
    steps: int,
    *,
    histories: bool,
) -> tuple[Floats, LoopResult]:
    """Summaries of runs of one motion with the results, whose rows end with the end of the last sample."""
    runs, n_samples = batch.runs[members], loop.n_samples[motion_index]
    padding = power_of_two(len(runs), _FEWEST_RUNS) - len(runs)
    places = np.append(runs, np.repeat(runs[-1:], padding, axis=0), axis=0)
    candidates, draws, buildings = places[:, 0], places[:, 2], places[:, 3]
    delay = (loop.delay + places[:, 4].astype(np.int64)) * (steps // loop.steps)
    shaping = np.tile([0.0, np.inf], (len(places), 1)) if batch.shaping is None else batch.shaping[candidates]
    arrays = _Own(
        plant=plants[0]
        if len(plants) == 1
        else jax.tree.map(lambda *leaves: jnp.stack(leaves)[buildings], *plants),
        gains={name: jnp.asarray(gain[candidates]) for name, gain in batch.gains.items()},
        theta=tuple(jnp.asarray(theta[draws]) for theta in batch.theta),
        dead_zone=jnp.asarray(shaping[:, 0]),
        furthest=jnp.asarray(np.minimum(shaping[:, 1], loop.command_rate) * loop.sample_time),
        delay=jnp.asarray(delay),
    )
    dt, acceleration = loop.motions[motion_index]
    ground, record = _ground(acceleration.tobytes(), dt, loop.sample_time / steps, n_samples * steps)
    call = partial(
        _simulate,
        arrays,
        loop.devices,
        loop.believed,
        loop.ranges[: loop.n_commanded, 1],
        loop.ranges[loop.n_commanded :, 0],
        loop.sample_time,
        ground,
        n_samples,
        steps,
        law=loop.law,
        shared=len(plants) == 1,
        # As many as the longest motion has, so that all motions share one program.
        n_kept=power_of_two(max(loop.n_samples), _FEWEST_SAMPLES),
        # Commands that are still on their way, at most.
        depth=1 + power_of_two(-(-int(delay.max()) // steps), 1) if delay.any() else 1,
        histories=histories,
    )
    result: Any = jax.tree.map(lambda array: np.array(array[: len(runs)]), computed(call))
    rows = np.concatenate([result.rows[:, :n_samples], result.end[:, None]], axis=1)
    # The first signal is the record, which a step finer has other values of.
    rows[:, :, :1] = record[::steps, None]
    summary = [result.numbers[name] for name, *_ in _rust.run_quantities()]
    return np.concatenate(summary, axis=1), result._replace(rows=rows)


@partial(jax.jit, static_argnames=("law", "shared", "n_kept", "depth", "histories"))
def _simulate(
    arrays: _Own,
    devices: Devices,
    believed: Devices | None,
    largest: Array,
    held: Array,
    sample_time: Array,
    ground: Array,
    n_samples: Array,
    steps: Array,
    *,
    law: str,
    shared: bool,
    n_kept: int,
    depth: int,
    histories: bool,
) -> LoopResult:
    def of_run(arrays: _Own) -> LoopResult:
        run = LoopRun(
            plant=arrays.plant,
            devices=with_theta(devices, arrays.theta),
            believed=believed,
            law=partial(LAWS[law], arrays.gains),
            largest=largest,
            dead_zone=arrays.dead_zone,
            furthest=arrays.furthest,
            delay=arrays.delay,
            sample_time=sample_time,
            ground=ground,
            held=held,
        )
        return simulate(run, n_samples, steps, n_kept=n_kept, depth=depth, histories=histories, bounded=True)

    axes: Any = (None if shared else 0, *(0 for _ in arrays[1:]))
    return jax.vmap(of_run, in_axes=(_Own(*axes),))(arrays)
