"""What the modules of the twins share: double precision, the parameters by name, a power with finite derivatives."""

from __future__ import annotations

from typing import Protocol

import jax
import jax.numpy as jnp
from jax import Array

# The Rust core computes in double precision, and the twins must agree with it.
jax.config.update("jax_enable_x64", True)  # type: ignore[no-untyped-call] # jax leaves it unannotated


class Parameters(Protocol):
    """Parameters of a model by their names in its spec."""

    def __getattr__(self, name: str) -> Array: ...


def power(base: Array, exponent: Array) -> Array:
    """`base ** exponent` for base >= 0 and exponent >= 1, with finite derivatives at zero."""
    positive = base > 0.0
    return jnp.where(positive, jnp.where(positive, base, 1.0) ** exponent, 0.0)
