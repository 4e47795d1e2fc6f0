"""A script designs a law without a file, and is refused as a study file is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sentences import Refused

import mrwork as mr
from mrwork.control import DesignProblem, PassiveSettings, RegulatorSettings, design_law
from mrwork.errors import SettingError


def problem() -> DesignProblem:
    frame, rd1005 = mr.building("uts"), mr.damper("static_hysteretic").preset("kwok2006")
    damper = mr.Device(
        name="storey 1", spec=rd1005.spec, theta=rd1005.theta, row=frame.storeys[0], largest_command=1.88
    )
    return DesignProblem(building=frame, devices=[damper], sample_time=1e-3)


def test_a_designed_law_is_the_one_made_by_hand() -> None:
    law = design_law("clipped_optimal", problem(), RegulatorSettings(control_weight=1e-7, drifts=1.0))
    plant = problem().plant
    outputs = mr.control.drifts(plant)
    by_hand = mr.control.regulator_of_outputs(plant, outputs, np.ones(len(outputs.names)), 1e-7)
    np.testing.assert_array_equal(np.asarray(law.gains["gain"]), by_hand.gain)


def test_a_setting_that_cannot_be_is_refused(refused: Refused) -> None:
    for law, settings in (
        ("clipped_optimal", {}),
        ("clipped_optimal", {"control_weight": -1.0}),
        ("clipped_optimal", {"control_weight": float("nan")}),
        ("clipped_optimal", {"control_wieght": 1.0}),
        ("clipped_optimal", {"control_weight": 1e-7, "drifts": [1.0, 2.0]}),
        ("passive", {"command": 5.0}),
        ("clipped_optimum", {"control_weight": 1.0}),
    ):
        refused(design_law, law, problem(), settings)


def test_settings_are_refused_when_they_are_made(refused: Refused) -> None:
    refused(RegulatorSettings, control_wieght=1.0)
    refused(RegulatorSettings, drifts=1.0)


def test_settings_of_another_law_are_refused(refused: Refused) -> None:
    refused(design_law, "clipped_optimal", problem(), PassiveSettings(command=1.0))


def test_values_by_name_and_settings_design_the_same_law() -> None:
    by_name = design_law("clipped_optimal", problem(), {"control_weight": 1e-7, "drifts": 1.0})
    law = design_law("clipped_optimal", problem(), RegulatorSettings(control_weight=1e-7, drifts=1.0))
    np.testing.assert_array_equal(np.asarray(law.gains["gain"]), np.asarray(by_name.gains["gain"]))


def test_a_static_damper_is_its_own_curve_and_another_model_needs_a_counterpart() -> None:
    spec = mr.damper("static_hysteretic").with_current_laws(
        {"c": "linear", "alpha": "cubic", "beta": "linear"}
    )
    frame = mr.building("uts")
    damper = mr.Device(
        name="storey 1", spec=spec, theta=np.ones(len(spec.names)), row=frame.storeys[0], largest_command=1.0
    )
    own = DesignProblem(building=frame, devices=[damper], sample_time=1e-3)
    assert own.curve[0] == spec
    hyperbolic = mr.damper("modified_bouc_wen").preset("dyke1996")
    damper = replace(damper, spec=hyperbolic.spec, theta=hyperbolic.theta, largest_command=2.25)
    unstated = DesignProblem(building=frame, devices=[damper], sample_time=1e-3)
    with pytest.raises(SettingError, match="is replaced by a static model"):
        _ = unstated.curve
    counterpart, _ = replace(unstated, amplitude=(1e-3, 1e-2), velocity=(1e-2, 1e-1)).curve
    assert counterpart.name == "static_hysteretic"
    assert problem().curve[0] == problem().devices[0].spec


def test_only_the_ideal_law_commands_forces() -> None:
    assert [spec.name for spec in mr.control.control_laws() if spec.commands_force] == ["active"]
