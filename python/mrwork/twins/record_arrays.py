"""A record as arrays of JAX: the splines of its motion, and its command."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from mrwork import _rust
from mrwork.twins.models import on_processor


class RecordArrays(NamedTuple):
    """Motion and command of a record, a pytree of operands.

    `splines` are the coefficients of displacement and velocity over each sample interval, (n_time - 1, 8); `facts` the
    step, the motion at the end and the largest velocity and acceleration at a reversal, (5,); `command` [A or V] has
    shape (n_time,), or (1,) where it is constant, not a number where the model follows none.
    """

    splines: Array
    facts: Array
    command: Array

    @classmethod
    @on_processor()
    def of(cls, history: _rust.LoadingHistory) -> RecordArrays:
        """The arrays of a history of the core; a constant command is kept as one value."""
        splines, facts = history.parts
        command = history.command
        if command is None:
            command = np.full(1, np.nan)
        elif np.ptp(command) == 0.0:
            command = command[:1]
        return cls(*(jnp.asarray(array) for array in (splines, facts, command)))

    @property
    def n_time(self) -> int:
        """Number of samples, one more than there are splines."""
        return int(self.splines.shape[-2]) + 1

    def padded(self, n_time: int) -> RecordArrays:
        """The record with intervals at rest up to a number of samples, and its last command held."""
        missing = n_time - self.n_time
        command = self.command if len(self.command) == 1 else jnp.pad(self.command, (0, missing), mode="edge")
        return self._replace(splines=jnp.pad(self.splines, ((0, missing), (0, 0))), command=command)

    def samples(self, n_time: Any, n_kept: int) -> Array:
        """Displacement and velocity at the samples, shape (n_kept, 2), of which `n_time` are not padding."""
        starts = jnp.concatenate([self.splines[:, np.array([0, 4])], self.facts[None, 1:3]])[:n_kept]
        return jnp.where(jnp.arange(n_kept)[:, None] == n_time - 1, self.facts[1:3], starts)


def motion_at(coefficients: Array, share: Any) -> tuple[Array, Array]:
    """Displacement and velocity at a share of an interval, whose coefficients have shape (8, ...)."""
    x0, x1, x2, x3, v0, v1, v2, v3 = coefficients
    return x0 + share * (x1 + share * (x2 + share * x3)), v0 + share * (v1 + share * (v2 + share * v3))
