"""The page of a study: changes of every quantity, tables of criteria, profiles, histories, loops, energies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from mrwork.closed_loop.evaluation import criterion
from mrwork.report.html import filled_in
from mrwork.report.numbers import MINUS, fixed
from mrwork.report.section import Group, Section
from mrwork.report.study.comparison_tables import change_table, leading_table, signed_percent
from mrwork.report.study.criteria_tables import overview_table, ratio_table, value_table
from mrwork.report.study.history_sections import ReadHistory, device_section, history_section
from mrwork.report.study.motion_sections import motion_section, spread_section
from mrwork.report.study.sections import (
    demand_section,
    energy_section,
    profile_section,
    step_section,
    uncertainty_section,
)
from mrwork.report.study.shown_rows import ShownRows, shown_rows
from mrwork.study.comparison import (
    ADD_BEST_PASSIVE,
    MOST_IN_DETAIL,
    StudyComparison,
    compared,
    judged_in_words,
)
from mrwork.study.results import OFF_BALANCE, StudyResults

# Quantities of the headline; the section of changes has all of them.
_HEADLINE = ("peak_drift", "peak_acceleration", "peak_base_shear")


def study_page(
    results: StudyResults,
    histories: ReadHistory,
    *,
    motion: int,
    drawn: Sequence[int],
    status: tuple[str, str, str] = ("Runs", "", ""),
    command: str = "",
) -> str:
    """The page of a study.

    Parameters
    ----------
    motion
        Index of the motion of the time histories.
    drawn
        Indices of the rows that are drawn there; of many, the best.
    status
        Heading, value and note of the last number of the headline.
    command
        Command line of the study.

    Returns
    -------
    str
        HTML with embedded styles and figures.
    """
    comparison = compared(results)
    shown = shown_rows(comparison, drawn)
    sections = [
        _comparison_section(comparison, shown),
        spread_section(comparison, shown),
        _criteria_section(comparison, shown),
        profile_section(results, motion, shown),
        history_section(results, histories, motion, shown.with_histories),
        device_section(results, histories, motion, shown.with_histories),
        uncertainty_section(results, shown),
        demand_section(results),
        energy_section(results, motion, shown),
        step_section(results, shown),
        motion_section(results),
    ]
    return filled_in(
        "study.html.j2",
        title=results.title,
        motions=results.motions,
        banner=_banner(results),
        leading=_leading_in_words(comparison),
        shown=shown.in_words,
        headline=_headline(comparison),
        status=status,
        warnings=results.warnings(),
        advice="" if results.balanced else OFF_BALANCE,
        sections=[section for section in sections if section is not None],
        facts=(*results.facts, *([("Command", f"`{command}`")] if command else [])),
    )


def _comparison_section(comparison: StudyComparison, shown: ShownRows) -> Section | None:
    if comparison.leading is None:
        return None
    results, leading = comparison.results, comparison.leading
    words = [text.replace(" -", f" {MINUS}") for text in comparison.in_words(leading)]
    lacking = (ADD_BEST_PASSIVE,) if comparison.lacks_best_passive else ()
    groups = [
        Group(title=comparison.heading(leading), table=leading_table(comparison, leading)),
        *(
            Group(
                title=f"{'Every arrangement' if len(shown.listed) == len(results.rows) else 'Arrangements'} against "
                f"{results.rows[reference].label}",
                prose=lacking if reference == comparison.passive else (),
                table=change_table(comparison, reference, shown.listed),
            )
            for reference in comparison.references
        ),
    ]
    return Section(anchor="changes", title="Changes", summary=" ".join(words), groups=tuple(groups))


def _criteria_section(comparison: StudyComparison, shown: ShownRows) -> Section:
    results = comparison.results
    assert isinstance(results, StudyResults)
    groups = (
        [
            Group(
                title=f"Score and ratios over {judged_in_words(results)}",
                table=overview_table(comparison, shown.listed),
            )
        ]
        if len(results.motions) > 1
        else []
    )
    many = len(results.motions) > MOST_IN_DETAIL
    if many:
        groups += [
            Group(
                title=f"Criteria, median of {judged_in_words(results)}",
                table=value_table(results, results.judged, shown.listed),
                prose=(
                    f"The criteria of all {len(results.motions)} motions are in `criteria.csv` and `results.json`.",
                ),
            )
        ]
    for number, motion in enumerate(() if many else results.motions):
        groups.append(
            Group(
                title=motion.name,
                synthetic=motion.synthetic,
                table=ratio_table(results, number, shown.listed),
            )
        )
        groups.append(Group(table=value_table(results, (number,), shown.listed)))
    return Section(
        anchor="criteria", title="Criteria", summary=comparison.scores_in_words(), groups=tuple(groups)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Number:
    """A number of the headline, and a line below it; those that became worse are coloured."""

    title: str
    value: str
    unit: str = ""
    worse: bool = False
    note: str = ""
    note_worse: bool = False


def _headline(comparison: StudyComparison) -> list[_Number]:
    """Changes of the leading row against the building without dampers, and below against the best passive damper."""
    results, row = comparison.results, comparison.leading
    if row is None or comparison.uncontrolled is None:
        return [
            _Number(title="Arrangements", value=fixed(len(results.rows), 0)),
            _Number(title="Ground motions", value=fixed(len(results.motions), 0)),
        ]
    numbers = []
    for name in _HEADLINE:
        bare = comparison.changes(row, comparison.uncontrolled)[name]
        number = _Number(
            title=criterion(name).title, value=signed_percent(bare.mean), unit="%", worse=bare.worse
        )
        if comparison.passive is not None and comparison.passive != row:
            passive = comparison.changes(row, comparison.passive)[name]
            number = replace(
                number,
                note=f"{signed_percent(passive.mean)} % against the best passive damper",
                note_worse=passive.worse,
            )
        numbers.append(number)
    return numbers


def _leading_in_words(comparison: StudyComparison) -> str:
    if comparison.leading is None or comparison.uncontrolled is None:
        return ""
    label = comparison.results.rows[comparison.uncontrolled].label
    return f"{comparison.heading(comparison.leading)}, against {label}:"


def _banner(results: StudyResults) -> str:
    if results.complete:
        return ""
    return (
        f"This study was interrupted: {results.done} of {results.total} runs are done. "
        "Run it with --resume to continue."
    )
