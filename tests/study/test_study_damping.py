"""A study says once, wherever it is read, that its building has undamped modes; one whose modes grow is refused."""

from __future__ import annotations

import html
import json
from pathlib import Path

import pytest
from command_line import mrwork

import mrwork as mr
from mrwork.study import read_results

SAID = "frame: 2 of 2 modes have no damping. Every damper looks better on a frame without damping"
STUDY = """[building]
name = "frame"
masses = [300.0, 300.0]
stiffnesses = [4e5, 4e5]
{damping}

[[damper]]
storey = 1
preset = "kwok2006"

[[motion]]
synthetic = "kanai_tajimi"
duration = 1
pga = 0.5

[[motion]]
synthetic = "kanai_tajimi"
duration = 1
pga = 0.5
seed = 1
use = "training"
name = "other"

[[controller]]
law = "passive_on"

[[tune]]
laws = ["clipped_optimal"]
budget = 6
population = 6
"""


def study(folder: Path, damping: str = "", more: str = "") -> Path:
    path = folder / "study.toml"
    path.write_text(STUDY.format(damping=damping) + more)
    return path


def plain(page: str) -> str:
    return " ".join(html.unescape(page).split())


def test_respond_says_it_once_on_the_terminal_in_json_on_the_page_and_in_python(tmp_path: Path) -> None:
    path, out = study(tmp_path), tmp_path / "run"
    ended = mrwork("respond", path, "--out", out, "--quiet")
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.count(f"warning: {SAID}") == (ended.stdout + ended.stderr).count(SAID) == 1
    assert plain((out / "report.html").read_text(encoding="utf-8")).count(SAID) == 1
    assert sum(SAID in each for each in read_results(out).warnings()) == 1
    ended = mrwork("respond", path, "--out", out, "--quiet", "--json")
    assert sum(SAID in each for each in json.loads(ended.stdout)["warnings"]) == 1
    results = mr.run_study(mr.read_study(path))
    assert sum(SAID in each for each in results.warnings()) == 1
    assert SAID in " ".join(repr(results).split())


def test_tune_says_it_once_on_the_terminal_on_the_page_and_in_python(tmp_path: Path) -> None:
    path, out = study(tmp_path), tmp_path / "tuned"
    ended = mrwork("tune", path, "--out", out, "--quiet")
    assert ended.returncode == 0, ended.stderr
    assert (ended.stdout + ended.stderr).count(SAID) == 1
    assert plain((out / "report.html").read_text(encoding="utf-8")).count(SAID) == 1
    results = mr.tuning.read_tuning(out)
    assert sum(SAID in each for each in results.warnings) == 1
    document = json.loads((out / "results.json").read_text())
    assert sum(SAID in each for each in document["warnings"]) == 1


@pytest.mark.parametrize(
    "damping",
    [
        "modal_damping = { ratios = [0.01] }",
        "rayleigh = { a0 = 0.1, a1 = 1e-4 }",
        "storey_damping = [200.0, 0.0]",
    ],
)
def test_a_damped_building_is_silent(tmp_path: Path, damping: str) -> None:
    assert mr.read_study(study(tmp_path, damping)).warnings == ()


def test_an_undamped_baseline_is_said_where_the_building_is_damped(tmp_path: Path) -> None:
    more = """
[[baseline]]
label = "another frame"
building = { modal_damping = { ratios = [0.0] }, name = "another" }
"""
    damped = "modal_damping = { ratios = [0.01] }"
    (said,) = mr.read_study(study(tmp_path, damped, more)).warnings
    assert said.startswith("another: 2 of 2 modes have no damping. ")
    said, _ = mr.read_study(study(tmp_path, "", more)).warnings
    assert said.startswith("frame: 2 of 2 modes have no damping. ")


def test_a_study_whose_building_has_negative_damping_ends_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    flipped = "[building]\npublished = 'utfpr'\ndamping = [[-1.2, 0.3], [0.3, -0.3]]\n"
    path.write_text(flipped + STUDY.partition("{damping}")[2])
    ended = mrwork("respond", path, "--out", tmp_path / "run", "--quiet")
    assert (ended.returncode, ended.stdout) == (2, "")
    (said,) = ended.stderr.splitlines()
    assert said.startswith(
        f"mrwork: {path}, line 1: building utfpr: 2 of 2 modes have negative damping, the worst is"
    )
    assert said.endswith("give a device that feeds energy as a control law, not as damping")
