"""Forces on floors in a study: where their tables come from, what is asked of them, and what baselines make of them."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
import scipy.signal
from command_line import mrwork
from loop_samples import nothing
from quarter_car import CAR
from refusals import command_refusal, refusal

import mrwork as mr
from mrwork.base.values import Floats
from mrwork.motions import GroundMotion, force_motion
from mrwork.motions.examination import force_remarks
from mrwork.motions.ground_motion import correlation_of_motions
from mrwork.report.study.figures import motion_section
from mrwork.study.histories import read_history
from mrwork.study.loop_case import LoopCase
from mrwork.study.study import digest_of_run

TIME = np.arange(0.0, 2.0 + 1e-9, 0.02)
GUSTS = np.round(200.0 * np.sin(9.0 * TIME + np.arange(3)[:, None]) * np.arange(1, 4)[:, None], 6)
HEAD = """[building]
masses = ["300 kg", "300 kg", "300 kg"]
stiffnesses = ["400 N/mm", "400 N/mm", "400 N/mm"]
floor_names = ["Deck 1", "Deck 2", "roof"]
[[damper]]
storey = 1
preset = "kwok2006"
[[controller]]
law = "passive_on"
[[motion]]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    def save(name: str, head: str, *columns: object) -> None:
        np.savetxt(tmp_path / name, np.column_stack(columns), "%.9g", delimiter=",", header=head, comments="")

    save("wind.csv", "time (s),Roof (kN),deck 1 (N),deck_2_N", TIME, GUSTS[2] / 1e3, GUSTS[0], GUSTS[1])
    save("two.csv", "t_s,roof,Deck 1", TIME, GUSTS[2], GUSTS[0])
    save("bare.csv", "", GUSTS.T)
    save("shaker.csv", "t_s,force_kN", TIME, GUSTS[2] / 1e3)
    save("twice.csv", "t_s,roof_N,Roof (kN)", TIME, GUSTS[2], GUSTS[2])
    save("attic.csv", "t_s,Deck 1_N,attic_N", TIME, GUSTS[2], GUSTS[2])
    save("one.csv", "t_s,roof (kN)", TIME, GUSTS[2])
    save("pressed.csv", "t_s,roof (kPa)", TIME, GUSTS[2])
    save("lonely.csv", "t_s,roof (kN)", TIME[:1], GUSTS[2][:1])
    save("falling.csv", "t_s,roof_N", TIME[::-1], GUSTS[2])
    save("holes.csv", "t_s,roof_N,Deck 1_N", TIME, np.where(TIME[7] == TIME, np.nan, GUSTS[2]), GUSTS[0])
    save("zeros.csv", "t_s,roof_N", TIME, 0.0 * TIME)
    save("odd.csv", "t_s,roof_N", 1.5 * TIME, GUSTS[2])
    save("slow.csv", "t_s,roof_N", 0.1 * np.arange(5), np.arange(5.0))
    (tmp_path / "swing.csv").write_text("t_s,a_mps2\n" + "".join(f"{t:.2f},{np.sin(t):.6f}\n" for t in TIME))
    return tmp_path


def study(folder: Path, motion: str, head: str = HEAD) -> mr.Study:
    (folder / "study.toml").write_text(head + motion)
    return mr.read_study(folder / "study.toml")


def ground(folder: Path, motion: str) -> GroundMotion:
    (only,) = study(folder, motion).grounds
    return only


def test_columns_are_of_the_floors_that_they_name_each_in_its_unit(folder: Path) -> None:
    found = ground(folder, 'force = "wind.csv"')
    assert (found.name, found.dt, found.peak) == ("wind", pytest.approx(0.02), 0.0)
    assert found.forces == pytest.approx(GUSTS, abs=1e-6)
    two = ground(folder, 'force = "two.csv"\nunit = "kN"')
    assert two.forces == pytest.approx(1e3 * GUSTS * [[1.0], [0.0], [1.0]], abs=1e-3)
    assert ground(folder, 'force = "bare.csv"\nunit = "N"\ndt = 0.02').forces == pytest.approx(
        GUSTS, abs=1e-6
    )


def test_one_column_acts_on_a_floor_or_in_a_shape(folder: Path) -> None:
    by_name, by_number = (
        ground(folder, f'force = "shaker.csv"\nfloor = {floor}') for floor in ('"ROOF"', "3")
    )
    assert by_name.forces == pytest.approx(GUSTS[2] * [[0.0], [0.0], [1.0]], abs=1e-6)
    assert np.array_equal(by_name.forces, by_number.forces)
    shaped = ground(folder, 'force = "shaker.csv"\nshape = [0.0, 0.5, -1.0]')
    assert shaped.forces == pytest.approx(GUSTS[2] * [[0.0], [0.5], [-1.0]], abs=1e-6)


def test_keys_of_motions_process_forces(folder: Path) -> None:
    made = study(
        folder,
        'force = "wind.csv"\nname = "storm"\ngroup = "gusts"\nstart = 0.4\nend = 1.2\nresample = 0.01\nrest = 0.5\n'
        'factor = [1.0, -2.0]\nuse = "test"',
    )
    assert [motion.facts.name for motion in made.motions] == ["storm x 1", "storm x -2"]
    assert [motion.facts.level for motion in made.motions] == ["factor 1", "factor -2"]
    one, other = made.grounds
    assert one.forces[:, :81:2] == pytest.approx(GUSTS[:, 20:61], abs=1e-6)
    assert not one.forces[:, 81:].any()
    assert one.duration == pytest.approx(1.3)
    assert other.forces == pytest.approx(-2.0 * one.forces)
    assert one.groups == ("gusts",)
    level = study(folder, 'force = "wind.csv"').motions[0]
    assert level.facts.level == f"{level.ground.peak_force / 1e3:.3g} kN"


def test_forces_of_a_call_stand_alone_or_beside_an_acceleration(tmp_path: Path) -> None:
    swing = np.sin(TIME)
    for table, acceleration in (
        ({"forces": GUSTS / 1e3, "unit": "kN", "dt": 0.02}, 0.0 * swing),
        ({"forces": GUSTS, "acceleration": swing, "dt": 0.02}, swing),
        (replace(force_motion(GUSTS, 0.02), acceleration=swing), swing),
        (replace(force_motion(GUSTS, 0.02), acceleration=swing, is_road=True), swing),
        (force_motion(GUSTS, 0.02), 0.0 * swing),
    ):
        made = mr.study_of(
            building=mr.buildings.shear_building(
                name="frame", masses=[300.0] * 3, stiffnesses=[4e5] * 3, storey_damping=[500.0] * 3
            ),
            motions=[table],
            dampers=[{"storey": 1, "preset": "kwok2006"}],
            laws=["passive_on"],
        )
        (found,) = made.grounds
        assert found.forces == pytest.approx(GUSTS, abs=1e-9)
        assert np.array_equal(found.acceleration, acceleration)
        made.to_toml(tmp_path / "study.toml", replace=True)
        again = mr.read_study(tmp_path / "study.toml")
        assert np.array_equal(again.grounds[0].forces, found.forces)
        assert np.array_equal(again.grounds[0].acceleration, found.acceleration)
        assert again.grounds[0].is_road == found.is_road
        digests = [digest_of_run(each.arrangements[0], *each.grounds) for each in (made, again)]
        assert digests[0] == digests[1]
        assert digests[0] != digest_of_run(made.arrangements[0], replace(found, forces=2.0 * found.forces))


def test_forces_of_a_table_act_beside_the_ground(folder: Path) -> None:
    found = ground(folder, 'file = "swing.csv"\nforce = "slow.csv"\nfactor = 2.0')
    assert (found.name, found.dt) == ("swing", pytest.approx(0.02))
    assert found.acceleration == pytest.approx(2.0 * np.sin(TIME), abs=1e-5)
    expected = 2.0 * np.interp(TIME, [0.0, 0.4], [0.0, 4.0]) * (TIME < 0.401)
    assert found.forces == pytest.approx(expected * [[0.0], [0.0], [1.0]], abs=1e-9)
    assert "forces of slow.csv beside it" in found.changes
    road = ground(
        folder, 'synthetic = "iso_8608"\nroad_class = "B"\nspeed = 20\nduration = 1\nforce = "wind.csv"'
    )
    assert (road.is_road, road.n_time) == (True, 2001)
    assert road.forces[:, ::20] == pytest.approx(GUSTS, abs=1e-6)
    assert not road.acceleration[1001:].any()


def test_synthetic_motions_of_one_kind_are_told_apart_by_their_seeds(folder: Path) -> None:
    road = 'synthetic = "iso_8608"\nroad_class = "C"\nspeed = 20\nduration = 2\n'
    names = [motion.facts.name for motion in study(folder, f"{road}[[motion]]\n{road}seed = 1").motions]
    assert names == ["ISO 8608 class C, 20 m/s", "ISO 8608 class C, 20 m/s, seed 1"]


def test_forces_stay_on_their_floors_where_a_baseline_adds_a_floor(folder: Path) -> None:
    isolated = '[[baseline]]\nlabel = "isolated"\n[baseline.building.isolation]\n'
    isolated += "period = 2.0\nratio = 0.1\nmass = 300\n"
    made = study(folder, f'force = "wind.csv"\n{isolated}')
    (baseline,) = [each for each in made.arrangements if each.row.kind == "baseline"]
    assert baseline.building.floor_names == ("base", "Deck 1", "Deck 2", "roof")
    still = mr.ControlLaw(name="active", gains={"gain": np.zeros((0, 8))})
    case = LoopCase(arrangement=replace(baseline, law=still), motions=made.grounds, hardware=made.hardware)
    found = case.responses()
    above = force_motion(np.vstack([np.zeros((1, TIME.size)), made.grounds[0].forces]), 0.02)
    frame = baseline.building
    alone = mr.simulate_loop(frame, *nothing(frame), [above], made.hardware)
    assert np.array_equal(found.peak_drift, alone.peak_drift)


def test_a_study_of_forces_has_their_peaks_and_no_fragility(folder: Path) -> None:
    results = mr.run_study(study(folder, 'force = "wind.csv"\nfactor = [1.0, 2.0]'))
    facts = results.motions[1]
    assert (facts.peak, facts.peak_force) == (
        0.0,
        pytest.approx(np.abs(2.0 * GUSTS.sum(axis=0)).max(), rel=1e-6),
    )
    at = results.motions.by_record
    assert (at.unit, at.measure) == ("N", "Peak force")
    assert at.levels == pytest.approx([0.5 * facts.peak_force, facts.peak_force])
    section = motion_section(results)
    assert "peak forces from" in section.summary
    assert "m/s" not in section.summary
    refusal(mr.fragility, results, match="'wind x 1' has forces on floors")


def test_a_run_of_forces_resumes_and_another_force_does_not(folder: Path) -> None:
    study(folder, 'force = "wind.csv"\n')
    words = ("respond", folder / "study.toml", "--out", folder / "run")
    assert mrwork(*words).returncode == 0
    first = (folder / "run" / "runs.nc").read_bytes()
    assert mrwork(*words, "--resume").returncode == 0
    assert (folder / "run" / "runs.nc").read_bytes() == first
    stronger = (folder / "wind.csv").read_text().replace("(kN)", "(MN)")
    (folder / "wind.csv").write_text(stronger)
    command_refusal(*words, "--resume", match="another study: motion.1.content")


def test_a_page_draws_the_forces(folder: Path, pages: None) -> None:
    study(folder, 'force = "wind.csv"')
    assert mrwork("respond", folder / "study.toml", "--out", folder / "run").returncode == 0
    page = (folder / "run" / "report.html").read_text()
    assert "Sum of the forces on the floors of wind" in page
    assert "Ground acceleration" not in page
    history = read_history(folder / "run", 0, 0)
    assert history is not None
    expected = np.interp(history.time, TIME, GUSTS.sum(axis=0))
    assert history.floor_force == pytest.approx(expected, rel=1e-6, abs=1e-3)


def test_the_motion_drawn_in_detail_is_the_test_motion_of_the_largest_push(folder: Path) -> None:
    two = 'force = "wind.csv"\nuse = "training"\n[[motion]]\nforce = "shaker.csv"\nfloor = 1\n'
    three = two + '[[motion]]\nforce = "shaker.csv"\nfloor = 2\nfactor = -3.0\nname = "strong"'
    assert study(folder, two).detailed == 1
    assert study(folder, three).detailed == 2


def test_settings_are_of_the_forces_over_the_mass(folder: Path) -> None:
    # Of the same push on every unit of mass, by the ground or by forces on the floors.
    swing = 0.4 * np.sin(9.0 * TIME)
    shaken = {"acceleration": swing, "dt": 0.02}
    pushed = {"forces": -300.0 * np.tile(swing, (3, 1)), "dt": 0.02}
    frame = mr.buildings.shear_building(
        name="frame", masses=[300.0] * 3, stiffnesses=[4e5] * 3, storey_damping=[500.0] * 3
    )
    both = [
        mr.study_of(
            building=frame,
            motions=[motion],
            dampers=[{"storey": 1, "preset": "kwok2006"}],
            laws=["sliding_mode"],
        )
        for motion in (shaken, pushed)
    ]
    gains = [mr.study.designed(each).laws[0][1].gains for each in both]
    for name in gains[0]:
        assert gains[0][name] == pytest.approx(gains[1][name], rel=1e-3)


def test_observers_and_predictions_are_told_of_forces(folder: Path) -> None:
    def codes(more: str) -> list[str]:
        made = study(folder, 'force = "wind.csv"\n' + more)
        return [remark.code for remark in made.remarks if remark.code.startswith("forces")]

    assert codes("") == []
    assert codes('[hardware]\nfeedback = "observer"\n') == ["forces_observed"]
    assert codes('[hardware]\nfeedback = "observer"\nkinematic = true\nmeasured_storeys = [1, 2, 3]\n') == []
    rollout = '[[controller]]\nlaw = "predictive_rollout"\n[controller.settings]\n'
    rollout += "base = 1.0\ndrift = 1e-3\nacceleration = 1.0\n"
    assert codes(rollout) == ["forces_not_forecast"]
    assert codes(rollout + "shear_offsets = true\n") == []


def test_a_grid_that_loses_the_gusts_is_told(folder: Path) -> None:
    with pytest.warns(
        mr.errors.MrworkWarning, match=r"resampled every 0.7 s the impulse of its forces is off by"
    ):
        study(folder, 'force = "wind.csv"\nresample = 0.7')
    # Every second sample holds a tenth of a period.
    study(folder, 'force = "wind.csv"\nresample = 0.04')


def test_a_record_beside_a_wind_is_no_copy_of_it_without(folder: Path) -> None:
    swing = 'file = "swing.csv"\n'
    windy = f'{swing}name = "windy"\nforce = "wind.csv"\n'
    again = windy.replace("windy", "again")
    made = study(folder, f"{swing}[[motion]]\n{windy}[[motion]]\n{again}")
    assert [remark.words for remark in made.remarks if remark.code == "records_copied"] == [
        ("windy", "again")
    ]


def test_two_winds_of_one_mean_are_no_copies_and_one_with_another_factor_is() -> None:
    rng = np.random.default_rng(5)
    one, other = (force_motion(5e3 + 5e2 * rng.standard_normal((3, 200)), 0.02) for _ in range(2))
    assert correlation_of_motions(one, other) < 0.2
    assert correlation_of_motions(one, mr.motions.scaled(one, -3.0)) == pytest.approx(1.0)


@pytest.mark.parametrize("factor", [1e4, 1e-9])
def test_forces_far_from_the_weight_are_asked_about(folder: Path, factor: float) -> None:
    def remarks(more: str) -> list[tuple[str, str]]:
        made = study(folder, 'force = "wind.csv"\n' + more)
        return [(remark.code, remark.measured.unit) for remark in made.remarks if remark.measured]

    # The sines of the table begin at 93 % of their peak.
    assert remarks(f"factor = {factor}") == [("floor_force_unusual", "N"), ("force_sudden", "N")]
    assert remarks("") == [("force_sudden", "N")]


LONG = 0.1 * np.arange(1200)
BREEZE = 4e3 * (1.0 + 0.1 * np.sin(0.7 * LONG) + 0.1 * np.sin(2.3 * LONG)) * np.minimum(LONG / 30.0, 1.0)


@pytest.mark.parametrize(
    ("force", "dt", "told"),
    [
        (BREEZE, 0.1, []),
        (BREEZE[600:], 0.1, ["force_sudden"]),
        (np.where(LONG[700] == LONG, 60.0, 1.0) * BREEZE, 0.1, ["force_wild"]),
        (BREEZE, 50.0, ["force_step_long"]),
        (-BREEZE[600:], 0.1, ["force_sudden"]),
        (0.0 * BREEZE, 0.1, []),
    ],
)
def test_forces_are_examined_as_ground_motions_are(force: Floats, dt: float, told: list[str]) -> None:
    forces = np.outer([0.5, 1.0], force)
    assert [remark.code for remark in force_remarks("wind", forces, dt, 1e6, 0.5)] == told


DECK = """[building]
mass = [[9000.0, 0.0], [0.0, 9000.0]]
stiffness = [[3.1e6, -1.4e6], [-1.4e6, 3.1e6]]
modal_damping = { ratios = ["0.8 %"] }
influence = [0.0, 0.0]
floor_names = ["third", "two thirds"]
"""
SHAKE = '[[motion]]\nsynthetic = "kanai_tajimi"\nduration = 4\n'


def test_a_deck_that_the_ground_does_not_move_answers_to_forces(tmp_path: Path) -> None:
    time = 0.02 * np.arange(500)
    forces = np.array([[300.0], [200.0]]) * np.sin(2.0 * np.pi * 2.1 * time)
    head = "time (s),third (N),two thirds (N)"
    np.savetxt(tmp_path / "crowd.csv", np.vstack([time, forces]).T, delimiter=",", header=head, comments="")
    (tmp_path / "deck.toml").write_text(f'{DECK}[[motion]]\nforce = "crowd.csv"\n')
    results = mr.run_study(mr.read_study(tmp_path / "deck.toml"), threads=1)
    found = results.criteria(0, 0)
    assert found is not None
    # Exact for forces that are straight between samples.
    mass, stiffness = 9e3 * np.eye(2), np.array([[3.1e6, -1.4e6], [-1.4e6, 3.1e6]])
    squared, shapes = scipy.linalg.eigh(stiffness, mass)
    damping = mass @ shapes @ np.diag(0.016 * np.sqrt(squared)) @ shapes.T @ mass
    state = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness / 9e3, -damping / 9e3]])
    push = np.vstack([np.zeros((2, 2)), np.eye(2) / 9e3])
    fine = np.arange(0.0, time[-1] + 1e-9, 0.002)
    finer = np.array([np.interp(fine, time, each) for each in forces]).T
    system = scipy.signal.StateSpace(state, push, state[2:], push[2:])
    _, acceleration, _ = scipy.signal.lsim(system, finer, fine)
    assert found["peak_acceleration"] == pytest.approx(np.abs(acceleration).max(), rel=1e-3)
    assert "ground_unfelt" not in {remark.code for remark in results.remarks}
    # With a share of the mass that follows the ground, however small, it is the same deck.
    tiny = DECK.replace("[0.0, 0.0]", "[1e-9, 1e-9]") + '[[motion]]\nforce = "crowd.csv"\n'
    (tmp_path / "tiny.toml").write_text(tiny)
    beside = mr.run_study(mr.read_study(tmp_path / "tiny.toml"), threads=1)
    assert beside.criteria(0, 0) == pytest.approx(found, nan_ok=True)


def test_a_ground_that_moves_nothing_is_told(tmp_path: Path) -> None:
    (tmp_path / "deck.toml").write_text(DECK + SHAKE)
    made = mr.read_study(tmp_path / "deck.toml")
    assert "ground_unfelt" in {remark.code for remark in made.remarks}
    assert made.building.total_mass == 0.0
    assert made.building.reference_mass == 18e3
    (tmp_path / "deck.toml").write_text(DECK.replace("[0.0, 0.0]", "[1.0, 1.0]") + SHAKE)
    assert "ground_unfelt" not in {remark.code for remark in mr.read_study(tmp_path / "deck.toml").remarks}


def test_a_mass_ratio_on_a_deck_is_of_its_mode(tmp_path: Path) -> None:
    (tmp_path / "deck.toml").write_text(
        DECK + 'tuned_mass = [{ floor = "third", mass_ratio = 0.02 }]\n' + SHAKE
    )
    # Both coordinates move alike in the first mode, so that its mass at either is that of both.
    assert mr.read_study(tmp_path / "deck.toml").building.mass[-1, -1] == pytest.approx(0.02 * 18e3)


@pytest.mark.parametrize(
    ("motion", "says"),
    [
        ('force = "twice.csv"', "line 11: .*floor 'roof' has two columns"),
        (
            'force = "attic.csv"',
            "'attic' is no floor of the building; choose one of Deck 1, Deck 2, roof, or delete that column",
        ),
        ('force = "shaker.csv"', "column 'force_kN' names no floor; give floor = \"roof\", or shape"),
        (
            'force = "shaker.csv"\nfloor = "rof"',
            "line 12: .*'rof' is no floor of the building, did you mean roof",
        ),
        ('force = "shaker.csv"\nfloor = 4', "`floor` 4 is no floor"),
        ('force = "shaker.csv"\nshape = [1.0, 2.0]', "`shape` has 2 numbers, and the building 3 floors"),
        ('force = "shaker.csv"\nfloor = 3\nshape = [1, 1, 1]', "line 13: .*keep one"),
        ('force = "wind.csv"\nfloor = "roof"', "name each column by its floor, or keep one column"),
        ('force = "bare.csv"\nunit = "N"', "no column is time; give it as here: dt=0.01$"),
        ('force = "wind.csv"\ndt = 0.04', "with a step of 0.02 s where `dt` is 0.04 s; leave out `dt`"),
        ('force = "two.csv"', "unit of the force .*: unit=\"kN\"; .* in the heading, as 'roof \\(kN\\)'"),
        (
            'file = "swing.csv"\nforce = "two.csv"\nunit = "kN"',
            "give it in the heading, as 'roof \\(kN\\)'$",
        ),
        ('force = "shaker.csv"\nfloor = 3\nunit = "N"', "where column 'force_kN' states kN; leave it out"),
        ('force = "shaker.csv"\nfloor = 3\nunit = "g"', "'g'"),
        ('force = "pressed.csv"\nunit = "kN"', "'roof \\(kPa\\)': 'kPa' is no unit of force"),
        ('force = "lonely.csv"', "has 1 row; give two or more"),
        (
            'force = "one.csv"\nfloor = "Deck 1"',
            "column 'roof \\(kN\\)' is of floor 'roof', and `floor` or `shape`",
        ),
        (
            'force = "one.csv"\nshape = [0.2, 0.5, 1.0]',
            "is of floor 'roof', and `floor` or `shape` say otherwise",
        ),
        ('file = "wind.csv"', 'a force \\[kN\\], and .*give forces on floors as force = "wind.csv"'),
        ('file = "shaker.csv"\ncolumn = "2"\nunit = "g"', "'force_kN' is a force"),
        ('force = "falling.csv"', "line 3: time goes from 2 to 1.98 s; sort the rows"),
        ('force = "holes.csv"', "line 9: the force in column 'roof_N' is no finite number"),
        ('force = "zeros.csv"', "is zero throughout"),
        ('force = "wind.csv"\npga = "0.3 g"', "line 12: pga is of ground accelerations"),
        ('force = "wind.csv"\nsa = "0.3 g"', "sa is of ground accelerations"),
        ('force = "wind.csv"\nscale_to = "pga"', "scale_to is of ground accelerations"),
        ('force = "wind.csv"\nbaseline = 0', "baseline is of ground accelerations"),
        ('force = "wind.csv"\ncolumn = "2"', "column is of records"),
        ('use = "test"', "needs a file, samples, a synthetic motion, a suite, a road or forces"),
        ('road = "swing.csv"\nfile = "swing.csv"', "has file and road; keep one"),
        ('force = "wind.csv"\nforces = [[0.0, 1.0]]', "has force and forces; keep one"),
        ('force = "bare.csv"\nfile = "swing.csv"\nunit = "m/s2"', "no column is time"),
        (
            'force = "odd.csv"\nfile = "swing.csv"',
            "forces every 0.03 s beside ground motion swing every 0.02 s",
        ),
        (
            f"forces = {[[0.0] * 100] * 3}\nfile = 'swing.csv'",
            "its forces have shape \\(3, 100\\), and its acceleration 101 samples",
        ),
        ('file = "swing.csv"\nfloor = "roof"', "floor is of the one column of a force"),
        ("forces = [[0.0, 1.0], [0.0, 1.0], [0.0, 1.0]]", "no dt of its forces"),
        ("forces = [[0.0, 1.0], [0.0, 1.0]]\ndt = 0.1", "2 floors, and the building 3 floors"),
        ("forces = [[0.0, 1.0]]\nacceleration = [0, 1, 0]\ndt = 0.1", "line 11: .*as many samples"),
        (
            "forces = [[0.0, 1.0]]\nacceleration = [0, 1]\ndt = 0.1\nunit = 'N'",
            "'N' is a unit of force, no unit of acceleration",
        ),
        (
            'force = "wind.csv"\n[target]\ncode = "en_1998"\na_g = 2.0\nground = "B"',
            "line 12: .*has forces on floors",
        ),
    ],
)
def test_a_mistake_is_told_with_its_line_and_remedy(folder: Path, motion: str, says: str) -> None:
    refusal(study, folder, motion, match=says)


# Words of pages


def test_a_page_of_a_car_calls_its_parts_by_their_names(tmp_path: Path, pages: None) -> None:
    heights = "\n".join(f"{0.05 * n:.2f},{max(0.0, 20.0 * np.sin(0.1 * n)):.3f}" for n in range(60))
    (tmp_path / "bump.csv").write_text(f"distance_m,height_mm\n{heights}\n")
    control = '[[controller]]\nlaw = "passive_on"\n[[motion]]\nroad = "bump.csv"\nspeed = "36 km/h"\n'
    (tmp_path / "car.toml").write_text(CAR + control)
    ended = mrwork("respond", tmp_path / "car.toml", "--out", tmp_path / "out")
    page = re.sub(
        r"<(style|script).*?</\1>|<[^>]*>", " ", (tmp_path / "out" / "report.html").read_text(), flags=re.S
    )
    of_buildings = r"storey|roof|drift ratio|building|ground motion|ground acceleration"
    # The page has the command line, whose folder may be called anything.
    said = (ended.stdout + page).replace(str(tmp_path), "")
    assert not re.search(of_buildings, said, re.IGNORECASE)
    assert all(words in page for words in ("tyre, suspension", "Quarter car", "Shear of parts"))
    # A road has no peak acceleration.
    results = mr.load(tmp_path / "out")
    assert motion_section(results).title == "Motions"
    assert "m/s" not in motion_section(results).summary
