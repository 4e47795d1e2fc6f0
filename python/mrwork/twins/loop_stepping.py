"""Closed-loop run: measurement and command at t = k Ts, then integration steps until the next control sample.

The plant is a building with dampers across its storeys, M q'' + C q' + K q = -sum_d e_d' F_d - M r a_g. In a step,
building, dampers and energies advance by the classical Runge-Kutta rule, the driver by its exact solution.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike

from mrwork.base.arguments import Count, Positive
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.twins.models import parameters_at, twin_of


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
    def of(
        cls,
        *,
        mass: ArrayLike,
        damping: ArrayLike,
        stiffness: ArrayLike,
        influence: ArrayLike,
        floors: ArrayLike,
        storeys: ArrayLike,
        unit_drifts: ArrayLike | None = None,
        heights: ArrayLike = (),
    ) -> LoopPlant:
        """Return the plant of M [kg], C [N s/m], K [N/m], (n, n), and rows of floors and storeys, as in `Building`.

        Without unit drifts shears are not worked out.
        """
        rows, tall = np.asarray(storeys, dtype=np.float64), np.asarray(heights, dtype=np.float64)
        m = jnp.asarray(mass, dtype=jnp.float64)
        c = jnp.asarray(damping, dtype=jnp.float64)
        k = jnp.asarray(stiffness, dtype=jnp.float64)
        return cls(
            mass=m,
            damping=c,
            stiffness=k,
            influence=jnp.asarray(influence, dtype=jnp.float64),
            floors=jnp.asarray(floors, dtype=jnp.float64),
            storeys=jnp.asarray(rows),
            unit_drifts=jnp.asarray(np.zeros_like(rows) if unit_drifts is None else unit_drifts),
            heights=jnp.asarray(tall if tall.size else np.zeros(len(rows))),
            stiffness_per_mass=jnp.linalg.solve(m, k),
            damping_per_mass=jnp.linalg.solve(m, c),
        )


@partial(
    jax.tree_util.register_dataclass,
    data_fields=["theta", "row", "count"],
    meta_fields=["spec", "differential"],
)
@array_dataclass()
class LoopDevice:
    """Dampers across a storey with one command: `F = count f(x, v)`, or `count (f(x, v) - f(-x, -v))` if differential.

    The elongation is row @ q, shape (n,): a row of `storeys`.
    """

    spec: DamperSpec
    theta: Array
    row: Array
    count: Array | float = 1.0
    differential: bool = False

    @property
    def lagged(self) -> bool:
        """Whether the coil follows the command with a lag."""
        return self.spec.lagged

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

    def decay(self, time: Array | float) -> Array:
        """Fraction of the difference between command and coil current left after a time [s]; zero without a lag."""
        if not self.lagged:
            return jnp.zeros(())
        left: Array = jnp.exp(-self.theta[-1] * time)
        return left


Devices = tuple[LoopDevice, ...]


def rows_of(devices: Devices) -> Array:
    """Rows of all devices, shape (n_devices, n)."""
    return jnp.stack([device.row for device in devices])


def pulls_of(plant: LoopPlant, devices: Devices) -> Array:
    """M^-1 e' of all devices, shape (n, n_devices)."""
    pulls: Array = jnp.linalg.solve(plant.mass, rows_of(devices).T)
    return pulls


@array_dataclass()
class Measurement:
    """Measurements for a law at a control sample: one entry per device, and the state s, shape (2n,).

    The elongation of a device [m], its rate [m/s], its force [N], and the forces at other coil currents.
    """

    state: Array
    deformation: Array
    rate: Array
    force: Array
    force_at: Callable[[Array], Array]
    largest: Array

    def slope(self) -> Array:
        """G of f(i) = F0 + G i + H i^2 through the forces at 0, half and the largest command, shape (n_devices,)."""
        none, middle, full = (self.force_at(share * self.largest) for share in (0.0, 0.5, 1.0))
        return (4.0 * middle - full - 3.0 * none) / self.largest


class Law(Protocol):
    """A control law."""

    def command(self, measured: Measurement) -> Array:
        """Command of each device, shape (n_devices,); the loop holds it between 0 and the largest."""


class Extent(NamedTuple):
    """Peak magnitude and sum of squares of signals, over the starts of all steps."""

    peak: Array
    squares: Array

    @classmethod
    def none(cls, n: int) -> Extent:
        """Initial value for `n` signals."""
        return cls(jnp.zeros(n), jnp.zeros(n))

    def with_sample(self, signal: Array) -> Extent:
        """Return the value with one more sample."""
        return Extent(jnp.maximum(self.peak, jnp.abs(signal)), self.squares + signal * signal)


class Energies(NamedTuple):
    """Energies since the start [J]: input, structural damping, and dissipation of each device, (n_devices,)."""

    entered: Array
    damping: Array
    devices: Array


# Share of the largest command that a change exceeds to be counted.
_CHANGE = 0.1


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

    @classmethod
    def none(cls, n: int) -> Travel:
        """Initial value for `n` commands."""
        return cls(*(jnp.zeros(n) for _ in cls._fields))

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
        begun = Travel.none(len(command))._replace(last=command, low=command, high=command)
        travel: Travel = jax.tree.map(lambda yes, no: jnp.where(first, yes, no), begun, after)
        return travel


class Reductions(NamedTuple):
    """Accumulated signals of floors, storeys, base and devices by name, see `signals_of`, and of the currents."""

    extents: dict[str, Extent]
    current_sum: Array
    command: Travel


_PEAKS_ONLY = ("stroke", "rate", "storey_shear", "frame_shear", "overturning")


class LoopResult(NamedTuple):
    """Result of a run: accumulated signals, energies [J] and drifts [m] at the end, number of steps, duration [s]."""

    reductions: Reductions
    energies: Energies
    kinetic: Array
    strain: Array
    drift: Array
    n_steps: Array
    step_time: Array | float

    @property
    def energy_error(self) -> Array:
        """Relative error of the energy balance at the end."""
        entered, damping, devices = self.energies
        held = self.kinetic + self.strain
        turnover = jnp.maximum(jnp.abs(entered), held + jnp.abs(damping) + jnp.abs(devices).sum())
        return jnp.abs(entered - held - damping - devices.sum()) / turnover

    def summary(self) -> dict[str, Array]:
        """Quantities with the names of the Rust loop, one number for each floor, storey or device, in SI."""
        kept = self.reductions
        rms = {name: jnp.sqrt(extent.squares / self.n_steps) for name, extent in kept.extents.items()}
        return {
            **{f"peak_{name}": extent.peak for name, extent in kept.extents.items()},
            **{f"rms_{name}": each for name, each in rms.items() if name not in _PEAKS_ONLY},
            "residual_drift": self.drift,
            "mean_current": kept.current_sum / self.n_steps,
            "command_travel": kept.command.travel / (self.n_steps * self.step_time),
            "switching_rate": kept.command.changes / (self.n_steps * self.step_time),
            "device_energy": self.energies.devices,
            # The twin is that of buildings without passive elements.
            "peak_element_force": jnp.zeros(0),
            "peak_element_stroke": jnp.zeros(0),
            "element_energy": jnp.zeros(0),
            "storey_energy": jnp.zeros_like(self.drift),
            "input_energy": self.energies.entered[None],
            "kinetic_energy": self.kinetic[None],
            "strain_energy": self.strain[None],
            "damping_energy": self.energies.damping[None],
            "energy_error": self.energy_error[None],
        }


class LoopState(NamedTuple):
    """State of a Runge-Kutta step: coordinates, their rates, damper states, energies."""

    q: Array
    v: Array
    states: tuple[Array, ...]
    energies: Energies


class Stage(NamedTuple):
    """Runge-Kutta stage: derivative of the state; forces, elongations and their rates of the devices, (n_devices,)."""

    rate: LoopState
    force: Array
    elongation: Array
    elongation_rate: Array


class StepGround(NamedTuple):
    """Ground acceleration at start, middle and end of a step [m/s^2]."""

    start: Array
    middle: Array
    end: Array


def at_rest(plant: LoopPlant, devices: Devices) -> LoopState:
    """State at rest, with zero energies."""
    n = plant.mass.shape[0]
    zero = jnp.float64(0.0)
    return LoopState(
        jnp.zeros(n),
        jnp.zeros(n),
        tuple(device.at_rest for device in devices),
        Energies(zero, zero, jnp.zeros(len(devices))),
    )


# Numbers of a matrix up to which a product is written as a sum.
_FEW = 1024


def times(matrix: Array, vector: Array) -> Array:
    """Matrix or row times a vector; of few numbers as a sum, which XLA fuses with what is computed beside it."""
    product: Array = jnp.sum(matrix * vector, axis=-1) if matrix.size <= _FEW else matrix @ vector
    return product


def stage(
    plant: LoopPlant, devices: Devices, pulls: Array, parameters: list[Any], at: LoopState, a_g: Array
) -> Stage:
    """Equation of motion, with `pulls` = M^-1 e' of each damper, shape (n, n_devices)."""
    rows = rows_of(devices)
    x, x_rate = times(rows, at.q), times(rows, at.v)
    responses = [
        device.respond(parameters[i], at.states[i], x[i], x_rate[i]) for i, device in enumerate(devices)
    ]
    force = jnp.stack([damper_force for damper_force, _ in responses])
    acceleration = (
        -(times(plant.stiffness_per_mass, at.q) + times(plant.damping_per_mass, at.v) + times(pulls, force))
        - plant.influence * a_g
    )
    powers = Energies(
        entered=-times(times(plant.mass, plant.influence), at.v) * a_g,
        damping=times(at.v, times(plant.damping, at.v)),
        devices=x_rate * force,
    )
    return Stage(
        rate=LoopState(at.v, acceleration, tuple(rate for _, rate in responses), powers),
        force=force,
        elongation=x,
        elongation_rate=x_rate,
    )


def step(
    plant: LoopPlant,
    devices: Devices,
    pulls: Array,
    motion: LoopState,
    start: Array,
    command: Array,
    ground: StepGround,
    h: Array | float,
) -> tuple[LoopState, Array, Stage]:
    """State and coil currents (n_devices,) after the step under commands, and the stage at its start."""
    decay = jnp.stack([device.decay(0.5 * h) for device in devices])
    middle = (start - command) * decay + command
    end = (middle - command) * decay + command
    at_start, at_middle, at_end = (
        [device.parameters(u[index]) for index, device in enumerate(devices)] for u in (start, middle, end)
    )
    first = stage(plant, devices, pulls, at_start, motion, ground.start)
    second = stage(plant, devices, pulls, at_middle, along(motion, 0.5 * h, first.rate), ground.middle)
    third = stage(plant, devices, pulls, at_middle, along(motion, 0.5 * h, second.rate), ground.middle)
    fourth = stage(plant, devices, pulls, at_end, along(motion, h, third.rate), ground.end)
    after = jax.tree.map(
        lambda x, a, b, c, d: x + h / 6.0 * (a + 2.0 * (b + c) + d),
        motion,
        first.rate,
        second.rate,
        third.rate,
        fourth.rate,
    )
    return after, end, first


def along(motion: LoopState, time: Array | float, rate: LoopState) -> LoopState:
    """State after `time` at a constant rate."""
    later: LoopState = jax.tree.map(lambda x, slope: x + time * slope, motion, rate)
    return later


def signals_of(
    plant: LoopPlant, motion: LoopState, at: Stage, current: Array, a_g: Array
) -> dict[str, Array]:
    """Signals at the start of a step; the acceleration of floors is absolute."""
    inertia = times(plant.mass, at.rate.v + plant.influence * a_g)
    shears = times(plant.unit_drifts, inertia)
    return {
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


# Part of a step below which the interval of a record is finer, as FINER of `ground_motion.rs`.
_FINER = 0.999


def stage_values(acceleration: Floats, dt: Positive, step: Positive, n_steps: Count) -> Floats:
    """Ground acceleration at start, middle and end of each step, (n_steps, 3) [m/s^2].

    That of a record finer than the step is the line `M0 - b/2, M0, M0 + b/2` with `b = 6 M0 - 12 M1`, which has the
    mean M0 of the acceleration and the mean M1 of `(1 - s) a` over the step, s from 0 to 1: see `ground_motion.rs`.
    """
    if dt >= _FINER * step:
        halves = half_steps(acceleration, dt, step, n_steps)
        return np.stack([halves[:-1:2], halves[1::2], halves[2::2]], axis=1)
    samples, length = np.arange(acceleration.size), step / dt
    edges = length * np.arange(n_steps + 1)
    places = np.union1d(edges, samples[samples < edges[-1]])
    values = np.interp(places, samples, acceleration)
    number = np.searchsorted(edges, places[:-1], side="right") - 1
    # The ground is still after the last sample.
    share = np.diff(places) / length * (places[1:] <= samples[-1])
    left = [(edges[number + 1] - each) / length for each in (places[:-1], places[1:])]
    first, last = share * values[:-1], share * values[1:]
    mean = np.bincount(number, 0.5 * (first + last), n_steps)
    moment = first * (2.0 * left[0] + left[1]) + last * (left[0] + 2.0 * left[1])
    half = 3.0 * mean - np.bincount(number, moment, n_steps)
    return np.stack([mean - half, mean, mean + half], axis=1)


def half_steps(acceleration: Floats, dt: Positive, step: Positive, n_steps: Count) -> Floats:
    """Ground acceleration every half step, (2 n_steps + 1,) [m/s^2]: linear between samples, zero after the last."""
    if acceleration.ndim != 1 or not acceleration.size:
        raise SettingError(f"`acceleration` has shape {acceleration.shape}; give (n_time,)")
    # In units of samples, so that a step that divides the sampling step hits every sample exactly.
    places = np.arange(2 * n_steps + 1) * (0.5 * step / dt)
    places = np.where(np.abs(places - np.rint(places)) < 1e-9, np.rint(places), places)
    ground: Floats = np.interp(places, np.arange(acceleration.size), acceleration, right=0.0)
    return ground
