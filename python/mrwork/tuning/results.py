"""Results of a tuning: settings of each law and its scores on training and test motions; and its folder."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

from mrwork.arguments import NotNegative, Whole, checked
from mrwork.closed_loop.evaluation import Spread
from mrwork.errors import RecordError
from mrwork.numbers import format_rounded, with_decimals
from mrwork.store.codec import OrInfinite, OrNan, Related, finite, json_document, read_document
from mrwork.store.output_folder import Destination, write_folder
from mrwork.store.parse import toml_table
from mrwork.store.run_folder import (
    CHOSEN,
    JOURNAL,
    REPORT,
    RESULTS,
    SCORES_TABLE,
    STUDY,
    TUNING_RUN,
    check_manifest,
    read_manifest,
)
from mrwork.study.results import RealisationBand
from mrwork.study.study import StudyFile
from mrwork.summary import Summarised, Summary, list_names
from mrwork.table import csv_text
from mrwork.tuning.space import LARGEST, FreeSetting, LawCandidate

_MARGIN = 0.01
# Longest array whose numbers are shown in a line.
_MOST_IN_WORDS = 8
TRAINING_ONLY = (
    "No motion of the study is for testing only: every score is of the motions that the settings were tuned on, and "
    'says nothing about others. Give some motions use = "training" and others use = "test".'
)


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionScore:
    """Score and criteria of a law under one motion, over those at i = 0."""

    motion: str
    score: OrNan
    criteria: dict[str, OrNan]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class TuningJudgement(Summarised):
    """A law on some motions, in the nominal study.

    `score` is that of a study, whatever is minimised: the mean over motions of peak and rms drift and acceleration over
    those at i = 0. `criteria` is the mean ratio of each
    criterion that has one, `largest` the largest value of the others. `objective` and `violation` are those of the
    tuning, with its risk, and with the realisations where they belong to it. `spread` is that of the score and the
    ratios over motions. `bands` are those of score and ratios, each the mean over motions, over realisations.
    """

    score: OrNan
    objective: OrInfinite
    violation: OrInfinite
    criteria: dict[str, OrNan]
    largest: dict[str, OrInfinite]
    spread: dict[str, Spread]
    motions: tuple[MotionScore, ...]
    energy_error: OrNan
    bands: dict[str, RealisationBand] = field(default_factory=dict)


def judgement_of_objective(objective: float) -> TuningJudgement:
    """The judgement of an interrupted tuning, of which only the objective is known."""
    return TuningJudgement(
        score=math.nan,
        objective=objective,
        violation=0.0,
        criteria={},
        largest={},
        spread={},
        motions=(),
        energy_error=math.nan,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Better:
    """Under how many motions a law is better than the best constant command, in each criterion and in both."""

    peak_drift: Whole
    peak_acceleration: Whole
    both: Whole
    motions: Whole


@dataclass(frozen=True, slots=True, kw_only=True)
class TracePoint:
    """The least penalised objective after a number of candidates."""

    candidates: Whole
    least: OrInfinite


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LawResult(Summarised, Related):
    """A law with the settings that were chosen for it, or a reference.

    `settings` include the largest command. `origin` says where the settings are from. `test` is `None` where the study
    has no test motions or the tuning was interrupted before. `free` are the free settings with their ranges.
    `certificate` says what is proved of the law, `limited` whether the largest command is one of its settings.
    """

    law: str
    label: str
    settings: dict[str, Any]
    origin: str
    train: TuningJudgement
    test: TuningJudgement | None
    candidates: Whole
    seconds: NotNegative
    certificate: str
    limited: bool = False
    refused: Whole = 0
    objective: str = ""
    better: Better | None = None
    free: tuple[FreeSetting, ...] = ()
    trace: tuple[TracePoint, ...] = ()

    @property
    def judged(self) -> TuningJudgement:
        """The judgement on the test motions, or on the training motions where there is no other."""
        return self.train if self.test is None else self.test

    @property
    def chosen_candidate(self) -> LawCandidate:
        """The settings as a candidate."""
        settings = dict(self.settings)
        return LawCandidate(largest_command=settings.pop(LARGEST), settings=settings)

    def disagreement(self) -> str:
        """Whether the largest command is a number, and is there where it is one of the settings."""
        if LARGEST not in self.settings:
            return f"{self.label} has no {LARGEST} among its settings" if self.limited else ""
        value = self.settings[LARGEST]
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        return "" if is_number else f"{LARGEST} of {self.label} is not a number"


@dataclass(frozen=True, slots=True, kw_only=True)
class FrontPoint:
    """A point of a Pareto front: its objectives on the training and on the test motions, settings and certificate."""

    settings: dict[str, Any]
    train: dict[str, OrInfinite]
    test: dict[str, OrInfinite] | None
    certificate: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Front:
    """The Pareto front of a law over several objectives."""

    law: str
    label: str
    objectives: tuple[str, ...]
    points: tuple[FrontPoint, ...]
    candidates: Whole


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class TuningResults(Summarised):
    """What `tune` found.

    `share_outside` is the share of the time outside the simulation: design of gains, search, scores.
    `building_warnings` are sentences on modes of the building without damping or stiffness, `damper_warnings` on
    demand of the tuned laws outside the tested ranges of the dampers.
    """

    title: str
    status: Literal["finished", "interrupted"]
    laws: tuple[LawResult, ...]
    references: tuple[LawResult, ...]
    training: tuple[str, ...]
    testing: tuple[str, ...]
    command_unit: str
    realisations: Whole
    fronts: tuple[Front, ...] = ()
    seconds: NotNegative = 0.0
    candidates_per_second: NotNegative = 0.0
    share_outside: OrNan = 0.0
    facts: tuple[tuple[str, str], ...] = ()
    building_warnings: tuple[str, ...] = ()
    damper_warnings: tuple[str, ...] = ()

    @property
    def ranked(self) -> tuple[LawResult, ...]:
        """Laws and references, the lowest score on the test motions first, else on the training motions."""
        return tuple(sorted((*self.laws, *self.references), key=lambda each: each.judged.score))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences on undamped modes, demand out of tested ranges, what scores cannot say, and exceeded limits."""
        found = [*self.building_warnings, *self.damper_warnings, *(() if self.testing else (TRAINING_ONLY,))]
        for each in self.laws:
            if each.train.violation > 0.0:
                found.append(
                    f"{each.label}: no candidate keeps all limits; the chosen one exceeds them by "
                    f"{each.train.violation:.0%} of the limits in all, on the training motions."
                )
            elif each.test is not None and each.test.violation > 0.0:
                found.append(
                    f"{each.label} keeps its limits on the training motions and exceeds them by "
                    f"{each.test.violation:.0%} of the limits in all on the test motions."
                )
            found += self._overtaken(each)
            found += [
                f"{each.label}: {name} is at {place} bound of its range; widen it with free."
                for name, place in _at_ends(each)
            ]
        return tuple(found)

    def _overtaken(self, law: LawResult) -> list[str]:
        best = min((each for each in self.references), key=lambda each: each.judged.score, default=None)
        if best is None or not math.isfinite(law.judged.score) or best.judged.score >= law.judged.score:
            return []
        on = "test" if law.test is not None else "training"
        return [
            f"{law.label} does not reach the score of {best.label} on the {on} motions "
            f"({law.judged.score:.3f} against {best.judged.score:.3f})."
        ]

    def _summary(self) -> Summary:
        return Summary(
            title=f"Tuning of {self.title}: {self.status}",
            facts=(
                ("training motions", list_names(self.training)),
                ("test motions", list_names(self.testing) or "none"),
                ("candidates", f"{self.candidates_per_second:.3g} a second"),
            ),
            columns=("law", "training", "test", "settings"),
            rows=[
                (
                    each.label,
                    with_decimals(each.train.score, 4),
                    "-" if each.test is None else with_decimals(each.test.score, 4),
                    settings_in_words(each.settings, self.command_unit),
                )
                for each in self.ranked
            ],
            notes=[f"warning: {each}" for each in self.warnings],
        )


def _at_ends(law: LawResult) -> list[tuple[str, str]]:
    """Free settings, other than the largest command, at an end of their range."""
    found = []
    for each in law.free:
        value = law.settings.get(each.name)
        if each.name == LARGEST or not isinstance(value, int | float):
            continue
        place = each.unit(value)
        if place is not None and not _MARGIN < place < 1.0 - _MARGIN:
            found.append((each.name, "the lower" if place <= _MARGIN else "the upper"))
    return found


def settings_in_words(settings: Mapping[str, Any], command_unit: str) -> str:
    """Settings in one line, the largest command last."""
    parts = [f"{name} {_value(value)}" for name, value in settings.items() if name != LARGEST]
    if LARGEST in settings:
        parts.append(f"at most {format_rounded(settings[LARGEST])} {command_unit}")
    return ", ".join(parts)


def _value(value: Any) -> str:
    if value is None or isinstance(value, str):
        return value or "-"
    if isinstance(value, int | float):
        return format_rounded(float(value))
    if isinstance(value, Mapping):
        return f"({', '.join(f'{name} {_value(each)}' for name, each in value.items())})"
    if len(value) > _MOST_IN_WORDS:
        return f"{len(value)} numbers"
    return f"[{', '.join(_value(each) for each in value)}]"


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
    names = [name for each in results.references[:1] for name in each.train.criteria]
    lines = [["law", "use", "motion", "score", *names]]
    for law in (*results.laws, *results.references):
        for use, found in (("training", law.train), ("test", law.test)):
            lines += _lines(law, use, found, names)
    return csv_text(lines)


def _lines(law: LawResult, use: str, found: TuningJudgement | None, names: Sequence[str]) -> list[list[str]]:
    return [
        [law.label, use, each.motion, f"{each.score:.9g}", *(f"{each.criteria[name]:.9g}" for name in names)]
        for each in (() if found is None else found.motions)
    ]
