"""Interface of a section of a fit's page, apart because every section imports it and `page` imports every section."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from mrwork.report.comparison import Comparison
from mrwork.report.section import Absent, Section
from mrwork.stored import StoredRun


@dataclass(frozen=True, slots=True, kw_only=True)
class SectionKind:
    """A section as `page.SECTIONS` lists it.

    `make` returns the section of a run and of its fit's tests, or `None` where the run has no data for it; the page
    then shows `absent`, which names the command that adds it.
    """

    make: Callable[[StoredRun, Sequence[Comparison]], Section | None]
    absent: Absent | None = None
