"""HDF5 and Parquet files are read in a child process: what is in them, and one sentence for whatever is wrong."""

from __future__ import annotations

import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from mrwork.store import child_program, child_reader
from mrwork.store.child_reader import TooLargeError, UnreadableError, read_members
from mrwork.store.input_file import LEAST


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
    members = read_members(path.read_bytes(), "hdf5")
    arrays = {name: each.array.tolist() for name, each in members.items() if each.array is not None}
    assert arrays == {"group/table": [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]], "big_endian": [0, 1, 2]}
    assert set(members) == {*arrays, "", "group", "group/deep", "text"}
    assert {name for name, each in members.items() if each.is_group} == {"", "group", "group/deep"}
    assert members[""].attributes == {"title": "a title"}
    assert members["group/table"].attributes == {"units": "N"}
    with pytest.raises(UnreadableError, match=r"^[^\n]+$"):
        read_members(path.read_bytes()[:900], "hdf5")


def test_claimed_sizes_are_refused_before_they_are_allocated(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "file.h5", "w") as file:
        file.create_dataset("force", shape=(LEAST // 8 + 1, 1), chunks=(1024, 1), dtype="f4")
    with pytest.raises(TooLargeError, match="the data up to 'force' claim more than the 101 MB"):
        read_members((tmp_path / "file.h5").read_bytes(), "hdf5")


@pytest.mark.parametrize(
    ("program", "reason"),
    [
        ("while True: pass", "takes more than 1 s"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "fails on it"),
        ("bytearray(1 << 40)", "MemoryError"),
    ],
)
@pytest.mark.skipif(sys.platform != "linux", reason="limits are kept by the kernel of Linux")
def test_what_the_library_may_do_to_the_child_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, program: str, reason: str
) -> None:
    # The limits of the child with a program in the place of the library.
    source = Path(child_program.__file__)
    limits, start, main = source.read_text().partition('if __name__ == "__main__":')
    (tmp_path / source.name).write_text(f"{limits}def hdf5(data, out):\n    {program}\n\n\n{start}{main}")
    monkeypatch.setattr(child_reader, "_HERE", tmp_path)
    monkeypatch.setattr(child_reader, "_SECONDS", 1.0)
    with pytest.raises(UnreadableError, match=reason):
        read_members(b"", "hdf5")
