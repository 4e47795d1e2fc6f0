"""One step of the loop: the classical Runge-Kutta rule for building, dampers and energies, the driver exactly."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from mrwork.twins.loop.plant import Devices, LoopPlant, rows_of
from mrwork.twins.loop.reductions import Energies, Extent, Reductions


class Motion(NamedTuple):
    """What a Runge-Kutta step moves on: coordinates, their rates, states of the dampers, energies."""

    q: Array
    v: Array
    states: tuple[Array, ...]
    energies: Energies


class Stage(NamedTuple):
    """At one point: derivative of the motion; forces, elongations and their rates, of the devices (n_devices,)."""

    rate: Motion
    force: Array
    elongation: Array
    elongation_rate: Array


class StepGround(NamedTuple):
    """Acceleration of the ground at start, middle and end of a step [m/s^2]."""

    start: Array
    middle: Array
    end: Array


def at_rest(plant: LoopPlant, devices: Devices) -> Motion:
    """Nothing moves, nothing has entered."""
    n = plant.mass.shape[0]
    zero = jnp.float64(0.0)
    return Motion(
        jnp.zeros(n),
        jnp.zeros(n),
        tuple(device.at_rest for device in devices),
        Energies(zero, zero, jnp.zeros(len(devices))),
    )


def stage(
    plant: LoopPlant, devices: Devices, pulls: Array, parameters: list[Any], at: Motion, a_g: Array
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
        rate=Motion(at.v, acceleration, tuple(rate for _, rate in responses), powers),
        force=force,
        elongation=x,
        elongation_rate=x_rate,
    )


def step(
    plant: LoopPlant,
    devices: Devices,
    pulls: Array,
    motion: Motion,
    start: Array,
    command: Array,
    ground: StepGround,
    h: Array | float,
) -> tuple[Motion, Array, Stage]:
    """Return motion and coil currents (n_devices,) after the step, and the stage at its start.

    `start` is what the coils have then, `command` what they are told over the step, shape (n_devices,).
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


def along(motion: Motion, time: Array | float, rate: Motion) -> Motion:
    """The motion a time later at this rate."""
    later: Motion = jax.tree.map(lambda x, slope: x + time * slope, motion, rate)
    return later


def reduced(
    plant: LoopPlant, kept: Reductions, motion: Motion, at: Stage, current: Array, a_g: Array
) -> Reductions:
    """What is kept, with the start of one step more."""
    momentum = plant.mass @ plant.influence
    shear = momentum @ at.rate.v + (momentum @ plant.influence) * a_g
    return Reductions(
        displacement=kept.displacement.seen(plant.floors @ motion.q),
        acceleration=kept.acceleration.seen(plant.floors @ at.rate.v + a_g),
        drift=kept.drift.seen(plant.storeys @ motion.q),
        base_shear=kept.base_shear.seen(shear[None]),
        force=kept.force.seen(at.force),
        stroke=kept.stroke.seen(at.elongation),
        rate=kept.rate.seen(at.elongation_rate),
        current=kept.current.seen(current),
        current_sum=kept.current_sum + current,
    )


def nothing_kept(plant: LoopPlant, n_devices: int) -> Reductions:
    """Before the first step."""
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
