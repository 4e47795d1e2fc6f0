"""Functions that JAX has compiled."""

import sys
from types import ModuleType
from typing import Any

_counted = False
_compiled = 0


def _count(event: str, seconds: float, **_: object) -> None:
    global _compiled
    _compiled += event == "/jax/core/compile/backend_compile_duration"


def release_compiled() -> None:
    """Give back the memory of all functions that JAX has compiled since the last call: a search through all memory."""
    global _counted, _compiled
    jax: Any = sys.modules.get("jax")
    # A library may have put a stub there that loads it when it is first used.
    if type(jax) is not ModuleType:
        return
    if not _counted:
        jax.monitoring.register_event_duration_secs_listener(_count)
    if _compiled or not _counted:
        jax.clear_caches()
    _counted, _compiled = True, 0
