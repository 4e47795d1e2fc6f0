"""The same test gives the same data from every format, delimiter and unit."""

from __future__ import annotations

import hashlib
import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from record_files import DT, N_TIME, built, clean_columns, codes, write_text
from refusals import refusal
from scipy.io import savemat

from mrwork.records import DamperTest, read_damper_test, read_damper_tests


def assert_is_the_clean_test(test: DamperTest, rtol: float = 1e-15) -> None:
    columns = clean_columns()
    np.testing.assert_allclose(test.time, columns["t_s"], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(test.displacement, columns["displacement_m"], rtol=rtol, atol=1e-17)
    np.testing.assert_allclose(test.velocity, columns["velocity_mps"], rtol=rtol, atol=1e-17)
    np.testing.assert_allclose(test.force, columns["force_n"], rtol=rtol)
    assert test.velocity_source == "measured"
    assert test.dt == pytest.approx(DT)


def test_a_clean_file_gives_its_arrays_and_no_finding(tmp_path: Path) -> None:
    path = write_text(tmp_path / "rig 3.csv", clean_columns())
    test = read_damper_test(path)
    assert_is_the_clean_test(test, rtol=0.0)
    assert test.findings == ()
    assert (test.name, test.path) == ("rig 3", str(path))
    assert test.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert (test.current, test.voltage, test.amplitude, test.frequency) == (None, None, None, None)
    assert not test.synthetic


def test_the_arrays_of_a_test_cannot_be_changed(tmp_path: Path) -> None:
    test = read_damper_test(write_text(tmp_path / "rig.csv", clean_columns()))
    with pytest.raises(ValueError, match="read-only"):
        test.force[0] = 0.0


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


def test_text_in_a_column_that_is_not_asked_for_does_not_matter(tmp_path: Path) -> None:
    path = write_text(tmp_path / "rig.csv", clean_columns())
    header, *rows = path.read_text().splitlines()
    path.write_text("\n".join([f"remark,{header}", *(f"ok,{row}" for row in rows)]))
    assert_is_the_clean_test(read_damper_test(path), rtol=0.0)


UNITS = {
    "t_s": {"t_ms": 1e3, "Time (s)": 1.0, "time_us": 1e6, "time_min": 1.0 / 60.0},
    "displacement_m": {"disp_mm": 1e3, "x_cm": 1e2, "Stroke [um]": 1e6, "displacement_in": 1.0 / 0.0254},
    "velocity_mps": {"velocity_mm_s": 1e3, "v_m_s": 1.0, "Velocity, cm/s": 1e2, "v_mmps": 1e3},
    "force_n": {"force_kN": 1e-3, "F_LBF": 1.0 / 4.4482216152605, "Force [kgf]": 1.0 / 9.80665, "f_n": 1.0},
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
    assert test.findings == ()


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
    ("force", "word"),
    [(np.ones(7), "'force_n' has 7"), (1j * np.ones(400), "no column for the force among")],
)
def test_mat_variables_that_are_no_columns_are_told(
    tmp_path: Path, force: NDArray[np.generic], word: str
) -> None:
    path = tmp_path / "rig.mat"
    savemat(path, {**clean_columns(), "force_n": force})
    refusal(read_damper_test, path, match=word)


def test_parquet_reads_like_text(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow", reason="reading Parquet needs pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "rig.parquet"
    parquet.write_table(pyarrow.table(clean_columns()), path)
    assert_is_the_clean_test(read_damper_test(path), rtol=0.0)
    path.write_bytes(path.read_bytes()[:-100])
    refusal(read_damper_test, path, match="not a readable Parquet file")
    parquet.write_table(pyarrow.table({**clean_columns(), "force_n": ["1"] * N_TIME}), path)
    refusal(read_damper_test, path, match="'force_n' holds object values")


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
    ("extension", "module", "remedy"),
    [("parquet", "pyarrow", "parquet"), ("tdms", "nptdms", "tdms"), ("xlsx", "python_calamine", "xlsx")],
)
def test_without_its_library_a_format_names_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, extension: str, module: str, remedy: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    path = tmp_path / f"rig.{extension}"
    path.write_bytes(b"PAR1")
    refusal(read_damper_test, path, match=rf"pip install 'mrwork\[{remedy}\]'")
