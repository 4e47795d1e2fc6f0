"""The page of a comparison of runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from mrwork.report.html import Page, page_html
from mrwork.report.section import Group, Lead, Section
from mrwork.runs.compare import RunsComparison


def compare_page(found: RunsComparison, runs: Sequence[Path]) -> Page:
    """The first table on the front, the others in sections below it."""
    first, *others = found.tables
    lead = Lead(
        eyebrow="Comparison of runs",
        title=found.title,
        subject=", ".join(map(str, runs)),
        verdict=found.verdict,
        table=first,
        cautions=found.remarks,
    )
    sections = [
        Section(anchor=f"table-{number}", title=table.label, groups=(Group(table=table),))
        for number, table in enumerate(others, start=1)
    ]
    return page_html(lead, sections)
