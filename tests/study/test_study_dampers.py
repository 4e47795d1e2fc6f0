"""Which damper a study means: a preset, one written out, a run of `mrwork identify`, by the twin, or another model."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import own_dampers
import pytest
from command_line import printed
from refusals import refusal
from study_samples import ranges

import mrwork as mr
from mrwork.base.documents import read_table
from mrwork.base.places import Place
from mrwork.dampers import damper
from mrwork.dampers.tested_range import FittedDamper
from mrwork.study.dampers import chosen_damper
from mrwork.study.reading import parse
from mrwork.study.schema import DamperTable

TESTED = ranges(command=(0.5, 4.003), command_unit="V")


def identified(run: Path) -> FittedDamper:
    if run.name == "valve":
        spec = damper("dahl").with_current_laws({"k_w": "log_linear:0,50"}, unit="%")
        return FittedDamper(spec=spec, theta=tuple(spec.nominal.tolist()), tested=None)
    if run.name not in ("run", "old"):
        raise mr.errors.RecordError(f"{run} does not exist; give the run folder")
    preset = damper("bouc_wen").preset("jansen2000")
    return FittedDamper(spec=preset.spec, theta=preset.theta, tested=TESTED if run.name == "run" else None)


def chosen(text: str) -> mr.Device:
    document, lines = parse(f"storey = 1\n{text}", "study.toml")
    place = Place(origin="study.toml", lines=lines)
    table = read_table(DamperTable, document, place)
    with place.prefix_errors(mr.errors.SettingError):
        return chosen_damper(table, Path("place"), identified)[0]


@pytest.mark.parametrize(
    ("model", "name"),
    [("static_hysteretic", "kwok2006"), ("modified_bouc_wen", "dyke1996"), ("bouc_wen", "yoshida2004")],
)
def test_a_preset_is_that_of_its_model(model: str, name: str) -> None:
    preset = damper(model).preset(name)
    found = chosen(f'preset = "{name}"')
    assert found.spec == preset.spec
    assert found.draws[0].tolist() == list(preset.theta)
    assert found.largest_command == preset.largest_command


def test_a_parameter_of_a_preset_is_changed_and_no_other() -> None:
    preset = damper("modified_bouc_wen").preset("dyke1996")
    found = chosen('preset = "dyke1996"\nparameters = { x0 = 0.0 }\nlargest_command = 1.5')
    differs = np.flatnonzero(found.draws[0] != np.array(preset.theta))
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
    assert found.draws[0].tolist() == list(preset.theta)


def test_a_law_that_is_no_polynomial_is_named() -> None:
    found = chosen('preset = "kwok2006"\nparameters = { c = [100, 10, -0.9] }\nlaws = { c = "exponential" }')
    assert str(found.spec.laws[0]) == "exponential"


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
    along, across = (mr.run_study(each).quantities.at(1, 0) for each in (diagonal, level))
    np.testing.assert_allclose(along["peak_drift"], across["peak_drift"], rtol=2e-5)
    np.testing.assert_allclose(along["peak_stroke"], share * across["peak_stroke"], rtol=2e-5)
    np.testing.assert_allclose(share * along["peak_force"], across["peak_force"], rtol=2e-5)
    row = frame(parameters={"c0": 2e3, **upright}, row=[-share, share, 0.0], **brace)
    np.testing.assert_allclose(
        mr.run_study(row).quantities.peak_force[1, 0, 0], along["peak_force"], rtol=1e-9
    )
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
    runs, written = (mr.run_study(grouped(one, each)).quantities for each in (other, raised))
    np.testing.assert_array_equal(runs.peak_drift, written.peak_drift)
    np.testing.assert_array_equal(runs.peak_force, written.peak_force)
    settings = {"drifts": 1, "control_weight": 1e-12}
    results = mr.run_study(grouped(one, other, law="inverse_direct", settings=settings))
    for kind in ("passive_on", "clipped_optimal"):
        (row,) = (number for number, each in enumerate(results.rows) if each.description == kind)
        np.testing.assert_allclose(results.quantities.peak_current[row, 0, 0], [1.5, 0.8])
    # The best constant command is one share of the largest commands.
    best = results.quantities.peak_current[results.row_of("best_passive"), 0, 0]
    np.testing.assert_allclose(best / best[0], [1.0, 0.8 / 1.5])
    assert "takes it for the force of damper in storey 2" in " ".join(text for _, text in results.page.facts)


def test_groups_of_different_dampers_have_a_best_constant_command_each() -> None:
    # So many that the largest commands are too much.
    large, small = {**GROUPS[0], "count": 6}, {**GROUPS[1], "storey": 5, "count": 30}
    study = grouped(large, small, law="best_passive_by_group", label="each its own")
    results = mr.run_study(study, threads=1)
    kinds = [row.kind for row in results.rows]
    share, by_group = map(kinds.index, ("best_passive", "best_passive_by_group"))
    assert results.score(by_group).mean < results.score(share).mean
    assert results.rows[share].label.endswith(" %")
    # One share of all is the reference.
    assert mr.study.compared(results).passive == share
    commands = results.quantities.peak_current[by_group, 0, 0]
    levels = np.array([1.5, 0.8]) / 20.0
    np.testing.assert_allclose(commands / levels, np.round(commands / levels), atol=1e-9)
    # No single group does better at another level.
    for device in (0, 1):
        tried = np.tile(commands, (21, 1))
        tried[:, device] = np.arange(21) * levels[device]
        law = mr.ControlLaw(name="passive", gains={"command": np.vstack([[0.0, 0.0], tried])})
        runs = mr.simulate_loop(FRAME, study.devices, law, study.grounds, study.hardware)
        drifts, accelerations = runs.peak_drift.max(axis=1), runs.peak_acceleration.max(axis=1)
        rms = runs.rms_drift.max(axis=1), runs.rms_acceleration.max(axis=1)
        scores = np.mean([each / each[0] for each in (drifts, accelerations, *rms)], axis=0)
        assert results.score(by_group).mean == pytest.approx(scores[1:].min(), rel=1e-9)
    said = results.choices[1]
    assert said.startswith("each its own, ")
    assert "of coordinate search" in said
    assert f"beside {results.score(share).mean:.3f} of one share" in said
    refusal(grouped, GROUPS[0], law="best_passive_by_group", match="all are equal; give best_passive")
    # The setting of the passive law takes a command for each.
    passive = mr.run_study(grouped(large, small, law="passive", settings={"command": commands.tolist()}))
    np.testing.assert_array_equal(passive.quantities.peak_drift[-1], results.quantities.peak_drift[by_group])


def test_currents_and_voltages_stand_side_by_side_and_a_command_of_all_is_a_share() -> None:
    """A damper in V is that in A with another driver: its responses have the same bits."""
    one, other = GROUPS
    in_volt = {**other, "unit": "V"}
    rollout = {"law": "predictive_rollout", "settings": {"horizon": 0.1}}
    in_a, in_v = (mr.run_study(grouped(one, each, **rollout), threads=1) for each in (other, in_volt))
    np.testing.assert_array_equal(in_v.quantities.peak_drift, in_a.quantities.peak_drift)
    np.testing.assert_array_equal(in_v.quantities.peak_current, in_a.quantities.peak_current)
    assert in_v.command_unit == "A and V"
    assert [each.command_unit for each in in_v.dampers] == ["A", "V"]
    assert in_v.rows[2].label == in_a.rows[2].label
    assert in_v.rows[3].label.endswith(" V")
    # One number of commands in both units is not known; those of each damper and their switchings are.
    found = in_v.criteria(4, 0)
    assert found is not None
    assert "rms_current" not in found
    assert found["switching_rate"] >= 0.0
    assert "RMS command" not in str(in_v)
    clipped = {"law": "clipped_optimal", "settings": {"drifts": 1, "control_weight": 1e-12}}
    half = mr.run_study(grouped(one, in_volt, **clipped, largest_command="50 %", label="half"), threads=1)
    row = [each.label for each in half.rows].index("half")
    np.testing.assert_array_equal(half.quantities.peak_current[row, 0, 0], [0.75, 0.4])
    passive = grouped(one, in_volt, law="passive", settings={"command": [0.3, 0.8]})
    assert mr.run_study(passive, threads=1).quantities.peak_current[-1, 0, 0].tolist() == [0.3, 0.8]


@pytest.mark.parametrize(
    ("controller", "word"),
    [
        (
            {"law": "clipped_optimal", "largest_command": "0.5 A"},
            "is '0.5 A', where a number .1. is expected",
        ),
        ({"law": "clipped_optimal", "largest_command": 1.2}, "a share of the largest command of each"),
        ({"law": "clipped_optimal", "command_slope": 10.0}, "per second in one unit"),
        ({"law": "passive", "settings": {"command": 0.5}}, "give one for each damper"),
        ({"law": "inverse_direct", "settings": {"drifts": 1, "control_weight": 1e-9}}, "one command to all"),
    ],
)
def test_what_is_in_one_unit_is_refused_for_dampers_of_both(controller: dict[str, Any], word: str) -> None:
    refusal(grouped, GROUPS[0], {**GROUPS[1], "unit": "V"}, label="x", **controller, match=word)


def test_laws_and_limits_of_single_groups_are_refused() -> None:
    one, other = GROUPS
    refusal(
        mr.study_of,
        building={"published": "uts"},
        dampers=[one, {**other, "unit": "V"}],
        motions=MOTIONS,
        report={"limit": {"rms_current": 0.5}},
        match="limit another criterion",
    )
    refusal(grouped, one, {**other, "law": "clipped_optimal"}, match="a law commands all of them")
    refusal(grouped, *GROUPS, law="clipped_optimal", largest_command=1.6, match="1.5 at most")


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
        ("passive = true\ncommand = 1.0", "", "line 4: .*a passive damper takes no command"),
        ("passive = true\nlargest_command = 2.0", "", "line 8: a passive damper takes no command"),
        ("passive = true", CLIPPED, "line 10: clipped_optimal commands the dampers, and they are passive"),
    ],
)
def test_a_run_without_laws_is_no_controllable_damper(
    without_laws: Path, more: str, controller: str, word: str
) -> None:
    path = without_laws / "study.toml"
    path.write_text(STUDY.format(more=more, controller=controller))
    refusal(mr.read_study, path, match=word)


def test_a_passive_damper_may_be_called_passive_off(without_laws: Path) -> None:
    path = without_laws / "study.toml"
    path.write_text(STUDY.format(more="passive = true", controller=ON.replace("_on", "_off")))
    assert [each.row.label for each in mr.read_study(path).arrangements] == ["uncontrolled", "on"]


# Dampers of the user


FRAME = mr.building("uts")
MOTIONS = [mr.synthetic_motion(rng=0, peak=3.0, duration=1.0)]
PARAMETERS = {
    "c": [1232.0, 1929.0], "k": 5100.0, "alpha": [32.0, 918.0], "beta": 100.0, "delta": 0.58, "x_s": 1e-4, "f0": 0.0,
}  # fmt: skip


def own_study(damper: dict[str, Any], laws: list[Any], **given: Any) -> mr.Study:
    return mr.study_of(building=FRAME, dampers=[{"storey": 1, **damper}], laws=laws, motions=MOTIONS, **given)


def stated(model: mr.DamperSpec | str) -> dict[str, Any]:
    return {"model": model, "parameters": PARAMETERS, "largest_command": 1.5}


@pytest.fixture(scope="module")
def fit() -> mr.Fit:
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


@pytest.mark.long
def test_a_damper_of_the_user_has_the_criteria_of_the_model_under_any_law() -> None:
    laws = ["passive_on", "best_passive", "clipped_optimal", lambda sample, memory: np.ones_like(sample.rate)]
    noisy = mr.Hardware(feedback="observer", acceleration_noise=0.02)
    own, lanes = (
        mr.run_study(own_study(stated(model), laws, hardware=noisy))
        for model in (own_dampers.static, "static_hysteretic")
    )
    for name in ("peak_drift", "peak_acceleration", "device_energy"):
        ours, theirs = (each.to_pandas()[name].to_numpy(dtype=float) for each in (own, lanes))
        np.testing.assert_allclose(ours, theirs, rtol=1e-6, err_msg=name)
    assert np.nanmax(own.to_pandas()["energy_error"].to_numpy(dtype=float)) < 1e-3


@pytest.mark.long
def test_a_fit_of_it_is_written_beside_a_study_and_like_of_earlier_versions_is_passed_over(
    fit: mr.Fit, tmp_path: Path
) -> None:
    with pytest.warns(mr.errors.MrworkWarning, match="'hyperbolic_tangent_guo' is passed over"):
        placed = own_study({"run": fit, "like": "hyperbolic_tangent_guo"}, ["clipped_optimal"])
    assert placed.devices[0].spec.own == own_dampers.guo.own
    own = own_study({"run": fit}, ["passive_on"])
    own.to_toml(tmp_path / "study.toml")
    again = mr.read_study(tmp_path / "study.toml")
    assert again.devices[0].spec == fit.spec


BESIDE = (
    {"storey": 1, "preset": "kwok2006", "count": 40},
    {"storey": 2, "name": "held", "preset": "kwok2006", "count": 20, "command": "500 mA"},
    {"storey": 2, "name": "dashpot", "model": "maxwell", "passive": True,
     "parameters": {"k": 1e6, "tau": 4e-3, "c": 10.0, "f0": 0.0}},
)  # fmt: skip


def test_dampers_that_hold_a_command_or_follow_none_stand_beside_others(tmp_path: Path) -> None:
    laws = ["clipped_optimal", "passive_on"]
    # In a study those that laws command come first, whatever their order.
    study = mr.study_of(building=FRAME, dampers=[BESIDE[1], BESIDE[0], BESIDE[2]], laws=laws, motions=MOTIONS)
    assert study.device_names[1:] == ("held", "dashpot")
    assert [each.is_commanded for each in study.devices] == [True, False, False]
    assert [each.command for each in study.devices] == [None, 0.5, None]
    results = mr.run_study(study, threads=1)
    numbers = results.quantities
    labels = [row.label for row in results.rows]
    at_zero, on = labels.index("Passive-off"), labels.index("Passive-on")
    # What is held is held in every row with dampers, and counts in no criterion of the command.
    assert (numbers.peak_current[1:, :, 0, 1] == 0.5).all()
    assert (numbers.peak_current[at_zero, :, 0, 0] == 0.0).all()
    assert (numbers.peak_current[on, :, 0, 0] == study.devices[0].largest_command).all()
    assert np.isnan(numbers.rms_current[1:, :, 0, 1:]).all()
    assert (results.criteria_of_runs.rms_current[at_zero] == 0.0).all()
    # Its file is the same study, with the same runs.
    path = tmp_path / "study.toml"
    study.to_toml(path)
    again = mr.read_study(path)
    assert [each.command for each in again.devices] == [None, 0.5, None]
    np.testing.assert_array_equal(mr.run_study(again, threads=1).quantities.peak_drift, numbers.peak_drift)


def test_a_damper_that_holds_a_command_is_the_constant_command_of_it_alone() -> None:
    (alone,) = ({**BESIDE[0]},)
    held = mr.run_study(
        mr.study_of(building=FRAME, dampers=[{**alone, "command": 0.5}], motions=MOTIONS), threads=1
    )
    constant = {"law": "passive", "settings": {"command": 0.5}}
    sent = mr.run_study(
        mr.study_of(building=FRAME, dampers=[alone], laws=[constant], motions=MOTIONS), threads=1
    )
    # The step of the loop resolves the damper at the commands that it can get.
    np.testing.assert_allclose(held.quantities.peak_drift[1], sent.quantities.peak_drift[-1], rtol=1e-5)
    assert [row.kind for row in held.rows] == ["uncontrolled", "passive_off"]


@pytest.mark.parametrize(
    ("dampers", "laws", "word"),
    [
        ([{**BESIDE[0], "command": 2.5}], [], "1.88 at most"),
        ([{**BESIDE[0], "command": "0.5 V"}], [], "command"),
        ([{**BESIDE[2], "command": 0.5}], [], "takes no command"),
        (BESIDE[1:2], ["clipped_optimal"], "passive or hold a command"),
    ],
)  # fmt: skip
def test_what_cannot_hold_a_command_is_refused(dampers: object, laws: object, word: str) -> None:
    refusal(mr.study_of, building=FRAME, dampers=dampers, laws=laws, motions=MOTIONS, match=word)
