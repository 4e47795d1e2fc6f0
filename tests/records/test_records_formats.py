"""The same test gives the same data from every format, delimiter and unit; the sheet with the record is read."""

import hashlib
import importlib.util
import struct
import sys
from collections.abc import Sequence
from datetime import datetime, timedelta
from pathlib import Path

import h5py
import numpy as np
import pytest
from matlab_files import append, element, object_of
from numpy.typing import NDArray
from odd_files import KN, MM, NEWTON, TIME, assert_is_the_test, workbook
from record_files import DT, N_TIME, built, clean_columns, codes, message, write_text
from refusals import refusal
from scipy.io import savemat
from scipy.sparse import csc_matrix

from mrwork.files.matlab import matrices_among, read_variables
from mrwork.records import DamperTest, read_damper_test, read_damper_tests


def assert_is_the_clean_test(test: DamperTest, rtol: float = 1e-15) -> None:
    columns = clean_columns()
    np.testing.assert_allclose(test.time, columns["t_s"], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(test.displacement, columns["displacement_m"], rtol=rtol, atol=1e-17)
    np.testing.assert_allclose(test.velocity, columns["velocity_mps"], rtol=rtol, atol=1e-17)
    np.testing.assert_allclose(test.force, columns["force_n"], rtol=rtol)
    assert test.velocity_source == "measured"
    assert test.dt == pytest.approx(DT)


def test_a_clean_file_gives_its_arrays_and_no_remark(tmp_path: Path) -> None:
    path = write_text(tmp_path / "rig 3.csv", clean_columns())
    test = read_damper_test(path)
    assert_is_the_clean_test(test, rtol=0.0)
    assert test.remarks == ()
    assert (test.name, test.path) == ("rig 3", str(path))
    assert test.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert (test.current, test.voltage, test.amplitude, test.frequency) == (None, None, None, None)
    assert not test.synthetic


@pytest.mark.parametrize(
    ("before", "after"),
    [
        pytest.param("t_s,", "# t_s,", id="header as a comment"),
        pytest.param("e-05,", "E-05,", id="capital exponent"),
        pytest.param("displacement_m", '"Displacement (m)"', id="quoted name"),
    ],
)
def test_harmless_variants_of_text_do_not_matter(tmp_path: Path, before: str, after: str) -> None:
    path = write_text(tmp_path / "rig.CSV", clean_columns())
    path.write_text(path.read_text().replace(before, after))
    assert_is_the_clean_test(read_damper_test(path), rtol=0.0)


POUND = 4.4482216152605
UNITS = {
    "t_s": {"t_ms": 1e3, "Time (s)": 1.0, "time_us": 1e6, "time_min": 1.0 / 60.0},
    "displacement_m": {"disp_mm": 1e3, "x_cm": 1e2, "Stroke [um]": 1e6, "displacement_in": 1.0 / 0.0254},
    "velocity_mps": {"velocity_mm_s": 1e3, "v_m_s": 1.0, "Velocity, cm/s": 1e2, "v_mmps": 1e3},
    "force_n": {
        **{"force_kN": 1e-3, "F_LBF": 1.0 / POUND, "Load (lbs)": 1.0 / POUND, "Load [lb]": 1.0 / POUND},
        **{"load_Lbf": 1.0 / POUND, "Load (kips)": 1e-3 / POUND, "load_kip": 1e-3 / POUND},
        **{"Force [kgf]": 1.0 / 9.80665, "Load [tf]": 1e-3 / 9.80665, "f_n": 1.0},
    },
}


@pytest.mark.parametrize(
    ("column", "other", "factor"),
    [(column, other, factor) for column, others in UNITS.items() for other, factor in others.items()],
)
def test_units_do_not_matter(tmp_path: Path, column: str, other: str, factor: float) -> None:
    columns = {
        other if name == column else name: samples * (factor if name == column else 1.0)
        for name, samples in clean_columns().items()
    }
    test = read_damper_test(write_text(tmp_path / "rig.csv", columns, ";"))
    # One multiplication each way: three roundings.
    assert_is_the_clean_test(test, rtol=4e-16)
    assert test.remarks == ()


@pytest.mark.parametrize(
    ("version", "compressed", "in_struct"), [("4", False, False), ("5", False, False), ("5", True, True)]
)
def test_mat_files_read_like_text(tmp_path: Path, version: str, compressed: bool, in_struct: bool) -> None:
    path = tmp_path / "rig.mat"
    content: dict[str, object] = {**clean_columns(), "current_a": 0.5}
    savemat(path, {"rig": content} if in_struct else content, format=version, do_compression=compressed)
    test = read_damper_test(path)
    assert_is_the_clean_test(test, rtol=0.0)
    assert test.current == 0.5


def test_mat_files_of_big_endian_machines_read_like_text(tmp_path: Path) -> None:
    # SciPy writes only the byte order of the machine, so these bytes follow the format description.
    old, new = b"", b"MATLAB 5.0 MAT-file".ljust(124) + b"\x01\x00MI"
    for name, samples in clean_columns().items():
        items, label = samples.astype(">f8").tobytes(), name.encode()
        old += struct.pack(">5i", 1000, samples.size, 1, 0, len(label) + 1) + label + b"\0" + items
        flags = struct.pack(">4I", 6, 8, 6, 0)
        shape = struct.pack(">2I2i", 5, 8, samples.size, 1)
        named = struct.pack(">2I", 1, len(label)) + label + bytes(-len(label) % 8)
        body = flags + shape + named + struct.pack(">2I", 9, len(items)) + items
        new += struct.pack(">2I", 14, len(body)) + body
    for content in (old, new):
        path = tmp_path / "rig.mat"
        path.write_bytes(content)
        assert_is_the_clean_test(read_damper_test(path), rtol=0.0)


def test_mat_vectors_may_be_columns_integers_and_single_precision(tmp_path: Path) -> None:
    columns = clean_columns()
    path = tmp_path / "rig.mat"
    content = {
        "t_ms": np.arange(N_TIME, dtype=np.uint16)[:, np.newaxis] * 5,
        "displacement_m": columns["displacement_m"].astype(np.float32),
        "force_n": np.round(columns["force_n"]).astype(np.int32),
        "note": "not a column",
        "gains": np.eye(3),
        "mixed": np.array([1, "a"], dtype=object),
    }
    savemat(path, content)
    test = read_damper_test(path)
    np.testing.assert_array_equal(test.force, np.round(columns["force_n"]))
    np.testing.assert_array_equal(test.displacement, columns["displacement_m"].astype(np.float32))


@pytest.mark.parametrize(
    ("force", "word"), [(np.ones(7), "'force_n' has 7"), (1j * np.ones(400), "no column for the force among")]
)
def test_mat_variables_that_are_no_columns_are_told(
    tmp_path: Path, force: NDArray[np.generic], word: str
) -> None:
    path = tmp_path / "rig.mat"
    savemat(path, {**clean_columns(), "force_n": force})
    refusal(read_damper_test, path, match=word)


def test_a_pattern_reads_its_files_in_name_order(tmp_path: Path) -> None:
    for name in ("b.csv", "a.csv", "c[1].csv"):
        write_text(tmp_path / name, clean_columns())
    assert [test.name for test in read_damper_tests(str(tmp_path / "*.csv"))] == ["a", "b", "c[1]"]
    assert [test.name for test in read_damper_tests(tmp_path / "c[1].csv")] == ["c[1]"]
    given_order = [tmp_path / "b.csv", tmp_path / "a.csv"]
    assert [test.name for test in read_damper_tests(given_order)] == ["b", "a"]


def test_arrays_give_the_same_test_as_a_file() -> None:
    test = built(clean_columns(), current=np.full(N_TIME, 0.5))
    assert_is_the_clean_test(test, rtol=0.0)
    assert (codes(test), test.path, test.synthetic, test.current) == ([], "", False, 0.5)


def test_the_hash_of_arrays_depends_on_every_value() -> None:
    columns = clean_columns()

    def digest(force_change: float, current: float) -> str:
        force = columns["force_n"].copy()
        force[-1] += force_change
        return built(columns | {"force_n": force}, current=np.full(N_TIME, current)).sha256

    assert digest(0.0, 0.5) == digest(0.0, 0.5)
    assert len({digest(0.0, 0.5), digest(1e-9, 0.5), digest(0.0, 0.6)}) == 3


@pytest.mark.parametrize(
    ("extension", "module", "remedy"), [("tdms", "nptdms", "tdms"), ("xlsx", "python_calamine", "xlsx")]
)
def test_without_its_library_a_format_names_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, extension: str, module: str, remedy: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    path = tmp_path / f"rig.{extension}"
    path.write_bytes(b"rig")
    refusal(read_damper_test, path, match=rf"pip install 'mrwork\[{remedy}\]'")


Rows = list[Sequence[object]]
needs_calamine = pytest.mark.skipif(
    importlib.util.find_spec("python_calamine") is None, reason="reading .xlsx needs python-calamine"
)
HEAD: Rows = [["Time (s)", "Stroke (mm)", "Force (kN)"]]
BODY: Rows = [list(row) for row in zip(TIME, MM, KN, strict=True)]


def read_workbook(path: Path, sheets: dict[str, Rows], **columns: str) -> DamperTest:
    path.write_bytes(workbook(sheets))
    return read_damper_test(path, columns=columns)


def old_workbook(rows: Rows) -> bytes:
    """An .xls workbook of one sheet, `run`: BIFF8 records in a compound file of sectors of 512 bytes."""

    def entry(kind: int, body: bytes) -> bytes:
        return struct.pack("<HH", kind, len(body)) + body

    def cell(row: int, column: int, value: object) -> bytes:
        at = struct.pack("<HHH", row, column, 0)
        if isinstance(value, str):
            return entry(0x204, at + struct.pack("<HB", len(value), 0) + value.encode("latin-1"))
        return entry(0x203, at + struct.pack("<d", value))

    cells = b"".join(cell(i, j, value) for i, row in enumerate(rows) for j, value in enumerate(row))
    start, end = entry(0x809, struct.pack("<HHHHII", 0x600, 5, 0, 0, 0, 0)), entry(0x0A, b"")
    bound = struct.pack("<IBBBB", len(start) + 15 + len(end), 0, 0, 3, 0) + b"run"
    stream = start + entry(0x85, bound) + end + start.replace(b"\x05", b"\x10") + cells + end
    n_sectors = max(8, -(-len(stream) // 512))
    chain = [0xFFFFFFFD, 0xFFFFFFFE, *range(3, n_sectors + 2), 0xFFFFFFFE]
    table = struct.pack("<128I", *chain, *[0xFFFFFFFF] * (128 - len(chain)))

    def member(name: str, kind: int, child: int, first: int, size: int) -> bytes:
        text = (name + "\0").encode("utf-16-le")
        links = struct.pack("<HBBIII", len(text), kind, 1, 0xFFFFFFFF, 0xFFFFFFFF, child)
        return text.ljust(64, b"\0") + links + bytes(36) + struct.pack("<IQ", first, size)

    folder = member("Root Entry", 5, 1, 0xFFFFFFFE, 0) + member("Workbook", 2, 0xFFFFFFFF, 2, 512 * n_sectors)
    head = bytes.fromhex("d0cf11e0a1b11ae1") + bytes(16) + struct.pack("<HHHHH6x", 0x3E, 3, 0xFFFE, 9, 6)
    head += struct.pack("<IIIIIIIII", 0, 1, 1, 0, 4096, 0xFFFFFFFE, 0, 0xFFFFFFFE, 0)
    head += struct.pack("<109I", 0, *[0xFFFFFFFF] * 108)
    return head + table + folder.ljust(512, b"\0") + stream.ljust(512 * n_sectors, b"\0")


@needs_calamine
def test_an_old_workbook_reads_like_a_plain_table(tmp_path: Path) -> None:
    path = tmp_path / "rig.xls"
    path.write_bytes(old_workbook(HEAD + BODY))
    assert_is_the_test(read_damper_test(path))


SHEETS: dict[str, Rows] = {

    "a header block": [["Rig 3"], ["Rate", 200.0, "Hz"], ["Limits", -10.0, 10.0], [], *HEAD, *BODY],
    "a row of units": [["Zeit", "Weg", "Kraft"], ["[s]", "[mm]", "[kN]"], *BODY],
    "empty columns before": [[None, None, *row] for row in HEAD + BODY],
    "marks below": [["t", "x", "F"], ["s", '"', "N"], *zip(TIME, MM / 25.4, NEWTON, strict=True)],

    "remarks": [[*HEAD[0], "Remark"], [*BODY[0], "start"], *BODY[1:]],
    "numbers as texts with commas": [*HEAD, *([f"{cell:.9f}".replace(".", ",") for cell in row] for row in BODY)],
}  # fmt: skip


@needs_calamine
@pytest.mark.parametrize("sheet", SHEETS)
def test_a_sheet_reads_like_a_plain_table(tmp_path: Path, sheet: str) -> None:
    assert_is_the_test(read_workbook(tmp_path / "rig.xlsx", {"Sheet 1": SHEETS[sheet]}))


@needs_calamine
def test_cells_of_dates_are_times(tmp_path: Path) -> None:
    begin = datetime(2024, 2, 29, 23, 59, 59)
    stamps = [begin + timedelta(seconds=float(each)) for each in TIME]
    rows: Rows = [["Recorded at", "Stroke (mm)", "Force (kN)"], *zip(stamps, MM, KN, strict=True)]
    test = read_workbook(tmp_path / "rig.xlsx", {"Sheet 1": rows})
    assert_is_the_test(test)
    assert test.start_time == 0.0


@needs_calamine
def test_the_first_sheet_with_a_record_is_read_and_the_others_are_named(tmp_path: Path) -> None:
    longer: Rows = [["a", "b"], *([float(k), float(k)] for k in range(3000))]
    sheets = {"Info": [["operator", "me"]], "Raw & more": longer, "Run 1": HEAD + BODY, "Empty": []}
    test = read_workbook(tmp_path / "rig.xlsx", sheets)
    assert_is_the_test(test)
    assert message(test, "not_used") == "not used: sheets 'Info', 'Raw & more'"
    assert "further_records" not in codes(test)


@needs_calamine
def test_further_sheets_with_a_record_are_a_warning(tmp_path: Path) -> None:
    test = read_workbook(tmp_path / "rig.xlsx", {"Run 1": HEAD + BODY, "Run 2": HEAD + BODY, "Info": [["a"]]})
    assert_is_the_test(test)
    (warning,) = [each for each in test.remarks if each.code == "further_records"]
    assert warning.severity == "warning"
    assert "have a record: 'Run 2'; save each as a file" in warning.message
    assert message(test, "not_used") == "not used: sheet 'Info'"


@needs_calamine
def test_without_a_known_heading_the_longest_sheet_is_asked_about(tmp_path: Path) -> None:
    sheets = {"Info": [["a", "b"], [1.0, 2.0]], "Run": [["Ch 1", "Ch 2", "Ch 3"], *BODY]}
    refusal(read_workbook, tmp_path / "rig.xlsx", sheets, match="--column 'force=Ch 3:kN'")
    given = {"time": "Ch 1:s", "displacement": "Ch 2:mm", "force": "Ch 3:kN"}
    assert_is_the_test(read_workbook(tmp_path / "rig.xlsx", sheets, **given))


@needs_calamine
def test_a_wrong_cell_is_named_by_its_sheet_and_row(tmp_path: Path) -> None:
    body = [*BODY[:100], [*BODY[100][:2], "overload"], *BODY[101:]]
    sheets = {"Run 1": [[], *HEAD, *body]}
    refusal(
        read_workbook, tmp_path / "rig.xlsx", sheets, match=r"sheet 'Run 1': line 103, column 'Force \(kN\)'"
    )


@needs_calamine
@pytest.mark.parametrize(
    ("content", "word"),
    [(b"t_s,x_mm,F_N\n0,0,0\n", "not a readable .xlsx"), (workbook({"Notes": [["me"]]}), "'Notes'")],
)
def test_what_is_no_workbook_with_a_record_is_refused(tmp_path: Path, content: bytes, word: str) -> None:
    path = tmp_path / "rig.xlsx"
    path.write_bytes(content)
    refusal(read_damper_test, path, match=word)


def read_matrices(path: Path) -> dict[str, NDArray[np.float64]]:
    return matrices_among(read_variables(path)[1])


FULL = np.array([[4.0, -1.0, 0.0], [0.5, 3.0, 0.0]])


@pytest.mark.parametrize(("version", "compressed"), [("4", False), ("5", False), ("5", True)])
def test_full_and_sparse_matrices_come_back_as_they_were(
    tmp_path: Path, version: str, compressed: bool
) -> None:
    path = tmp_path / "frame.mat"
    stored = {"K": FULL, "S": csc_matrix(FULL), "row": np.array([[1, 2, 3]], dtype=np.uint8)}
    # A sparse matrix without columns is none.
    savemat(path, stored | {"none": csc_matrix((0, 0))}, format=version, do_compression=compressed)
    matrices = read_matrices(path)
    assert set(matrices) == set(stored)
    np.testing.assert_array_equal(matrices["K"], FULL)
    np.testing.assert_array_equal(matrices["S"], FULL)
    np.testing.assert_array_equal(matrices["row"], [[1.0, 2.0, 3.0]])


@pytest.mark.parametrize("name", ["sys", "plant", "x"])
def test_an_object_is_left_out_and_named(tmp_path: Path, name: str) -> None:
    path = tmp_path / "frame.mat"
    fields = {
        "K": FULL,
        "note": "of two floors",
        "of": {"S": csc_matrix(FULL)},
        "poles": np.array([[1j, 2.0]]),
    }
    savemat(path, {"K": FULL, "frame": fields, "cells": np.array([1, "a"], dtype=object)})
    _, variables = read_variables(append(path, object_of(name, "tf"), object_of("t", "string")))
    words = {key: content for key, content in variables.items() if isinstance(content, str)}
    assert words == {
        "frame.note": "text",
        "frame.poles": "complex numbers",
        "cells": "a cell array",
        name: "an object of class tf",
        "t": "an object of class string",
    }
    assert set(read_matrices(path)) == {"K", "frame.K", "frame.of.S"}
    np.testing.assert_array_equal(read_matrices(path)["frame.of.S"], FULL)


@pytest.mark.parametrize("kind", [2, 9])
def test_a_sparse_logical_matrix_has_bytes_whatever_type_they_claim(tmp_path: Path, kind: int) -> None:
    path = tmp_path / "frame.mat"
    savemat(path, {"K": FULL})
    head = element(6, struct.pack("<2I", 5 | 0x0200, 4)) + element(5, struct.pack("<2i", 2, 3))
    places = element(5, struct.pack("<4i", 0, 1, 0, 1)) + element(5, struct.pack("<4i", 0, 2, 4, 4))
    append(path, element(14, head + element(1, b"S") + places + element(kind, b"\1\1\1\1")))
    np.testing.assert_array_equal(read_matrices(path)["S"], FULL != 0.0)


def test_a_sparse_matrix_with_room_for_more_has_the_numbers_that_it_has(tmp_path: Path) -> None:
    # As MATLAB's spalloc leaves it: eight row indices, and the eight bytes of one number.
    path = tmp_path / "frame.mat"
    savemat(path, {"K": FULL})
    head = element(6, struct.pack("<2I", 5, 8)) + element(5, struct.pack("<2i", 2, 3))
    places = element(5, struct.pack("<8i", *[0] * 8)) + element(5, struct.pack("<4i", 0, 1, 1, 1))
    append(path, element(14, head + element(1, b"S") + places + element(9, struct.pack("<d", 2.5))))
    np.testing.assert_array_equal(read_matrices(path)["S"], [[2.5, 0.0, 0.0], [0.0, 0.0, 0.0]])


def test_structs_objects_and_sparse_matrices_of_version_73_are_told(tmp_path: Path) -> None:
    path = tmp_path / "frame.mat"
    sparse = csc_matrix(FULL)
    with h5py.File(path, "w") as file:
        for name in ("model/K", "model/part/K"):
            file[name] = FULL.T
        for part, values in (("data", sparse.data), ("ir", sparse.indices), ("jc", sparse.indptr)):
            file[f"S/{part}"] = values
        file["S"].attrs["MATLAB_sparse"] = len(FULL)
        for name, matlab_class in (("sys", "ss"), ("note", "char"), ("names", "cell")):
            file[name] = np.zeros((1, 6), np.uint32)
            file[name].attrs["MATLAB_class"] = np.bytes_(matlab_class)
    _, variables = read_variables(path)
    words = {key: content for key, content in variables.items() if isinstance(content, str)}
    assert words == {"sys": "an object of class ss", "note": "text", "names": "a cell array"}
    matrices = read_matrices(path)
    assert set(matrices) == {"model.K", "model.part.K", "S"}
    for matrix in matrices.values():
        np.testing.assert_array_equal(matrix, FULL)


@pytest.mark.parametrize(
    "text", ["# Created by Octave 8.4.0\n# name: K\n# type: matrix\n", " 1.0e+00 2.0e+00\n"]
)
def test_a_text_with_the_name_of_a_mat_file_is_no_damage(tmp_path: Path, text: str) -> None:
    (tmp_path / "frame.mat").write_text(text)
    refusal(read_matrices, tmp_path / "frame.mat", match="is a text.* `save -v7`")


@pytest.mark.parametrize("length", [160, 200])
def test_a_cut_file_is_refused(tmp_path: Path, length: int) -> None:
    path = tmp_path / "frame.mat"
    savemat(path, {"S": csc_matrix(FULL)})
    path.write_bytes(path.read_bytes()[:length])
    refusal(read_matrices, path, match="cut off or damaged")


def test_a_sparse_item_outside_its_matrix_is_refused(tmp_path: Path) -> None:
    triplets = np.array([[5.0, 1.0, 2.0], [2.0, 2.0, 0.0]])
    path = tmp_path / "frame.mat"
    path.write_bytes(struct.pack("<5i", 2, 2, 3, 0, 2) + b"S\0" + triplets.ravel(order="F").tobytes())
    refusal(read_matrices, path, match="exceeds matrix dim")
