"""What a section of a fit's page has to give; apart, for every section imports it and `page` imports every section."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from mrwork.report.comparison import Comparison
from mrwork.report.section import Absent, Section
from mrwork.stored import StoredRun


@dataclass(frozen=True, slots=True, kw_only=True)
class SectionKind:
    """A section as `page.SECTIONS` lists it.

    `make` gives the section of a run and of its fit's tests, or `None` where the run has nothing for it; `absent` then
    says on the page which verb makes it.
    """

    make: Callable[[StoredRun, Sequence[Comparison]], Section | None]
    absent: Absent | None = None
