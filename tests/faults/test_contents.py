"""Files of runs that are well-formed but wrong: every leaf of their trees, in the place of which stands another value.

Each file of a tiny run is read back with one value replaced, removed or doubled: it is refused in one printable
sentence, or what it says can be used. `MRWORK_MUTANTS` is how many of the mutants of each file are tried, or `all`.
"""

from __future__ import annotations

import json
import os
import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pytest
import tuning_samples
from command_line import Ended, mrwork
from run_folders import WALKERS, add_every_file
from sentences import Refused
from study_texts import study_text

import mrwork as mr
from mrwork.errors import MrworkError, RecordError
from mrwork.identification.fit_file import reopen
from mrwork.store.run_folder import (
    CALIBRATION,
    CHAIN,
    DRAWS,
    FIT,
    HELD_OUT,
    HELD_OUT_FORCES,
    JOURNAL,
    LAWS,
    MANIFEST,
    NEAR_SETS,
    PLAN,
    PREDICTIONS,
    PROFILES,
    RANKING,
    RESULTS,
)
from tools.faults.damage import array_mutants, journal_mutants, json_mutants
from tools.faults.options import written_record

MUTANTS = os.environ.get("MRWORK_MUTANTS", "12")
# Pages take seconds: of the mutants that can be read, one in so many is predicted with or drawn.
PREDICTED, DRAWN = 4, 60
STEPS = 20
T = TypeVar("T")

# Every mutant takes minutes a document.
pytestmark = [pytest.mark.timeout(3600)] if MUTANTS == "all" else []


def sampled(listed: list[T], share: float = 1.0) -> list[T]:
    """Those that are tried; a `share` of them where each takes long."""
    count = len(listed) if MUTANTS == "all" else int(MUTANTS)
    return random.Random(7).sample(listed, min(len(listed), max(1, int(share * count))))


def in_one_sentence(ended: Ended, what: str) -> None:
    """The verb has ended as it should, or has refused in one printable line."""
    assert ended.returncode in (0, 2), (what, ended)
    if ended.returncode == 2:
        lines = ended.stderr.splitlines()
        assert lines, what
        assert lines[-1].isprintable(), (what, ended.stderr)
        assert lines[-1].startswith("mrwork: "), (what, ended.stderr)
        assert ended.stdout == "", (what, ended)


def read(load: Callable[[], Any], what: str) -> bool:
    """Whether a reader accepts; it refuses with an error of ours, in one sentence, only."""
    refusal = ""
    try:
        repr(load())
    except MrworkError as error:
        refusal = str(error)
    except Exception as error:
        raise AssertionError(what) from error
    assert "\n" not in refusal, what
    return not refusal


# Runs of an identification


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    place = tmp_path_factory.mktemp("records")
    return [
        written_record(place / f"{stroke:g}mm1Hz.csv", stroke, noise=0.01) for stroke in (10.0, 14.0, 20.0)
    ]


@pytest.fixture(scope="module")
def run(records: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with every file that a verb adds."""
    place = tmp_path_factory.mktemp("run") / "run"
    own, *others = records
    ended = mrwork("identify", own, "--model", "viscous_dahl", "--out", place, "--quiet", "--json")
    assert ended.returncode == 0, ended
    opened = reopen(place)
    more = [mr.read_damper_test(other) for other in others]
    add_every_file(place, opened.fit, opened.tests[0], more, steps=STEPS)
    mr.load(place)
    return place


@pytest.fixture
def copied(run: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(run, tmp_path / "run"))


@pytest.mark.parametrize(
    "name", [MANIFEST, FIT, PROFILES, PLAN, CALIBRATION, RANKING, LAWS, NEAR_SETS, HELD_OUT]
)
def test_a_document_of_a_run_is_used_or_refused_in_a_sentence(
    name: str, copied: Path, records: list[Path]
) -> None:
    path = copied / name
    # Another process reads it, each time.
    (copied / DRAWS).unlink()
    found = json_mutants(path.read_text())
    kept, accepted = path.read_text(), 0
    for what, text in sampled(found):
        path.write_text(text())
        if not read(lambda: mr.load(copied), what):
            continue
        accepted += 1
        if accepted % PREDICTED == 1:
            in_one_sentence(mrwork("predict", copied, records[1], "--level", "0.9", "--json"), what)
        if accepted % DRAWN == 0:
            in_one_sentence(mrwork("report", copied, "--quiet"), what)
    path.write_text(kept)
    print(f"{name}: {len(sampled(found))} of {len(found)} mutants, {accepted} accepted")


@pytest.mark.parametrize("name", [PREDICTIONS, HELD_OUT_FORCES])
def test_forged_predictions_are_refused_or_used(name: str, copied: Path) -> None:
    path = copied / name
    (copied / DRAWS).unlink()
    with np.load(path) as archive:
        arrays = dict(archive)
    forged = array_mutants(arrays, "facts")
    accepted = 0
    for what, made in sampled(forged):
        np.savez(path, **made)  # type: ignore[arg-type] # NumPy takes arrays by any name
        if read(lambda: mr.load(copied), what):
            accepted += 1
            if accepted % DRAWN == 0:
                in_one_sentence(mrwork("report", copied, "--quiet"), what)
    print(f"{name}: {len(forged)} mutants, {accepted} of those tried accepted")


def test_a_forged_posterior_is_refused_or_used(copied: Path) -> None:
    import h5py

    path = copied / DRAWS
    whole = path.read_bytes()

    def attributes_of(file: Any) -> list[tuple[str, str]]:
        places = ["/", *(f"posterior/{name}" for name in file["posterior"])]
        return [(place, name) for place in places for name in file[place].attrs if not name.startswith("_")]

    with h5py.File(path) as file:
        pairs = attributes_of(file)
        columns = [f"posterior/{name}" for name in file["posterior"] if file[f"posterior/{name}"].ndim == 2]
    forged: list[tuple[str, str, str, Any]] = [
        (f"{place} {name} is {wrong!r}", place, name, wrong)
        for place, name in pairs
        for wrong in ("", "text", -1, 0, 1e300, float("nan"), True, None)
    ] + [
        (f"{place} is {value}", place, "", value)
        for place in [*columns, "sample_stats/lp"]
        for value in (float("nan"), float("inf"), 1e300, -1e300, None)
    ]
    accepted = 0
    # A child process reads the file: a fifth of the mutants of other files.
    for what, place, name, wrong in sampled(forged, 0.2):
        path.write_bytes(whole)
        with h5py.File(path, "r+") as file:
            if name:
                attributes = file[place].attrs
                attributes.pop(name) if wrong is None else attributes.__setitem__(name, wrong)
            elif wrong is None:
                del file[place]
            else:
                file[place][0, 0] = wrong
        accepted += read(lambda: mr.load(copied), what)
    print(f"{DRAWS}: {len(forged)} mutants, {accepted} of those tried accepted")


def test_an_addition_of_another_fit_is_refused(run: Path, copied: Path, refused: Refused) -> None:
    document = json.loads((copied / FIT).read_text())
    document["estimates"][0]["value"] *= 1.01
    (copied / FIT).write_text(json.dumps(document))
    with pytest.raises(RecordError, match=r"manifest\.json is of another run than fit\.json beside it"):
        mr.load(copied)
    (copied / MANIFEST).write_text("{}")
    for name in (DRAWS, PROFILES, CALIBRATION, PLAN, NEAR_SETS, HELD_OUT):
        refused(mr.load, copied)
        (copied / name).unlink()
    assert mr.load(copied).profiles is None
    for name in (RANKING, LAWS):
        shutil.copy(run / name, copied / name)
        (copied / name).write_text((run / name).read_text().replace("viscous_dahl", "bouc_wen"))
        refused(mr.load, copied)
        (copied / name).unlink()


# Journals


def test_a_forged_chain_is_refused_or_resumed(copied: Path) -> None:
    path = copied / CHAIN
    words = ("sample", copied, "--steps", STEPS, "--walkers", WALKERS, "--resume", "--quiet", "--json")
    found = journal_mutants(b"\n".join(path.read_bytes().splitlines()[:3]) + b"\n")
    for what, content in sampled(found, 0.2):
        path.write_bytes(content())
        in_one_sentence(mrwork(*words), what)
    print(f"{CHAIN}: {len(found)} mutants")


# Studies and tunings


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a study's results, and its file beside it."""
    place = tmp_path_factory.mktemp("study")
    (place / "study.toml").write_text(study_text("control_weight = 1e-13"))
    ended = mrwork(
        "respond", place / "study.toml", "--out", place / "out", "--check-step", "--quiet", "--json"
    )
    assert ended.returncode == 0, ended
    return place


@pytest.mark.parametrize("name", [RESULTS, MANIFEST])
def test_results_of_a_study_are_used_or_refused(name: str, study: Path, tmp_path: Path) -> None:
    for each in (RESULTS, MANIFEST):
        shutil.copy(study / "out" / each, tmp_path / each)
    found, accepted = json_mutants((study / "out" / name).read_text()), 0

    def results() -> Any:
        stored = mr.study.read_results(tmp_path)
        for row in range(len(stored.rows)):
            stored.score(row)
            for motion in range(len(stored.motions)):
                stored.ratios(row, motion, "passive_off")
                stored.step_changes(row, motion)
        return stored, stored.warnings()

    for what, forged in sampled(found):
        (tmp_path / name).write_text(forged())
        accepted += read(results, what)
    print(f"study {name}: {len(sampled(found))} of {len(found)} mutants, {accepted} accepted")


def test_a_forged_journal_of_a_study_is_refused_or_resumed(study: Path, tmp_path: Path) -> None:
    place = Path(shutil.copytree(study, tmp_path / "study"))
    path = place / "out" / JOURNAL
    found = journal_mutants(path.read_bytes())
    words = (
        "respond",
        place / "study.toml",
        "--out",
        place / "out",
        "--check-step",
        "--resume",
        "--quiet",
        "--json",
    )
    whole = path.read_bytes()
    for what, content in sampled(found, 0.1 if MUTANTS != "all" else 0.05):
        path.write_bytes(content())
        in_one_sentence(mrwork(*words), what)
        path.write_bytes(whole)
    print(f"study {JOURNAL}: {len(found)} mutants")


@pytest.fixture(scope="module")
def tuned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("tuning")
    file = tuning_samples.study_file(place, building=tuning_samples.TWO_STOREYS)
    ended = mrwork("tune", file, "--out", place / "out", "--threads", 1, "--quick", "--json", "--quiet")
    assert ended.returncode == 0, ended
    return place


def test_results_of_a_tuning_are_used_or_refused(tuned: Path, tmp_path: Path) -> None:
    for name in (MANIFEST, RESULTS):
        shutil.copy(tuned / "out" / name, tmp_path / name)
    accepted = 0
    for name in (RESULTS, MANIFEST):
        document = json.loads((tmp_path / name).read_text())
        if name == RESULTS:
            # Six references have equal fields, and four fifths of the values: one of them is enough.
            del document["references"][1:]
        text = json.dumps(document)
        found = json_mutants(text)
        for what, forged in sampled(found):
            (tmp_path / name).write_text(forged())
            accepted += read(lambda: (found := mr.tuning.read_tuning(tmp_path), found.warnings), what)
        (tmp_path / name).write_text(text)
        print(f"tuning {name}: {len(sampled(found))} of {len(found)} mutants, {accepted} accepted")
