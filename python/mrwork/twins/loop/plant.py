"""Plant: a building with dampers across its storeys, M q'' + C q' + K q = -sum_d e_d' F_d - M r a_g."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array
from numpy.typing import ArrayLike

from mrwork.dampers.spec import DamperSpec
from mrwork.twins.models import parameters_at, twin_of
from mrwork.values import holds_arrays


class LoopPlant(NamedTuple):
    """Matrices of a building, as in `mrwork.buildings.Building`, with the products that a step needs."""

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
        """Return the plant of M [kg], C [N s/m], K [N/m], (n, n), and rows of floors and storeys, as in `Building`."""
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
    meta_fields=["spec", "differential"],
)
@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class LoopDevice:
    """Dampers across a storey with one command: `F = count f(x, v)`, or `count (f(x, v) - f(-x, -v))` if differential.

    The elongation is row @ q, shape (n,): a row of `storeys`.
    """

    spec: DamperSpec
    theta: Array
    row: Array
    count: Array | float = 1.0
    differential: bool = False

    @property
    def lagged(self) -> bool:
        """Whether the coil follows the command with a lag."""
        return self.spec.current is not None and self.spec.current.lagged

    @property
    def at_rest(self) -> Array:
        """States of the dampers at rest, one row per direction, shape (1 or 2, n_states)."""
        return jnp.zeros((2 if self.differential else 1, self.spec.n_states))

    def parameters(self, received: Array) -> Any:
        """Parameters of the plain model for a command received by the coil."""
        return parameters_at(self.spec, self.theta, received)

    def respond(self, p: Any, states: Array, x: Array, v: Array) -> tuple[Array, Array]:
        """Force F [N] for an elongation and its rate, and the rates of the damper states, in the shape of `at_rest`."""
        twin = twin_of(self.spec)
        force = self.count * twin.force(p, states[0], x, v)
        rates = [twin.rate(p, states[0], x, v)]
        if self.differential:
            force = force - self.count * twin.force(p, states[1], -x, -v)
            rates.append(twin.rate(p, states[1], -x, -v))
        return force, jnp.stack(rates)

    def decay(self, time: Array | float) -> Array:
        """Fraction of the difference between command and coil current left after a time [s]; zero without a lag."""
        if not self.lagged:
            return jnp.zeros(())
        left: Array = jnp.exp(-self.theta[-1] * time)
        return left


Devices = tuple[LoopDevice, ...]


def rows_of(devices: Devices) -> Array:
    """Rows of all devices, shape (n_devices, n)."""
    return jnp.stack([device.row for device in devices])


def pulls_of(plant: LoopPlant, devices: Devices) -> Array:
    """M^-1 e' of all devices, shape (n, n_devices)."""
    pulls: Array = jnp.linalg.solve(plant.mass, rows_of(devices).T)
    return pulls
