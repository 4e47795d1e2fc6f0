"""Control laws of the loop in JAX: the command of each device, (n_devices,), of the gains and what is measured.

f is the force of a device [N], s = [q; q'] the state. The loop holds commands between 0 and the largest.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import jax.numpy as jnp
from jax import Array

from mrwork.base.values import array_dataclass

Gains = Mapping[str, Array]


@array_dataclass()
class Measurement:
    """Measurements for a law at a control sample: one entry per device, and the state s, shape (2n,).

    The elongation of a device [m], its rate [m/s], its force [N], the forces at other coil currents, and the commands
    of the sample where they are prescribed. Absolute accelerations of the floors [m/s^2], (n_floors,), drifts of the
    storeys [m], (n_storeys,), acceleration [m/s^2] and velocity [m/s] of the ground, and the time [s].
    """

    state: Array
    deformation: Array
    rate: Array
    force: Array
    force_at: Callable[[Array], Array]
    largest: Array
    prescribed: Array | None
    acceleration: Array
    drift: Array
    ground_acceleration: Array
    ground_velocity: Array
    time: Array

    def slope(self) -> Array:
        """G of f(i) = F0 + G i + H i^2 through the forces at 0, half and the largest command, shape (n_devices,)."""
        none, middle, full = (self.force_at(share * self.largest) for share in (0.0, 0.5, 1.0))
        return (4.0 * middle - full - 3.0 * none) / self.largest


def _prescribed(gains: Gains, measured: Measurement) -> Array:
    assert measured.prescribed is not None
    return measured.prescribed


def _clipped_optimal(gains: Gains, measured: Measurement) -> Array:
    """`i = i_max H((f_c - f) f)`, f_c = -K s, and i_max |f_c| / f_max, at most i_max, where there is a `full_force`."""
    wanted = -gains["gain"] @ measured.state
    share: Array | float = 1.0
    if "full_force" in gains:
        share = jnp.minimum(jnp.abs(wanted) / gains["full_force"], 1.0)
    return jnp.where((wanted - measured.force) * measured.force > 0.0, share * measured.largest, 0.0)


def _lyapunov(gains: Gains, measured: Measurement) -> Array:
    """`i = i_max H(-(s'P B) f)`; the `weight` is (P B)', shape (n_devices, 2n)."""
    return jnp.where(-(measured.state @ gains["weight"].T) * measured.force > 0.0, measured.largest, 0.0)


def _proportional_direct(gains: Gains, measured: Measurement) -> Array:
    """`i = sat(-kappa s'P B G)`, `slope` is kappa: the thesis' first controller, made smooth."""
    return -gains["slope"] * (measured.state @ gains["weight"].T) * measured.slope()


def _signal_network(gains: Gains, measured: Measurement) -> Array:
    """`i = i_max (1 + tanh(b + sum_k v_k (tanh(b_k + w_k'c) + tanh(b_k - w_k'c)))) / 2`, c = (d, d', f, f_c).

    f_c is -K s; `gain` is K, shape (n_devices, 2n); `network` has a row for each device: b_k, w_k and v_k of each
    unit, last b.
    """
    network, wanted = gains["network"], -gains["gain"] @ measured.state
    signals = jnp.stack([measured.deformation, measured.rate, measured.force, wanted], axis=1)
    units = network[:, :-1].reshape(len(network), -1, signals.shape[1] + 2)
    bias, weights, output = units[..., 0], units[..., 1:-1], units[..., -1]
    inner = jnp.einsum("dks,ds->dk", weights, signals)
    even = jnp.tanh(bias + inner) + jnp.tanh(bias - inner)
    return 0.5 * measured.largest * (1.0 + jnp.tanh(network[:, -1] + jnp.sum(output * even, axis=1)))


LAWS: Mapping[str, Callable[[Gains, Measurement], Array]] = {
    "passive": lambda gains, _: gains["command"],
    "clipped_optimal": _clipped_optimal,
    "modified_clipped_optimal": _clipped_optimal,
    "lyapunov": _lyapunov,
    "proportional_direct": _proportional_direct,
    "signal_network": _signal_network,
    "": _prescribed,
}
"""Laws by the name of the law in the core; the empty name is for a table of commands."""
