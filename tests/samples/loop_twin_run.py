"""The whole loop in JAX, by the steps of `mrwork.twins.loop_stepping`: a reference for the loop of the core."""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from mrwork.errors import SettingError
from mrwork.twins.loop_stepping import (
    Devices,
    Extent,
    Law,
    LoopPlant,
    LoopResult,
    LoopState,
    Measurement,
    Reductions,
    StepGround,
    Travel,
    at_rest,
    pulls_of,
    rows_of,
    signals_of,
    stage,
    step,
)


def _no_samples(plant: LoopPlant, n_devices: int) -> Reductions:
    n_floors = plant.floors.shape[0]
    sizes = {
        "displacement": n_floors,
        "acceleration": n_floors,
        "drift": plant.storeys.shape[0],
        "base_shear": 1,
    }
    sizes |= dict.fromkeys(("storey_shear", "frame_shear", "overturning"), plant.storeys.shape[0])
    sizes |= dict.fromkeys(("force", "stroke", "rate", "current"), n_devices)
    return Reductions(
        extents={name: Extent.none(size) for name, size in sizes.items()},
        current_sum=jnp.zeros(n_devices),
        command=Travel.none(n_devices),
    )


class _RunCarry(NamedTuple):
    motion: LoopState
    received: Array
    # Commands of this control sample and of earlier ones that are still delayed, newest first.
    commands: Array
    kept: Reductions


@partial(jax.jit, static_argnames=("steps_per_sample", "delay"))
def run_loop(
    plant: LoopPlant,
    devices: Devices,
    law: Law,
    ground: Array,
    *,
    step_time: Array | float,
    largest_command: Array,
    steps_per_sample: int = 1,
    delay: int = 0,
    believed: Devices | None = None,
    counted: Array | None = None,
) -> LoopResult:
    """Run the loop from rest and accumulate its results; the coils start settled at the first command.

    `ground` has `half_steps` [m/s^2], `largest_command` (n_devices,); `delay` is in integration steps. Devices that are
    `believed`, without states, give the slope of the force in the current to laws. Peaks and sums are those of the
    first steps that are `counted`, energies those of all.
    """
    if counted is None:
        counted = jnp.float64((ground.shape[0] - 1) // 2)
    n_samples = _samples(ground, steps_per_sample, delay)
    pulls, rows = pulls_of(plant, devices), rows_of(devices)
    lagged = jnp.array([device.lagged for device in devices])
    # Age, in control samples, of the command that each step receives.
    ages = np.array([max(0, math.ceil((delay - j) / steps_per_sample)) for j in range(steps_per_sample)])

    def force(motion: LoopState, currents: Array) -> Array:
        parameters = [device.parameters(currents[index]) for index, device in enumerate(devices)]
        return stage(plant, devices, pulls, parameters, motion, jnp.float64(0.0)).force

    def curve(motion: LoopState, currents: Array) -> Array:
        if believed is None:
            return force(motion, currents)
        x, v = rows @ motion.q, rows @ motion.v
        forces = [
            device.respond(device.parameters(currents[i]), device.at_rest, x[i], v[i])[0]
            for i, device in enumerate(believed)
        ]
        return jnp.stack(forces)

    def integrate(carry: _RunCarry, inputs: tuple[Array, Array, StepGround]) -> tuple[_RunCarry, None]:
        age, counts, accelerations = inputs
        command = carry.commands[age]
        # Without a lag, the coil current equals the command.
        current = jnp.where(lagged, carry.received, command)
        after, received, start = step(
            plant, devices, pulls, carry.motion, current, command, accelerations, step_time
        )
        signals = signals_of(plant, carry.motion, start, current, accelerations.start)
        more = carry.kept._replace(
            extents={name: carry.kept.extents[name].with_sample(signal) for name, signal in signals.items()},
            current_sum=carry.kept.current_sum + current,
        )
        kept = jax.tree.map(lambda after, before: jnp.where(counts, after, before), more, carry.kept)
        return _RunCarry(after, received, carry.commands, kept), None

    def sample(carry: _RunCarry, inputs: tuple[Array, Array, StepGround]) -> tuple[_RunCarry, None]:
        first, counts, accelerations = inputs
        measured = Measurement(
            state=jnp.concatenate([carry.motion.q, carry.motion.v]),
            deformation=rows @ carry.motion.q,
            rate=rows @ carry.motion.v,
            force=force(carry.motion, carry.received),
            force_at=lambda currents: curve(carry.motion, currents),
            largest=largest_command,
        )
        command = jnp.clip(law.command(measured), 0.0, largest_command)
        commands = jnp.concatenate([command[None], carry.commands[:-1]])
        taken = carry.kept.command.with_sample(command, largest_command, first)
        taken = jax.tree.map(
            lambda after, before: jnp.where(counts[0], after, before), taken, carry.kept.command
        )
        carry = carry._replace(
            kept=carry.kept._replace(command=taken),
            commands=jnp.where(first, command, commands),
            received=jnp.where(first, command, carry.received),
        )
        last, _ = lax.scan(integrate, carry, (jnp.asarray(ages), counts, accelerations))
        return last, None

    start = _RunCarry(
        motion=at_rest(plant, devices),
        received=jnp.zeros(len(devices)),
        commands=jnp.zeros((1 + int(ages.max()), len(devices))),
        kept=_no_samples(plant, len(devices)),
    )
    at_steps = StepGround(ground[:-1:2], ground[1::2], ground[2::2])
    at_samples = (
        jnp.arange(n_samples) == 0,
        (jnp.arange(n_samples * steps_per_sample) < counted).reshape(n_samples, steps_per_sample),
        jax.tree.map(lambda a: a.reshape(n_samples, steps_per_sample), at_steps),
    )

    last, _ = lax.scan(sample, start, at_samples)
    q, v = last.motion.q, last.motion.v
    return LoopResult(
        reductions=last.kept,
        energies=last.motion.energies,
        kinetic=0.5 * v @ (plant.mass @ v),
        strain=0.5 * q @ (plant.stiffness @ q),
        drift=plant.storeys @ q,
        n_steps=counted,
        step_time=step_time,
    )


def _samples(ground: Array, steps_per_sample: int, delay: int) -> int:
    n_steps, odd = divmod(ground.shape[0] - 1, 2)
    if odd or n_steps < 1 or steps_per_sample < 1 or n_steps % steps_per_sample or delay < 0:
        raise SettingError(
            f"{ground.shape[0]} values of the ground's acceleration, {steps_per_sample} steps to a control sample and "
            f"a delay of {delay} do not make a run; give two values to a step and one more, whole control samples, "
            "and a delay of 0 or more"
        )
    return n_steps // steps_per_sample
