"""Free settings of every law: a tuning of a law needs nothing but its name."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from refusals import refusal

import mrwork as mr
from mrwork import Device
from mrwork.closed_loop.evaluation import SCORE, Scales
from mrwork.control import DesignProblem, ReferencePeaks, settings_of
from mrwork.control.laws.law_problem import Magnitudes
from mrwork.control.laws.law_settings import SETTINGS, design_candidates
from mrwork.study import TuneTable
from mrwork.study.runs import Runs, numbered, study_criteria
from mrwork.tuning.space import LARGEST, Scores, TuningObjective, space_of, tuning_objective

MAGNITUDES = Magnitudes(
    drift=5e-3,
    displacement=0.02,
    velocity=0.4,
    acceleration=3.0,
    energy=300.0,
    force=2000.0,
    stroke=5e-3,
    rate=0.1,
    ground=1.0,
    command=1.88,
    constant_drift=2e-3,
    constant_acceleration=2.0,
)


def _problem() -> DesignProblem:
    frame = mr.building("uts")
    preset = mr.damper("static_hysteretic").preset("kwok2006")
    device = Device(
        name="pair",
        spec=preset.spec,
        theta=preset.theta,
        row=frame.storeys[0],
        largest_command=1.88,
        differential=True,
    )
    return DesignProblem(
        building=frame,
        devices=[device],
        sample_time=1e-3,
        reference_peaks=lambda _: ReferencePeaks(commands=(0.5,), drift=2e-3, acceleration=3.0),
    )


# A network is given, not searched.
SEARCHED = [law for law in SETTINGS if law != "inverse_network"]


@pytest.mark.parametrize("law", SEARCHED)
def test_every_law_can_be_tuned_by_its_name_alone(law: str) -> None:
    space = space_of(TuneTable(laws=(law,)), law, MAGNITUDES)
    candidates = [space.candidate(np.full(len(space.free), place)) for place in (0.2, 0.5, 0.8)]
    settings = [settings_of(law, each.of_law) for each in candidates]
    designed = design_candidates(law, _problem(), settings)
    assert designed.law is not None
    assert len(designed.designed) == 3, designed.refusals


@pytest.mark.parametrize("law", SEARCHED)
def test_candidate_and_point_of_the_cube_are_inverse(law: str) -> None:
    space = space_of(TuneTable(laws=(law,)), law, MAGNITUDES)
    for unit in np.random.default_rng(0).uniform(size=(20, len(space.free))):
        candidate = space.candidate(unit)
        back = space.unit(candidate)
        assert back is not None
        assert space.candidate(back) == candidate


def test_batch_designs_are_those_of_single_settings() -> None:
    settings = [settings_of("clipped_optimal", {"drifts": 1.0, "control_weight": R}) for R in (1e-14, 1e-12)]
    designed = design_candidates("clipped_optimal", _problem(), settings)
    assert designed.law is not None
    for place, each in enumerate(settings):
        gain = np.asarray(designed.law.gains["gain"])[place]
        assert np.array_equal(gain, each.design(_problem()).gains["gain"])


def test_settings_that_make_no_law_are_refused_by_their_index() -> None:
    settings = [
        settings_of("clipped_optimal", {"drifts": w, "control_weight": 1e-13}) for w in (1.0, (1.0, 2.0))
    ]
    designed = design_candidates("clipped_optimal", _problem(), settings)
    assert designed.designed == (0,)
    assert "5 storeys" in designed.refusals[1]


def test_held_settings_are_not_searched_and_ranges_of_the_table_are() -> None:
    table = TuneTable(
        laws=("clipped_optimal",),
        settings={"drifts": 2.0},
        free={"control_weight": (1e-14, 1e-12), LARGEST: ()},
    )
    space = space_of(table, "clipped_optimal", MAGNITUDES)
    assert [each.name for each in space.free] == ["control_weight", LARGEST]
    assert space.candidate(np.zeros(2)).of_law == {"drifts": 2.0, "control_weight": 1e-14}
    assert space.candidate(np.ones(2)).largest_command == 1.88


@pytest.mark.parametrize(
    ("law", "keys", "word"),
    [
        ("clipped_optimal", {"free": {"control_weight": (2.0, 1.0)}}, "range of control_weight"),
        ("clipped_optimal", {"free": {LARGEST: (0.5, 3.0)}}, "1.88, the largest"),
        ("clipped_optimal", {"free": {"drifts": ()}}, "no control_weight"),
        ("clipped_optimal", {"settings": {"drifts": 1.0}, "free": {"drifts": ()}}, "held .* and free"),
        ("predictive_rollout", {"free": {"drift": (), "horizon": ()}}, "free acceleration"),
    ],
)
def test_a_space_that_cannot_be_searched_is_refused(law: str, keys: dict[str, Any], word: str) -> None:
    refusal(space_of, TuneTable(laws=(law,), **keys), law, MAGNITUDES, match=word)


SCALES = Scales.of(mr.building("uts"))
SCORES = np.array([[0.1, 0.5, 0.3, 0.9, 0.2, 0.4, 0.6, 0.8, 0.7, 1.0]])


def found(value: float) -> Runs:
    axes = {"candidate": numbered(1), "motion": ("A", "B"), "realisation": numbered(3)}
    runs = Runs.empty(axes, study_criteria("A"))
    return replace(runs, numbers={name: np.full(runs.shape, value) for name in runs.numbers})


def risk_of(scores: Any, risk: Any, tail: float) -> Any:
    return TuningObjective(weights={}, risk=risk, tail=tail).value(scores)


def test_conditional_value_at_risk_lies_between_mean_and_largest() -> None:
    assert risk_of(SCORES, "cvar", 1.0)[0] == pytest.approx(risk_of(SCORES, "mean", 1.0)[0])
    assert risk_of(SCORES, "cvar", 0.1)[0] == risk_of(SCORES, "max", 0.1)[0] == 1.0
    # The two largest and half the third.
    assert risk_of(SCORES, "cvar", 0.25)[0] == pytest.approx((1.0 + 0.9 + 0.4) / 2.5)


def test_risk_does_not_depend_on_the_order_of_the_scores() -> None:
    mixed = np.random.default_rng(0).permutation(SCORES[0])[None]
    for tail in (0.05, 0.3, 0.77):
        assert risk_of(mixed, "cvar", tail) == pytest.approx(risk_of(SCORES, "cvar", tail))


@pytest.mark.parametrize("risk", ["mean", "max", "cvar"])
def test_a_run_that_did_not_finish_makes_every_risk_infinite(risk: str) -> None:
    scores = SCORES.copy()
    scores[0, 3] = np.inf
    assert risk_of(scores, risk, 0.2)[0] == np.inf


def test_dampers_at_zero_command_have_score_one() -> None:
    objective = tuning_objective(TuneTable(laws=("lyapunov",)), "A", SCALES)
    assert tuple(objective.weights) == SCORE
    assert (objective.run_scores(found(2.0), found(2.0)) == 1.0).all()
    # Without an end, and over a baseline of zero, a run has no score: a search takes it for infinitely bad.
    assert np.isinf(objective.run_scores(found(np.nan), found(2.0))).all()
    assert np.isinf(objective.run_scores(found(0.0), found(0.0))).all()


def test_weights_of_criteria_are_relative() -> None:
    table = TuneTable(laws=("lyapunov",), criteria={"peak_drift": 3.0, "rms_drift": 1.0})
    runs = found(1.0)
    lower = replace(runs, numbers={**runs.numbers, "peak_drift": 0.5 * runs.peak_drift})
    assert tuning_objective(table, "A", SCALES).run_scores(lower, runs) == pytest.approx(0.75 * 0.5 + 0.25)


def test_the_largest_criterion_is_that_of_each_run() -> None:
    table = TuneTable(
        laws=("lyapunov",),
        criteria=("peak_drift", "rms_drift"),
        relative_to="best_passive",
        combine="largest",
    )
    runs = found(1.0)
    mixed = replace(runs, numbers={**runs.numbers, "peak_drift": np.linspace(0.5, 1.5, 6).reshape(1, 2, 3)})
    objective = tuning_objective(table, "A", SCALES)
    assert (objective.run_scores(mixed, runs)[0] == np.maximum(mixed.peak_drift[0], 1.0)).all()
    assert "largest of peak drift and RMS drift, each over its value under the best constant" in (
        objective.in_words(robust=False)
    )


def test_an_exceeded_limit_costs_more_than_any_gain_of_the_score() -> None:
    table = TuneTable(laws=("lyapunov",), constraints={"peak_stroke": "10 mm"})
    violation = tuning_objective(table, "A", SCALES).violation(found(0.015))
    assert violation == pytest.approx(0.5)
    scores = Scores(objective=np.array([0.4, 0.9]), violation=np.array([violation[0], 0.0]))
    assert scores.best == 1


@pytest.mark.parametrize(
    ("keys", "word"),
    [
        ({"criteria": ("peak_drifft",)}, "did you mean peak_drift"),
        ({"criteria": {"peak_drift": -1.0}}, "is -1; give a number above 0"),
        ({"constraints": {"peak_stroke": "10 kN"}}, "10 kN"),
        ({"constraints": {"peak_stroke": 0.0}}, "peak_stroke is 0"),
        ({"tail": 0.2}, "tail has no effect"),
    ],
)
def test_an_objective_that_means_nothing_is_refused(keys: dict[str, object], word: str) -> None:
    refusal(lambda: tuning_objective(TuneTable(laws=("lyapunov",), **keys), "A", SCALES), match=word)  # type: ignore[arg-type] # of several keys
