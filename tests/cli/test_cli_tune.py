"""`mrwork tune`: one JSON object, exit statuses, a killed tuning resumed."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from typing import Any

import pytest
import tuning_samples
from command_line import COMMAND, mrwork, printed, started, wait_until
from sentences import Refused

import mrwork as mr

TIMES = {"seconds", "candidates_per_second", "seconds_outside", "out"}


def still(document: object) -> object:
    """A document without the numbers that depend on the machine."""
    if isinstance(document, dict):
        return {name: still(value) for name, value in document.items() if name not in TIMES}
    return [still(each) for each in document] if isinstance(document, list) else document


def test_json_has_laws_and_references_in_one_form(tmp_path: Path) -> None:
    study = tuning_samples.study_file(tmp_path, building=tuning_samples.TWO_STOREYS)
    document = json.loads(printed("tune", study, "--out", tmp_path / "out", "--threads", 1, "--json"))
    for law in (*document["laws"], *document["references"]):
        assert {"law", "settings", "train", "test", "candidates", "seconds", "certificate"} <= set(law)
        assert {"score", "criteria", "spread"} <= set(law["test"])
    assert [each["label"] for each in document["references"]] == [
        "Passive-off",
        "Optimal passive",
        "Passive-on",
        "Equal drift weights, R scanned",
        "Convex weights, R scanned",
        "Weights of dashpots, R scanned",
        "Semi-active weights, budget scanned",
    ]
    assert "html" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    read = mr.tuning.read_tuning(tmp_path / "out")
    assert read.laws[0].settings == document["laws"][0]["settings"]
    assert (
        mrwork("respond", tmp_path / "out" / "chosen.toml", "--out", tmp_path / "r", "--json").returncode == 0
    )


def test_placements_are_in_the_json_in_the_text_and_in_the_folder(tmp_path: Path) -> None:
    study = tuning_samples.study_file(
        tmp_path, building=tuning_samples.TWO_STOREYS, tune="[places]\ndampers = 2\n"
    )
    out = tmp_path / "out"
    document = json.loads(printed("tune", study, "--out", out, "--threads", 1, "--json"))
    assert len(document["places"]) == 3
    assert set(document["places"][0]) == {"storeys", "command", "train", "test", "given", "count"}
    assert [each.storeys for each in mr.tuning.read_tuning(out).places] == [
        each["storeys"] for each in document["places"]
    ]
    assert "3 placements of the dampers" in (out / "report.html").read_text(encoding="utf-8")
    text = printed("tune", study, "--out", tmp_path / "text", "--threads", 1)
    assert "3 placements of the dampers, each with its best constant command" in text
    assert mrwork("respond", out / "chosen.toml", "--out", tmp_path / "r", "--json").returncode == 0


def test_a_killed_tuning_resumes_to_the_same_document(tmp_path: Path) -> None:
    study = tuning_samples.study_file(tmp_path, building=tuning_samples.TWO_STOREYS)
    whole = mrwork("tune", study, "--out", tmp_path / "whole", "--threads", 1, "--json")
    journal = tmp_path / "cut.part" / "journal.jsonl"
    with started(*COMMAND, "tune", study, "--out", tmp_path / "cut", "--threads", "1", "--json") as process:
        wait_until(lambda: journal.is_file() and len(journal.read_bytes().splitlines()) > 6, process)
    text = printed("tune", study, "--out", tmp_path / "cut", "--threads", 1, "--json", "--resume")
    assert still(json.loads(text)) == still(json.loads(whole.stdout))


def test_bad_input_is_one_line_and_status_two(tmp_path: Path, refused: Refused) -> None:
    study = tuning_samples.study_file(tmp_path, tune="")
    refused.command("tune", study, "--law", "clipped_optimall", "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("verb", "function"), [("tune", "tuning.run.tune"), ("respond", "study.run.run_study")]
)
def test_the_folder_has_the_study_that_was_read(
    verb: str, function: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = tuning_samples.study_file(tmp_path, building=tuning_samples.TWO_STOREYS)
    content = study.read_bytes()
    module, _, name = function.rpartition(".")
    computed = getattr(importlib.import_module(f"mrwork.{module}"), name)

    def edited_meanwhile(*arguments: Any, **named: Any) -> Any:
        study.unlink()
        return computed(*arguments, **named)

    monkeypatch.setattr(f"mrwork.{function}", edited_meanwhile)
    printed(verb, study, "--out", tmp_path / "out", "--threads", "1", "--quiet")
    assert (tmp_path / "out" / "study.toml").read_bytes() == content
    if verb == "tune":
        assert content.decode().strip() in (tmp_path / "out" / "chosen.toml").read_text(encoding="utf-8")
