"""The fuzzing harness: its mutants can be made again, it counts every end of a reader, and finds none in a few mutants.

`make faults` reads a million.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import warnings
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import pytest
from command_line import ran

from mrwork.errors import MrworkWarning, RecordError
from mrwork.files.open_table import EXTENSIONS
from mrwork.motions.networks import Lines
from mrwork.motions.read import FORMATS
from mrwork.store.run_folder import (
    ADDITIONS,
    CHAIN,
    ENSEMBLE,
    FIT,
    FOLDS,
    LAWS,
    MANIFEST,
    NEAR_SETS,
    RANKING,
    RESULTS,
)
from tools.fuzzing import trial
from tools.fuzzing.harness import Harness
from tools.fuzzing.mutants import _CHANGES, Structure, mutant
from tools.fuzzing.reader import Reader, Seed
from tools.fuzzing.readers import all_readers

PATIENCE = 240.0
WHOLE = {
    "text": b"t_s,displacement_mm,force_N\n0.0,1.0,2.0\n0.1,1.5,2.5\n",
    "json": b'{"a": [1.0, 2.0], "b": {"c": "text", "d": null}}',
    "toml": b'title = "a"\n[table]\nkey = 1.0\n[[more]]\nname = "b"\n',
}
# JAX has threads, where another test has loaded it.
forking = pytest.mark.filterwarnings("ignore:os.fork")


@pytest.mark.parametrize("structure", _CHANGES)
def test_a_mutant_can_be_made_again_from_its_seed_and_number(structure: Structure) -> None:
    content = WHOLE.get(structure, bytes(range(256)) * 4)

    def made(name: str) -> list[bytes]:
        return [mutant(name, structure, content, [content], number) for number in range(200)]

    assert made("a") == made("a") != made("b")
    assert len(set(made("a"))) > 100


def failing(path: Path) -> object:
    raise KeyError("a")


def panicking(path: Path) -> object:
    class PanicError(BaseException):
        """As of the compiled module."""

    raise PanicError("index out of bounds")


def crashing(path: Path) -> object:
    os.kill(os.getpid(), signal.SIGSEGV)
    return None


def hanging(path: Path) -> object:
    while True:
        pass


def swallowing(path: Path) -> object:
    return len(bytearray(2 << 30))


def filling(path: Path) -> object:
    return len(bytearray(b"a") * 100_000_000)


def warning_raw(path: Path) -> object:
    warnings.warn("invalid value", RuntimeWarning, stacklevel=1)
    return None


def silent(path: Path) -> object:
    raise RecordError("")


def refusing(path: Path) -> object:
    raise RecordError("a sentence\nwith a break")


def warning(path: Path) -> object:
    warnings.warn("a sentence", MrworkWarning, stacklevel=1)
    return path.read_bytes()


def tried(tmp_path: Path, read: Callable[[Path], object], **options: object) -> Harness:
    seed = Seed(file="a.csv", content=WHOLE["text"], structure="text")
    reader = Reader(name="reader", read=read, seeds=(seed,), **options)  # type: ignore[arg-type] # settings of several kinds by name
    harness = Harness([reader], 2, n_processes=1, kept=tmp_path / "kept")
    harness.run(lambda line: None)
    return harness


@forking
@pytest.mark.parametrize(
    ("read", "words"),
    [
        (failing, "KeyError"),
        (panicking, "index out of bounds"),
        (crashing, "ended by SIGSEGV"),
        (hanging, "takes too long"),
        (swallowing, "MemoryError"),
        (warning_raw, "RuntimeWarning"),
        (silent, "is empty"),
    ],
)
def test_whatever_is_no_result_and_no_sentence_is_a_failure_and_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, read: Callable[[Path], object], words: str
) -> None:
    monkeypatch.setattr(trial, "SECONDS", 0.2)
    harness = tried(tmp_path, read)
    (row,) = harness.rows
    assert (row.mutants, row.results, row.refusals, row.failures) == (2, 0, 0, 2)
    kept = sorted((tmp_path / "kept").iterdir())
    assert len(kept) == 2
    assert words in (kept[0] / "recipe.json").read_text()
    seed, content = row.reader.mutant(0)
    assert (kept[0] / seed.file).read_bytes() == content
    assert re.search(r"all +2 +0 +0 +0 +2 ", harness.table())


@forking
@pytest.mark.skipif(
    sys.platform != "linux", reason="the memory of a process is limited by the kernel of Linux"
)
def test_memory_beyond_the_limit_is_a_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trial, "BYTES", 64 << 20)
    harness = tried(tmp_path, filling)
    assert (harness.rows[0].failures, harness.rows[0].mutants) == (2, 2)
    assert harness.rows[0].peak > trial.BYTES


@forking
def test_results_refusals_and_our_own_warnings_are_no_failures(tmp_path: Path) -> None:
    assert tried(tmp_path, warning).rows[0].results == 2
    assert tried(tmp_path, refusing).rows[0].refusals == 2


@forking
def test_a_library_in_this_process_may_end_it_as_it_may_end_its_child(tmp_path: Path) -> None:
    (row,) = tried(tmp_path, crashing, in_child=False).rows
    assert (row.ended, row.failures) == (2, 0)


def fuzzing(*options: object) -> list[str]:
    return [sys.executable, "-m", "tools.fuzzing", *map(str, options)]


def environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


def test_no_reader_fails_on_a_few_mutants(tmp_path: Path) -> None:
    ended = ran(
        *fuzzing("--mutants", 1200, "--processes", 1, "--out", tmp_path / "faults"), env=environment()
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "failures" in ended.stdout


def test_ctrl_c_ends_the_harness_with_what_has_been_counted(tmp_path: Path) -> None:
    with subprocess.Popen(
        fuzzing("--mutants", 10**7, "--processes", 1, "--reader", "motions", "--out", tmp_path / "faults"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
    ) as process:
        try:
            assert process.stderr is not None
            assert process.stdout is not None
            assert "mutants" in process.stderr.readline()
            process.send_signal(signal.SIGINT)
            table = process.stdout.read()
            assert process.wait(PATIENCE) == 130
            assert "motions" in table
        finally:
            process.kill()


def test_every_registered_format_has_a_seed() -> None:
    readers = all_readers()
    files = {seed.file for reader in readers for seed in reader.seeds}
    # Libraries that are not required; without one there is nothing to read such a file.
    optional = {"nptdms": ".tdms", "python_calamine": ".xlsx"}
    unread = {extension for library, extension in optional.items() if find_spec(library) is None}
    assert set(EXTENSIONS) - {".pq"} - unread <= {Path(file).suffix for file in files}
    # Files of a run that a verb reads back; the page and the figures are only written.
    named = {Path(file).name for file in files}
    folds = {FOLDS, f"{CHAIN}.part", CHAIN}
    assert (ADDITIONS | {MANIFEST, FIT, RANKING, LAWS, NEAR_SETS, RESULTS, ENSEMBLE}) - folds <= named
    motions = [
        seed.content for reader in readers if reader.name.startswith("motions: ") for seed in reader.seeds
    ]
    for form in FORMATS:
        lines = (Lines(path=Path(), texts=tuple(each.decode("latin-1").splitlines())) for each in motions)
        recognised = [next(known for known in FORMATS if known.recognises(each)) for each in lines]
        assert form in recognised, form.name
