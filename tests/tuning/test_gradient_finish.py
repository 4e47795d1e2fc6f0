"""Gradients of a smooth law: the twin has the scores of the loop, and their derivatives in the free settings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tuning_samples
from sentences import Refused

import mrwork as mr
from mrwork.study import TuneTable
from mrwork.tuning.law_tuning import check_finish, follow_gradients, risk_weights
from mrwork.tuning.problem import Clock, benches_of, magnitudes_of, score_candidates
from mrwork.tuning.space import TuningObjective, objective_of, risk_of, space_of

LAW = "proportional_direct"


def test_gradients_lower_the_objective_of_the_loop(tmp_path: Path) -> None:
    study = mr.read_study(
        tuning_samples.study_file(tmp_path, motions=tuning_samples.motion("A", 1).replace("3\n", "1\n", 1))
    )
    table = TuneTable(laws=(LAW,), free={"slope": (), "largest_command": ()})
    benches = benches_of(study, journal=None, threads=1, clock=Clock())
    space = space_of(table, LAW, magnitudes_of(benches.training))
    objective = objective_of(table, "A")
    start = np.array([0.4, 0.99])
    found = follow_gradients(space, benches.training, objective, start, 3)
    candidates = [space.candidate(start), space.candidate(found.unit)]
    before, after = score_candidates(benches.training, objective, LAW, candidates).objective
    assert after < before
    assert found.unit[1] == start[1]


@pytest.mark.parametrize(("risk", "tail"), [("mean", 1.0), ("max", 1.0), ("cvar", 0.3)])
def test_weights_of_scores_are_the_derivative_of_the_risk(risk: str, tail: float) -> None:
    objective = TuningObjective(weights={"peak_drift": 1.0}, risk=risk, tail=tail)  # type: ignore[arg-type] # a parameter
    scores = np.random.default_rng(0).uniform(size=7)
    weights = risk_weights(scores, objective)
    for place in range(7):
        moved = scores.copy()
        moved[place] += 1e-6
        ends = [risk_of(each[None], objective.risk, tail)[0] for each in (scores, moved)]
        assert weights[place] == pytest.approx((ends[1] - ends[0]) / 1e-6, abs=1e-6)


def test_gradients_that_the_twin_does_not_have_are_refused(tmp_path: Path, refused: Refused) -> None:
    study = mr.read_study(tuning_samples.study_file(tmp_path))
    refused(check_finish, TuneTable(laws=("clipped_optimal",), gradient_steps=5), study)
    learned = TuneTable(laws=("signal_network",), gradient_steps=5)
    refused(check_finish, replace(learned, settings={"floors": (5,)}), study)
    refused(check_finish, replace(learned, free={"network": (), "dead_zone": ()}), study)
