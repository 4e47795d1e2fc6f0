"""Program of the child process of `child_reader`; it stands alone because it imports nothing of mrwork.

The file comes through stdin; `answer` of `child_hdf5` or `child_parquet` writes to stdout what is in it.
"""

from __future__ import annotations

import math
import runpy
import sys
import time


def main(program: str, seconds: float, memory: int) -> None:
    """Read the file within limits on the time of the processor [s] and on the memory beyond that of the imports [B]."""
    data = sys.stdin.buffer.read()
    answer = runpy.run_path(program)["answer"]
    _limit(seconds, memory)
    try:
        answer(data, sys.stdout.buffer)
    except Exception as error:  # the libraries raise whatever a damaged file leads them to
        sys.exit(_reason(error).encode("ascii", "replace").decode())


def _reason(error: Exception) -> str:
    try:
        return str(error).partition("\n")[0] or type(error).__name__
    except Exception:  # a text that cannot be made
        return type(error).__name__


def _limit(seconds: float, memory: int) -> None:
    try:
        import resource
    except ImportError:
        # Windows; the parent limits the time there.
        return
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    cpu = math.ceil(time.process_time() + seconds)
    resource.setrlimit(resource.RLIMIT_CPU, (cpu, cpu))
    try:
        with open("/proc/self/statm", "rb") as statm:  # noqa: PTH123 - a path takes longer to import
            used = int(statm.read().split()[0]) * resource.getpagesize()
    except OSError:
        # Other systems do not enforce this limit.
        return
    resource.setrlimit(resource.RLIMIT_AS, (used + memory, used + memory))


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]), int(sys.argv[3]))
