"""Isolators are strokes, whether the isolated frame is the building of a study or a baseline beside it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refusal

import mrwork as mr
from mrwork.control.laws.law_settings import design_law, settings_of

FRAME: dict[str, Any] = {
    "masses": [1e5] * 3, "stiffnesses": [2e8, 1.5e8, 1e8], "rayleigh": {"ratios": [0.02, 0.02]}
}  # fmt: skip
RUBBER: dict[str, Any] = {"isolation": {"mass": 1e5, "period": 2.5, "ratio": 0.1}}
LEAD: dict[str, Any] = {"lead_rubber": {"mass": 1e5, "period": 2.5, "yield_force": 1e5}}
HEIGHTS = {"heights": [3.5, 3.0, 3.0]}
MOTIONS = [{"synthetic": "kanai_tajimi", "duration": 5, "pga": "0.3 g"}]


def isolated(frame: dict[str, Any], **more: Any) -> mr.study.StudyResults:
    return mr.run_study(mr.study_of(building=frame, motions=MOTIONS, **more))


@pytest.mark.parametrize("bearings", [RUBBER, LEAD], ids=["rubber", "lead"])
@pytest.mark.parametrize("heights", [HEIGHTS, {}], ids=["heights", "none"])
def test_results_are_the_same_as_building_and_as_baseline(
    bearings: dict[str, Any], heights: dict[str, Any]
) -> None:
    frame = FRAME | heights
    beside = isolated(frame, baselines=[{"label": "isolated", "building": bearings}])
    alone = isolated(frame | bearings)
    for group in ("criteria", "quantities"):
        one = beside.to_xarray()[group].to_dataset().sel(row="isolated")
        other = alone.to_xarray()[group].to_dataset().sel(row="uncontrolled")
        for name in one:
            np.testing.assert_array_equal(one[name].values, other[name].values, err_msg=str(name))
    drift = alone.criteria_of_runs.peak_drift[0, 0, 0]
    assert 20.0 * drift < alone.criteria_of_runs.peak_stroke[0, 0, 0]
    assert alone.quantities.axes["storey"] == ("storey 1", "storey 2", "storey 3")
    assert alone.quantities.axes["floor"] == ("floor 1", "floor 2", "floor 3")


def test_a_tuned_mass_of_the_building_has_its_stroke_beside_dampers_too() -> None:
    tuned = FRAME | {"tuned_mass": [{"floor": 3, "mass_ratio": 0.02}]}
    brace = {"stiffness": 2e8}
    results = isolated(
        tuned, dampers=[{"storey": 1, "preset": "kwok2006", "brace": brace}], laws=["passive_on"]
    )
    assert results.quantities.axes["device"] == ("damper in storey 1", "tuned mass")
    strokes = results.quantities.peak_stroke[:, 0, 0]
    assert np.isnan(strokes[:, 0]).tolist() == [True, *[False] * (len(strokes) - 1)]
    np.testing.assert_allclose(strokes[:, 1], strokes[0, 1], rtol=0.05)
    np.testing.assert_array_equal(results.criteria_of_runs.peak_stroke[:, 0, 0], strokes[:, 1])


def test_isolators_of_own_matrices_are_named_or_have_no_height(tmp_path: Path) -> None:
    built = mr.study_of(building=FRAME | HEIGHTS | RUBBER, motions=MOTIONS).building
    stiffness, damping = built.stiffness.tolist(), built.damping.tolist()
    chain = {"mass": built.mass.tolist(), "stiffness": stiffness, "damping": damping}
    expected = isolated(FRAME | HEIGHTS | RUBBER).criteria_of_runs
    for stated in ({"heights": [0.0, 3.5, 3.0, 3.0]}, {"isolators": ["storey 1"]}):
        found = isolated(chain | stated)
        assert found.quantities.axes["storey"] == ("storey 2", "storey 3", "storey 4")
        for name in ("peak_drift", "peak_stroke", "peak_acceleration"):
            np.testing.assert_allclose(found.criteria_of_runs.numbers[name], expected.numbers[name])
    refusal(isolated, chain | {"isolators": ["base"]}, match="isolators names 'base'")
    # Heights of strokes alone make no isolators of a frame that has nothing else.
    single = mr.buildings.shear_building(masses=[1.0], stiffnesses=[1.0])
    assert len(mr.buildings.with_base_isolation(single, mass=1.0, stiffness=1.0, damping=0.0).drifts) == 1
    # A study file of a building that was given as a value keeps them.
    study = mr.study_of(building=built, motions=MOTIONS)
    again = mr.read_study(study.to_toml(tmp_path / "study.toml"))
    assert again.building.isolators == ("isolation",)
    assert again.building.drift_names == built.drift_names


@pytest.mark.parametrize("storey", ["isolation", "storey 1"])
def test_dampers_and_laws_see_isolators_as_strokes(storey: str) -> None:
    damper = {"storey": storey, "preset": "kwok2006", "count": 20}
    laws = [{"law": "clipped_optimal", "settings": {"control_weight": 1e-12}}]
    study = mr.study_of(building=FRAME | HEIGHTS | RUBBER, dampers=[damper], laws=laws, motions=MOTIONS)
    results = mr.run_study(study)
    drifts = results.quantities.peak_drift[:, 0, 0]
    np.testing.assert_array_equal(results.criteria_of_runs.peak_drift[:, 0, 0], drifts.max(axis=1))
    # The stroke of the isolators stands in every row, behind that of the dampers.
    assert results.quantities.axes["device"][:2] == (f"damper in {storey}", "isolation")
    strokes = results.quantities.peak_stroke[:, 0, 0]
    assert (strokes[:, 1] > 10.0 * drifts.max(axis=1)).all()
    of_damper = strokes[:, 1] if storey == "isolation" else drifts[:, 0]
    np.testing.assert_allclose(strokes[1:, 0], of_damper[1:])
    assert results.dampers[0].place == storey
    # One weight of all drifts leaves the isolators free; a list has one for each storey.
    gains = []
    for drifts in (1.0, (0.0, 1.0, 1.0, 1.0), (1.0, 1.0, 1.0, 1.0)):
        settings = settings_of("clipped_optimal", {"drifts": drifts, "control_weight": 1e-12})
        gains.append(design_law("clipped_optimal", study.problem, settings).gains["gain"])
    free, listed, held = gains
    np.testing.assert_allclose(free, listed)
    assert np.abs(held - free).max() > 1e-3 * np.abs(free).max()
    limits = mr.control.RmsLimits(rms_drift=(2e-3, 2e-3, 3e-3))
    designed = mr.control.design_weights(study.building, study.devices, limits=limits, budget=1e5)
    assert designed.outputs.names[:3] == tuple(f"drift storey {number}" for number in (1, 2, 3))


def test_expected_strokes_of_dampers_are_not_those_of_isolators() -> None:
    damper = {"storey": "storey 1", "preset": "kwok2006", "count": 20}
    study = mr.study_of(building=FRAME | HEIGHTS | RUBBER, dampers=[damper], laws=["fuzzy"], motions=MOTIONS)
    (settings,) = (taken for _, taken in mr.study.designed(study).taken_settings)
    words = " ".join(settings.in_words)
    low, high = (float(end) for end in words.partition("deformation from ")[2].split()[:3:2])
    off = mr.run_study(study).quantities.peak_stroke[1, 0, 0]
    assert low < off[0] < high
    assert off[1] > 90.0 * off[0]
