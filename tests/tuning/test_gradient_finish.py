"""Gradients of a law that does not switch lower its objective, and what has none is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import own_dampers
import pytest
import tuning_samples
from sentences import Refused

import mrwork as mr
from mrwork.errors import Interrupted
from mrwork.study import TuneTable
from mrwork.tuning import law_tuning
from mrwork.tuning.law_tuning import check_finish, follow_gradients
from mrwork.tuning.problem import Bench, Clock, benches_of, magnitudes_of, score_candidates
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


def test_gradients_that_are_interrupted_keep_what_the_search_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    followed = []

    def interrupted(space: object, bench: Bench, *_: object) -> None:
        followed.append(len(bench.realisations))
        raise KeyboardInterrupt

    monkeypatch.setattr(law_tuning, "follow_gradients", interrupted)
    study = mr.read_study(
        tuning_samples.study_file(
            tmp_path,
            building=tuning_samples.TWO_STOREYS,
            more="\n[uncertainty]\nrealisations = 2\nstiffness = 0.1\n",
            tune=f"[[tune]]\nlaws = ['{LAW}']\nbudget = 8\npopulation = 5\ngradient_steps = 2\nrobust = true\n",
        )
    )
    with pytest.raises(Interrupted) as stopped:
        mr.tune(study, threads=1)
    assert [law.law for law in stopped.value.result.laws] == [LAW]
    # The score that is searched, with its realisations, is the one that is followed.
    assert followed == [2]
