"""Rows as tables, best first; an entry that failed is a row with its reason."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mrwork.closed_loop import SCORE
from mrwork.report import Table
from studies.former.scores import PEAKS, TITLES
from studies.leaderboard.damper_scores import DamperScore
from studies.leaderboard.entries import Row
from studies.leaderboard.law_scores import MotionScore

if TYPE_CHECKING:
    from studies.leaderboard.benchmark_score import BenchmarkScore

ScoreT = TypeVar("ScoreT")
LawScore = Mapping[str, MotionScore]
"""Ratios by the name of the motion."""


def damper_table(title: str, rows: Sequence[Row[DamperScore]], *, absent: str = "") -> Table:
    """Prediction of held-out tests, largest median first."""
    return _table(
        title,
        rows,
        {
            "median [%]": lambda score: f"{score.median:.2f}",
            "worst [%]": lambda score: f"{score.worst:.2f}",
            "worst test": lambda score: score.worst_test,
        },
        order=lambda score: -score.median,
        note=absent or "Fit % of held-out tests, each motion left out in turn.",
    )


def law_table(title: str, rows: Sequence[Row[LawScore]], *, absent: str = "") -> Table:
    """Ratios on unseen motions, least mean of the four ratios first."""

    def ratio_to_best(name: str) -> Callable[[LawScore], str]:
        return lambda score: f"{np.mean([each.to_best_constant[name] for each in score.values()]):.3f}"

    def ratio_to_off(name: str) -> Callable[[LawScore], str]:
        return lambda score: f"{np.mean([each.to_passive_off[name] for each in score.values()]):.3f}"

    return _table(
        title,
        rows,
        {
            **{f"{TITLES[name]} / optimal passive": ratio_to_best(name) for name in PEAKS},
            **{f"{TITLES[name]} / passive-off": ratio_to_off(name) for name in SCORE},
            "mean of four": lambda score: f"{mean_score(score):.3f}",
            "worst motion": lambda score: worst_motion(score),
            "its mean": lambda score: f"{score[worst_motion(score)].score:.3f}",
        },
        order=mean_score,
        note=absent or "Means over the motions; the mean of four is that of the ratios to passive-off.",
    )


def benchmark_table(title: str, rows: Sequence[Row[BenchmarkScore]]) -> Table:
    """Errors on the test signals of the Bouc-Wen benchmark."""
    return _table(
        title,
        rows,
        {
            "multisine [m]": lambda score: f"{score.multisine:.2e}",
            "sine sweep [m]": lambda score: f"{score.sweep:.2e}",
            "identified from": lambda score: score.training,
            "tested on": lambda score: score.test,
        },
        order=lambda score: score.multisine,
        note="Root mean square error of the free run. Only errors on the published test signals compare with papers.",
    )


def method_table(rows: Sequence[Row[Any]]) -> Table:
    """The method of each entry, the first line of its docstring."""
    return Table(
        title="Methods",
        columns=("entry", "method"),
        rows=tuple({row.name: (row.name, row.title) for row in rows}.values()),
        words=(1,),
        note="Authors and references stand in the files of the entries.",
    )


def mean_score(score: LawScore) -> float:
    """The mean over motions of the mean of the four ratios to passive-off."""
    return float(np.mean([each.score for each in score.values()]))


def worst_motion(score: LawScore) -> str:
    """The motion with the largest mean of the four ratios."""
    return max(score, key=lambda name: score[name].score)


def _table(
    title: str,
    rows: Sequence[Row[ScoreT]],
    columns: Mapping[str, Callable[[ScoreT], str]],
    *,
    order: Callable[[ScoreT], float],
    note: str,
) -> Table:
    ranked = sorted(rows, key=lambda row: (row.score is None, 0.0 if row.score is None else order(row.score)))

    def cells(row: Row[ScoreT]) -> tuple[str, ...]:
        if row.score is None:
            return (f"failed: {row.failure.replace('|', '/')}", *[""] * (len(columns) - 1))
        return tuple(cell(row.score) for cell in columns.values())

    return Table(
        title=title,
        columns=("entry", *columns, "parameters", "seconds"),
        rows=tuple(
            (
                row.name,
                *cells(row),
                "" if row.n_params is None else str(row.n_params),
                f"{row.seconds:.1f}",
            )
            for row in ranked
        ),
        note=note,
    )
