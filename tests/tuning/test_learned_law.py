"""A network of measured signals: its numbers are learned like any setting, and stand in the chosen study."""

from pathlib import Path

import numpy as np
import pytest
import tuning_samples
from refusals import refusal

from mrwork.control import settings_of
from mrwork.study import TuneTable
from mrwork.tuning.law_tuning import follow_gradients
from mrwork.tuning.tuned_laws import settings_in_words
from mrwork.tuning.tuning_run import plan_of

LAW = "signal_network"
TUNE = f"""
[[tune]]
laws = ["{LAW}"]
search = "cma"
population = 8
budget = 24
"""


@pytest.mark.long
def test_a_learned_network_stands_in_the_chosen_study_with_its_score(tmp_path: Path) -> None:
    pytest.importorskip("cma", reason="needs the extra peers")
    learned = tuning_samples.tuned_law_with_its_score(tmp_path, TUNE)
    assert learned.trace[-1].least < learned.trace[0].least
    assert len(learned.settings["network"]) == 25
    assert "network 25 numbers" in settings_in_words(learned.settings, "A")


def test_gradients_train_a_network_and_leave_the_largest_command() -> None:
    motions = tuning_samples.motion("A", 1) + tuning_samples.motion("B", 2).replace("3\n", "1.5\n", 1)
    study = tuning_samples.study_with(motions=motions)
    plan = plan_of(study, TuneTable(laws=(LAW,)), 1)
    space = plan.space
    is_largest = np.array([each.name for each in space.free]) == "largest_command"
    start = np.where(is_largest, 0.99, space.start)
    found = follow_gradients(plan, start, 3)
    candidates = [space.candidate(unit) for unit in (start, found.unit)]
    before, after = plan.scores(candidates).objective
    assert after < before
    assert found.unit[is_largest] == start[is_largest]


def test_a_network_near_the_clipped_optimal_law_is_where_the_search_begins() -> None:
    """On where the desired force has the direction of the force and is larger, off where it opposes the force."""
    space = plan_of(tuning_samples.small_study(), TuneTable(laws=(LAW,)), 1).space
    *units, bias = space.candidate(space.start).settings["network"]

    def share(force: float, wanted: float) -> float:
        total = bias
        for b, _, _, of_force, of_wanted, output in np.reshape(units, (4, 6)):
            inner = of_force * force + of_wanted * wanted
            total += output * (np.tanh(b + inner) + np.tanh(b - inner))
        return float(0.5 * (1.0 + np.tanh(total)))

    assert share(0.5, 1.0) > 0.8
    assert share(-0.5, -1.0) == share(0.5, 1.0)
    assert share(0.5, -1.0) < 0.05
    assert share(1.0, 0.1) < 0.05


def test_numbers_that_make_no_law_are_refused() -> None:
    problem = tuning_samples.small_study().problem
    scales = {"control_weight": 1e-12, "deformation": 1e-3, "rate": 0.1, "force": 1e3}
    network = settings_of(LAW, {**scales, "network": [0.0] * 24})
    refusal(network.design, problem, match="24 numbers; give 25")
