"""A run folder is written whole or not at all, and reads back as the same fit."""

from __future__ import annotations

import json
import math
import os
import resource
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from refusals import refusal
from report_samples import comparison, fit

from mrwork.identification import Fit
from mrwork.identification.fit_file import manifest_of, read_fit, write_run
from mrwork.store.output_file import Lock
from mrwork.store.output_folder import Destination, check_destination
from mrwork.store.run_folder import FIT as FIT_FILE
from mrwork.store.run_folder import FIT_RUN, MANIFEST, REPORT

FIT = fit(comparison())
# What is in a journal does not matter to the run folder: any file will do.
STEPS = Path(__file__)


def to(place: Path) -> Destination:
    return Destination(path=place, kind=FIT_RUN)


def write(
    place: Path, described: Fit = FIT, *, text: str = "report", manifest: dict[str, Any] | None = None
) -> Path:
    """A run with a small document."""
    stated = {"command": "identify"} if manifest is None else manifest
    write_run(to(place), fit=described, manifest=stated, journal=STEPS, documents={REPORT: text})
    return place


def contents(folder: Path) -> dict[str, bytes | None]:
    """Every path below `folder`, hidden ones too, with the bytes of the files."""
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }


@pytest.mark.contract
def test_a_run_reads_back_as_the_same_fit_and_leaves_nothing_beside_it(tmp_path: Path) -> None:
    described = fit(comparison(), comparison("second", synthetic=True))
    place = write(tmp_path / "out" / "run", described, text="ü")
    assert json.loads((place / REPORT).read_text(encoding="utf-8")) == "ü"
    assert read_fit(place) == described
    assert [path.name for path in place.parent.iterdir()] == ["run"]


@pytest.mark.contract
def test_numbers_that_are_not_finite_are_null_in_every_file_and_come_back(tmp_path: Path) -> None:
    free = replace(FIT.estimates[0], lower=-math.inf, upper=math.inf)
    described = replace(FIT, estimates=(free, *FIT.estimates[1:]))
    assert math.isinf(described.trace.median[0])
    facts = {"misfit": math.inf, "inner": [math.nan], "path": Path("a")}
    place = write(tmp_path / "run", described, manifest=facts)

    def strictly(name: str) -> Any:
        text = (place / name).read_text()
        return json.loads(text, parse_constant=lambda constant: pytest.fail(f"{constant} is not JSON"))

    assert strictly(MANIFEST).items() >= {"misfit": None, "inner": [None], "path": "a"}.items()
    strictly(FIT_FILE)
    again = read_fit(place)
    assert again.estimates == described.estimates
    assert again.trace == described.trace


def test_an_empty_folder_and_a_link_may_be_written_to_and_others_may_read_it(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "latest").symlink_to("empty")
    earlier = os.umask(0o022)
    try:
        write(tmp_path / "latest")
    finally:
        os.umask(earlier)
    assert read_fit(tmp_path / "empty") == FIT
    assert (tmp_path / "empty").stat().st_mode & 0o777 == 0o755
    assert (tmp_path / "empty" / FIT_FILE).stat().st_mode & 0o777 == 0o644


# What fails while a second run is written over a first


@pytest.mark.parametrize(
    "failure", [OSError("no"), KeyboardInterrupt()], ids=lambda each: type(each).__name__
)
def test_a_rename_that_fails_half_way_brings_the_earlier_run_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failure: BaseException
) -> None:
    place, rename, failures = write(tmp_path / "run"), os.rename, [failure]
    before = contents(tmp_path)

    def fail_once(source: Any, target: Any, **options: Any) -> None:
        if Path(target) == place and failures:
            raise failures.pop()
        rename(source, target, **options)

    monkeypatch.setattr(os, "rename", fail_once)
    with pytest.raises((KeyboardInterrupt, OSError)):
        write(place, text="second")
    assert not failures
    assert contents(tmp_path) == before


def test_a_full_disk_leaves_the_earlier_run(tmp_path: Path) -> None:
    place = write(tmp_path / "run")
    before, limits = contents(tmp_path), resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, limits[1]))
    try:
        refusal(write, place, text="x" * 200_000, match="the disk is full; free some space")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert contents(tmp_path) == before
    write(place, text="x" * 200_000)


@pytest.mark.parametrize("is_there", [False, True])
def test_what_a_killed_writer_left_is_removed_and_a_run_without_successor_put_back(
    tmp_path: Path, is_there: bool
) -> None:
    # It was killed between the two renames.
    left = tmp_path / ".mrwork-killed"
    write(left / "old" / "run", text="old")
    with Lock(left / "writer"):
        os.utime(left, (time.time() - 3600.0,) * 2)
        check_destination(to(tmp_path / "another"))
        assert left.is_dir(), "it is at work"
    os.utime(left, (time.time() - 3600.0,) * 2)
    if is_there:
        write(tmp_path / "run", text="new")
    check_destination(to(tmp_path / "another"))
    assert not left.exists()
    assert json.loads((tmp_path / "run" / REPORT).read_text()) == ("new" if is_there else "old")


# What is read back


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (lambda fit: fit.update(status="fine"), "fit.status"),
        (lambda fit: fit["estimates"][0].update(name="d"), "its estimates are of"),
        (lambda fit: fit["estimates"][0].update(value=1e9), "outside its bounds"),
        (lambda fit: fit["error_norms"].pop("time"), "lacks time"),
    ],
)
def test_a_fit_that_contradicts_itself_is_refused(
    tmp_path: Path, change: Callable[[Any], object], match: str
) -> None:
    place = write(tmp_path / "run")
    change(document := json.loads((place / FIT_FILE).read_text()))
    (place / FIT_FILE).write_text(json.dumps(document))
    refusal(read_fit, place, match=match)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("model", "bingham"),
        ("status", "stopped"),
        ("estimates", {each.name: 1.01 * each.value for each in FIT.estimates}),
        ("inputs", {"another.csv": "0" * 64}),
    ],
)
def test_a_manifest_of_another_run_is_refused(tmp_path: Path, name: str, value: object) -> None:
    stated = manifest_of(FIT, FIT.status)
    assert read_fit(write(tmp_path / "run", manifest={**stated, "of the user": [1]})) == FIT
    write(tmp_path / "run", manifest={**stated, name: value})
    assert len(str(refusal(read_fit, tmp_path / "run", match=f"another run than .* {name} is"))) < 400
