"""Control laws of a study: from settings to finished numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sentences import Refused

from mrwork import Device
from mrwork.base.keys import read_table
from mrwork.base.places import Place
from mrwork.buildings import building
from mrwork.control import (
    SETTINGS,
    ControlLaw,
    Design,
    DesignProblem,
    LoopModel,
    accelerations,
    control_law,
    control_laws,
    published_regulator,
    regulator_as_published,
    regulator_of_outputs,
)
from mrwork.control.laws.law_problem import LawSettings
from mrwork.dampers import damper
from mrwork.errors import SettingError
from mrwork.study.arrangements import laws_text
from mrwork.study.reading import parse

# What each law is told here; those that need nothing are told nothing.
TOLD = {
    "passive": "command = 0.5",
    "clipped_optimal": "control_weight = 1e-12",
    "modified_clipped_optimal": "control_weight = 1e-12\nfull_force = '1 kN'",
    "proportional_clipped_optimal": "control_weight = 1e-12\nfull_force = 1000",
    "modulated_homogeneous_friction": "slope = '100 kN/m'",
    "sliding_mode": "peak_acceleration = '0.3 g'\nlargest_force = 2000",
    "adaptive_sliding_mode": "peak_acceleration = 3\nlargest_force = 2000",
    "super_twisting": "peak_acceleration = 3\nlargest_force = 2000",
    "fuzzy": "deformation = '5 mm'\nrate = 0.1",
    "proportional_direct": "slope = 1e-3",
    "inverse_direct": "control_weight = 1e-12\ndrifts = 1e4",
    "inverse_parabola": "control_weight = 1e-12\ndrifts = 1e4",
    "inverse_network": "control_weight = 1e-12\namplitude = 0.005\nvelocity = 0.1\nhidden = 3",
    "signal_network": "control_weight = 1e-12\ndeformation = 0.005\nrate = 0.1\nforce = 2000\nnetwork = ["
    + ", ".join(["0.1"] * 25)
    + "]",
    "signal_polynomial": "control_weight = 1e-12\ndeformation = 0.005\nrate = 0.1\nforce = 2000",
    "active": "control_weight = 1e-12",
    "predictive_rollout": "base = 0.5\ndrift = '2 mm'\nacceleration = '0.28 g'",
}


def design_problem(
    name: str = "uts", preset: str = "kwok2006", model: str = "static_hysteretic"
) -> DesignProblem:
    frame, published = building(name), damper(model).preset(preset)
    device = Device(
        name="damper in storey 1",
        spec=published.spec,
        theta=np.array(published.theta),
        row=frame.storeys[0],
        differential=preset == "kwok2006",
        largest_command=published.largest_command or 0.0,
    )
    return DesignProblem(building=frame, devices=(device,), sample_time=1e-3)


def design(law: str, text: str, on: DesignProblem | None = None) -> Design:
    document, lines = parse(text, "study.toml")
    place = Place(origin="study.toml", lines=lines)
    settings: LawSettings = read_table(SETTINGS[law], document, place)
    with place.prefix_errors(SettingError):
        return settings.design(on or design_problem())


def test_an_inverse_network_gives_the_force_of_the_whole_group() -> None:
    """Two parallel dampers give twice the force at the same command, so the network takes twice the desired force."""
    one = replace(design_problem().devices[0], differential=False)
    tables = [
        design(
            "inverse_network",
            TOLD["inverse_network"],
            replace(design_problem(), devices=(replace(one, count=count),)),
        ).tables
        for count in (1, 2)
    ]
    deformation_rate_force = np.tile([1.0, 1.0, 2.0], 2)
    np.testing.assert_allclose(tables[1]["reach"], tables[0]["reach"] * deformation_rate_force, rtol=1e-12)
    layers = [np.asarray(each["layer"]).reshape(3, 8) for each in tables]
    np.testing.assert_allclose(layers[1][:, 1:7] * deformation_rate_force, layers[0][:, 1:7], rtol=1e-6)
    np.testing.assert_allclose(layers[1][:, [0, 7]], layers[0][:, [0, 7]], rtol=1e-6)


def test_every_law_of_the_registry_has_settings() -> None:
    assert set(SETTINGS) == {spec.name for spec in control_laws()}


@pytest.mark.parametrize("law", list(SETTINGS))
def test_a_design_has_the_numbers_that_its_law_takes(law: str) -> None:
    found = design(law, TOLD.get(law, ""))
    curve = design_problem().curve if control_law(law).needs_curve else None
    on = design_problem()
    model = LoopModel(building=on.building, devices=on.devices) if control_law(law).needs_model else None
    made = ControlLaw(name=law, gains=found.gains, tables=found.tables, curve=curve, model=model)
    n_gains = sum(
        {"device": 1, "state": 10, "loop": 1, "signal": 0}.get(gain.shape, gain.numbers)
        for gain in made.spec.gains
    )
    assert made.gain_rows(1, 10).shape == (1, n_gains)
    assert len(made.table_rows()) == len(made.spec.tables)


@pytest.mark.parametrize("law", list(SETTINGS))
def test_every_law_has_finite_numbers_for_each_device(law: str) -> None:
    found = design(law, TOLD.get(law, ""))
    for gain in found.gains.values():
        assert gain.shape in ((1,), (1, 2), (1, 5), (1, 10), (1, 25))
        assert np.isfinite(gain).all()
    for table in found.tables.values():
        assert np.isfinite(table).all()


def test_the_weights_of_dyke_are_stated_in_a_table() -> None:
    on = design_problem("dyke1996", "dyke1996", "modified_bouc_wen")
    found = design("clipped_optimal", "accelerations = [0, 0, 1]\ncontrol_weight = 1e-17", on)
    published = regulator_as_published(on.plant, published_regulator("dyke1996"))
    assert found.gains["gain"] == pytest.approx(published.gain, rel=1e-9)


def test_one_weight_stands_for_all_floors() -> None:
    on = design_problem()
    one = design("clipped_optimal", "accelerations = 2\ncontrol_weight = 1e-9", on)
    each = regulator_of_outputs(on.plant, accelerations(on.plant), [2.0] * 5, 1e-9)
    assert one.gains["gain"] == pytest.approx(each.gain, rel=1e-12)


def test_a_cheaper_force_is_wanted_more() -> None:
    dear = design("clipped_optimal", "control_weight = 1e-8").gains["gain"]
    cheap = design("clipped_optimal", "control_weight = 1e-9").gains["gain"]
    assert np.linalg.norm(cheap[:, 5:]) > np.linalg.norm(dear[:, 5:])


def test_the_force_of_a_sliding_law_pushes_its_surface_down() -> None:
    on = design_problem()
    found = design("sliding_mode", TOLD["sliding_mode"], on).gains
    # (S s)' = S B f + ..., and the law adds +rho sat(S s/phi) to f.
    assert (found["surface"] @ on.plant.B).item() == pytest.approx(-1.0)


def test_a_mistake_is_one_sentence_with_its_line(refused: Refused) -> None:
    for law, text in (
        ("clipped_optimal", "drifts = [1, 2]\ncontrol_weight = 1"),
        ("clipped_optimal", "drifts = 1\nenergy = 1\ncontrol_weight = 1"),
        ("clipped_optimal", "drifts = -1\ncontrol_weight = 1"),
        ("passive", "command = 3"),
        ("sliding_mode", "peak_acceleration = '3 N'\nlargest_force = 1"),
    ):
        refused(design, law, text)


def test_the_printed_laws_have_every_setting() -> None:
    text = laws_text()
    for name in SETTINGS:
        assert f"{name}: " in text
    assert "best_passive" in text
