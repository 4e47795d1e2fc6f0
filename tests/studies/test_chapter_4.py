"""The study of chapter 4 with few runs, and its arithmetic on traces whose answers are known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import measured_data
import numpy as np
import pytest
from blank_pictures import blank

from studies.chapter_4.decay import (
    at_budget,
    error_level,
    evaluations_to,
    expected_evaluations,
    holm,
)
from studies.chapter_4.excerpts import synthetic_excerpts
from studies.chapter_4.findings import comparisons_of, findings_of
from studies.chapter_4.page import write_page
from studies.chapter_4.search_cells import Replicates, cells_of
from studies.chapter_4.search_runs import recall, run_cells
from studies.chapter_4.search_settings import EFFICIENT, SEARCHES, STANDARD, SWARM, ComparisonSettings
from studies.chapter_4.tables import error_table, level_table, tables_of

REPLICATES, POPULATION, GENERATIONS = 4, 10, 12


def made_of(best: list[list[float]], evaluations: list[list[int]]) -> Replicates:
    """Runs with these traces."""
    return Replicates(
        best=np.array(best),
        evaluations=np.array(evaluations),
        unit=np.zeros((len(best), 1)),
        spared=0.0,
        seconds=0.0,
    )


def test_few_runs_of_every_search_are_compared_kept_and_shown(tmp_path: Path) -> None:
    whole = ComparisonSettings.read(measured_data.ROOT / "studies/chapter_4/study.toml")
    settings = replace(
        whole,
        replicates=REPLICATES,
        population=POPULATION,
        generations=GENERATIONS,
        synthetic=replace(whole.synthetic, currents=(0.0, 1.0), seconds=0.6),
    )
    tests = synthetic_excerpts(settings.synthetic, seed=settings.seed)
    cells = cells_of(settings, (tests,))
    assert len({cell.name for cell in cells}) == len(cells)
    assert len(cells) == len(settings.models) * len(tests.tests) * len(SEARCHES)
    kept = tmp_path / "cells"

    def run(chosen: object = cells) -> tuple[Replicates, ...]:
        return run_cells(chosen, kept, threads=1, fresh=False, say=lambda what: None)  # type: ignore[arg-type] # cells

    run(cells[:2])
    finished = {path: path.stat().st_mtime_ns for path in kept.iterdir()}
    assert [recall(kept, cell) is not None for cell in cells[:4]] == [True, True, False, False]
    found = run()
    assert all(path.stat().st_mtime_ns == written for path, written in finished.items())
    np.testing.assert_array_equal(recall(kept, cells[0]).best, found[0].best)
    for runs in found:
        assert runs.best.shape == (REPLICATES, GENERATIONS)
        assert np.all(np.diff(runs.best, axis=1) <= 0.0)
        assert np.all(runs.evaluations[:, 0] == POPULATION)
        assert np.all(np.diff(runs.evaluations, axis=1) <= POPULATION)

    comparison = comparisons_of((tests,), cells, found)[0]
    for trial in comparison.trials:
        for search in SEARCHES:
            np.testing.assert_array_equal(trial.runs[search].best[:, 0], trial.runs[STANDARD].best[:, 0])
            # Only the swarm gives thresholds.
            assert (trial.runs[search].spared > 0.0) == (search == SWARM)
    first, other = (trial.runs[STANDARD].best[:, 0] for trial in comparison.trials[:2])
    assert not np.any(first == other)

    findings = findings_of(comparison, settings)
    trial = comparison.trials[0]
    mean = 100.0 * trial.runs[EFFICIENT].final.mean()
    assert f"{mean:.2f} ± " in error_table(findings, "here").rows[0][1 + SEARCHES.index(EFFICIENT)]
    below = 100.0 * np.mean(trial.runs[SWARM].final <= trial.level)
    assert level_table(findings, "here").rows[0][2 + SEARCHES.index(SWARM)] == f"{below:.0f}"
    assert all(len(row) == len(table.columns) for table in tables_of(findings, "here") for row in table.rows)
    page = tmp_path / "report.html"
    with blank():
        write_page([comparison], [findings], page, settings=settings, skipped="No records.", footer="")
    text = page.read_text(encoding="utf-8")
    assert '<span class="tag">synthetic</span>' in text
    assert "Measured at" not in text


def test_levels_costs_and_errors_are_those_of_known_traces() -> None:
    runs = [made_of([[1.0, 0.2], [3.0, 1.0]], [[1, 2]] * 2), made_of([[1.0, 0.4], [3.0, 0.6]], [[1, 2]] * 2)]
    assert error_level(runs) == pytest.approx(0.2 + 0.05 * (2.0 - 0.2))
    # Runs that miss a level count.
    three = made_of(
        [[4.0, 2.0, 1.0], [4.0, 3.0, 3.0], [1.0, 1.0, 1.0]], [[10, 18, 25], [10, 17, 26], [10, 15, 20]]
    )
    np.testing.assert_array_equal(evaluations_to(three, 1.5), [25.0, np.inf, 10.0])
    assert expected_evaluations(three, 1.5) == (25 + 26 + 10) / 2
    assert expected_evaluations(three, 0.5) == np.inf
    # An error at a budget is that of the last generation paid for.
    two = made_of([[4.0, 2.0, 1.0], [5.0, 3.0, 2.0]], [[10, 18, 25], [10, 20, 30]])
    np.testing.assert_array_equal(at_budget(two, np.array([18, 19])), [2.0, 5.0])
    np.testing.assert_array_equal(at_budget(two, np.array([[9], [100]])), [[np.inf, np.inf], [1.0, 2.0]])
    np.testing.assert_allclose(holm(np.array([0.01, 0.04, 0.03, 0.9])), [0.04, 0.09, 0.09, 0.9])
