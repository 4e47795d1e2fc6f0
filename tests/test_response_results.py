"""What follows from the runs of a study: criteria, ratios, score, warnings."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

import response_samples
from mrwork.closed_loop.criteria import criteria


def test_a_linear_swing_has_the_ratios_of_its_amplitudes() -> None:
    results = response_samples.results()
    for row in range(5):
        wanted = response_samples.amplitude(row, 1) / response_samples.amplitude(0, 1)
        found = results.ratios(row, 1, "uncontrolled")
        for entry in criteria():
            if entry.ratio:
                assert found[entry.name] == pytest.approx(wanted, rel=1e-12), entry.name


def test_ratios_of_the_references_themselves_are_one() -> None:
    results = response_samples.results()
    for row, against in ((0, "uncontrolled"), (1, "passive_off")):
        found = results.ratios(row, 0, against)  # type: ignore[arg-type]
        assert {found[entry.name] for entry in criteria() if entry.ratio} == {1.0}


def test_the_score_is_the_mean_over_motions() -> None:
    results = response_samples.results()
    wanted = response_samples.amplitude(4, 0) / response_samples.amplitude(1, 0)
    assert results.score(4) == pytest.approx(wanted, rel=1e-12)


def test_a_run_that_failed_has_no_criteria_and_leaves_no_score() -> None:
    results = response_samples.results()
    runs = dict(results.runs)
    runs[4, 0] = replace(runs[4, 0], outcome="diverged", energy_error=math.nan)
    results = replace(results, runs=runs)
    assert results.criteria(4, 0) is None
    assert math.isnan(results.score(4))
    assert all(math.isnan(value) for value in results.ratios(4, 0, "passive_off").values())
    assert "Lyapunov <1 A> under El Centro ended diverged; it has no criteria." in results.warnings()


def test_an_energy_balance_that_does_not_hold_is_said_once_for_each_row() -> None:
    (warning,) = response_samples.results().warnings()
    assert "Clipped-optimal" in warning
    assert "3.0e-04 of what was turned over, under filtered noise; 1 of 2 runs" in warning


def test_a_balance_that_is_no_number_does_not_hold() -> None:
    results = response_samples.results()
    runs = results.runs | {(2, 0): replace(results.runs[2, 0], energy_error=math.nan)}  # type: ignore[operator]
    assert any(text.startswith("Isolation") for text in replace(results, runs=runs).warnings())
