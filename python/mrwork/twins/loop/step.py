"""One step of the closed loop, and the quantities that are accumulated over the steps.

Building, dampers and energies advance by the classical Runge-Kutta rule, the driver by its exact solution.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from mrwork.twins.loop.plant import Devices, LoopPlant, rows_of


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


class Reductions(NamedTuple):
    """Accumulated signals of floors (displacement, absolute acceleration), storeys, base and devices."""

    displacement: Extent
    acceleration: Extent
    drift: Extent
    base_shear: Extent
    force: Extent
    stroke: Extent
    rate: Extent
    current: Extent
    current_sum: Array


class LoopResult(NamedTuple):
    """Result of a run: accumulated signals, energies [J] at the end, number of steps."""

    reductions: Reductions
    energies: Energies
    kinetic: Array
    strain: Array
    n_steps: Array

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

        def both(name: str, extent: Extent) -> dict[str, Array]:
            return {f"peak_{name}": extent.peak, f"rms_{name}": jnp.sqrt(extent.squares / self.n_steps)}

        return (
            both("displacement", kept.displacement)
            | both("acceleration", kept.acceleration)
            | both("drift", kept.drift)
            | both("base_shear", kept.base_shear)
            | both("force", kept.force)
            | {"peak_stroke": kept.stroke.peak, "peak_rate": kept.rate.peak}
            | both("current", kept.current)
            | {
                "mean_current": kept.current_sum / self.n_steps,
                "device_energy": self.energies.devices,
                # The twin is that of buildings without passive elements.
                "peak_element_force": jnp.zeros(0),
                "peak_element_stroke": jnp.zeros(0),
                "element_energy": jnp.zeros(0),
                "input_energy": self.energies.entered[None],
                "kinetic_energy": self.kinetic[None],
                "strain_energy": self.strain[None],
                "damping_energy": self.energies.damping[None],
                "energy_error": self.energy_error[None],
            }
        )

    def worst(self, name: str) -> Array:
        """Largest value of a quantity of `summary` over floors, storeys or devices."""
        return self.summary()[name].max()


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


def stage(
    plant: LoopPlant, devices: Devices, pulls: Array, parameters: list[Any], at: LoopState, a_g: Array
) -> Stage:
    """Equation of motion, with `pulls` = M^-1 e' of each damper, shape (n, n_devices)."""
    rows = rows_of(devices)
    x, x_rate = rows @ at.q, rows @ at.v
    responses = [
        device.respond(parameters[i], at.states[i], x[i], x_rate[i]) for i, device in enumerate(devices)
    ]
    force = jnp.stack([found for found, _ in responses])
    acceleration = (
        -(plant.stiffness_per_mass @ at.q + plant.damping_per_mass @ at.v + pulls @ force)
        - plant.influence * a_g
    )
    powers = Energies(
        entered=-(plant.mass @ plant.influence) @ at.v * a_g,
        damping=at.v @ (plant.damping @ at.v),
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
    """Return state and coil currents (n_devices,) after the step, and the stage at its start.

    `start` are the coil currents at the start, `command` the commands over the step, shape (n_devices,).
    """
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


def reduced(
    plant: LoopPlant, kept: Reductions, motion: LoopState, at: Stage, current: Array, a_g: Array
) -> Reductions:
    """Accumulated signals with the start of one more step."""
    momentum = plant.mass @ plant.influence
    shear = momentum @ at.rate.v + (momentum @ plant.influence) * a_g
    return Reductions(
        displacement=kept.displacement.with_sample(plant.floors @ motion.q),
        acceleration=kept.acceleration.with_sample(plant.floors @ at.rate.v + a_g),
        drift=kept.drift.with_sample(plant.storeys @ motion.q),
        base_shear=kept.base_shear.with_sample(shear[None]),
        force=kept.force.with_sample(at.force),
        stroke=kept.stroke.with_sample(at.elongation),
        rate=kept.rate.with_sample(at.elongation_rate),
        current=kept.current.with_sample(current),
        current_sum=kept.current_sum + current,
    )


def no_samples(plant: LoopPlant, n_devices: int) -> Reductions:
    """Accumulated signals before the first step."""
    n_floors, n_storeys = plant.floors.shape[0], plant.storeys.shape[0]
    return Reductions(
        displacement=Extent.none(n_floors),
        acceleration=Extent.none(n_floors),
        drift=Extent.none(n_storeys),
        base_shear=Extent.none(1),
        force=Extent.none(n_devices),
        stroke=Extent.none(n_devices),
        rate=Extent.none(n_devices),
        current=Extent.none(n_devices),
        current_sum=jnp.zeros(n_devices),
    )
