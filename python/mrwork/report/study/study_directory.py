"""The folder of a study: manifest, journal, results, tables, histories and page, whole or not at all."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path

from mrwork.report.fit_json import json_document
from mrwork.report.run_directory import HISTORIES, JOURNAL, MANIFEST, REPORT, write_folder
from mrwork.report.study.stored_histories import Histories
from mrwork.report.study.study_json import criteria_csv, profiles_csv, study_document
from mrwork.study.results import StudyResults

RESULTS = "results.json"
STUDY = "study.toml"
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

    def fill(fresh: Path) -> None:
        (fresh / MANIFEST).write_text(json_document(manifest), encoding="utf-8")
        (fresh / RESULTS).write_text(json_document(study_document(results)), encoding="utf-8")
        (fresh / _CRITERIA).write_text(criteria_csv(results), encoding="utf-8")
        (fresh / _PROFILES).write_text(profiles_csv(results), encoding="utf-8")
        (fresh / REPORT).write_text(page, encoding="utf-8")
        shutil.copyfile(study_file, fresh / STUDY)
        shutil.copyfile(journal, fresh / JOURNAL)
        histories.move_into(fresh)

    write_folder(place, fill, written=_WRITTEN, flush=results.complete)
