"""The page of the study: tables, and the larger peak ratio of each law beside its score."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from mrwork.report import panel, style, write_study_page
from studies.rollout.loop import SIXTEEN
from studies.rollout.tables import tables


def write_page(found: Mapping[str, Any], path: Path) -> None:
    """Write a figure for each level, and the tables."""
    write_study_page(
        Path(__file__).parent / "page.html.j2",
        path,
        panels=[
            panel(
                f"peaks-{number}",
                f"Sixteen motions, {level}",
                peak_figure(figures["laws"]),
                f"Mean of the larger ratio of both peaks to the best constant command at {level}, for each law",
            )
            for number, (level, figures) in enumerate(found["levels"].items())
        ],
        tables=list(tables(found)),
    )


def peak_figure(laws: Mapping[str, Any]) -> Figure:
    """A row for each law: the mean larger ratio of its peaks to those of the best constant command."""
    ranked = sorted(laws.items(), key=lambda each: -each[1][SIXTEEN]["larger"])
    with style.drawn_in_style():
        figure = Figure(figsize=(7.0, 0.4 * len(ranked) + 0.8), layout="constrained")
        axes = figure.add_subplot()
        for place, (_, row) in enumerate(ranked):
            axes.plot(row[SIXTEEN]["larger"], place, "o", color=style.DATA)
        axes.axvline(1.0, color=style.MODEL)
        axes.set_yticks(range(len(ranked)), [label for label, _ in ranked])
        axes.set_xlabel("mean of the larger peak ratio to the best constant command")
    return figure
