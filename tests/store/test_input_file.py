"""Every file is read through one gate, which refuses what is no ordinary file of a reasonable size."""

from __future__ import annotations

import ast
import os
import socket
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import mrwork
from mrwork.buildings import read_building
from mrwork.dampers import damper
from mrwork.errors import MrworkError, RecordError
from mrwork.files.matrices import read_matrix
from mrwork.motions import read_motion
from mrwork.records import read_damper_test, read_test_table
from mrwork.store.input_file import TOML, bytes_of, is_there, start_of, text_of
from mrwork.study import read_results, read_study
from mrwork.uncertainty.candidate_tests import read_candidates

PACKAGE = Path(mrwork.__file__).parent
# Calls that open a file or read a text, and the modules that may make them.
GATE = ("store/input_file.py",)
OPENERS = {
    *("open", "open_code", "fdopen", "read_text", "read_bytes", "open_datatree", "open_dataset"),
    *(
        "np.load",
        "np.loadtxt",
        "np.genfromtxt",
        "np.fromfile",
        "np.memmap",
        "pickle.load",
        "json.load",
        "json.loads",
    ),
    *(
        "tomllib.load",
        "tomllib.loads",
        "h5py.File",
        "zipfile.ZipFile",
        "parquet.ParquetFile",
        "loadmat",
    ),
}
ELSEWHERE = {
    "cli/cite.py": "a file of the package",
    "cli/init.py": "a file of the package",
    "cli/terminal.py": "the null device in place of a closed output",
    "files/delimited.py": "lines in memory",
    "base/namespace.py": "stubs of the package",
    "files/open_table.py": "bytes in memory",
    "files/rows.py": "bytes in memory",
    "drawing/style.py": "a file of the package",
    "report/html.py": "files of the package",
    "twins/kernel.py": "a header of jaxlib",
    "workers/engine.py": "the name of the processor",
    "store/child_reader.py": "what its child process prints",
    "store/child_program.py": "bytes in memory, and how much memory the process has",
    "store/parse.py": "texts that are in memory",
    "store/output_file.py": "files that are written",
    "store/output_folder.py": "folders, to flush them",
}

ENTRANCES: dict[str, tuple[str, Callable[[Path], object]]] = {
    "record": ("rig.csv", read_damper_test),
    "record of MATLAB": ("rig.mat", read_damper_test),
    "record of Parquet": ("rig.parquet", read_damper_test),
    "record of TDMS": ("rig.tdms", read_damper_test),
    "record of .xlsx": ("rig.xlsx", read_damper_test),
    "table of tests": ("tests.csv", read_test_table),
    "motion": ("motion.at2", read_motion),
    "motion of MATLAB": ("motion.mat", read_motion),
    "matrix": ("K.csv", read_matrix),
    "building": ("frame.toml", read_building),
    "matrices": ("frame.mat", read_building),
    "study": ("study.toml", read_study),
    "candidates": ("candidates.csv", lambda path: read_candidates(path, damper("bingham"))),
    "results": ("results.json", lambda path: read_results(path.parent)),
}


def callers(file: Path) -> Iterator[str]:
    """Names of the opening functions that a module calls."""
    text = file.read_text()
    # Parsing all modules takes seconds.
    if not any(f"{name}(" in text for name in OPENERS):
        return
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call):
            name = ast.unparse(node.func)
            if name in OPENERS or name.rpartition(".")[2] in OPENERS:
                yield name


def test_no_module_but_the_gate_opens_files() -> None:
    found = {str(file.relative_to(PACKAGE)) for file in PACKAGE.rglob("*.py") if any(callers(file))}
    assert found - set(GATE) <= set(ELSEWHERE)
    assert set(ELSEWHERE) <= found, "a module that opens no file any more"


def made_pipe(path: Path) -> None:
    os.mkfifo(path)


def made_device(path: Path) -> None:
    path.symlink_to("/dev/zero")


def made_loop(path: Path) -> None:
    path.symlink_to(path)


def made_socket(path: Path) -> None:
    place = os.open(path.parent, os.O_RDONLY)
    try:
        # The name of a socket is short.
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(f"/proc/self/fd/{place}/{path.name}")
    finally:
        os.close(place)


def made_huge(path: Path) -> None:
    """A file of 100 GB that takes no space."""
    with path.open("wb") as stream:
        stream.truncate(10**11)


@pytest.mark.skipif(sys.platform != "linux", reason="pipes and devices of Linux")
@pytest.mark.parametrize("make", [made_pipe, made_device, made_loop, made_socket, made_huge, Path.mkdir])
@pytest.mark.parametrize(("name", "read"), ENTRANCES.values(), ids=ENTRANCES)
def test_what_is_no_ordinary_file_is_refused_by_every_reader(
    tmp_path: Path, name: str, read: Callable[[Path], object], make: Callable[[Path], None]
) -> None:
    path = tmp_path / name
    make(path)
    with pytest.raises(MrworkError) as caught:
        read(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["x" * 300, "nul\0inside", "half\ud800", "not\udcff-utf8"])
@pytest.mark.parametrize(("suffix", "read"), ENTRANCES.values(), ids=ENTRANCES)
def test_names_that_no_file_can_have_are_refused_by_every_reader(
    tmp_path: Path, suffix: str, read: Callable[[Path], object], name: str
) -> None:
    with pytest.raises(MrworkError):
        read(tmp_path / name / suffix)
    with pytest.raises(MrworkError):
        read(tmp_path / (name + suffix))


def test_a_name_that_is_not_utf_8_is_read(tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(b"caf\xe9.toml")
    try:
        path.write_text("a = 1")
    except OSError:
        pytest.skip("the file system takes UTF-8 names only")
    assert text_of(path, TOML) == "a = 1"


@pytest.mark.skipif(sys.platform != "linux", reason="pipes of Linux")
def test_a_pipe_that_takes_the_place_of_a_file_after_the_check_is_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, other = tmp_path / "a.toml", tmp_path / "b.toml"
    os.mkfifo(path)
    other.write_text("")
    ordinary = other.stat()
    monkeypatch.setattr(os, "stat", lambda *_, **__: ordinary)
    with pytest.raises(RecordError, match="named pipe"):
        bytes_of(path, TOML)


def test_the_start_of_a_file_is_no_longer_than_asked(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_bytes(b"abc")
    assert (start_of(path, TOML, 2), start_of(path, TOML, 9), bytes_of(path, TOML)) == (b"ab", b"abc", b"abc")


def test_a_missing_file_is_told_from_another_thing_in_its_place(tmp_path: Path) -> None:
    assert not is_there(tmp_path / "none", TOML)
    with pytest.raises(RecordError, match="is a directory where a TOML file was expected"):
        is_there(tmp_path, TOML)
