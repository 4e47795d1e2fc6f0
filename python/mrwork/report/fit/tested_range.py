"""The section on the ranges in which the damper was tested."""

from __future__ import annotations

from collections.abc import Sequence

from mrwork.report.comparison import Comparison
from mrwork.report.fit.kind import SectionKind
from mrwork.report.section import Group, Section, Table
from mrwork.stored import StoredRun


def _section(run: StoredRun, _: Sequence[Comparison]) -> Section | None:
    """The table of ranges; none for a fit of an earlier version whose tests could not be read."""
    tested = run.fit.tested
    if tested is None:
        return None
    return Section(
        anchor="tested",
        title="Tested range",
        summary=f"Tested range: {tested.in_words}.",
        groups=(
            Group(
                table=Table(
                    label="Ranges of the tests",
                    columns=("Quantity", "Tested"),
                    rows=tuple((name[:1].upper() + name[1:], span) for name, span in tested.rows()),
                    words=(1,),
                    note="The stroke is half the peak-to-peak displacement; velocity and force are peaks; the mean "
                    "power is the largest dissipated by a test; the frequency is that of the cycles. `mrwork predict` "
                    "and `mrwork respond` say where the damper is used outside these ranges.",
                )
            ),
        ),
    )


TESTED_RANGE = SectionKind(make=_section)
"""The ranges in which the damper was tested."""
