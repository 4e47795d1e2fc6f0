"""What is no file of its own in the place of whatever a verb writes: it stays as it is, and the verb ends in order.

These are links, symbolic and hard, and pipes, devices and sockets. What a verb writes is not listed here: the
interpreter tells of every file that is opened for writing, made, linked or renamed while the verb runs.
`MRWORK_LINKS=all` tries every kind in every place, otherwise there is one of each group in each.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import socket
import stat
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
from command_line import Ended, mrwork
from study_texts import study_text
from tuning_samples import TWO_STOREYS, study_file

from mrwork.cli.door import verbs
from mrwork.store.run_folder import JOURNAL, MANIFEST
from tools.faults.options import written_record

EVERY = os.environ.get("MRWORK_LINKS") == "all"
# Where files lie is asked, not what they show.
pytestmark = pytest.mark.usefixtures("blank_pictures")
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
# Groups of kinds; a link is named by what it leads to. The first are replaced themselves where a file is replaced.
LINKS = ("file", "folder", "nowhere", "hard link")
DIRECT = ("pipe", "device", "socket")
SPECIAL = (*DIRECT, "to a pipe", "to a device")
# Folders with names that nobody can know before.
RANDOM = (".mrwork-", ".mrwork_probe-")
SCRATCH = ("out.part/models/", "out.part/histories/", "run/.posterior.jsonl.copying")
# The folders that the user names: one that is a link is followed.
NAMED = ("run", "out")
_seen: list[str] | None = None


def _watch(event: str, arguments: tuple[object, ...]) -> None:
    if _seen is None:
        return
    if event == "open":
        path, _, flags = arguments
        if isinstance(path, str) and isinstance(flags, int) and flags & WRITING:
            _seen.append(path)
    elif event in ("os.rename", "os.link"):
        _seen.append(os.fspath(arguments[1]))  # type: ignore[arg-type] # a path
    elif event == "os.mkdir":
        _seen.append(os.fspath(arguments[0]))  # type: ignore[arg-type] # a path


sys.addaudithook(_watch)


@contextlib.contextmanager
def watched() -> Iterator[list[str]]:
    """Paths that are written in the block."""
    global _seen
    _seen = found = []
    try:
        yield found
    finally:
        _seen = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A command in a folder, those that have run there before, and folders that are there."""

    words: str
    before: tuple[str, ...] = ()
    there: tuple[str, ...] = ()


# Small work, for which a second thread would only wait.
FIT = "identify one.csv --model viscous_dahl --every 4 --threads 1 --out run"
TWO = "identify one.csv two.csv --model viscous_dahl --every 4 --threads 1 --out run"
COMPARED = "identify one.csv two.csv --model bingham,viscous_dahl --every 8 --threads 1 --out out"
STUDY = "respond small.toml --out out"
TUNED = "tune study.toml --quick --out out"
SAMPLED = "sample run --steps 4 --walkers 16"

JOBS = {
    "demo": Job(words="demo --threads 1 --out run"),
    "init rig": Job(words="init rig rig"),
    "init study": Job(words="init study sample.toml"),
    "identify": Job(words=FIT),
    "identify --resume": Job(words=f"{FIT} --resume", before=(FIT,)),
    "identify --model A,B": Job(words=COMPARED),
    "identify --model A,B --resume": Job(words=f"{COMPARED} --resume", there=("out.part/models",)),
    "profile": Job(words="profile run", before=(FIT,)),
    "sample": Job(words=SAMPLED, before=(FIT,)),
    "sample --resume": Job(words=f"{SAMPLED} --resume", before=(FIT, SAMPLED)),
    "calibrate": Job(words="calibrate run two.csv", before=(FIT,)),
    "calibrate by folds": Job(words="calibrate run", before=(TWO,)),
    "predict": Job(words="predict run two.csv", before=(FIT,)),
    "report": Job(words="report run --figures", before=(FIT,)),
    "plan": Job(words="plan run --amplitudes 0.01,0.02 --frequencies 1", before=(FIT,)),
    "respond": Job(words=STUDY),
    "respond --resume": Job(words=f"{STUDY} --resume", before=(STUDY,)),
    "tune": Job(words=TUNED),
    "tune --resume": Job(words=f"{TUNED} --resume", before=(TUNED,)),
    "models": Job(words="models bingham --figure figure.svg"),
    "export": Job(words="export run --to mat --output run.mat --replace", before=(FIT,)),
    "characterise": Job(words="characterise one_rig --model static_hysteretic --out run"),
    "compare": Job(words="compare run run --out page.html", before=(FIT,)),
    "fragility": Job(words="fragility out --output f.csv --replace", before=("respond ida.toml --out out",)),
    "check": Job(words="check one.csv two.csv --table table.csv"),
}
# Verbs that write nothing.
READING = {"convert", "cite", "completion"}


def done(words: str, folder: Path) -> Ended:
    with contextlib.chdir(folder):
        loud = ("models", "check", "init", "export", "compare", "fragility")
        quiet = ("--quiet",) if words.split()[0] not in loud else ()
        return mrwork(*words.split(), *quiet, "--json")


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files that the commands read."""
    place = tmp_path_factory.mktemp("records")
    written_record(place / "one.csv")
    (place / "one_rig").mkdir()
    written_record(place / "one_rig" / "10mm1Hz.csv")
    (place / "one_rig" / "tests.csv").write_text("file,use\n10mm1Hz.csv,fit\n")
    lines = (place / "one.csv").read_text().splitlines()
    rows = [[float(number) for number in line.split(",")] for line in lines[1:]]
    wider = [f"{t},{1.5 * x},{f}" for t, x, f in rows]
    (place / "two.csv").write_text("\n".join([lines[0], *wider]) + "\n")
    small = study_text("control_weight = 1e-13").replace("duration = 2", "duration = 0.4")
    (place / "small.toml").write_text(small)
    levels = 'name = "{}"\nseed = {}\npga = [1, 2]\n'
    first, second = (levels.format(name, seed) for seed, name in enumerate("ab"))
    again = f'{first}\n[[motion]]\nsynthetic = "kanai_tajimi"\nduration = 0.4\n{second}'
    ida = small.replace("duration = 0.4\n", f"duration = 0.4\n{again}")
    (place / "ida.toml").write_text(f"{ida}\n[report]\nlimit = {{ peak_drift = 0.01 }}\n")
    study_file(place, building=TWO_STOREYS)
    return place


def listed(folder: Path) -> dict[str, object]:
    """Everything below a folder."""
    return {
        str(path.relative_to(folder)): (
            path.readlink() if path.is_symlink() else path.read_bytes() if path.is_file() else None
        )
        for path in sorted(folder.rglob("*"))
    }


@pytest.fixture(scope="module")
def specials(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, ...]:
    """The special kinds that can be made here; a device of our own wants the rights of root."""
    try:
        make_special(tmp_path_factory.mktemp("specials") / "device", "device")
    except OSError:
        return tuple(kind for kind in SPECIAL if "device" not in kind)
    return SPECIAL


def make_special(path: Path, kind: str) -> None:
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        # The one that takes everything and keeps nothing.
        os.mknod(path, stat.S_IFCHR | 0o600, os.makedev(1, 3))
    else:
        with socket.socket(socket.AF_UNIX) as end, contextlib.chdir(path.parent):
            end.bind(path.name)


def state(path: Path) -> tuple[int, ...]:
    """What stays the same of a special file."""
    found = path.stat()
    return found.st_mode, found.st_ino, found.st_rdev


def plant(path: Path, kind: str, victims: Path) -> None:
    """Put something else in a place; what is there becomes the target of a link."""
    if kind in SPECIAL:
        victims.mkdir(parents=True)
        if os.path.lexists(path):
            path.rename(victims / "itself")
        path.parent.mkdir(parents=True, exist_ok=True)
        kind, is_link = kind.removeprefix("to a "), kind.startswith("to a ")
        make_special(victims / kind if is_link else path, kind)
        if is_link:
            path.symlink_to(victims / kind)
        return
    (victims / "folder").mkdir(parents=True)
    for victim in (victims / "file", victims / "folder" / "file"):
        victim.write_text("precious")
    if kind == "hard link":
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_file() and not path.is_symlink():
            (victims / "itself").hardlink_to(path)
        elif not os.path.lexists(path):
            path.hardlink_to(victims / "file")
        return
    if os.path.lexists(path):
        path.rename(victims / "itself")
        kind = "itself"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.symlink_to(victims / kind)


def outermost(places: Sequence[str]) -> list[str]:
    """The places that are not below another one."""
    return [place for place in places if not any(str(above) in places for above in Path(place).parents)]


def named_in(sentence: str, places: Sequence[str]) -> list[str]:
    """Those of the places that a refusal names: the one of a link, or all that a run would lose."""
    if "would lose" in sentence:
        within = {place: place.partition("/")[2] for place in places}
        return [
            place
            for place, name in within.items()
            if name and re.search(rf" {re.escape(name)}[,;]", sentence)
        ]
    if "but no manifest.json" in sentence or "no journal to resume" in sentence:
        lost = MANIFEST if "manifest" in sentence else JOURNAL
        return [place for place in places if Path(place).name == lost]
    found = [place for place in places if re.search(f"{re.escape(place)}[ :]", sentence)]
    return sorted(found, key=len)[-1:]


def test_every_verb_has_a_job() -> None:
    assert {job.words.split()[0] for job in JOBS.values()} | READING == set(verbs())


@pytest.mark.parametrize("turn", range(len(SPECIAL)) if EVERY else range(1))
@pytest.mark.parametrize("group", ["links", "special"])
@pytest.mark.parametrize("name", JOBS)
def test_what_is_no_file_of_its_own_stays_as_it_is(
    name: str, group: str, turn: int, records: Path, tmp_path: Path, specials: tuple[str, ...]
) -> None:
    available = LINKS if group == "links" else specials
    job, base, work, victims = JOBS[name], tmp_path / "base", tmp_path / "work", tmp_path / "victims"
    shutil.copytree(records, base)
    for words in job.before:
        assert done(words, base).returncode == 0
    for folder in job.there:
        (base / folder).mkdir(parents=True)
    shutil.copytree(base, work)
    with watched() as seen:
        ended = done(job.words, work)
    assert ended.returncode == 0, ended.stderr
    within = {os.path.relpath(work / path, work) for path in seen}
    for folder in NAMED:
        # A folder that is not there yet has no links, and one with links only is no run folder.
        there = {str(path.relative_to(base)) for path in (base / folder).rglob("*")}
        within = {path for path in within if there or not path.startswith(f"{folder}/")} | there
    places = sorted(
        path for path in within if path not in (".", *NAMED) and not path.startswith(("..", *RANDOM))
    )
    assert places
    kinds = {place: available[(number + turn) % len(available)] for number, place in enumerate(places)}
    # Links in all places at once; one that is refused is named, and left out the next time.
    left = places
    while left:
        planted = outermost(left)
        shutil.rmtree(work)
        shutil.copytree(base, work)
        shutil.rmtree(victims, ignore_errors=True)
        for number, place in enumerate(planted):
            plant(work / place, kinds[place], victims / str(number))
        # What a run that is begun anew has left in the folder of its journals is removed first.
        special = [
            work / place
            if kinds[place] in DIRECT
            else victims / str(number) / kinds[place].removeprefix("to a ")
            for number, place in enumerate(planted)
            if kinds[place] in SPECIAL and not place.startswith(SCRATCH)
        ]
        before = listed(victims), [state(path) for path in special]
        ended = done(job.words, work)
        assert (listed(victims), [state(path) for path in special]) == before, (planted, ended)
        if ended.returncode == 0:
            tried = planted
        else:
            assert ended.returncode == 2, ended
            said = [line for line in ended.stderr.splitlines() if "warning: " not in line]
            assert len(said) == 1 or "nothing to resume" in said[0], ended
            assert said[-1].startswith("mrwork: "), ended
            tried = named_in(said[-1], planted)
            assert tried, (planted, said)
        print(f"{name}: {ended.returncode} {tried}")
        left = [place for place in left if place not in tried]
