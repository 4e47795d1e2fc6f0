"""Seconds for which JAX has compiled in this process; `twins` lets JAX report them, where it is loaded."""

from __future__ import annotations

_COMPILED = "/jax/core/compile/backend_compile_duration"


class CompileTime:
    """Sum of the times that JAX reports as compilation [s]."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def count(self, event: str, duration_secs: float, **_: str | int) -> None:
        """Count an event of JAX, where it is a compilation."""
        if event == _COMPILED:
            self.seconds += duration_secs


COMPILE_TIME = CompileTime()
"""Of this process."""
