"""The page of the study: tables, and the scores of each law with their spread over motions."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mrwork.report import panel, style, write_study_page
from studies.robust_control.tables import tables


def write_page(found: Mapping[str, Any], path: Path) -> None:
    """Write a figure for each level, and the tables."""
    write_study_page(
        Path(__file__).parent / "page.html.j2",
        path,
        panels=[
            panel(
                f"scores-{number}",
                f"Scores on the test motions, {level}",
                score_figure(figures["laws"]),
                f"Score of each law under each test motion at {level}, with the mean over them",
            )
            for number, (level, figures) in enumerate(found.items())
        ],
        tables=list(tables(found)),
    )


def score_figure(laws: Mapping[str, Any]) -> Figure:
    """A row for each law: a point for each test motion, and the mean."""
    ranked = sorted(laws.items(), key=lambda each: -each[1]["test"])
    with style.drawn_in_style():
        figure = Figure(figsize=(7.0, 0.4 * len(ranked) + 0.8), layout="constrained")
        axes = figure.add_subplot()
        for place, (_, row) in enumerate(ranked):
            scores = np.array(list(row["motions"].values()))
            axes.plot(scores, np.full(scores.size, place), "o", color=style.DATA, markersize=3, alpha=0.6)
            axes.plot(row["test"], place, "|", color=style.MODEL, markersize=14, markeredgewidth=2.5)
        axes.set_yticks(range(len(ranked)), [label for label, _ in ranked])
        axes.set_xlabel("score under each test motion, and the mean")
    return figure
