"""What a tuning has found, as arrays and as rows of the study that was tuned."""

from dataclasses import replace

import pytest
import tuning_samples
from refusals import refusal

import mrwork as mr
from mrwork.tuning.space import FreeSetting

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
    assert results.score(places["chosen"], [training]).mean == pytest.approx(law.least, rel=1e-9)


def test_objectives_and_settings_have_the_law_and_the_study_judges_each_point(
    found: mr.TuningResults,
) -> None:
    law, data = found.laws[0], found.to_xarray()
    assert data["least"].sel(law=law.label) == law.least
    assert data["largest_command"].sel(law=law.label) == law.settings["largest_command"]
    assert found.to_pandas().loc[law.label, "candidates"] == law.candidates
    judged = mr.tuning.judge(tuning_samples.small_study(), found)
    front = judged.tuned.fronts[0]
    assert front.to_xarray()["train"].dims == ("point", "objective")
    test = front.points[0].test
    picked = mr.tuning.with_tuned_law(tuning_samples.small_study(), front, front.points[0], label="first")
    alone = mr.run_study(picked)
    ratios = [alone.ratios(len(picked.rows) - 1, each, "passive_off") for each in alone.judged_motions]
    assert test is not None
    for name, ratio in test.items():
        assert ratio == pytest.approx(sum(each[name] for each in ratios) / len(ratios), rel=1e-9)


def test_a_setting_at_the_end_of_what_its_law_permits_is_not_to_be_widened(found: mr.TuningResults) -> None:
    for upper, codes in ((1.0, set()), (0.5, {"settings_at_bound"})):
        share = FreeSetting(name="share", lower=0.0, upper=upper, scale="linear")
        law = replace(found.laws[0], law="skyhook_groundhook", free=(share,), settings={"share": upper})
        assert {remark.code for remark in law.remarks} == codes


def test_what_is_no_point_or_no_objective_is_said(study: mr.Study, found: mr.TuningResults) -> None:
    front = found.fronts[0]
    refusal(front.pick, {"peak_drft": 1.0}, match="did you mean peak_drift")
    refusal(mr.tuning.with_tuned_law, study, found.laws[0], front.points[0], match="`point` is of a front")
    label = study.rows[1].label
    refusal(mr.tuning.with_tuned_law, study, found.laws[0], label=label, match=label)
