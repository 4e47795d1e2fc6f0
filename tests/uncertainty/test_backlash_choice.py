"""A rig with play: the model with backlash is chosen, and predicts small strokes where it was tested at them."""

import numpy as np
import pytest
from backlash_rig import ELEMENT, MOTIONS, PLAY, backlash_test

import mrwork as mr
from mrwork.identification.result import free_run

MODELS = ("hyperbolic_tangent_gavin", "normalised_bouc_wen", "backlash_bouc_wen")
LARGE, MIDDLE, SMALL, SMALLEST = (MOTIONS[place] for place in (0, 2, 3, 4))


@pytest.mark.long
def test_the_model_with_backlash_is_chosen_on_a_single_test() -> None:
    ranking = mr.choose_model(backlash_test(MIDDLE, cycles=4), MODELS, threads=1).ranking
    assert ranking.chosen == "backlash_bouc_wen"
    best, second = ranking.standings[:2]
    assert best.left_out_percent is not None
    assert second.left_out_percent is not None
    assert best.left_out_percent > second.left_out_percent + 5.0


@pytest.fixture(scope="module")
def joint() -> mr.uncertainty.Choice:
    tests = [backlash_test(motion, cycles=3, rng=seed) for seed, motion in enumerate((LARGE, MIDDLE, SMALL))]
    return mr.choose_model(tests, MODELS[1:], threads=1)


@pytest.mark.long
def test_the_model_with_backlash_is_chosen_over_several_amplitudes(joint: mr.uncertainty.Choice) -> None:
    assert joint.ranking.chosen == "backlash_bouc_wen"
    found = dict(zip(joint.best.spec.names, joint.best.theta, strict=True))
    assert found["g"] == pytest.approx(PLAY, rel=0.05)
    assert found["k_w"] == pytest.approx(ELEMENT["k_w"], rel=0.02)


@pytest.mark.long
def test_small_strokes_are_predicted_where_such_were_tested_and_warned_of_where_not(
    joint: mr.uncertainty.Choice,
) -> None:
    fit = joint.best
    assert fit.tested is not None
    tested, untested = backlash_test(SMALL, rng=7), backlash_test(SMALLEST)
    _, quality = free_run(fit.spec, np.array(fit.theta), tested)
    assert quality.fit_percent > 90.0
    assert fit.outside(tested).names == ()
    (remark,) = fit.outside(untested).remarks
    assert "2 mm or less, make 20 % of the travel or more, tested from 4 mm" in remark.message
