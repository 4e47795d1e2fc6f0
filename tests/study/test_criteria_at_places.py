"""Criteria of one floor, storey or damper, wherever a criterion is named, and weighted accelerations from histories."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import mrwork
from quarter_car import CAR, ROAD
from refusals import refusal

import mrwork as mr
from mrwork.closed_loop import frequency_weighted
from mrwork.closed_loop.evaluation import Scales
from mrwork.study.schema import TuneTable
from mrwork.study.study import study_fingerprint
from mrwork.tuning.space import tuning_objective

SKYHOOK = '[[controller]]\nlaw = "skyhook_groundhook"\n'
ASKED = ("rms_acceleration@body", "peak_drift@suspension", "weighted_acceleration@body")


def study(folder: Path, *tables: str, roads: str = ROAD, references: str = "none") -> mr.Study:
    path = folder / "car.toml"
    text = f'references = "{references}"\n{CAR}sprung = "body"\n{roads}{SKYHOOK}\n[hardware]\nsample_time = 0.001\n'
    path.write_text(text + "\n".join(tables))
    return mr.read_study(path)


def asking(*names: str) -> str:
    return f"[report]\ncriteria = {list(names)}\n"


def test_a_criterion_at_a_place_is_its_quantity_there(tmp_path: Path) -> None:
    results = mr.run_study(study(tmp_path, asking(*ASKED)))
    body, strut = results.quantities.rms_acceleration[..., 1], results.quantities.peak_drift[..., 1]
    np.testing.assert_array_equal(results.criteria_of_runs.numbers[ASKED[0]], body)
    np.testing.assert_array_equal(results.criteria_of_runs.numbers[ASKED[1]], strut)
    assert results.criteria(1, 0)[ASKED[0]] == body[1, 0, 0]
    # The wheel is shaken more than the body, and has the criterion of all floors.
    assert results.criteria(1, 0)["rms_acceleration"] > 3.0 * body[1, 0, 0]
    assert set(ASKED) <= {*results.to_pandas().columns}


def test_a_weighted_acceleration_is_that_of_the_history(tmp_path: Path) -> None:
    made = study(tmp_path, asking("weighted_acceleration@body"))
    results = mr.run_study(made)
    arrangement = made.arrangements[1]
    run = mr.simulate_loop(
        arrangement.building,
        arrangement.devices,
        arrangement.law,
        made.grounds,
        made.hardware,
        histories=True,
    )
    weighted = frequency_weighted(run.histories[0].acceleration[:, 1], 1e-3)
    assert results.criteria(1, 0)["weighted_acceleration@body"] == pytest.approx(
        np.sqrt(np.mean(weighted**2)), rel=1e-12
    )
    # Nobody asks for it otherwise, and no file has it.
    plain = mr.run_study(study(tmp_path))
    assert "weighted_acceleration" not in plain.quantities.numbers


def test_a_run_folder_a_page_and_tables_have_them(tmp_path: Path, pages: None) -> None:
    study(tmp_path, asking(*ASKED))
    ended = mrwork("respond", tmp_path / "car.toml", "--out", tmp_path / "out")
    assert ended.returncode == 0, ended.stderr
    assert "RMS acc. body" in ended.stdout
    loaded = mr.load(tmp_path / "out")
    assert set(ASKED) <= loaded.criteria(1, 0).keys()
    assert "rms_acceleration@body [m/s2]" in (tmp_path / "out" / "criteria.csv").read_text()
    assert "W_k acc. body" in (tmp_path / "out" / "report.html").read_text()


@pytest.mark.parametrize(
    ("name", "match"),
    [
        ("rms_drift@body", "'body' is a floor, and rms_drift is of a storey; give one of tyre, suspension"),
        ("rms_acceleration@roof", "nothing is called 'roof'.*give one of wheel, body"),
        ("peak_base_shear@body", "one number of the whole building"),
        ("rms_accel@body", "no criterion is called 'rms_accel', did you mean rms_acceleration"),
    ],
)
def test_a_place_that_has_no_such_criterion_is_refused(tmp_path: Path, name: str, match: str) -> None:
    tables = [
        asking(name),
        f'[report]\nlimit = {{ "{name}" = 1.0 }}\n',
        f'[[tune]]\nlaws = ["passive"]\ncriteria = ["{name}"]\n',
    ]
    for table in tables:
        refusal(study, tmp_path, table, match=match)


def test_a_name_that_is_lacking_and_a_limit_without_a_unit_are_told_where_the_study_is_read(
    tmp_path: Path,
) -> None:
    refusal(
        study,
        tmp_path,
        asking("rms_acceleration@"),
        match="line .*rms_acceleration@: no name stands behind @",
    )
    tuned = '[[tune]]\nlaws = ["skyhook_groundhook"]\nconstraints = { "peak_drift@suspension" = "40" }\n'
    refusal(study, tmp_path, tuned, match="line .*the limit of peak_drift@suspension is the text '40'")


def test_a_tuning_minimises_and_keeps_limits_at_places(tmp_path: Path) -> None:
    made = study(tmp_path)
    comfort = TuneTable(
        laws=("skyhook_groundhook",),
        free={"share": (), "largest_command": ()},
        criteria=("rms_acceleration@body",),
        budget=12,
        population=6,
    )
    holding = replace(comfort, criteria=("weighted_acceleration@body", "rms_drift@tyre"), label="holding")
    limited = replace(comfort, constraints={"peak_drift@suspension": "1 mm"}, label="limited")
    tuned = mr.tune(made, tables=[comfort, holding, limited], rng=1)
    # No command keeps a limit of a millimetre.
    assert tuned.laws[2].violation > 0.0
    judged = mr.tuning.judge(made, tuned)
    off = judged.row_of("passive_off")
    row = judged.row_of_law(tuned.laws[0])
    ratio = judged.ratios(row, 0, off)["rms_acceleration@body"]
    assert ratio == pytest.approx(tuned.laws[0].least, rel=1e-9)


def test_a_fragility_has_the_limit_of_a_place(tmp_path: Path) -> None:
    roads = "".join(
        f"{ROAD}seed = {seed}\nfactor = [0.25, 0.5, 1.0, 2.0]\nname = 'road {seed}'\n" for seed in range(3)
    )
    results = mr.run_study(study(tmp_path, roads=roads))
    body = results.quantities.rms_acceleration[0, :, 0, 1].reshape(3, 4)
    found = mr.fragility(results, limit={"rms_acceleration@body": float(np.sort(body, axis=None)[5])})
    assert found["uncontrolled"].median > 0.0


@pytest.mark.parametrize(
    "table",
    [
        '[report]\nscore = ["peak_drift_ratio"]\n',
        '[report]\ncriteria = ["peak_drift_ratio@tyre"]\n',
        '[report]\nlimit = { "peak_drift_ratio@tyre" = 0.01 }\n',
        '[[tune]]\nlaws = ["skyhook_groundhook"]\ncriteria = ["peak_drift_ratio"]\n',
        '[[tune]]\nlaws = ["skyhook_groundhook"]\nconstraints = { peak_drift_ratio = 0.01 }\n',
    ],
)
def test_a_criterion_over_what_the_building_lacks_is_refused_wherever_it_is_named(
    table: str, tmp_path: Path
) -> None:
    # Without heights it is unknown in every run: a score of it chooses nothing, a column of it is empty.
    refusal(study, tmp_path, table, match=r"line \d+: .*is known only with height or heights in \[")


# The score of a study


def test_the_score_is_the_mean_of_the_criteria_that_the_study_states(tmp_path: Path) -> None:
    names = ("weighted_acceleration@body", "rms_drift@tyre")
    study(tmp_path, f"[report]\nscore = {list(names)}\n", references="best_passive")
    ended = mrwork("respond", tmp_path / "car.toml", "--out", tmp_path / "run")
    results = mr.load(tmp_path / "run")
    assert results.scored == names
    numbers = [results.criteria_of_runs.numbers[name][:, 0, 0] for name in names]
    for row in range(len(results.rows)):
        expected = np.mean([number[row] / number[results.at_zero] for number in numbers])
        assert results.scores(row)[0] == pytest.approx(expected, rel=1e-12)
    # Constant commands are compared by the same numbers: of this car none is better than no command.
    assert results.scores(results.row_of("best_passive"))[0] == 1.0
    assert "Score (W_k acc. body, RMS drift tyre over i = 0)" in ended.stdout
    assert "score_of_worst_place" not in {remark.code for remark in results.remarks}


def test_references_of_laws_are_the_best_constant_command_by_the_score(tmp_path: Path) -> None:
    rollout = '[[controller]]\nlaw = "predictive_rollout"\n'
    score = '[report]\nscore = ["weighted_acceleration@body"]\n'
    bases = [
        next(
            law.gains["base"] for _, law in study(tmp_path, *tables).laws if law.name == "predictive_rollout"
        )
        for tables in ((rollout,), (rollout, score))
    ]
    assert bases[0] > 0.5
    assert bases[1] == 0.0


def test_a_road_without_a_score_is_told_and_another_score_is_another_study(tmp_path: Path) -> None:
    plain = study(tmp_path)
    (remark,) = (each for each in plain.remarks if each.code == "score_of_worst_place")
    assert 'score = ["rms_acceleration@body", "rms_drift@tyre"]' in remark.message
    other = study(tmp_path, '[report]\nscore = ["rms_drift@tyre"]\n')
    prints = [study_fingerprint(each) for each in (plain, other)]
    assert prints[0] != prints[1]


def test_a_law_that_reads_the_damper_alone_on_a_road_is_told(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    path.write_text(f'{CAR}{ROAD}[[controller]]\nlaw = "mixed_skyhook"\nsettings = {{ crossover = inf }}\n')
    bare = mr.read_study(path)
    (remark,) = (each for each in bare.remarks if each.code == "sprung_missing")
    assert 'sprung = "body"' in remark.message
    # What the remark says: skyhook of the rate of the damper is its largest command.
    law, most = bare.arrangements[-1], bare.devices[0].largest_command
    run = mr.simulate_loop(
        law.building, law.devices, law.law, bare.grounds, bare.hardware, histories=True
    ).histories[0]
    assert np.median(run.command) == most
    assert "sprung_missing" not in {each.code for each in study(tmp_path).remarks}


def test_a_speed_of_kilometres_an_hour_without_its_unit_is_told(tmp_path: Path) -> None:
    plain = study(tmp_path, roads=ROAD.replace('"72 km/h"', "72.0"))
    (remark,) = (each for each in plain.remarks if each.code == "number_unusual")
    assert 'write "72 km/h"' in remark.message


def test_tuning_searches_the_score_of_the_study(tmp_path: Path) -> None:
    made = study(tmp_path, '[report]\nscore = ["rms_acceleration@body"]\n')
    objective = tuning_objective(
        TuneTable(laws=("skyhook_groundhook",)), "A", Scales.of(made.building), made.scored
    )
    assert objective.weights == {"rms_acceleration@body": 1.0}


@pytest.mark.parametrize(
    ("score", "says"),
    [
        ("[]", "score is empty"),
        ('["comfort"]', "no criterion is called 'comfort'"),
        ('["rms_drift@roof"]', "nothing is called 'roof'"),
        ('["rms_current"]', "rms_current is zero at i = 0"),
    ],
)
def test_a_score_that_is_none_is_refused(tmp_path: Path, score: str, says: str) -> None:
    refusal(study, tmp_path, f"[report]\nscore = {score}\n", match=says)
