"""Files that the verbs write into the folders of runs, studies and tunings, and the journals that they resume."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import Final

import tuning_samples
from run_folders import WALKERS, add_every_file
from sinusoidal_tests import sinusoidal_test
from study_texts import study_text

import mrwork as mr
from mrwork.errors import MrworkWarning
from mrwork.identification import FitSettings
from mrwork.identification.fit_file import manifest_of, write_run
from mrwork.identification.settings import resize_search, search_named
from mrwork.store.codec import json_document
from mrwork.store.journal import read_lines
from mrwork.store.output_folder import Destination
from mrwork.store.run_folder import (
    CALIBRATION,
    CHAIN,
    DRAWS,
    ENSEMBLE,
    FIT,
    FIT_RUN,
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
from mrwork.study import Study
from mrwork.study.ensemble import ensemble_of
from mrwork.study.folder import study_document
from mrwork.study.run_result import Histories
from mrwork.tuning.results import tuning_document
from tools.fuzzing.mutants import Structure
from tools.fuzzing.reader import Reader, Seed
from tools.fuzzing.user_files import in_child

MODEL: Final = "bingham"
_STEPS: Final = 4
_STRUCTURES: Final[Mapping[str, Structure]] = {
    ".json": "json",
    ".jsonl": "journal",
    ".npz": "zip",
    ".nc": "binary",
}
# Documents of a fit, beside `FIT` and `MANIFEST`, with the files that are read together with them.
DOCUMENTS: Final[Mapping[str, tuple[str, ...]]] = {
    MANIFEST: (),
    FIT: (),
    PROFILES: (),
    CALIBRATION: (PREDICTIONS,),
    PREDICTIONS: (CALIBRATION,),
    HELD_OUT: (HELD_OUT_FORCES,),
    HELD_OUT_FORCES: (HELD_OUT,),
    PLAN: (),
    RANKING: (),
    LAWS: (),
    NEAR_SETS: (),
}


def run_readers() -> list[Reader]:
    """Readers of folders that the verbs have written."""
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        # A fit to few samples is not to be trusted.
        warnings.simplefilter("ignore", MrworkWarning)
        return [*_readers_of_a_fit(Path(name)), *_readers_of_a_study(Path(name))]


def _test(number: int) -> mr.DamperTest:
    theta = tuple(mr.damper(MODEL).nominal)
    return sinusoidal_test(MODEL, theta, (0.005 * (1 + number), 1.0), noise=0.02, cycles=2, rng=number)


def _search() -> FitSettings:
    """A search that takes no time."""
    small = resize_search(search_named("genetic"), population=8, generations=2)
    return FitSettings(search=small)


def _readers_of_a_fit(folder: Path) -> list[Reader]:
    place = folder / "run"
    tests = tuple(_test(number) for number in range(3))
    search = _search().search
    beginning = folder / JOURNAL
    with closing(mr.Journal(beginning)) as journal:
        fit = mr.identify(MODEL, tests[0], search=search, threads=1, journal=journal)
    write_run(
        Destination(path=place, kind=FIT_RUN),
        fit=fit,
        manifest=manifest_of(fit, fit.status),
        journal=beginning,
    )
    add_every_file(place, fit, tests[0], tests[1:], steps=_STEPS)

    def sampled(path: Path) -> object:
        with closing(mr.Journal(path, resume=True)) as journal:
            return mr.sample(fit, tests[0], walkers=WALKERS, most_steps=_STEPS, threads=1, journal=journal)

    def identified(path: Path) -> object:
        with closing(mr.Journal(path, resume=True)) as journal:
            return mr.identify(MODEL, tests[0], search=search, threads=1, journal=journal)

    whole = {name: (place / name).read_bytes() for name in (*DOCUMENTS, DRAWS)}
    readers = [
        Reader(
            name=f"run: {name}",
            read=lambda path: mr.load(path.parent),
            seeds=(_seed(name, whole[name]),),
            beside={each: whole[each] for each in {MANIFEST, FIT, name, *together}},
            share=4.0,
        )
        for name, together in DOCUMENTS.items()
    ]
    readers += in_child(
        f"run: {DRAWS}",
        lambda path: mr.load(path.parent),
        [_seed(DRAWS, whole[DRAWS])],
        1.0,
        beside={each: whole[each] for each in (MANIFEST, FIT)},
    )
    return [
        *readers,
        *_readers_of_a_journal("identify", beginning.read_bytes(), identified),
        *_readers_of_a_journal("sample", (place / CHAIN).read_bytes(), sampled),
    ]


def _readers_of_a_study(folder: Path) -> list[Reader]:
    study_file = folder / "study.toml"
    study_file.write_text(study_text("control_weight = 1e-13").replace("duration = 2", "duration = 0.4"))
    study = mr.read_study(study_file)
    place, beginning = folder / "study", folder / "study.jsonl"
    histories = Histories(place, study, resume=False)
    with closing(mr.Journal(beginning)) as journal:
        results = mr.run_study(study, journal=journal, keep=histories.keep, threads=1)
    history = histories.paths()[0]

    def responded(path: Path) -> object:
        with closing(mr.Journal(path, resume=True)) as journal:
            return mr.run_study(study, journal=journal, threads=1)

    tuning_file = tuning_samples.study_file(folder)
    tuned_study, tuned_journal = mr.read_study(tuning_file), folder / "tuned.jsonl"
    with closing(mr.Journal(tuned_journal)) as journal:
        tuned = mr.tune(tuned_study, budget=8, journal=journal, threads=1)

    def tuned_again(path: Path) -> object:
        with closing(mr.Journal(path, resume=True)) as journal:
            return mr.tune(tuned_study, budget=8, journal=journal, threads=1)

    stated = {
        kind: json_document({"kind": kind, "title": title, "status": "finished"}).encode()
        for kind, title in (("study", results.title), ("tuning", tuned.title))
    }
    return [
        Reader(
            name="study: results.json",
            read=lambda path: mr.study.read_results(path.parent),
            seeds=(_seed(RESULTS, json_document(study_document(results)).encode()),),
            beside={MANIFEST: stated["study"]},
            share=3.0,
        ),
        Reader(
            name="study: ensemble.json",
            read=lambda path: mr.study.read_results(path.parent),
            seeds=(_seed(ENSEMBLE, json_document(asdict(ensemble_of((results, results)))).encode()),),
            beside={
                MANIFEST: stated["study"],
                RESULTS: json_document(study_document(results)).encode(),
            },
            share=1.0,
        ),
        Reader(
            name="study: manifest.json",
            read=lambda path: mr.study.read_results(path.parent),
            seeds=(_seed(MANIFEST, stated["study"]),),
            beside={RESULTS: json_document(study_document(results)).encode()},
            share=0.5,
        ),
        Reader(
            name="study: histories",
            read=lambda path: _history(path, study),
            seeds=(_seed(f"study/histories/{history.name}", history.read_bytes()),),
            share=2.0,
        ),
        Reader(
            name="tuning: results.json",
            read=lambda path: mr.tuning.read_tuning(path.parent),
            seeds=(_seed(RESULTS, json_document(tuning_document(tuned)).encode()),),
            beside={MANIFEST: stated["tuning"]},
            share=1.0,
        ),
        Reader(
            name="tuning: manifest.json",
            read=lambda path: mr.tuning.read_tuning(path.parent),
            seeds=(_seed(MANIFEST, stated["tuning"]),),
            beside={RESULTS: json_document(tuning_document(tuned)).encode()},
            share=0.5,
        ),
        *_readers_of_a_journal("respond", beginning.read_bytes(), responded),
        *_readers_of_a_journal("tune", tuned_journal.read_bytes(), tuned_again, replayed=0.02),
    ]


def _history(path: Path, study: Study) -> object:
    return Histories(path.parents[1], study, resume=True)._read(path, 0, 0)


def _readers_of_a_journal(
    verb: str, content: bytes, resumed: Callable[[Path], object], *, replayed: float = 0.2
) -> list[Reader]:
    """Its lines alone, and the run that is resumed from it."""
    seeds = (_seed(f"{verb}.jsonl", content),)
    return [
        Reader(
            name=f"lines of a journal of {verb}",
            read=lambda path: read_lines(path.read_bytes(), path),
            seeds=seeds,
            share=4.0,
        ),
        Reader(name=f"journal of {verb}, resumed", read=resumed, seeds=seeds, share=replayed),
    ]


def _seed(file: str, content: bytes) -> Seed:
    return Seed(file=file, content=content, structure=_STRUCTURES[Path(file).suffix])
