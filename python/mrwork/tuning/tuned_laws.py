"""What a tuning has found: settings of each law with how they were searched, references, fronts and placements."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final, Literal

import numpy as np

from mrwork.base.arguments import Count, NotNegative, Whole, checked
from mrwork.base.keys import check_known
from mrwork.base.labelled import NamedArray, NamedArrays, WithAxes, columns_of
from mrwork.base.numbers import (
    NOTHING,
    counted,
    duration_in_words,
    format_rounded,
    significant,
    with_decimals,
)
from mrwork.base.plotted import Plotted
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary, list_names
from mrwork.base.table import Column, Table
from mrwork.buildings.groups import BOTH_UNITS
from mrwork.errors import SettingError
from mrwork.study.damper_size import BEST_AT_LARGEST
from mrwork.study.row_kinds import Kind
from mrwork.tuning.space import (
    COMMAND_SLOPE,
    DEAD_ZONE,
    LARGEST,
    FreeSetting,
    LawCandidate,
    TuningObjective,
    is_last,
)

_MARGIN = 0.01
# Longest array whose numbers are shown in a line.
_MOST_IN_WORDS = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class TracePoint:
    """The least penalised objective after a number of candidates."""

    candidates: Whole
    least: float


_NO_LAW: Final = RemarkKind(
    "candidates_failed", "{0}: none of {count} makes a law that can be simulated", warns=True
)
_LIMITS_UNMET: Final = RemarkKind(
    "limits_unmet",
    "{0}: no candidate keeps all limits; on the training motions the chosen one exceeds them by {percent} % in all",
    warns=True,
)
_AT_BOUND: Final = RemarkKind(
    "settings_at_bound", "{0}: at the {1} bound of the range: {names}", "widen the range with free"
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class TunedLaw(Summarised):
    """A law with the settings that were chosen for it on the training motions, or a reference.

    `kind` is what it is as a row of a study. `settings` include the largest command and its shape. `origin` says where
    they are from. `least` is the value of the `objective` with these settings, over the realisations where it is
    `robust`, and `violation` by how much they exceed its limits, relative to these. `free` are the free settings with
    their ranges, `refused` is the number of first candidates that could not be simulated, and `certificate` says what
    is proved of the law.
    """

    _made_by: ClassVar[str] = "mr.tune(study).laws"

    law: str
    label: str
    kind: Kind = "controller"
    settings: dict[str, Any]
    origin: str
    objective: TuningObjective
    robust: bool = False
    least: float
    violation: float = 0.0
    candidates: Whole
    seconds: NotNegative = 0.0
    certificate: str = ""
    refused: Whole = 0
    free: tuple[FreeSetting, ...] = ()
    trace: tuple[TracePoint, ...] = ()

    @property
    def candidate(self) -> LawCandidate:
        """The chosen settings as a candidate, which tells those of the law from those of the command."""
        return LawCandidate(self.settings)

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """On limits that no candidate keeps, and on free settings at a bound beyond which their range may go."""
        return tuple(self._remarks())

    def _remarks(self) -> Iterator[Remark]:
        if not math.isfinite(self.least):
            yield _NO_LAW.remark(self.label, count=counted(self.candidates, "candidate"))
        elif self.violation > 0.0:
            percent, measured = significant(100.0 * self.violation, 2), Measured(self.violation, "")
            yield _LIMITS_UNMET.remark(self.label, measured=measured, percent=percent)
        ends: dict[str, list[str]] = {}
        for setting in self.free:
            value = self.settings.get(setting.name)
            at = setting.unit(value) if isinstance(value, int | float) else None
            is_free = setting.name != LARGEST and not is_last(self.law, setting, at or 0.0)
            if is_free and at is not None and not _MARGIN < at < 1.0 - _MARGIN:
                ends.setdefault("lower" if at <= _MARGIN else "upper", []).append(setting.name)
        for end, names in ends.items():
            yield _AT_BOUND.remark(self.label, end, *names, names=", ".join(names))


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """Dampers by storey, their best constant command, and its scores over the building without dampers.

    A score is the mean over motions of the criteria of the study's score over those without dampers, which do not
    depend on the placement; `test` is `None` where no motion is held out. `given` says that the study has them so.
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
    """A point of a Pareto front: its objectives on the training motions, settings and certificate.

    `test` are its objectives on the test motions, `None` until the study has judged it; see `judge`.
    """

    settings: dict[str, Any]
    train: dict[str, float]
    certificate: str
    test: dict[str, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Front(Plotted, WithAxes, Summarised):
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
        factors = dict.fromkeys(self.objectives, 1.0) if weights is None else dict(weights)
        for name in factors:
            sentence = f"the front of {self.label} has no objective {name!r}"
            check_known(name, self.objectives, sentence, otherwise="it has")
        if not self.points:
            raise SettingError(f"the front of {self.label} has no points; tune with a larger budget")
        return min(
            self.points, key=lambda point: sum(weight * point.train[name] for name, weight in factors.items())
        )

    def _named_arrays(self) -> NamedArrays:
        arrays = {}
        for use in ("train", "test"):
            values = [getattr(point, use) or {} for point in self.points]
            rows = [[scores.get(name, math.nan) for name in self.objectives] for scores in values]
            arrays[use] = NamedArray.of(
                np.array(rows).reshape(len(self.points), len(self.objectives)),
                *("point", "objective"),
                unit="1",
                long_name=f"objective on the {use}ing motions over its reference",
            )
        return NamedArrays(
            title=f"Front of {self.label}",
            rows=("point",),
            labels={
                "point": NamedArray.of(range(len(self.points))),
                "objective": NamedArray.of(self.objectives),
            },
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
class TuningResults(Plotted, WithAxes, Summarised):
    """What `tune` has chosen on the training motions: laws with their settings, references, and Pareto fronts.

    The study judges them, see `judge`. The arrays are `least`, `violation`, the number of candidates, and the settings
    that are numbers, over law, laws before references. `training` are the names of the motions. `places` are placements
    of the dampers, the best first, at which the laws are tuned.
    """

    _made_by: ClassVar[str] = "mr.tune(study)"

    title: str
    status: Literal["finished", "interrupted"]
    laws: tuple[TunedLaw, ...]
    references: tuple[TunedLaw, ...]
    training: tuple[str, ...]
    command_unit: str
    fronts: tuple[Front, ...] = ()
    places: tuple[Placement, ...] = ()
    seconds: NotNegative = 0.0

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """On limits that no candidate keeps, on settings at a bound, and on dampers best at the largest command."""
        by_kind = {law.kind: law for law in self.references}
        best, largest = by_kind.get("best_passive"), by_kind.get("passive")
        of_dampers = (
            [BEST_AT_LARGEST.remark(best.label, unless=", unless they lock a storey")]
            if best and largest and best.settings == largest.settings
            else []
        )
        return (*(remark for law in self.laws for remark in law.remarks), *of_dampers)

    @checked
    def is_comparable(self, law: TunedLaw) -> bool:
        """Whether the objective of a law, apart from its limits, is that of all tuned laws.

        References were chosen by the score of a study, or by an objective over i = 0.
        """
        first, *others = (replace(other.objective, limits={}) for other in (law, *self.laws))
        return law in self.laws or all(first == other for other in others)

    def _named_arrays(self) -> NamedArrays:
        laws = (*self.laws, *self.references)
        numbers = (
            Column("least", unit="1", words="objective on the training motions"),
            Column("violation", unit="1", words="excess of the limits, relative to these"),
            Column("candidates", unit="1", words="candidates"),
        )
        return NamedArrays(
            title=f"Tuning of {self.title}",
            rows=("law",),
            labels={"law": NamedArray.of([law.label for law in laws])},
            along=_setting_arrays([law.settings for law in laws], "law"),
            arrays=columns_of(laws, "law", numbers),
        )

    def _summary(self) -> Summary:
        summary = self._found()
        hint = "What the settings are worth on other motions: mr.tuning.judge(study, tuned)."
        return replace(summary, remarks=self.remarks, notes=(*summary.notes, hint))

    def _found(self) -> Summary:
        """The summary without what the judging study says, too: remarks, and what the settings are worth."""
        places = [places_table(self)] if self.places else []
        columns = (
            Column("label", "law"),
            Column(
                heading="objective",
                of=lambda law: with_decimals(law.least, 4) if self.is_comparable(law) else NOTHING,
            ),
            Column("settings", "settings", shown=lambda given: settings_in_words(given, self.command_unit)),
        )
        return Summary(
            title=f"Tuning of {self.title}: {self.status}",
            facts=(
                ("training motions", list_names(self.training)),
                ("searches", self.effort_in_words),
                *(("best placement", placement.in_words) for placement in self.places[:1]),
            ),
            tables=(*places, Table.of(columns, (*self.laws, *self.references))),
            notes=[f"{law.label}: {law.certificate}" for law in self.laws if law.certificate],
        )

    @property
    def effort_in_words(self) -> str:
        """The candidates of all searches, and the time of the tuning."""
        count = sum(law.candidates for law in self.laws) + sum(front.candidates for front in self.fronts)
        return f"{counted(count, 'candidate')} in {duration_in_words(self.seconds)}"


# Placements that are listed, beside the study's own.
_LISTED = 10


def places_table(results: TuningResults) -> Table:
    """The best of the placements of the dampers that were compared, and the study's own."""
    ranked = enumerate(results.places, start=1)
    shown = [(number, placement) for number, placement in ranked if number <= _LISTED or placement.given]
    return Table(
        title=f"{counted(len(results.places), 'placement')} of the dampers, each with its best constant command: score "
        "over the building without dampers",
        columns=("", "Dampers", "Command", "Training", "Test"),
        rows=tuple(
            (
                str(number),
                placement.in_words + (" (the study)" if placement.given else ""),
                f"{placement.command:.3g} {results.command_unit}",
                with_decimals(placement.train, 3),
                "-" if placement.test is None else with_decimals(placement.test, 3),
            )
            for number, placement in shown
        ),
        note="Laws are tuned at the first.",
    )


def settings_in_words(
    settings: Mapping[str, Any], command_unit: str, number: Callable[[float], str] = format_rounded
) -> str:
    """Settings in one line, first of the law, then of the command, with a `number` as a page or a terminal has it."""
    candidate = LawCandidate(settings)
    words = {
        LARGEST: ("at most", "of the largest" if command_unit == BOTH_UNITS else command_unit),
        DEAD_ZONE: ("dead zone", "m/s"),
        COMMAND_SLOPE: ("slope at most", f"{command_unit}/s"),
    }
    parts = [f"{name} {setting_in_words(value, number)}" for name, value in candidate.of_law.items()]
    for name, value in candidate.of_command.items():
        word, unit = words[name]
        parts.append(f"{word} {number(value)} {unit}")
    return ", ".join(parts)


def setting_in_words(value: Any, number: Callable[[float], str]) -> str:
    """The value of a setting in a line; of a long array the number of its entries."""
    if value is None or isinstance(value, str):
        return value or "-"
    if isinstance(value, int | float):
        return number(float(value))
    if isinstance(value, Mapping):
        return f"({', '.join(f'{name} {setting_in_words(item, number)}' for name, item in value.items())})"
    if len(value) > _MOST_IN_WORDS:
        return f"{len(value)} numbers"
    return f"[{', '.join(setting_in_words(item, number) for item in value)}]"
