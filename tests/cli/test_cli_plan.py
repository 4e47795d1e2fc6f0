"""`mrwork plan`: from a run folder to a ranking, a document and a map in it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from command_line import printed
from refusals import command_refusal


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("plan") / "run"
    fitted = ("synthetic:rd1005_1a", "--every", "4", "--model", "static_hysteretic", "--fix", "x_s=1e-4")
    printed("identify", *fitted, "--quiet", "--out", place)
    return place


def test_a_plan_names_the_best_test_first(run: Path) -> None:
    lists = ("--amplitudes", "0.005,0.01,0.02", "--frequencies", "0.5,1,2")
    text = printed("plan", run, "--band", "c", *lists)
    assert "Of 9 tests this one narrows the band of c most: 20 mm, 2 Hz" in text
    gains = json.loads((run / "plan.json").read_text())["plan"]["gains"]
    assert [each["gain"] for each in gains] == sorted((each["gain"] for each in gains), reverse=True)
    assert gains[0]["candidate"] == {"amplitude": 0.02, "frequency": 2.0, "command": None}


def test_json_is_one_object(run: Path, tmp_path: Path) -> None:
    table = tmp_path / "tests.csv"
    table.write_text("amplitude,frequency\n0.01,1\n0.02,1\n0.03,1\n")
    arguments = ("plan", run, "--json", "--candidates", table, "--stroke", "0.05", "--targets", table)
    document = json.loads(printed(*arguments))
    assert len(document["plan"]["gains"]) == 2
    assert document["plan"]["band"] == "force"
    assert document["limits"] == {"stroke": 0.05, "peak_velocity": None}


@pytest.mark.parametrize(
    ("words", "word"),
    [
        (("--band", "x_s"), "x_s is fixed"),
        (("--amplitudes", "5,10"), "--amplitudes: '5'"),
        (("--candidates", "a.csv", "--frequencies", "1"), "one or the other"),
    ],
)
def test_what_cannot_be_planned_is_refused(run: Path, words: tuple[str, ...], word: str) -> None:
    command_refusal("plan", run, *words, match=word)


def test_draws_of_the_posterior_are_used_where_there_are_some(run: Path, tmp_path: Path) -> None:
    sampled = Path(shutil.copytree(run, tmp_path / "sampled"))
    printed("sample", sampled, "--steps", 40, "--walkers", 16, "--threads", 1, "--quiet")
    lists = ("--amplitudes", "0.005,0.02", "--frequencies", "0.5,2")
    assert "Draws of the posterior" in printed("plan", sampled, *lists)
    (sampled / "posterior.nc").write_text("no")
    command_refusal("plan", sampled, *lists, match="run `mrwork sample .*sampled` again")
