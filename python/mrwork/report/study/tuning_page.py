"""The page of a tuning: scores with their spread, settings with certificates, searches, Pareto fronts, every motion."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mrwork.base.numbers import NOTHING, counted, format_fixed, shortest, significant
from mrwork.base.table import Table
from mrwork.base.values import Floats
from mrwork.closed_loop.evaluation import SCORE, Spread, criteria, criterion
from mrwork.closed_loop.responses import axis_of, in_command_unit
from mrwork.errors import escape_text
from mrwork.plots import style
from mrwork.plots.canvas import column_axes, name_lines, name_rows, room_for
from mrwork.plots.study_drawing import add_front, short
from mrwork.report.html import Page, page_html
from mrwork.report.section import Group, Lead, Section, first_sentences, panel, warning_section
from mrwork.report.study.front import little_said
from mrwork.report.study.page import band_section, provenance_section
from mrwork.study.comparison import BOTH, beaten_in_words, lowers_all
from mrwork.study.tables import band_table
from mrwork.tuning.results import (
    Front,
    FrontPoint,
    LawResult,
    TuningResults,
    motions_in_words,
    places_table,
    settings_in_words,
    speed_in_words,
)

# Letters of a label in a figure and in the table of the front.
_LONGEST, _IN_TABLE = 30, 40


@style.drawn_in_style()
def score_figure(laws: Sequence[LawResult]) -> Figure:
    """Scores on training and test motions, the best above, with range and quartiles over the test motions."""
    names, places = [short(each.label, _LONGEST) for each in laws], range(len(laws))[::-1]
    figure, axes = column_axes(left=room_for(names), top=0.35, height=0.85 + 0.26 * len(laws))
    spreads = [each.judged.spread.get("score", Spread.of(())) for each in laws]
    least, lower, upper, most = np.array(
        [(each.least, each.lower_quartile, each.upper_quartile, each.most) for each in spreads]
    ).T
    axes.hlines(places, least, most, style.DATA, linewidth=2.0)
    axes.hlines(places, lower, upper, style.BAND_EDGE, linewidth=5.0, label="middle half of the motions")
    training = [each.train.score for each in laws]
    testing = [math.nan if each.test is None else each.test.score for each in laws]
    for scores, colour, filled, label in (
        (training, style.FAINT_INK, "white", "training"),
        (testing, style.MODEL, style.MODEL, "test"),
    ):
        if np.isfinite(scores).any():
            axes.plot(scores, places, "o", markersize=5, color=colour, markerfacecolor=filled, label=label)
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


_IN_UNITS = {"m": ("mm", 1e3), "N": ("kN", 1e-3), "J": ("J", 1.0)}


def tuning_page(results: TuningResults, *, command: str = "", summary: bool = False) -> Page:
    """The page of a tuning: HTML with embedded styles and figures; a `summary` is its front alone."""
    lead = _lead(results)
    if summary:
        return page_html(lead)
    bands = [
        (each.label, [bands.get(name) for name in ("score", *SCORE)])
        for each in results.ranked
        if (bands := each.judged.bands)
    ]
    note = "All laws have the same realisations."
    sections = [
        warning_section(results.warnings),
        _places_section(results),
        _score_section(results),
        _settings_section(results),
        band_section(band_table(bands, results.realisations, note=note), results.realisations),
        *(_front_section(number, front) for number, front in enumerate(results.fronts)),
        _demand_section(results),
        _motion_section(results),
        _search_section(results) if results.laws else None,
        provenance_section(results.facts, command),
    ]
    return page_html(lead, sections)


# Rows of the table, and sentences.
_ROWS, _CAUTIONS = 7, 2


def _lead(results: TuningResults) -> Lead:
    """The front: whether a tuned law beats the best constant command on motions that it was not tuned on."""
    unseen = len(results.testing)
    held_out = "Nothing was held out: the laws are judged on the motions that they were tuned on."
    cautions = [*([] if unseen else [held_out]), *results.warnings, *little_said(unseen, "test motion")]
    shown = results.ranked[:_ROWS]
    said = (
        "Score of each law on training and test motions, with the middle half and the range over the motions"
    )
    tuned = "Control laws tuned" if results.laws else "Places of dampers compared"
    laws = counted(len(results.laws), "law") if results.laws else counted(len(results.places), "placement")
    at = f"; dampers: {results.places[0].in_words}" if results.places else ""
    return Lead(
        eyebrow=f"{tuned} on training motions",
        title=results.title,
        subject=f"{laws} on {motions_in_words(results)}{at}",
        verdict=_verdict(results),
        banner="" if results.status == "finished" else "The tuning was interrupted; resume it with --resume.",
        panels=(panel("front-scores", "Scores with their spread over motions", score_figure(shown), said),)
        if shown
        else (),
        wide=True,
        table=_law_table(results, shown) if results.laws else places_table(results),
        cautions=first_sentences(cautions, _CAUTIONS),
        advice=(
            "`mrwork respond chosen.toml`, in this folder: the study with these settings, on every motion.",
            'Further `[[motion]]` tables with `use = "test"`: motions that the tuning has not seen.'
            if results.realisations
            else "`robust = true` in `[[tune]]`: settings for dampers and a building that are not known exactly.",
        ),
    )


def _verdict(results: TuningResults) -> str:
    """The law with the lowest score beside the best constant command, by both peaks under each motion."""
    laws = [each for each in results.ranked if each in results.laws]
    constant = next((each for each in results.references if each.better is None), None)
    if not laws:
        return _place_verdict(results) if results.places else "No law was tuned."
    if constant is None:
        return f"{laws[0].label} has the lowest score, {laws[0].judged.score:.3f}."
    changes = [_changes(each, constant) for each in laws]
    best = next((number for number, each in enumerate(changes) if lowers_all(each)), 0)
    both = laws[best].better
    several = both is not None and both.motions > 1
    unseen = counted(len(results.testing), "unseen motion")
    on = unseen if results.testing else "the training motions, all of them seen"
    over = f"{constant.label} {'on average over' if several else 'under'} {on}"
    under = f", both lower under {both.in_words}" if several and both is not None else ""
    return f"{beaten_in_words(laws[best].label, over, changes[best])}{under}."


def _place_verdict(results: TuningResults) -> str:
    """The best placement with its command and scores, beside that of the study."""
    said = []
    for each in (results.places[0], *(each for each in results.places[1:] if each.given)):
        test = "" if each.test is None else f", {_fixed(each.test)} on the test motions"
        command = f"at {each.command:.3g} {results.command_unit}"
        said.append(f"{each.in_words}, {command}; score {_fixed(each.train)} on the training motions{test}.")
    there = " The study has them there." if results.places[0].given else ""
    return f"The best place of the dampers: {' As the study has them, '.join(said)}{there}"


def _changes(law: LawResult, constant: LawResult) -> dict[str, Floats]:
    """Relative changes of both peaks against the constant command, under each motion."""
    pairs = list(zip(law.judged.motions, constant.judged.motions, strict=False))
    ratios = {name: [one.criteria[name] / other.criteria[name] for one, other in pairs] for name in BOTH}
    return {name: np.array(each or [math.nan]) - 1.0 for name, each in ratios.items()}


_fixed = partial(format_fixed, decimals=3)


def _cells(law: LawResult, names: Sequence[str], *between: str) -> tuple[str, ...]:
    """Scores on training and test motions, what stands `between`, mean ratios, and how often both peaks are lower."""
    test = None if law.test is None else law.test.score
    ratios = [law.judged.criteria.get(name) for name in names]
    better = NOTHING if law.better is None else law.better.in_words
    return (_fixed(law.train.score), _fixed(test), *between, *map(_fixed, ratios), better)


def _law_table(results: TuningResults, shown: Sequence[LawResult]) -> Table:
    more = len(results.ranked) - len(shown)
    settings = [_cut(settings_in_words(each.settings, results.command_unit)) for each in shown]
    return Table(
        label="Tuned laws and references",
        columns=("", "Training", "Test", *(criterion(name).short for name in BOTH), "Better", "Settings"),
        rows=tuple(
            (short(each.label, _IN_TABLE), *_cells(each, BOTH), own)
            for each, own in zip(shown, settings, strict=True)
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
    on = "test" if results.testing else "training"

    def spread(law: LawResult) -> tuple[str, str]:
        own = law.judged.spread.get("score")
        if own is None:
            return NOTHING, NOTHING
        return _fixed(own.median), f"{format_fixed(own.least, 2)} to {format_fixed(own.most, 2)}"

    ratios = [criterion(name).short for name in SCORE]
    table = Table(
        label="Scores",
        columns=("", "Training", "Test", "Median", "Range", *ratios, "Better"),
        rows=tuple((each.label, *_cells(each, SCORE, *spread(each))) for each in results.ranked),
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
    ranked = results.ranked
    summary = f"{ranked[0].label} has the lowest score on the {on} motions." if ranked else ""
    group = Group(table=table, prose=results.findings)
    return Section(anchor="scores", title="Scores", summary=summary, groups=(group,))


def _places_section(results: TuningResults) -> Section | None:
    table = places_table(results)
    if table is None:
        return None
    return Section(
        anchor="places",
        title="Places",
        summary=f"The lowest score on the training motions: {results.places[0].in_words}.",
        groups=(Group(table=table),),
    )


def _settings_section(results: TuningResults) -> Section | None:
    if not results.laws:
        return None
    groups = []
    for each in results.laws:
        ranges = {free.name: f"{shortest(free.lower)} to {shortest(free.upper)}" for free in each.free}
        refused = f", of which {each.refused} of the first could not be simulated" if each.refused else ""
        prose = (
            f"Minimised: {each.objective}.",
            f"Settings from: {each.origin}; {each.candidates} candidates in {each.seconds:.3g} s{refused}.",
            f"Certificate: {each.certificate or 'none'}.",
            *each.design.loop,
        )
        table = Table(
            label=f"Settings of {each.label}",
            columns=("Setting", "Value", "Searched"),
            rows=tuple(
                (name, _format_value(own), ranges.get(name, "held")) for name, own in each.settings.items()
            ),
            words=(2,),
        )
        groups.append(Group(title=each.label, prose=prose, table=table))
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
    title, names = f"Pareto front of {front.label}", front.objectives
    uses = ("Training", "Test") if any(each.test is not None for each in front.points) else ("Training",)
    heads = [criterion(name).title for name in names] * len(uses)

    def numbers(point: FrontPoint) -> Iterator[str]:
        for values in (point.train, point.test or {})[: len(uses)]:
            yield from (_fixed(values.get(name)) for name in names)

    table = Table(
        label=title,
        columns=("Point", *heads, "Settings", "Certificate"),
        rows=tuple(
            (str(place), *numbers(each), _in_line(each.settings), each.certificate)
            for place, each in enumerate(front.points, start=1)
        ),
        over=(("", 1), *((use, len(names)) for use in uses), ("", 2)),
        words=(1 + len(heads), 2 + len(heads)),
        note="Points of which no other is lower in every objective on the training motions.",
    )
    figure = panel(f"front-{number}", "Front", front_figure(front), title)
    return Section(
        anchor=f"front-{number}",
        title=title,
        summary=f"{len(front.points)} points of {front.candidates} candidates.",
        groups=(Group(panels=(figure,)), Group(table=table)),
    )


def _in_line(settings: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {_format_value(value)}" for name, value in settings.items())


def _demand_section(results: TuningResults) -> Section:
    shown = [
        (entry, *_IN_UNITS.get(entry.unit, (in_command_unit(entry.unit, results.command_unit), 1.0)))
        for entry in criteria()
        if axis_of(entry.quantity) == "device"
    ]
    table = Table(
        label="Demand on the dampers",
        columns=("", *(f"{entry.short} ({unit})" for entry, unit, _ in shown)),
        rows=tuple(
            (
                each.label,
                *(
                    significant(factor * each.judged.largest.get(entry.name, math.nan), 3)
                    for entry, _, factor in shown
                ),
            )
            for each in results.ranked
        ),
        note=f"The largest over the {'test' if results.testing else 'training'} motions; a force is that of all "
        "dampers of a group.",
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
                (under[0].motion, *(_fixed(each.score) for each in under))
                for under in zip(*(motions for _, motions in laws), strict=True)
            ),
        )
        groups.append(Group(title=f"{use} motions", table=table))
    return Section(anchor="motions", title="Every motion", groups=tuple(groups)) if groups else None


def _search_section(results: TuningResults) -> Section:
    laws = [each for each in results.laws if len(each.trace) > 1]
    count = format_fixed(sum(each.candidates for each in results.laws), 0)
    figure = panel(
        "searches",
        "Course of the searches",
        course_figure(laws),
        "Least objective of each law over the number of candidates",
        "First candidates, then generations of the search. One that exceeds a limit has a higher objective.",
    )
    return Section(
        anchor="searches",
        title="Searches",
        summary=f"{count} candidates; {speed_in_words(results)}.",
        groups=(Group(panels=(figure,) if laws else ()),),
    )
