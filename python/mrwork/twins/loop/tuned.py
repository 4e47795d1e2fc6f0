"""Tuning by gradients: laws that are smooth in their numbers, and their scores under ground motions with derivatives.

A law is a `NamedTuple` of numbers, differentiable in each, with a method `command(measured)`. f is the force of a
device [N], s = [q; q'] the state.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from mrwork.dampers.spec import DamperSpec
from mrwork.twins.loop.run import Devices, Law, LoopDevice, LoopPlant, Measurement, half_steps, run_loop
from mrwork.twins.models import begin
from mrwork.values import array_dataclass

Floats = NDArray[np.float64]
_SIDE_BY_SIDE = 8
Gains = Mapping[str, Array]


class LyapunovDirect(NamedTuple):
    """`i = sat(-kappa sigma G)`, sigma = s'P B, `weight` (2n, n_devices): the thesis' first controller, made smooth."""

    kappa: Array
    weight: Array

    def command(self, measured: Measurement) -> Array:
        """In proportion to the reduction of s'P s by the current."""
        return -self.kappa * (measured.state @ self.weight) * measured.slope()


class SignalNetwork(NamedTuple):
    """`i = i_max (1 + tanh(b + sum_k v_k (tanh(b_k + w_k'c) + tanh(b_k - w_k'c)))) / 2`, c = (d, d', f, f_c).

    f_c is -K s; `gain` is K, shape (n_devices, 2n); `network` has a row for each device: b_k, w_k and v_k of each
    unit, last b.
    """

    gain: Array
    network: Array

    def command(self, measured: Measurement) -> Array:
        """A share of the largest command."""
        wanted = -self.gain @ measured.state
        signals = jnp.stack([measured.deformation, measured.rate, measured.force, wanted], axis=1)
        n_signals = signals.shape[1]
        units = self.network[:, :-1].reshape(len(self.network), -1, n_signals + 2)
        bias, weights, output = units[..., 0], units[..., 1:-1], units[..., -1]
        inner = jnp.einsum("dks,ds->dk", weights, signals)
        even = jnp.tanh(bias + inner) + jnp.tanh(bias - inner)
        return 0.5 * measured.largest * (1.0 + jnp.tanh(self.network[:, -1] + jnp.sum(output * even, axis=1)))


SMOOTH: Mapping[str, Callable[[Gains], Law]] = {
    "proportional_direct": lambda gains: LyapunovDirect(kappa=gains["slope"], weight=gains["weight"].T),
    "signal_network": lambda gains: SignalNetwork(gain=gains["gain"], network=gains["network"]),
}
"""Laws that are smooth in their numbers, by the name of the law in the core: the law of the twin from its gains."""


@array_dataclass()
class TwinDamper:
    """A damper across a storey, as `mrwork.buildings.matrices.Device`, and its parameters, shape (n_params,)."""

    spec: DamperSpec
    theta: Floats
    row: Floats
    count: float
    differential: bool


class TunedLoop:
    """The loop of a law of `SMOOTH` under motions, (step [s], accelerations); `believed` are the law's dampers.

    `weights`: of each criterion in the score, by the name of the quantity of a run whose largest value it is.
    `baseline`: values that these criteria are divided by under each motion, shape (n_motions, n_criteria). `delay` is
    in steps.
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
        baseline: Floats,
    ) -> None:
        begin()
        plant = LoopPlant.of(**matrices)
        devices, own = _devices(dampers), None if believed is None else _devices(believed)
        total = sum(weights.values())

        def score(gains: Gains, largest: Array, ground: Array, counted: Array, below: Array) -> Array:
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
                counted=counted,
            )
            values = jnp.stack([found.worst(name) for name in weights])
            return jnp.sum(jnp.asarray(list(weights.values())) / total * values / below)

        self._rates = jax.jit(jax.vmap(jax.value_and_grad(score), in_axes=(None, None, 0, 0, 0)))
        sample = step * steps_per_sample
        lengths = [math.ceil((len(acceleration) - 1) * dt / sample - 1e-9) for dt, acceleration in motions]
        order = np.argsort(lengths, kind="stable")
        self._groups = []
        # Motions of about the same length run side by side, the shorter ones continued by free vibrations.
        for start in range(0, len(order), _SIDE_BY_SIDE):
            members = order[start : start + _SIDE_BY_SIDE]
            n_steps = lengths[members[-1]] * steps_per_sample
            grounds = [half_steps(motions[each][1], motions[each][0], step, n_steps) for each in members]
            counted = [float(lengths[each] * steps_per_sample) for each in members]
            self._groups.append(
                (members, jnp.array(np.stack(grounds)), jnp.array(counted), jnp.array(baseline[members]))
            )

    def scores(
        self, gains: Mapping[str, Floats], largest_command: Floats
    ) -> tuple[Floats, list[dict[str, Floats]]]:
        """Score under each motion, shape (n_motions,), and its derivatives in each gain."""
        given = {name: jnp.asarray(value, dtype=jnp.float64) for name, value in gains.items()}
        largest = jnp.asarray(largest_command, dtype=jnp.float64)
        scores = np.empty(sum(len(members) for members, *_ in self._groups))
        rates: list[dict[str, Floats]] = [{}] * len(scores)
        for members, ground, counted, below in self._groups:
            values, rate = self._rates(given, largest, ground, counted, below)
            scores[members] = np.asarray(values)
            for place, member in enumerate(members):
                rates[member] = {name: np.asarray(each[place]) for name, each in rate.items()}
        return scores, rates


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
