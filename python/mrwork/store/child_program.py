"""Program of the child process of `child_reader`; it stands alone because it imports nothing of mrwork.

The file comes through stdin; a function of `child_formats` writes to stdout what is in it.
"""

from __future__ import annotations

import importlib
import math
import runpy
import sys
import time

try:
    import resource
except ImportError:
    # Windows; the parent limits the time there.
    resource = None  # type: ignore[assignment]  # on systems without it

NO_MEMORY = 3
"""Exit status where the memory that this process was started with is too little."""


def main(program: str, form: str, library: str, seconds: float, memory: int) -> None:
    """Read the file within limits on the time of the processor [s] and on the memory beyond that of the imports [B]."""
    own = math.inf
    try:
        data = sys.stdin.buffer.read()
        importlib.import_module(library)
        answer = runpy.run_path(program)[form]
        own = _limit(seconds, memory)
        answer(data, sys.stdout.buffer)
    except (ImportError, MemoryError) as error:
        sys.exit(NO_MEMORY if _memory_before < own else _reason(error))
    except Exception as error:  # the libraries raise whatever a damaged file leads them to
        sys.exit(_reason(error))


def _reason(error: Exception) -> str:
    try:
        reason = str(error).partition("\n")[0] or type(error).__name__
    except Exception:  # a text that cannot be made
        reason = type(error).__name__
    return reason.encode("ascii", "replace").decode()


def limit_of(name: str) -> float:
    """The limit that this process has, by its name in `resource`."""
    if resource is None:
        return math.inf
    limits = resource.getrlimit(getattr(resource, name))
    return min((each for each in limits if each != resource.RLIM_INFINITY), default=math.inf)


_memory_before = min(limit_of("RLIMIT_AS"), limit_of("RLIMIT_DATA"))


def _limit(seconds: float, memory: int) -> float:
    """Set the limits, none above that which the process was started with; return its own limit of the memory."""
    if resource is None:
        return math.inf
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _lower("RLIMIT_CPU", math.ceil(time.process_time() + seconds))
    try:
        with open("/proc/self/statm", "rb") as statm:  # noqa: PTH123 - a path takes longer to import
            used = int(statm.read().split()[0]) * resource.getpagesize()
    except OSError:
        # Other systems do not enforce this limit.
        return math.inf
    _lower("RLIMIT_AS", used + memory)
    return used + memory


def _lower(name: str, wanted: int) -> None:
    least = int(min(wanted, limit_of(name)))
    resource.setrlimit(getattr(resource, name), (least, least))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3], float(sys.argv[4]), int(sys.argv[5]))
