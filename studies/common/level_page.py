"""The page of a study of laws: figures, one for each level of the motions, then tables and notes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mrwork.report import Panel, Table, panel, style, write_study_page


def write_page(
    path: Path,
    *,
    title: str,
    subject: str,
    panels: Iterable[Panel],
    tables: Iterable[Table],
    notes: Mapping[str, Iterable[str]] | None = None,
) -> None:
    """Write a page of figures, tables, and notes by their headings."""
    write_study_page(
        Path(__file__).parent / "level_page.html.j2",
        path,
        title=title,
        subject=subject,
        panels=list(panels),
        tables=list(tables),
        notes=notes or {},
    )


def level_panels(
    name: str, title: str, words: str, levels: Mapping[str, Any], draw: Callable[[Any], Figure]
) -> list[Panel]:
    """A figure for each level; `words` describe it."""
    return [
        panel(f"{name}-{number}", f"{title}, {level}", draw(figures), f"{words} at {level}")
        for number, (level, figures) in enumerate(levels.items())
    ]


def ranked_figure(
    laws: Mapping[str, Any],
    rank: Callable[[Any], float],
    mark: Callable[[Axes, Any, int], None],
    label: str,
) -> Figure:
    """A row for each law, lowest rank on top, with the marks that `mark` puts at its place."""
    ranked = sorted(laws.items(), key=lambda item: -rank(item[1]))
    with style.drawn_in_style():
        figure = Figure(figsize=(7.0, 0.4 * len(ranked) + 0.8), layout="constrained")
        axes = figure.add_subplot()
        for place, (_, row) in enumerate(ranked):
            mark(axes, row, place)
        axes.set_yticks(range(len(ranked)), [name for name, _ in ranked])
        axes.set_xlabel(label)
    return figure
