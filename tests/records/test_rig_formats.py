"""Files of LabVIEW and of MATLAB 7.3 read like a plain table; damaged and hostile ones are refused."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import h5py
import numpy as np
import pytest
from record_files import DT, N_TIME, clean_columns, damaged
from rig_files import lvm, tdms_channels, write_matlab_73, write_tdms
from sentences import Refused

from mrwork.errors import MrworkError
from mrwork.records import DamperTest, read_damper_test


def assert_is_the_test(test: DamperTest) -> None:
    columns = clean_columns()
    assert test.n_time == N_TIME
    assert test.dt == pytest.approx(DT, rel=1e-6)
    np.testing.assert_allclose(test.displacement, columns["displacement_m"], rtol=1e-8, atol=1e-11)
    np.testing.assert_allclose(test.force, columns["force_n"], rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("comma", [False, True])
@pytest.mark.parametrize("cuts", [(), (100, 150)])
@pytest.mark.parametrize("x_columns", ["One", "Multi", "No"])
@pytest.mark.parametrize("extension", [".lvm", ".txt"])
def test_a_labview_file_reads_like_a_plain_table(
    tmp_path: Path, extension: str, x_columns: str, cuts: tuple[int, ...], comma: bool
) -> None:
    path = tmp_path / f"rig{extension}"
    path.write_text(lvm(x_columns, cuts=cuts, comma=comma))
    assert_is_the_test(read_damper_test(path))


def test_a_labview_file_is_refused_by_its_lines(tmp_path: Path, refused: Refused) -> None:
    def read(text: str) -> object:
        path = tmp_path / "rig.lvm"
        path.write_text(text)
        return read_damper_test(path)

    whole = lvm("One")
    lines = whole.split("\n")
    refused(read, lvm("No", steps="0.005\t0.01"))
    wrong = 40
    text = "\n".join([*lines[:wrong], lines[wrong].rpartition("\t")[0] + "\toverload", *lines[wrong + 1 :]])
    refused(read, text)
    other = lvm("One", cuts=(100,))
    head, _, rest = other.rpartition("X_Value\tStroke\tLoad cell")
    refused(read, f"{head}X_Value\tStroke\tTemperature{rest}")
    refused(read, "\n".join(lines[:23]))
    refused(read, "\n".join(lines[:8]))
    parted = lvm("Multi").split("\n")
    parted[40] = parted[40].replace("\t", "9\t", 1)
    refused(read, "\n".join(parted))


@pytest.mark.parametrize("struct", ["", "rig"])
def test_a_matlab_73_file_reads_like_a_plain_table(tmp_path: Path, struct: str) -> None:
    path = tmp_path / "rig.mat"
    columns = clean_columns()
    write_matlab_73(
        path, {**columns, "current_a": 0.5, "gains": np.eye(3), "pair": 1j * np.ones(3)}, struct=struct
    )
    test = read_damper_test(path)
    np.testing.assert_array_equal(test.force, columns["force_n"])
    np.testing.assert_array_equal(test.velocity, columns["velocity_mps"])
    assert test.current == 0.5


def test_a_matlab_73_file_that_is_cut_off_is_refused(tmp_path: Path, refused: Refused) -> None:
    path = tmp_path / "rig.mat"
    write_matlab_73(path, clean_columns())
    whole = path.read_bytes()
    for size in range(600, len(whole) - 1, len(whole) // 9):
        path.write_bytes(whole[:size])
        refused(read_damper_test, path)


def test_a_matlab_73_file_cannot_claim_memory_or_name_other_files(tmp_path: Path, refused: Refused) -> None:
    path = tmp_path / "rig.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        # Chunks that were never written take no room in the file.
        file.create_dataset("force_n", shape=(1 << 34, 1), chunks=(1024, 1), dtype="f8")
    refused(read_damper_test, path)
    secret = tmp_path / "secret.h5"
    with h5py.File(secret, "w") as file:
        for name, samples in clean_columns().items():
            file.create_dataset(name, data=samples)
    with h5py.File(path, "w", userblock_size=512) as file:
        for name in clean_columns():
            file[name] = h5py.ExternalLink(str(secret), name)
    refused(read_damper_test, path)


@pytest.fixture
def nptdms() -> ModuleType:
    module: ModuleType = pytest.importorskip("nptdms", reason="reading TDMS needs npTDMS")
    return module


def test_a_tdms_file_reads_like_a_plain_table(nptdms: Any, tmp_path: Path, refused: Refused) -> None:
    path = tmp_path / "rig.tdms"
    evenly = tdms_channels(wf_increment=DT, wf_start_offset=0.0)
    write_tdms(path, evenly)
    assert_is_the_test(read_damper_test(path))
    timed = {"Time": (clean_columns()["t_s"], {"unit_string": "s"}), **tdms_channels()}
    write_tdms(path, timed)
    assert_is_the_test(read_damper_test(path))
    stamps = np.datetime64("2020-01-02T12:00") + np.round(1e6 * clean_columns()["t_s"]).astype(
        "timedelta64[us]"
    )
    write_tdms(path, {"Time": (stamps, {}), **tdms_channels()})
    assert_is_the_test(read_damper_test(path))
    write_tdms(path, tdms_channels())
    refused(read_damper_test, path)


@pytest.mark.filterwarnings("ignore:.*npTDMS reports:mrwork.errors.MrworkWarning")
def test_a_damaged_tdms_file_reads_or_is_refused(
    nptdms: Any, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "rig.tdms"
    write_tdms(path, tdms_channels(wf_increment=DT))
    intact = path.read_bytes()
    n_refused = 0
    for copy in damaged(intact, 60, header=300, rng=3):
        path.write_bytes(copy)
        try:
            read_damper_test(path)
        except MrworkError:
            n_refused += 1
    assert n_refused > 0
    assert capfd.readouterr() == ("", "")


def test_without_nptdms_the_remedy_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused
) -> None:
    monkeypatch.setitem(sys.modules, "nptdms", None)
    path = tmp_path / "rig.tdms"
    path.write_bytes(b"TDSm")
    refused(read_damper_test, path)
