"""Dampers of a rig or of the user in a study: a run of `mrwork identify`, by the twin, or with another model."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import own_dampers
import pytest
from command_line import printed
from refusals import refusal

import mrwork as mr
from mrwork.errors import MrworkWarning
from mrwork.identification.fit import Fit

STUDY = """\
[building]
published = "uts"

[[damper]]
storey = 1
run = "rig/run"
{more}

{controller}

[[motion]]
synthetic = "kanai_tajimi"
duration = 4
pga = "0.1 g"

[report]
histories = "none"
"""


ON = '[[controller]]\nlaw = "passive_on"\nlabel = "on"'
CLIPPED = '[[controller]]\nlaw = "clipped_optimal"'


def responded(folder: Path, more: str, controller: str = "") -> dict[str, Any]:
    """The runs of the study, by label."""
    (folder / "study.toml").write_text(STUDY.format(more=more, controller=controller))
    text = printed("respond", folder / "study.toml", "--out", folder / "out", "--json")
    return {entry["controller"]: entry for entry in json.loads(text)["results"]}


@pytest.fixture(scope="module")
def without_laws(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a run without laws."""
    folder = tmp_path_factory.mktemp("identified")
    record = ("synthetic:rd1005_1a", "--every", "4", "--model", "bingham", "--quiet")
    printed("identify", *record, "--out", folder / "rig" / "run")
    return folder


def test_a_run_without_laws_is_taken_as_a_passive_damper_where_the_study_says_so(without_laws: Path) -> None:
    found = responded(without_laws, more="passive = true")
    assert set(found) == {"uncontrolled", "passive"}
    assert found["passive"]["outcome"] == "finished"
    assert found["passive"]["energy_error"] < 1e-6
    assert found["passive"]["criteria"]["peak_drift"] < found["uncontrolled"]["criteria"]["peak_drift"]


@pytest.mark.parametrize(
    ("more", "controller", "word"),
    [
        ("", "", "line 4: no parameter of this bingham .* depends on the command"),
        ("passive = true\nlargest_command = 1.0", "", "line 8: a passive damper takes no command"),
        ("passive = true", CLIPPED, "line 10: clipped_optimal commands the dampers, and they are passive"),
    ],
)
def test_a_run_without_laws_is_no_controllable_damper(
    without_laws: Path, more: str, controller: str, word: str
) -> None:
    study = without_laws / "study.toml"
    study.write_text(STUDY.format(more=more, controller=controller))
    refusal(mr.read_study, study, match=word)


def test_a_passive_damper_may_be_called_passive_off(without_laws: Path) -> None:
    study = without_laws / "study.toml"
    study.write_text(STUDY.format(more="passive = true", controller=ON.replace("_on", "_off")))
    assert [each.row.label for each in mr.read_study(study).arrangements] == ["uncontrolled", "on"]


# Dampers of the user


FRAME = mr.building("uts")
MOTIONS = [mr.synthetic_motion(rng=0, peak=3.0, duration=1.0)]
PARAMETERS = {
    "c": [1232.0, 1929.0], "k": 5100.0, "alpha": [32.0, 918.0], "beta": 100.0, "delta": 0.58, "x_s": 1e-4, "f0": 0.0,
}  # fmt: skip


def study(damper: dict[str, Any], laws: list[Any], **given: Any) -> mr.Study:
    return mr.study_of(building=FRAME, dampers=[{"storey": 1, **damper}], laws=laws, motions=MOTIONS, **given)


def stated(model: mr.DamperSpec | str) -> dict[str, Any]:
    return {"model": model, "parameters": PARAMETERS, "largest_command": 1.5}


@pytest.fixture(scope="module")
def fit() -> Fit:
    """Of a damper of the user, from tests at three commands."""
    time = np.arange(0.0, 1.0, 0.005)
    truth = mr.damper("hyperbolic_tangent_guo").with_current_laws({"A1": "linear"})
    tests = []
    for command, stroke, frequency in (
        (0.0, 0.01, 2.0),
        (0.5, 0.004, 3.0),
        (1.0, 0.01, 1.0),
        (1.0, 0.004, 3.0),
    ):
        motion = stroke * np.sin(2.0 * np.pi * frequency * time)
        loading = mr.Loading(dt=0.005, displacement=motion, command=command, command_unit="A")
        force = mr.simulate_force(truth, [300.0, 600.0, 2000.0, 40.0, 3.0, 0.0], loading)
        tests.append(mr.test_from_arrays(time, motion, force, name=f"{command}", current=command))
    return mr.identify(own_dampers.guo.with_current_laws({"A1": "linear"}), tests)


def test_the_twin_has_the_criteria_of_the_lanes() -> None:
    laws = ["passive_on", "best_passive"]
    own, lanes = (
        mr.run_study(study(stated(model), laws)) for model in (own_dampers.static, "static_hysteretic")
    )
    for name in ("peak_drift", "peak_acceleration", "device_energy"):
        ours, theirs = (each.to_pandas()[name].to_numpy(dtype=float) for each in (own, lanes))
        np.testing.assert_allclose(ours, theirs, rtol=1e-6, err_msg=name)
    assert np.nanmax(own.to_pandas()["energy_error"].to_numpy(dtype=float)) < 1e-3


def test_what_the_twin_lacks_is_refused_before_anything_runs() -> None:
    own = stated(own_dampers.static)
    for law in ("inverse_direct", lambda sample, memory: 1.0):
        refusal(study, own, [law], match=r"cannot have the law .* like = ")
    refusal(study, own, ["passive_on"], hardware=mr.Hardware(feedback="observer"), match="an observer")
    refusal(study, own | {"like": "bouc_wen"}, ["passive_on"], match="give a run")


def test_another_model_takes_its_place_and_says_how_close_it_is(fit: Fit, tmp_path: Path) -> None:
    near = mr.fit_like(fit, "hyperbolic_tangent_guo")
    assert near.tested == fit.tested
    assert "differs from it by " in near.warnings[0]
    assert near.fit_percent > 99.0
    with pytest.warns(MrworkWarning, match="hyperbolic_tangent_guo takes the place of my_guo in the study"):
        placed = study({"run": fit, "like": "hyperbolic_tangent_guo"}, ["clipped_optimal"])
    assert placed.devices[0].spec.own is None
    assert any("taken as hyperbolic_tangent_guo" in str(fact) for fact in placed.facts)
    own = study({"run": fit}, ["passive_on"])
    own.to_toml(tmp_path / "study.toml")
    again = mr.read_study(tmp_path / "study.toml")
    assert again.devices[0].spec == fit.spec
