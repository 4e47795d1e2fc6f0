"""A script designs a law without a file, and is refused as a study file is."""

from dataclasses import replace

import numpy as np
import pytest
from loop_samples import design_problem
from refusals import refusal

import mrwork as mr
from mrwork.control import DesignProblem, design_law
from mrwork.control.laws.law_settings import PassiveSettings
from mrwork.control.laws.regulator_settings import RegulatorSettings


def test_a_designed_law_is_the_one_made_by_hand() -> None:
    law = design_law("clipped_optimal", design_problem(), RegulatorSettings(control_weight=1e-7, drifts=1.0))
    plant = design_problem().plant
    outputs = mr.control.drifts(plant)
    by_hand = mr.control.regulator_of_outputs(plant, outputs, np.ones(len(outputs.names)), 1e-7)
    np.testing.assert_array_equal(np.asarray(law.gains["gain"]), by_hand.gain)
    by_name = design_law("clipped_optimal", design_problem(), {"control_weight": 1e-7, "drifts": 1.0})
    np.testing.assert_array_equal(np.asarray(law.gains["gain"]), np.asarray(by_name.gains["gain"]))


@pytest.mark.parametrize(
    ("law", "settings", "words"),
    [
        ("clipped_optimal", {}, "has no control_weight"),
        ("clipped_optimal", {"control_wieght": 1.0}, "did you mean control_weight"),
        ("clipped_optimal", {"control_weight": 1e-7, "drifts": [1.0, 2.0]}, "2 weights, .* 5 storeys"),
        ("passive", {"command": 5.0}, "1.88 at most"),
        ("clipped_optimum", {"control_weight": 1.0}, "did you mean clipped_optimal"),
        ("clipped_optimal", PassiveSettings(command=1.0), "takes RegulatorSettings"),
    ],
)
def test_a_setting_that_cannot_be_is_told(law: str, settings: object, words: str) -> None:
    refusal(design_law, law, design_problem(), settings, match=words)


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
    refusal(lambda: unstated.curve, match="is replaced by a static model")
    counterpart, _ = replace(unstated, amplitude=(1e-3, 1e-2), velocity=(1e-2, 1e-1)).curve
    assert counterpart.name == "static_hysteretic"
    assert design_problem().curve[0] == design_problem().devices[0].spec
