"""The section on the choice of current laws: the laws that were tried, and how they predict tests left out."""

from __future__ import annotations

from collections.abc import Sequence

from mrwork.report.comparison import Comparison
from mrwork.report.fit.kind import SectionKind
from mrwork.report.section import Absent, Group, Section, table
from mrwork.stored import StoredRun


def _section(run: StoredRun, _: Sequence[Comparison]) -> Section | None:
    """The sentence and the table of a choice, and how its numbers are defined."""
    laws = run.laws
    if laws is None:
        return None
    chosen = laws.chosen
    columns: tuple[str, ...] = ("Laws", "Parameters", "Fit %", "Left-out fit %", "Median", "Worst", "Remark")
    rows = tuple((each.in_words, *each.cells[:-1]) for each in laws.tried)
    words: tuple[int, ...] = (6,)
    in_words = chosen.in_words
    if laws.is_of_several:
        columns = ("Model", *columns)
        rows = tuple((each.model, *row) for each, row in zip(laws.tried, rows, strict=True))
        words = (1, 7)
        in_words = f"{laws.model}, {in_words}"
    return Section(
        anchor="laws",
        title="Choice of current laws",
        summary=f"Choice of laws: {in_words}, of {len(laws.tried)} sets of laws; left-out fit "
        f"{chosen.left_out_percent:.2f} %.",
        groups=(
            Group(
                prose=(laws.sentence, *(f"{note}." for note in laws.notes)),
                table=table(label="Laws that were tried", columns=columns, words=words, rows=rows),
                points=laws.definitions,
            ),
        ),
    )


LAWS = SectionKind(
    make=_section,
    absent=Absent(
        title="Choice of current laws",
        command="mrwork identify TESTS --law auto",
        description="chooses which parameters follow the command, and by which law, by predictions of tests left out, "
        "and writes a run folder of its own.",
    ),
)
