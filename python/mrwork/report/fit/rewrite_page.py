"""The page of a run folder, written again after a verb has added to the folder."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from mrwork.identification.fit_file import reopen
from mrwork.report.fit.page import comparisons_of, fit_page
from mrwork.store.run_folder import REPORT, write_files
from mrwork.stored import load
from mrwork.uncertainty.identifiability.verdicts import identifiability_of


def rewrite_page(place: str | Path) -> Path:
    """Write `report.html` of the run folder at `place` again, with everything that the folder holds.

    Raises
    ------
    RecordError
        Where it is no run directory, its tests cannot be read as they were, or an addition is damaged.
    OutputError
        Where the page cannot be written.
    """
    opened = reopen(place)
    fit = opened.fit
    if fit.identifiability is None:
        # An earlier version did not ask.
        fit = replace(fit, identifiability=identifiability_of(fit, opened.tests))
    page = fit_page(replace(load(opened.place), fit=fit), comparisons_of(fit, opened.tests))
    write_files(opened.place, {REPORT: page.encode()})
    return opened.place / REPORT
