"""Control laws of the twin: smooth laws, and bang-bang laws with a switch that can be softened.

A law is a `NamedTuple` of numbers, differentiable in each, with a method `command(measured)`. f is the force of a
device [N], s = [q; q'] the state. `width` = 0 gives the switch of the paper, whose derivative is zero.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import jax
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


def switch(x: Array, width: Array | float) -> Array:
    """H(x), or 1 / (1 + exp(-x / width)) where `width` is positive."""
    soft = jnp.asarray(width) > 0.0
    smooth = jax.nn.sigmoid(x / jnp.where(soft, width, 1.0))
    return jnp.where(soft, smooth, jnp.where(x > 0.0, 1.0, 0.0))


class Passive(NamedTuple):
    """A constant command, shape (n_devices,)."""

    constant: Array

    def command(self, measured: Measurement) -> Array:
        """The constant command."""
        return self.constant


class ClippedOptimal(NamedTuple):
    """`V_max H((f_c - f) f)`, f_c = -K s (Dyke et al. 1996), softened over `width` [N]: (f_c - f) f / width^2.

    `gain` is K, shape (n_devices, 2n).
    """

    gain: Array
    width: Array | float = 0.0

    def command(self, measured: Measurement) -> Array:
        """The largest command or zero, or a value between if softened."""
        wanted = -self.gain @ measured.state
        return measured.largest * switch((wanted - measured.force) * measured.force, jnp.square(self.width))


class ModifiedClippedOptimal(NamedTuple):
    """`V_c H((f_c - f) f)`, V_c = V_max |f_c| / f_max, at most V_max (Yoshida and Dyke 2004), softened in the same way.

    `largest_force` is f_max [N], shape (n_devices,).
    """

    gain: Array
    largest_force: Array
    width: Array | float = 0.0

    def command(self, measured: Measurement) -> Array:
        """In proportion to the desired force."""
        wanted = -self.gain @ measured.state
        share = jnp.minimum(jnp.abs(wanted) / self.largest_force, 1.0)
        on = switch((wanted - measured.force) * measured.force, jnp.square(self.width))
        return measured.largest * share * on


class LyapunovBangBang(NamedTuple):
    """`V_max H(-(s'P B) f)` (Jansen and Dyke 2000), softened over `width` [that of s'P B f].

    `weight` is P B, shape (2n, n_devices).
    """

    weight: Array
    width: Array | float = 0.0

    def command(self, measured: Measurement) -> Array:
        """On if the damper reduces s'P s."""
        return measured.largest * switch(-(measured.state @ self.weight) * measured.force, self.width)


class LyapunovDirect(NamedTuple):
    """`i = sat(-kappa sigma G)`, sigma = s'P B: the smooth form of the thesis' first controller.

    `weight` is P B, shape (2n, n_devices); G is the slope of the force in the current.
    """

    kappa: Array
    weight: Array

    def command(self, measured: Measurement) -> Array:
        """In proportion to the reduction of s'P s by the current."""
        return -self.kappa * (measured.state @ self.weight) * measured.slope()


class LqrDirect(NamedTuple):
    """`i = sat(-R^-1 G(s) B'P s)`, the thesis' second controller; `gain` is R^-1 B'P, shape (n_devices, 2n)."""

    gain: Array

    def command(self, measured: Measurement) -> Array:
        """The desired force times the slope of the force in the current."""
        return -measured.slope() * (self.gain @ measured.state)


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
