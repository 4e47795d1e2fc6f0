"""When a search has said what it can: the hypothesis test, the stall."""

from __future__ import annotations

import numpy as np
import pytest

from mrwork.search.rules import first_improvement, has_stalled, hypothesis_test, statistic, threshold


def test_thresholds_are_those_of_the_source():
    # 0.334 at 95 % and 0.217 at 99 %.
    assert threshold(0.95) == pytest.approx(0.334, abs=5e-4)
    assert threshold(0.99) == pytest.approx(0.217, abs=5e-4)


def test_statistic_counts_from_the_first_improvement():
    best = np.array([np.inf, 9.0, 9.0, 4.0, 2.0])
    assert first_improvement(best) == 1
    assert statistic(best) == pytest.approx((9 + 9 + 4 + 2) / 4 / 9)
    assert first_improvement(np.array([9.0, 9.0, 4.0, 2.0])) == 2
    assert statistic(np.array([9.0, 9.0, 4.0, 2.0])) == pytest.approx(0.75)


@pytest.mark.parametrize("best", [[], [1.0], [1.0, 1.0], [np.inf, np.inf], [2.0, 0.0], [0.0, 0.0]])
def test_nothing_decayed_means_no_stop(best):
    assert not hypothesis_test(np.array(best))


def test_traces_side_by_side_are_judged_each_on_its_own():
    traces = np.array([[np.inf, 9.0, 9.0, 4.0, 2.0], [9.0, 9.0, 9.0, 9.0, 9.0], [9.0, 3.0, 1.0, 0.5, 0.1]])
    assert np.array_equal(first_improvement(traces), [1, 5, 1])
    assert np.array_equal(statistic(traces), [float(statistic(trace)) for trace in traces])
    floor = np.array([0.5, 0.0, 0.1])
    assert np.array_equal(
        statistic(traces, floor=floor),
        [float(statistic(t, floor=f)) for t, f in zip(traces, floor, strict=True)],
    )
    assert np.array_equal(has_stalled(traces, generations=3, tolerance=0.1), [False, True, False])


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
