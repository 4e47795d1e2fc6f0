"""The run folder of a tuning: the folder of the judging study, what the search found, the chosen study as a file."""

from __future__ import annotations

import tomllib
from dataclasses import asdict
from pathlib import Path
from typing import Any

from mrwork.base.arguments import checked
from mrwork.base.keys import toml_text
from mrwork.base.table import csv_text
from mrwork.errors import RecordError
from mrwork.store.codec import json_document
from mrwork.store.run_folder import CHOSEN, SCORES_TABLE, TUNED, TUNING_RUN, RunFolder
from mrwork.study.arrangements import own_law_of
from mrwork.study.schema import LawFileTable
from mrwork.study.study import StudyFile
from mrwork.study.study_folder import results_of_folder, study_document, study_files
from mrwork.tuning.judging import TunedStudy, with_tuning
from mrwork.tuning.space import LARGEST, follows_command
from mrwork.tuning.tuned_laws import TunedLaw, TuningResults


def tuning_files(results: TunedStudy, study_file: StudyFile) -> dict[str, bytes]:
    """The files of a tuning by name, but its manifest, journal, histories and page."""
    texts = {
        TUNED: json_document(asdict(results.tuned)),
        SCORES_TABLE: _scores_csv(results),
        CHOSEN: chosen_study(results.tuned, study_file),
    }
    return study_files(results, study_file) | {name: text.encode() for name, text in texts.items()}


@checked
def read_tuning(folder: str | Path) -> TunedStudy:
    """Read the results of a tuning back from its folder, as `mr.load` does.

    Raises
    ------
    RecordError
        If it is not the folder of a tuning, or the file is damaged.

    Examples
    --------
    >>> import mrwork as mr
    >>> mr.tuning.read_tuning("out/study").tuned.laws[0].settings  # doctest: +SKIP
    {'drifts': 1.0, 'control_weight': 1.2e-13, 'largest_command': 1.316}
    """
    run = RunFolder.open(folder, TUNING_RUN)
    tuned = run.read(TuningResults, TUNED)
    if tuned is None:
        raise RecordError(f"{folder} has no {TUNED}; run `mrwork tune` again")
    return with_tuning(results_of_folder(run), tuned)


def tuning_document(results: TunedStudy) -> dict[str, Any]:
    """The results as a JSON object: the study's own, and each law and reference with its judgements."""

    def judged(law: TunedLaw) -> dict[str, Any]:
        uses = {"train": results.judgement(law, "training"), "test": results.judgement(law, "test")}
        return {**asdict(law), **{use: None if each is None else asdict(each) for use, each in uses.items()}}

    tuned = results.tuned
    return {
        **study_document(results),
        **asdict(tuned),
        "laws": [judged(law) for law in tuned.laws],
        "references": [judged(law) for law in tuned.references],
        "status": results.status,
        "remarks": results.remarks,
    }


def chosen_study(results: TuningResults, study_file: StudyFile) -> str:
    """The study file with the chosen settings of each law as further controllers, without its comments.

    Names of files stay as they are; `folder` is the place that they are relative to.
    """
    document = tomllib.loads(study_file.text)
    folder = study_file.path.parent / document.pop("folder", "")
    if results.places:
        first, placed = document["damper"][0], results.places[0].storeys
        first.pop("name", None)
        document["damper"] = [
            first | {"storey": name, "count": first.get("count", 1) * number}
            for name, number in placed.items()
        ]
        del document["places"]
    users = {
        own_law_of(LawFileTable(**tune["user"]), folder).name: tune["user"]
        for tune in document.get("tune", [])
        if "user" in tune
    }
    document["controller"] = [
        *document.get("controller", []),
        *(_controller(law, users.get(law.law)) for law in results.laws),
    ]
    return (
        f"# The study {study_file.path.name} with the settings that mrwork tune has chosen, as its last controllers; "
        f"for mrwork respond.\n{toml_text({'folder': str(folder), **document})}"
    )


def _controller(law: TunedLaw, user: dict[str, Any] | None) -> dict[str, Any]:
    settings, of_command = law.candidate.of_law, law.candidate.of_command
    if not follows_command(law.law):
        of_command.pop(LARGEST, None)
    named = {"law": law.law} if user is None else {"user": user}
    return {**named, "label": law.label, **({"settings": settings} if settings else {}), **of_command}


def _scores_csv(results: TunedStudy) -> str:
    names = [entry.name for entry in results.criteria_of_runs.entries if entry.ratio]
    lines = [["law", "use", "motion", "score", *names]]
    for law in (*results.tuned.laws, *results.tuned.references):
        row = results.row_of_law(law)
        if row is None:
            continue
        for motion, facts in enumerate(results.motions):
            ratios = results.ratios(row, motion, "passive_off")
            numbers = (results.scores(row)[motion], *(ratios[name] for name in names))
            lines.append([law.label, facts.use, facts.name, *(f"{number:.9g}" for number in numbers)])
    return csv_text(lines)
