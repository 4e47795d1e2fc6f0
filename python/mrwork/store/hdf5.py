"""Contents of HDF5 files (netCDF 4, MATLAB 7.3), read in a child process with limits of time and memory.

A damaged file can keep the HDF5 library busy for ever, out of reach of Ctrl-C, let it claim all memory, or end the
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
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from mrwork.values import holds_arrays

# Time of the processor [s]: for any file, and for each byte of it.
_SECONDS: Final = 8.0
_SECONDS_PER_BYTE: Final = 1.0 / 20e6
# Seconds after which the child is ended on any system, however busy.
_PATIENCE: Final = 120.0
# Bytes that the library needs besides file and data.
_OVERHEAD: Final = 128 << 20
# Bytes of all data of a file; compressed data may claim any size.
LARGEST: Final = 1 << 30
_LONGEST_HEAD: Final = 64 << 20


class UnreadableError(Exception):
    """The file cannot be read; the text is the reason, for a sentence."""


class TooLargeError(UnreadableError):
    """The data of the file claim more than `LARGEST`."""


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """A group or data set: its attributes that are a number or a text, and its array if that has real numbers."""

    is_group: bool
    attributes: Mapping[str, Any]
    array: NDArray[np.generic] | None


def read_hdf5(data: bytes) -> dict[str, Member]:
    """Members of an HDF5 file down to the second level, by path; that of the file itself is "".

    Links to other files and names that begin with `#` are left out.

    Raises
    ------
    UnreadableError
        If the file is damaged, or reading it takes too much time or memory.
    TooLargeError
        If its data claim more than `LARGEST`.
    """
    seconds = _SECONDS + _SECONDS_PER_BYTE * len(data)
    child = subprocess.Popen(
        [
            *(sys.executable, "-P", str(Path(__file__).with_name("hdf5_child.py"))),
            *(str(seconds), str(2 * len(data) + LARGEST + _OVERHEAD)),
        ],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=os.environ
        | {
            "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
            "OPENBLAS_NUM_THREADS": "1",
            "OMP_NUM_THREADS": "1",
        },
    )
    ended = threading.Timer(_PATIENCE + seconds, child.kill)
    ended.start()
    with child:
        try:
            _send(cast(IO[bytes], child.stdin), data)
            return _received(child, cast(IO[bytes], child.stdout), seconds)
        finally:
            ended.cancel()
            child.kill()


def _send(stdin: IO[bytes], data: bytes) -> None:
    try:
        stdin.write(data)
        stdin.close()
    except BrokenPipeError:
        # It has ended already; `_received` finds why.
        pass


def _received(child: subprocess.Popen[bytes], stdout: IO[bytes], seconds: float) -> dict[str, Member]:
    line = stdout.readline(_LONGEST_HEAD)
    if not line.endswith(b"\n"):
        raise UnreadableError(_reason(child, seconds))
    head = json.loads(line)
    left = LARGEST
    for path, entry in head.items():
        if entry["type"] is not None:
            left -= math.prod(entry["shape"]) * max(np.dtype(entry["type"]).itemsize, 8)
        if left < 0:
            raise TooLargeError(f"the data up to '{path}' claim more than {LARGEST >> 30} GiB")
    members: dict[str, Member] = {}
    for path, entry in head.items():
        array = None
        if entry["type"] is not None:
            content = stdout.read(math.prod(entry["shape"]) * np.dtype(entry["type"]).itemsize)
            try:
                array = np.frombuffer(content, dtype=entry["type"]).reshape(entry["shape"])
            except (ValueError, OverflowError):
                raise UnreadableError(_reason(child, seconds)) from None
        members[path] = Member(is_group=entry["group"], attributes=entry["attributes"], array=array)
    return members


def _reason(child: subprocess.Popen[bytes], seconds: float) -> str:
    """Why the child has ended."""
    lines = cast(IO[bytes], child.stderr).read().decode(errors="replace").strip().splitlines()
    status = child.wait()
    if status == 1 and lines:
        return lines[-1]
    if status < 0:
        return f"the HDF5 library fails on it, or takes more than {seconds:.0f} s"
    return f"the process that reads it ended with status {status}"
