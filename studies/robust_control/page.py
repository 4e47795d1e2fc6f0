"""The page of the study: tables, and the scores of each law with their spread over motions."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mrwork.report import style
from studies.former.page import level_panels, ranked_figure, write_level_page
from studies.robust_control.tables import tables


def write_page(found: Mapping[str, Any], path: Path) -> None:
    """Write a figure for each level, and the tables."""
    write_level_page(
        path,
        title="Laws on motions they were not tuned on",
        subject="Five storeys with a pair of magnetorheological dampers: tuned on synthetic motions, judged on "
        "measured ones",
        panels=level_panels(
            "scores",
            "Scores on the test motions",
            "Score of each law under each test motion, with the mean over them,",
            {level: figures["laws"] for level, figures in found.items()},
            score_figure,
        ),
        tables=tables(found),
    )


def score_figure(laws: Mapping[str, Any]) -> Figure:
    """A row for each law: a point for each test motion, and the mean."""

    def mark(axes: Axes, row: Mapping[str, Any], place: int) -> None:
        scores = list(row["motions"].values())
        axes.plot(scores, np.full(len(scores), place), "o", color=style.DATA, markersize=3, alpha=0.6)
        axes.plot(row["test"], place, "|", color=style.MODEL, markersize=14, markeredgewidth=2.5)

    label = "score under each test motion, and the mean"
    return ranked_figure(laws, lambda row: row["test"], mark, label)
