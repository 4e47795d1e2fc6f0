"""The page of a study: tables of criteria, profiles, histories, loops, energies."""

from __future__ import annotations

from collections.abc import Sequence

from mrwork.report.html import filled_in
from mrwork.report.numbers import fixed
from mrwork.report.section import Group, Section
from mrwork.report.study.criteria_tables import overview_table, ratio_table, value_table
from mrwork.report.study.history_sections import ReadHistory, device_section, history_section
from mrwork.report.study.sections import energy_section, motion_section, profile_section, step_section
from mrwork.study.results import OFF_BALANCE, StudyResults


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
        Indices of the rows that are drawn there.
    status
        Heading, value and note of the last number of the headline.
    command
        Command line of the study.

    Returns
    -------
    str
        HTML with embedded styles and figures.
    """
    sections = [
        _criteria_section(results),
        profile_section(results, motion),
        history_section(results, histories, motion, drawn),
        device_section(results, histories, motion, drawn),
        energy_section(results, motion),
        step_section(results),
        motion_section(results),
    ]
    return filled_in(
        "study.html.j2",
        title=results.title,
        motions=results.motions,
        banner=_banner(results),
        headline=_headline(results),
        status=status,
        warnings=results.warnings(),
        advice="" if results.balanced else OFF_BALANCE,
        sections=[section for section in sections if section is not None],
        facts=(*results.facts, *([("Command", f"`{command}`")] if command else [])),
    )


def _criteria_section(results: StudyResults) -> Section:
    groups = (
        [Group(title="Over all motions", table=overview_table(results))] if len(results.motions) > 1 else []
    )
    for number, motion in enumerate(results.motions):
        groups.append(
            Group(title=motion.name, synthetic=motion.synthetic, table=ratio_table(results, number))
        )
        groups.append(Group(table=value_table(results, number)))
    return Section(anchor="criteria", title="Criteria", summary=_best_in_words(results), groups=tuple(groups))


def _best(results: StudyResults) -> tuple[int, float] | None:
    """The control law with the lowest score."""
    scores = [(results.score(row), row) for row in range(len(results.rows))]
    known = [
        (score, row) for score, row in scores if score == score and results.rows[row].kind == "controller"
    ]
    return (min(known)[1], min(known)[0]) if known else None


def _best_in_words(results: StudyResults) -> str:
    best = _best(results)
    if best is None:
        return ""
    row, score = best
    return (
        f"{results.rows[row].label} has the lowest score, {fixed(score, 3)}: on average drift and acceleration are "
        f"{fixed(100.0 * (1.0 - score), 0)} % below those at i = 0."
    )


def _headline(results: StudyResults) -> list[tuple[str, str, str]]:
    best = _best(results)
    return [
        ("Lowest score", fixed(None if best is None else best[1], 3), ""),
        ("Arrangements", fixed(len(results.rows), 0), ""),
        ("Ground motions", fixed(len(results.motions), 0), ""),
    ]


def _banner(results: StudyResults) -> str:
    if results.complete:
        return ""
    return (
        f"This study was interrupted: {results.done} of {results.total} runs are done. "
        "Run it with --resume to continue."
    )
