"""`mrwork tune`: one JSON object, exit statuses, a killed tuning resumed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import tuning_samples
from command_line import mrwork, printed

import mrwork as mr
from mrwork.tuning import run as tuning_run


@pytest.fixture(scope="module")
def tuned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study and the run folder of its tuning, with the JSON that was printed."""
    place = tmp_path_factory.mktemp("tuned")
    study = tuning_samples.study_file(place, building=tuning_samples.TWO_STOREYS)
    text = printed("tune", study, "--out", place / "out", "--threads", 1, "--json")
    (place / "printed.json").write_text(text)
    return place


def test_json_has_laws_and_references_in_one_form(tuned: Path, tmp_path: Path) -> None:
    document = json.loads((tuned / "printed.json").read_text())
    for law in (*document["laws"], *document["references"]):
        assert {"law", "settings", "train", "test", "candidates", "seconds", "certificate"} <= set(law)
        assert {"score", "criteria", "spread"} <= set(law["test"])
    passive = ["Passive-off", "Optimal passive", "Passive-on"]
    assert [each["label"] for each in document["references"]][:3] == passive
    assert len(document["references"]) == 7
    assert mr.tuning.read_tuning(tuned / "out").laws[0].settings == document["laws"][0]["settings"]
    printed("respond", tuned / "out" / "chosen.toml", "--out", tmp_path / "r", "--json")


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
    assert mrwork("respond", out / "chosen.toml", "--out", tmp_path / "r", "--json").returncode == 0


def test_the_folder_has_the_study_that_was_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    study = tuning_samples.study_file(tmp_path, building=tuning_samples.TWO_STOREYS)
    content, computed = study.read_bytes(), tuning_run.tune

    def edited_meanwhile(*arguments: Any, **named: Any) -> Any:
        study.unlink()
        return computed(*arguments, **named)

    monkeypatch.setattr(tuning_run, "tune", edited_meanwhile)
    printed("tune", study, "--out", tmp_path / "out", "--threads", "1", "--quiet")
    assert (tmp_path / "out" / "study.toml").read_bytes() == content
    assert content.decode().strip() in (tmp_path / "out" / "chosen.toml").read_text(encoding="utf-8")
