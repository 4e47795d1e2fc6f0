"""A record as arrays of JAX: the splines of its motion, and its command."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from mrwork import _rust
from mrwork.twins.model_twins import on_processor


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

    @property
    def samples(self) -> Array:
        """Displacement and velocity at the samples, shape (n_time, 2)."""
        return jnp.concatenate([self.splines[:, np.array([0, 4])], self.facts[None, 1:3]])


def motion_at(coefficients: Array, share: Any) -> tuple[Array, Array]:
    """Displacement and velocity at a share of an interval, whose coefficients have shape (8, ...)."""
    x0, x1, x2, x3, v0, v1, v2, v3 = coefficients
    return x0 + share * (x1 + share * (x2 + share * x3)), v0 + share * (v1 + share * (v2 + share * v3))
