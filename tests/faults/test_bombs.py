"""Small files that unpack to gigabytes, and files with holes: each reader refuses them in one sentence beforehand.

A hole of a sparse file reads as zeros, and takes no room on the disk.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from study_texts import study_text

import mrwork as mr
from mrwork.buildings import read_building
from mrwork.errors import MrworkError
from mrwork.files.matrices import read_matrix
from mrwork.motions import read_motion
from mrwork.records import read_damper_test
from mrwork.store.parse import json_value

try:
    import resource
except ImportError:
    pytest.skip("Windows has no limits of a process", allow_module_level=True)

MATLAB_5 = b"MATLAB 5.0 MAT-file".ljust(124, b" ") + struct.pack("<H", 0x0100) + b"IM"
# Memory that a reader takes at most, beyond the largest file.
MOST_MEMORY = 600 << 20
LARGEST = 1 << 30
ROWS = "".join(f"{0.01 * row:.2f},{row % 7},{row % 5}\n" for row in range(10_000)).encode()


def element(kind: int, content: bytes) -> bytes:
    return struct.pack("<2I", kind, len(content)) + content + b"\0" * (-len(content) % 8)


def head(matrix_class: int, shape: tuple[int, int], name: str) -> bytes:
    flags, sides = struct.pack("<2I", matrix_class, 0), struct.pack("<2i", *shape)
    return element(6, flags) + element(5, sides) + element(1, name.encode())


def compressed(parts: list[bytes | int]) -> bytes:
    """A compressed matrix of parts: bytes, or so many zeros."""

    def pieces() -> Iterator[bytes]:
        for part in parts:
            if isinstance(part, bytes):
                yield part
            else:
                for start in range(0, part, 1 << 20):
                    yield bytes(min(1 << 20, part - start))

    packer = zlib.compressobj(9)
    total = sum(part if isinstance(part, int) else len(part) for part in parts)
    packed = packer.compress(struct.pack("<2I", 14, total))
    packed += b"".join(map(packer.compress, pieces())) + packer.flush()
    return struct.pack("<2I", 15, len(packed)) + packed


def dense(name: str, rows: int, columns: int) -> bytes:
    count = 8 * rows * columns
    return compressed([head(6, (rows, columns), name), struct.pack("<2I", 9, count), count])


def sparse(name: str, n_items: int) -> bytes:
    """A matrix of 10 x 10 with so many items, all in one place."""
    starts = struct.pack("<11i", 0, *(10 * [n_items]))
    indices = [struct.pack("<2I", 5, 4 * n_items), 4 * n_items, element(5, starts)]
    return compressed([head(5, (10, 10), name), *indices, struct.pack("<2I", 2, n_items), n_items])


def hole(path: Path, start: bytes, size: int, end: bytes = b"") -> None:
    with path.open("wb") as file:
        file.write(start)
        file.truncate(size - len(end))
        file.seek(0, os.SEEK_END)
        file.write(end)


PACKED = {
    "dense": dense("K", 7000, 7000),
    "dense, thrice": b"".join(dense(name, 4000, 4000) for name in "MCK"),
    "beyond any": dense("K", 12_000, 12_000),
    "sparse": sparse("K", 24_000_000),
    "tags": bytes(8 << 20),
    "packed tags": compressed(
        [head(2, (1, 1), "s"), element(5, b"\1\0\0\0"), element(1, b"a" * 800_000), 8 << 20]
    ),
}
READERS: dict[str, Callable[[Path], object]] = {
    "record": read_damper_test,
    "motion": read_motion,
    "matrix": read_matrix,
    "building": read_building,
    "system": mr.buildings.read_system,
}


def gain(path: Path) -> object:
    """A study whose law has the gain of a file."""
    study = path.with_name("study.toml")
    study.write_text(study_text(f'gain = "{path.name}"'))
    return mr.read_study(study)


READERS["gain"] = gain
SPARSE: dict[str, tuple[Callable[[Path], object], str, bytes, int]] = {
    "record": (read_damper_test, "a.csv", b"t_s,displacement_mm,force_N\n" + ROWS, LARGEST),
    "record of blanks": (read_damper_test, "a.txt", b"t_s displacement_mm force_N\n", LARGEST),
    "record of LabVIEW": (read_damper_test, "a.lvm", b"LabVIEW Measurement\t\n", LARGEST),
    "record of MATLAB": (read_damper_test, "a.mat", MATLAB_5, LARGEST),
    "record of MATLAB 4": (read_damper_test, "a.mat", b"\0", LARGEST),
    "record of TDMS": (read_damper_test, "a.tdms", b"TDSm", LARGEST),
    "motion": (read_motion, "a.csv", b"t_s,acceleration_g,b\n" + ROWS, LARGEST),
    "motion of MATLAB": (read_motion, "a.mat", MATLAB_5, LARGEST),
    "matrix": (read_matrix, "a.csv", b"1,2\n3,4\n", 256 << 20),
    "matrix of MATLAB": (read_matrix, "a.mat", MATLAB_5, 256 << 20),
    "matrix of arrays": (read_matrix, "a.npy", b"\x93NUMPY", 256 << 20),
    "gain": (gain, "a.csv", b"1,2\n3,4\n", 256 << 20),
    "building": (read_building, "a.toml", b"masses = [1.0]\n", 4 << 20),
    "study": (mr.read_study, "a.toml", b"title = 'a'\n", 4 << 20),
    "fit": (lambda path: mr.load(path.parent), "fit.json", b'{"model": ', 256 << 20),
    "results": (lambda path: mr.load(path.parent), "manifest.json", b'{"kind": ', 256 << 20),
}


def refused_soon(read: Callable[[Path], object], path: Path) -> None:
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(MrworkError):
        read(path)
    more = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - used)
    assert more < MOST_MEMORY + path.stat().st_size


@pytest.mark.parametrize("content", PACKED)
@pytest.mark.parametrize("reader", READERS)
def test_a_small_file_that_unpacks_to_much_is_refused_soon(reader: str, content: str, tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    path.write_bytes(MATLAB_5 + PACKED[content])
    if (reader, content) == ("matrix", "dense"):
        # It is one, as large as any.
        assert read_matrix(path).shape == (7000, 7000)
        return
    refused_soon(READERS[reader], path)


@pytest.mark.parametrize("reader", SPARSE)
def test_a_file_with_a_hole_is_refused_soon(reader: str, tmp_path: Path) -> None:
    read, name, start, size = SPARSE[reader]
    for end in (b"", ROWS[-30:]):
        hole(tmp_path / name, start, size, end)
        refused_soon(read, tmp_path / name)


@pytest.mark.parametrize("content", [b"\n" * (64 << 20), b"1 " * (8 << 20), b"\r\n" * (8 << 20)])
def test_a_matrix_of_too_many_lines_or_too_long_ones_is_refused_soon(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(content)
    refused_soon(read_matrix, tmp_path / "a.csv")


def test_a_document_of_too_many_values_is_refused_before_it_is_read() -> None:
    with pytest.raises(ValueError, match="more than 16,000,000 values"):
        json_value("[" + "[]," * 8_000_000 + "[]]")
