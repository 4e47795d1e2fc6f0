"""The page of a study: changes of every quantity, tables of criteria, storey profiles, histories, loops, energies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mrwork.base.numbers import NOTHING, format_fixed, significant
from mrwork.base.table import Table
from mrwork.closed_loop.evaluation import ratio
from mrwork.dampers.tested_range import OperatingRange, covering
from mrwork.drawing.of_studies import strokes
from mrwork.report.html import Page, page_html
from mrwork.report.section import Group, Section, panel, warning_section
from mrwork.report.study.figures import (
    ReadHistory,
    device_section,
    energy_figure,
    history_section,
    motion_section,
    spread_section,
)
from mrwork.report.study.front import drawn_rows, study_lead
from mrwork.study.comparison import ADD_BEST_PASSIVE, StudyComparison, compared, findings, judged_in_words
from mrwork.study.results import (
    OFF_BALANCE,
    StudyResults,
    largest_step_changes,
)
from mrwork.study.tables import ShownRows, bands_of_study, change_table, shown_rows, step_table, value_table


def energy_section(results: StudyResults, motion: int, shown: ShownRows) -> Section | None:
    """Distribution of the input energy, and the error of its balance."""
    if not results.finished_rows(motion):
        return None
    name = results.motions[motion].name
    worst = max(run.energy_error for run in results.runs.values() if run.finished)
    return Section(
        anchor="energy",
        title="Energy",
        summary=f"the largest error of the energy balance is {significant(worst, 2)} of the largest energy.",
        groups=(
            Group(
                title=name,
                synthetic=results.motions[motion].synthetic,
                panels=(
                    panel(
                        "energy",
                        "Energy at the end of the motion",
                        energy_figure(results, motion, shown.drawn),
                        f"Energy dissipated by dampers and structure under {name}, for "
                        f"{_drawn_in_words(results, shown)}",
                    ),
                ),
            ),
            Group(title="Balance", table=_balance_table(results, shown.listed)),
        ),
    )


def _drawn_in_words(results: StudyResults, shown: ShownRows) -> str:
    count, total = len(shown.drawn), len(results.rows)
    return "every arrangement" if count == total else f"{count} of {total} arrangements"


def demand_section(results: StudyResults) -> Section | None:
    """The largest demand of all runs on one damper at each place, and the ranges it was tested in."""
    demands = [each for key in results.runs for each in results.demands(*key)]
    if not demands:
        return None
    columns = ("stroke", "velocity", "frequency", "command", "force", "mean power")

    def row(label: str, shown: OperatingRange | None) -> tuple[str, ...]:
        spans = {} if shown is None else dict(shown.rows())
        return (label, *(spans.get(name, NOTHING) for name in columns))

    rows = []
    for device in results.dampers:
        rows += [
            row(device.name, covering([each.demand for each in demands if each.device == device.name])),
            row("tested", device.tested),
        ]
    outside = sorted({name for each in demands for name in each.outside.names})
    known = any(each.outside.known for each in demands)
    summary = f"outside the tested range in {', '.join(outside)}." if outside else "within the tested range."
    return Section(
        anchor="demand",
        title="Demand on the dampers",
        summary=summary if known else "the tested ranges of these dampers are not known.",
        groups=(
            Group(
                table=Table(
                    label="Largest demand on one damper, and the range it was tested in",
                    columns=("", *(name[:1].upper() + name[1:] for name in columns)),
                    rows=tuple(rows),
                    words=tuple(range(1, 1 + len(columns))),
                    note="Of all runs. Stroke, velocity and force are peaks, the power is the mean over the motion. "
                    "The frequency is that of a sinusoid with the peak velocity and the peak stroke of a run.",
                )
            ),
        ),
    )


def _balance_table(results: StudyResults, listed: Sequence[int]) -> Table:
    rows = []
    for number in listed:
        row = results.rows[number]
        done = [run for (of, _), run in results.runs.items() if of == number and run.finished]
        if not done:
            continue
        spent = ratio(
            np.array([np.sum(run.device_energy) for run in done]),
            np.array([run.input_energy for run in done]),
        )
        rows.append(
            (
                row.label,
                format_fixed(100.0 * float(np.mean(spent)), 1),
                significant(max(run.energy_error for run in done), 2),
                format_fixed(max(run.steps for run in done), 0),
            )
        )
    return Table(
        label="Balance of energy",
        columns=("", "Dissipated by dampers (%)", "Largest error of balance", "Most steps per sample"),
        rows=tuple(rows),
        note="Input = kinetic + strain + structural damping + dampers, integrated with the same stages as the motion. "
        "The error is the imbalance over the largest energy, the largest of all motions.",
    )


def step_section(results: StudyResults, shown: ShownRows) -> Section | None:
    """The largest change of each row; `None` if the step was not checked."""
    changes = largest_step_changes(results)
    if not changes:
        return None
    compared = [each for each in changes if each.criterion]
    summary = "no runs can be compared."
    if compared:
        worst = max(compared, key=lambda each: each.change)
        summary = (
            f"half the step changes no criterion by more than {significant(worst.change, 2)} of its value, that of "
            f"{results.rows[worst.row].label}."
        )
    return Section(
        anchor="step",
        title="Half the step",
        summary=summary,
        groups=(Group(table=step_table(results, shown.listed)),),
    )


def band_section(table: Table, count: int) -> Section | None:
    """Bands of the score and of its ratios over so many realisations; `None` without any."""
    if not (count and table.rows):
        return None
    return Section(
        anchor="bands",
        title="Under uncertainty",
        summary=f"{count} realisations of what is not known exactly.",
        groups=(Group(table=table),),
    )


# Motions that the front names.
_NAMED = 4
# Quantities of the headline; the section of changes has all of them.
_HEADLINE = ("peak_drift", "peak_acceleration", "peak_base_shear")


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
    comparison, motion = compared(results), results.detailed
    lead = study_lead(comparison)
    if summary:
        return page_html(lead)
    shown = shown_rows(comparison, results.with_histories)
    took = [] if seconds is None else [("Runs", f"{results.done} of {results.total} in {seconds:.3g} s")]
    of_row = strokes(results, drawn_rows(comparison))
    first = [row for row in (comparison.leading, comparison.passive) if row is not None]
    sections = [
        warning_section([*results.warnings(), *([] if results.balanced else [OFF_BALANCE])]),
        _change_section(comparison, shown),
        spread_section(comparison, shown, of_row),
        _criteria_section(results, shown),
        history_section(results, histories, motion, shown.with_histories, of_row),
        device_section(results, histories, motion, first, of_row),
        energy_section(results, motion, shown),
        band_section(bands_of_study(results, shown.listed), results.n_realisations),
        demand_section(results),
        step_section(results, shown),
        motion_section(results),
        provenance_section([*results.facts, *took], command),
    ]
    return page_html(lead, sections)


def provenance_section(facts: Sequence[tuple[str, str]], command: str) -> Section:
    """The last section: what was computed, and by which command."""
    said = (*facts, *([("Command", f"`{command}`")] if command else []))
    return Section(anchor="provenance", title="Provenance", groups=(Group(facts=said),))


def _change_section(comparison: StudyComparison, shown: ShownRows) -> Section | None:
    """Changes of every quantity against the best constant command and the building without dampers, and findings."""
    if comparison.leading is None:
        return None
    results = comparison.results
    lacking = (ADD_BEST_PASSIVE,) if comparison.lacks_best_passive else ()
    groups = [
        Group(
            title=f"Against {results.rows[reference].label}",
            prose=lacking if reference == comparison.passive else (),
            table=change_table(comparison, reference, shown.listed),
        )
        for reference in reversed(comparison.references)
    ]
    return Section(
        anchor="changes",
        title="Changes of every quantity",
        summary=f"{comparison.heading(comparison.leading)}.",
        groups=(*groups, Group(points=findings(results), prose=(shown.in_words,) if shown.in_words else ())),
    )


def _criteria_section(results: StudyResults, shown: ShownRows) -> Section:
    judged = results.judged_motions
    median = f", median of {judged_in_words(results)}" if len(judged) > 1 else ""
    return Section(
        anchor="criteria",
        title="Criteria",
        summary=f"in their units{median}; those of every motion are in `criteria.csv`.",
        groups=(Group(table=value_table(results, judged, shown.listed)),),
    )
