"""HDF5 files are read in a child process: what is in them, and one sentence for whatever is wrong with them."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from mrwork.store import hdf5
from mrwork.store.hdf5 import LARGEST, TooLargeError, UnreadableError, read_hdf5


def written(path: Path) -> bytes:
    with h5py.File(path, "w") as file:
        file.attrs["title"] = "a title"
        file.attrs["steps"] = 3
        group = file.create_group("group")
        group["table"] = np.arange(6.0).reshape(2, 3)
        group["table"].attrs["units"] = np.bytes_("N")
        group["big_endian"] = np.arange(3, dtype=">i2")
        group.create_group("deep")["deeper"] = 1.0
        file["scalar"] = 0.5
        file["none"] = np.empty((0, 3))
        file["text"] = "abc"
        file["complex"] = np.ones(2, dtype=complex)
        file["#refs#"] = 1.0
        file["elsewhere"] = h5py.ExternalLink(str(path), "scalar")
    return path.read_bytes()


def test_members_come_back_with_their_numbers_and_attributes(tmp_path: Path) -> None:
    members = read_hdf5(written(tmp_path / "file.h5"))
    assert set(members) == {
        *("", "group", "group/table", "group/big_endian", "group/deep"),
        *("scalar", "none", "text", "complex"),
    }
    assert members[""].attributes == {"title": "a title", "steps": 3}
    assert members["group/table"].attributes == {"units": "N"}
    arrays = {path: member.array for path, member in members.items() if member.array is not None}
    np.testing.assert_array_equal(arrays["group/table"], np.arange(6.0).reshape(2, 3))
    np.testing.assert_array_equal(arrays["group/big_endian"], [0, 1, 2])
    assert arrays["scalar"] == 0.5
    assert arrays["none"].shape == (0, 3)
    assert set(arrays) == {"group/table", "group/big_endian", "scalar", "none"}
    assert [path for path, member in members.items() if member.is_group] == ["", "group", "group/deep"]


def test_a_damaged_file_is_one_sentence(tmp_path: Path) -> None:
    whole = written(tmp_path / "file.h5")
    for damaged in (b"", b"no", whole[:900]):
        with pytest.raises(UnreadableError) as error:
            read_hdf5(damaged)
        assert len(str(error.value).splitlines()) == 1


def test_claimed_sizes_are_refused_before_they_are_allocated(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "file.h5", "w") as file:
        file.create_dataset("force", shape=(LARGEST // 8 + 1, 1), chunks=(1024, 1), dtype="f4")
    with pytest.raises(TooLargeError, match="the data up to 'force' claim more than 1 GiB"):
        read_hdf5((tmp_path / "file.h5").read_bytes())


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
    source = Path(hdf5.__file__).with_name("hdf5_child.py").read_text()
    child = tmp_path / "hdf5_child.py"
    child.write_text(source.replace("        with h5py.File", f"        {program}\n        with h5py.File"))
    monkeypatch.setattr(hdf5, "__file__", str(tmp_path / "hdf5.py"))
    monkeypatch.setattr(hdf5, "_SECONDS", 1.0)
    began = time.process_time()
    with pytest.raises(UnreadableError, match=reason):
        read_hdf5(b"")
    # The child computes, not this process.
    assert time.process_time() - began < 1.0
