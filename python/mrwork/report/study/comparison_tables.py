"""Tables of the changes of every quantity against the building without dampers and the best passive damper."""

from __future__ import annotations

import math
from collections.abc import Collection

from mrwork.closed_loop.evaluation import Criterion
from mrwork.report.numbers import fixed
from mrwork.report.section import NOTHING, Table
from mrwork.study.comparison import (
    LAWS,
    QuantityChange,
    StudyComparison,
    compared_quantities,
    judged_in_words,
    rounds_to_increase,
)


def leading_table(comparison: StudyComparison, row: int) -> Table:
    """The changes of one row, quantity by quantity, against each reference."""
    results = comparison.results
    references = [each for each in comparison.references if each != row]
    several = len(results.judged) > 1
    heads = ("Mean (%)", "Largest (%)", "Under") if several else ("Change (%)",)
    cells: list[tuple[str, ...]] = []
    alarming = set()
    for line, entry in enumerate(compared_quantities()):
        found: list[str] = [entry.title]
        for reference in references:
            change = comparison.changes(row, reference)[entry.name]
            numbers = (change.mean, change.largest) if several else (change.mean,)
            alarming |= {
                (line, len(found) + place)
                for place, number in enumerate(numbers)
                if rounds_to_increase(number)
            }
            found += [signed_percent(number) for number in numbers]
            if several:
                found.append(NOTHING if math.isnan(change.mean) else results.motions[change.motion].name)
        cells.append(tuple(found))
    return Table(
        label=f"Changes of {results.rows[row].label}",
        columns=("", *(head for _ in references for head in heads)),
        rows=tuple(cells),
        words=tuple(len(heads) * (number + 1) for number in range(len(references))) if several else (),
        over=(("", 1), *((f"Against {results.rows[each].label}", len(heads)) for each in references)),
        alarming=frozenset(alarming),
        note="Negative changes are improvements; increases are coloured."
        + (f" Mean over {judged_in_words(results)}, and the largest change under one." if several else ""),
    )


def change_table(comparison: StudyComparison, reference: int, shown: Collection[int]) -> Table:
    """The changes of the shown rows against a reference, the rows of each rank together."""
    results = comparison.results
    quantities = compared_quantities()
    several = len(results.judged) > 1
    cells: list[tuple[str, ...]] = []
    headings: dict[int, str] = {}
    strong: set[tuple[int, int]] = set()
    alarming: set[tuple[int, int]] = set()
    for rank, rows in comparison.ranks:
        others = [row for row in rows if row != reference and row in shown]
        if not others:
            continue
        start = len(cells)
        headings[start] = rank.title
        changes = [comparison.changes(row, reference) for row in others]
        for line, (row, found) in enumerate(zip(others, changes, strict=True), start):
            largest = [_largest(comparison, found, quantities)] if several else []
            cells.append(
                (
                    results.rows[row].label,
                    *(signed_percent(found[entry.name].mean) for entry in quantities),
                    *largest,
                )
            )
            alarming |= {
                (line, place) for place, entry in enumerate(quantities, 1) if found[entry.name].worse
            }
        for place, entry in enumerate(quantities, 1):
            means = [found[entry.name].mean for found in changes]
            known = [mean for mean in means if not math.isnan(mean)]
            strong |= {
                (start + number, place)
                for number, mean in enumerate(means)
                if len(known) > 1 and signed_percent(mean) == signed_percent(min(known))
            }
    return Table(
        label=f"Changes against {results.rows[reference].label}",
        columns=(
            "",
            *(entry.short for entry in quantities),
            *(["Largest increase under one motion"] if several else []),
        ),
        rows=tuple(cells),
        foot=_worse_laws(comparison, reference, several=several),
        words=(len(quantities) + 1,) if several else (),
        strong=frozenset(strong),
        alarming=frozenset(alarming),
        headings=headings,
        note=f"Change in per cent{f', mean over {judged_in_words(results)}' if several else ''}; increases are "
        "coloured, and the best of each kind is bold. Peaks unless stated otherwise."
        + "".join(f" {rank.note}" for rank, _ in comparison.ranks if rank.note),
    )


def signed_percent(change: float) -> str:
    """A change in whole per cent, with its sign."""
    text = fixed(100.0 * change, 0)
    return f"+{text}" if rounds_to_increase(change) else text


def _largest(
    comparison: StudyComparison, changes: dict[str, QuantityChange], quantities: tuple[Criterion, ...]
) -> str:
    """The largest increase of a quantity under one motion; empty if none increases."""
    found = [(changes[entry.name], entry) for entry in quantities]
    known = [(change.largest, change.motion, entry) for change, entry in found if not math.isnan(change.mean)]
    if not known:
        return NOTHING
    largest, motion, entry = max(known, key=lambda each: each[0])
    if not rounds_to_increase(largest):
        return "none"
    return f"{entry.short} {signed_percent(largest)}, {comparison.results.motions[motion].name}"


def _worse_laws(comparison: StudyComparison, reference: int, *, several: bool) -> tuple[str, ...]:
    laws = sum(len(rows) for rank, rows in comparison.ranks if rank is LAWS)
    if laws < 2:
        return ()
    counts = comparison.worse_counts(reference)
    return (
        f"Control laws that are worse, of {laws}",
        *(fixed(counts[entry.name], 0) for entry in compared_quantities()),
        *([""] if several else []),
    )
