"""`mrwork profile`: from a run folder to a table, a document and a figure in it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from command_line import printed

import mrwork as mr
from mrwork import load
from mrwork.identification.fit_file import read_fit


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("profile") / "run"
    fitted = ("synthetic:rd1005_1a", "--every", "4", "--model", "static_hysteretic")
    printed("identify", *fitted, "--quiet", "--out", place)
    return place


@pytest.fixture(scope="module")
def valley(run: Path) -> Path:
    """The run with delta and x_s halved, which the force hardly shows: the fit is at a bound of delta."""
    place = run.parent / "valley"
    shutil.copytree(run, place)
    document = json.loads((place / "fit.json").read_text())
    for estimate in document["estimates"]:
        if estimate["name"] in ("delta", "x_s"):
            estimate |= {"value": 0.5 * estimate["value"], "remark": ""}
    (place / "fit.json").write_text(json.dumps(document))
    # That of a fit with other parameters would be refused.
    (place / "manifest.json").write_text("{}")
    return place


def test_a_profile_says_what_the_data_settle(valley: Path) -> None:
    text = printed("profile", valley, "--quiet")
    (alpha,) = [line for line in text.splitlines() if line.strip().startswith("alpha ")]
    assert alpha.endswith("identifiable")
    (delta,) = [line for line in text.splitlines() if line.strip().startswith("delta ")]
    assert "open" in delta
    assert "weakly identifiable" in delta or "not identifiable" in delta
    assert "delta/x_s is better identifiable" in text
    document = json.loads((valley / "profiles.json").read_text())
    assert [each["name"] for each in document["profiles"]] == [*mr.damper("static_hysteretic").names]


def test_json_is_one_object_and_what_is_written(valley: Path) -> None:
    document = json.loads(printed("profile", valley, "--json", "--level", "0.5", "--parameter", "c"))
    (c,) = document["profiles"]
    assert c["lower"] < c["estimate"] < c["upper"]
    written = json.loads((valley / "profiles.json").read_text())
    assert written["profiles"] == document["profiles"]
    assert (document["level"], document["status"]) == (0.5, "finished")
    assert document["directions"]


def test_intervals_take_the_place_of_standard_errors_everywhere(run: Path, tmp_path: Path) -> None:
    place = tmp_path / "profiled"
    shutil.copytree(run, place)
    (place / "profiles.json").unlink(missing_ok=True)
    # Of one parameter only: the table keeps its standard errors, as it has one kind of uncertainty.
    printed("profile", place, "--quiet", "--parameter", "c")
    assert load(place).fit.intervals is None
    document = json.loads(printed("profile", place, "--json"))
    (c,) = [each for each in document["profiles"] if each["name"] == "c"]
    fit = load(place).fit
    assert fit == read_fit(place)
    assert "standard error" not in repr(fit)
    assert f"{c['lower']:.4g} to {c['upper']:.4g}" in repr(fit)
    stored = json.loads((place / "fit.json").read_text())["intervals"]
    assert (stored["kind"], stored["level"]) == ("profile", 0.95)
    judged = {each["name"]: each["verdict"] for each in document["profiles"]}
    assert {name: fit.verdict_on(name)[0] for name in judged} == judged
