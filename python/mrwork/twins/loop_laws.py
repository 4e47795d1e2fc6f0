"""Control laws of the loop in JAX: a `NamedTuple` of numbers with a method `command`.

f is the force of a device [N], s = [q; q'] the state.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol

import jax.numpy as jnp
from jax import Array

from mrwork.base.values import array_dataclass

Gains = Mapping[str, Array]


@array_dataclass()
class Measurement:
    """Measurements for a law at a control sample: one entry per device, and the state s, shape (2n,).

    The elongation of a device [m], its rate [m/s], its force [N], the forces at other coil currents, and the commands
    of the sample where they are prescribed.
    """

    state: Array
    deformation: Array
    rate: Array
    force: Array
    force_at: Callable[[Array], Array]
    largest: Array
    prescribed: Array | None

    def slope(self) -> Array:
        """G of f(i) = F0 + G i + H i^2 through the forces at 0, half and the largest command, shape (n_devices,)."""
        none, middle, full = (self.force_at(share * self.largest) for share in (0.0, 0.5, 1.0))
        return (4.0 * middle - full - 3.0 * none) / self.largest


class Law(Protocol):
    """A control law as the loop calls it, once each sample."""

    def command(self, measured: Measurement) -> Array:
        """Command of each device, shape (n_devices,); the loop holds it between 0 and the largest."""


class _Prescribed(NamedTuple):
    """Commands of a table."""

    def command(self, measured: Measurement) -> Array:
        assert measured.prescribed is not None
        return measured.prescribed


class _Constant(NamedTuple):
    """A constant command, shape (n_devices,)."""

    constant: Array

    def command(self, measured: Measurement) -> Array:
        return self.constant


class _ClippedOptimal(NamedTuple):
    """`i = i_max H((f_c - f) f)`, f_c = -K s, and i_max |f_c| / f_max, at most i_max, where there is a `full_force`."""

    gain: Array
    full_force: Array | None = None

    def command(self, measured: Measurement) -> Array:
        wanted = -self.gain @ measured.state
        share = 1.0 if self.full_force is None else jnp.minimum(jnp.abs(wanted) / self.full_force, 1.0)
        return jnp.where((wanted - measured.force) * measured.force > 0.0, share * measured.largest, 0.0)


class _Lyapunov(NamedTuple):
    """`i = i_max H(-(s'P B) f)`; `weight` is P B, shape (2n, n_devices)."""

    weight: Array

    def command(self, measured: Measurement) -> Array:
        """The largest command if the damper reduces s'P s."""
        return jnp.where(-(measured.state @ self.weight) * measured.force > 0.0, measured.largest, 0.0)


class _ProportionalDirect(NamedTuple):
    """`i = sat(-kappa sigma G)`, sigma = s'P B, `weight` (2n, n_devices): the thesis' first controller, made smooth."""

    kappa: Array
    weight: Array

    def command(self, measured: Measurement) -> Array:
        """In proportion to the reduction of s'P s by the current."""
        return -self.kappa * (measured.state @ self.weight) * measured.slope()


class _SignalNetwork(NamedTuple):
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


LAWS: Mapping[str, Callable[[Gains], Law]] = {
    "passive": lambda gains: _Constant(gains["command"]),
    "clipped_optimal": lambda gains: _ClippedOptimal(gains["gain"]),
    "modified_clipped_optimal": lambda gains: _ClippedOptimal(gains["gain"], gains["full_force"]),
    "lyapunov": lambda gains: _Lyapunov(gains["weight"].T),
    "proportional_direct": lambda gains: _ProportionalDirect(gains["slope"], gains["weight"].T),
    "signal_network": lambda gains: _SignalNetwork(gains["gain"], gains["network"]),
    "": lambda _: _Prescribed(),
}
"""Laws by the name of the law in the core, from their gains; the empty name is for a table of commands."""
