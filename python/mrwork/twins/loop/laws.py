"""Control laws of the twin that are smooth in their numbers, for tuning by gradients.

A law is a `NamedTuple` of numbers, differentiable in each, with a method `command(measured)`. f is the force of a
device [N], s = [q; q'] the state.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import jax.numpy as jnp
from jax import Array

from mrwork.values import holds_arrays


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """Measurements available to a law at a control sample.

    Attributes
    ----------
    state
        s, shape (2n,).
    deformation, rate
        Elongation of each device [m] and its rate [m/s], shape (n_devices,).
    force
        Force of each device, shape (n_devices,) [N].
    force_at
        Forces for other coil currents, (n_devices,) to (n_devices,).
    largest
        Largest command of each device, shape (n_devices,).
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


class LyapunovDirect(NamedTuple):
    """`i = sat(-kappa sigma G)`, sigma = s'P B: the smooth form of the thesis' first controller.

    `weight` is P B, shape (2n, n_devices); G is the slope of the force in the current.
    """

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
