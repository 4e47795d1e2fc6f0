"""The ranking in the report: every family in the table, every one with a left-out fit in the figure."""

from __future__ import annotations

import numpy as np
import pytest

from mrwork.report import numbers
from mrwork.report.canvas import svg_bytes
from mrwork.report.fit.choices import ranking_figure
from mrwork.uncertainty.choice.leave_one_out import LeaveOneOut
from mrwork.uncertainty.choice.ranking import Evidence, Ranking, rank, ranking_of


def family(model: str, n_params: int, *left_out: float, reason: str = "") -> Evidence:
    told = LeaveOneOut(elpd=np.array([1.0, 2.0]) / n_params, pareto_k=np.array([0.1, 0.9]))
    return Evidence(
        model=model,
        title=model.capitalize(),
        n_params=n_params,
        status="converged" if left_out else "failed",
        seconds=1.0,
        reason=reason,
        fit_percent=95.0 if left_out else None,
        left_out=left_out,
        variance=0.01 * n_params if left_out else None,
        leave_one_out=told if left_out else None,
    )


@pytest.fixture(scope="module")
def ranking() -> Ranking:
    families = [
        family("good", 4, 0.05, 0.07, 0.06),
        family("large", 9, 0.05, 0.07, 0.0595),
        family("poor", 3, 0.30, 0.25, 0.20),
        family("lost", 5, 2.0, 8.0, 0.1),
        family("broken", 6, reason="it diverged"),
    ]
    return ranking_of(rank(families, 100.0), held_out="3 tests", n_folds=3, n_blocks=2, n_effective=100.0)


def test_every_family_is_a_row_and_the_reasons_are_there(ranking: Ranking) -> None:
    table = ranking.table
    rows = {row[0]: dict(zip(table.columns, row, strict=True)) for row in table.rows}
    assert list(rows) == ["large", "good", "poor", "lost", "broken"]
    assert rows["good"]["remark"] == "chosen, Pareto k above 0.7 in 1 block"
    assert rows["large"]["remark"].startswith("as good")
    assert rows["broken"]["remark"] == "failed, it diverged"
    assert rows["broken"]["left-out fit %"] == rows["broken"]["Δ BIC"] == "–"
    assert rows["good"]["left-out fit %"] == "94.00 ± 0.58"
    assert rows["large"]["behind, points"] == "0.00"


def test_page_and_terminal_have_the_same_cells_of_a_ranking(ranking: Ranking) -> None:
    text, page = ranking.table, ranking.page_table
    assert [row[1:] for row in text.rows] == [row[1:] for row in page.rows]
    assert [each.lower() for each in text.columns] == [each.lower() for each in page.columns]
    assert [row[0] for row in page.rows] == [each.title for each in ranking.standings]


def test_the_figure_has_every_family_that_was_judged_within_its_axes(ranking: Ranking) -> None:
    figure = ranking_figure(ranking)
    (axes,) = figure.axes
    labels = [label.get_text() for label in axes.get_yticklabels()]
    assert labels == ["Large, 9", "Good, 4", "Poor, 3", "Lost, 5"]
    assert [label.get_fontweight() for label in axes.get_yticklabels()] == [
        "normal",
        "bold",
        "normal",
        "normal",
    ]
    left, right = axes.get_xlim()
    # What lies 300 points away must not squeeze the others.
    assert right - left < 60.0
    for line in axes.lines:
        x = np.asarray(line.get_xdata(), dtype=float)
        assert np.all(x <= right)
    said = [text.get_text() for text in axes.texts]
    assert "chosen" in said
    assert "as good" in said
    assert f"{numbers.MINUS}237 %" in said
    assert svg_bytes(figure) == svg_bytes(ranking_figure(ranking))


def test_a_single_family_on_a_single_fold_can_be_drawn() -> None:
    alone = ranking_of(
        rank([family("only", 2, 0.1)], None),
        held_out="later cycles",
        n_folds=1,
        n_blocks=None,
        n_effective=None,
    )
    assert len(ranking_figure(alone).axes[0].get_yticklabels()) == 1
