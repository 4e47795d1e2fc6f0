"""Results of a tuning: settings of each law and its scores on training and test motions; references alike."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import NotNegative, Whole
from mrwork.closed_loop.evaluation import SCORE, Spread, criteria
from mrwork.store.record import OrInfinite, OrNan, Related
from mrwork.study.batches import Band, RunCriteria
from mrwork.summary import Summarised, Summary, listed, rounded, with_decimals
from mrwork.tuning.objective import Objective, over
from mrwork.tuning.problem import Bench
from mrwork.tuning.space import LARGEST, Candidate, FreeSetting

Floats = NDArray[np.float64]

_MARGIN = 0.01
# Longest array whose numbers are shown in a line.
_MOST_IN_WORDS = 8
# That of a study, whatever a table minimises, so that all laws are compared by one number.
_SCORE = Objective(weights=dict.fromkeys(SCORE, 1.0))
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
class Judgement(Summarised):
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
    bands: dict[str, Band] = field(default_factory=dict)


def unjudged(objective: float) -> Judgement:
    """The judgement of an interrupted tuning, of which only the objective is known."""
    return Judgement(
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
    train: Judgement
    test: Judgement | None
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
    def chosen(self) -> Candidate:
        """The settings as a candidate."""
        settings = dict(self.settings)
        return Candidate(largest_command=settings.pop(LARGEST), settings=settings)

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
        return tuple(sorted((*self.laws, *self.references), key=lambda each: _judged(each).score))

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
                f"{each.label}: {name} is at {place} end of its range; widen it with free."
                for name, place in _at_ends(each)
            ]
        return tuple(found)

    def _overtaken(self, law: LawResult) -> list[str]:
        best = min((each for each in self.references), key=lambda each: _judged(each).score, default=None)
        if best is None or not math.isfinite(_judged(law).score) or _judged(best).score >= _judged(law).score:
            return []
        on = "test" if law.test is not None else "training"
        return [
            f"{law.label} does not reach the score of {best.label} on the {on} motions "
            f"({_judged(law).score:.3f} against {_judged(best).score:.3f})."
        ]

    def _summary(self) -> Summary:
        return Summary(
            title=f"Tuning of {self.title}: {self.status}",
            facts=(
                ("training motions", listed(self.training)),
                ("test motions", listed(self.testing) or "none"),
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


def _judged(law: LawResult) -> Judgement:
    return law.train if law.test is None else law.test


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
        parts.append(f"at most {rounded(settings[LARGEST])} {command_unit}")
    return ", ".join(parts)


def _value(value: Any) -> str:
    if value is None or isinstance(value, str):
        return value or "-"
    if isinstance(value, int | float):
        return rounded(float(value))
    if isinstance(value, Mapping):
        return f"({', '.join(f'{name} {_value(each)}' for name, each in value.items())})"
    if len(value) > _MOST_IN_WORDS:
        return f"{len(value)} numbers"
    return f"[{', '.join(_value(each) for each in value)}]"


@dataclass(frozen=True, slots=True, kw_only=True)
class Varied:
    """A bench with realisations, and the criteria of a candidate on it."""

    bench: Bench
    found: RunCriteria


def judged(
    bench: Bench, objective: Objective, found: RunCriteria, varied: Varied | None, *, robust: bool
) -> Judgement:
    """The judgement of one candidate.

    Parameters
    ----------
    found
        Its criteria on the bench, of one realisation: the nominal study.
    varied
        The same with realisations, if the study has any.
    robust
        Whether the objective takes the realisations.
    """
    ratios = _ratios(found, bench.passive)
    names = [motion.name for motion in bench.motions]
    per_motion = {name: values[0, :, 0] for name, values in ratios.items()}
    value_of, on = found, bench
    if varied is not None and robust:
        value_of, on = varied.found, varied.bench
    scores = objective.run_scores(value_of, on.baseline(objective))
    numbers = {name: float(values.mean()) for name, values in per_motion.items()}
    return Judgement(
        score=numbers.pop("score"),
        objective=float(objective.value(scores)[0]),
        violation=_finite(float(objective.violation(value_of)[0])),
        criteria=numbers,
        largest={entry.name: float(found.of(entry.name)[0].max()) for entry in criteria() if not entry.ratio},
        spread={name: Spread.of(values.tolist()) for name, values in per_motion.items()},
        motions=tuple(
            MotionScore(
                motion=name,
                score=float(per_motion["score"][number]),
                criteria={each: float(v[number]) for each, v in per_motion.items() if each != "score"},
            )
            for number, name in enumerate(names)
        ),
        energy_error=float(found.energy_error.max()),
        bands={} if varied is None else _bands(_ratios(varied.found, varied.bench.passive)),
    )


def _finite(value: float) -> float:
    return value if math.isfinite(value) else math.inf


def _ratios(found: RunCriteria, passive: RunCriteria) -> dict[str, Floats]:
    """Score and ratios to i = 0 of each run, shape (n_candidates, n_motions, n_realisations)."""
    ratios = {"score": _SCORE.run_scores(found, passive)}
    return ratios | {
        entry.name: over(found.of(entry.name), passive.of(entry.name)) for entry in criteria() if entry.ratio
    }


def _bands(ratios: Mapping[str, Floats]) -> dict[str, Band]:
    """Bands of the means over motions."""
    return {name: Band.of(values[0].mean(axis=0)) for name, values in ratios.items()}


def compared_to(law: Judgement, constant: Judgement) -> Better:
    """How often a law is better than a constant command, motion by motion."""
    pairs: Sequence[tuple[MotionScore, MotionScore]] = list(zip(law.motions, constant.motions, strict=True))

    def lower(name: str) -> list[bool]:
        return [one.criteria[name] < other.criteria[name] for one, other in pairs]

    drift, acceleration = lower("peak_drift"), lower("peak_acceleration")
    both = [one and other for one, other in zip(drift, acceleration, strict=True)]
    return Better(
        peak_drift=sum(drift), peak_acceleration=sum(acceleration), both=sum(both), motions=len(pairs)
    )
