"""The page of a comparison of runs."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from matplotlib.figure import Figure

from mrwork.drawing import style
from mrwork.drawing.canvas import column_axes, finish, name_lines
from mrwork.drawing.of_fits import Law, laws_of, with_unit
from mrwork.identification.fit import Fit
from mrwork.report.html import Page, page_html
from mrwork.report.section import Group, Lead, Panel, Section, panel
from mrwork.runs.compare import RunsComparison


def compare_page(found: RunsComparison, runs: Sequence[Path]) -> Page:
    """The first table on the front, the laws of fits and the other tables in sections below; no files of data."""
    first, *others = found.tables
    lead = Lead(
        eyebrow="Comparison of runs",
        title=found.title,
        subject=", ".join(map(str, runs)),
        verdict=found.verdict,
        table=first,
        cautions=found.remarks,
    )
    laws = tuple(_law_panels(found.fits))
    sections = [
        *([Section(anchor="laws", title="Laws", groups=(Group(panels=laws),))] if laws else []),
        *(
            Section(
                anchor=f"table-{number}",
                title=table.title,
                groups=(Group(table=replace(table, title="", label=table.title)),),
            )
            for number, table in enumerate(others, start=1)
        ),
    ]
    return page_html(lead, sections)


def _law_panels(fits: Mapping[str, Fit]) -> Iterator[Panel]:
    """Of fits of one model, each parameter that follows the command in any of them."""
    if len({fit.model for fit in fits.values()}) != 1:
        return
    of_fits = {name: {law.parameter.name: law for law in laws_of(fit)} for name, fit in fits.items()}
    for parameter in dict.fromkeys(parameter for laws in of_fits.values() for parameter in laws):
        own = {name: laws[parameter] for name, laws in of_fits.items() if parameter in laws}
        constant = [name for name in fits if name not in own]
        drawn = panel(
            f"law-{parameter}",
            re.split("[:,]", next(iter(own.values())).parameter.description)[0].capitalize(),
            _law_figure(own, fits),
            f"{parameter} over the command in {', '.join(own)}",
            f"Constant in {', '.join(constant)}." if constant else "",
        )
        yield replace(drawn, data="")


@style.drawn_in_style()
def _law_figure(laws: Mapping[str, Law], fits: Mapping[str, Fit]) -> Figure:
    """The law of a parameter in several fits, each in the colour of its place among all."""
    figure, axes = column_axes()
    colours = dict(zip(fits, map(style.hue, range(len(fits))), strict=True))
    for name, law in laws.items():
        axes.plot(law.commands, law.values, color=colours[name], linewidth=1.4, label=name)
        parameter, current = law.parameter, fits[name].spec.current
    unit = "" if current is None else current.unit
    finish(axes, with_unit(style.symbol_text(parameter.name), parameter.unit), with_unit("Command", unit))
    name_lines(axes)
    return figure
