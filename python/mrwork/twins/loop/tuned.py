"""Scores of smooth laws under ground motions with their derivatives in the numbers of the law, for tuning."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from mrwork.dampers.spec import DamperSpec
from mrwork.twins.loop.laws import Law, LyapunovDirect
from mrwork.twins.loop.plant import Devices, LoopDevice, LoopPlant
from mrwork.twins.loop.run import half_steps, run_loop

Floats = NDArray[np.float64]
Gains = Mapping[str, Array]


def _proportional_direct(gains: Gains) -> Law:
    return LyapunovDirect(kappa=gains["slope"], weight=gains["weight"].T)


SMOOTH: Mapping[str, Callable[[Gains], Law]] = {"proportional_direct": _proportional_direct}
"""Laws that are smooth in their numbers, by the name of the law in the core: the law of the twin from its gains."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinDamper:
    """A damper across a storey, as `mrwork.buildings.devices.Device`, and its parameters, shape (n_params,)."""

    spec: DamperSpec
    theta: Floats
    row: Floats
    count: float
    differential: bool


class TunedLoop:
    """The loop of a law of `SMOOTH` under several motions, in the twin.

    Parameters
    ----------
    dampers, believed
        The dampers, and those of the law's own model if it is another one.
    motions
        Sampling step [s] and acceleration [m/s^2] of each.
    step, steps_per_sample, delay
        Integration step [s], steps of a control sample, and steps from measurement to driver.
    weights
        Weight of each criterion in the score, by the name of the quantity of a run whose largest value it is.
    passive
        Values of these criteria at i = 0 under each motion, shape (n_motions, n_criteria).
    """

    def __init__(
        self,
        law: str,
        *,
        matrices: Mapping[str, Floats],
        dampers: Sequence[TwinDamper],
        believed: Sequence[TwinDamper] | None,
        motions: Sequence[tuple[float, Floats]],
        step: float,
        steps_per_sample: int,
        delay: int,
        weights: Mapping[str, float],
        passive: Floats,
    ) -> None:
        plant = LoopPlant.of(**matrices)
        devices, own = _devices(dampers), None if believed is None else _devices(believed)
        total = sum(weights.values())

        def score(gains: Gains, largest: Array, ground: Array, below: Array) -> Array:
            found = run_loop(
                plant,
                devices,
                SMOOTH[law](gains),
                ground,
                step_time=step,
                largest_command=largest,
                steps_per_sample=steps_per_sample,
                delay=delay,
                believed=own,
            )
            values = jnp.stack([found.worst(name) for name in weights])
            return jnp.sum(jnp.asarray(list(weights.values())) / total * values / below)

        self._rates = jax.jit(jax.value_and_grad(score))
        self._below = [jnp.asarray(each) for each in passive]
        sample = step * steps_per_sample
        self._grounds = []
        for dt, acceleration in motions:
            n_samples = int(np.ceil((len(acceleration) - 1) * dt / sample - 1e-9))
            n_steps = n_samples * steps_per_sample
            self._grounds.append(jnp.asarray(half_steps(acceleration, dt, step, n_steps)))

    def scores(
        self, gains: Mapping[str, Floats], largest_command: Floats
    ) -> tuple[Floats, list[dict[str, Floats]]]:
        """Score under each motion, shape (n_motions,), and its derivatives in each gain."""
        given = {name: jnp.asarray(value, dtype=jnp.float64) for name, value in gains.items()}
        largest = jnp.asarray(largest_command, dtype=jnp.float64)
        values, rates = [], []
        for ground, below in zip(self._grounds, self._below, strict=True):
            value, rate = self._rates(given, largest, ground, below)
            values.append(float(value))
            rates.append({name: np.asarray(each) for name, each in rate.items()})
        return np.array(values), rates


def _devices(dampers: Sequence[TwinDamper]) -> Devices:
    return tuple(
        LoopDevice(
            spec=each.spec,
            theta=jnp.asarray(each.theta),
            row=jnp.asarray(each.row),
            count=each.count,
            differential=each.differential,
        )
        for each in dampers
    )
