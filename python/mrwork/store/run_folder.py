"""Folder of a run: names of its files, the verbs that write one, and its manifest, read back and compared.

The contents of each file are defined in the module of its type. Every reader of a folder asks `read_kind` first.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from mrwork.base.summary import list_names
from mrwork.errors import OutputError, RecordError, escape_text
from mrwork.store.codec import finite, parse_document
from mrwork.store.input_file import exists, is_file, is_folder, is_there, make_stored_kind, text_of
from mrwork.store.parse import json_value

MANIFEST = "manifest.json"
JOURNAL = "journal.jsonl"
REPORT = "report.html"
SUMMARY = "summary.html"
"""The front of the page alone."""
DATA = "data"
"""Folder of CSV files with what the figures of the page draw."""
FIGURES = "figures"
FIT = "fit.json"
# Added to the folder of a fit by later verbs.
CHAIN = "posterior.jsonl"
DRAWS = "posterior.nc"
PROFILES = "profiles.json"
PLAN = "plan.json"
CALIBRATION = "calibration.json"
FOLDS = "left_out"
PREDICTIONS = "predictions.npz"
HELD_OUT = "held_out.json"
HELD_OUT_FORCES = "held_out.npz"
ADDITIONS = frozenset({
    CHAIN, f"{CHAIN}.part", DRAWS, PROFILES, PLAN, CALIBRATION, FOLDS, PREDICTIONS, HELD_OUT, HELD_OUT_FORCES,
})  # fmt: skip
# Added by a comparison of models: the ranking, and a folder with the fit of each model.
RANKING = "ranking.json"
MODELS = "models"
# Added by a choice of current laws: the laws that were tried.
LAWS = "laws.json"
# And the fits of other sets of laws that predict nearly as well.
NEAR_SETS = "near_sets.json"
# Written by a study of buildings.
RESULTS = "results.json"
STUDY = "study.toml"
HISTORIES = "histories"
CRITERIA_TABLE = "criteria.csv"
PROFILES_TABLE = "profiles.csv"
# With [uncertainty]: the criteria of every realisation.
REALISATIONS = "realisations.npz"
# With --ensemble: its verdicts and criteria for each set of laws.
ENSEMBLE = "ensemble.json"
# Written by a tuning.
CHOSEN = "chosen.toml"
"""The study with the chosen settings, for `mrwork respond`."""
SCORES_TABLE = "scores.csv"

_PART, _CHUNKS = ".part", ".chunks"
_RESUME = "run the command that began it again with --resume"
# Runs in a folder that a message names.
_NAMED: Final = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class RunKind:
    """Kind of run folder that a verb writes, with its `kind` in the manifest.

    `written`: patterns of paths that the verb writes. `added`: names that later verbs add. `redrawn`: files that later
    verbs write again from the others, and folders of such files, so that the manifest does not list them.
    """

    verb: str
    kind: str
    written: frozenset[str]
    added: frozenset[str] = frozenset()
    redrawn: frozenset[str] = frozenset({REPORT, SUMMARY, DATA})

    def redraws(self, name: str) -> bool:
        """Whether a file of the folder is one that later verbs write again, or within a folder of such files."""
        return name.partition("/")[0] in self.redrawn

    @property
    def entries(self) -> frozenset[str]:
        """Names in the folder that the verb, or a later one, may use; all others are the user's."""
        return self.added | {pattern.partition("/")[0] for pattern in self.written}


# The page, and what is beside it.
_PAGE: Final = frozenset({REPORT, SUMMARY, f"{DATA}/*.csv"})

FIT_RUN: Final = RunKind(
    verb="identify",
    kind="identification",
    written=frozenset({MANIFEST, JOURNAL, REPORT, FIT, RANKING, LAWS, NEAR_SETS, f"{MODELS}/*/{FIT}"})
    | _PAGE,
    added=ADDITIONS | {FIGURES},
)
STUDY_RUN: Final = RunKind(
    verb="respond",
    kind="study",
    written=_PAGE
    | {MANIFEST, JOURNAL, REPORT, RESULTS, STUDY, CRITERIA_TABLE, PROFILES_TABLE}
    | {f"{HISTORIES}/*.npz", ENSEMBLE, REALISATIONS},
)
TUNING_RUN: Final = RunKind(
    verb="tune",
    kind="tuning",
    written=frozenset({MANIFEST, JOURNAL, REPORT, RESULTS, STUDY, CHOSEN, SCORES_TABLE}) | _PAGE,
)


RUN_KINDS: Final = (FIT_RUN, STUDY_RUN, TUNING_RUN)
"""Every kind of run folder."""


def kind_of(manifest: Mapping[str, Any]) -> RunKind | None:
    """The kind of the run folder that has a manifest; `None` where no verb of `mrwork` has written it."""
    for known in RUN_KINDS:
        if manifest.get("verb") == known.verb and manifest.get("kind") == known.kind:
            return known
    return None


def real_place(path: str | Path) -> Path:
    """Path with symbolic links resolved, so that writing replaces the target; an impossible name stays."""
    try:
        return Path(os.path.realpath(path))
    except ValueError:
        return Path(path)


def part_of(path: str | Path) -> Path:
    """Folder for the journal of an unfinished run to `path`."""
    place = real_place(path)
    if not place.name:
        raise OutputError(
            f"{path} is the root of all folders, where no run is written; name a folder below it"
        )
    return place.with_name(place.name + _PART)


def chunks_beside(journal: Path) -> Path:
    """Folder of the finished chunks of the step that a journal does not have yet."""
    return journal.with_name(f"{journal.name}{_CHUNKS}")


def is_part(path: Path) -> bool:
    """Whether it is the folder of the journal of an unfinished run."""
    return path.name.endswith(_PART) and path.is_dir()


def is_unfinished(journal: Path) -> bool:
    """Whether a journal has the place of one whose run is not finished."""
    return journal.name.endswith(_PART) or any(is_part(folder) for folder in journal.parents)


def name_unfinished(kept: Path) -> Path:
    """Path of an unfinished journal, which is moved to `kept` when it is complete."""
    return kept.with_name(kept.name + _PART)


# Characters of a value in a message.
_SHOWN: Final = 40


def read_kind(place: Path, wanted: RunKind | None = None) -> tuple[RunKind, Mapping[str, Any]]:
    """Kind and manifest of the run folder at `place`, which must be of the kind `wanted`, by default of any."""
    verbs = [f"`mrwork {each.verb}`" for each in ((wanted,) if wanted else RUN_KINDS)]
    give = f"give a folder that {', '.join(verbs[:-1])} or {verbs[-1]} has written".replace("  or", "")
    kind_by_files = _kind_by_files(place)
    file = make_stored_kind(kind_by_files.verb, name="the manifest")
    path = place / MANIFEST
    if not (is_folder(place) and is_there(path, file)):
        raise RecordError(_no_run(place, give))
    stated = parse_document(text_of(path, file), origin=str(path), verb=kind_by_files.verb)
    if not isinstance(stated, Mapping):
        raise RecordError(
            f"{path} is not a manifest, which is an object of JSON; run `mrwork {kind_by_files.verb}` again"
        )
    # What a manifest does not state contradicts nothing.
    kinds = [
        each
        for each in RUN_KINDS
        if stated.get("kind", each.kind) == each.kind and stated.get("verb", each.verb) == each.verb
    ]
    if not kinds:
        raise RecordError(f"the {MANIFEST} of {place} is not that of a run of mrwork; {give}")
    if wanted is not None and wanted not in kinds:
        raise RecordError(
            f"{place} is a run of `mrwork {kinds[0].verb}`, where one of {verbs[0]} was expected; give the folder of "
            "one, or read this one back with `mr.load`"
        )
    return wanted or (kinds[0] if len(kinds) == 1 else kind_by_files), stated


def _kind_by_files(place: Path) -> RunKind:
    """The kind of a folder, by the files that no other kind has; of a fit where there are none of these."""
    for known in RUN_KINDS:
        others = frozenset().union(*(each.written for each in RUN_KINDS if each is not known))
        if any(exists(place / name) for name in known.written - others):
            return known
    return FIT_RUN


def _no_run(place: Path, give: str) -> str:
    """Why what is at `place` is no run folder, and what to give instead."""
    for around in place.parents[:2]:
        if exists(place) and kind_of(read_manifest_if_whole(around / MANIFEST)):
            return f"{place} is a part of the run {around}; give that folder"
    if is_part(place):
        return f"{place} is the journal of an unfinished run; {_RESUME}"
    if not exists(place):
        part = part_of(place)
        return (
            f"{place} is not written yet, {part} is the journal of its unfinished run; {_RESUME}"
            if is_folder(part)
            else f"{place} does not exist; {give}"
        )
    if not is_folder(place):
        return f"{place} is a file; {give}"
    runs: list[str] = []
    with suppress(OSError):
        runs = sorted(each.name for each in place.iterdir() if is_file(each / MANIFEST))
    if runs:
        return f"{place} holds runs and is none itself; give one of {list_names(runs, _NAMED)} in it"
    return f"{place} is not a run folder, it has no {MANIFEST}; {give}"


def read_manifest_if_whole(manifest: Path) -> Mapping[str, Any]:
    """Content of a manifest; empty where the manifest is damaged."""
    try:
        stated = json_value(text_of(manifest, make_stored_kind("identify", name="the manifest")))
    except (RecordError, ValueError):
        return {}
    return stated if isinstance(stated, Mapping) else {}


def check_manifest(
    place: Path, stated: Mapping[str, Any], facts: Mapping[str, Collection[object]], *, file: str, verb: str
) -> None:
    """Check that a manifest agrees with its results; a manifest with fewer facts is from another version.

    `facts`: the values that an entry may have. `file`, `verb`: name of the results, and what writes both, for messages.
    """
    for name, permitted in facts.items():
        if name in stated and stated[name] not in [finite(value) for value in permitted]:
            shown = repr(stated[name])
            cut = f"{shown[:_SHOWN]}…" if len(shown) > _SHOWN else shown
            raise RecordError(
                escape_text(
                    f"{place / MANIFEST} is of another run than {file} beside it: its {name} is {cut}; "
                    f"restore the one that was written with it, or run `mrwork {verb}` again"
                )
            )
