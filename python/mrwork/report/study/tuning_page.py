"""The page of a tuning: scores with their spread, settings with certificates, searches, Pareto fronts, every motion."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mrwork.base.numbers import NOTHING, format_fixed, shortest, significant
from mrwork.base.table import Table
from mrwork.base.values import Floats
from mrwork.closed_loop.evaluation import SCORE, criteria, criterion
from mrwork.closed_loop.responses import in_command_unit
from mrwork.drawing import style
from mrwork.drawing.canvas import column_axes, name_lines, name_rows, room_for
from mrwork.drawing.of_studies import add_front, short
from mrwork.errors import escape_text
from mrwork.report.html import Page, page_html
from mrwork.report.section import Group, Lead, Panel, Section, first_sentences, panel, warning_section
from mrwork.report.study.page import band_section, provenance_section
from mrwork.study.comparison import BOTH, lowers_all, peaks_in_words
from mrwork.study.tables import band_table
from mrwork.tuning.results import (
    Front,
    LawResult,
    TuningResults,
    motions_in_words,
    settings_in_words,
    speed_in_words,
)

_LINE = 0.26
_BELOW, _ABOVE = 0.5, 0.35
_LONGEST, _IN_TABLE = 30, 40


@style.drawn_in_style()
def score_figure(laws: Sequence[LawResult]) -> Figure:
    """Scores on training and test motions, the best above, with range and quartiles over the test motions."""
    names = [short(each.label, _LONGEST) for each in laws]
    figure, axes = column_axes(left=room_for(names), top=_ABOVE, height=_BELOW + _ABOVE + _LINE * len(laws))
    for place, each in enumerate(reversed(laws)):
        spread = each.judged.spread.get("score")
        if spread is not None:
            axes.plot([spread.least, spread.most], [place, place], color=style.DATA, linewidth=2.0)
            quartiles = spread.lower_quartile, spread.upper_quartile
            axes.plot(quartiles, [place, place], color=style.BAND_EDGE, linewidth=5.0)
        axes.plot(each.train.score, place, "o", markersize=5, markerfacecolor="white", color=style.FAINT_INK)
        if each.test is not None:
            axes.plot(each.test.score, place, "o", markersize=5, color=style.MODEL)
    axes.plot([], [], "o", markersize=5, markerfacecolor="white", color=style.FAINT_INK, label="training")
    if laws[0].test is not None:
        axes.plot([], [], "o", markersize=5, color=style.MODEL, label="test")
    axes.plot([], [], color=style.BAND_EDGE, linewidth=5.0, label="middle half of the motions")
    name_rows(axes, [escape_text(name) for name in reversed(names)], "Score over i = 0")
    axes.xaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10]))
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderpad=0.2, columnspacing=0.9)
    return figure


@style.drawn_in_style()
def course_figure(laws: Sequence[LawResult]) -> Figure:
    """The least penalised objective after each generation of every search."""
    figure, axes = column_axes(top=0.2 if len(laws) <= len(style.HUES) else 0.9)
    for number, each in enumerate(laws):
        axes.step(
            [point.candidates for point in each.trace],
            [point.least for point in each.trace],
            where="post",
            color=style.hue(number),
            linewidth=1.4 if number < len(style.HUES) else 0.6,
            label=short(each.label, _LONGEST),
        )
    axes.set_xlabel("Candidates")
    axes.set_ylabel("Least objective on the training motions")
    axes.set_xlim(left=0.0)
    name_lines(axes)
    return figure


@style.drawn_in_style()
def front_figure(front: Front) -> Figure:
    """The first two objectives of a Pareto front, on the training and on the test motions."""
    figure, axes = column_axes()
    add_front(axes, front)
    axes.legend(loc="upper right")
    return figure


_DECIMALS = 3
_IN_UNITS = {"m": ("mm", 1e3), "N": ("kN", 1e-3), "J": ("J", 1.0)}


def tuning_page(results: TuningResults, *, command: str = "", summary: bool = False) -> Page:
    """The page of a tuning: HTML with embedded styles and figures; a `summary` is its front alone."""
    lead = _lead(results)
    if summary:
        return page_html(lead)
    sections = [
        warning_section(results.warnings),
        _score_section(results),
        _settings_section(results),
        band_section(
            band_table(
                [
                    (each.label, [bands.get("score"), *(bands.get(name) for name in SCORE)])
                    for each in results.ranked
                    if (bands := each.judged.bands)
                ],
                results.realisations,
                note="All laws have the same realisations.",
            ),
            results.realisations,
        ),
        *(_front_section(number, front) for number, front in enumerate(results.fronts)),
        _demand_section(results),
        _motion_section(results),
        _search_section(results),
        provenance_section(results.facts, command),
    ]
    return page_html(lead, sections)


# Rows of the table, and sentences.
_ROWS, _CAUTIONS = 7, 2


def _lead(results: TuningResults) -> Lead:
    """The front: whether a tuned law beats the best constant command on motions that it was not tuned on."""
    laws = f"{len(results.laws)} law{'' if len(results.laws) == 1 else 's'}"
    few = len(results.testing)
    cautions = list(results.warnings)
    if not few:
        cautions.insert(
            0, "Nothing was held out: the laws are judged on the motions that they were tuned on."
        )
    elif few < _FEW:
        cautions.append(
            f"{'One test motion says' if few == 1 else f'{few} test motions say'} little about the next."
        )
    ranked = results.ranked
    shown = ranked[:_ROWS]
    panels: tuple[Panel, ...] = ()
    if ranked:
        figure = score_figure(shown)
        said = "Score of each law on training and test motions, with the middle half and the range over the motions"
        panels = (panel("front-scores", "Scores with their spread over motions", figure, said),)
    return Lead(
        eyebrow="Control laws tuned on training motions",
        title=results.title,
        subject=f"{laws} on {motions_in_words(results)}",
        verdict=_verdict(results),
        banner="" if results.status == "finished" else "The tuning was interrupted; resume it with --resume.",
        panels=panels,
        wide=True,
        table=_law_table(results, shown) if ranked else None,
        cautions=first_sentences(cautions, _CAUTIONS),
        advice=(
            "`mrwork respond chosen.toml`, in this folder: the study with these settings, on every motion.",
            "`robust = true` in `[[tune]]`: settings for dampers and a building that are not known exactly."
            if not results.realisations
            else 'Further `[[motion]]` tables with `use = "test"`: motions that the tuning has not seen.',
        ),
    )


_FEW = 3


def _verdict(results: TuningResults) -> str:
    """The law with the lowest score beside the best constant command, by both peaks under each motion."""
    laws = [each for each in results.ranked if each in results.laws]
    constant = next((each for each in results.references if each.better is None), None)
    if not laws or constant is None:
        return (
            "No law was tuned."
            if not laws
            else f"{laws[0].label} has the lowest score, {laws[0].judged.score:.3f}."
        )
    count = len(results.testing)
    on = (
        f"{count} unseen motion{'' if count == 1 else 's'}"
        if count
        else "the training motions, all of them seen,"
    )
    winners = [each for each in laws if lowers_all(_changes(each, constant))]
    law = (winners or laws)[0]
    both = law.better
    under = (
        f", both lower under {both.both} of {both.motions}" if both is not None and both.motions > 1 else ""
    )
    changes = peaks_in_words(_changes(law, constant))
    if winners:
        return f"On {on} {law.label} lowers both peaks against {constant.label}: {changes}{under}."
    return (
        f"On {on} no law lowers both peaks on average against {constant.label}. {law.label}, the law with the lowest "
        f"score: {changes}{under}."
    )


def _changes(law: LawResult, constant: LawResult) -> dict[str, Floats]:
    """Relative changes of both peaks against the constant command, under each motion."""
    pairs = list(zip(law.judged.motions, constant.judged.motions, strict=False))
    return {
        name: np.array([one.criteria[name] / other.criteria[name] for one, other in pairs] or [math.nan])
        - 1.0
        for name in BOTH
    }


def _law_table(results: TuningResults, shown: Sequence[LawResult]) -> Table:
    more = len(results.ranked) - len(shown)
    return Table(
        label="Tuned laws and references",
        columns=("", "Training", "Test", *(criterion(name).short for name in BOTH), "Better", "Settings"),
        rows=tuple(
            (
                short(each.label, _IN_TABLE),
                format_fixed(each.train.score, _DECIMALS),
                format_fixed(None if each.test is None else each.test.score, _DECIMALS),
                *(format_fixed(each.judged.criteria.get(name, math.nan), _DECIMALS) for name in BOTH),
                NOTHING if each.better is None else each.better.in_words,
                _cut(settings_in_words(each.settings, results.command_unit)),
            )
            for each in shown
        ),
        over=(("", 1), ("Score over i = 0", 2), ("Mean ratio over i = 0", 2), ("", 2)),
        words=(6,),
        note="Better: motions with both peaks below those of the best constant command."
        + (f" {more} more below." if more else ""),
    )


_SETTINGS = 60


def _cut(settings: str) -> str:
    """The first of some settings in a line; none is cut within."""
    if len(settings) <= _SETTINGS:
        return settings
    # A comma outside all brackets ends a setting.
    ends = [
        place
        for place, letter in enumerate(settings[:_SETTINGS])
        if letter == ","
        and not sum(map(settings[:place].count, "([")) - sum(map(settings[:place].count, ")]"))
    ]
    return f"{settings[: ends[-1]]}, …" if ends else f"{settings.partition(' ')[0]} …"


def _score_section(results: TuningResults) -> Section:
    ranked = results.ranked
    rows = []
    for each in ranked:
        judgement = each.judged
        spread = judgement.spread.get("score")
        rows.append(
            (
                each.label,
                format_fixed(each.train.score, _DECIMALS),
                format_fixed(None if each.test is None else each.test.score, _DECIMALS),
                NOTHING if spread is None else format_fixed(spread.median, _DECIMALS),
                NOTHING
                if spread is None
                else f"{format_fixed(spread.least, 2)} to {format_fixed(spread.most, 2)}",
                *(format_fixed(judgement.criteria.get(name, math.nan), _DECIMALS) for name in SCORE),
                NOTHING if each.better is None else each.better.in_words,
            )
        )
    on = "test" if results.testing else "training"
    table = Table(
        label="Scores",
        columns=(
            "",
            "Training",
            "Test",
            "Median",
            "Range",
            *(criterion(name).short for name in SCORE),
            "Better",
        ),
        rows=tuple(rows),
        over=(
            ("", 1),
            ("Score", 2),
            (f"Score of one {on} motion", 2),
            (f"Mean ratio, {on} motions", 4),
            ("", 1),
        ),
        note="The score is the mean of peak and RMS drift and acceleration over those at i = 0, whatever is minimised, "
        "then over the motions; the lowest is above. "
        "Better: under how many motions both peak drift and peak acceleration are below those of the best constant "
        "command, which is chosen on the training motions.",
    )
    return Section(
        anchor="scores",
        title="Scores",
        summary=f"{ranked[0].label} has the lowest score on the {on} motions." if ranked else "",
        groups=(Group(table=table, prose=results.findings),),
    )


def _settings_section(results: TuningResults) -> Section | None:
    if not results.laws:
        return None
    groups = []
    for each in results.laws:
        ranges = {free.name: f"{shortest(free.lower)} to {shortest(free.upper)}" for free in each.free}
        rows = tuple(
            (name, _format_value(value), ranges.get(name, "held")) for name, value in each.settings.items()
        )
        groups.append(
            Group(
                title=each.label,
                prose=(
                    f"Minimised: {each.objective}.",
                    f"Settings from: {each.origin}; {each.candidates} candidates in {each.seconds:.3g} s"
                    + (
                        f", of which {each.refused} of the first could not be simulated."
                        if each.refused
                        else "."
                    ),
                    f"Certificate: {each.certificate}." if each.certificate else "Certificate: none.",
                    *each.design.loop,
                ),
                table=Table(
                    label=f"Settings of {each.label}",
                    columns=("Setting", "Value", "Searched"),
                    rows=rows,
                    words=(2,),
                ),
            )
        )
    groups += [
        Group(title=f"Weights of {', '.join(labels)}", prose=sentences)
        for labels, sentences in results.designs
    ]
    return Section(anchor="settings", title="Settings", groups=tuple(groups))


def _format_value(value: Any) -> str:
    if isinstance(value, int | float):
        return significant(float(value), 4)
    if isinstance(value, str):
        return value
    if isinstance(value, Mapping):
        return f"({_in_line(value)})"
    return f"{len(value)} numbers"


def _front_section(number: int, front: Front) -> Section:
    heads = [criterion(name).title for name in front.objectives]
    tested = any(each.test is not None for each in front.points)
    rows = tuple(
        (
            str(place),
            *(format_fixed(each.train[name], _DECIMALS) for name in front.objectives),
            *(format_fixed((each.test or {}).get(name), _DECIMALS) for name in front.objectives if tested),
            _in_line(each.settings),
            each.certificate,
        )
        for place, each in enumerate(front.points, start=1)
    )
    table = Table(
        label=f"Pareto front of {front.label}",
        columns=("Point", *heads, *(heads if tested else ()), "Settings", "Certificate"),
        rows=rows,
        over=(
            ("", 1),
            ("Training", len(heads)),
            *((("Test", len(heads)),) if tested else ()),
            ("", 2),
        ),
        words=(1 + len(heads) * (2 if tested else 1), 2 + len(heads) * (2 if tested else 1)),
        note="Points of which no other is lower in every objective on the training motions.",
    )
    figure = panel(f"front-{number}", "Front", front_figure(front), f"Pareto front of {front.label}")
    return Section(
        anchor=f"front-{number}",
        title=f"Pareto front of {front.label}",
        summary=f"{len(front.points)} points of {front.candidates} candidates.",
        groups=(Group(panels=(figure,)), Group(table=table)),
    )


def _in_line(settings: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {_format_value(value)}" for name, value in settings.items())


def _demand_section(results: TuningResults) -> Section | None:
    entries = [entry for entry in criteria() if not entry.ratio]
    units = [
        _IN_UNITS.get(entry.unit, (in_command_unit(entry.unit, results.command_unit), 1.0))
        for entry in entries
    ]

    def cells(largest: Mapping[str, float]) -> list[str]:
        return [
            significant(factor * largest[entry.name], 3) if entry.name in largest else NOTHING
            for entry, (_, factor) in zip(entries, units, strict=True)
        ]

    on = "test" if results.testing else "training"
    table = Table(
        label="Demand on the dampers",
        columns=("", *(f"{entry.short} ({unit})" for entry, (unit, _) in zip(entries, units, strict=True))),
        rows=tuple((each.label, *cells(each.judged.largest)) for each in results.ranked),
        note=f"The largest over the {on} motions; a force is that of all dampers of a group.",
    )
    return Section(anchor="demand", title="Demand on the dampers", groups=(Group(table=table),))


def _motion_section(results: TuningResults) -> Section | None:
    groups = []
    for use in ("Test", "Training"):
        judgements = [(law.label, law.test if use == "Test" else law.train) for law in results.ranked]
        laws = [(label, each.motions) for label, each in judgements if each is not None and each.motions]
        if not laws:
            continue
        table = Table(
            label=f"Scores under each {use.lower()} motion",
            columns=("Motion", *(label for label, _ in laws)),
            rows=tuple(
                (motion.motion, *(format_fixed(motions[place].score, _DECIMALS) for _, motions in laws))
                for place, motion in enumerate(laws[0][1])
            ),
        )
        groups.append(Group(title=f"{use} motions", table=table))
    return Section(anchor="motions", title="Every motion", groups=tuple(groups)) if groups else None


def _search_section(results: TuningResults) -> Section:
    laws = [each for each in results.laws if len(each.trace) > 1]
    count = sum(each.candidates for each in results.laws)
    panels = (
        panel(
            "searches",
            "Course of the searches",
            course_figure(laws),
            "Least objective of each law over the number of candidates",
            "First candidates, then generations of the search. One that exceeds a limit has a higher objective.",
        ),
    )
    return Section(
        anchor="searches",
        title="Searches",
        summary=f"{format_fixed(count, 0)} candidates; {speed_in_words(results)}.",
        groups=(Group(panels=panels if laws else ()),),
    )
