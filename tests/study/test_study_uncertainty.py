"""Realisations of a study, one axis of the batch; and its progress, which changes no bit."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tuning_samples
from refusals import refusal

import mrwork as mr
from mrwork.buildings import with_tuned_mass
from mrwork.closed_loop import simulate
from mrwork.closed_loop.evaluation import criterion
from mrwork.dampers.tested_range import FittedDamper
from mrwork.errors import Interrupted
from mrwork.study.loop_case import LoopCase, vary_building
from mrwork.study.realisations import nominal
from mrwork.study.results import RealisationBand
from mrwork.study.study import Arrangement, Row
from mrwork.study.study_folder import study_document

CONTROLLER = """
[[controller]]
law = "clipped_optimal"
settings = { drifts = 1, control_weight = 1e-13 }
largest_command = 1.2
"""
UNCERTAIN = "[uncertainty]\nrealisations = 4\nstiffness = 0.1\ndamping = 0.2\ndelay = '2 ms'\n"


def study(folder: Path, more: str = UNCERTAIN, tune: str = CONTROLLER) -> mr.Study:
    return mr.read_study(tuning_samples.study_file(folder, tune=tune, more=more))


def test_every_row_has_bands_about_its_nominal_values(tmp_path: Path) -> None:
    results = mr.run_study(study(tmp_path), threads=1)
    document = study_document(results)
    for run in document["results"]:
        band = run["bands"]["peak_drift"]
        assert band["lower"] < band["median"] < band["upper"]
        assert 0.5 * run["criteria"]["peak_drift"] < band["median"] < 2.0 * run["criteria"]["peak_drift"]
    assert document["score_bands"]["Passive-off"] == {"lower": 1.0, "median": 1.0, "upper": 1.0}
    assert document["realisations"] == 4


def case_of(given: mr.Study, realisations: Any) -> LoopCase:
    """The law of a study, for realisations."""
    arrangement = next(each for each in given.arrangements if each.row.kind == "controller")
    where = {"motions": given.grounds, "hardware": given.hardware, "threads": 1}
    return LoopCase(arrangement=arrangement, realisations=realisations, **where)


def simulated(given: mr.Study, realisations: Any) -> Any:
    return case_of(given, realisations).criteria()


def test_the_nominal_realisation_gives_the_bits_of_the_study(tmp_path: Path) -> None:
    given = study(tmp_path)
    results = mr.run_study(given, threads=1)
    row = next(number for number, each in enumerate(given.arrangements) if each.row.kind == "controller")
    found = simulated(given, nominal(given.devices))
    for motion in range(len(given.motions)):
        for name, value in (results.criteria(row, motion) or {}).items():
            assert found.numbers[name][0, motion, 0] == value


def test_draws_of_dampers_are_one_batch_with_the_bits_of_single_ones(tmp_path: Path) -> None:
    given = study(tmp_path)
    rows = given.devices[0].draws * np.array([[0.9], [1.0], [1.1]])
    one = nominal(given.devices)
    ones = np.ones(3)
    three = replace(one, stiffness=ones, damping=ones, delay=0.0 * ones, seed=np.arange(3), theta=(rows,))
    batch = simulated(given, three)
    for place in range(3):
        alone = simulated(given, replace(one, theta=(rows[place : place + 1],)))
        for name, array in batch.numbers.items():
            assert np.array_equal(array[..., place], alone.numbers[name][..., 0], equal_nan=True)


def test_posterior_draws_of_a_run_are_spread_over_the_realisations(tmp_path: Path) -> None:
    preset = mr.damper("static_hysteretic").preset("kwok2006")
    chain = np.asarray(preset.theta) * np.linspace(0.9, 1.1, 1001)[:, None]
    fit = FittedDamper(spec=preset.spec, theta=tuple(preset.theta), draws=lambda: chain)
    path = tuning_samples.study_file(tmp_path, tune="", more="[uncertainty]\nrealisations = 5\n")
    text = path.read_text().replace('preset = "kwok2006"', 'run = "run"\nlargest_command = 1.88')
    path.write_text(text.replace("lag = 190\n", ""))
    realisations = mr.read_study(path, lambda run: fit).realisations
    assert realisations is not None
    found = np.sort(realisations.theta[0][:, 0] / preset.theta[0])
    assert found == pytest.approx([0.9, 0.95, 1.0, 1.05, 1.1])


def test_storeys_that_yield_vary_in_stiffness_and_strength_and_keep_their_yield_drift(tmp_path: Path) -> None:
    given = study(tmp_path)
    arrangement = next(each for each in given.arrangements if each.row.kind == "controller")
    softer, damping = 0.8 * arrangement.bare.stiffness, arrangement.bare.damping
    drift = {"yield_drift": 5e-4}
    frame, soft = (
        mr.buildings.with_storeys_that_yield(each, **drift)
        for each in (arrangement.bare, replace(arrangement.bare, stiffness=softer, damping=damping))
    )
    arrangement = replace(arrangement, bare=frame, building=frame)
    varied = vary_building(arrangement, stiffness=0.8, damping=1.0)
    np.testing.assert_allclose(
        [each.numbers for each in varied.elements], [each.numbers for each in soft.elements], rtol=1e-12
    )
    one = nominal(given.devices)
    realisations = replace(
        one, stiffness=np.array([1.0, 0.8]), damping=np.ones(2), delay=np.zeros(2), seed=np.arange(2)
    )
    case = replace(case_of(given, realisations), arrangement=arrangement)
    found = case.criteria()
    assert found.axes["realisation"] == ("1", "2")
    assert (found.numbers["peak_ductility"] > 1.5).any()
    for place, building in enumerate((frame, soft)):
        alone = replace(arrangement, building=building)
        expected = replace(case, arrangement=alone, realisations=one).criteria()
        for name, array in found.numbers.items():
            np.testing.assert_allclose(array[..., place], expected.numbers[name][..., 0], rtol=1e-9)


def test_the_spring_of_a_tuned_mass_does_not_vary_with_the_building() -> None:
    bare = mr.building("uts")
    tuned = with_tuned_mass(bare, floor=5, mass=30.0, frequency=3.0, ratio=0.1)
    row = Row(label="TMD", kind="baseline")
    arrangement = Arrangement(row=row, bare=bare, building=tuned, devices=(), law=None)
    varied = vary_building(arrangement, stiffness=1.1, damping=1.0)
    n = bare.n_coordinates
    difference = varied.stiffness - tuned.stiffness
    assert np.allclose(difference[:n, :n], 0.1 * bare.stiffness)
    assert not difference[n:].any()


def test_an_isolated_building_varies_above_its_isolators() -> None:
    bare = mr.building("uts")
    isolated = mr.buildings.with_base_isolation_of_period(bare, mass=330.0, period=2.0, ratio=0.1)
    row = Row(label="isolated", kind="baseline")
    arrangement = Arrangement(row=row, bare=bare, building=isolated, devices=(), law=None)
    varied = vary_building(arrangement, stiffness=1.2, damping=1.0)
    # A rigid motion of the building on its isolators has the strain energy of these alone.
    rigid = np.linalg.lstsq(
        isolated.storeys, np.eye(len(isolated.storeys))[arrangement.strokes[0]], rcond=None
    )[0]
    assert rigid @ varied.stiffness @ rigid == pytest.approx(rigid @ isolated.stiffness @ rigid)


def test_a_band_of_a_run_that_failed_is_open() -> None:
    assert RealisationBand.of(np.array([1.0, np.inf])).upper == np.inf
    assert criterion("peak_drift").ratio


def test_an_uncertainty_that_cannot_be_is_refused(tmp_path: Path) -> None:
    refusal(study, tmp_path, "[uncertainty]\n", match="line 14: nothing in .* is uncertain")
    law = tuning_samples.study_file(tmp_path, tune=CONTROLLER.replace("1.2", "3.0"))
    refusal(mr.read_study, law, match="largest_command is 3, .* 1.88 at most")


def test_numbers_of_a_study_stopped_before_its_realisations_are_marked_unfinished(tmp_path: Path) -> None:
    given = study(tmp_path)

    def on_progress(progress: mr.Progress) -> None:
        if "realisations" in progress.in_words:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted) as stopped:
        mr.run_study(given, threads=1, on_progress=on_progress)
    assert stopped.value.result.status == "interrupted"
    assert mr.run_study(given, threads=1).status == "finished"


def test_progress_is_told_within_a_call_and_changes_no_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    many = "[uncertainty]\nrealisations = 100\nstiffness = 0.1\n"
    given = study(tmp_path, many, '[[controller]]\nlaw = "best_passive"\n')
    seen: list[mr.Progress] = []
    silent = mr.run_study(given, threads=1, check_step=True)
    told = mr.run_study(given, threads=1, on_progress=seen.append, check_step=True)
    # Nor do blocks of another size.
    monkeypatch.setattr(simulate, "_BLOCK_SECONDS", 0.0)
    small = mr.run_study(given, threads=1, on_progress=lambda progress: None, check_step=True)
    for name, array in silent.criteria_of_runs.numbers.items():
        for other in (told, small):
            assert np.array_equal(array, other.criteria_of_runs.numbers[name], equal_nan=True), name
    # The time that is left is known from the first runs with dampers on.
    assert [progress.left is None for progress in seen[:2]] == [True, True]
    assert all(progress.left is not None for progress in seen[2:])
    assert any("realisations 64 of " in progress.in_words for progress in seen)
    shares = [progress.share for progress in seen if progress.share is not None]
    assert 0.0 <= min(shares) <= max(shares) <= 1.0
