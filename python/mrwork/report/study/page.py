"""The page of a study: changes of every quantity, tables of criteria, storey profiles, histories, loops, energies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.ticker import MaxNLocator

from mrwork.base.numbers import NOTHING, format_fixed, percent, shortest, significant
from mrwork.base.table import Table
from mrwork.closed_loop.evaluation import criterion, ratio
from mrwork.dampers.tested_range import OperatingRange, covering
from mrwork.plots import style
from mrwork.plots.canvas import column_axes, legend, room_for
from mrwork.plots.of_studies import energies, fronts, short, strokes
from mrwork.report.html import Page, page_html
from mrwork.report.section import Group, Section, panel, warning_section
from mrwork.report.study.figures import (
    ReadHistory,
    device_section,
    fragilities_of_page,
    fragility_section,
    history_section,
    motion_section,
    profile_figure,
    spread_section,
)
from mrwork.report.study.front import drawn_rows, messages_of_page, study_lead
from mrwork.study.comparison import Comparison, change_table, compared, results_in_words
from mrwork.study.results import StudyResults, largest_step_changes
from mrwork.study.storeys import OVERTURNING, SHEAR, limits_in_words, storey_table
from mrwork.study.tables import ShownRows, bands_of_study, shown_rows, step_table, value_table
from mrwork.tuning.judging import TunedStudy
from mrwork.tuning.tuned_laws import (
    Front,
    FrontPoint,
    TunedLaw,
    TuningResults,
    places_table,
    setting_in_words,
    settings_in_words,
)


def energy_section(results: StudyResults, shown: ShownRows) -> Section | None:
    """Distribution of the input energy, and the error of its balance."""
    motion, count, total = results.motions[results.page.detailed], len(shown.drawn), len(results.rows)
    if not results.finished_rows(results.page.detailed):
        return None
    arrangements = "every arrangement" if count == total else f"{count} of {total} arrangements"
    rows = [row for row in results.finished_rows(results.page.detailed) if row in shown.drawn]
    names = [short(results.rows[row].label, 29) for row in rows]
    bars, axes = column_axes(left=room_for(names), top=0.42, height=0.95 + 0.30 * len(rows))
    energies(results, axes, motion=results.page.detailed, rows=rows)
    axes.set_yticks(range(len(names)), names[::-1])
    axes.xaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10]))
    figure = panel(
        "energy",
        "Energy at the end of the motion",
        bars,
        f"Energy dissipated by dampers and structure under {motion.name}, for {arrangements}",
    )
    worst = float(np.nanmax(results.quantities.energy_error[..., 0]))
    return Section(
        title="Energy",
        summary=f"the largest error of the energy balance is {significant(worst, 2)} of the largest energy.",
        groups=(
            Group(title=motion.name, synthetic=motion.synthetic, panels=(figure,)),
            Group(title="Balance", table=_balance_table(results, shown.listed)),
        ),
    )


def _balance_table(results: StudyResults, listed: Sequence[int]) -> Table:
    quantities = results.quantities.numbers
    finished = results.quantities.finished[:, :, 0]

    def cells(row: int) -> tuple[str, ...]:
        taken, input_energy, errors, steps = (
            quantities[name][row, finished[row], 0]
            for name in ("device_energy", "input_energy", "energy_error", "steps")
        )
        return (
            results.rows[row].label,
            percent(float(np.mean(ratio(np.nansum(taken, axis=1), input_energy)))),
            significant(float(errors.max()), 2),
            format_fixed(float(steps.max()), 0),
        )

    return Table(
        label="Balance of energy",
        columns=("", "Dissipated by dampers (%)", "Largest error of balance", "Most steps per sample"),
        rows=tuple(cells(row) for row in listed if finished[row].any()),
        note="Input = kinetic + strain + structure + dampers, integrated with the same stages as the motion. "
        "The error is the imbalance over the largest energy, the largest of all motions.",
    )


_DEMAND = ("stroke", "velocity", "frequency", "command", "force", "mean power")


def demand_section(results: StudyResults) -> Section | None:
    """The largest demand of all runs on one damper at each place, and the ranges it was tested in."""
    demands = [demand for of_run in results.demanded.values() for demand in of_run]
    if not demands:
        return None
    ranges: list[tuple[str, OperatingRange | None]] = []
    for damper in results.dampers:
        of_damper = [demand.demand for demand in demands if demand.device == damper.name]
        ranges += [(damper.name, covering(of_damper)), ("tested", damper.tested)]
    outside = sorted({name for demand in demands for name in demand.outside.names})
    known = any(demand.outside.known for demand in demands)
    summary = f"outside the tested range in {', '.join(outside)}." if outside else "within the tested range."
    table = Table(
        label="Largest demand on one damper, and the range it was tested in",
        columns=("", *map(str.capitalize, _DEMAND)),
        rows=tuple(
            (label, *(dict(spans.rows() if spans else ()).get(name, NOTHING) for name in _DEMAND))
            for label, spans in ranges
        ),
        note="Of all runs, on one damper of a group. Stroke, velocity and force are peaks, the power is the mean over "
        "the motion. "
        "The frequency is that of a sinusoid with the peak velocity and the peak stroke of a run.",
    )
    return Section(
        title="Demand on the dampers",
        summary=summary if known or outside else "the tested ranges of these dampers are not known.",
        groups=(Group(table=table),),
    )


def step_section(results: StudyResults, shown: ShownRows) -> Section | None:
    """The largest change of each row; `None` if the step was not checked."""
    changes = largest_step_changes(results)
    if not changes:
        return None
    worst = max(
        (change for change in changes if change.criterion), key=lambda change: change.change, default=None
    )
    return Section(
        title="Half the step",
        summary="no runs can be compared."
        if worst is None
        else f"half the step changes no criterion by more than {significant(worst.change, 2)} of its value, for "
        f"{results.rows[worst.row].label}.",
        groups=(Group(table=step_table(results, shown.listed)),),
    )


def _band_section(results: StudyResults, shown: ShownRows) -> Section | None:
    count, table = results.n_realisations, bands_of_study(results, shown.listed)
    if not (count and table.rows):
        return None
    words = f"{count} realisations of what is not known exactly."
    return Section(title="Under uncertainty", summary=words, groups=(Group(table=table),))


def storey_section(results: StudyResults, first: Sequence[int], drawn: Sequence[int]) -> Section | None:
    """Peaks of storeys of the `first` rows, and profiles of shear and overturning of the `drawn` ones."""
    table = storey_table(results, first)
    if table is None:
        return None
    panels, title = [], "Parts" if results.building.parts else "Storeys"
    uses = results.motions.in_words
    for quantity in (SHEAR, OVERTURNING):
        rows = [row for row in drawn if quantity.of_runs(results, row) is not None]
        if rows:
            panels.append(
                panel(
                    quantity.name.replace("_", "-"),
                    f"{quantity.title} of {title.lower()}",
                    profile_figure(results, quantity.name, rows),
                    f"{quantity.title} of {title.lower()}, {len(rows)} arrangements, mean over {uses}",
                )
            )
    return Section(
        title=title,
        summary=f"peaks of each, mean over {uses}.",
        groups=(
            Group(points=tuple(limits_in_words(results)), table=table),
            *((Group(panels=tuple(panels), layout="small"),) if panels else ()),
        ),
    )


# Letters of a label in a figure.
_LONGEST_LABEL = 30


def tuning_sections(results: TunedStudy) -> Iterator[Section]:
    """How the settings of the laws were found, and what each is worth on the motions that it was tuned on."""
    tuned = results.tuned
    if tuned.places:
        summary = f"The lowest score on the training motions: {tuned.places[0].in_words}."
        yield Section(title="Places", summary=summary, groups=(Group(table=places_table(tuned)),))
    if tuned.laws:
        yield _settings_section(results)
    for number, front in enumerate(tuned.fronts):
        yield _front_section(number, front, tuned.command_unit)
    if tuned.laws:
        yield _search_section(tuned)


def _objective_table(results: TunedStudy) -> Table:

    def cells(law: TunedLaw) -> Iterator[str]:
        for use in ("training", "test"):
            judged = results.judgement(law, use)
            objective, score = (None, None) if judged is None else (judged.objective, judged.score.mean)
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


def _settings_section(results: TunedStudy) -> Section:
    groups = [Group(table=_objective_table(results))]
    for law in results.tuned.laws:
        ranges = {
            setting.name: f"{shortest(setting.lower)} to {shortest(setting.upper)}" for setting in law.free
        }
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
                (name, setting_in_words(value, shortest), ranges.get(name, "held"))
                for name, value in law.settings.items()
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
    laws = [law for law in results.laws if len(law.trace) > 1]
    course, axes = column_axes(top=0.9)
    for number, law in enumerate(laws):
        axes.step(
            [point.candidates for point in law.trace],
            [point.least for point in law.trace],
            where="post",
            color=style.hue(number),
            linewidth=1.4 if number < len(style.HUES) else 0.6,
            label=short(law.label, _LONGEST_LABEL),
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


@style.drawn_in_style()
def study_page(
    results: StudyResults,
    histories: ReadHistory,
    *,
    command: str = "",
    seconds: float | None = None,
    summary: bool = False,
) -> Page:
    """The page of a study, HTML with embedded styles and figures.

    `command` is the command line that has made it in so many `seconds`; a `summary` is the front alone.
    """
    comparison = compared(results)
    fragilities = fragilities_of_page(results)
    lead = study_lead(comparison, fragilities)
    if summary:
        return page_html(lead)
    shown = shown_rows(comparison, results.page.with_histories)
    facts = [*results.page.facts]
    facts += [] if seconds is None else [("Runs", f"{results.done} of {results.total} in {seconds:.3g} s")]
    facts += [("Command", f"`{command}`")] if command else []
    of_row = strokes(results, drawn_rows(comparison))
    first = [row for row in (comparison.leading, comparison.passive) if row is not None]
    bare = [row for row in (comparison.uncontrolled,) if row not in first]
    several = len(results.judged_motions) > 1
    median = f", median of {results.motions.in_words}" if several else ""
    sections = [
        warning_section(messages_of_page(results, fragilities)),
        _change_section(comparison, shown),
        spread_section(comparison, shown, of_row),
        *(tuning_sections(results) if isinstance(results, TunedStudy) else ()),
        None if fragilities is None else fragility_section(results, fragilities),
        Section(
            title="Criteria",
            summary=f"in their units{median}; `criteria.csv` has every motion.",
            groups=(Group(table=value_table(results, results.judged_motions, shown.listed)),),
        ),
        history_section(results, histories, shown.with_histories, of_row),
        storey_section(results, [*first, *bare], drawn_rows(comparison)),
        device_section(results, histories, first, of_row),
        energy_section(results, shown),
        _band_section(results, shown),
        demand_section(results),
        step_section(results, shown),
        motion_section(results),
        Section(title="Provenance", groups=(Group(facts=tuple(facts)),)),
    ]
    return page_html(lead, sections)


def _change_section(comparison: Comparison, shown: ShownRows) -> Section | None:
    if comparison.leading is None:
        return None
    results = comparison.results
    groups = [
        Group(
            title=f"Against {results.rows[reference].label}",
            table=change_table(comparison, reference, shown.listed),
        )
        for reference in reversed(comparison.references)
    ]
    return Section(
        title="Changes of every quantity",
        summary=f"{comparison.heading}.",
        groups=(
            *groups,
            Group(points=results_in_words(results), prose=(shown.in_words,) if shown.in_words else ()),
        ),
    )
