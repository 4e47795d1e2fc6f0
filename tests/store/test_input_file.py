"""Every file is read through one gate: one sentence for whatever is wrong."""

import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest
from refusals import refusal

import mrwork as mr
from mrwork.files.matrices import read_matrix
from mrwork.store.input_file import LEAST, TOML, Allowance, bytes_of, is_there, text_of
from mrwork.store.members import _lines, members_of
from mrwork.uncertainty.candidate_tests import read_candidates

ENTRANCES: dict[str, Callable[[Path], object]] = {
    "rig.csv": mr.read_damper_test,
    "rig.mat": mr.read_damper_test,
    "rig.tdms": mr.read_damper_test,
    "rig.xlsx": mr.read_damper_test,
    "tests.csv": mr.records.read_test_table,
    "motion.at2": mr.read_motion,
    "K.csv": read_matrix,
    "frame.toml": mr.buildings.read_building,
    "frame.mat": mr.buildings.read_building,
    "study.toml": mr.read_study,
    "candidates.csv": lambda path: read_candidates(path, mr.damper("bingham")),
    "manifest.json": lambda path: mr.study.read_results(path.parent),
}


def huge(path: Path) -> None:
    """A file of 100 GB that takes no space."""
    with path.open("wb") as stream:
        stream.truncate(10**11)


@pytest.mark.skipif(sys.platform != "linux", reason="pipes and devices of Linux")
@pytest.mark.parametrize("make", [os.mkfifo, huge, Path.mkdir, lambda path: path.symlink_to("/dev/zero")])
@pytest.mark.parametrize("name", ENTRANCES)
def test_what_is_no_ordinary_file_is_refused_by_every_reader(
    tmp_path: Path, name: str, make: Callable[[Path], None]
) -> None:
    make(tmp_path / name)
    assert str(tmp_path / name) in str(refusal(ENTRANCES[name], tmp_path / name, match=name))


def test_a_name_that_is_not_utf_8_is_read_as_far_as_asked(tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(b"caf\xe9.toml")
    try:
        path.write_text("abc")
    except OSError:
        pytest.skip("the file system takes UTF-8 names only")
    assert (bytes_of(path, TOML, 2), bytes_of(path, TOML, 9), text_of(path, TOML)) == (b"ab", b"abc", "abc")
    assert not is_there(tmp_path / "none", TOML)


@pytest.mark.contract
def test_members_come_back_with_their_numbers_and_attributes(tmp_path: Path) -> None:
    path = tmp_path / "file.h5"
    with h5py.File(path, "w") as file:
        file.attrs["title"] = "a title"
        file["group/table"] = np.arange(6.0).reshape(2, 3)
        file["group/table"].attrs["units"] = np.bytes_("N")
        file["group/deep/deeper"] = 1.0
        file["big_endian"] = np.arange(3, dtype=">i2")
        file["text"] = "abc"
        file["#refs#"] = 1.0
        file["elsewhere"] = h5py.ExternalLink(str(path), "text")
    members = members_of(path.read_bytes(), path)
    arrays = {name: each.array.tolist() for name, each in members.items() if each.array is not None}
    assert arrays == {"group/table": [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]], "big_endian": [0, 1, 2]}
    assert set(members) == {*arrays, "", "group", "group/deep", "text"}
    assert {name for name, each in members.items() if each.is_group} == {"", "group", "group/deep"}
    assert members[""].attributes == {"title": "a title"}
    assert members["group/table"].attributes == {"units": "N"}
    refusal(members_of, path.read_bytes()[:900], path, match="not a readable HDF5 file")


def test_claimed_sizes_are_refused_before_they_are_allocated(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "file.h5", "w") as file:
        file.create_dataset("force", shape=(LEAST // 8 + 1, 1), chunks=(1024, 1), dtype="f4")
    content = (tmp_path / "file.h5").read_bytes()
    refusal(members_of, content, tmp_path / "file.h5", match="'force' claims 101 MB")


def test_a_text_that_stands_in_many_cells_counts_in_each(tmp_path: Path) -> None:
    class Sheet:
        @staticmethod
        def iter_rows() -> Iterator[list[str]]:
            while True:
                yield ["x" * 1_000_000]

    refusal(_lines, Sheet(), Allowance(tmp_path / "rig.xlsx", 100), match="a sheet claims")
