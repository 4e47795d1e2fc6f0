"""The folder of a tuning: results, scores as a table, and the chosen settings as a study file."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from mrwork.arguments import checked
from mrwork.errors import RecordError
from mrwork.store.codec import finite, json_document
from mrwork.store.destination import Destination
from mrwork.store.manifest import check_manifest, read_manifest
from mrwork.store.output_folder import write_folder
from mrwork.store.parse import toml_table
from mrwork.store.record import read_document
from mrwork.store.run_folder import CHOSEN, JOURNAL, REPORT, RESULTS, SCORES_TABLE, STUDY, TUNING_RUN
from mrwork.study.study import StudyFile
from mrwork.tuning.results import Judgement, LawResult, TuningResults
from mrwork.tuning.space import LARGEST


def write_tuning(
    destination: Destination,
    results: TuningResults,
    *,
    study_file: StudyFile,
    page: str | None,
    manifest: Mapping[str, object],
    journal: Path,
) -> None:
    """Write the folder of a tuning, in place of an earlier one."""
    contents = {
        RESULTS: json_document(tuning_document(results)),
        SCORES_TABLE: _scores_csv(results),
        CHOSEN: chosen_study(results, study_file),
    }
    if page is not None:
        contents[REPORT] = page
    write_folder(
        destination,
        {STUDY: study_file.content} | {name: text.encode() for name, text in contents.items()},
        manifest=manifest,
        copied={JOURNAL: journal},
        flush=results.status == "finished",
    )


@checked
def read_tuning(folder: str | Path) -> TuningResults:
    """Read the results of a tuning back from its folder.

    Raises
    ------
    RecordError
        If it is not the folder of a tuning, or the file is damaged.

    Examples
    --------
    >>> import mrwork as mr
    >>> mr.tuning.read_tuning("out/study").laws[0].settings  # doctest: +SKIP
    {'drifts': 1.0, 'control_weight': 1.2e-13, 'largest_command': 1.316}
    """
    place = Path(folder)
    manifest = read_manifest(place, verb="tune")
    is_tuning = manifest is not None and manifest.get("kind") == TUNING_RUN.kind
    found = read_document(TuningResults, place / RESULTS, name="tuning", verb="tune") if is_tuning else None
    if manifest is None or found is None:
        raise RecordError(f"{place} is not the folder of a tuning; give one that `mrwork tune` has written")
    facts = {"title": (found.title,), "status": (found.status,)}
    check_manifest(place, manifest, facts, file=RESULTS, verb="tune")
    return found


def tuning_document(results: TuningResults) -> dict[str, Any]:
    """The results as a JSON object; numbers that are not finite are `null`."""
    found: dict[str, Any] = finite({**asdict(results), "warnings": results.warnings})
    return found


def chosen_study(results: TuningResults, study_file: StudyFile) -> str:
    """The study file with the chosen settings of each law, and the best constant command, as further controllers.

    The text of the study stays; names of files in it are relative to its own folder.
    """
    text = study_file.text
    blocks = [_controller(each) for each in results.laws]
    if not re.search(r'^\s*law\s*=\s*"best_passive"', text, flags=re.MULTILINE):
        blocks.append('[[controller]]\nlaw = "best_passive"\n')
    folder = study_file.path.parent / toml_table(text).get("folder", "")
    head = (
        f"# The study {study_file.path.name} with the settings that mrwork tune has chosen; for mrwork respond.\n"
        f"folder = {_text(str(folder))} # of the files that the study names\n\n"
    )
    return head + _without_folder(text).rstrip() + "\n\n# Chosen by mrwork tune.\n\n" + "\n".join(blocks)


def _without_folder(text: str) -> str:
    """The study without a `folder` of its own, which stands before its first table."""
    first = re.search(r"^\s*\[", text, flags=re.MULTILINE)
    end = len(text) if first is None else first.start()
    return re.sub(r"^[ \t]*folder[ \t]*=.*\n?", "", text[:end], flags=re.MULTILINE) + text[end:]


def _controller(law: LawResult) -> str:
    settings = {name: value for name, value in law.settings.items() if name != LARGEST}
    lines = [
        "[[controller]]",
        f"law = {_text(law.law)}",
        f"label = {_text(law.label)}",
        *([f"settings = {_toml(settings)}"] if settings else []),
        *([f"{LARGEST} = {_toml(law.settings[LARGEST])}"] if law.limited else []),
    ]
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    """A value as TOML: a number, a text, an array, or a table in braces."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{name} = {_toml(each)}" for name, each in value.items()) + " }"
    if isinstance(value, Sequence):
        return "[" + ", ".join(_toml(each) for each in value) + "]"
    return repr(value)


def _text(value: str) -> str:
    # The escapes of JSON are those of TOML.
    return json.dumps(value, ensure_ascii=False)


def _scores_csv(results: TuningResults) -> str:
    """Score and ratios of every law and reference under every motion, a line for each."""
    names = [name for each in results.references[:1] for name in each.train.criteria]
    lines = [["law", "use", "motion", "score", *names]]
    for law in (*results.laws, *results.references):
        for use, found in (("training", law.train), ("test", law.test)):
            lines += _lines(law, use, found, names)
    target = io.StringIO()
    csv.writer(target, lineterminator="\n").writerows(lines)
    return target.getvalue()


def _lines(law: LawResult, use: str, found: Judgement | None, names: Sequence[str]) -> list[list[str]]:
    return [
        [law.label, use, each.motion, f"{each.score:.9g}", *(f"{each.criteria[name]:.9g}" for name in names)]
        for each in (() if found is None else found.motions)
    ]
