"""Studies with a damper of the user: by the twin of the loop, or with the model that takes its place."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import own_dampers
import pytest
from sentences import Refused

import mrwork as mr
from mrwork.errors import MrworkWarning
from mrwork.identification.fit import Fit

FRAME = mr.building("uts")
MOTIONS = [mr.synthetic_motion(rng=0, peak=3.0, duration=3.0)]
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
    time = np.arange(0.0, 2.0, 0.005)
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


def test_what_the_twin_lacks_is_refused_before_anything_runs(refused: Refused) -> None:
    for given in ({"laws": ["inverse_direct"]}, {"laws": [lambda sample, memory: 1.0]}):
        refused(study, stated(own_dampers.static), **given)
    refused(study, stated(own_dampers.static), ["passive_on"], hardware=mr.Hardware(feedback="observer"))
    refused(study, stated(own_dampers.static) | {"like": "bouc_wen"}, ["passive_on"])


def test_another_model_takes_its_place_and_says_how_close_it_is(
    fit: Fit, tmp_path: Path, refused: Refused
) -> None:
    near = mr.fit_like(fit, "hyperbolic_tangent_guo")
    assert near.tested == fit.tested
    assert "differs from it by " in near.warnings[0]
    assert near.fit_percent > 99.0
    with pytest.warns(MrworkWarning, match="hyperbolic_tangent_guo takes the place of my_guo in the study"):
        placed = study({"run": fit, "like": "hyperbolic_tangent_guo"}, ["clipped_optimal"])
    assert placed.devices[0].spec.own is None
    assert any("taken as hyperbolic_tangent_guo" in str(fact) for fact in placed.facts)
    refused(study, {"run": fit, "like": "guo"}, ["passive_on"])
    own = study({"run": fit}, ["passive_on"])
    own.to_toml(tmp_path / "study.toml")
    again = mr.read_study(tmp_path / "study.toml")
    assert again.devices[0].spec == fit.spec
    assert mr.run_study(again).to_pandas()["peak_drift"].notna().all()


def test_loadings_without_a_command_are_refused(fit: Fit, refused: Refused) -> None:
    refused(mr.fit_like, fit, "bingham", [])
    refused(mr.fit_like, fit, "bingham", [mr.Loading(dt=0.01, displacement=np.sin(np.arange(99.0)))])
