"""Contents of HDF5 (netCDF 4, MATLAB 7.3), Parquet and .xlsx, read in a child process with limits of time and memory.

A damaged file can keep such a library busy for ever, out of reach of Ctrl-C, let it claim all memory, or end the
process by a signal. In a child process each of these is one sentence. A checksum beside the file would not do: these
files also come from others. Reading takes some tenths of a second longer, for the start of the child.

Limits are kept by the kernel of Linux; macOS does not enforce that of the memory, and Windows has that of `_PATIENCE`
only.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import threading
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, Final, Literal, cast

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import array_dataclass
from mrwork.errors import LibraryError, RecordError
from mrwork.store.child_program import NO_MEMORY, limit_of
from mrwork.store.input_file import compute_allowance

Format = Literal["hdf5", "parquet", "xlsx"]

_HERE: Final = Path(__file__).parent

# Time of the processor [s]: for any file, and for each byte of it.
_SECONDS: Final = 8.0
_SECONDS_PER_BYTE: Final = 1.0 / 20e6
# Seconds after which the child is ended on any system, however busy.
_PATIENCE: Final = 120.0
# Bytes that a library needs besides file and data.
_OVERHEAD: Final = 128 << 20
_LONGEST_HEAD: Final = 64 << 20
# SIGKILL, and SIGXCPU, which Windows does not have.
_ENDED_BY_TIME: Final = (-9, -24)
_OUTSIDE: Final = (
    "the process that reads HDF5, Parquet and .xlsx files has come to the limit of {limit} of this shell or job "
    "(ulimit {option}); raise it, or read the file where there is none"
)


class UnreadableError(Exception):
    """The file cannot be read; the text is the reason, for a sentence."""


class TooLargeError(UnreadableError):
    """The data of the file claim more than what is `allowed`."""


@array_dataclass()
class Member:
    """A group, data set or column: its attributes that are numbers or texts, and its array if that has real numbers."""

    is_group: bool
    attributes: Mapping[str, Any]
    array: NDArray[np.generic] | None


def read_members(data: bytes, form: Format) -> dict[str, Member]:
    """Members of a file, by name.

    Of HDF5 down to the second level, by path, and the file itself as "", without links to other files and names with
    `#`; of Parquet the columns, as float64; of .xlsx the sheets, by number, with their `name`, as bytes of a text with
    tabs between cells.
    """
    seconds = _SECONDS + _SECONDS_PER_BYTE * len(data)
    child = subprocess.Popen(
        [
            *(sys.executable, "-P", str(_HERE / "child_program.py")),
            *(form, str(seconds), str(memory_of_child(len(data)))),
        ],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=os.environ
        | {
            "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
            "OPENBLAS_NUM_THREADS": "1",
            "OMP_NUM_THREADS": "1",
            # The others reserve more than they use.
            "ARROW_DEFAULT_MEMORY_POOL": "system",
        },
    )
    ended = threading.Timer(_PATIENCE + seconds, child.kill)
    ended.start()
    with child:
        try:
            # Where it has ended already, `_reason` finds why.
            with suppress(BrokenPipeError):
                stdin = cast(IO[bytes], child.stdin)
                stdin.write(data)
                stdin.close()
            return receive_members(cast(IO[bytes], child.stdout), compute_allowance(len(data)))
        except EOFError:
            raise UnreadableError(_reason(child, seconds)) from None
        finally:
            ended.cancel()
            child.kill()


def members_of(
    data: bytes, form: Format, path: Path, *, name: str, remedy: str, smaller: str
) -> dict[str, Member]:
    """Members of the file at `path` as by `read_members`; one that is no readable `name` is refused."""
    try:
        return read_members(data, form)
    except TooLargeError as error:
        raise RecordError(f"{path}: {error}; {smaller}") from None
    except UnreadableError as error:
        raise RecordError(f"{path}: not a readable {name} ({error}); {remedy}") from None


def memory_of_child(size: int) -> int:
    """Bytes that the child may take for a file of `size` bytes: a column is held packed, unpacked and converted."""
    return 2 * size + 3 * compute_allowance(size) + _OVERHEAD


def receive_members(stdout: IO[bytes], most: int) -> dict[str, Member]:
    """Members as the program of the child has written them, of `most` bytes in all."""
    line = stdout.readline(_LONGEST_HEAD)
    if not line.endswith(b"\n"):
        raise EOFError
    head = json.loads(line)
    left = most
    for path, entry in head.items():
        if entry["type"] is not None:
            left -= math.prod(entry["shape"]) * max(np.dtype(entry["type"]).itemsize, 8)
        if left < 0:
            raise TooLargeError(
                f"the data up to '{path}' claim more than the {most / 1e6:,.0f} MB that a file of its size may hold"
            )
    members: dict[str, Member] = {}
    for path, entry in head.items():
        array = None
        if entry["type"] is not None:
            content = stdout.read(math.prod(entry["shape"]) * np.dtype(entry["type"]).itemsize)
            try:
                array = np.frombuffer(content, dtype=entry["type"]).reshape(entry["shape"])
            except (ValueError, OverflowError):
                raise EOFError from None
        members[path] = Member(is_group=entry["group"], attributes=entry["attributes"], array=array)
    return members


def _reason(child: subprocess.Popen[bytes], seconds: float) -> str:
    lines = cast(IO[bytes], child.stderr).read().decode(errors="replace").strip().splitlines()
    status = child.wait()
    if status == NO_MEMORY:
        raise LibraryError(_OUTSIDE.format(limit="memory", option="-v"))
    if status == 1 and lines:
        return lines[-1]
    if status in _ENDED_BY_TIME and limit_of("RLIMIT_CPU") <= seconds:
        raise LibraryError(_OUTSIDE.format(limit="processor time", option="-t"))
    if status < 0:
        return f"the library that reads it fails on it, or takes more than {seconds:.0f} s"
    return f"the process that reads it ended with status {status}"
