"""The page of a run directory, written anew after a verb has added to it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from mrwork.errors import OutputError
from mrwork.report.fit.page import comparisons_of, dossier_page
from mrwork.report.reopen import reopen
from mrwork.report.run_directory import REPORT
from mrwork.uncertainty.identifiability.verdicts import identifiability_of


def write_dossier(place: str | Path) -> Path:
    """Write `report.html` of the run directory at `place` again, with all that is in it.

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
    page = dossier_page(fit, comparisons_of(fit, opened.tests), opened.place)
    target = opened.place / REPORT
    beside = target.with_name(f".{REPORT}.new")
    try:
        beside.write_text(page, encoding="utf-8")
        beside.replace(target)
    except OSError as reason:
        raise OutputError(
            f"cannot write {target}: {reason.strerror}; make room, then repeat the verb"
        ) from reason
    finally:
        beside.unlink(missing_ok=True)
    return target
