"""Where compiled twins are kept, so that the next process need not compile them again."""

from __future__ import annotations

import os
import platform
from functools import cache
from pathlib import Path

import jax

# Set to "off", nothing is kept.
SWITCH = "MRWORK_COMPILATION_CACHE"
# What compiles faster is not worth a file [s].
_WORTH_KEEPING = 0.1


@cache
def keep_compiled() -> None:
    """Let JAX keep what it compiles from now on in the user's cache folder, $XDG_CACHE_HOME or ~/.cache.

    A folder that JAX was given already stays, also by JAX_COMPILATION_CACHE_DIR; the switch does not concern it. Where
    the folder cannot be written, nothing is kept.
    """
    if jax.config.values["jax_compilation_cache_dir"] is not None:
        return
    if os.environ.get(SWITCH) == "off":
        return
    folder = _folder()
    if folder is None:
        return
    jax.config.update("jax_compilation_cache_dir", str(folder))  # type: ignore[no-untyped-call] # as in _base
    if "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS" not in os.environ:
        jax.config.update("jax_persistent_cache_min_compile_time_secs", _WORTH_KEEPING)  # type: ignore[no-untyped-call] # as above


def _folder() -> Path | None:
    try:
        above = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        # Machines that share a home have different processors, and what was compiled for one need not run on another.
        folder = above / "mrwork" / "twins" / (platform.node() or "here")
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):  # nowhere to write, or no home
        return None
    return folder if os.access(folder, os.W_OK) else None
