"""Sections of a study's page on the tuning of its laws: placements, settings, searches, and Pareto fronts."""

from __future__ import annotations

from collections.abc import Iterator

from mrwork.base.numbers import format_fixed, shortest
from mrwork.base.table import Table
from mrwork.closed_loop.evaluation import criterion
from mrwork.plots import style
from mrwork.plots.canvas import column_axes, legend
from mrwork.plots.of_studies import fronts, short
from mrwork.report.section import Group, Section, panel
from mrwork.tuning.judging import TunedStudy
from mrwork.tuning.results import (
    Front,
    FrontPoint,
    TunedLaw,
    TuningResults,
    places_table,
    setting_in_words,
    settings_in_words,
)

# Letters of a label in a figure.
_LONGEST = 30


def tuning_sections(results: TunedStudy) -> Iterator[Section | None]:
    """How the settings of the laws were found, and what each is worth on the motions that it was tuned on."""
    yield _places_section(results.tuned)
    yield _settings_section(results)
    tuned = results.tuned
    yield from (
        _front_section(number, front, tuned.command_unit) for number, front in enumerate(tuned.fronts)
    )
    yield _search_section(results.tuned) if results.tuned.laws else None


def _objective_table(results: TunedStudy) -> Table:
    """Objective and score of each law and reference on the training and the test motions."""

    def cells(law: TunedLaw) -> Iterator[str]:
        for use in ("training", "test"):
            judged = results.judgement(law, use)
            objective, score = (None, None) if judged is None else (judged.objective, judged.score)
            yield format_fixed(objective if results.tuned.is_comparable(law) else None, 3)
            yield format_fixed(score, 3)

    return Table(
        label="Objective and score",
        columns=("", "Objective", "Score", "Objective", "Score"),
        rows=tuple((law.label, *cells(law)) for law in (*results.tuned.laws, *results.tuned.references)),
        over=(("", 1), ("Training motions", 2), ("Test motions", 2)),
        note="The objective is what the laws were tuned for; references that were chosen by another have none here. "
        "The score is the study's. A gap between training and test motions is the price of tuning on few motions.",
    )


def _places_section(results: TuningResults) -> Section | None:
    table = places_table(results)
    if table is None:
        return None
    return Section(
        title="Places",
        summary=f"The lowest score on the training motions: {results.places[0].in_words}.",
        groups=(Group(table=table),),
    )


def _settings_section(results: TunedStudy) -> Section | None:
    tuned = results.tuned
    if not tuned.laws:
        return None
    groups = [Group(table=_objective_table(results))]
    for law in tuned.laws:
        ranges = {free.name: f"{shortest(free.lower)} to {shortest(free.upper)}" for free in law.free}
        refused = f", of which {law.refused} of the first could not be simulated" if law.refused else ""
        prose = (
            f"Minimised: {law.objective.in_words(robust=law.robust)}.",
            f"Settings from: {law.origin}; {law.candidates} candidates in {law.seconds:.3g} s{refused}.",
            f"Certificate: {law.certificate or 'none'}.",
        )
        table = Table(
            label=f"Settings of {law.label}",
            columns=("Setting", "Value", "Searched"),
            rows=tuple(
                (name, setting_in_words(setting, shortest), ranges.get(name, "held"))
                for name, setting in law.settings.items()
            ),
        )
        groups.append(Group(title=law.label, prose=prose, table=table))
    return Section(title="How the settings were found", groups=tuple(groups))


def _front_section(number: int, front: Front, command_unit: str) -> Section:
    title, names = f"Pareto front of {front.label}", front.objectives
    uses = ("Training", "Test") if any(point.test is not None for point in front.points) else ("Training",)
    heads = [criterion(name).title for name in names] * len(uses)

    def numbers(point: FrontPoint) -> Iterator[str]:
        for values in (point.train, point.test or {})[: len(uses)]:
            yield from (format_fixed(values.get(name), 3) for name in names)

    table = Table(
        label=title,
        columns=("Point", *heads, "Settings", "Certificate"),
        rows=tuple(
            (
                str(index),
                *numbers(point),
                settings_in_words(point.settings, command_unit, shortest),
                point.certificate,
            )
            for index, point in enumerate(front.points, start=1)
        ),
        over=(("", 1), *((use, len(names)) for use in uses), ("", 2)),
        note="Points of which no other is lower in every objective on the training motions.",
    )
    figure, axes = column_axes()
    fronts(front, axes, legend=False)
    axes.legend(loc="upper right")
    drawn = panel(f"front-{number}", "Front", figure, title)
    return Section(
        title=title,
        summary=f"{len(front.points)} points of {front.candidates} candidates.",
        groups=(Group(panels=(drawn,)), Group(table=table)),
    )


def _search_section(results: TuningResults) -> Section:
    """The least penalised objective after each generation of every search."""
    laws = [law for law in results.laws if len(law.trace) > 1]
    course, axes = column_axes(top=0.9)
    for number, law in enumerate(laws):
        axes.step(
            [point.candidates for point in law.trace],
            [point.least for point in law.trace],
            where="post",
            color=style.hue(number),
            linewidth=1.4 if number < len(style.HUES) else 0.6,
            label=short(law.label, _LONGEST),
        )
    axes.set_xlabel("Candidates")
    axes.set_ylabel("Least objective on the training motions")
    axes.set_xlim(left=0.0)
    legend(axes, columns=2, others=max(len(laws) - len(style.HUES), 0))
    figure = panel(
        "searches",
        "Course of the searches",
        course,
        "Least objective of each law over the number of candidates",
        "First candidates, then generations of the search. One that exceeds a limit has a higher objective.",
    )
    return Section(
        title="Searches",
        summary=f"{results.effort_in_words}.",
        groups=(Group(panels=(figure,) if laws else ()),),
    )
