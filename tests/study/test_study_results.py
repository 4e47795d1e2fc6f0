"""What follows from the runs of a study, and from their file: criteria, ratios, score, warnings."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import study_samples

from mrwork.base.remark import Measured
from mrwork.base.units import unit_of
from mrwork.closed_loop import criteria
from mrwork.closed_loop.evaluation import Spread
from mrwork.dampers.simulation import Outcome
from mrwork.motions.spectrum import Intensity
from mrwork.store.run_folder import STUDY_RUN
from mrwork.store.run_writer import RunAtWork
from mrwork.study import StudyResults, compared, read_results, tables
from mrwork.study.comparison import times_better
from mrwork.study.results import largest_step_changes
from mrwork.study.runs import HALF_STEP, NOMINAL
from mrwork.study.study import StudyFile
from mrwork.study.study_folder import study_document, study_files


def test_a_linear_swing_has_the_ratios_of_its_amplitudes() -> None:
    results = study_samples.results()
    for row in range(5):
        wanted = study_samples.amplitude(row, 1) / study_samples.amplitude(0, 1)
        found = results.ratios(row, 1, "uncontrolled")
        for entry in criteria():
            if entry.ratio:
                assert found[entry.name] == pytest.approx(wanted, rel=1e-12), entry.name


def factor_of(unit: str) -> float:
    known = unit_of(unit)
    assert known is not None, unit
    return known.factor


def test_criteria_are_shown_in_their_units() -> None:
    declared = {entry.name: entry.unit for entry in criteria()}
    for name, unit, factor in tables._VALUES:
        if unit == "%":
            assert (declared[name], factor) == ("1", 100.0), name
        elif factor == 1.0:
            assert unit.replace("²", "2") in (declared[name], "", "1"), name
        else:
            assert factor_of(declared[name]) == pytest.approx(factor * factor_of(unit)), name


def test_scores_and_changes_stand_on_test_motions_only() -> None:
    results = study_samples.results()
    first, second = results.motions
    split = study_samples.under(results, (replace(first, use="training"), second))
    alone = study_samples.with_runs(
        results,
        motions=(second,),
        runs={
            (row, 0): run
            for (row, motion), run in study_samples.runs_by_place(results).items()
            if motion == 1
        },
    )
    assert split.judged_motions == (1,)
    for row in range(len(results.rows)):
        assert split.score(row) == alone.score(row)
    changes, others = compared(split).tables, compared(alone).tables
    for key, table in changes.items():
        for name, change in table.items():
            assert (change.mean, change.largest) == (others[key][name].mean, others[key][name].largest)
            assert change.motion == others[key][name].motion == "filtered noise"


def test_the_spread_of_a_score_has_the_quartiles_of_single_motions() -> None:
    spread = Spread.of([0.5, 0.9, 0.6, 0.7, 0.8])
    assert (spread.motions, spread.least, spread.median, spread.most) == (5, 0.5, 0.7, 0.9)
    assert (spread.lower_quartile, spread.upper_quartile) == (0.6, 0.8)
    assert spread.mean == pytest.approx(0.7)
    assert math.isnan(Spread.of([0.5, math.nan]).median)
    # Some are infinite, as of commands over none at i = 0.
    infinite = Spread.of([math.inf, 0.5, math.inf])
    assert (infinite.least, infinite.median, infinite.most) == (0.5, math.inf, math.inf)


def test_a_run_that_failed_has_no_criteria_and_leaves_no_score() -> None:
    results = study_samples.results()
    results = study_samples.diverged(results, 4, 0)
    assert results.criteria(4, 0) is None
    assert math.isnan(results.score(4).mean)
    assert all(math.isnan(value) for value in results.ratios(4, 0, "passive_off").values())
    (said,) = (each for each in results.remarks if each.code == "run_unfinished")
    assert "El Centro" in said.message


def test_a_change_of_the_step_is_that_of_the_criteria_and_another_end_is_said() -> None:
    results = study_samples.results()
    halved = {key: run for key, run in study_samples.runs_by_place(results).items() if key[0] == 3}
    whole = halved[3, 1]
    halved[3, 1] = {**whole, "peak_drift": 1.01 * whole["peak_drift"], "rms_drift": 0.98 * whole["rms_drift"]}
    checked = study_samples.with_runs(results, halved=halved)
    assert checked.step_changes(2, 0) is None
    known = results.criteria(3, 0) or {}
    assert checked.step_changes(3, 0) == dict.fromkeys(known, 0.0)
    assert known.keys() <= {entry.name for entry in criteria()}
    (change,) = largest_step_changes(checked)
    assert (change.row, change.criterion, change.motion, change.unfinished) == (3, "rms_drift", 1, ())
    assert change.change == pytest.approx(0.02)
    diverged = {"outcome": Outcome.DIVERGED}
    (change,) = largest_step_changes(study_samples.with_runs(results, halved={(3, 1): diverged}))
    assert change.criterion == ""
    assert change.in_words(results) == "not compared: filtered noise"


def test_a_study_is_complete_when_its_check_is() -> None:
    results = study_samples.results()
    assert results.complete
    begun = study_samples.with_runs(results, halved={(0, 0): study_samples.run(0.1, 0)})
    assert (begun.done, begun.total, begun.complete) == (11, 20, False)
    assert study_samples.with_runs(results, halved=study_samples.runs_by_place(results)).complete


def test_energies_that_do_not_balance_are_said_once_with_the_worst_run_and_the_rows() -> None:
    results = study_samples.results()
    found = results.remarks[0]
    assert (found.code, found.measured) == ("energies_unbalanced", Measured(pytest.approx(3e-4), ""))
    assert found.words == ("Clipped-optimal", "filtered noise")
    several = study_samples.changed(results, 2, 0, energy_error=1e-4).remarks[0]
    assert (several.code, several.words) == (found.code, found.words)
    assert "2 runs" in several.message
    assert "runs of Isolation, Clipped-optimal: " in several.message
    # A balance that is no number does not hold.
    unknown = study_samples.changed(results, 2, 0, energy_error=math.nan).remarks[0]
    assert (unknown.measured, unknown.words[0]) == (Measured(math.inf, ""), "Isolation")


def test_groups_hold_some_of_the_test_motions_and_training_motions_stand_apart() -> None:
    results = study_samples.many_motions()
    assert results.motions.groups == {
        "firm soil": [0, 2, 4, 6, 8],
        "soft soil": [1, 3, 5, 7, 9],
        "training motions": [10, 11],
    }
    assert results.motions.in_words == "10 test motions"
    assert study_samples.results().motions.in_words == "2 motions"


def test_a_law_is_better_where_drift_and_acceleration_are_both_lower() -> None:
    results = study_samples.many_motions()
    # Amplitudes of row 4 over those of row 1: 0.4 (1 + 0.08 m) / 0.85 (1 + 0.02 m), below 1 for every motion m.
    assert times_better(results, 4, 1) == 10
    assert times_better(results, 1, 4) == 0
    # Row 2: 0.7 (1 + 0.04 m) / (0.85 (1 + 0.02 m)) exceeds 1 from m = 14 on, which none has; row 0 is above row 1 until
    # 0.85 (1 + 0.02 m) exceeds 1, from m = 9 on.
    assert times_better(results, 1, 0) == 9
    assert times_better(study_samples.diverged(results, 4, 3), 4, 1) is None


def test_xarray_has_every_criterion_and_quantity_by_the_labels_of_its_axes() -> None:
    results = study_samples.results()
    results = study_samples.with_runs(results, halved=study_samples.runs_by_place(results))
    tree = results.to_xarray()
    for row, motion in np.argwhere(results.quantities.finished[:, :, 0]).tolist():
        places = {
            "row": results.rows[row].label,
            "motion": results.motions[motion].name,
            "realisation": NOMINAL,
        }
        for name, value in (results.criteria(row, motion) or {}).items():
            assert tree[f"criteria/{name}"].sel(places) == value
        drift = tree["quantities/peak_drift"].sel(places)
        assert drift.sel(storey="storey 2") == results.quantities.peak_drift[row, motion, 0][1]
    assert tree["criteria/mean_current"].attrs["units"] == "A"
    named = ("peak_acceleration", "peak_drift", "peak_base_shear")
    assert [tree[f"criteria/{name}"].attrs["units"] for name in named] == ["m/s^2", "m", "N"]
    assert tree["quantities/peak_acceleration"].dims == ("row", "motion", "realisation", "floor")
    assert list(tree["quantities"].coords["realisation"].values) == [NOMINAL, HALF_STEP]
    assert tree["quantities/peak_force"].sel(row="Isolation").isnull().all()


def read_back(results: StudyResults, folder: Path) -> StudyResults:
    with RunAtWork(folder / "run", STUDY_RUN) as work:
        work.commit(study_files(results, StudyFile(path=folder, content=b"")), {})
    return read_results(folder / "run")


def test_what_follows_from_the_runs_follows_from_their_file(tmp_path: Path) -> None:
    results = study_samples.results()
    runs = study_samples.runs_by_place(results)
    halved = {key: {**run, "peak_drift": 1.01 * run["peak_drift"]} for key, run in runs.items()}
    results = study_samples.with_runs(results, {**runs, (4, 0): {"outcome": Outcome.DIVERGED}}, halved=halved)
    stored = read_back(results, tmp_path)
    assert [(row.label, row.kind) for row in stored.rows] == [(row.label, row.kind) for row in results.rows]
    assert [motion.peak for motion in stored.motions] == [motion.peak for motion in results.motions]
    assert (stored.quantities, stored.criteria_of_runs) == (results.quantities, results.criteria_of_runs)
    for row, motion in runs:
        assert stored.criteria(row, motion) == results.criteria(row, motion)
        for against in ("uncontrolled", "passive_off"):
            assert repr(stored.ratios(row, motion, against)) == repr(results.ratios(row, motion, against))
    assert repr([stored.score(row).mean for row in range(5)]) == repr(
        [results.score(row).mean for row in range(5)]
    )
    assert stored.remarks == results.remarks
    assert largest_step_changes(stored) == largest_step_changes(results)
    assert (stored.done, stored.total, stored.complete) == (results.done, results.total, True)
    assert stored.finished_rows(0) == results.finished_rows(0) == [0, 1, 2, 3]


def test_the_file_has_the_intensity_of_each_motion(tmp_path: Path) -> None:
    results = study_samples.results()
    known = (
        Intensity(measure="pga", value=3.0),
        Intensity(measure="sa", value=2.0, period=0.8, damping_ratio=0.05),
    )
    motions = [replace(motion, intensity=each) for motion, each in zip(results.motions, known, strict=True)]
    results = study_samples.under(results, motions)
    assert tuple(motion.intensity for motion in read_back(results, tmp_path).motions) == known


def test_the_file_says_which_motions_scores_stand_on_and_their_spread(tmp_path: Path) -> None:
    results = study_samples.many_motions()
    document = study_document(results)
    assert document["judged_on"] == "10 test motions"
    assert [motion.use for motion in document["motions"]].count("training") == 2
    spread = document["spreads"]["Clipped-optimal"]
    assert spread["motions"] == 10
    assert spread["least"] < spread["lower_quartile"] < spread["median"] < spread["most"]
    assert [group["name"] for group in document["groups"]] == ["firm soil", "soft soil", "training motions"]
    stored = read_back(results, tmp_path)
    assert stored.motions == results.motions
    assert [stored.score(row).mean for row in range(5)] == [results.score(row).mean for row in range(5)]
    assert stored.motions.in_words == "10 test motions"


def test_rows_that_were_not_reached_are_known_by_their_labels(tmp_path: Path) -> None:
    results = study_samples.results()
    runs = study_samples.runs_by_place(results)
    begun = study_samples.with_runs(results, {key: run for key, run in runs.items() if key[0] < 3})
    stored = read_back(begun, tmp_path)
    assert [row.label for row in stored.rows] == [row.label for row in results.rows]
    assert (stored.done, stored.total, stored.complete) == (6, 10, False)
    assert stored.criteria(4, 0) is None
    assert "6 of 10 runs" in repr(stored)
