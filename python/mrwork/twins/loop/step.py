"""One step of the loop: the classical Runge-Kutta rule for building, dampers and energies, the driver exactly."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from mrwork.twins.loop.plant import LoopDevice, LoopPlant
from mrwork.twins.loop.reductions import Energies, Extent, Reductions

Devices = tuple[LoopDevice, ...]


class Motion(NamedTuple):
    """What a Runge-Kutta step moves on: coordinates, their rates, states of the dampers, energies."""

    q: Array
    v: Array
    states: tuple[Array, ...]
    energies: Energies


class Stage(NamedTuple):
    """At one point: derivative of the motion, forces and strokes of the dampers (n_devices,)."""

    rate: Motion
    force: Array
    stroke: Array


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
        tuple(jnp.zeros(device.spec.n_states) for device in devices),
        Energies(zero, zero, zero),
    )


def stage(
    plant: LoopPlant, devices: Devices, pulls: Array, parameters: list[Any], at: Motion, a_g: Array
) -> Stage:
    """Equation of motion, with `pulls` = M^-1 e' of each damper, shape (n, n_devices)."""
    responses = [
        device.respond(p, state, at.q, at.v)
        for device, p, state in zip(devices, parameters, at.states, strict=True)
    ]
    force = jnp.stack([found for found, _ in responses])
    rows = jnp.stack([device.row for device in devices])
    acceleration = (
        -(plant.stiffness_per_mass @ at.q + plant.damping_per_mass @ at.v + pulls @ force)
        - plant.influence * a_g
    )
    powers = Energies(
        entered=-(plant.mass @ plant.influence) @ at.v * a_g,
        damping=at.v @ (plant.damping @ at.v),
        devices=(rows @ at.v) @ force,
    )
    return Stage(
        rate=Motion(at.v, acceleration, tuple(rate for _, rate in responses), powers),
        force=force,
        stroke=rows @ at.q,
    )


def step(
    plant: LoopPlant,
    devices: Devices,
    pulls: Array,
    motion: Motion,
    received: Array,
    command: Array,
    ground: StepGround,
    h: Array | float,
) -> tuple[Motion, Array, Stage]:
    """Return motion and coil currents (n_devices,) after the step, and the stage at its start.

    `command` is that of each damper, shape (n_devices,), held over the step.
    """
    decay = jnp.stack([device.decay(0.5 * h) for device in devices])
    # Without a lag the coil follows at once.
    lagged = jnp.array([device.spec.current is not None and device.spec.current.lagged for device in devices])
    start = jnp.where(lagged, received, command)
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
    plant: LoopPlant, kept: Reductions, motion: Motion, at: Stage, command: Array, a_g: Array
) -> Reductions:
    """What is kept, with the start of one step more."""
    return Reductions(
        displacement=kept.displacement.seen(plant.floors @ motion.q),
        drift=kept.drift.seen(plant.storeys @ motion.q),
        acceleration=kept.acceleration.seen(plant.floors @ at.rate.v + a_g),
        force=kept.force.seen(at.force),
        stroke=kept.stroke.seen(at.stroke),
        command=kept.command + command,
        energies=motion.energies,
    )


def nothing_kept(plant: LoopPlant, n_devices: int, n_channels: int) -> Reductions:
    """Before the first step."""
    zero = jnp.float64(0.0)
    return Reductions(
        displacement=Extent.none(plant.floors.shape[0]),
        drift=Extent.none(plant.storeys.shape[0]),
        acceleration=Extent.none(plant.floors.shape[0]),
        force=Extent.none(n_devices),
        stroke=Extent.none(n_devices),
        command=jnp.zeros(n_channels),
        energies=Energies(zero, zero, zero),
    )
