"""Closed-loop runs of dampers of the user in batches, by JAX, with the stepping rule and the results of the Rust loop.

Integration steps follow from the building, from the slopes of the force, and from the relaxation of the states along
the run itself, which is simulated again with more of them until they suffice. Steps, samples and delays are counted at
run time, and runs and motions are padded to powers of two, so that few shapes are compiled.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import NamedTuple, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import ArrayLike, NDArray

from mrwork import _rust
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.simulation import MOST_SUBSTEPS, Outcome
from mrwork.dampers.spec import DamperSpec
from mrwork.twins.loop_laws import LAWS, Gains
from mrwork.twins.loop_stepping import (
    Devices,
    Energies,
    Extent,
    Law,
    LoopDevice,
    LoopPlant,
    LoopResult,
    LoopState,
    Measurement,
    Reductions,
    Stage,
    StepGround,
    Travel,
    at_rest,
    half_steps,
    pulls_of,
    rows_of,
    signals_of,
    stage,
    stage_values,
    step,
    times,
)
from mrwork.twins.models import on_processor, twin_of
from mrwork.twins.own_batches import interruptible, power_of_two
from mrwork.twins.own_stepping import FINER, RESOLUTION, radius_of


class PlacedDamper(Protocol):
    """A damper across a storey: `mrwork.buildings.matrices.Device`, of whose draws the first counts."""

    @property
    def spec(self) -> DamperSpec:
        """Model."""

    @property
    def draws(self) -> Floats:
        """Parameters, shape (n_draws, n_params)."""

    @property
    def row(self) -> ArrayLike:
        """Row of the elongation, shape (n,)."""

    @property
    def count(self) -> float:
        """Number in parallel."""

    @property
    def differential(self) -> bool:
        """Whether as many act in the opposite direction."""


def devices_of(dampers: Sequence[PlacedDamper]) -> Devices:
    """The devices of a run, from those of NumPy arrays."""
    return tuple(
        LoopDevice(
            spec=each.spec,
            theta=jnp.asarray(each.draws[0]),
            row=jnp.asarray(each.row, dtype=jnp.float64),
            count=each.count,
            differential=each.differential,
        )
        for each in dampers
    )


# As LARGEST_DISPLACEMENT of `respond.rs` [m], STEPS_PER_CHECK of `block.rs`, COMMAND_LEVELS of `resolution.rs`, and the
# velocities, displacements and differences of `slopes.rs` by which slopes of the force are looked for.
_LARGEST_DISPLACEMENT = 1e3
_STEPS_PER_CHECK = 512
_LEVELS = 9
_VELOCITIES = (0.0, 1e-3, -1e-3, 1e-2, -1e-2, 0.1, -0.1, 0.5, -0.5)
_DISPLACEMENTS = (0.0, 1e-4, -1e-4, 1e-2, -1e-2)
_SHIFT = 1e-7
# A run that is not finite is tried so many times with finer steps.
_TRIES = 3
# Fewest runs, values of the ground and samples of a history that are compiled apart.
_FEWEST_RUNS, _FEWEST_VALUES, _FEWEST_SAMPLES = 4, 1 << 14, 1024
# Most numbers of the histories of a call.
_MOST_NUMBERS = 3e7


@array_dataclass()
class OwnLoop:
    """What the runs of a call share: building, dampers, law, hardware and motions, (step [s], acceleration).

    `varied` are damping and stiffness of realisations of the building, `believed` the dampers of the law, `largest`
    their largest commands. `sample_time` and `command_rate` are those of the hardware, `steps` its integration steps of
    a sample, in which the `delay` is counted.
    `widths` are the numbers of a summary and of a row of a history.
    """

    matrices: Mapping[str, Floats]
    varied: Sequence[tuple[Floats, Floats]]
    dampers: Sequence[PlacedDamper]
    believed: Sequence[PlacedDamper] | None
    largest: Floats
    law: str
    motions: Sequence[tuple[float, Floats]]
    sample_time: float
    steps: int
    delay: int
    command_rate: float
    step_factor: int
    widths: tuple[int, int]


class Responded(NamedTuple):
    """Summary of each run, its outcome and steps of a sample, and rows of its history, as of `_rust.respond`."""

    summary: Floats
    outcome: NDArray[np.uint8]
    steps: NDArray[np.uint32]
    rows: list[Floats] | None


class _Inputs(NamedTuple):
    """What the runs of a group differ in, with a leading axis; without varied buildings the plant is one for all."""

    gains: Gains
    theta: Array
    dead_zone: Array
    furthest: Array
    delay: Array


@on_processor()
def respond(
    loop: OwnLoop,
    runs: NDArray[np.uint32],
    gains: Mapping[str, Floats],
    shaping: Floats | None,
    theta: Floats,
    *,
    histories: bool = False,
) -> Responded:
    """Simulate runs: candidate, motion, draw, building and delay of each, shape (n_runs, 5).

    `gains` by name, shape (n_candidates, ...); `shaping` (n_candidates, 2), dead zone and slope; `theta`
    (n_draws, n_devices, n_columns).
    """
    plants = [
        LoopPlant.of(**{**loop.matrices, "damping": damping, "stiffness": stiffness})
        for damping, stiffness in loop.varied or [(loop.matrices["damping"], loop.matrices["stiffness"])]
    ]
    fastest = [_fastest(plant) for plant in plants]
    additions = _additions(loop, theta)
    summary = np.full((len(runs), loop.widths[0]), np.inf)
    outcome = np.full(len(runs), Outcome.UNRESOLVED, dtype=np.uint8)
    steps = np.zeros(len(runs), dtype=np.uint32)
    seconds = [dt * (len(acceleration) - 1) for dt, acceleration in loop.motions]
    n_samples = [max(math.floor(each / loop.sample_time * (1.0 + 1e-12)), 1) for each in seconds]
    n_columns = loop.widths[1]
    # A row for each sample, and one for the end of the last.
    rows = (
        [np.full((n_samples[motion] + 1, n_columns), np.inf) for motion in runs[:, 1]] if histories else None
    )
    tries = np.zeros(len(runs), dtype=np.int64)
    bounds = [math.hypot(fastest[run[3]], additions[run[2]][0]) + additions[run[2]][1] for run in runs]
    pending = {
        run: wanted * loop.step_factor
        for run, bound in enumerate(bounds)
        if (wanted := _steps_for(loop, bound))
    }
    while pending:
        finer: dict[int, int] = {}
        for motion, count, members in _groups(pending, runs, n_columns * max(n_samples) if histories else 0):
            found, bound, invalid, kept = _run_group(
                loop,
                plants,
                runs[members],
                gains,
                shaping,
                theta,
                motion,
                count,
                n_samples[motion],
                histories=histories,
            )
            displacements = found[:, : len(loop.matrices["floors"])]
            bounded = np.isfinite(found).all(axis=1) & np.all(displacements < _LARGEST_DISPLACEMENT, axis=1)
            for place, (run, finite) in enumerate(zip(members, bounded.tolist(), strict=True)):
                tries[run] += not finite
                wanted = _steps_after(loop, count, bound[place], tries[run] if not finite else 0)
                if wanted > count:
                    finer[run] = wanted
                elif wanted:
                    failed = Outcome.FAILED_SAFE if invalid[place] else Outcome.FINISHED
                    outcome[run], steps[run] = failed if finite else Outcome.DIVERGED, count
                    if finite:
                        summary[run] = found[place]
                    if rows is not None:
                        dt, acceleration = loop.motions[motion]
                        n_steps = n_samples[motion] * count
                        halves = half_steps(acceleration, dt, loop.sample_time / count, n_steps)
                        rows[run][:] = kept[place, : n_samples[motion] + 1]
                        # The first signal is the record, which a step finer has other values of.
                        rows[run][:, 0] = halves[:: 2 * count]
        pending = finer
    return Responded(summary, outcome, steps, rows)


def _steps_for(loop: OwnLoop, bound: float) -> int:
    """Steps of a sample for a rate [1/s]: those of the hardware times a power of two; 0 beyond the most."""
    wanted, steps = loop.sample_time * bound / RESOLUTION, loop.steps
    if not math.isfinite(wanted):
        return 0
    while steps < wanted:
        steps *= 2
    return steps if steps <= MOST_SUBSTEPS * loop.steps else 0


def _steps_after(loop: OwnLoop, count: int, bound: float, tries: int) -> int:
    """Steps that a run with `count` of them wants, no more where they suffice, 0 where none do.

    `bound` is that of its rates [1/s], `tries` counts runs that were not finite.
    """
    finer, spec = FINER * count, loop.dampers[0].spec
    possible = finer <= MOST_SUBSTEPS * loop.steps * loop.step_factor
    if tries:
        return finer if possible and tries <= _TRIES else count
    wanted = _steps_for(loop, bound) * loop.step_factor
    # Far from resolved, a run has no bound of its own to be trusted.
    if spec.n_states and twin_of(spec).relaxation is None and not 0 < wanted <= finer:
        return finer if possible else 0
    return wanted


def _groups(
    pending: Mapping[int, int], runs: NDArray[np.uint32], numbers: int
) -> Iterator[tuple[int, int, list[int]]]:
    """Motion, steps of a sample and runs that are simulated together, each with so many `numbers` of a history."""
    groups: dict[tuple[int, int], list[int]] = {}
    for run, count in pending.items():
        groups.setdefault((int(runs[run, 1]), count), []).append(run)
    at_once = max(_FEWEST_RUNS, int(_MOST_NUMBERS / max(numbers, 1)))
    for (motion, count), members in groups.items():
        for start in range(0, len(members), at_once):
            yield motion, count, members[start : start + at_once]


def _fastest(plant: LoopPlant) -> float:
    """The larger of the largest natural frequency [rad/s] and the largest eigenvalue of M^-1 C [1/s]."""
    stiffest, dampest = (
        float(np.abs(np.linalg.eigvals(np.asarray(each))).max())
        for each in (plant.stiffness_per_mass, plant.damping_per_mass)
    )
    return max(math.sqrt(stiffest), dampest)


def _additions(loop: OwnLoop, theta: Floats) -> list[tuple[float, float]]:
    """What the dampers of each draw add to the building: a frequency [rad/s] and a decay [1/s], as `resolution.rs`."""
    inverse = np.linalg.inv(loop.matrices["mass"])
    added = np.zeros((len(theta), 2))
    for index, device in enumerate(loop.dampers):
        levels = np.linspace(0.0, loop.largest[index], _LEVELS if device.spec.follows_command else 1)
        slopes = interruptible(partial(_steepest, devices_of([device])[0], theta[:, index], levels))
        dampers = device.count * (2.0 if device.differential else 1.0)
        added += dampers * np.asarray(slopes) * (np.asarray(device.row) @ inverse @ np.asarray(device.row))
    return [(math.sqrt(stiffening), decay) for stiffening, decay in added.tolist()]


@jax.jit
def _steepest(device: LoopDevice, theta: Array, levels: Array) -> Array:
    """Largest slopes of the force over displacement and velocity, shape (n_draws, 2)."""
    force, rest = twin_of(device.spec).force, jnp.zeros(device.spec.n_states)
    at = jnp.array([(x, v) for x in _DISPLACEMENTS for v in _VELOCITIES])

    def slopes(row: Array, level: Array, motion: Array) -> Array:
        p, (x, v) = replace(device, theta=row).parameters(level), motion
        here = force(p, rest, x, v)
        return (
            jnp.abs(jnp.stack([force(p, rest, x + _SHIFT, v), force(p, rest, x, v + _SHIFT)]) - here) / _SHIFT
        )

    every = jax.vmap(jax.vmap(jax.vmap(slopes, (None, None, 0)), (None, 0, None)), (0, None, None))
    return jnp.max(every(theta, levels, at), axis=(1, 2))


@lru_cache(maxsize=32)
def _ground(motion: bytes, dt: float, step: float, n_steps: int) -> Floats:
    values = stage_values(np.frombuffer(motion), dt, step, n_steps).ravel()
    return np.concatenate([values, np.zeros(power_of_two(len(values), _FEWEST_VALUES) - len(values))])


def _run_group(
    loop: OwnLoop,
    plants: Sequence[LoopPlant],
    runs: NDArray[np.uint32],
    gains: Mapping[str, Floats],
    shaping: Floats | None,
    theta: Floats,
    motion: int,
    steps: int,
    n_samples: int,
    *,
    histories: bool,
) -> tuple[Floats, Floats, NDArray[np.bool_], Floats]:
    """Summaries of runs of one motion, bounds of their rates [1/s], whether a command was invalid, and histories."""
    places = np.append(
        runs, np.repeat(runs[-1:], power_of_two(len(runs), _FEWEST_RUNS) - len(runs), axis=0), axis=0
    )
    candidate, draw, building = places[:, 0], places[:, 2], places[:, 3]
    finer = steps // loop.steps
    delay = (loop.delay + places[:, 4].astype(np.int64)) * finer
    shaped = np.tile([0.0, np.inf], (len(places), 1)) if shaping is None else shaping[candidate]
    inputs = _Inputs(
        gains={name: jnp.asarray(each[candidate]) for name, each in gains.items()},
        theta=jnp.asarray(theta[draw]),
        dead_zone=jnp.asarray(shaped[:, 0]),
        furthest=jnp.asarray(np.minimum(shaped[:, 1], loop.command_rate) * loop.sample_time),
        delay=jnp.asarray(delay),
    )
    plant = plants[0] if len(plants) == 1 else jax.tree.map(lambda *each: jnp.stack(each)[building], *plants)
    dt, acceleration = loop.motions[motion]
    found = interruptible(
        partial(
            _simulate,
            plant,
            devices_of(loop.dampers),
            None if loop.believed is None else devices_of(loop.believed),
            inputs,
            _ground(acceleration.tobytes(), dt, loop.sample_time / steps, n_samples * steps),
            loop.largest,
            loop.sample_time,
            n_samples,
            steps,
            law=loop.law,
            shared=len(plants) == 1,
            # Commands that are still on their way, at most.
            depth=1 + power_of_two(-(-int(delay.max()) // steps), 1) if delay.any() else 1,
            n_kept=power_of_two(n_samples + 1, _FEWEST_SAMPLES) if histories else 0,
        )
    )
    summary, bound, invalid, rows = (np.asarray(each)[: len(runs)] for each in found)
    return summary, bound, invalid, rows


class _Kept(NamedTuple):
    """What is accumulated over a run: peaks and squares of all signals, sums of currents, commands, the balance."""

    signals: Extent
    current_sum: Array
    command: Travel
    imbalance: Array
    turnover: Array
    bound: Array
    invalid: Array
    rows: Array


class _Carry(NamedTuple):
    motion: LoopState
    received: Array
    # Newest first.
    commands: Array
    kept: _Kept


@partial(jax.jit, static_argnames=("law", "shared", "depth", "n_kept"))
def _simulate(
    plant: LoopPlant,
    devices: Devices,
    believed: Devices | None,
    inputs: _Inputs,
    ground: Array,
    largest: Array,
    sample_time: Array,
    n_samples: Array,
    steps: Array,
    *,
    law: str,
    shared: bool,
    depth: int,
    n_kept: int,
) -> tuple[Array, Array, Array, Array]:
    def of_run(plant: LoopPlant, own: _Inputs) -> tuple[Array, Array, Array, Array]:
        fitted = tuple(replace(each, theta=own.theta[index]) for index, each in enumerate(devices))
        run = _Run(
            plant,
            fitted,
            pulls_of(plant, fitted),
            believed,
            LAWS[law](own.gains),
            own,
            ground,
            largest,
            sample_time,
            steps,
        )
        last = lax.fori_loop(0, n_samples, run.sample, run.start(depth, n_kept))
        return run.result(last, n_samples * steps)

    return jax.vmap(of_run, in_axes=(None if shared else 0, 0))(plant, inputs)


class _Run(NamedTuple):
    """The equations of one run."""

    plant: LoopPlant
    devices: Devices
    pulls: Array
    believed: Devices | None
    law: Law
    own: _Inputs
    ground: Array
    largest: Array
    sample_time: Array
    steps: Array

    @property
    def _lagged(self) -> Array:
        return jnp.array([device.lagged for device in self.devices])

    def start(self, depth: int, n_kept: int) -> _Carry:
        """At rest, with nothing accumulated."""
        n, zero = len(self.devices), jnp.float64(0.0)
        motion = at_rest(self.plant, self.devices)
        still = jnp.zeros(n)
        first = self._stage(motion, still, zero)
        signals = _joined(signals_of(self.plant, motion, first, still, zero))
        width = len(self._row(zero, motion, still, still))
        kept = _Kept(
            Extent.none(len(signals)),
            still,
            Travel.none(n),
            zero,
            zero,
            zero,
            jnp.bool_(False),
            jnp.zeros((n_kept, width)),
        )
        return _Carry(motion, still, jnp.zeros((depth, n)), kept)

    def _stage(self, motion: LoopState, currents: Array, a_g: Array) -> Stage:
        parameters = [device.parameters(currents[index]) for index, device in enumerate(self.devices)]
        return stage(self.plant, self.devices, self.pulls, parameters, motion, a_g)

    def sample(self, k: Array, carry: _Carry) -> _Carry:
        """A control sample: the balance of the energies, the command, and the steps until the next one."""
        motion, kept, first = carry.motion, carry.kept, k == 0
        rows = rows_of(self.devices)
        x, v = times(rows, motion.q), times(rows, motion.v)
        checked = k % jnp.maximum(_STEPS_PER_CHECK // self.steps, 1) == 0
        kept = jax.tree.map(partial(jnp.where, checked), self._balanced(motion, kept), kept)

        def force_at(currents: Array) -> Array:
            if self.believed is None:
                return self._stage(motion, currents, jnp.float64(0.0)).force
            forces = (
                device.respond(device.parameters(currents[i]), device.at_rest, x[i], v[i])[0]
                for i, device in enumerate(self.believed)
            )
            return jnp.stack(list(forces))

        measured = Measurement(
            state=jnp.concatenate([motion.q, motion.v]),
            deformation=x,
            rate=v,
            force=self._stage(motion, carry.received, jnp.float64(0.0)).force,
            force_at=force_at,
            largest=self.largest,
        )
        raw = self.law.command(measured)
        command = jnp.clip(jnp.where(jnp.isnan(raw), 0.0, raw), 0.0, self.largest)
        command = jnp.where(jnp.abs(v) < self.own.dead_zone, 0.0, command)
        before, furthest = carry.commands[0], self.own.furthest
        command = jnp.where(first, command, jnp.clip(command, before - furthest, before + furthest))
        commands = jnp.concatenate([command[None], carry.commands[:-1]])
        # The first command is in force from the start.
        commands = jnp.where(first, command, commands)
        received = jnp.where(first, command, carry.received)
        current = jnp.where(self._lagged, received, commands[self._age(0)])
        n_kept = len(kept.rows)
        kept = kept._replace(
            command=kept.command.with_sample(command, self.largest, first),
            bound=jnp.maximum(kept.bound, self._relaxation(motion, current, x, v)),
            invalid=kept.invalid | jnp.isnan(raw).any(),
        )
        if n_kept:
            kept = kept._replace(
                rows=kept.rows.at[k].set(self._row(self.ground[3 * k * self.steps], motion, current, command))
            )
        start = _Carry(motion, received, commands, kept)
        last: _Carry = lax.fori_loop(0, self.steps, partial(self._integrate, k), start)
        return last

    def _age(self, j: Array | int) -> Array:
        """Age, in control samples, of the command that a step of a sample receives."""
        age: Array = jnp.maximum(0, -((j - self.own.delay) // self.steps))
        return age

    def _integrate(self, k: Array, j: Array, carry: _Carry) -> _Carry:
        accelerations = StepGround(*lax.dynamic_slice(self.ground, (3 * (k * self.steps + j),), (3,)))
        command = carry.commands[self._age(j)]
        # Without a lag, the coil current equals the command.
        current = jnp.where(self._lagged, carry.received, command)
        h = self.sample_time / self.steps
        after, received, start = step(
            self.plant, self.devices, self.pulls, carry.motion, current, command, accelerations, h
        )
        signals = _joined(signals_of(self.plant, carry.motion, start, current, accelerations.start))
        kept = carry.kept._replace(
            signals=carry.kept.signals.with_sample(signals), current_sum=carry.kept.current_sum + current
        )
        return _Carry(after, received, carry.commands, kept)

    def _relaxation(self, motion: LoopState, currents: Array, x: Array, v: Array) -> Array:
        """Fastest relaxation of the dampers' states [1/s]."""
        found = [jnp.float64(0.0)]
        for index, device in enumerate(self.devices if any(d.spec.n_states for d in self.devices) else ()):
            twin, p = twin_of(device.spec), device.parameters(currents[index])
            for state, sign in zip(motion.states[index], (1.0, -1.0), strict=False):
                at = sign * x[index], sign * v[index]
                radius = (
                    radius_of(twin.rate, p, state, *at)
                    if twin.relaxation is None
                    else twin.relaxation(p, *at)
                )
                found.append(radius)
        return jnp.max(jnp.stack(found))

    def _balanced(self, motion: LoopState, kept: _Kept) -> _Kept:
        """The largest imbalance of the energies, and the largest energy that it is compared with [J]."""
        kinetic, strain = self._held(motion)
        entered, damping, devices = motion.energies
        turned_over = jnp.abs(damping) + jnp.abs(devices).sum() + kinetic + strain
        imbalance = jnp.abs(entered - kinetic - strain - damping - devices.sum())
        return kept._replace(
            imbalance=jnp.maximum(kept.imbalance, imbalance),
            turnover=jnp.maximum(kept.turnover, jnp.maximum(jnp.abs(entered), turned_over)),
        )

    def _held(self, motion: LoopState) -> tuple[Array, Array]:
        """Kinetic and strain energy [J]."""
        q, v = motion.q, motion.v
        return 0.5 * times(v, times(self.plant.mass, v)), 0.5 * times(q, times(self.plant.stiffness, q))

    def _row(self, a_g: Array, motion: LoopState, current: Array, command: Array) -> Array:
        """A row of the history, in the order of `_rust.history_signals`."""
        at = self._stage(motion, current, a_g)
        signals = signals_of(self.plant, motion, at, current, a_g)
        energies: Energies = motion.energies
        none = jnp.zeros(0)
        row = signals | {
            "ground_acceleration": a_g[None],
            "state": jnp.concatenate([motion.q, motion.v]),
            "deformation": signals["stroke"],
            "command": command,
            "device_energy": energies.devices,
            "input_energy": energies.entered[None],
            "damping_energy": energies.damping[None],
            # The twin is that of buildings without passive elements.
            **dict.fromkeys(("element_deformation", "element_force", "element_energy"), none),
        }
        return jnp.concatenate([row[name] for name, *_ in _rust.history_signals()])

    def result(self, last: _Carry, n_steps: Array) -> tuple[Array, Array, Array, Array]:
        """Summary in the order of `_rust.run_quantities`, bound, validity of the commands, rows of the history."""
        kept = self._balanced(last.motion, last.kept)
        zero = jnp.float64(0.0)
        still = jnp.zeros(len(self.devices))
        names = signals_of(self.plant, last.motion, self._stage(last.motion, still, zero), still, zero)
        ends = np.cumsum([len(each) for each in names.values()])[:-1]
        peaks, squares = (jnp.split(each, ends) for each in kept.signals)
        kinetic, strain = self._held(last.motion)
        summary = LoopResult(
            reductions=Reductions(
                extents={
                    name: Extent(peak, square)
                    for name, peak, square in zip(names, peaks, squares, strict=True)
                },
                current_sum=kept.current_sum,
                command=kept.command,
            ),
            energies=last.motion.energies,
            kinetic=kinetic,
            strain=strain,
            drift=times(self.plant.storeys, last.motion.q),
            n_steps=n_steps,
            step_time=self.sample_time / self.steps,
        ).summary()
        error = jnp.where(kept.turnover == 0.0, 0.0, kept.imbalance / kept.turnover)
        summary["energy_error"] = error[None]
        numbers = jnp.concatenate([summary[name] for name, *_ in _rust.run_quantities()])
        rows = kept.rows
        if len(rows):
            # No sample follows: the last command is still held.
            end = self._row(self.ground[3 * n_steps - 1], last.motion, last.received, last.commands[0])
            rows = rows.at[n_steps // self.steps].set(end)
        return numbers, kept.bound, kept.invalid, rows


def _joined(signals: Mapping[str, Array]) -> Array:
    return jnp.concatenate(list(signals.values()))
