"""Gradients of a law that does not switch lower its objective, and what has none is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import own_dampers
import tuning_samples
from sentences import Refused

import mrwork as mr
from mrwork.study import TuneTable
from mrwork.tuning.law_tuning import check_finish, follow_gradients
from mrwork.tuning.problem import Clock, benches_of, magnitudes_of, score_candidates
from mrwork.tuning.space import objective_of, space_of

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


def test_scores_without_gradients_are_refused(tmp_path: Path, refused: Refused) -> None:
    study = mr.read_study(tuning_samples.study_file(tmp_path))
    learned = TuneTable(laws=("signal_network",), gradient_steps=5)
    for table in (
        replace(learned, laws=("clipped_optimal",)),
        replace(learned, free={"network": (), "dead_zone": ()}),
        replace(learned, constraints={"switching_rate": 1.0}),
    ):
        refused(check_finish, table, study)
    coarse = replace(study, hardware=replace(study.hardware, force_resolution=10.0))
    refused(check_finish, learned, coarse)
    spec = own_dampers.static
    own = replace(
        study, devices=tuple(replace(each, spec=spec, theta=spec.nominal) for each in study.devices)
    )
    refused(check_finish, learned, own)
