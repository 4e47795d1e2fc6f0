"""Long verbs that are killed, interrupted or out of disk: the earlier results stay, and the verb goes on to the same.

A process sends the signal to itself, at one of the files, folders or lines of journals that it is about to make: a
moment that no load of the machine moves.
"""

import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import chdir
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import tuning_samples
from command_line import Ended, mrwork, ran
from record_files import write_test
from sinusoidal_tests import MOTIONS, sinusoidal_test

import mrwork as mr
from mrwork.store.journal import n_steps


def fit_of(run: Any) -> object:
    return run.fit.model, run.fit.theta


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """Words that write into the folder `run`, those before them, and the part of the results that the words change."""

    words: str
    before: str
    part: Callable[[Any], object] = fit_of
    resume: tuple[str, ...] = ("--resume",)


FIT = "identify rig --model viscous_dahl --fix k_x=800 --every 4 --threads 1 --out run"
ONE = "identify rig/0.csv --model bingham --every 4 --threads 1 --out run"
JOBS = {
    "identify": Job(words="identify rig/0.csv --model bouc_wen --threads 1 --out run", before=ONE),
    "laws": Job(words=f"{FIT} --law auto", before=ONE),
    "models": Job(words="identify rig --model viscous_dahl,dahl --every 4 --threads 1 --out run", before=ONE),
    "posterior": Job(
        words="intervals run --posterior --walkers 16 --steps 60 --threads 1",
        before=FIT,
        part=lambda run: None if run.draws is None else run.draws.theta.tolist(),
    ),
    "calibrate": Job(
        words="calibrate run --threads 1", before=FIT, part=lambda run: run.calibration, resume=()
    ),
    "intervals": Job(
        words="intervals run --threads 1",
        before=FIT,
        part=lambda run: re.sub(r"simulations, [\d.]+ s", "", repr(run.profiles)),
        resume=(),
    ),
    "plan": Job(words="plan run --threads 1", before=FIT, part=lambda run: repr(run.plan), resume=()),
    "respond": Job(
        words="respond study.toml --motions all --check-step --threads 1 --out run",
        before="respond study.toml --seed 3 --threads 1 --out run",
        part=lambda run: {name: array.tobytes() for name, array in run.criteria_of_runs.numbers.items()},
    ),
    "tune": Job(
        words="tune study.toml --threads 1 --out run",
        before="tune study.toml --quick --seed 3 --threads 1 --out run",
        part=lambda run: [(law.settings, run.judgement(law, "test")) for law in run.tuned.laws],
    ),
}
# Signals itself at the file, folder or line of a journal of that number that it is about to make; 0 is none.
PROGRAM = """
import os, signal, sys
from blank_pictures import no_pages
from mrwork.cli import main
from mrwork.store.journal import Journal

number, point = int(sys.argv[1]), int(sys.argv[2])
del sys.argv[1:3]
here, events = os.getcwd(), 0

def step():
    global events
    events += 1
    if events == point:
        os.kill(os.getpid(), number)

def watch(event, arguments):
    if event == "open" and not (isinstance(arguments[2], int) and arguments[2] & (os.O_WRONLY | os.O_RDWR)):
        return
    if event not in ("open", "os.mkdir") or not isinstance(arguments[0], (str, os.PathLike)):
        return
    if os.path.abspath(arguments[0]).startswith(here):
        step()

def write(journal, lines, written=Journal._write):
    step()
    written(journal, lines)

sys.addaudithook(watch)
Journal._write = write
try:
    with no_pages():
        main()
finally:
    print(events, file=sys.stderr)
"""


def signalled(job: Job, folder: Path, number: int, point: int) -> subprocess.CompletedProcess[str]:
    words = (sys.executable, "-c", PROGRAM, int(number), point, *job.words.split(), "--quiet")
    return ran(*words, cwd=folder, env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))})


def done(words: str, folder: Path, *options: str) -> Ended:
    with chdir(folder):
        return mrwork(*words.split(), "--quiet", *options)


def results(job: Job, folder: Path) -> object:
    """What a reader finds in the run."""
    return job.part(mr.load(folder / "run"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """A job, the folder before it, its results before and after, and how many files and folders it makes."""

    job: Job
    before: Path
    old: object
    new: object
    events: int
    largest: int

    def goes_on(self, folder: Path) -> None:
        """The run is the old or the new one, the same command makes the new one, and the user's file is there.

        Steps are resumed or replaced by leave only, and where all are there nothing is to resume.
        """
        assert results(self.job, folder) in (self.old, self.new)
        if self.job.resume and self.is_unfinished(folder):
            kept = contents(folder)
            ended = done(self.job.words, folder)
            assert (ended.returncode, ended.stdout) == (2, "")
            assert re.search("--resume .*--replace", ended.stderr.splitlines()[-1])
            assert contents(folder) == kept
        ended = done(self.job.words, folder, *self.job.resume)
        if ended.returncode == 2 and "without --resume" in ended.stderr:
            ended = done(self.job.words, folder)
        elif ended.returncode == 2 and "with --replace" in ended.stderr:
            ended = done(self.job.words, folder, "--replace")
        assert ended.returncode == 0, ended.stderr
        assert results(self.job, folder) == self.new
        assert (folder / "run" / "notes.txt").read_text() == "mine"
        if self.job.resume:
            again = done(self.job.words, folder, "--resume", "--json")
            assert (again.returncode, "is complete; nothing to resume" in again.stderr) == (0, True)
            assert json.loads(again.stdout)
            assert results(self.job, folder) == self.new

    @staticmethod
    def is_unfinished(folder: Path) -> bool:
        """Whether steps were recorded, and no commit has begun, which is ended whatever comes next."""
        has_steps = any(n_steps(path) for path in folder.rglob("*.jsonl.new"))
        return has_steps and "replaced" not in json.loads((folder / "run" / "manifest.json").read_text())


def contents(folder: Path) -> dict[Path, bytes]:
    return {
        path: path.read_bytes() for path in folder.rglob("*") if path.is_file() and ".lock" not in path.name
    }


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("inputs")
    tuning_samples.small_files(place)
    (place / "tuned.toml").rename(place / "study.toml")
    (place / "rig").mkdir()
    for number, (motion, ampere) in enumerate((m, a) for m in MOTIONS[:3] for a in (0.0, 1.0)):
        theta = (800.0, 200.0 + 480.0 * ampere, 2000.0, 20.0)
        test = sinusoidal_test(
            "viscous_dahl", theta, motion, noise=0.02, rng=number, cycles=5, command=ampere
        )
        write_test(place / "rig" / f"{number}.csv", test)
    return place


@pytest.fixture(scope="module", params=JOBS)
def stage(request: pytest.FixtureRequest, inputs: Path, tmp_path_factory: pytest.TempPathFactory) -> Stage:
    job, before = JOBS[request.param], tmp_path_factory.mktemp(request.param) / "before"
    shutil.copytree(inputs, before)
    assert done(job.before, before).returncode == 0
    (before / "run" / "notes.txt").write_text("mine")
    after = Path(shutil.copytree(before, before.with_name("work")))
    ended = signalled(job, after, signal.SIGKILL, 0)
    assert ended.returncode == 0, ended.stderr
    old, new = results(job, before), results(job, after)
    assert old != new
    unchanged = {path.read_bytes() for path in before.rglob("*") if path.is_file()}
    written = [path.read_bytes() for path in after.rglob("*") if path.is_file() and path.suffix != ".html"]
    largest = max(len(content) for content in written if content not in unchanged)
    shutil.rmtree(after)
    events = int(ended.stderr.splitlines()[-1])
    return Stage(job=job, before=before, old=old, new=new, events=events, largest=largest)


@pytest.fixture
def folder(stage: Stage, tmp_path: Path) -> Path:
    return Path(shutil.copytree(stage.before, tmp_path / "work"))


def test_a_complete_comparison_of_other_tests_is_not_taken_for_this_one(inputs: Path, tmp_path: Path) -> None:
    folder, words = Path(shutil.copytree(inputs, tmp_path / "work")), JOBS["laws"].words
    assert done(words, folder).returncode == 0
    ended = done(words.replace("rig", "rig/0.csv"), folder, "--resume")
    assert (ended.returncode, "is of other tests" in ended.stderr) == (2, True)


@pytest.mark.parametrize("third", [2, 3])
def test_a_killed_verb_loses_nothing_and_goes_on_to_the_same_results(
    stage: Stage, folder: Path, third: int
) -> None:
    ended = signalled(stage.job, folder, signal.SIGKILL, max(third * stage.events // 3, 1))
    assert ended.returncode == -signal.SIGKILL, ended.stderr
    assert stage.is_unfinished(folder) or third == 3 or not stage.job.resume
    stage.goes_on(folder)


@pytest.mark.parametrize(("number", "half"), [(signal.SIGINT, 1), (signal.SIGTERM, 2)])
def test_an_interrupted_verb_says_so_and_goes_on_to_the_same_results(
    stage: Stage, folder: Path, number: signal.Signals, half: int
) -> None:
    ended = signalled(stage.job, folder, number, half * stage.events // 2)
    assert ended.returncode == 128 + number, ended.stderr
    assert "interrupted" in ended.stderr
    assert "Traceback" not in ended.stderr
    stage.goes_on(folder)


def test_a_full_disk_is_one_sentence_and_the_verb_goes_on(stage: Stage, folder: Path) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (stage.largest // 2, before[1]))
    try:
        ended = done(stage.job.words, folder)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert ended.returncode == 2, ended
    assert any(word in ended.stderr for word in ("space", "room", "full", "File too large")), ended.stderr
    # The results may be there, and the page not.
    assert results(stage.job, folder) in (stage.old, stage.new)
    stage.goes_on(folder)
