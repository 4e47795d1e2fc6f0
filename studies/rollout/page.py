"""The page of the study: tables, and the larger peak ratio of each law beside its score."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mrwork.report import style
from studies.former.page import level_panels, ranked_figure, write_level_page
from studies.rollout.loop import SIXTEEN
from studies.rollout.tables import tables


def write_page(found: Mapping[str, Any], path: Path) -> None:
    """Write a figure for each level, and the tables."""
    write_level_page(
        path,
        title="A predictive rollout beside other laws",
        subject="Five storeys with a pair of magnetorheological dampers: chosen on synthetic motions, judged on "
        "measured ones",
        panels=level_panels(
            "peaks",
            "Sixteen motions",
            "Mean of the larger ratio of both peaks to the best constant command, for each law,",
            {level: figures["laws"] for level, figures in found["levels"].items()},
            peak_figure,
        ),
        tables=tables(found),
    )


def peak_figure(laws: Mapping[str, Any]) -> Figure:
    """A row for each law: the mean larger ratio of its peaks to those of the best constant command."""

    def mark(axes: Axes, row: Mapping[str, Any], place: int) -> None:
        axes.plot(row[SIXTEEN]["larger"], place, "o", color=style.DATA)
        axes.axvline(1.0, color=style.MODEL)

    label = "mean of the larger peak ratio to the best constant command"
    return ranked_figure(laws, lambda row: row[SIXTEEN]["larger"], mark, label)
