"""HDF5 and Parquet files are read in a child process: what is in them, and one sentence for whatever is wrong."""

from __future__ import annotations

import io
import os
import re
import sys
from pathlib import Path
from typing import get_args

import h5py
import numpy as np
import pytest
from command_line import ran
from counted_calls import calls_of

from mrwork.store import child_program, child_reader
from mrwork.store.child_reader import Format, TooLargeError, UnreadableError, read_members
from mrwork.store.input_file import LEAST


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
    members = read_members(written(tmp_path / "file.h5"), "hdf5")
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
            read_members(damaged, "hdf5")
        assert len(str(error.value).splitlines()) == 1


def in_parquet(columns: dict[str, object], **options: object) -> bytes:
    pyarrow = pytest.importorskip("pyarrow", reason="reading Parquet needs pyarrow")
    from pyarrow import parquet

    content = io.BytesIO()
    parquet.write_table(pyarrow.table(columns), content, **options)
    return content.getvalue()


def test_columns_of_parquet_come_back_as_float64(tmp_path: Path) -> None:
    columns = {"whole": [1, None, 3], "single": np.ones(3, "f4"), "text": ["a", "b", "c"], "none": [None] * 3}
    members = read_members(in_parquet(columns), "parquet")
    assert list(members) == list(columns)
    assert members["text"].array is members["none"].array is None
    for name, numbers in (("whole", [1.0, np.nan, 3.0]), ("single", [1.0, 1.0, 1.0])):
        array = members[name].array
        assert array is not None
        assert array.dtype == np.float64
        np.testing.assert_array_equal(array, numbers)


def test_a_page_of_parquet_that_claims_more_than_its_file_holds_is_one_sentence() -> None:
    whole = in_parquet({"force": np.arange(60.0)}, use_dictionary=False, compression="snappy", version="1.0")
    # The header of the first page: its kind, then its unpacked size as a number in pieces of seven bits.
    assert whole[4:7] == b"\x15\x00\x15"
    size = next(place for place in range(7, 20) if whole[place] < 0x80) + 1
    for claimed in (b"\xfe\xff\xff\xff\x0f", b"\x80\x80\x80\x80\x04"):
        with pytest.raises(UnreadableError) as error:
            read_members(whole[:7] + claimed + whole[size:], "parquet")
        assert len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize("form", get_args(Format))
def test_every_format_has_a_program_for_the_child(form: Format) -> None:
    assert callable(getattr(child_program, form))
    with pytest.raises(UnreadableError):
        read_members(b"no such file", form)


def test_claimed_sizes_are_refused_before_they_are_allocated(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "file.h5", "w") as file:
        file.create_dataset("force", shape=(LEAST // 8 + 1, 1), chunks=(1024, 1), dtype="f4")
    with pytest.raises(TooLargeError, match="the data up to 'force' claim more than the 101 MB"):
        read_members((tmp_path / "file.h5").read_bytes(), "hdf5")


def put_in_place_of_hdf5(program: str, folder: Path) -> None:
    """The limits of the child with a program in the place of the library."""
    source = Path(child_program.__file__)
    limits, start, main = source.read_text().partition('if __name__ == "__main__":')
    (folder / source.name).write_text(f"{limits}def hdf5(data, out):\n    {program}\n\n\n{start}{main}")


LIMITED = """
import sys
from pathlib import Path
from mrwork.errors import LibraryError
from mrwork.store import child_reader

child_reader._HERE = Path(sys.argv[1])
try:
    print(list(child_reader.read_members(b"", "hdf5")))
except (LibraryError, child_reader.UnreadableError) as error:
    print(type(error).__name__, error)
"""


@pytest.mark.parametrize(
    ("limit", "program", "words"),
    [
        # Both are below what the child would set.
        ("ulimit -v 400000", "out.write(b'{}' + bytes([10]))", r"\[\]"),
        ("ulimit -t 5", "out.write(b'{}' + bytes([10]))", r"\[\]"),
        (
            "ulimit -v 400000",
            "bytearray(399 << 20)",
            "LibraryError the process .* limit of memory .*ulimit -v",
        ),
        (
            "ulimit -t 2",
            "while True: pass",
            "LibraryError the process .* limit of processor time .*ulimit -t",
        ),
        ("ulimit -v 400000", "raise ValueError('damaged')", "UnreadableError damaged"),
        ("ulimit -v 64000000", "bytearray(1 << 40)", "UnreadableError MemoryError"),
    ],
)
@pytest.mark.skipif(sys.platform != "linux", reason="limits are kept by the kernel of Linux")
def test_a_limit_of_the_shell_holds_for_the_child_and_is_no_damage(
    tmp_path: Path, limit: str, program: str, words: str
) -> None:
    put_in_place_of_hdf5(program, tmp_path)
    line = f'{limit}; exec "$@"'
    ended = ran(
        *("bash", "-c", line, "bash", sys.executable, "-c", LIMITED, tmp_path),
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
    )
    assert re.match(words, ended.stdout), ended
    assert len(ended.stdout.splitlines()) == 1


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
    put_in_place_of_hdf5(program, tmp_path)
    monkeypatch.setattr(child_reader, "_HERE", tmp_path)
    monkeypatch.setattr(child_reader, "_SECONDS", 1.0)

    def read() -> None:
        with pytest.raises(UnreadableError, match=reason):
            read_members(b"", "hdf5")

    # The child computes, not this process.
    assert calls_of(read) < 5000
