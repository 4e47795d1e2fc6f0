"""Regulators are timed beside SciPy where both find the same gains, and not otherwise."""

from __future__ import annotations

import numpy as np
import pytest

from mrwork.errors import MrworkError, SettingError
from studies.speed import regulators
from studies.speed.regulators import bench_regulators, frames, measure, residual


def test_rows_say_what_was_measured() -> None:
    benchmark = bench_regulators(states=[6, 10], threads=[1], rounds=1, batch=9)
    assert [(row.states, row.batch, row.threads) for row in benchmark.rows] == [(6, 9, 1), (10, 9, 1)]
    for row in benchmark.rows:
        assert min(row.ours, row.scipy) > 0.0
        assert row.ratio == pytest.approx(row.ours / row.scipy)
        assert max(row.residual, row.scipy_residual) < 1e-11
    assert len(list(benchmark.text())) == 6


def test_results_that_disagree_are_not_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(regulators, "AGREEMENT", 0.0)
    with pytest.raises(MrworkError, match="do not trust the times"):
        next(measure(threads=1, states=6, batch=3, rounds=1))


def test_a_residual_is_relative_to_the_terms() -> None:
    assert residual(*frames(6, 2), np.zeros((2, 6, 6))) == pytest.approx(1.0)


@pytest.mark.parametrize("wrong", [{"states": [5]}, {"threads": [0]}, {"rounds": 0}, {"batch": -1}])
def test_settings_out_of_range_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(SettingError, match="must be 1 or more"):
        bench_regulators(**wrong)  # type: ignore[arg-type] # settings of several kinds by name
