"""The verbs `fragility` and `tune`: one JSON object, tables, sentences and files."""

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest
import tuning_samples
from command_line import mrwork, printed
from refusals import command_refusal
from study_texts import ONE_STOREY

import mrwork as mr
from mrwork.tuning import tuning_run

STUDY = f"""design_level = "0.3 g"
{ONE_STOREY}[report]
limit = {{ peak_drift_ratio = "0.4 %" }}
""" + "".join(
    f"""[[motion]]
synthetic = "kanai_tajimi"
name = "record {seed}"
seed = {seed}
duration = 3
sa = ["0.1 g", "0.3 g", "0.6 g", "1.2 g"]
"""
    for seed in range(3)
)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("fragility")
    (place / "study.toml").write_text(STUDY)
    printed("respond", place / "study.toml", "--out", place / "out", "--quiet")
    return place / "out"


def test_it_has_the_numbers_of_the_function_and_the_limit_of_the_page(run: Path) -> None:
    own = mr.fragility(mr.load(run, mr.StudyResults), {"peak_drift_ratio": 0.004}, level=0.8)
    document = json.loads(printed("fragility", run, "--level", "0.8", "--json"))
    assert (document["criterion"], document["limit"]) == ("peak_drift_ratio", 0.004)
    assert [each["median"] for each in document["arrangements"]] == [
        each.median for each in own.rows.values()
    ]
    assert document["sentences"] == list(own.in_words())
    text = printed("fragility", run, "--limit", "peak_drift_ratio = 0.4 %", "--against", "uncontrolled")
    assert "the median Sa(0.257 s, 5 %) at which the peak drift ratio reaches 0.4 %" in " ".join(text.split())


def test_it_writes_its_table_and_figures_beside_it(run: Path, tmp_path: Path) -> None:
    table = tmp_path / "new" / "limit.csv"
    document = json.loads(printed("fragility", run, "--output", table, "--json"))
    names = ["limit-fragility.svg", "limit-ida.svg", "limit.csv"]
    assert sorted(Path(each).name for each in document["files"]) == names
    assert sorted(each.name for each in table.parent.iterdir()) == names
    head, *lines = table.read_text().splitlines()
    assert head == 'arrangement,"Sa(0.257 s, 5 %) [m/s2]",probability,reached,beyond tests'
    assert len(lines) == 3 * 4
    command_refusal("fragility", run, "--output", table, match="--replace")
    printed("fragility", run, "--output", table, "--replace")


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
        assert {"score", "criteria"} <= set(law["test"])
    passive = ["Passive-off", "Optimal passive", "Passive-on"]
    assert [each["label"] for each in document["references"]][:3] == passive
    assert len(document["references"]) == 7
    assert mr.tuning.read_tuning(tuned / "out").tuned.laws[0].settings == document["laws"][0]["settings"]
    printed("respond", tuned / "out" / "chosen.toml", "--out", tmp_path / "r", "--json")


def test_placements_are_in_the_json_in_the_text_and_in_the_folder(tmp_path: Path) -> None:
    study = tuning_samples.study_file(
        tmp_path, building=tuning_samples.TWO_STOREYS, tune="[places]\ndampers = 2\n"
    )
    out = tmp_path / "out"
    document = json.loads(printed("tune", study, "--out", out, "--threads", 1, "--json"))
    assert len(document["places"]) == 3
    assert set(document["places"][0]) == {"storeys", "command", "train", "test", "given", "count"}
    assert [each.storeys for each in mr.tuning.read_tuning(out).tuned.places] == [
        each["storeys"] for each in document["places"]
    ]
    assert mrwork("respond", out / "chosen.toml", "--out", tmp_path / "r", "--json").returncode == 0


@pytest.mark.long
def test_the_folder_has_the_study_that_was_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    study = tuning_samples.study_file(tmp_path, building=tuning_samples.TWO_STOREYS)
    content, computed = study.read_bytes(), tuning_run.tune

    def edited_meanwhile(*arguments: Any, **named: Any) -> Any:
        study.unlink()
        return computed(*arguments, **named)

    monkeypatch.setattr(tuning_run, "tune", edited_meanwhile)
    printed("tune", study, "--out", tmp_path / "out", "--threads", "1", "--quiet")
    assert (tmp_path / "out" / "study.toml").read_bytes() == content
    read, chosen = (
        tomllib.loads(content.decode()),
        tomllib.loads((tmp_path / "out" / "chosen.toml").read_text()),
    )
    assert {name: chosen[name] for name in read if name != "controller"} == {
        name: table for name, table in read.items() if name != "controller"
    }
    assert chosen["controller"][: len(read.get("controller", []))] == read.get("controller", [])
    assert Path(chosen["folder"]) == study.parent
