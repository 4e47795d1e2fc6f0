"""Section of a study on its step: what changes with half of it."""

from __future__ import annotations

from mrwork.report.numbers import significant
from mrwork.report.section import Group, Section, Table
from mrwork.study.results import StudyResults
from mrwork.study.step_check import ON_OFF, step_changes


def step_section(results: StudyResults) -> Section | None:
    """The largest change of each row; none where the step was not checked."""
    changes = step_changes(results)
    if not changes:
        return None
    compared = [each for each in changes if each.criterion]
    summary = "no two runs can be compared."
    if compared:
        worst = max(compared, key=lambda each: each.change)
        summary = (
            f"half the step moves no criterion by more than {significant(worst.change, 2)} of its value, that of "
            f"{results.rows[worst.row].label}."
        )
    return Section(
        anchor="step",
        title="Half the step",
        summary=summary,
        groups=(
            Group(
                table=Table(
                    label="Largest change of a criterion with half the step",
                    columns=("", "largest change", "of, under"),
                    rows=tuple(
                        (
                            results.rows[each.row].label,
                            significant(each.change if each.criterion else None, 2),
                            each.in_words(results),
                        )
                        for each in changes
                    ),
                    words=(2,),
                    note=f"Every run was made again with half its integration step; the change is that over the value. "
                    f"{ON_OFF}",
                )
            ),
        ),
    )
