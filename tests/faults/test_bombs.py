"""Small files that unpack to gigabytes, and files with holes: each reader refuses them before it takes much memory.

A hole of a sparse file reads as zeros, and takes no room on the disk.
"""

from __future__ import annotations

import os
import resource
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import pytest
from refusals import refusal

import mrwork as mr
from mrwork.buildings import read_building
from mrwork.files.matrices import read_matrix
from mrwork.motions import read_motion
from mrwork.records import read_damper_test

MATLAB_5 = b"MATLAB 5.0 MAT-file".ljust(124, b" ") + struct.pack("<H", 0x0100) + b"IM"
# Memory that a reader takes at most, beyond the largest file.
MOST_MEMORY = 600 << 20
LARGEST, MATRIX = 1 << 30, 256 << 20
ROWS = "".join(f"{0.01 * row:.2f},{row % 7},{row % 5}\n" for row in range(10_000)).encode()


def element(kind: int, content: bytes) -> bytes:
    return struct.pack("<2I", kind, len(content)) + content + b"\0" * (-len(content) % 8)


def zeros(name: str, side: int) -> bytes:
    """A compressed matrix of zeros in a file of MATLAB."""
    count = 8 * side**2
    head = element(6, struct.pack("<2I", 6, 0)) + element(5, struct.pack("<2i", side, side))
    head += element(1, name.encode()) + struct.pack("<2I", 9, count)
    packer = zlib.compressobj(9)
    packed = packer.compress(struct.pack("<2I", 14, len(head) + count) + head)
    packed += b"".join(packer.compress(bytes(side)) for _ in range(8 * side)) + packer.flush()
    return struct.pack("<2I", 15, len(packed)) + packed


PACKED = (b"".join(zeros(name, 4000) for name in "MCK"), zeros("K", 12_000), bytes(8 << 20))
# Reader, name, start, and the size where a hole follows.
CASES: list[tuple[Callable[[Path], object], str, bytes, int]] = [
    *((read, "a.mat", MATLAB_5 + packed, 0) for packed in PACKED for read in (read_damper_test, read_matrix)),
    *((read, "a.mat", MATLAB_5 + PACKED[0], 0) for read in (read_motion, read_building)),
    (read_damper_test, "a.csv", b"t_s,displacement_mm,force_N\n" + ROWS, LARGEST),
    (read_damper_test, "a.lvm", b"LabVIEW Measurement\t\n", LARGEST),
    (read_damper_test, "a.mat", MATLAB_5, LARGEST),
    (read_motion, "a.csv", b"t_s,acceleration_g,b\n" + ROWS, LARGEST),
    (read_matrix, "a.csv", b"1,2\n3,4\n", MATRIX),
    (read_matrix, "a.npy", b"\x93NUMPY", MATRIX),
    (mr.read_study, "a.toml", b"title = 'a'\n", 4 << 20),
    (lambda path: mr.load(path.parent), "fit.json", b'{"model": ', MATRIX),
    (read_matrix, "a.csv", b"\n" * (64 << 20), 0),
    (read_matrix, "a.csv", b"1 " * (8 << 20), 0),
]


@pytest.mark.parametrize("case", range(len(CASES)))
def test_a_file_that_would_take_much_memory_is_refused_before(case: int, tmp_path: Path) -> None:
    read, name, start, size = CASES[case]
    with (tmp_path / name).open("wb") as file:
        file.write(start)
        if size:
            file.truncate(size - 30)
            file.seek(0, os.SEEK_END)
            file.write(ROWS[-30:])
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    refusal(read, tmp_path / name, match="")
    more = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - used)
    assert more < MOST_MEMORY + (tmp_path / name).stat().st_size
