"""Pages of chapters and of studies of laws: figures as panels, marks in a key, loops of tests."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from pathlib import Path
from typing import Any, Concatenate, ParamSpec

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mrwork.report import Panel, Table, blank, draw_points, finish, panel, style, write_study_page
from studies.former.arrays import Floats

Arguments = ParamSpec("Arguments")

TONES = (style.MODEL, style.RESIDUAL, style.PARAMETER_BAND, style.INK, style.DATA, style.BAND_EDGE)
"""Colours of the lines of a figure, in their order."""
_LOOP_POINTS = 80

# Stroke width and dash pattern of the lines a key can show.
_STROKES = {
    "line": (1.6, ""),
    "dotted": (1.6, "2 2.5"),
    "dashed": (1.6, "6 3"),
    "wide": (6.0, ""),
}


def drawn(
    size: tuple[float, float],
) -> Callable[[Callable[Concatenate[Axes, Arguments], None]], Callable[Arguments, Figure]]:
    """Decorator that makes of a function that draws into axes one that returns a figure of this size."""

    def figure_function(draw: Callable[Concatenate[Axes, Arguments], None]) -> Callable[Arguments, Figure]:
        @wraps(draw)
        @style.drawn_in_style()
        def figure_of(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Figure:
            figure, axes = blank(size)
            draw(axes, *args, **kwargs)
            return figure

        return figure_of

    return figure_function


def panels(anchor: str, figures: Iterable[tuple[str, Figure, str]]) -> list[Panel]:
    """Panels of figures, each of which comes with a title and a description for screen readers."""
    return [
        panel(f"{anchor}-{place}", title, figure, description)
        for place, (title, figure, description) in enumerate(figures)
    ]


def write_chapter_page(folder: Path, path: Path, **content: Any) -> None:
    """Fill in `page.html.j2` of a chapter, which extends the layout of all chapters, and write it."""
    environment = Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined
    )
    layout, macros = (
        environment.from_string((Path(__file__).parent / f"{name}.html.j2").read_text(encoding="utf-8"))
        for name in ("layout", "figures")
    )
    shared = {"layout": layout, "macros": macros, "skipped": "", "footer": ""}
    write_study_page(folder / "page.html.j2", path, **shared | content)


def sentence_case(label: str) -> str:
    """The label with its first letter as a capital."""
    return label[0].upper() + label[1:]


def swatch(colour: str, kind: str, text: str = "") -> Markup:
    """A sample of a mark for a key ("point", "line", "dotted", "dashed" or "wide"), before its meaning."""
    if kind == "point":
        mark = Markup('<circle cx="11" cy="4.5" r="3.5" fill="{}"/>').format(colour)
    else:
        width, pattern = _STROKES[kind]
        dash = Markup(' stroke-dasharray="{}"').format(pattern) if pattern else ""
        mark = Markup('<path d="M0 4.5H22" stroke="{}" stroke-width="{}"{}/>').format(colour, width, dash)
    return Markup('<svg viewBox="0 0 22 9" aria-hidden="true">{}</svg>{}').format(mark, text)


def finish_loop(axes: Axes, *, over_velocity: bool) -> None:
    """Name the axes of a force loop in N and mm, or N and mm/s."""
    finish(axes, "Force (N)", "Velocity (mm/s)" if over_velocity else "Displacement (mm)")


def tested_points(axes: Axes, abscissa: Floats, force: Floats, cycle: slice) -> None:
    """One cycle of a test as points, thinned so that they can be distinguished."""
    drawn_samples = slice(cycle.start, cycle.stop, max(1, (cycle.stop - cycle.start) // _LOOP_POINTS))
    draw_points(axes, abscissa[drawn_samples], force[drawn_samples], size=4.5)


def write_level_page(
    path: Path,
    *,
    title: str,
    subject: str,
    panels: Iterable[Panel],
    tables: Iterable[Table],
    notes: Mapping[str, Iterable[str]] | None = None,
) -> None:
    """Write the page of a study of laws: figures, tables, and notes by their headings."""
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
