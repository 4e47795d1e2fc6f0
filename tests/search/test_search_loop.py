"""The loop: events, callbacks, rules that end a search, interrupts, going on."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from refusals import refusal
from search_problems import all_failing, bits, flat, half_failing, only_capped, sphere, with_floor

from mrwork.errors import Interrupted
from mrwork.search import EfficientGA, EliteRule, StopRules, run_search
from mrwork.search.rules import has_stalled, statistic, threshold

# Rules


@pytest.mark.parametrize(
    ("reason", "rules", "objective"),
    [
        ("hypothesis_test", StopRules(), sphere),
        ("hypothesis_test", StopRules(floor_share=1.0), with_floor),
        ("stall", StopRules(), with_floor),
        ("stall", StopRules(), flat),
        ("stall", StopRules(confidence=None), flat),
        ("target", StopRules(target=0.01), sphere),
        ("max_generations", StopRules(max_generations=10), sphere),
        ("max_evaluations", StopRules(max_evaluations=500), sphere),
        ("max_seconds", StopRules(max_seconds=0.0), sphere),
        # Long enough for crossover alone to draw half the population onto the best.
        ("spread", StopRules(confidence=None, stall_generations=None, max_generations=2000), with_floor),
    ],
)
def test_every_rule_is_reached_and_named(reason, rules, objective):
    result = run_search(EfficientGA(stop=rules), objective, rng=0, n_params=3)
    assert result.stop_reason == reason
    if reason != "max_seconds":
        assert result.state.course.stop_reason == reason


def test_time_is_no_part_of_the_state():
    optimiser = only_capped(8)
    ended = run_search(
        replace(optimiser, stop=replace(optimiser.stop, max_seconds=0.0)), sphere, rng=0, n_params=3
    )
    assert ended.state.course.running
    whole = run_search(optimiser, sphere, rng=0, n_params=3)
    resumed = run_search(optimiser, sphere, rng=0, n_params=3, state=ended.state)
    assert bits(resumed.state) == bits(whole.state)


def test_literal_test_never_stops_on_a_model_error_floor_and_the_floored_one_does():
    trace = run_search(only_capped(300), with_floor, rng=0, n_params=3).trace.best
    assert statistic(trace) > threshold(0.95) > statistic(trace, floor=trace[-1])


@pytest.mark.parametrize("rng", range(3))
def test_nothing_but_caps_and_target_stops_before_the_least_generations(rng):
    optimiser = EfficientGA(population=30, stop=StopRules(min_generations=25))
    assert run_search(optimiser, sphere, rng=rng, n_params=2).generations >= 25


def test_a_cap_below_the_first_generation_is_refused():
    capped = EfficientGA(stop=StopRules(max_evaluations=59))
    refusal(run_search, capped, sphere, rng=0, n_params=3, match="first generation alone takes 60")


# Events


def test_callback_returning_none_or_false_goes_on():
    answers = iter([None, False, True])
    result = run_search(EfficientGA(), sphere, rng=0, n_params=2, on_generation=lambda _: next(answers))
    assert (result.generations, result.stop_reason) == (3, "callback")


def test_every_generation_is_reported_with_the_result_so_far():
    reports = []
    result = run_search(EfficientGA(), half_failing, rng=2, n_params=3, on_generation=reports.append)
    assert [so_far.generations for so_far in reports] == list(range(1, result.generations + 1))
    assert [so_far.evaluations for so_far in reports] == list(result.trace.evaluations)
    assert [so_far.best_misfit for so_far in reports] == list(result.trace.best)
    assert np.all(np.diff([so_far.seconds for so_far in reports]) >= 0.0)
    assert [so_far.stop_reason for so_far in reports[-2:]] == ["", result.stop_reason]
    assert bits(reports[-1].state) == bits(result.state)


# Going on


def test_resuming_another_search_is_refused():
    state = EfficientGA().start(3, rng=5)
    for changed, word in (({"rng": 6}, "rng=6"), ({"n_params": 4}, "n_params=4")):
        asked = {"rng": 5, "n_params": 3, **changed}
        refusal(run_search, EfficientGA(), sphere, **asked, state=state, match=rf"requested are .*{word}")


def interrupted_after(completed, calls):
    """Sphere whose evaluation is interrupted by Ctrl-C after a number of generations."""
    count = itertools.count()

    def objective(unit):
        if next(count) == completed:
            raise KeyboardInterrupt
        calls.append(unit)
        return sphere(unit)

    return objective


@pytest.mark.parametrize("completed", [0, 5])
def test_interrupt_carries_what_the_completed_generations_found(completed):
    calls = []
    with pytest.raises(Interrupted) as caught:
        run_search(EfficientGA(), interrupted_after(completed, calls), rng=0, n_params=3)
    result = caught.value.result
    assert isinstance(caught.value, KeyboardInterrupt)
    assert (result.stop_reason, result.generations) == ("interrupted", completed)
    assert result.best_misfit == min((sphere(unit).min() for unit in calls), default=math.inf)
    assert result.evaluations == sum(len(unit) for unit in calls)


def test_interrupted_search_goes_on_as_if_it_never_was():
    optimiser = only_capped(20)
    whole = run_search(optimiser, sphere, rng=0, n_params=3)
    with pytest.raises(Interrupted) as caught:
        run_search(optimiser, interrupted_after(7, []), rng=0, n_params=3)
    resumed = run_search(optimiser, sphere, rng=0, n_params=3, state=caught.value.result.state)
    assert bits(whole.state) == bits(resumed.state)


def test_the_elite_is_led_by_the_best():
    optimiser = EfficientGA(elite=EliteRule(count=5, distance=0.15))
    result = run_search(optimiser, with_floor, rng=1, n_params=2)
    assert np.array_equal(result.elite[0], result.best_unit)
    assert np.all(np.diff(result.elite_misfit) >= 0.0)
    assert np.allclose(with_floor(result.elite), result.elite_misfit, rtol=1e-12)
    gap = np.abs(result.elite[:, None] - result.elite[None]).max(axis=2)
    assert len(result.elite) == 5
    assert np.all(gap[~np.eye(5, dtype=bool)] >= 0.15)


def test_thresholds_are_those_of_the_source():
    # 0.334 at 95 % and 0.217 at 99 %.
    assert threshold(0.95) == pytest.approx(0.334, abs=5e-4)
    assert threshold(0.99) == pytest.approx(0.217, abs=5e-4)
    for confidence in (0.0, 1.0, 2.0):
        refusal(StopRules, confidence=confidence, match="`confidence`")


def test_statistic_counts_from_the_first_improvement():
    best = np.array([np.inf, 9.0, 9.0, 4.0, 2.0])
    assert statistic(best) == pytest.approx((9 + 9 + 4 + 2) / 4 / 9)
    assert statistic(np.array([9.0, 9.0, 4.0, 2.0])) == pytest.approx(0.75)


@pytest.mark.parametrize("best", [[], [1.0], [1.0, 1.0], [np.inf, np.inf], [2.0, 0.0], [0.0, 0.0]])
def test_nothing_decayed_means_no_stop(best):
    assert statistic(np.array(best)) > threshold(0.95)


def test_no_decay_is_tested_while_every_simulation_has_failed():
    # At this confidence the least decay counts as significant.
    rules = StopRules(confidence=0.3, min_generations=1, spread_tolerance=None, stall_generations=None)
    assert (
        run_search(EfficientGA(stop=rules), all_failing, rng=0, n_params=2).stop_reason == "max_generations"
    )


def test_statistic_does_not_depend_on_the_unit_of_the_misfit():
    best = np.exp(-0.1 * np.arange(40))
    assert statistic(best * 1e300) == pytest.approx(statistic(best), rel=1e-12)


def test_stall_is_relative_and_needs_its_generations():
    best = np.array([2.0, 1.0, 0.9995, 0.9995])
    assert has_stalled(best, generations=2, tolerance=1e-3)
    assert not has_stalled(best, generations=2, tolerance=1e-4)
    assert not has_stalled(best, generations=3, tolerance=1e-3)
    assert not has_stalled(best, generations=4, tolerance=1e-3)
    assert has_stalled(np.zeros(5), generations=3, tolerance=1e-3)
    assert has_stalled(np.full(5, np.inf), generations=3, tolerance=1e-3)
