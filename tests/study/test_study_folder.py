"""Results of a study, read back from its folder, are those that were written."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest
import study_samples
from refusals import refusal

from mrwork.motions.spectrum import Intensity
from mrwork.store.codec import json_document
from mrwork.store.run_folder import MANIFEST, RESULTS
from mrwork.study import StudyResults, read_results
from mrwork.study.comparison import judged_in_words
from mrwork.study.folder import study_document
from mrwork.study.results import largest_step_changes


def read_back(results: StudyResults, folder: Path) -> StudyResults:
    (folder / RESULTS).write_text(json_document(study_document(results)), encoding="utf-8")
    return read_results(folder)


def test_what_follows_from_the_runs_follows_from_their_file(tmp_path: Path) -> None:
    results = study_samples.results()
    failed = replace(results.runs[4, 0], outcome="diverged").with_numbers(energy_error=math.nan)
    halved = {key: run.with_numbers(peak_drift=1.01 * run.peak_drift) for key, run in results.runs.items()}
    results = study_samples.with_runs(results, {**results.runs, (4, 0): failed}, halved=halved)
    stored = read_back(results, tmp_path)
    assert [(row.label, row.kind) for row in stored.rows] == [(row.label, row.kind) for row in results.rows]
    assert [motion.peak for motion in stored.motions] == [motion.peak for motion in results.motions]
    for row, motion in results.runs:
        assert stored.criteria(row, motion) == results.criteria(row, motion)
        for against in ("uncontrolled", "passive_off"):
            assert repr(stored.ratios(row, motion, against)) == repr(results.ratios(row, motion, against))
    assert repr([stored.score(row) for row in range(5)]) == repr([results.score(row) for row in range(5)])
    assert stored.warnings() == results.warnings()
    assert largest_step_changes(stored) == largest_step_changes(results)
    assert (stored.done, stored.total, stored.complete) == (results.done, results.total, True)
    assert stored.finished_rows(0) == results.finished_rows(0) == [0, 1, 2, 3]


def test_the_file_has_the_intensity_of_each_motion(tmp_path: Path) -> None:
    results = study_samples.results()
    known = (
        Intensity(measure="pga", value=3.0),
        Intensity(measure="sa", value=2.0, period=0.8, damping_ratio=0.05),
    )
    motions = [replace(motion, intensity=each) for motion, each in zip(results.motions, known, strict=True)]
    results = replace(results, motions=tuple(motions))
    assert tuple(motion.intensity for motion in read_back(results, tmp_path).motions) == known


def test_the_file_says_which_motions_scores_stand_on_and_their_spread(tmp_path: Path) -> None:
    results = study_samples.many_motions()
    document = study_document(results)
    assert document["judged_on"] == "10 test motions"
    assert [motion["use"] for motion in document["motions"]].count("training") == 2
    spread = document["spreads"]["Clipped-optimal"]
    assert spread["motions"] == 10
    assert spread["least"] < spread["lower_quartile"] < spread["median"] < spread["most"]
    assert [group["name"] for group in document["groups"]] == ["firm soil", "soft soil", "training motions"]
    stored = read_back(results, tmp_path)
    assert stored.motions == results.motions
    assert [stored.score(row) for row in range(5)] == [results.score(row) for row in range(5)]
    assert judged_in_words(stored) == "10 test motions"


def test_rows_that_were_not_reached_are_known_by_their_labels(tmp_path: Path) -> None:
    results = study_samples.results()
    begun = study_samples.with_runs(results, {key: run for key, run in results.runs.items() if key[0] < 3})
    stored = read_back(begun, tmp_path)
    assert [row.label for row in stored.rows] == [row.label for row in results.rows]
    assert (stored.done, stored.total, stored.complete) == (6, 10, False)
    assert stored.criteria(4, 0) is None
    assert "6 of 10 runs" in repr(stored)


@pytest.mark.parametrize(
    ("name", "value", "word"),
    [
        ("kind", "tuning", "run of `mrwork tune`"),
        ("title", "Another", "its title"),
        ("status", "interrupted", "its status"),
    ],
)
def test_a_manifest_of_another_study_is_refused(tmp_path: Path, name: str, value: str, word: str) -> None:
    results = study_samples.results()
    stated = {"kind": "study", "title": results.title, "status": "finished", "seed": 0}
    (tmp_path / MANIFEST).write_text(json_document(stated))
    read_back(results, tmp_path)
    (tmp_path / MANIFEST).write_text(json_document({**stated, name: value}))
    refusal(read_results, tmp_path, match=word)
