"""What is controlled: a building with dampers across its storeys, M q'' + C q' + K q = -sum_d e_d' F_d - M r a_g."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array
from numpy.typing import ArrayLike

from mrwork.spec import DamperSpec
from mrwork.twins._base import parameters_at, twin_of


class LoopPlant(NamedTuple):
    """Matrices of a building, as `mrwork.buildings.Building` has them, and what a step multiplies by."""

    mass: Array
    damping: Array
    stiffness: Array
    influence: Array
    floors: Array
    storeys: Array
    stiffness_per_mass: Array
    damping_per_mass: Array

    @classmethod
    def of(
        cls,
        *,
        mass: ArrayLike,
        damping: ArrayLike,
        stiffness: ArrayLike,
        influence: ArrayLike,
        floors: ArrayLike,
        storeys: ArrayLike,
    ) -> LoopPlant:
        """Return the plant of M [kg], C [N s/m], K [N/m], shape (n, n), and its rows.

        Parameters
        ----------
        influence
            r, how the coordinates follow the ground, shape (n,).
        floors, storeys
            Displacements of the floors and drifts of the storeys from the coordinates, shape (n_floors, n) and
            (n_storeys, n).
        """
        m = jnp.asarray(mass, dtype=jnp.float64)
        c = jnp.asarray(damping, dtype=jnp.float64)
        k = jnp.asarray(stiffness, dtype=jnp.float64)
        return cls(
            mass=m,
            damping=c,
            stiffness=k,
            influence=jnp.asarray(influence, dtype=jnp.float64),
            floors=jnp.asarray(floors, dtype=jnp.float64),
            storeys=jnp.asarray(storeys, dtype=jnp.float64),
            stiffness_per_mass=jnp.linalg.solve(m, k),
            damping_per_mass=jnp.linalg.solve(m, c),
        )


@partial(
    jax.tree_util.register_dataclass,
    data_fields=["theta", "row", "count"],
    meta_fields=["spec", "opposed", "channel"],
)
@dataclass(frozen=True, slots=True, kw_only=True)
class LoopDevice:
    """A damper of the building: `F = count f(x, v)`, mounted the other way round `F = -count f(-x, -v)`.

    Attributes
    ----------
    spec
        Model, with current laws if it follows a command.
    theta
        Parameters in spec order, shape (n_params,).
    row
        e, its deformation from the coordinates, shape (n,): a row of `storeys`.
    count
        How many such dampers side by side.
    channel
        Which command it gets; dampers on one channel lie across one storey, and count as one for the control law.
    """

    spec: DamperSpec
    theta: Array
    row: Array
    count: Array | float = 1.0
    opposed: bool = False
    channel: int = 0

    def parameters(self, received: Array) -> Any:
        """Parameters of the plain model where the coil gets this command."""
        return parameters_at(self.spec, self.theta, received)

    def respond(self, p: Any, state: Array, q: Array, v: Array) -> tuple[Array, Array]:
        """Force F [N] at coordinates and rates, shape (n,), and the rate of the damper's own state, (n_states,)."""
        twin = twin_of(self.spec)
        side = -1.0 if self.opposed else 1.0
        x, x_rate = side * (self.row @ q), side * (self.row @ v)
        return side * self.count * twin.force(p, state, x, x_rate), twin.rate(p, state, x, x_rate)

    def decay(self, time: Array | float) -> Array:
        """What is left of the difference between command and coil after a time [s]; zero without a lag."""
        if self.spec.current is None or not self.spec.current.lagged:
            return jnp.zeros(())
        left: Array = jnp.exp(-self.theta[-1] * time)
        return left


def n_channels(devices: tuple[LoopDevice, ...]) -> int:
    """How many commands the dampers take."""
    return 1 + max(device.channel for device in devices)


def state_matrices(plant: LoopPlant, devices: tuple[LoopDevice, ...]) -> tuple[Array, Array]:
    """A and B of `s' = A s + B f`, with s = [q; q'] and f the force of each channel; shape (2n, 2n), (2n, n_channels).

    The dampers resist, so that B is [0; -M^-1 e'].
    """
    n = plant.mass.shape[0]
    zero, one = jnp.zeros((n, n)), jnp.eye(n)
    state = jnp.block([[zero, one], [-plant.stiffness_per_mass, -plant.damping_per_mass]])
    rows = {device.channel: device.row for device in devices}
    pulls = jnp.stack([jnp.linalg.solve(plant.mass, rows[c]) for c in range(n_channels(devices))], axis=1)
    return state, jnp.concatenate([jnp.zeros_like(pulls), -pulls])
