"""An identification that is killed at any moment ends, resumed, in the same bits.

A process is killed once; the other moments are journals that end in the middle of a line.
"""

from __future__ import annotations

import json
import random
import shutil
import signal
import subprocess
import sys
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from command_line import PATIENCE, printed, ran
from refusals import command_refusal

from mrwork import Journal, identify
from mrwork.dampers import damper
from mrwork.identification import Fit, Progress
from mrwork.records import DamperTest, cut
from mrwork.records.reading import synthetic_test
from mrwork.search import EfficientGA, StopRules

N_POINTS = 3
SHORT = ["--population", "16", "--generations", "12"]
COMMAND = ["identify", "synthetic:spencer1997", "--every", "16", "--seed", "3", *SHORT]
DESCENTS = ["identify", "synthetic:spencer1997", "--every", "16", "--seed", "3"]


def found(place: Path) -> dict[str, str]:
    """All that a fit says but for times; `repr` of the numbers, for it tells every bit."""
    fit = json.loads((place / "fit.json").read_text())
    fit.pop("seconds")
    provenance = fit.pop("provenance")
    return {key: repr(value) for key, value in fit.items()} | {"rng": repr(provenance["rng"])}


def steps_of(journal: Path) -> list[dict[str, Any]]:
    """Lines of a journal without what a clock says, or what depends on the threads: steps before one is abandoned."""
    steps = [json.loads(line) for line in journal.read_text().splitlines()]
    for step in steps:
        step.pop("seconds")
        step.pop("crc32")
        step.get("result", {}).pop("search_seconds", None)
        step["counters"] = step.get("counters", {}).get("simulations")
    return steps


def finished(command: list[str], folder: Path) -> Path:
    """The run folder of a run that nothing interrupted."""
    printed(*command, "--out", folder / "run")
    return folder / "run"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A genetic search, then local minimisations one by one."""
    return finished(COMMAND, tmp_path_factory.mktemp("genetic"))


@pytest.fixture(scope="module")
def descended(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Descents from many starts, side by side."""
    return finished(DESCENTS, tmp_path_factory.mktemp("descents"))


def killed_at(command: list[str], place: Path, n_lines: int, delay: float) -> None:
    """Begin a run and kill it after its journal has a number of lines and a further delay."""
    process = subprocess.Popen(
        [sys.executable, "-m", "mrwork", *command, "--out", str(place)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    journal = place / "journal.jsonl"
    give_up = time.monotonic() + PATIENCE
    while process.poll() is None and time.monotonic() < give_up:
        if journal.is_file() and journal.read_bytes().count(b"\n") >= n_lines:
            break
        time.sleep(0.0005)
    time.sleep(delay)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL


@pytest.mark.long
@pytest.mark.parametrize(
    ("command", "uninterrupted", "point"),
    [
        (COMMAND, "whole", 0),
        pytest.param(COMMAND, "whole", 1, marks=pytest.mark.machine),
        (DESCENTS, "descended", 2),
    ],
)
def test_a_run_that_is_killed_is_resumed_to_the_same_bits(
    tmp_path: Path, request: pytest.FixtureRequest, command: list[str], uninterrupted: str, point: int
) -> None:
    whole: Path = request.getfixturevalue(uninterrupted)
    lines = (whole / "journal.jsonl").read_bytes().splitlines(keepends=True)
    chance = random.Random(point)
    # Each point in a part of the journal of its own, so that all stages are met: somewhere between two of its lines.
    n_lines = int((point + chance.random()) / N_POINTS * len(lines))
    place = tmp_path / "run"
    if point == 1:
        seconds = [json.loads(line)["seconds"] for line in lines]
        gap = seconds[n_lines] - (seconds[n_lines - 1] if n_lines else 0.0)
        killed_at(command, place, n_lines, chance.random() * gap)
    else:
        torn = lines[n_lines][: int(chance.random() * len(lines[n_lines]))]
        part_with(tmp_path, b"".join(lines[:n_lines]) + torn)
    printed(*command, "--out", place, "--resume", "--threads", 1 + point % 2)
    assert found(place) == found(whole)
    assert steps_of(place / "journal.jsonl") == steps_of(whole / "journal.jsonl")
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def part_with(tmp_path: Path, content: bytes) -> Path:
    """A place whose unfinished run has this journal."""
    place = tmp_path / "run"
    place.mkdir()
    (place / "journal.jsonl").write_bytes(content)
    return place


def refused(place: Path, arguments: list[object], word: str) -> None:
    """Exit 2, the word, and nothing has changed."""
    before = {path: path.read_bytes() for path in place.parent.rglob("*") if path.is_file()}
    command_refusal(*arguments, "--out", place, "--resume", match=word)
    assert {path: path.read_bytes() for path in place.parent.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--seed", "4"], "another identification.* seed is 3 there and 4 here"),
        (["--fix", "n=2"], "bounds.n is absent there"),
        (["--every", "4"], "test.1.samples"),
        (["--model", "static_hysteretic"], "model is normalised_bouc_wen there"),
    ],
)
def test_a_run_of_something_else_is_refused_by_name(
    whole: Path, tmp_path: Path, arguments: list[str], word: str
) -> None:
    refused(part_with(tmp_path, (whole / "journal.jsonl").read_bytes()), [*COMMAND, *arguments], word)


def test_a_resumption_of_nothing_and_one_over_a_finished_run_change_nothing(
    whole: Path, tmp_path: Path
) -> None:
    refused(tmp_path / "run", [*COMMAND], "no journal.jsonl to resume")
    shutil.copytree(whole, tmp_path / "run")
    refused(tmp_path / "run", [*COMMAND, "--seed", "4"], "seed is 3 there and 4 here")


def test_a_line_that_was_changed_is_refused(whole: Path, tmp_path: Path) -> None:
    lines = (whole / "journal.jsonl").read_bytes().splitlines(keepends=True)
    lines[4] = lines[4].replace(b"0.", b"1.", 1)
    refused(part_with(tmp_path, b"".join(lines)), [*COMMAND], "damaged in line 5")


# Ctrl-C comes from the program itself, when the last stage begins: the run is surely still going.
INTERRUPTED = """
import os, signal, sys
from mrwork.cli import main
from mrwork.identification.minimise import polish

find_minima = polish.find_minima

def interrupted(*arguments, **settings):
    os.kill(os.getpid(), signal.SIGINT)
    return find_minima(*arguments, **settings)

polish.find_minima = interrupted
main(sys.argv[1:])
"""


@pytest.mark.machine
def test_after_ctrl_c_the_run_goes_on(whole: Path, tmp_path: Path) -> None:
    place = tmp_path / "run"
    interrupted = ran(sys.executable, "-c", INTERRUPTED, *COMMAND, "--out", place)
    assert interrupted.returncode == 130, interrupted.stderr
    assert "with --resume to continue" in interrupted.stderr
    assert json.loads((place / "fit.json").read_text())["status"] == "interrupted"
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
    printed(*COMMAND, "--out", place, "--resume")
    assert found(place) == found(whole)


# From Python


@pytest.fixture(scope="module")
def record() -> DamperTest:
    return cut(synthetic_test("spencer1997"), every=4)


SEARCH = EfficientGA(population=16, stop=StopRules(max_generations=12))


@pytest.mark.long
def test_a_joint_identification_is_journalled_at_each_command(record: DamperTest, tmp_path: Path) -> None:
    spec = damper("static_hysteretic").with_current_laws({"alpha": "linear", "c": "linear"}, unit="A")
    tests = [
        replace(record, name=f"at {current} A", current=current, force=(1.0 + current) * record.force)
        for current in (0.0, 0.5, 1.0)
    ]
    path = tmp_path / "journal.jsonl"
    told: list[Progress] = []

    def identified(journal: Journal | None) -> Fit:
        told.clear()
        fit = identify(spec, tests, search=SEARCH, rng=2, journal=journal, on_progress=told.append)
        if journal is not None:
            journal.close()
        return fit

    without = identified(None)
    n_events = len(told)
    assert (identified(Journal(path)).theta, len(told)) == (without.theta, n_events)
    lines = path.read_bytes().splitlines(keepends=True)
    kinds = [json.loads(line)["step"] for line in lines]
    n_generations = 12
    assert kinds.count("generation") == n_generations * len({test.current for test in tests})
    assert kinds.count("iteration") > 20
    for kept in (8, len(lines)):
        path.write_bytes(b"".join(lines[:kept]))
        resumed = identified(Journal(path, resume=True))
        assert (resumed.theta, resumed.evaluations) == (without.theta, without.evaluations)
        assert len(told) < n_events


@pytest.fixture(scope="module")
def static(record: DamperTest) -> Fit:
    return identify("static_hysteretic", record, search=SEARCH, rng=2)


@pytest.mark.parametrize(("stage", "least"), [("search", 3), ("screening", 3), ("refinement", 1)])
def test_a_callback_may_stop_the_run_and_it_goes_on(
    record: DamperTest, static: Fit, tmp_path: Path, stage: str, least: int
) -> None:
    path = tmp_path / "journal.jsonl"
    seen: list[Progress] = []

    def enough(progress: Progress) -> bool:
        seen.append(progress)
        return progress.stage == stage and progress.count >= least

    settings = {"search": SEARCH, "rng": 2}
    with closing(Journal(path)) as journal:
        stopped = identify("static_hysteretic", record, **settings, on_progress=enough, journal=journal)
    assert stopped.status == "stopped"
    assert stopped.stop_reason == ("callback" if stage == "search" else "max_generations")
    assert all(estimate.standard_error is None for estimate in stopped.estimates)
    assert seen[-1].stage == stage
    with closing(Journal(path, resume=True)) as journal:
        resumed = identify("static_hysteretic", record, **settings, journal=journal)
    for name in ("theta", "evaluations", "status", "trace"):
        assert getattr(resumed, name) == getattr(static, name)


def test_a_fit_by_optimistix_is_recalled(record: DamperTest, tmp_path: Path) -> None:
    stages: list[str] = []
    settings = {"search": SEARCH, "engine": "optimistix", "rng": 2}

    def identified(*, resume: bool) -> Fit:
        with closing(Journal(tmp_path / "journal.jsonl", resume=resume)) as journal:
            return identify(
                *("static_hysteretic", record),
                **settings,
                on_progress=lambda progress: stages.append(progress.stage),
                journal=journal,
            )

    first = identified(resume=False)
    assert "refinement" in stages
    stages.clear()
    again = identified(resume=True)
    assert stages == []
    assert (again.theta, again.refinement_steps) == (first.theta, first.refinement_steps)
