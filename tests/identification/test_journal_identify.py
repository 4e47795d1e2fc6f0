"""An identification that is killed at any moment ends, resumed, in the same bits.

A process is killed once; the other moments are journals that end in the middle of a line. `MRWORK_KILL_POINTS` says at
how many moments a process is killed instead.
"""

from __future__ import annotations

import itertools
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from command_line import PATIENCE, mrwork, printed, ran

from mrwork import Journal, identify
from mrwork.errors import JournalError
from mrwork.identification import Fit, Progress
from mrwork.identification.progress import Tally
from mrwork.records import DamperTest
from mrwork.records.reading import synthetic_test
from mrwork.search import EfficientGA, StopRules
from mrwork.store.journal import line_of

KILLED = "MRWORK_KILL_POINTS" in os.environ
N_POINTS = int(os.environ.get("MRWORK_KILL_POINTS", "3"))
SHORT = ["--population", "16", "--generations", "12"]
COMMAND = ["identify", "synthetic:spencer1997", "--every", "4", "--seed", "3", *SHORT]
DESCENTS = ["identify", "synthetic:spencer1997", "--every", "4", "--seed", "3"]


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
    journal = place.with_name(place.name + ".part") / "journal.jsonl"
    give_up = time.monotonic() + PATIENCE
    while process.poll() is None and time.monotonic() < give_up:
        if journal.is_file() and journal.read_bytes().count(b"\n") >= n_lines:
            break
        time.sleep(0.0005)
    time.sleep(delay)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL


@pytest.mark.parametrize("point", range(N_POINTS))
@pytest.mark.parametrize(("command", "uninterrupted"), [(COMMAND, "whole"), (DESCENTS, "descended")])
def test_a_run_that_is_killed_is_resumed_to_the_same_bits(
    tmp_path: Path, request: pytest.FixtureRequest, command: list[str], uninterrupted: str, point: int
) -> None:
    whole: Path = request.getfixturevalue(uninterrupted)
    lines = (whole / "journal.jsonl").read_bytes().splitlines(keepends=True)
    chance = random.Random(point)
    # Each point in a part of the journal of its own, so that all stages are met: somewhere between two of its lines.
    n_lines = int((point + chance.random()) / N_POINTS * len(lines))
    place = tmp_path / "run"
    if KILLED or point == 1:
        seconds = [json.loads(line)["seconds"] for line in lines]
        gap = seconds[n_lines] - (seconds[n_lines - 1] if n_lines else 0.0)
        killed_at(command, place, n_lines, chance.random() * gap)
    else:
        torn = lines[n_lines][: int(chance.random() * len(lines[n_lines]))]
        part_with(tmp_path, b"".join(lines[:n_lines]) + torn)
    assert not place.exists()
    printed(*command, "--out", place, "--resume", "--threads", 1 + point % 2)
    assert found(place) == found(whole)
    assert steps_of(place / "journal.jsonl") == steps_of(whole / "journal.jsonl")
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def part_with(tmp_path: Path, content: bytes) -> Path:
    """A place whose unfinished run has this journal."""
    place = tmp_path / "run"
    (tmp_path / "run.part").mkdir()
    (tmp_path / "run.part" / "journal.jsonl").write_bytes(content)
    return place


def test_a_torn_last_line_is_dropped_with_a_note(whole: Path, tmp_path: Path) -> None:
    place = part_with(tmp_path, (whole / "journal.jsonl").read_bytes()[:-40])
    resumed = mrwork(*COMMAND, "--out", place, "--resume", "--json")
    assert resumed.returncode == 0, resumed.stderr
    assert "is torn" in resumed.stderr
    assert len(resumed.stderr.splitlines()) == 1
    assert found(place) == found(whole)


@pytest.mark.parametrize("count", [{}, -1, True, 1.5, "3", None])
@pytest.mark.parametrize("of", ["simulations", "steps"])
def test_a_journal_holds_counts_that_are_numbers(of: str, count: object) -> None:
    record = Tally(simulations=3, steps=40).as_record()
    Tally().restore(record)
    with pytest.raises(ValueError, match=of):
        Tally().restore({**record, of: count})


def refused(place: Path, arguments: list[str], *words: str) -> None:
    """Exit 2, one sentence, and nothing has changed."""
    before = {path: path.read_bytes() for path in place.parent.rglob("*") if path.is_file()}
    result = mrwork(*arguments, "--out", place, "--resume")
    assert (result.returncode, result.stdout) == (2, ""), result.stderr
    assert len(result.stderr.splitlines()) == 1, result.stderr
    for word in words:
        assert word in result.stderr
    assert {path: path.read_bytes() for path in place.parent.rglob("*") if path.is_file()} == before


def test_a_damaged_line_in_the_middle_is_refused(whole: Path, tmp_path: Path) -> None:
    lines = (whole / "journal.jsonl").read_bytes().splitlines(keepends=True)
    lines[4] = lines[4].replace(b"0.", b"1.", 1)
    refused(part_with(tmp_path, b"".join(lines)), COMMAND, "damaged in line 5")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([*COMMAND, "--seed", "4"], ("seed is 3 there and 4 here",)),
        ([*COMMAND, "--generations", "13"], ("max_generations is 12 there and 13 here",)),
        ([*COMMAND, "--fix", "n=2"], ("bounds.n is absent there",)),
        ([*COMMAND, "--nuisance", "level"], ("nuisances",)),
        ([*COMMAND, "--engine", "optimistix"], ("engine is lanes there and optimistix here",)),
        ([*COMMAND, "--every", "2"], ("test.1.samples", "test.1.signals")),
        ([*COMMAND, "--model", "static_hysteretic"], ("model is normalised_bouc_wen there",)),
        (["identify", "synthetic:spencer1997_slow", *COMMAND[2:]], ("test.1.name", "test.1.sha256")),
    ],
)
def test_a_run_of_something_else_is_refused_by_name(
    whole: Path, tmp_path: Path, arguments: list[str], words: tuple[str, ...]
) -> None:
    place = part_with(tmp_path, (whole / "journal.jsonl").read_bytes())
    refused(place, arguments, "another identification", *words)


def test_a_journal_from_before_there_were_engines_is_refused(whole: Path, tmp_path: Path) -> None:
    first, *others = (whole / "journal.jsonl").read_bytes().splitlines(keepends=True)
    header = json.loads(first)
    del header["crc32"], header["facts"]["engine"]
    part = part_with(tmp_path, b"".join([line_of(header), *others]))
    refused(part, COMMAND, "another identification", "engine is absent there and lanes here")


def test_without_a_journal_there_is_nothing_to_resume(tmp_path: Path) -> None:
    refused(tmp_path / "run", COMMAND, "no journal to resume", "run without --resume")
    assert list(tmp_path.iterdir()) == []


def test_a_refused_resumption_leaves_a_finished_run_alone(whole: Path, tmp_path: Path) -> None:
    shutil.copytree(whole, tmp_path / "run")
    refused(tmp_path / "run", [*COMMAND, "--seed", "4"], "seed is 3 there and 4 here")


def test_an_earlier_run_outlives_a_new_one_that_is_killed(whole: Path, tmp_path: Path) -> None:
    place = tmp_path / "run"
    shutil.copytree(whole, place)
    before = found(place)
    killed = [*COMMAND, "--seed", "4"]
    process = subprocess.Popen([sys.executable, "-m", "mrwork", *killed, "--out", str(place)])
    journal = tmp_path / "run.part" / "journal.jsonl"
    give_up = time.monotonic() + PATIENCE
    while not journal.is_file() and time.monotonic() < give_up:
        time.sleep(0.001)
    process.kill()
    process.wait()
    assert found(place) == before


# Ctrl-C comes from the program itself, when it loads the optimiser of the last stage: the run is surely still going.
INTERRUPTED = """
import os, signal, sys

def interrupt(event, arguments):
    if event == "import" and arguments[0] == "scipy.optimize":
        os.kill(os.getpid(), signal.SIGINT)

sys.addaudithook(interrupt)
from mrwork.cli import main
main(sys.argv[1:])
"""


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
    return synthetic_test("spencer1997")


SEARCH = EfficientGA(population=16, stop=StopRules(max_generations=12))


def test_a_joint_identification_is_journalled_at_each_command(record: DamperTest, tmp_path: Path) -> None:
    from mrwork.dampers import damper

    spec = damper("static_hysteretic").with_current_laws({"alpha": "linear", "c": "linear"}, unit="A")
    tests = [
        replace(record, name=f"at {current} A", current=current, force=(1.0 + current) * record.force)
        for current in (0.0, 0.5, 1.0)
    ]
    path = tmp_path / "journal.jsonl"
    simulated: list[int] = []

    def identified(journal: Journal | None) -> Fit:
        simulated.clear()
        fit = identify(
            spec,
            tests,
            search=SEARCH,
            rng=2,
            journal=journal,
            on_progress=lambda progress: simulated.append(1),
        )
        if journal is not None:
            journal.close()
        return fit

    without = identified(None)
    n_events = len(simulated)
    assert (identified(Journal(path)).theta, len(simulated)) == (without.theta, n_events)
    lines = path.read_bytes().splitlines(keepends=True)
    kinds = [json.loads(line)["step"] for line in lines]
    n_generations = 12
    assert kinds.count("generation") == n_generations * len({test.current for test in tests})
    assert kinds.count("iteration") > 20
    for kept in (8, 20, len(lines)):
        path.write_bytes(b"".join(lines[:kept]))
        resumed = identified(Journal(path, resume=True))
        assert (resumed.theta, resumed.evaluations) == (without.theta, without.evaluations)
        assert len(simulated) < n_events


@pytest.mark.parametrize(("stage", "least"), [("search", 3), ("screening", 3), ("refinement", 1)])
def test_a_callback_may_stop_the_run_and_it_goes_on(
    record: DamperTest, tmp_path: Path, stage: str, least: int
) -> None:
    path = tmp_path / "journal.jsonl"
    seen: list[Progress] = []

    def enough(progress: Progress) -> bool:
        seen.append(progress)
        return progress.stage == stage and progress.count >= least

    journal = Journal(path)
    stopped = identify("static_hysteretic", record, search=SEARCH, rng=2, on_progress=enough, journal=journal)
    journal.close()
    assert stopped.status == "stopped"
    assert stopped.stop_reason == ("callback" if stage == "search" else "max_generations")
    assert all(estimate.standard_error is None for estimate in stopped.estimates)
    assert seen[-1].stage == stage
    journal = Journal(path, resume=True)
    resumed = identify("static_hysteretic", record, search=SEARCH, rng=2, journal=journal)
    journal.close()
    whole = identify("static_hysteretic", record, search=SEARCH, rng=2)
    assert (resumed.theta, resumed.evaluations, resumed.status) == (
        whole.theta,
        whole.evaluations,
        whole.status,
    )
    assert resumed.trace == whole.trace


def test_a_fit_by_optimistix_is_recalled(record: DamperTest, tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    stages: list[str] = []

    def identified(*, resume: bool) -> Fit:
        stages.clear()
        journal = Journal(path, resume=resume)
        fit = identify(
            "static_hysteretic",
            record,
            search=SEARCH,
            engine="optimistix",
            rng=2,
            on_progress=lambda progress: stages.append(progress.stage),
            journal=journal,
        )
        journal.close()
        return fit

    first = identified(resume=False)
    assert "refinement" in stages
    again = identified(resume=True)
    assert stages == []
    assert (again.theta, again.refinement_steps) == (first.theta, first.refinement_steps)


def test_progress_tells_generation_median_and_what_was_simulated(record: DamperTest) -> None:
    seen: list[Progress] = []
    fit = identify("static_hysteretic", record, search=SEARCH, rng=2, on_progress=seen.append)
    searching = [progress for progress in seen if progress.stage == "search"]
    assert [progress.generation for progress in searching] == list(range(1, 13))
    assert [progress.evaluations for progress in searching] == list(fit.trace.evaluations)
    assert [progress.median_percent for progress in searching] == pytest.approx(
        [100.0 * (1.0 - median) for median in fit.trace.median], nan_ok=True
    )
    # At least one sub-step for each sample of each candidate.
    assert all(progress.steps >= progress.evaluations * record.n_time for progress in searching)
    assert all(one.steps <= other.steps for one, other in itertools.pairwise(seen))


def test_a_journal_of_other_data_is_refused(record: DamperTest, tmp_path: Path) -> None:
    journal = Journal(tmp_path / "journal.jsonl")
    identify(
        "static_hysteretic", record, search=SEARCH, rng=2, on_progress=lambda progress: True, journal=journal
    )
    journal.close()
    heavier = replace(record, force=1.001 * record.force)
    journal = Journal(tmp_path / "journal.jsonl", resume=True)
    with pytest.raises(JournalError, match=r"test\.1\.signals"):
        identify("static_hysteretic", heavier, search=SEARCH, rng=2, journal=journal)
    journal.close()
