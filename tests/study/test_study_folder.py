"""Results of a study, read back from its folder, are those that were written, also under former labels."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import study_samples
import tuning_samples
from command_line import mrwork
from sentences import Refused

import mrwork as mr
from mrwork.closed_loop.evaluation import criterion
from mrwork.store.codec import json_document
from mrwork.store.run_folder import MANIFEST, RESULTS
from mrwork.study import StudyResults, compared, read_results
from mrwork.study.comparison import judged_in_words
from mrwork.study.folder import StoredStudy, study_document
from mrwork.study.results import largest_step_changes
from mrwork.study.schema import present_label, recorded_label


def read_back(results: StudyResults, folder: Path) -> StoredStudy:
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


def test_a_file_without_the_changes_still_opens(tmp_path: Path) -> None:
    results = study_samples.results()
    document = study_document(results)
    for newer in ("changes", "best_passive", "judged_on", "chosen_on", "spreads", "groups"):
        del document[newer]
    for run in document["results"]:
        del run["over_best_passive"]
    for motion in document["motions"]:
        for newer in ("source", "synthetic", "use", "groups"):
            del motion[newer]
    (tmp_path / RESULTS).write_text(json_document(document), encoding="utf-8")
    stored = read_results(tmp_path)
    assert compared(stored).in_words(4) == compared(results).in_words(4)


def test_rows_that_were_not_reached_are_known_by_their_labels(tmp_path: Path) -> None:
    results = study_samples.results()
    begun = study_samples.with_runs(results, {key: run for key, run in results.runs.items() if key[0] < 3})
    stored = read_back(begun, tmp_path)
    assert [row.label for row in stored.rows] == [row.label for row in results.rows]
    assert (stored.done, stored.total, stored.complete) == (6, 10, False)
    assert stored.criteria(4, 0) is None
    assert "6 of 10 runs" in repr(stored)


def named_otherwise(value: Any, change: Callable[[dict[str, Any]], object]) -> None:
    """Change every table of criteria within a document."""
    for each in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        named_otherwise(each, change)
    if isinstance(value, dict) and "rms_base_shear" in value:
        change(value)


@pytest.mark.parametrize("name", ["rms_base_shear", "command_travel", "switching_rate"])
def test_a_file_that_is_older_than_a_criterion_opens_without_it(name: str, tmp_path: Path) -> None:
    results = study_samples.results()
    results = study_samples.with_runs(results, halved=results.runs)
    document = study_document(results)
    named_otherwise(document, lambda table: table.pop(name, None))
    (tmp_path / RESULTS).write_text(json_document(document), encoding="utf-8")
    stored = read_results(tmp_path)
    known, wanted = stored.criteria(3, 0) or {}, results.criteria(3, 0) or {}
    assert math.isnan(known.pop(name))
    assert wanted.pop(name) > 0.0
    assert known == wanted
    assert [stored.score(row) for row in range(5)] == [results.score(row) for row in range(5)]
    assert largest_step_changes(stored) == largest_step_changes(results)
    assert criterion(name).title not in " ".join(compared(stored).in_words(4))
    said = f"results.json is older than {name}; run `mrwork respond` again for it."
    lacking = (
        "results.json lacks quantities of floors, storeys and devices; run `mrwork respond` again for them."
    )
    assert stored.warnings() == [said, lacking, *results.warnings()]


def test_a_file_with_a_criterion_of_a_later_version_opens_with_the_others(tmp_path: Path) -> None:
    results = study_samples.results()
    document = study_document(results)
    named_otherwise(document["results"], lambda table: table.update(mean_drift=0.5))
    (tmp_path / RESULTS).write_text(json_document(document), encoding="utf-8")
    stored = read_results(tmp_path)
    assert stored.criteria(3, 0) == results.criteria(3, 0)
    assert stored.runs[3, 0].criteria["mean_drift"] == 0.5
    said = "results.json has mean_drift, no criterion of this version; it is left out."
    assert stored.warnings() == [said, *results.warnings()]


def _two_kinds(document: dict[str, Any]) -> None:
    document["results"][-1]["kind"] = "passive"


FORGED: dict[str, Callable[[dict[str, Any]], object]] = {
    "lacks peak_drift": lambda document: document["results"][3]["criteria"].pop("peak_drift"),
    "lacks rms_drift": lambda document: document["results"][3]["over_uncontrolled"].pop("rms_drift"),
    "has the unknown criterion 'peak_drifts'": lambda document: document["results"][0]["criteria"].update(
        peak_drifts=1.0
    ),
    "has other criteria than the first": lambda document: named_otherwise(
        document["results"][3], lambda table: table.pop("rms_base_shear")
    ),
    "finished without peak_drift": lambda document: document["results"][3]["criteria"].update(
        peak_drift=None
    ),
    "it is complete without a run": lambda document: document["results"].pop(),
    "and no score of": lambda document: document["scores"].popitem(),
    "is of the kind": _two_kinds,
    "it has two runs": lambda document: document["results"].append(document["results"][0]),
    "it has no motion": lambda document: document["motions"].pop(),
    "is not repeated with half the step": lambda document: document["results"][2].update(step_check=None),
}


@pytest.mark.parametrize("forge", FORGED.values(), ids=FORGED)
def test_results_that_contradict_themselves_are_refused(
    tmp_path: Path, forge: Callable[[dict[str, Any]], object], refused: Refused
) -> None:
    results = study_samples.results()
    document = study_document(study_samples.with_runs(results, halved=results.runs))
    assert document["complete"]
    forge(document)
    (tmp_path / RESULTS).write_text(json_document(document), encoding="utf-8")
    refused(read_results, tmp_path)


def test_a_manifest_of_another_study_is_refused(tmp_path: Path, refused: Refused) -> None:
    for name, value in (
        ("kind", "tuning"),
        ("verb", "publish"),
        ("title", "Another"),
        ("status", "interrupted"),
        ("status", None),
    ):
        results = study_samples.results()
        stated = {"kind": "study", "title": results.title, "status": "finished", "seed": 0}
        (tmp_path / MANIFEST).write_text(json_document(stated))
        read_back(results, tmp_path)
        (tmp_path / MANIFEST).write_text(json_document({**stated, name: value}))
        refused(read_results, tmp_path)


def test_another_folder_is_refused(tmp_path: Path, refused: Refused) -> None:
    refused(read_results, tmp_path)
    (tmp_path / RESULTS).write_text('{"title": 3}', encoding="utf-8")
    refused(read_results, tmp_path)


FORMER = {
    "Passive-off": "i = 0",
    "Passive-on": "Largest command",
    "Optimal passive": "Best constant command",
}


def with_former_labels(file: Path) -> None:
    text = file.read_text(encoding="utf-8")
    for present, former in FORMER.items():
        text = text.replace(present, former)
    file.write_text(text, encoding="utf-8")


@pytest.mark.parametrize(
    "label", [*FORMER, "Optimal passive, 1.32 A", "Clipped-optimal", "i = 0 by hand", "mine"]
)
def test_a_label_is_recorded_as_ever_and_read_as_today(label: str) -> None:
    assert present_label(recorded_label(label)) == label
    assert not {recorded_label(label)} & {*FORMER}


def test_the_folder_of_a_study_opens_and_its_journal_is_that_of_earlier_versions(tmp_path: Path) -> None:
    laws = "".join(f'[[controller]]\nlaw = "{law}"\n' for law in ("passive_on", "best_passive"))
    # The file of the study has a former label, too.
    study = tuning_samples.study_file(tmp_path, tune="", more=f'{laws}[report]\ncontrollers = ["i = 0"]\n')
    run = tmp_path / "run"
    assert mrwork("respond", study, "--out", run, "--quiet").returncode == 0
    now = read_results(run)
    assert {"Passive-off", "Passive-on"} <= {row.label for row in now.rows}
    with_former_labels(run / "results.json")
    before = read_results(run)
    assert [(row.label, row.kind) for row in before.rows] == [(row.label, row.kind) for row in now.rows]
    assert before.labelled.axes == now.labelled.axes
    assert before.damper_warnings == now.damper_warnings
    # The header of a journal names rows, always by the labels of the first version.
    header = json.loads((run / "journal.jsonl").read_text(encoding="utf-8").splitlines()[0])
    assert [each["label"] for each in header["facts"]["arrangement"]] == ["uncontrolled", *FORMER.values()]


def test_the_folder_of_a_tuning_opens(tmp_path: Path) -> None:
    run = tmp_path / "run"
    assert (
        mrwork(
            "tune",
            tuning_samples.study_file(tmp_path, building=tuning_samples.TWO_STOREYS),
            "--out",
            run,
            "--quiet",
        ).returncode
        == 0
    )
    now = mr.tuning.read_tuning(run)
    assert {*FORMER} <= {each.label for each in now.references}
    with_former_labels(run / "results.json")
    assert json.loads((run / "results.json").read_text())["references"][0]["label"] == "i = 0"
    assert mr.tuning.read_tuning(run) == now
