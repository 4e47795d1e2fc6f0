"""A controlled building in JAX, by the equations of the core: dampers of the package or of the user, sampled laws.

M q'' + C q' + K q = -sum_d e_d' F_d - M r a_g. At t = k Ts a law measures and commands. Until the next sample,
building, dampers and energies advance by the classical Runge-Kutta rule, the driver by its exact solution.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import ArrayLike

from mrwork import _rust
from mrwork.base.values import array_dataclass
from mrwork.dampers.spec import DamperSpec
from mrwork.twins.loop_laws import Measurement
from mrwork.twins.model_twins import left_of_lag, parameters_at, twin_of
from mrwork.twins.powers import root

# As STEPS_PER_CHECK of `block.rs`.
_STEPS_PER_CHECK = 512
STRETCH = 128
"""Control samples between two states that a derivative in reverse mode keeps; what lies between is simulated again."""
# Numbers of a matrix up to which a product is written as a sum.
_FEW = 1024
# Share of the largest command that a change exceeds to be counted.
_CHANGE = 0.1


class LoopPlant(NamedTuple):
    """Matrices of a building, as in `mrwork.buildings.Building`, with the products that a step needs."""

    mass: Array
    damping: Array
    stiffness: Array
    influence: Array
    floors: Array
    storeys: Array
    unit_drifts: Array
    heights: Array
    stiffness_per_mass: Array
    damping_per_mass: Array

    @classmethod
    def of(cls, matrices: Mapping[str, ArrayLike]) -> LoopPlant:
        """The plant of a building's M [kg], C [N s/m], K [N/m], (n, n), influence, rows of floors and storeys."""
        arrays = {name: jnp.asarray(matrix, dtype=jnp.float64) for name, matrix in matrices.items()}
        if not arrays["heights"].size:
            arrays["heights"] = jnp.zeros(len(arrays["storeys"]))
        products = (jnp.linalg.solve(arrays["mass"], arrays[name]) for name in ("stiffness", "damping"))
        return cls(**arrays, **dict(zip(("stiffness_per_mass", "damping_per_mass"), products, strict=True)))


MATRICES = tuple(name for name in LoopPlant._fields if not name.endswith("per_mass"))
"""Fields of a building that a plant is made of."""


@partial(
    jax.tree_util.register_dataclass,
    data_fields=["theta", "row", "count"],
    meta_fields=["spec", "differential"],
)
@array_dataclass()
class LoopDevice:
    """Dampers across a storey with one command: `F = count f(x, v)`, or `count (f(x, v) - f(-x, -v))` if differential.

    The elongation is row @ q, shape (n,).
    """

    spec: DamperSpec
    theta: Array
    row: Array
    count: Array | float = 1.0
    differential: bool = False

    @classmethod
    def of(cls, placed: Any) -> LoopDevice:
        """The dampers of a `mrwork.Device`, of whose draws the first counts."""
        theta, row = (jnp.asarray(array, dtype=jnp.float64) for array in (placed.draws[0], placed.row))
        return cls(
            spec=placed.spec, theta=theta, row=row, count=placed.count, differential=placed.differential
        )

    @property
    def at_rest(self) -> Array:
        """States of the dampers at rest, one row per direction, shape (1 or 2, n_states)."""
        return jnp.zeros((2 if self.differential else 1, self.spec.n_states))

    def parameters(self, received: Array) -> Any:
        """Parameters of the plain model for a command received by the coil."""
        return parameters_at(self.spec, self.theta, received)

    def respond(self, p: Any, states: Array, x: Array, v: Array) -> tuple[Array, Array]:
        """Force F [N] for an elongation and its rate, and the rates of the damper states, in the shape of `at_rest`."""
        twin = twin_of(self.spec)
        force = self.count * twin.force(p, states[0], x, v)
        rates = [twin.rate(p, states[0], x, v)]
        if self.differential:
            force = force - self.count * twin.force(p, states[1], -x, -v)
            rates.append(twin.rate(p, states[1], -x, -v))
        return force, jnp.stack(rates)


Devices = tuple[LoopDevice, ...]


def believed_devices(devices: Devices, curve: tuple[DamperSpec, ArrayLike] | None) -> Devices | None:
    """The devices as a law believes them to be: by its model of the damper, if it has one."""
    if curve is None:
        return None
    spec, theta = curve[0], jnp.asarray(curve[1], dtype=jnp.float64)
    return tuple(replace(device, spec=spec, theta=theta) for device in devices)


class Energies(NamedTuple):
    """Energies since the start [J]: input, structural damping, and dissipation of each device, (n_devices,)."""

    entered: Array
    damping: Array
    devices: Array


class Travel(NamedTuple):
    """Travel of commands from sample to sample, and the number of their changes, each (n_devices,).

    A change is one of more than a tenth of the largest command, and ends where the command turns back by as much.
    """

    travel: Array
    changes: Array
    last: Array
    low: Array
    high: Array
    direction: Array

    def with_sample(self, command: Array, largest: Array, first: Array) -> Travel:
        """Return the value with the commands of one more sample, or of the `first` one."""
        low, high = jnp.minimum(self.low, command), jnp.maximum(self.high, command)
        rose = (self.direction < 0.5) & (command - low > _CHANGE * largest)
        fell = (self.direction > -0.5) & (high - command > _CHANGE * largest)
        after = Travel(
            travel=self.travel + jnp.abs(command - self.last),
            changes=self.changes + rose + fell,
            last=command,
            low=jnp.where(fell, command, low),
            high=jnp.where(rose, command, high),
            direction=jnp.where(rose, 1.0, jnp.where(fell, -1.0, self.direction)),
        )
        begun = Travel(*6 * [jnp.zeros_like(command)])._replace(last=command, low=command, high=command)
        travel: Travel = jax.tree.map(partial(jnp.where, first), begun, after)
        return travel


class LoopState(NamedTuple):
    """State of a Runge-Kutta step: coordinates, their rates, damper states, energies."""

    q: Array
    v: Array
    states: tuple[Array, ...]
    energies: Energies

    def along(self, time: Array | float, rate: LoopState) -> LoopState:
        """State after `time` at a constant rate."""
        later: LoopState = jax.tree.map(lambda x, slope: x + time * slope, self, rate)
        return later


class Stage(NamedTuple):
    """Runge-Kutta stage: derivative of the state; forces, elongations and their rates of the devices, (n_devices,)."""

    rate: LoopState
    force: Array
    elongation: Array
    elongation_rate: Array


class Reductions(NamedTuple):
    """Accumulated numbers of a run: peaks and squares of all signals, sums of currents, commands, energy balance."""

    peak: Array
    squares: Array
    current_sum: Array
    command: Travel
    imbalance: Array
    turnover: Array


class LoopCarry(NamedTuple):
    """State of a loop between samples: motion, commands at the coils, earlier ones, newest first, what a law keeps."""

    motion: LoopState
    received: Array
    commands: Array
    memory: Array
    kept: Reductions


class AtSample(NamedTuple):
    """A control sample: its number, the ground at start, middle and end of its steps, and commands if prescribed.

    Of the ground also the acceleration by the record, as a law reads it [m/s^2], and the velocity [m/s], (3,).
    """

    number: Array
    ground: Array | None
    prescribed: Array | None
    sensed: Array


class LoopRun(NamedTuple):
    """A run: building, devices with those that the law believes in, its numbers, and the timing of the loop.

    `law` returns commands and what it keeps, of what is measured and what it keeps, which is `memory` at the start.
    `largest` are the largest commands. `dead_zone` is the damper velocity [m/s] below which the command is zero,
    `furthest` the largest change of the command from sample to sample, `delay` the delay of the command in integration
    steps. `ground` has the acceleration at start, middle and end of each step [m/s^2], shape (3 n_steps,), padded.
    """

    plant: LoopPlant
    devices: Devices
    believed: Devices | None
    law: Callable[[Measurement, Array], tuple[Array, Array]]
    memory: Array
    largest: Array
    dead_zone: Array | float
    furthest: Array | float
    delay: Array | int
    sample_time: Array | float
    ground: Array
    # At control samples and the end: by the record, as its sensor reads it, and its velocity, shape (n_kept + 1, 3).
    sensed: Array


class LoopResult(NamedTuple):
    """Quantities of a run by name, and rows of its history, (n_kept, n) and (n,) at the end."""

    numbers: dict[str, Array]
    rows: Array
    end: Array


def simulate_run(
    run: LoopRun,
    n_samples: Array | int,
    steps: Array | int,
    *,
    n_kept: int,
    depth: int,
    prescribed: Array | None = None,
    histories: bool = False,
) -> LoopResult:
    """Simulate a run over `n_samples` of at most `n_kept`, which is a multiple of `STRETCH`.

    `steps` are integration steps of a sample. As an operand they compile once; as a number, the loop has derivatives
    in reverse mode. `depth` is the number of commands that are on their way at most, and one; `prescribed` are
    commands at the samples, shape (n_kept, n_devices).
    """
    loop = _Loop(run, steps, histories=histories)
    ground = run.ground.reshape(n_kept, -1) if isinstance(steps, int) else None

    def sample(carry: LoopCarry, at: AtSample) -> tuple[LoopCarry, Array]:
        after: tuple[LoopCarry, Array] = lax.cond(at.number < n_samples, loop.sample, loop.skip, carry, at)
        return after

    @partial(jax.checkpoint, prevent_cse=False)
    def stretch(carry: LoopCarry, at: AtSample) -> tuple[LoopCarry, Array]:
        return lax.scan(sample, carry, at)

    samples = jax.tree.map(
        lambda array: array.reshape(-1, STRETCH, *array.shape[1:]),
        AtSample(jnp.arange(n_kept), ground, prescribed, run.sensed[:-1]),
    )
    last, rows = lax.scan(stretch, loop.start(depth), samples)
    return loop.result(last, rows.reshape(n_kept, -1), n_samples)


class _Loop:
    def __init__(self, run: LoopRun, steps: Array | int, *, histories: bool) -> None:
        self.run, self.steps, self.histories = run, steps, histories
        self.rows = jnp.stack([device.row for device in run.devices])
        # M^-1 e' of all devices, shape (n, n_devices).
        self.pulls = jnp.linalg.solve(run.plant.mass, self.rows.T)
        self.lagged = jnp.array([device.spec.n_rates > 0 for device in run.devices])
        self.h = run.sample_time / steps

    def start(self, depth: int) -> LoopCarry:
        """At rest, with nothing accumulated."""
        n, zero, still = len(self.run.plant.mass), jnp.float64(0.0), jnp.zeros(len(self.run.devices))
        states = tuple(device.at_rest for device in self.run.devices)
        motion = LoopState(jnp.zeros(n), jnp.zeros(n), states, Energies(zero, zero, still))
        none = jnp.zeros_like(self.signals(motion, self.stage(motion, still, zero), still, zero)[1])
        reductions = Reductions(
            peak=none,
            squares=none,
            current_sum=still,
            command=Travel(*6 * [still]),
            imbalance=zero,
            turnover=zero,
        )
        return LoopCarry(motion, still, jnp.zeros((depth, len(still))), self.run.memory, reductions)

    def sample(self, carry: LoopCarry, at: AtSample) -> tuple[LoopCarry, Array]:
        """A control sample: the balance of the energies, the command, and the steps until the next one."""
        run, motion, reductions, first = self.run, carry.motion, carry.kept, at.number == 0
        x, v = times(self.rows, motion.q), times(self.rows, motion.v)
        checked = at.number % jnp.maximum(_STEPS_PER_CHECK // self.steps, 1) == 0
        reductions = jax.tree.map(partial(jnp.where, checked), self.balanced(motion, reductions), reductions)

        def force_at(currents: Array) -> Array:
            if run.believed is None:
                return self.forces(run.devices, motion.states, currents, x, v)
            return self.forces(run.believed, [device.at_rest for device in run.believed], currents, x, v)

        # The ground of this sample alone has a derivative that is cheap.
        ground, offset = (run.ground, 3 * at.number * self.steps) if at.ground is None else (at.ground, 0)
        accelerations = self.stage(motion, carry.received, ground[offset]).rate.v
        measured = Measurement(
            state=jnp.concatenate([motion.q, motion.v]),
            deformation=x,
            rate=v,
            force=self.forces(run.devices, motion.states, carry.received, x, v),
            force_at=force_at,
            largest=run.largest,
            prescribed=at.prescribed,
            acceleration=times(run.plant.floors, accelerations) + ground[offset],
            drift=times(run.plant.storeys, motion.q),
            ground_acceleration=at.sensed[1],
            ground_velocity=at.sensed[2],
            time=run.sample_time * at.number,
        )
        raw, memory = run.law(measured, carry.memory)
        command = jnp.clip(jnp.where(jnp.isnan(raw), 0.0, raw), 0.0, run.largest)
        command = jnp.where(jnp.abs(v) < run.dead_zone, 0.0, command)
        before = carry.commands[0]
        command = jnp.where(first, command, jnp.clip(command, before - run.furthest, before + run.furthest))
        commands = jnp.concatenate([command[None], carry.commands[:-1]])
        # The first command is in force from the start.
        commands = jnp.where(first, command, commands)
        received = jnp.where(first, command, carry.received)
        current = jnp.where(self.lagged, received, commands[self.age(0)])
        reductions = reductions._replace(command=reductions.command.with_sample(command, run.largest, first))
        row = self.row(motion, current, command, ground[offset], at.sensed[0])
        start = LoopCarry(motion, received, commands, memory, reductions)
        after: LoopCarry = lax.fori_loop(0, self.steps, partial(self.integrate, ground, offset), start)
        return after, row

    def skip(self, carry: LoopCarry, at: AtSample) -> tuple[LoopCarry, Array]:
        """A sample beyond the last."""
        still = jnp.zeros(len(self.run.devices))
        return carry, jnp.zeros_like(self.row(carry.motion, still, still, jnp.float64(0.0), jnp.float64(0.0)))

    def age(self, j: Array | int) -> Array:
        """Age, in control samples, of the command that a step of a sample receives."""
        age: Array = jnp.maximum(0, -((j - self.run.delay) // self.steps))
        return age

    def integrate(self, ground: Array, offset: Array | int, j: Array, carry: LoopCarry) -> LoopCarry:
        """A step; the coil current equals the command where there is no lag."""
        motion, h = carry.motion, self.h
        a_g = lax.dynamic_slice(ground, (offset + 3 * j,), (3,))
        command = carry.commands[self.age(j)]
        current = jnp.where(self.lagged, carry.received, command)
        decay = jnp.stack(
            [
                left_of_lag(device.spec, device.theta, current[index], command[index], 0.5 * h)
                for index, device in enumerate(self.run.devices)
            ]
        )
        middle = (current - command) * decay + command
        end = (middle - command) * decay + command
        first = self.stage(motion, current, a_g[0])
        second = self.stage(motion.along(0.5 * h, first.rate), middle, a_g[1])
        third = self.stage(motion.along(0.5 * h, second.rate), middle, a_g[1])
        fourth = self.stage(motion.along(h, third.rate), end, a_g[2])
        after = jax.tree.map(
            lambda x, a, b, c, d: x + h / 6.0 * (a + 2.0 * (b + c) + d),
            motion,
            *(stage.rate for stage in (first, second, third, fourth)),
        )
        kept, signal = carry.kept, self.signals(motion, first, current, a_g[0])[1]
        reductions = kept._replace(
            peak=jnp.maximum(kept.peak, jnp.abs(signal)),
            squares=kept.squares + signal * signal,
            current_sum=kept.current_sum + current,
        )
        return LoopCarry(after, end, carry.commands, carry.memory, reductions)

    def stage(self, at: LoopState, currents: Array, a_g: Array) -> Stage:
        """Equation of motion under coil currents."""
        plant = self.run.plant
        x, x_rate = times(self.rows, at.q), times(self.rows, at.v)
        responses = [
            device.respond(device.parameters(currents[index]), at.states[index], x[index], x_rate[index])
            for index, device in enumerate(self.run.devices)
        ]
        force = jnp.stack([damper_force for damper_force, _ in responses])
        acceleration = (
            -(
                times(plant.stiffness_per_mass, at.q)
                + times(plant.damping_per_mass, at.v)
                + times(self.pulls, force)
            )
            - plant.influence * a_g
        )
        powers = Energies(
            entered=-times(times(plant.mass, plant.influence), at.v) * a_g,
            damping=times(at.v, times(plant.damping, at.v)),
            devices=x_rate * force,
        )
        rate = LoopState(at.v, acceleration, tuple(rate for _, rate in responses), powers)
        return Stage(rate=rate, force=force, elongation=x, elongation_rate=x_rate)

    def forces(self, devices: Devices, states: Sequence[Array], currents: Array, x: Array, v: Array) -> Array:
        """Forces of devices at elongations and rates, shape (n_devices,)."""
        forces = (
            device.respond(device.parameters(currents[index]), states[index], x[index], v[index])[0]
            for index, device in enumerate(devices)
        )
        return jnp.stack(list(forces))

    def signals(
        self, motion: LoopState, at: Stage, current: Array, a_g: Array
    ) -> tuple[dict[str, Array], Array]:
        """Signals at the start of a step by name, and all in a row; the acceleration of floors is absolute."""
        plant = self.run.plant
        inertia = times(plant.mass, at.rate.v + plant.influence * a_g)
        shears = times(plant.unit_drifts, inertia)
        signals = {
            "displacement": times(plant.floors, motion.q),
            "acceleration": times(plant.floors, at.rate.v) + a_g,
            "drift": times(plant.storeys, motion.q),
            "base_shear": times(plant.influence, inertia)[None],
            "storey_shear": shears,
            "frame_shear": times(plant.unit_drifts, times(plant.stiffness, motion.q)),
            "overturning": jnp.cumsum((shears * plant.heights)[::-1])[::-1],
            "force": at.force,
            "stroke": at.elongation,
            "rate": at.elongation_rate,
            "current": current,
        }
        return signals, jnp.concatenate(list(signals.values()))

    def row(self, motion: LoopState, current: Array, command: Array, a_g: Array, record: Array) -> Array:
        """A row of the history, in the order of `_rust.history_signals`; empty where none is kept."""
        if not self.histories:
            return jnp.zeros(0)
        signals, _ = self.signals(motion, self.stage(motion, current, a_g), current, a_g)
        row = signals | {
            "ground_acceleration": record[None],
            "state": jnp.concatenate([motion.q, motion.v]),
            "deformation": signals["stroke"],
            "command": command,
            "device_energy": motion.energies.devices,
            "input_energy": motion.energies.entered[None],
            "damping_energy": motion.energies.damping[None],
        }
        # Buildings with passive elements are not simulated here.
        return jnp.concatenate([row.get(name, jnp.zeros(0)) for name, *_ in _rust.history_signals()])

    def balanced(self, motion: LoopState, reductions: Reductions) -> Reductions:
        """The largest imbalance of the energies, and the largest energy that it is compared with [J]."""
        kinetic, strain = self.held(motion)
        entered, damping, devices = motion.energies
        turned_over = jnp.abs(damping) + jnp.abs(devices).sum() + kinetic + strain
        imbalance = jnp.abs(entered - kinetic - strain - damping - devices.sum())
        return reductions._replace(
            imbalance=jnp.maximum(reductions.imbalance, imbalance),
            turnover=jnp.maximum(reductions.turnover, jnp.maximum(jnp.abs(entered), turned_over)),
        )

    def held(self, motion: LoopState) -> tuple[Array, Array]:
        """Kinetic and strain energy [J]."""
        plant, q, v = self.run.plant, motion.q, motion.v
        return 0.5 * times(v, times(plant.mass, v)), 0.5 * times(q, times(plant.stiffness, q))

    def result(self, last: LoopCarry, rows: Array, n_samples: Array | int) -> LoopResult:
        """Quantities in SI with the names of the core, a number for each floor, storey or device, and the history."""
        n_steps = n_samples * self.steps
        motion, current, a_g = last.motion, last.received, self.run.ground[3 * n_steps - 1]
        reductions, energies, duration = self.balanced(motion, last.kept), motion.energies, n_steps * self.h
        named, at_end = self.signals(motion, self.stage(motion, current, a_g), current, a_g)
        ends = np.cumsum([len(signal) for signal in named.values()])[:-1]
        peaks, roots = (
            dict(zip(named, jnp.split(values, ends), strict=True))
            for values in (jnp.maximum(reductions.peak, jnp.abs(at_end)), root(reductions.squares / n_steps))
        )
        kinetic, strain = self.held(motion)
        none, drift = jnp.zeros(0), times(self.run.plant.storeys, motion.q)
        some = jnp.where(reductions.turnover == 0.0, 1.0, reductions.turnover)
        numbers = {
            **{f"peak_{name}": peak for name, peak in peaks.items()},
            **{f"rms_{name}": root for name, root in roots.items()},
            "residual_drift": drift,
            "mean_current": reductions.current_sum / n_steps,
            "command_travel": reductions.command.travel / duration,
            "switching_rate": reductions.command.changes / duration,
            "device_energy": energies.devices,
            # Buildings with passive elements are not simulated here.
            "peak_element_force": none,
            "peak_element_stroke": none,
            "element_energy": none,
            "storey_energy": jnp.zeros_like(drift),
            "input_energy": energies.entered[None],
            "kinetic_energy": kinetic[None],
            "strain_energy": strain[None],
            "damping_energy": energies.damping[None],
            "energy_error": (reductions.imbalance / some)[None],
        }
        return LoopResult(
            numbers={name: numbers[name] for name, *_ in _rust.run_quantities()},
            rows=rows,
            # No sample follows: the last command is still held.
            end=self.row(motion, current, last.commands[0], a_g, self.run.sensed[n_samples][0]),
        )


def times(matrix: Array, vector: Array) -> Array:
    """Matrix or row times a vector; of few numbers as a sum, which XLA fuses with what is computed beside it."""
    product: Array = jnp.sum(matrix * vector, axis=-1) if matrix.size <= _FEW else matrix @ vector
    return product


def with_theta(devices: Devices, theta: Sequence[Array] | Array) -> Devices:
    """The devices with other parameters, of which `theta` has (n_params,) for each."""
    return tuple(replace(device, theta=theta[index]) for index, device in enumerate(devices))
