"""Functions that JAX has compiled."""

from __future__ import annotations

import sys

_counted = False
_compiled = 0


def _count(event: str, seconds: float, **_: object) -> None:
    global _compiled
    _compiled += event == "/jax/core/compile/backend_compile_duration"


def release_compiled() -> None:
    """Give back the memory of all functions that JAX has compiled since the last call: a search through all memory."""
    global _counted, _compiled
    if (jax := sys.modules.get("jax")) is None:
        return
    if not _counted:
        jax.monitoring.register_event_duration_secs_listener(_count)
    if _compiled or not _counted:
        jax.clear_caches()
    _counted, _compiled = True, 0
