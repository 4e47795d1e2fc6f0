"""What a tuning has found, as arrays and as rows of the study that was tuned."""

from __future__ import annotations

import pytest
import tuning_samples
from refusals import refusal

import mrwork as mr

TUNE = """
[[tune]]
laws = ["clipped_optimal"]
budget = 5
population = 5
objectives = ["peak_drift", "peak_acceleration"]
"""


@pytest.fixture(scope="module")
def study() -> mr.Study:
    return tuning_samples.small_study(TUNE)


@pytest.fixture(scope="module")
def found(study: mr.Study) -> mr.TuningResults:
    pytest.importorskip("pymoo")
    return mr.tune(tuning_samples.small_study(), study.tunes, threads=1)


def test_a_point_of_a_front_is_a_row_that_is_simulated_as_it_was_tuned(
    study: mr.Study, found: mr.TuningResults
) -> None:
    (front,) = found.fronts
    (law,) = found.laws
    point = front.pick({"peak_drift": 1.0})
    assert point.train["peak_drift"] == min(each.train["peak_drift"] for each in front.points)
    wider = mr.tuning.with_tuned_law(study, front, point)
    wider = mr.tuning.with_tuned_law(wider, law, label="chosen")
    assert [row.label for row in wider.rows[-2:]] == [front.label, "chosen"]
    results = mr.run_study(wider)
    names = [motion.name for motion in results.motions]
    places = {front.label: len(wider.rows) - 2, "chosen": len(wider.rows) - 1}
    training = names.index(found.training[0])
    assert results.ratios(places[front.label], training, "passive_off")["peak_drift"] == pytest.approx(
        point.train["peak_drift"], rel=1e-9
    )
    for name, each in ((motion.motion, motion) for motion in law.train.motions):
        assert results.score_under(places["chosen"], [names.index(name)]) == pytest.approx(
            each.score, rel=1e-9
        )


def test_scores_and_criteria_have_law_and_motion(study: mr.Study, found: mr.TuningResults) -> None:
    data = found.to_xarray()
    assert data["score"].dims == ("law", "motion")
    assert set(data["motion"].values) == {motion.name for motion in study.motions}
    law = found.laws[0]
    assert law.test is not None
    for use, judged in (("training", law.train), ("test", law.test)):
        for each in judged.motions:
            place = {"law": law.label, "motion": each.motion}
            assert data["score"].sel(place) == each.score
            assert data["peak_drift"].sel(place) == each.criteria["peak_drift"]
            assert data["use"].sel(motion=each.motion) == use
    assert data["largest_command"].sel(law=law.label) == law.settings["largest_command"]
    table = found.to_pandas()
    assert table.index.names == ["law", "motion"]
    assert table.loc[(law.label, found.testing[0]), "use"] == "test"
    assert found.fronts[0].to_xarray()["train"].dims == ("point", "objective")


def test_what_is_no_point_or_no_objective_is_said(study: mr.Study, found: mr.TuningResults) -> None:
    front = found.fronts[0]
    refusal(front.pick, {"peak_drft": 1.0}, match="did you mean peak_drift")
    refusal(mr.tuning.with_tuned_law, study, found.laws[0], front.points[0], match="`point` is of a front")
    label = study.rows[1].label
    refusal(mr.tuning.with_tuned_law, study, found.laws[0], label=label, match=label)
