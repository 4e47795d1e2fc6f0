"""A run folder is written whole or not at all, and reads back as the same fit."""

from __future__ import annotations

import io
import json
import math
import os
import resource
import shutil
import struct
import subprocess
import sys
import tempfile
import time
import warnings
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import ran
from report_samples import comparison, fit
from sentences import Refused

from mrwork import load
from mrwork.errors import OutputError, RecordError
from mrwork.identification import Fit
from mrwork.identification.fit_file import manifest_of, read_fit, write_run
from mrwork.store.input_file import finite_numbers, make_stored_kind, read_arrays
from mrwork.store.output_file import Lock
from mrwork.store.output_folder import Destination, check_destination, write_folder
from mrwork.store.run_folder import (
    CALIBRATION,
    DRAWS,
    FIT_RUN,
    JOURNAL,
    LAWS,
    MANIFEST,
    PLAN,
    PREDICTIONS,
    PROFILES,
    RANKING,
    REPORT,
)
from mrwork.store.run_folder import FIT as FIT_FILE
from mrwork.uncertainty.bands.calibration_files import read_predictions

FIT = fit(comparison())
# What is in a journal does not matter to the run folder: any file will do.
STEPS = Path(__file__)


def to(place: Path, *, replace: bool = False) -> Destination:
    return Destination(path=place, kind=FIT_RUN, replace=replace)


def check(place: Path) -> None:
    check_destination(to(place))


def write(
    place: Path,
    described: Fit = FIT,
    *,
    text: str = "report",
    manifest: dict[str, Any] | None = None,
    documents: dict[str, object] | None = None,
    replace: bool = False,
) -> Path:
    """A run with a small document."""
    write_run(
        to(place, replace=replace),
        fit=described,
        manifest={"command": "identify"} if manifest is None else manifest,
        journal=STEPS,
        documents={REPORT: text} if documents is None else documents,
    )
    return place


def contents(folder: Path) -> dict[str, bytes | None]:
    """Every path below `folder`, hidden ones too, with the bytes of the files."""
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }


def test_a_run_holds_everything_and_reads_back_as_the_same_fit(tmp_path: Path) -> None:
    described = fit(comparison(), comparison("second", synthetic=True))
    place = tmp_path / "out" / "run"
    write(place, described, text="ü", manifest={"a": 1})
    assert sorted(path.name for path in place.iterdir()) == [
        "fit.json",
        "journal.jsonl",
        "manifest.json",
        "report.html",
    ]
    assert json.loads((place / REPORT).read_text(encoding="utf-8")) == "ü"
    assert read_fit(place) == described
    assert [path.name for path in place.parent.iterdir()] == ["run"]


def test_numbers_that_are_not_finite_are_null_in_every_file_and_come_back(tmp_path: Path) -> None:
    free = replace(FIT.estimates[0], lower=-math.inf, upper=math.inf)
    described = replace(FIT, estimates=(free, *FIT.estimates[1:]))
    assert math.isinf(described.trace.median[0])
    place = write(
        tmp_path / "run",
        described,
        manifest={"misfit": math.inf, "inner": [math.nan], "path": Path("a")},
    )

    def strictly(text: str) -> Any:
        return json.loads(text, parse_constant=lambda constant: pytest.fail(f"{constant} is not JSON"))

    stated = strictly((place / "manifest.json").read_text())
    assert {name: stated[name] for name in ("misfit", "inner", "path")} == {
        "misfit": None,
        "inner": [None],
        "path": "a",
    }
    strictly((place / "fit.json").read_text())
    again = read_fit(place)
    assert again.estimates == described.estimates
    assert again.trace == described.trace


def test_a_second_run_replaces_the_first_but_keeps_what_a_person_added(tmp_path: Path) -> None:
    place = write(tmp_path / "run", text="first")
    (place / "notes.txt").write_text("oil was warm")
    (place / "photos").mkdir()
    (place / "photos" / "rig.txt").write_text("a photo")
    write(place, text="second")
    assert json.loads((place / REPORT).read_text()) == "second"
    assert (place / "notes.txt").read_text() == "oil was warm"
    assert (place / "photos" / "rig.txt").read_text() == "a photo"
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_documents_of_a_comparison_go_with_the_run_that_replaces_it(tmp_path: Path) -> None:
    place = tmp_path / "run"
    documents = {"ranking.json": {"chosen": "dahl", "elpd": math.nan}, "models/dahl/fit.json": FIT.as_dict()}
    write(place, documents=documents)
    assert json.loads((place / "ranking.json").read_text()) == {"chosen": "dahl", "elpd": None}
    assert json.loads((place / "models" / "dahl" / "fit.json").read_text())["model"] == FIT.model
    write(place)
    assert not (place / "ranking.json").exists()
    assert not (place / "models").exists()


def test_an_empty_folder_and_a_link_may_be_written_to(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    assert read_fit(write(tmp_path / "empty")) == FIT
    link = tmp_path / "latest"
    link.symlink_to(tmp_path / "empty")
    write(link, text="through the link")
    assert link.is_symlink()
    assert json.loads((tmp_path / "empty" / REPORT).read_text()) == "through the link"


def test_others_may_read_a_run_as_far_as_the_umask_allows(tmp_path: Path) -> None:
    earlier = os.umask(0o022)
    try:
        place = write(tmp_path / "run")
    finally:
        os.umask(earlier)
    assert place.stat().st_mode & 0o777 == 0o755
    assert (place / "fit.json").stat().st_mode & 0o777 == 0o644


@pytest.mark.parametrize("action", [write, check])
def test_files_of_others_are_refused_and_left_alone(tmp_path: Path, action: Any, refused: Refused) -> None:
    (tmp_path / "file").write_text("mine")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "thesis.tex").write_text("mine too")
    before = contents(tmp_path)
    refused(action, tmp_path / "file")
    refused(action, tmp_path / "folder")
    refused(action, tmp_path / "file" / "run")
    assert contents(tmp_path) == before


def test_a_destination_is_checked_without_leaving_anything_there(tmp_path: Path) -> None:
    check(tmp_path / "run")
    write(tmp_path / "run")
    before = contents(tmp_path)
    check(tmp_path / "run")
    assert contents(tmp_path) == before


def test_an_interrupt_while_writing_leaves_the_earlier_run(tmp_path: Path) -> None:
    write(tmp_path / "run")
    before = contents(tmp_path)

    class Pressed(type(tmp_path)):  # type: ignore[misc] # the class of this system's paths
        def __fspath__(self) -> str:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_folder(to(tmp_path / "run"), {}, manifest={}, copied={JOURNAL: Pressed("journal")})
    assert contents(tmp_path) == before


# What follows needs limits and failures that only another process can bear. Each script writes a second
# run, with a report of `size` bytes, over the first and prints what became of it.
SCRIPT = """
import errno, os, resource, sys
from pathlib import Path
from report_samples import comparison, fit
from mrwork.identification.fit_file import write_run
from mrwork.store.output_folder import Destination
from mrwork.store.run_folder import FIT_RUN

place, size, failure = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
failures = {"OSError": OSError(errno.EIO, "Input/output error"), "KeyboardInterrupt": KeyboardInterrupt()}

def fail_the_first_rename_into_place(event, arguments):
    if event == "os.rename" and Path(arguments[1]) == place and failures:
        raise failures.pop(failure)

if failure.isdigit():
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(failure), int(failure)))
elif failure:
    failures = {failure: failures[failure]}
    sys.addaudithook(fail_the_first_rename_into_place)
try:
    written = Destination(path=place, kind=FIT_RUN)
    write_run(written, fit=fit(comparison()), documents={"report.html": "x" * size}, manifest={}, journal=os.devnull)
except (OSError, KeyboardInterrupt) as reason:
    print(f"{type(reason).__name__}: {reason}")
else:
    print("written")
"""


def run_script(place: Path, *, size: int, failure: str = "") -> str:
    finished = ran(
        *(sys.executable, "-c", SCRIPT, place, size, failure),
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert finished.returncode == 0, finished.stderr
    return finished.stdout.strip()


@pytest.mark.parametrize("failure", ["OSError", "KeyboardInterrupt"])
def test_a_rename_that_fails_half_way_brings_the_earlier_run_back(tmp_path: Path, failure: str) -> None:
    write(tmp_path / "run")
    before = contents(tmp_path)
    said = run_script(tmp_path / "run", size=10, failure=failure)
    assert said.startswith({"OSError": "OutputError: cannot write"}.get(failure, failure))
    assert contents(tmp_path) == before


def test_a_file_too_large_for_the_limit_leaves_the_earlier_run(tmp_path: Path) -> None:
    if resource.getrlimit(resource.RLIMIT_FSIZE)[1] != resource.RLIM_INFINITY:
        pytest.skip("the file size is already limited here")
    write(tmp_path / "run")
    before = contents(tmp_path)
    said = run_script(tmp_path / "run", size=200_000, failure="100000")
    assert said.startswith(f"OutputError: cannot write the run to {tmp_path / 'run'}: the disk is full; ")
    assert "\n" not in said
    assert contents(tmp_path) == before
    assert run_script(tmp_path / "run", size=50_000, failure="100000") == "written"


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A real file system of 300 kB."""
    place = tmp_path / "disk"
    place.mkdir()
    mounted = shutil.which("mount") and subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=300k", "none", str(place)], capture_output=True, check=False
    )
    if not mounted or mounted.returncode != 0:
        pytest.skip("no small disk: mounting a tmpfs is not allowed here")
    try:
        yield place
    finally:
        subprocess.run(["umount", str(place)], check=True)


def test_a_full_disk_leaves_the_earlier_run(small_disk: Path) -> None:
    write(small_disk / "run")
    before = contents(small_disk)
    said = run_script(small_disk / "run", size=400_000)
    assert said.startswith(f"OutputError: cannot write the run to {small_disk / 'run'}: the disk is full; ")
    assert contents(small_disk) == before
    assert read_fit(small_disk / "run") == FIT
    assert run_script(small_disk / "run", size=50_000) == "written"


def test_a_swap_that_fails_leaves_the_earlier_run(small_disk: Path, refused: Refused) -> None:
    # The root of a mounted disk cannot be renamed: everything is written before that shows.
    write(small_disk / "run")
    for entry in (small_disk / "run").iterdir():
        entry.rename(small_disk / entry.name)
    (small_disk / "run").rmdir()
    before = contents(small_disk.parent)
    refused(write, small_disk)
    assert contents(small_disk.parent) == before
    assert read_fit(small_disk) == FIT


def test_a_folder_that_may_not_be_written_to_is_named() -> None:
    with tempfile.TemporaryDirectory() as made:
        locked = Path(made)
        locked.chmod(0o555)
        user = os.geteuid()
        if user == 0:
            # Root may write anywhere; nobody may not.
            os.seteuid(65534)
        try:
            for action in (write, check):
                with pytest.raises(OutputError) as caught:
                    action(locked / "run")
                assert str(caught.value).startswith(
                    f"cannot write the run to {locked / 'run'}: Permission denied;"
                )
        finally:
            os.seteuid(user)
        assert contents(locked) == {}
        locked.chmod(0o755)


def damaged(change: Any) -> bytes:
    document = json.loads(json.dumps(replace(FIT, trace=replace(FIT.trace, median=FIT.trace.best)).as_dict()))
    change(document)
    return json.dumps(document).encode()


def test_a_damaged_fit_is_refused_with_the_place_named(tmp_path: Path, refused: Refused) -> None:
    place = write(tmp_path / "run")
    for content in (
        *(b"\xff\xfe\x00", b"[]", b"{}"),
        damaged(lambda fit: fit.update(status="fine")),
        damaged(lambda fit: fit.update(evaluations=1.5)),
        damaged(lambda fit: fit.update(evaluations=True)),
        damaged(lambda fit: fit["estimates"][2].update(value="big")),
        damaged(lambda fit: fit.update(estimates=[])),
        damaged(lambda fit: fit["estimates"].pop()),
        damaged(lambda fit: fit["estimates"][0].update(name="d")),
        damaged(lambda fit: fit["estimates"][0].update(value=None)),
        damaged(lambda fit: fit["estimates"][0].update(value=1e9)),
        damaged(lambda fit: fit["estimates"][0].update(standard_error=-1.0)),
        damaged(lambda fit: fit.update(estimates=None)),
        damaged(lambda fit: fit.update(model="bingam")),
        damaged(lambda fit: fit.update(nrmse=10**400)),
        b'{"model": ' + b"[" * 5000 + b"]" * 5000 + b"}",
        damaged(lambda fit: fit["error_norms"].pop("time")),
        damaged(lambda fit: fit["provenance"]["inputs"].update(a=1)),
    ):
        (place / FIT_FILE).write_bytes(content)
        refused(read_fit, place)
    (place / FIT_FILE).unlink()
    refused(read_fit, place)


@pytest.mark.parametrize("name", [FIT_FILE, MANIFEST, PROFILES, PLAN, CALIBRATION, RANKING, LAWS, DRAWS])
def test_a_folder_in_the_place_of_a_file_of_the_run_is_refused_by_its_name(
    tmp_path: Path, name: str, refused: Refused
) -> None:
    place = write(tmp_path / "run")
    (place / name).unlink(missing_ok=True)
    (place / name).mkdir()
    refused(load, place)


@pytest.mark.parametrize("name", [FIT_FILE, PROFILES, PLAN, CALIBRATION, RANKING, LAWS])
@pytest.mark.parametrize("content", [b"\xff\xfe", b"", b"[", b"[]", b"{}", b"null", b"NaN", b"[" * 9999])
def test_damaged_documents_of_a_run_are_refused_by_their_name(
    tmp_path: Path, name: str, content: bytes
) -> None:
    place = write(tmp_path / "run")
    (place / name).write_bytes(content)
    with pytest.raises(RecordError, match=name) as caught:
        load(place)
    assert "again" in str(caught.value)


def test_predictions_that_are_cut_or_forged_are_refused(tmp_path: Path, refused: Refused) -> None:
    path = tmp_path / PREDICTIONS
    np.savez_compressed(path, facts=np.array("[{}]"), model_0=np.zeros(100))
    whole = path.read_bytes()
    forged = io.BytesIO()
    with zipfile.ZipFile(forged, "w") as archive:
        header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }\n"
        archive.writestr("facts.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header)
    for content in (*(whole[:length] for length in range(0, len(whole), 7)), whole, forged.getvalue()):
        path.write_bytes(content)
        refused(read_predictions, tmp_path)


@pytest.mark.parametrize(
    "header",
    [
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (2L,)}",
        b"{'descr': '<f8', 'fortran_order': False, 'sh\\/pe': (2,)}",
        b"{'descr': '<\x1b[31m', 'fortran_order': False, 'shape': (2,)}",
    ],
)
def test_headers_that_numpy_does_not_write_are_refused_without_its_warnings(
    tmp_path: Path, header: bytes
) -> None:
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w") as archive:
        content = header.ljust(117) + b"\n"
        archive.writestr(
            "force.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(content)) + content + bytes(16)
        )
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        with pytest.raises(RecordError, match=r"a\.npz is damaged") as caught:
            read_arrays(path, make_stored_kind("calibrate"))
    assert not said
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    "wrong",
    [
        np.frombuffer(b"\xff" * 8, "<f4"),
        np.array([1.0, np.inf]),
        np.array([1.0 + 1.0j, 0.0]),
        np.array([1, 2]),
        np.array(["a", "b"]),
        np.array([1.0, 2.0], np.float16),
        np.frombuffer(b"\x01" * 32, np.longdouble),
    ],
)
def test_arrays_of_other_values_than_finite_numbers_are_refused(
    tmp_path: Path, wrong: np.ndarray, refused: Refused
) -> None:
    np.savez(tmp_path / "a.npz", force=wrong, time=np.arange(2.0))
    arrays = read_arrays(tmp_path / "a.npz", make_stored_kind("calibrate"))
    assert finite_numbers(arrays, "time").tolist() == [0.0, 1.0]
    for name in ("force", "velocity"):
        refused(finite_numbers, arrays, name)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("model", "bingham"),
        ("model", None),
        ("status", "stopped"),
        ("estimates", {each.name: 1.01 * each.value for each in FIT.estimates}),
        ("estimates", []),
        ("laws", ["linear"]),
        ("inputs", {"another.csv": "0" * 64}),
        ("rng", 17),
        ("settings", {}),
        ("versions", []),
        ("created", "\x1b[31m" + "long " * 50),
    ],
)
def test_a_manifest_of_another_run_is_refused(tmp_path: Path, name: str, value: object) -> None:
    def written(manifest: dict[str, object]) -> Path:
        return write(tmp_path / "run", manifest=manifest)

    stated = manifest_of(FIT, FIT.status)
    for status in (FIT.status, "interrupted"):
        assert read_fit(written({**stated, "status": status, "of the user": [1]})) == FIT
    assert value != stated[name]
    with pytest.raises(
        RecordError, match=rf"manifest\.json is of another run than fit\.json .* {name} is"
    ) as caught:
        read_fit(written({**stated, name: value}))
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize("content", ["[]", "null", '"identification"', "3", "{", '{"kind": 1, "kind": 2}'])
def test_a_damaged_manifest_is_refused_by_its_name(tmp_path: Path, content: str) -> None:
    place = write(tmp_path / "run")
    (place / MANIFEST).write_text(content)
    with pytest.raises(RecordError, match=r"manifest\.json is not"):
        read_fit(place)


def test_what_is_not_a_run_is_refused(tmp_path: Path, refused: Refused) -> None:
    (tmp_path / "file").write_text("x")
    (tmp_path / "folder").mkdir()
    refused(read_fit, tmp_path / "nothing")
    refused(read_fit, tmp_path / "file")
    refused(read_fit, tmp_path / "folder")


def left_by_a_killed_writer(folder: Path, *, age: float = 3600.0) -> Path:
    """The folder of a writer that was killed between the two renames, and was to replace `run`."""
    left = folder / ".mrwork-killed"
    (left / "new").mkdir(parents=True)
    (left / "old" / "run").mkdir(parents=True)
    (left / "old" / "run" / MANIFEST).write_text("{}")
    os.utime(left, (time.time() - age,) * 2)
    return left


def test_what_a_killed_writer_left_is_removed_and_the_run_that_it_set_aside_put_back(tmp_path: Path) -> None:
    left = left_by_a_killed_writer(tmp_path)
    check(tmp_path / "another")
    assert not left.exists()
    assert (tmp_path / "run" / MANIFEST).read_text() == "{}"


def test_a_run_that_is_there_is_not_replaced_by_one_that_was_set_aside(tmp_path: Path) -> None:
    left = left_by_a_killed_writer(tmp_path)
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / MANIFEST).write_text('{"kind": "identification", "verb": "identify", "newer": 1}')
    check(tmp_path / "run")
    assert not left.exists()
    assert (
        tmp_path / "run" / MANIFEST
    ).read_text() == '{"kind": "identification", "verb": "identify", "newer": 1}'


def test_the_folder_of_a_writer_at_work_stays(tmp_path: Path) -> None:
    left = left_by_a_killed_writer(tmp_path)
    with Lock(left / "writer"):
        os.utime(left, (time.time() - 3600.0,) * 2)
        check(tmp_path / "run")
        assert left.is_dir()
    shutil.rmtree(left)
    left = left_by_a_killed_writer(tmp_path, age=0.0)
    check(tmp_path / "run")
    assert left.is_dir()


@pytest.mark.parametrize("name", ["", "old", "old/run"])
def test_a_link_in_the_place_of_the_folder_of_a_killed_writer_is_not_followed(
    tmp_path: Path, name: str
) -> None:
    target = tmp_path / "precious"
    (target / "old" / "run").mkdir(parents=True)
    (target / "old" / "run" / "thesis.tex").write_text("mine")
    place = tmp_path / "out" / ".mrwork-killed" / name
    place.parent.mkdir(parents=True)
    place.symlink_to(target / name)
    left = tmp_path / "out" / ".mrwork-killed"
    for each in (target, left):
        os.utime(each, (time.time() - 3600.0,) * 2)
    before = contents(target)
    check(tmp_path / "out" / "another")
    assert contents(target) == before
    assert not (tmp_path / "out" / "run").exists()
