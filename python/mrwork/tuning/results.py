"""Results of a tuning: settings of each law and its scores on training and test motions; and its folder."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from mrwork.base.arguments import Count, NotNegative, Whole, checked
from mrwork.base.keys import suggestion, toml_text, toml_value
from mrwork.base.labelled import NamedArray, NamedArrays, WithAxes, labels_of, number_labels
from mrwork.base.numbers import apart, counted, format_rounded, percent, with_decimals
from mrwork.base.plotted import Plots
from mrwork.base.summary import Summarised, Summary, list_names
from mrwork.base.table import Table, csv_text
from mrwork.closed_loop.evaluation import Spread, criterion, ties_in_words
from mrwork.control.laws.law_settings import SETTINGS
from mrwork.errors import RecordError, SettingError, UnknownNameError
from mrwork.store.codec import json_document
from mrwork.store.parse import toml_table
from mrwork.store.run_folder import CHOSEN, RESULTS, SCORES_TABLE, STUDY, TUNING_RUN, RunFolder
from mrwork.store.run_writer import RunAtWork
from mrwork.study.placements import placed_document
from mrwork.study.results import RealisationBand
from mrwork.study.study import StudyFile, level_warnings
from mrwork.tuning.space import COMMAND_SLOPE, DEAD_ZONE, LARGEST, SHAPING_SPANS, FreeSetting, LawCandidate

_MARGIN = 0.01
_SAME = 5e-4
# Longest array whose numbers are shown in a line.
_MOST_IN_WORDS = 8
TRAINING_ONLY = (
    "No motion of the study is for testing only: every score is of the motions that the settings were tuned on, and "
    'says nothing about others. Give some motions use = "training" and others use = "test".'
)


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionScore:
    """Score and criteria of a law under one motion, as ratios to passive-off (i = 0)."""

    motion: str
    score: float
    criteria: dict[str, float]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class TuningJudgement(Summarised):
    """Judgement of a law on some motions, in the nominal study.

    `score` is that of a study, whatever is minimised: the mean over motions of peak and rms drift and acceleration over
    those at i = 0. `criteria` is the mean ratio of each
    criterion that has one, `largest` the largest value of the others. `objective` and `violation` are those of the
    tuning, with its risk, and with the realisations where they belong to it. `spread` is that of the score and the
    ratios over motions. `bands` are those of score and ratios, each the mean over motions, over realisations.
    """

    score: float
    objective: float
    violation: float
    criteria: dict[str, float]
    largest: dict[str, float]
    spread: dict[str, Spread]
    motions: tuple[MotionScore, ...]
    energy_error: float
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
    """Number of motions where a law is better than optimal passive, in each criterion and in both."""

    peak_drift: Whole
    peak_acceleration: Whole
    both: Whole
    motions: Whole

    @property
    def in_words(self) -> str:
        """Cell of a table: "2 of 3" motions, of a single one yes or no."""
        if self.motions == 1:
            return "yes" if self.both else "no"
        return f"{self.both} of {self.motions}"


@dataclass(frozen=True, slots=True, kw_only=True)
class TracePoint:
    """The least penalised objective after a number of candidates."""

    candidates: Whole
    least: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignNotes:
    """Sentences on the designed weights of a law, and on its gain: stability margins, a law that asks for no force."""

    weights: tuple[str, ...] = ()
    loop: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LawResult(Summarised):
    """A law with the settings that were chosen for it, or a reference.

    `settings` include the largest command. `origin` says where the settings are from. `test` is `None` where the study
    has no test motions or the tuning was interrupted before. `free` are the free settings with their ranges.
    `certificate` says what is proved of the law, `limited` whether the largest command is one of its settings,
    `design` what its weights and its gain are.
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
    design: DesignNotes = field(default_factory=DesignNotes)

    @property
    def judged(self) -> TuningJudgement:
        """The judgement on the test motions, or on the training motions where there is no other."""
        return self.train if self.test is None else self.test

    @property
    def motion_scores(self) -> list[tuple[str, MotionScore]]:
        """Use and score of every motion that the law was judged on."""
        return [
            (use, motion)
            for use, judgement in (("training", self.train), ("test", self.test))
            for motion in (() if judgement is None else judgement.motions)
        ]

    @property
    def chosen_candidate(self) -> LawCandidate:
        """The settings as a candidate."""
        return _candidate_of(self.settings)


_OF_COMMAND = (LARGEST, *SHAPING_SPANS)


def _part_settings(settings: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Settings of the law itself, and those of the command, which any law has."""
    of_law = {name: value for name, value in settings.items() if name not in _OF_COMMAND}
    return of_law, {name: settings[name] for name in _OF_COMMAND if name in settings}


def _candidate_of(settings: Mapping[str, Any]) -> LawCandidate:
    of_law, of_command = _part_settings(settings)
    return LawCandidate(settings=of_law, **of_command)


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """Dampers by storey, their best constant command, and its scores over the building without dampers.

    A score is the mean over motions of peak and rms drift and acceleration over those without dampers, which do not
    depend on the placement; `test` is `None` where it was not judged. `given` says that the study has its dampers so.
    `storeys` has the number of [[damper]] in each, of which each is `count` dampers.
    """

    storeys: dict[str, Whole]
    command: float
    train: float
    test: float | None = None
    given: bool = False
    count: Count = 1

    @property
    def in_words(self) -> str:
        """Where the dampers are, as in "2 in storey 1, 1 in storey 3"."""
        return ", ".join(f"{self.count * number} in {name}" for name, number in self.storeys.items())


@dataclass(frozen=True, slots=True, kw_only=True)
class FrontPoint:
    """A point of a Pareto front: its objectives on the training and on the test motions, settings and certificate."""

    settings: dict[str, Any]
    train: dict[str, float]
    test: dict[str, float] | None
    certificate: str

    @property
    def candidate(self) -> LawCandidate:
        """The settings as a candidate."""
        return _candidate_of(self.settings)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Front(WithAxes, Summarised):
    """The Pareto front of a law over several objectives.

    Its arrays are `train` and `test` over point and objective, and the settings that are numbers over point.
    """

    _made_by: ClassVar[str] = "mr.tune(study).fronts"

    law: str
    label: str
    objectives: tuple[str, ...]
    points: tuple[FrontPoint, ...]
    candidates: Whole

    @checked
    def pick(self, weights: Mapping[str, NotNegative] | None = None) -> FrontPoint:
        """The point with the least weighted sum of the objectives on the training motions; equal weights by default.

        `weights` are by objective, 0 for those that are not named; one alone picks the end of the front.
        """
        given = dict.fromkeys(self.objectives, 1.0) if weights is None else dict(weights)
        for name in given:
            if name not in self.objectives:
                near = suggestion(name, self.objectives, otherwise="it has")
                raise UnknownNameError(f"the front of {self.label} has no objective {name!r}{near}")
        if not self.points:
            raise SettingError(f"the front of {self.label} has no points; tune with a larger budget")
        return min(
            self.points, key=lambda point: sum(weight * point.train[name] for name, weight in given.items())
        )

    @property
    def plot(self) -> Plots[Front]:
        """Figure of the front, see `mr.plots`."""
        return Plots(self)

    def _named_arrays(self) -> NamedArrays:
        arrays = {}
        for use in ("train", "test"):
            values = [getattr(point, use) or {} for point in self.points]
            rows = [[given.get(name, math.nan) for name in self.objectives] for given in values]
            arrays[use] = NamedArray.of(
                np.array(rows).reshape(len(self.points), len(self.objectives)),
                *("point", "objective"),
                unit="1",
                long_name=f"objective on the {use}ing motions over its reference",
            )
        return NamedArrays(
            title=f"Front of {self.label}",
            rows=("point",),
            labels={"point": number_labels(len(self.points)), "objective": labels_of(self.objectives)},
            arrays=arrays,
            along=_setting_arrays([point.settings for point in self.points], "point"),
        )


def _setting_arrays(settings: Sequence[Mapping[str, Any]], axis: str) -> dict[str, NamedArray]:
    """Arrays of the settings that are always numbers; NaN where one is not given."""
    names = dict.fromkeys(name for given in settings for name in given)
    columns = {name: [given.get(name) for given in settings] for name in names}
    return {
        name: NamedArray.of(values, axis, long_name="setting")
        for name, values in columns.items()
        if all(one is None or (isinstance(one, int | float) and not isinstance(one, bool)) for one in values)
    }


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class TuningResults(WithAxes, Summarised):
    """Results of a tuning: laws with the chosen settings, references, and Pareto fronts.

    Its arrays are `score` and the ratio of every criterion to that at i = 0 over law and motion, laws before
    references, training before test motions, NaN where a law was not judged; with the use of each motion, and the
    settings of each law that are numbers. `places` are placements of the dampers, the best first, at which the laws are
    tuned. `seconds_outside` is the time outside the simulation [s]: design of gains, search, scores.
    `study_warnings` are those of the study, `damper_warnings` sentences on demand of the tuned laws outside the tested
    ranges of the dampers; `design_levels` are the levels of the motions that laws are tuned on, where the study names
    one or its records have several.
    """

    _made_by: ClassVar[str] = "mr.tune(study)"

    title: str
    status: Literal["finished", "interrupted"]
    laws: tuple[LawResult, ...]
    references: tuple[LawResult, ...]
    training: tuple[str, ...]
    testing: tuple[str, ...]
    command_unit: str
    realisations: Whole
    fronts: tuple[Front, ...] = ()
    places: tuple[Placement, ...] = ()
    seconds: NotNegative = 0.0
    candidates_per_second: NotNegative = 0.0
    seconds_outside: NotNegative = 0.0
    facts: tuple[tuple[str, str], ...] = ()
    study_warnings: tuple[str, ...] = ()
    damper_warnings: tuple[str, ...] = ()
    design_levels: tuple[str, ...] = ()

    @property
    def ranked(self) -> tuple[LawResult, ...]:
        """Laws and references, the lowest score on the test motions first, else on the training motions."""
        return tuple(sorted((*self.laws, *self.references), key=lambda law: law.judged.score))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences on undamped modes, demand out of tested ranges, what scores cannot say, and exceeded limits."""
        sentences = [
            *self.study_warnings,
            *level_warnings(self.design_levels),
            *self.damper_warnings,
            *(() if self.testing else (TRAINING_ONLY,)),
        ]
        for law in self.laws:
            if law.train.violation > 0.0:
                sentences.append(
                    f"{law.label}: no candidate keeps all limits; the chosen one exceeds them by "
                    f"{percent(law.train.violation, 0)} % of the limits in all, on the training motions."
                )
            elif law.test is not None and law.test.violation > 0.0:
                sentences.append(
                    f"{law.label} keeps its limits on the training motions and exceeds them by "
                    f"{percent(law.test.violation, 0)} % of the limits in all on the test motions."
                )
            sentences += self._reference_ahead_of(law)
            sentences += [
                f"{law.label}: {name} is at {place} bound of its range; widen it with free."
                for name, place in _settings_at_bounds(law)
            ]
        return tuple(sentences)

    @property
    def designs(self) -> tuple[tuple[tuple[str, ...], tuple[str, ...]], ...]:
        """Sentences of each design of weights once, with the labels of the laws and references that have it."""
        labels_of_design: dict[tuple[str, ...], list[str]] = {}
        for law in self.ranked:
            if law.design.weights:
                labels_of_design.setdefault(law.design.weights, []).append(law.label)
        return tuple((tuple(labels), sentences) for sentences, labels in labels_of_design.items())

    @property
    def findings(self) -> tuple[str, ...]:
        """Sentences on laws that are a constant command in effect, and on scores that motions do not tell apart."""
        constants = [law for law in self.references if SETTINGS[law.law].constant]
        in_effect = tuple(
            f"{law.label} has the response of {constant.label} under every motion: it is that in effect."
            for law in self.ranked
            if not SETTINGS[law.law].constant
            for constant in constants
            if _same_response(law.judged, constant.judged)
        )
        finished = [law for law in self.ranked if law.judged.motions]
        if not finished or len(finished[0].judged.motions) < 2:
            return in_effect
        scores = {law.label: [motion.score for motion in law.judged.motions] for law in finished}
        first = finished[0].label
        return (*in_effect, *ties_in_words(first, scores.pop(first), scores))

    @property
    def plot(self) -> Plots[TuningResults]:
        """Figure of the front, see `mr.plots`."""
        return Plots(self)

    def _named_arrays(self) -> NamedArrays:
        judged = (*self.laws, *self.references)
        scores = [
            {(use, score.motion): {"score": score.score} | score.criteria for use, score in law.motion_scores}
            for law in judged
        ]
        # A study without test motions has each of its motions once.
        columns = list(dict.fromkeys(key for of_law in scores for key in of_law))
        names = dict.fromkeys(
            ["score", *(name for of_law in scores for values in of_law.values() for name in values)]
        )

        def over_axes(name: str) -> NamedArray:
            numbers = [[of_law.get(key, {}).get(name, math.nan) for key in columns] for of_law in scores]
            array = np.array(numbers).reshape(len(judged), len(columns))
            title = name if name == "score" else criterion(name).title
            return NamedArray.of(array, *axes, unit="1", long_name=f"{title}, over that at i = 0")

        axes = ("law", "motion")
        return NamedArrays(
            title=f"Tuning of {self.title}",
            rows=axes,
            labels={
                "law": labels_of([law.label for law in judged]),
                "motion": labels_of([motion for _, motion in columns]),
            },
            along={"use": NamedArray.of([use for use, _ in columns], "motion", long_name="use of the motion")}
            | _setting_arrays([law.settings for law in judged], "law"),
            arrays={name: over_axes(name) for name in names},
        )

    def _reference_ahead_of(self, law: LawResult) -> list[str]:
        best = min(self.references, key=lambda reference: reference.judged.score, default=None)
        if best is None or not math.isfinite(law.judged.score) or best.judged.score >= law.judged.score:
            return []
        on = "test" if law.test is not None else "training"
        both = " against ".join(apart(with_decimals, law.judged.score, best.judged.score, 3))
        return [f"{law.label} does not reach the score of {best.label} on the {on} motions ({both})."]

    def _summary(self) -> Summary:
        return Summary(
            title=f"Tuning of {self.title}: {self.status}",
            facts=(
                ("training motions", list_names(self.training)),
                ("test motions", list_names(self.testing) or "none"),
                ("candidates", f"{self.candidates_per_second:.3g} a second"),
                *(("best placement", each.in_words) for each in self.places[:1]),
            ),
            columns=("law", "training", "test", "settings"),
            rows=[
                (
                    law.label,
                    with_decimals(law.train.score, 4),
                    "-" if law.test is None else with_decimals(law.test.score, 4),
                    settings_in_words(law.settings, self.command_unit),
                )
                for law in self.ranked
            ],
            notes=[f"warning: {warning}" for warning in self.warnings],
        )


# Placements that are listed, beside that of the study.
_LISTED = 10


def places_table(results: TuningResults) -> Table | None:
    """The best placements of the dampers and that of the study; `None` where none were compared."""
    ranked = enumerate(results.places, start=1)
    shown = [(number, each) for number, each in ranked if number <= _LISTED or each.given]
    if not shown:
        return None
    return Table(
        title=f"{counted(len(results.places), 'placement')} of the dampers, each with its best constant command: score "
        "over the building without dampers",
        columns=("", "Dampers", "Command", "Training", "Test"),
        rows=tuple(
            (
                str(number),
                each.in_words + (" (the study)" if each.given else ""),
                f"{each.command:.3g} {results.command_unit}",
                with_decimals(each.train, 3),
                "-" if each.test is None else with_decimals(each.test, 3),
            )
            for number, each in shown
        ),
        words=(1,),
        note="Laws are tuned at the first.",
    )


def motions_in_words(results: TuningResults) -> str:
    """The motions of a tuning, such as "1 training motion and 2 test motions"."""
    training = counted(len(results.training), "training motion")
    return f"{training} and {counted(len(results.testing), 'test motion')}" if results.testing else training


def speed_in_words(results: TuningResults) -> str:
    """Candidates per second, and what the time went into."""
    share = percent(results.seconds_outside / results.seconds if results.seconds else 0.0, 0)
    return (
        f"{results.candidates_per_second:.3g} candidates a second; design of gains, search and scores took {share} % "
        "of the time, simulations the rest"
    )


def _same_response(one: TuningJudgement, other: TuningJudgement) -> bool:
    """Whether two rows have the same ratios under every motion, to three decimals as tables show them."""
    pairs = list(zip(one.motions, other.motions, strict=False))
    return bool(pairs) and all(
        abs(first.criteria[name] - second.criteria.get(name, math.inf)) <= _SAME
        for first, second in pairs
        for name in first.criteria
    )


def _settings_at_bounds(law: LawResult) -> list[tuple[str, str]]:
    """Free settings, other than the largest command, at a bound of their range, and which bound."""
    at_ends = []
    for setting in law.free:
        value = law.settings.get(setting.name)
        if setting.name == LARGEST or not isinstance(value, int | float):
            continue
        place = setting.unit(value)
        if place is not None and not _MARGIN < place < 1.0 - _MARGIN:
            at_ends.append((setting.name, "the lower" if place <= _MARGIN else "the upper"))
    return at_ends


def settings_in_words(settings: Mapping[str, Any], command_unit: str) -> str:
    """Settings in one line, those of the command last."""
    of_law, of_command = _part_settings(settings)
    parts = [f"{name} {_value(value)}" for name, value in of_law.items()]
    words = {
        LARGEST: ("at most", command_unit),
        DEAD_ZONE: ("dead zone", "m/s"),
        COMMAND_SLOPE: ("slope at most", f"{command_unit}/s"),
    }
    for name, value in of_command.items():
        word, unit = words[name]
        parts.append(f"{word} {format_rounded(value)} {unit}")
    return ", ".join(parts)


def _value(value: Any) -> str:
    if value is None or isinstance(value, str):
        return value or "-"
    if isinstance(value, int | float):
        return format_rounded(float(value))
    if isinstance(value, Mapping):
        return f"({', '.join(f'{name} {_value(item)}' for name, item in value.items())})"
    if len(value) > _MOST_IN_WORDS:
        return f"{len(value)} numbers"
    return f"[{', '.join(_value(item) for item in value)}]"


def write_tuning(
    work: RunAtWork,
    results: TuningResults,
    *,
    study_file: StudyFile,
    manifest: Mapping[str, object],
) -> None:
    """Commit the folder of a tuning without its page, in place of an earlier one."""
    contents = {
        RESULTS: json_document(tuning_document(results)),
        SCORES_TABLE: _scores_csv(results),
        CHOSEN: chosen_study(results, study_file),
    }
    work.commit(
        {STUDY: study_file.content} | {name: text.encode() for name, text in contents.items()},
        manifest,
        flush=results.status == "finished",
    )


@checked
def read_tuning(folder: str | Path) -> TuningResults:
    """Read the results of a tuning back from its folder, as `mr.load` does.

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
    results = RunFolder.open(folder, TUNING_RUN).read(TuningResults, RESULTS)
    if results is None:
        raise RecordError(f"{folder} has no {RESULTS}; run `mrwork tune` again")
    return results


def tuning_document(results: TuningResults) -> dict[str, Any]:
    """The results as a JSON object."""
    return {**asdict(results), "warnings": results.warnings, "findings": results.findings}


def chosen_study(results: TuningResults, study_file: StudyFile) -> str:
    """The study file with the chosen settings of each law as further controllers.

    The text of the study stays; names of files in it are relative to its own folder.
    """
    text = study_file.text
    if results.places:
        text = toml_text(placed_document(toml_table(text), results.places[0].storeys))
    blocks = [_controller(law) for law in results.laws]
    folder = study_file.path.parent / toml_table(text).get("folder", "")
    head = (
        f"# The study {study_file.path.name} with the settings that mrwork tune has chosen; for mrwork respond.\n"
        f"folder = {toml_value(str(folder))} # of the files that the study names\n\n"
    )
    return head + _without_folder(text).rstrip() + "\n\n# Chosen by mrwork tune.\n\n" + "\n".join(blocks)


def _without_folder(text: str) -> str:
    """Text of the study without its key `folder`, which stands before the first table."""
    first = re.search(r"^\s*\[", text, flags=re.MULTILINE)
    end = len(text) if first is None else first.start()
    return re.sub(r"^[ \t]*folder[ \t]*=.*\n?", "", text[:end], flags=re.MULTILINE) + text[end:]


def _controller(law: LawResult) -> str:
    settings, of_command = _part_settings(law.settings)
    if not law.limited:
        of_command.pop(LARGEST, None)
    own = {"law": law.law, "label": law.label, **({"settings": settings} if settings else {})}
    return toml_text({"controller": [own | of_command]})


def _scores_csv(results: TuningResults) -> str:
    names = [name for law in results.references[:1] for name in law.train.criteria]
    lines = [["law", "use", "motion", "score", *names]]
    for law in (*results.laws, *results.references):
        for use, score in law.motion_scores:
            numbers = [f"{number:.9g}" for number in (score.score, *(score.criteria[name] for name in names))]
            lines.append([law.label, use, score.motion, *numbers])
    return csv_text(lines)
