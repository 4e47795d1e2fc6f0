"""The objective of a tuning: risk over motions and realisations, limits, runs that did not finish."""

from __future__ import annotations

import numpy as np
import pytest
from sentences import Refused

from mrwork.closed_loop import SCORE
from mrwork.study import TuneTable
from mrwork.study.run_result import LabelledRuns, criteria_of_runs, numbered
from mrwork.tuning.problem import Scores
from mrwork.tuning.space import objective_of, ratio_to_baseline, risk_of

SCORES = np.array([[0.1, 0.5, 0.3, 0.9, 0.2, 0.4, 0.6, 0.8, 0.7, 1.0]])


def found(value: float) -> LabelledRuns:
    axes = {"candidate": numbered(1), "motion": ("A", "B"), "realisation": numbered(3)}
    return criteria_of_runs(axes, value)


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
    assert risk_of(scores, risk, 0.2)[0] == np.inf  # type: ignore[arg-type] # the parameters are its names


def test_dampers_at_zero_command_have_score_one() -> None:
    objective = objective_of(TuneTable(laws=("lyapunov",)), "A")
    assert tuple(objective.weights) == SCORE
    assert (objective.run_scores(found(2.0), found(2.0)) == 1.0).all()
    assert (
        ratio_to_baseline(np.array([np.inf, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])) == [np.inf, np.inf, 1.0]
    ).all()


def test_weights_of_criteria_are_relative() -> None:
    table = TuneTable(laws=("lyapunov",), criteria={"peak_drift": 3.0, "rms_drift": 1.0})
    runs = found(1.0)
    lower = runs.with_numbers(peak_drift=0.5 * runs.peak_drift)
    assert objective_of(table, "A").run_scores(lower, runs) == pytest.approx(0.75 * 0.5 + 0.25)


def test_the_largest_criterion_is_that_of_each_run() -> None:
    table = TuneTable(
        laws=("lyapunov",),
        criteria=("peak_drift", "rms_drift"),
        relative_to="best_passive",
        combine="largest",
    )
    runs = found(1.0)
    mixed = runs.with_numbers(peak_drift=np.linspace(0.5, 1.5, 6).reshape(1, 2, 3))
    objective = objective_of(table, "A")
    assert (objective.run_scores(mixed, runs)[0] == np.maximum(mixed.peak_drift[0], 1.0)).all()
    assert "largest of peak drift and RMS drift, each over its value under the best constant" in (
        objective.in_words(robust=False)
    )


def test_an_exceeded_limit_costs_more_than_any_gain_of_the_score() -> None:
    table = TuneTable(laws=("lyapunov",), constraints={"peak_stroke": "10 mm"})
    violation = objective_of(table, "A").violation(found(0.015))
    assert violation == pytest.approx(0.5)
    scores = Scores(objective=np.array([0.4, 0.9]), violation=np.array([violation[0], 0.0]))
    assert scores.best == 1


@pytest.mark.parametrize(
    "keys",
    [
        {"criteria": ("peak_drifft",)},
        {"criteria": {"peak_drift": -1.0}},
        {"constraints": {"peak_stroke": "10 kN"}},
        {"constraints": {"peak_stroke": 0.0}},
        {"tail": 1.5, "risk": "cvar"},
        {"criteria": ("peak_drift", "rms_drift", "peak_drift")},
        {"objectives": ("peak_drift", "peak_drift")},
        {"tail": 0.2},
        {"tail": 0.5, "risk": "max"},
    ],
)
def test_an_objective_that_means_nothing_is_refused(keys: dict[str, object], refused: Refused) -> None:
    refused(lambda: objective_of(TuneTable(laws=("lyapunov",), **keys), "A"))  # type: ignore[arg-type] # of several keys
