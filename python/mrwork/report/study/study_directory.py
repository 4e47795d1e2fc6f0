"""The folder of a study: manifest, journal, results, tables, histories and page, whole or not at all."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from mrwork.report.study.stored_histories import Histories
from mrwork.report.study.study_json import criteria_csv, profiles_csv, study_document
from mrwork.store.codec import json_document
from mrwork.store.run_folder import HISTORIES, JOURNAL, MANIFEST, REPORT, RESULTS, STUDY, write_folder
from mrwork.study.results import StudyResults

_CRITERIA, _PROFILES = "criteria.csv", "profiles.csv"
_WRITTEN = frozenset({MANIFEST, JOURNAL, RESULTS, STUDY, REPORT, HISTORIES, _CRITERIA, _PROFILES})


def write_study(
    place: Path,
    results: StudyResults,
    *,
    study_file: Path,
    page: str,
    manifest: Mapping[str, object],
    journal: Path,
    histories: Histories,
) -> None:
    """Write the folder of a study, in place of an earlier one.

    Raises
    ------
    OutputError
        If anything cannot be written; the place is then as it was.
    """
    tables = {
        MANIFEST: json_document(manifest),
        RESULTS: json_document(study_document(results)),
        _CRITERIA: criteria_csv(results),
        _PROFILES: profiles_csv(results),
        REPORT: page,
    }
    write_folder(
        place,
        {name: text.encode() for name, text in tables.items()},
        copied={STUDY: study_file, JOURNAL: journal},
        linked={f"{HISTORIES}/{path.name}": path for path in histories.paths()},
        folders=(HISTORIES,),
        written=_WRITTEN,
        flush=results.complete,
    )
