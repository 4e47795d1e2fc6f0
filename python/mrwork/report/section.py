"""Sections of a page with text, tables and figures, their kinds, and the progress of drawing them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from markupsafe import Markup
from matplotlib.figure import Figure

from mrwork.base.arguments import checked
from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import Table
from mrwork.plots.canvas import inline_svg
from mrwork.plots.drawn import drawn_csv

# At this scale the letters of a figure are as large as the small ones of the page.
_PIXELS_PER_INCH = 78


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Panel(Summarised):
    """One figure of the page with the lines above and below it, and its natural width [px].

    `data` is what it draws as CSV, for the file of this `name` beside the page.
    """

    title: str
    svg: Markup
    note: str = ""
    width: int = 0
    name: str = ""
    data: str = ""
    figure: Figure | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Part of a section: paragraphs, a table, points, figures and facts; `synthetic` where its data were not measured.

    The `summary` of a result stands below the paragraphs, and so does `markup`, a `Markup` of its own such as an
    equation. A fact is a name and a text. The `layout` of figures is two in a row, four small ones in a row, or one at
    its natural width, scrolled sideways.
    """

    title: str = ""
    summary: Summary | None = None
    prose: tuple[str, ...] = ()
    markup: str = ""
    points: tuple[str, ...] = ()
    table: Table | None = None
    facts: tuple[tuple[str, str], ...] = ()
    panels: tuple[Panel, ...] = ()
    layout: Literal["columns", "small", "whole"] = "columns"
    synthetic: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A section of the page, folded below its `title` and its `summary`, which is its result in a sentence."""

    title: str
    groups: tuple[Group, ...]
    summary: str = ""

    @property
    def anchor(self) -> str:
        """The title as the name of a place in the page."""
        return re.sub(r"\W+", "-", self.title.lower()).strip("-")


@dataclass(frozen=True, slots=True, kw_only=True)
class Number:
    """A number of the front with a line below it; a `worse` one is in the colour of warnings."""

    title: str
    value: str
    unit: str = ""
    note: str = ""
    worse: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Lead:
    """The front of a page, one screen: may the result be used, where not, and what next.

    `verdict` is the answer in a sentence, `numbers` what it rests on, at most four; `cautions` say where the result
    does not hold, `advice` what to do next. Of `panels` at most eight small ones fit, in rows of four. A `banner` is
    above all: the result is not from a finished run.
    """

    eyebrow: str
    title: str
    subject: str
    verdict: str
    synthetic: bool = False
    banner: str = ""
    numbers: tuple[Number, ...] = ()
    panels: tuple[Panel, ...] = ()
    table: Table | None = None
    cautions: tuple[str, ...] = ()
    advice: tuple[str, ...] = ()


# Characters beyond which a caution of the front ends at its first colon or semicolon.
_LONG = 150


def first_sentences(warnings: Sequence[str], most: int) -> tuple[str, ...]:
    """Warnings as short sentences for the front of a page, which has a section with all of them in full."""
    sentences = []
    for warning in warnings[:most]:
        # What stands before a colon is a name; what follows a semicolon is the cure.
        shown = warning.split("; ")[0] if len(warning) > _LONG else warning
        sentences.append(f"{shown[:1].upper()}{shown[1:].removesuffix('.')}.")
    more = len(warnings) - most
    return (*sentences, *([f"{more} more in the section on warnings."] if more > 0 else []))


def warning_section(warnings: Sequence[str]) -> Section | None:
    """All warnings in full, `None` without any."""
    if not warnings:
        return None
    return Section(
        title="Warnings",
        summary=f"{len(warnings)} before you use this.",
        groups=(Group(points=tuple(warnings)),),
    )


def panel(identifier: str, title: str, figure: Figure, description: str, note: str = "") -> Panel:
    """A figure as a panel; `identifier` is unique on the page, `description` is for screen readers."""
    return Panel(
        title=title,
        svg=Markup(inline_svg(figure, identifier=identifier, description=description)),
        note=note,
        width=round(_PIXELS_PER_INCH * figure.get_figwidth()),
        name=identifier,
        data=drawn_csv(figure),
        figure=figure,
    )
