"""Which damper a study means."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from refusals import refusal
from study_samples import ranges

import mrwork as mr
from mrwork.base.keys import read_table
from mrwork.base.places import Place
from mrwork.dampers import damper
from mrwork.dampers.tested_range import FittedDamper
from mrwork.errors import RecordError
from mrwork.study.dampers import ChosenDamper, chosen_damper
from mrwork.study.reading import parse
from mrwork.study.schema import DamperTable

TESTED = ranges(command=(0.5, 4.003), command_unit="V")


def identified(run: Path) -> FittedDamper:
    if run.name == "valve":
        spec = damper("dahl").with_current_laws({"k_w": "values:0,50"}, unit="%")
        return FittedDamper(spec=spec, theta=tuple(spec.nominal.tolist()), tested=None)
    if run.name not in ("run", "old"):
        raise RecordError(f"{run} does not exist; give the run folder")
    preset = damper("bouc_wen").preset("jansen2000")
    return FittedDamper(spec=preset.spec, theta=preset.theta, tested=TESTED if run.name == "run" else None)


def chosen(text: str) -> ChosenDamper:
    document, lines = parse(f"storey = 1\n{text}", "study.toml")
    table = read_table(DamperTable, document, Place(origin="study.toml", lines=lines))
    return chosen_damper(table, Path("place"), identified)


@pytest.mark.parametrize(
    ("model", "name"),
    [("static_hysteretic", "kwok2006"), ("modified_bouc_wen", "dyke1996"), ("bouc_wen", "yoshida2004")],
)
def test_a_preset_is_that_of_its_model(model: str, name: str) -> None:
    preset = damper(model).preset(name)
    found = chosen(f'preset = "{name}"')
    assert found.spec == preset.spec
    assert found.theta.tolist() == list(preset.theta)
    assert found.largest_command == preset.largest_command


def test_a_parameter_of_a_preset_is_changed_and_no_other() -> None:
    preset = damper("modified_bouc_wen").preset("dyke1996")
    found = chosen('preset = "dyke1996"\nparameters = { x0 = 0.0 }\nlargest_command = 1.5')
    differs = np.flatnonzero(found.theta != np.array(preset.theta))
    assert [preset.spec.names[index] for index in differs] == ["x0"]
    assert found.largest_command == 1.5


def test_a_damper_written_out_is_the_same_as_its_preset() -> None:
    preset = damper("bouc_wen").preset("jansen2000")
    found = chosen(
        'model = "bouc_wen"\nunit = "V"\nlag = 190.0\nlargest_command = 5.0\n'
        "parameters = { c0 = [0.64, 0.52], k0 = 0, x0 = 0, alpha = [866, 886], "
        "gamma = 3e6, beta = 3e6, A = 120, n = 2 }"
    )
    assert found.spec == preset.spec
    assert found.theta.tolist() == list(preset.theta)


def test_a_law_that_is_no_polynomial_is_named() -> None:
    found = chosen('preset = "kwok2006"\nparameters = { c = [100, 10, -0.9] }\nlaws = { c = "exponential" }')
    assert found.spec.current is not None
    assert found.spec.current.laws[0] == "exponential"


def test_an_identified_run_is_taken_with_its_laws_and_its_largest_tested_command() -> None:
    found = chosen('run = "run"')
    assert found.spec == damper("bouc_wen").preset("jansen2000").spec
    assert found.largest_command == 4.0
    assert found.tested == TESTED
    assert chosen('run = "run"\nlargest_command = 5.0').largest_command == 5.0
    assert chosen('run = "run"\nlargest_command = "500 mV"').largest_command == 0.5


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ('run = "valve"', "line 2: .*in %"),
        ("", "give a preset, a run, or a model"),
        ('preset = "spencer1997"', "bingham and bouc_wen; choose one with model"),
        ('preset = "kwok2006"\nparameters = { cc = 1 }', "line 3: .*'cc', did you mean c"),
        ('preset = "kwok2006"\nlaws = { c = "exponential" }', "takes 3 coefficients, 2"),
        ('model = "dahl"\nparameters = { k_w = [1, 2] }', "no rho, f0 of dahl"),
        ('model = "dahl"\nparameters = { k_w = 1, rho = 1, f0 = 0 }', "passive = true"),
        ('run = "old"', r"largest command of the driver \[V\]"),
        ('run = "run"\nlargest_command = "2 A"', "line 3: largest_command .* V, mV"),
    ],
)
def test_a_damper_that_cannot_be_is_refused_by_what_it_lacks(text: str, word: str) -> None:
    refusal(chosen, text, match=word)


def frame(**damper: object) -> mr.Study:
    return mr.study_of(
        building={
            "n_storeys": 3,
            "masses": [300.0],
            "stiffnesses": [4e5],
            "modal_damping": {"ratios": [0.01]},
        },
        dampers=[{"storey": 2, "model": "bingham", "passive": True, **damper}] if damper else [],
        motions=[{"synthetic": "kanai_tajimi", "duration": 4.0, "pga": "0.2 g"}],
    )


@pytest.mark.parametrize("brace", [{}, {"brace": {"stiffness": 3e6}}])
def test_a_diagonal_damper_resists_by_the_square_of_its_cosine(brace: dict[str, object]) -> None:
    # Next to no friction, so that the damper is a dashpot.
    upright = {"f_c": 1e-3, "v_s": 0.1, "f0": 0.0}
    angle, share = "38 deg", np.cos(np.radians(38.0))
    diagonal = frame(parameters={"c0": 2e3, **upright}, angle=angle, **brace)
    softer = {"brace": {"stiffness": 3e6 * share**2}} if brace else {}
    level = frame(parameters={"c0": 2e3 * share**2, **upright}, **softer)
    along, across = (mr.run_study(each).runs[1, 0] for each in (diagonal, level))
    np.testing.assert_allclose(along.peak_drift, across.peak_drift, rtol=2e-5)
    np.testing.assert_allclose(along.peak_stroke, share * across.peak_stroke, rtol=2e-5)
    np.testing.assert_allclose(share * along.peak_force, across.peak_force, rtol=2e-5)
    row = frame(parameters={"c0": 2e3, **upright}, row=[-share, share, 0.0], **brace)
    np.testing.assert_allclose(mr.run_study(row).runs[1, 0].peak_force, along.peak_force, rtol=1e-9)
    (facts,) = mr.run_study(diagonal).dampers
    assert facts.share == pytest.approx(share)


def test_two_dampers_in_a_storey_have_names() -> None:
    kwok = {"storey": 1, "preset": "kwok2006"}
    building, motion = {"published": "uts"}, {"synthetic": "kanai_tajimi", "duration": 1.0}

    def names(*dampers: dict[str, object]) -> tuple[str, ...]:
        return mr.study_of(building=building, dampers=dampers, motions=[motion]).device_names

    assert names({**kwok, "name": "left"}, {**kwok, "name": "right"}) == ("left", "right")
    refusal(names, {**kwok, "name": "left"}, {**kwok, "name": "left"}, match="two dampers are called 'left'")
    refusal(names, {**kwok, "angle": 38}, match="2177 deg")
    refusal(names, {**kwok, "row": [1.0, 0.0]}, match="2 numbers for 5 coordinates")


ONE = {"f_c": [20.0, 350.0, -40.0], "v_s": 0.02, "c0": [200.0, 500.0], "f0": 0.0}
OTHER = {"f_c": [20.0, 300.0], "v_s": 0.03, "c0": 150.0, "f0": 0.0}
GROUPS = (
    {"storey": 1, "model": "bingham", "parameters": ONE, "largest_command": 1.5},
    {"storey": 2, "model": "bingham", "parameters": OTHER, "largest_command": 0.8, "count": 2},
)


def grouped(*dampers: Mapping[str, object], **controller: object) -> mr.Study:
    laws = [
        {"law": "passive_on"},
        {"law": "clipped_optimal", "settings": {"drifts": 1, "control_weight": 1e-12}},
    ]
    return mr.study_of(
        building={"published": "uts"},
        dampers=[dict(each) for each in dampers],
        laws=[*laws, controller] if controller else laws,
        motions=[{"synthetic": "kanai_tajimi", "duration": 3.0, "pga": "0.2 g"}],
    )


def test_groups_of_one_model_have_parameters_laws_and_largest_commands_of_their_own() -> None:
    one, other = GROUPS
    raised = {**other, "parameters": {**OTHER, "f_c": [20.0, 300.0, 0.0], "c0": [150.0, 0.0]}}
    runs, written = (mr.run_study(grouped(one, each)).runs for each in (other, raised))
    for key, run in runs.items():
        np.testing.assert_array_equal(run.peak_drift, written[key].peak_drift)
        np.testing.assert_array_equal(run.peak_force, written[key].peak_force)
    settings = {"drifts": 1, "control_weight": 1e-12}
    results = mr.run_study(grouped(one, other, law="inverse_direct", settings=settings))
    for kind in ("passive_on", "clipped_optimal"):
        (row,) = (number for number, each in enumerate(results.rows) if each.description == kind)
        np.testing.assert_allclose(results.runs[row, 0].peak_current, [1.5, 0.8])
    # The best constant command is tried up to the larger driver, of which the smaller one gives what it can.
    best = results.runs[results.row_of("best_passive"), 0].peak_current
    assert best[1] == min(best[0], 0.8)
    assert "takes it for that of damper in storey 2" in " ".join(text for _, text in results.facts)


def test_laws_of_single_groups_and_groups_of_several_models_are_refused() -> None:
    one, other = GROUPS
    refusal(grouped, *GROUPS, {"storey": 3, "preset": "kwok2006"}, match="are of one model")
    refusal(grouped, one, {**other, "unit": "V"}, match="a command in V")
    refusal(grouped, one, {**other, "law": "clipped_optimal"}, match="a law commands all of them")
    refusal(grouped, *GROUPS, law="clipped_optimal", largest_command=1.6, match="1.5 at most")
