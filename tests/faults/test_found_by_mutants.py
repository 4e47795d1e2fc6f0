"""The smallest files that showed a defect, and those that claim more than they hold: each is refused soon."""

import os
import resource
import struct
import time
import tracemalloc
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import rig_files
from matlab_files import element
from motion_files import knet_lines
from record_files import clean_columns, write_text
from refusals import refusal
from study_texts import study_text

import mrwork as mr
from mrwork.buildings import read_building
from mrwork.files.matlab import read_variables
from mrwork.files.matrices import read_matrix
from mrwork.files.open_table import open_table
from mrwork.motions import read_motion
from mrwork.records import read_damper_test

STUDY = study_text("control_weight = 1e-13")
STIFF = study_text("control_weight = 1e-13", damper="differential = true\nparameters = { k = 1e15 }")
BEST = STIFF.replace('law = "clipped', 'law = "best_passive"\n[[controller]]\nlaw = "clipped')
STILL = STUDY.replace('synthetic = "kanai_tajimi"\nduration = 2', 'file = "still.csv"')
LVM = rig_files.lvm("No").replace("X0\t0.0", "X0\t0,0")
KNET = "\n".join(knet_lines(np.arange(100), "1")).replace("100Hz", "1" * 60_000)
MASSLESS = "mass = [[1e-320]]\nstiffness = [[1.0]]"


def record(column: str, place: int, number: float) -> str:
    """A record with another number in one place."""
    columns = clean_columns()
    columns[column][place] = number
    rows = zip(*columns.values(), strict=True)
    return "\n".join([",".join(columns), *(",".join(map(repr, map(float, row))) for row in rows)])


def responses(path: Path) -> object:
    return mr.run_study(mr.read_study(path), threads=1)


REFUSED: dict[str, tuple[str, str, Callable[[Path], object], str]] = {
    "a force beyond any": ("a.csv", record("force_n", 5, 1e200), read_damper_test, r"line 7: .* 1e\+200"),
    "times that nearly repeat": ("a.csv", record("t_s", 1, 1e-200), read_damper_test, "line 3: .* 1e-200 s"),
    "another decimal sign": ("a.lvm", LVM, read_damper_test, "X0 of the header is '0,0'"),
    "a mass without size": ("a.toml", MASSLESS, mr.buildings.read_building, "9.99989e-321 kg"),
    "hours": ("a.toml", STUDY.replace("= 2", "= 65536"), mr.read_study, "line 9: .* 0.315 GB"),
    "days of rest": ("a.toml", STUDY.replace("= 2", "= 2\nrest = 1e9"), mr.read_study, "line 9: .* GB"),
    "a motion without motion": ("a.toml", STILL, mr.read_study, "'still' is zero throughout"),
    "no score": ("a.toml", BEST.replace("= 2", "= 0.1"), responses, "no constant command has a score"),
    "a long line of a header": ("a.NS", KNET, read_motion, "Sampling Freq"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_it_is_refused_soon(tmp_path: Path, name: str) -> None:
    file, text, read, word = REFUSED[name]
    (tmp_path / "still.csv").write_text("t_s,acceleration_g\n" + "".join(f"{t},0\n" for t in range(9)))
    (tmp_path / file).write_text(text)
    began = time.process_time()
    refusal(read, tmp_path / file, match=word)
    assert time.process_time() - began < 5.0


def test_a_test_that_moves_with_its_last_sample_only_is_read(tmp_path: Path) -> None:
    columns = clean_columns()
    del columns["velocity_mps"]
    columns["displacement_m"][:-1] *= 1e-6
    assert read_damper_test(write_text(tmp_path / "rig.csv", columns)).n_time == columns["t_s"].size


MATLAB_5 = b"MATLAB 5.0 MAT-file".ljust(124, b" ") + struct.pack("<H", 0x0100) + b"IM"
# Memory that a reader takes at most, beyond the largest file: three matrices of a building, unpacked and as arrays.
MOST_MEMORY = 800 << 20
LARGEST, MATRIX = 1 << 29, 256 << 20
ROWS = "".join(f"{0.01 * row:.2f},{row % 7},{row % 5}\n" for row in range(10_000)).encode()


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
    (read_matrix, "a.csv", b"\n" * (24 << 20), 0),
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


SPARSE, DOUBLE = 5, 6
BEYOND = 2**31 - 1


def integers(*values: int) -> bytes:
    return element(5, np.array(values, "<i4").tobytes())


def matrix(kind: int, shape: tuple[int, ...], name: str, *parts: bytes) -> bytes:
    facts = (element(6, struct.pack("<2I", kind, 0)), integers(*shape), element(1, name.encode()))
    return element(14, b"".join((*facts, *parts)))


def packed(name: str, column: np.ndarray) -> bytes:
    block = matrix(DOUBLE, (column.size, 1), name, element(9, column.tobytes()))
    content = zlib.compress(block, 9)
    return struct.pack("<2I", 15, len(content)) + content


def peak_of(read: Callable[[Path], object], path: Path) -> int:
    """Largest number of bytes that a reader allocates before it refuses a file."""
    tracemalloc.start()
    try:
        refusal(read, path, match=path.name)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    "content",
    [
        matrix(DOUBLE, (BEYOND, 1), "a", element(9, bytes(8))),
        matrix(DOUBLE, (BEYOND, BEYOND, BEYOND, 0), "a", element(9, b"")),
        matrix(DOUBLE, (-1, 1), "a", element(9, bytes(8))),
        matrix(DOUBLE, 100 * (1,), "a", element(9, bytes(8))),
        matrix(SPARSE, (3, 0), "a", integers(), integers(), element(9, b"")),
        matrix(SPARSE, (3, 3), "S", integers(0), integers(0, BEYOND, -2, 0), element(9, bytes(8))),
    ],
    ids=["long", "no items", "negative", "100 dimensions", "no columns", "indices that wrap"],
)
def test_sides_that_no_array_has_are_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "frame.mat"
    path.write_bytes(MATLAB_5 + content)
    assert peak_of(read_variables, path) < 1e6


def test_columns_that_do_not_change_are_read_however_far_they_shrink(tmp_path: Path) -> None:
    time = 1e-3 * np.arange(200_000)
    columns = {"t_s": time, "force_n": 300.0 * np.sign(np.cos(2.0 * np.pi * time))}
    path = tmp_path / "rig.mat"
    path.write_bytes(MATLAB_5 + b"".join(packed(name, column) for name, column in columns.items()))
    assert path.stat().st_size < 2 * time.nbytes / 4
    for name, column in open_table(path, lambda _: True).read(list(columns)).items():
        np.testing.assert_array_equal(column, columns[name])
