"""The page of a study: one HTML file that needs nothing from anywhere else, in the style of the reports."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from markupsafe import Markup
from matplotlib.figure import Figure

from mrwork.report.html import environment, styles
from mrwork.report.svg import inline_svg

# Stroke width and dash pattern of the lines a key can show.
_STROKES = {
    "line": (1.6, ""),
    "dotted": (1.6, "2 2.5"),
    "dashed": (1.6, "6 3"),
    "wide": (6.0, ""),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """A figure with what stands above it."""

    title: str
    svg: Markup


def panel(identifier: str, title: str, figure: Figure, description: str) -> Panel:
    """A figure as a panel; `identifier` is unique on the page, `description` is for who cannot see it."""
    return Panel(title=title, svg=Markup(inline_svg(figure, identifier=identifier, description=description)))


def swatch(colour: str, kind: str) -> Markup:
    """What a mark looks like, for a key: a "point", or a "line", "dotted", "dashed" or "wide"."""
    if kind == "point":
        mark = Markup('<circle cx="11" cy="4.5" r="3.5" fill="{}"/>').format(colour)
    else:
        width, pattern = _STROKES[kind]
        dash = Markup(' stroke-dasharray="{}"').format(pattern) if pattern else ""
        mark = Markup('<path d="M0 4.5H22" stroke="{}" stroke-width="{}"{}/>').format(colour, width, dash)
    return Markup('<svg viewBox="0 0 22 9" aria-hidden="true">{}</svg>').format(mark)


def write_study_page(template: Path, path: Path, **content: Any) -> None:
    """Fill in a Jinja template, which may use `styles`, and write it."""
    page = environment().from_string(template.read_text(encoding="utf-8"))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(page.render(styles=Markup(styles()), **content), encoding="utf-8")
