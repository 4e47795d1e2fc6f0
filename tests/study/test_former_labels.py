"""Folders, journals and study files that call constant commands by former labels are read, and show those of today."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import tuning_samples
from command_line import mrwork

import mrwork as mr
from mrwork.study import read_results
from mrwork.study.schema import present_label, recorded_label

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
    assert mrwork("tune", tuning_samples.study_file(tmp_path), "--out", run, "--quiet").returncode == 0
    now = mr.tuning.read_tuning(run)
    assert {*FORMER} <= {each.label for each in now.references}
    with_former_labels(run / "results.json")
    assert json.loads((run / "results.json").read_text())["references"][0]["label"] == "i = 0"
    assert mr.tuning.read_tuning(run) == now
