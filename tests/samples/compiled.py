"""Functions that JAX has compiled."""

from __future__ import annotations

import sys


def release_compiled() -> None:
    """Give back the memory of all compiled functions, where JAX has been loaded."""
    if (jax := sys.modules.get("jax")) is not None:
        jax.clear_caches()
