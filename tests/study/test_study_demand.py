"""Dampers outside their tested ranges and ratings, their forces by storey, and passive devices of the building."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import study_samples
from study_samples import ranges

import mrwork as mr
from mrwork.base.remark import Measured, warnings_of
from mrwork.dampers.tested_range import FittedDamper, OperatingRange, beyond_rating
from mrwork.plots.of_studies import energy_parts
from mrwork.study import StudyResults, read_study, run_study
from mrwork.study.damper_size import demands_of, shares_in_words
from mrwork.study.study_folder import study_document

PRESET = mr.damper("static_hysteretic").preset("kwok2006")
STUDY = """\
references = "none"

[building]
published = "uts"

[[damper]]
storey = 1
run = "run"
count = 2

[[controller]]
law = "passive_on"

[[controller]]
law = "active"
settings = { control_weight = 1e-5 }

[[motion]]
synthetic = "kanai_tajimi"
duration = 3
pga = "0.2 g"

[report]
histories = "all"
"""


def studied(folder: Path, tested: OperatingRange | None, text: str = STUDY) -> StudyResults:
    (folder / "study.toml").write_text(text)

    def identified(run: Path) -> FittedDamper:
        return FittedDamper(spec=PRESET.spec, theta=PRESET.theta, tested=tested)

    return run_study(read_study(folder / "study.toml", identified))


def test_within_the_tested_ranges_nothing_is_said(tmp_path: Path) -> None:
    results = studied(tmp_path, ranges())
    assert warnings_of(results.remarks) == ()
    assert [each["outside_tested_range"] for each in study_document(results)["results"]] == [()] * 4


def test_demand_is_that_on_one_damper(tmp_path: Path) -> None:
    results = studied(tmp_path, ranges())
    off, on = results.quantities.of_row(1), results.quantities.of_row(2)
    (demand,) = (each.demand for each in results.demanded.get((2, 0), ()))
    assert demand.force == pytest.approx(0.5 * on.peak_force[0, 0, 0, 0])
    assert demand.power == pytest.approx(0.5 * on.device_energy[0, 0, 0, 0] / results.motions[0].duration)
    assert (demand.stroke, demand.velocity) == (on.peak_stroke[0, 0, 0, 0], on.peak_rate[0, 0, 0, 0])
    # The largest command is that of the tests; kwok2006 itself goes to 1.88 A.
    assert demand.command == (pytest.approx(1.5), pytest.approx(1.5))
    assert results.demanded.get((1, 0), ())[0].demand.command == (0.0, 0.0)
    assert off.peak_current[0, 0, 0, 0] == 0.0
    # The building without dampers, and ideal actuators in their place.
    assert results.demanded.get((0, 0), ()) == results.demanded.get((3, 0), ()) == ()


def test_a_sentence_for_each_quantity_names_the_worst_run(tmp_path: Path) -> None:
    velocity = studied(tmp_path, ranges()).quantities.peak_rate[1, 0, 0][0]
    results = studied(tmp_path, ranges(velocity=0.25 * velocity, command=(0.5, 1.5)))
    first, second = results.damper_remarks
    assert (first.code, first.words[0], first.measured) == (
        "outside_tested_range",
        "velocity",
        Measured(velocity, "m/s"),
    )
    assert "with Passive-off, in 2 of 2 runs with dampers" in first.message
    assert second.message.startswith(
        "command 0 A, tested from 0.5 to 1.5 A; the laws of c, k, alpha, delta, f0 are"
    )
    document = study_document(results)
    outside = [each["outside_tested_range"] for each in document["results"]]
    assert outside == [(), ("velocity", "command"), ("velocity",), ()]
    assert document["remarks"] == results.remarks


def test_unknown_ranges_are_said_once_and_are_no_warning(tmp_path: Path) -> None:
    text = STUDY.replace('run = "run"', 'run = "run"\nlargest_command = 1.5')
    results = studied(tmp_path, None, text)
    assert warnings_of(results.remarks) == ()
    assert study_document(results)["results"][1]["outside_tested_range"] is None
    assert [fact for fact in results.page.facts if fact[0] == "Tested ranges"] == [
        ("Tested ranges", "not known")
    ]


def test_strokes_below_the_tested_ones_are_named_for_every_run_with_dampers(tmp_path: Path) -> None:
    results = studied(tmp_path, ranges(least_stroke=0.1))
    (found_small,) = results.damper_remarks
    assert found_small.words == ("stroke",)
    assert " make 20 % of the travel or more, tested from 100 mm, so " in found_small.message
    assert "in 2 of 2 runs with dampers" in found_small.message
    # The uncontrolled building and that with actuators demand nothing.
    assert np.isnan(results.quantities.least_stroke[:, 0, 0, 0]).tolist() == [True, False, False, True]
    found = results.demanded.get((2, 0), ())[0].demand.least_stroke
    assert found is not None
    assert 0.0 < found < results.quantities.peak_stroke[2, 0, 0][0]
    # A damper that was tested at strokes as small is within its range.
    assert studied(tmp_path, ranges(least_stroke=0.9 * found)).damper_remarks == ()


def test_histories_for_the_least_stroke_change_no_bit_of_the_other_results(tmp_path: Path) -> None:
    runs = [studied(tmp_path, each).quantities for each in (ranges(), ranges(least_stroke=1e-9))]
    without, found = (replace(each, numbers={**each.numbers, "least_stroke": np.zeros(1)}) for each in runs)
    assert without == found


def test_a_law_that_turns_negative_at_a_demanded_command_is_a_warning(tmp_path: Path) -> None:
    text = STUDY.replace('run = "run"', 'run = "run"\nparameters = { alpha = [-100, 900] }')
    results = studied(tmp_path, ranges(), text)
    (found,) = results.damper_remarks
    assert (found.code, found.words, found.measured) == (
        "law_leaves_range_beyond",
        ("alpha",),
        Measured(-100.0, "N"),
    )


def device_with(**tested: float) -> mr.Device:
    row = mr.building("uts").storeys[0]
    return mr.Device(
        name="pair", spec=PRESET.spec, theta=PRESET.theta, row=row, largest_command=1.88, count=2.0,
        tested=ranges(**tested),
    )  # fmt: skip


SINE = mr.GroundMotion(name="sine", dt=0.01, acceleration=np.sin(15.0 * np.arange(0.0, 2.0, 0.01)))


def test_the_simulation_in_python_says_the_same() -> None:
    law = mr.ControlLaw(name="passive", gains={"command": [[1.0], [1.88]]})
    responses = mr.simulate_loop(mr.building("uts"), [device_with(velocity=1e-3)], law, [SINE])
    assert responses.demand(0, 0).force == pytest.approx(0.5 * responses.peak_force[0, 0])
    assert [each.names for run in (0, 1) for each in responses.outside(run)] == [
        ("velocity",),
        ("velocity", "command"),
    ]
    velocity, command = responses.remarks
    assert velocity.words == ("velocity",)
    assert velocity.measured == Measured(responses.peak_rate.max(), "m/s")
    assert (command.words, command.measured) == (("command",), Measured(1.88, "A"))


def test_the_simulation_in_python_knows_small_strokes_from_its_histories() -> None:
    device, law = device_with(least_stroke=0.1), mr.ControlLaw(name="passive", gains={"command": [[1.0]]})
    without = mr.simulate_loop(mr.building("uts"), [device], law, [SINE])
    assert (without.demand(0, 0).least_stroke, without.remarks) == (None, ())
    (found,) = mr.simulate_loop(mr.building("uts"), [device], law, [SINE], histories=True).remarks
    assert found.words == ("stroke",)


def test_a_run_that_did_not_finish_demands_nothing() -> None:
    results = study_samples.results()
    assert len(demands_of(results.quantities, 3, 0, (device_with(),), 8.0)) == 1
    ended = study_samples.diverged(results, 3, 0)
    assert demands_of(ended.quantities, 3, 0, (device_with(),), 8.0) == ()


# Ratings and forces by storey


RATED = 20.0


def study() -> mr.Study:
    """Two storeys with a damper in each, that of storey 1 rated for a small force, and a viscous damper."""
    return mr.study_of(
        building={
            "n_storeys": 2,
            "masses": [500.0],
            "stiffnesses": [2e5],
            "modal_damping": {"ratios": [0.02]},
            "viscous": [{"storey": 2, "damping": 500.0}],
        },
        dampers=[
            {"storey": 1, "preset": "kwok2006", "rated_force": RATED, "rated_stroke": "10 m"},
            {"storey": 2, "preset": "kwok2006"},
        ],
        motions=[mr.synthetic_motion(rng=0, duration=4.0, peak=2.0)],
        references="none",
    )


@pytest.fixture(scope="module")
def results() -> StudyResults:
    """The runs of that study."""
    return mr.run_study(study())


def test_a_run_beyond_a_rating_is_told_and_stored(results: StudyResults) -> None:
    (said,) = [each for each in results.remarks if each.code == "demand_beyond_rating"]
    assert f"rated to {RATED:g} N" in said.message
    assert "in 1 of 1 runs" in said.message
    row = results.row_of("passive_off")
    assert row is not None
    (first, second) = results.demanded.get((row, 0), ())
    assert first.outside.names == ("force",)
    assert first.outside.exceedances[0].rated
    assert second.outside.names == ()
    # A preset has the rating of its damper.
    assert [(each.rated_force, each.rated_stroke) for each in study().devices] == [
        (RATED, 10.0),
        (2224.0, 0.0265),
    ]
    (run,) = (each for each in study_document(results)["results"] if each["kind"] == "passive_off")
    assert list(run["outside_tested_range"]) == ["force"]


def test_a_rating_is_exceeded_only_above_it() -> None:
    demand = OperatingRange(
        stroke=0.02, velocity=0.1, frequency=None, command=None, command_unit=None, force=100.0, power=1.0
    )
    assert beyond_rating(demand, force=100.0, stroke=None) == ()
    (one,) = beyond_rating(demand, force=100.0, stroke=0.01)
    assert (one.quantity, one.times) == ("stroke", 2.0)


def test_forces_are_said_by_storey_and_the_base_has_those_of_the_first(results: StudyResults) -> None:
    (said,) = shares_in_words(results)
    row = results.row_of("passive_off")
    assert row is not None
    forces, bare = (
        results.quantities.peak_force[row, 0, 0] / 1e3,
        results.quantities.peak_base_shear[0, 0, 0] / 1e3,
    )
    assert f"{forces[0]:.3g} kN in storey 1" in said
    assert f"{forces[1]:.3g} kN in storey 2; on the base {forces[0]:.3g} kN, " in said
    assert f"{100.0 * forces[0] / bare:.2g} % of the peak base shear" in said
    assert f" kN, {results.building.total_mass:,.10g} kg), under" in said


def test_dampers_that_stand_in_one_storey_add_there(results: StudyResults) -> None:
    """Beside each other they share the drift, so that their forces add."""
    first, second = results.dampers
    beside = replace(results, dampers=(first, replace(second, storey=0, place=first.place)))
    row = results.row_of("passive_off")
    assert row is not None
    together = float(np.sum(results.quantities.peak_force[row, 0, 0][:2])) / 1e3
    assert f"reach {together:.3g} kN in storey 1, " in shares_in_words(beside)[0]


def test_viscous_dampers_of_the_building_are_listed_with_the_other_devices(results: StudyResults) -> None:
    facts = results.building
    assert facts is not None
    assert facts.passive == ("viscous damper in storey 2",)
    assert facts.passive_storeys == (1,)
    # Forces and strokes of passive devices stand behind those of the dampers.
    assert results.quantities.axes["device"][-1] == "viscous damper in storey 2"
    *dampers, viscous = results.quantities.peak_force[0, 0, 0]
    assert np.isnan(dampers).all()
    assert viscous > 0.0


def test_energy_of_viscous_dampers_is_that_of_the_dampers(results: StudyResults) -> None:
    """It is the integral of c v^2 of their storey, and the energies still balance."""
    uts = mr.buildings.with_viscous_damper(mr.building("uts"), storey=1, damping=1e4)
    motion = mr.synthetic_motion(rng=0, duration=4.0, peak=2.0)
    study = mr.study_of(building=uts, motions=[motion])
    kept = {}
    run = mr.run_study(study, keep=lambda row, motion, history: kept.update({row: history})).quantities.at(
        0, 0
    )
    history = kept[0]
    # Trapezoids over the samples of the hardware, 1 ms of a first period of 0.35 s.
    rate = np.gradient(history.drift[:, 0], history.time)
    expected = np.trapezoid(1e4 * rate**2, history.time)
    dampers, structure, moving = energy_parts(run)
    assert dampers == pytest.approx(float(expected), rel=2e-3)
    assert history.energy[-1, 4] == pytest.approx(dampers, rel=1e-3)
    assert structure == pytest.approx(float(run["damping_energy"]), rel=1e-3)
    assert dampers + structure + moving == pytest.approx(float(run["input_energy"]), rel=1e-9)


def test_a_linear_damper_leaves_a_linear_building() -> None:
    damped = mr.buildings.with_viscous_damper(mr.building("uts"), storey=1, damping=1e4)
    assert damped.nonlinear == ""


@pytest.mark.parametrize(("largest", "told"), [("3 A", True), ("1.5 A", False)])
def test_a_command_beyond_that_of_the_published_set_is_told(tmp_path: Path, largest: str, told: bool) -> None:
    text = STUDY.replace('run = "run"', f'preset = "kwok2006"\nlargest_command = "{largest}"')
    said = [each for each in studied(tmp_path, None, text).damper_remarks if "command" in each.words]
    assert [each.code for each in said] == ["demand_beyond_rating"] * told


SHAKEN = {"acceleration": (2.5 * np.sin(0.08 * np.arange(800))).tolist(), "dt": 0.01, "name": "sine"}
STIFF, EDGE = 4e6, 7.5
PLAN = {
    "mass": [[4e4, 0.0], [0.0, 1.1e6]],
    "stiffness": [[3.0 * STIFF, STIFF * EDGE], [STIFF * EDGE, 9.0 * STIFF * EDGE**2]],
    "modal_damping": {"ratios": [0.03]},
    "influence": [1.0, 0.0],
    "storeys": [[1.0, -EDGE], [1.0, EDGE]],
    "floors": [[1.0, -EDGE], [1.0, EDGE]],
}
CHAIN = {"n_storeys": 3, "masses": ["20 t"], "stiffnesses": ["12 MN/m"], "modal_damping": {"ratios": [0.02]}}


def with_row(building: dict[str, object], row: list[float], count: int, storey: int = 1) -> StudyResults:
    damper = {"storey": storey, "row": row, "preset": "kwok2006", "count": count}
    return mr.run_study(
        mr.study_of(
            building=building, dampers=[damper], laws=["passive_on"], motions=[SHAKEN], references="none"
        )
    )


@pytest.mark.parametrize(
    ("building", "row", "count", "storey"),
    [
        (CHAIN, [1.0, 0.0, 0.0], 1, 1),
        (CHAIN, [-1.0, 0.0, 0.0], 1, 1),
        (CHAIN, [0.0, 1.0, -1.0], 1, 3),
        (PLAN, [1.0, EDGE], 3, 1),
        (PLAN, [-1.0, EDGE], 3, 1),
    ],
)
def test_a_share_of_the_base_shear_has_a_size_and_no_sign(
    building: dict[str, object], row: list[float], count: int, storey: int
) -> None:
    results = with_row(building, row, count, storey)
    share = 100.0 * results.quantities.peak_force[-1, 0, 0, 0] / results.quantities.peak_base_shear[0, 0, 0]
    (said,) = shares_in_words(results)
    assert f"{share:.2g} % of the peak base shear" in said
    for weak in (remark for remark in results.remarks if remark.code == "dampers_weak"):
        assert weak.measured is not None
        assert weak.measured.value == pytest.approx(0.01 * share)
        advised = int(weak.words[0].removeprefix("count = ").split()[0])
        assert advised == pytest.approx(10.0 * count / share, abs=1.0)


def test_dampers_of_two_frames_that_stand_on_the_ground_add_on_the_base() -> None:
    dampers = [{"storey": storey, "preset": "kwok2006", "count": 3} for storey in (1, 2)]
    study = mr.study_of(
        building=PLAN, dampers=dampers, laws=["passive_on"], motions=[SHAKEN], references="none"
    )
    results = mr.run_study(study)
    together = 1e-3 * results.quantities.peak_force[-1, 0, 0, :2].sum()
    assert f"on the base {together:.3g} kN" in shares_in_words(results)[0]


def test_dampers_that_turn_a_plan_have_no_share_of_the_base_shear() -> None:
    turning = with_row(PLAN, [0.0, 10.0], 3)
    assert turning.dampers[0].share == 0.0
    # A moment of inertia is no mass.
    assert turning.building.total_mass == 4e4
    assert shares_in_words(turning) == ()
    assert not [remark for remark in turning.remarks if "base shear" in remark.message]
