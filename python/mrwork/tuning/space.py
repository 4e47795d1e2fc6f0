"""Search space and objective of a tuning: the free settings of a law as a unit cube, and the risk of their scores."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, ClassVar, Literal

import numpy as np

from mrwork.base.arguments import Share, Whole
from mrwork.base.hints import Within
from mrwork.base.keys import check_known, keys_of
from mrwork.base.numbers import of_unit, round_to
from mrwork.base.places import keyed
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass
from mrwork.closed_loop.evaluation import SCORE, Scales, criterion, ratio, searched
from mrwork.closed_loop.responses import COMMAND_UNIT
from mrwork.control.laws.control_law import control_law
from mrwork.control.laws.law_problem import Magnitudes, Span
from mrwork.control.laws.law_settings import SETTINGS
from mrwork.errors import InvalidSettingError, SettingError
from mrwork.study.fragilities import limit_of
from mrwork.study.runs import Runs
from mrwork.study.schema import Baseline, Combination, Risk, TuneTable

_TAIL = 0.2
PENALTY = 10.0
"""What is added to the objective for a constraint that is exceeded by its own limit."""


@array_dataclass(repr=False)
class Scores(Summarised):
    """Objective of candidates, by how much they exceed their limits, and both together, shape (n,) each."""

    objective: Floats
    violation: Floats

    @property
    def penalised_scores(self) -> Floats:
        """Objective plus `PENALTY` times the relative violation of the limits, which a search minimises."""
        return np.asarray(self.objective + PENALTY * self.violation)

    @property
    def best(self) -> int:
        """The candidate of the least penalised objective; the first of equal ones."""
        return int(np.argmin(self.penalised_scores))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class TuningObjective(Summarised):
    """Objective of a tuning.

    The score of a run is the mean (or the largest, by `combine`) of its criteria over the criteria of the baseline
    `relative_to` under the same motion and realisation, with `weights`. `risk` takes one number of the scores of all
    motions and realisations: their mean, the largest, or the mean of the worst share `tail` (conditional value at risk;
    Rockafellar & Uryasev, J. Risk 2, 2000, 21-41). `limits` are the largest admissible criteria by name, in SI.
    """

    _made_by: ClassVar[str] = "mr.tune(study)"

    weights: Mapping[str, float]
    risk: Risk = "mean"
    tail: float = _TAIL
    limits: Mapping[str, float] = field(default_factory=dict)
    relative_to: Baseline = "passive_off"
    combine: Combination = "mean"

    def scores(self, runs: Runs, baselines: Mapping[str, Runs]) -> Scores:
        """The scores of candidates by the runs under each of the baselines; without an end, no limit counts."""
        value = self.value(self.run_scores(runs, baselines[self.relative_to]))
        return Scores(objective=value, violation=np.where(np.isfinite(value), self.violation(runs), 0.0))

    def run_scores(self, runs: Runs, baseline: Runs) -> Floats:
        """Score of each run, shape (n_candidates, n_motions, n_realisations); infinite where a run has none."""
        ratios = {name: searched(ratio(runs.numbers[name], baseline.numbers[name])) for name in self.weights}
        if self.combine == "largest":
            return np.asarray(
                np.max([weight * ratios[name] for name, weight in self.weights.items()], axis=0)
            )
        total = sum(self.weights.values())
        parts = [weight / total * ratios[name] for name, weight in self.weights.items()]
        return np.asarray(np.sum(parts, axis=0))

    def value(self, scores: Floats) -> Floats:
        """The risk of the scores of runs, shape (n_candidates,).

        The worst share is weighted exactly: of 10 scores, a tail of 0.25 is the mean of the two largest and half the
        third.
        """
        scores = scores.reshape(len(scores), -1)
        if self.risk == "max":
            return np.asarray(scores.max(axis=1))
        if self.risk == "mean":
            return np.asarray(scores.mean(axis=1))
        n = scores.shape[1]
        weights = np.clip(self.tail * n - np.arange(n), 0.0, 1.0)
        worst = -np.sort(-scores, axis=1)
        # Infinity times a weight of zero is no number.
        parts = np.where(weights > 0.0, worst, 0.0) * weights
        return np.asarray(parts.sum(axis=1) / weights.sum())

    def violation(self, runs: Runs) -> Floats:
        """By how much each candidate exceeds its limits, relative to these and summed, shape (n_candidates,)."""
        violation = np.zeros(runs.shape[0])
        for name, limit in self.limits.items():
            largest = searched(runs.numbers[name].max(axis=(1, 2)))
            violation += np.maximum(largest / limit - 1.0, 0.0)
        return violation

    def in_words(self, *, robust: bool) -> str:
        """The objective as the end of a sentence; `robust` if it includes the realisations."""
        titles = {name: criterion(name).title.lower().replace("rms", "RMS") for name in self.weights}
        weighted = {name: "" if weight == 1.0 else f"{weight:g} x " for name, weight in self.weights.items()}
        names = " and ".join(f"{weighted[name]}{title}" for name, title in titles.items())
        motions = "motions and realisations" if robust else "motions"
        risk = {
            "mean": f"mean over all {motions}",
            "max": f"largest over all {motions}",
            "cvar": f"mean of the worst {100.0 * self.tail:.0f} % of all {motions}",
        }[self.risk]
        taken = "mean" if self.combine == "mean" else "largest"
        return f"{risk} of the {taken} of {names}, each over its value {self.baseline_in_words}"

    @property
    def baseline_in_words(self) -> str:
        """Under which command the criteria are that it is relative to."""
        return "at i = 0" if self.relative_to == "passive_off" else "under the best constant command"


def tuning_objective(
    table: TuneTable, command_unit: str, scales: Scales, scored: Sequence[str] = SCORE
) -> TuningObjective:
    """The objective of a table [[tune]], by default of the `scored` criteria, its limits in SI.

    A limit that needs scales the building lacks is refused.
    """
    criteria = table.criteria or scored
    weights = dict(criteria) if isinstance(criteria, Mapping) else dict.fromkeys(criteria, 1.0)
    limits: dict[str, float] = {}
    for name, value in (table.constraints or {}).items():
        with keyed("constraints"):
            limits |= limit_of({name: value}, command_unit, scales)
    return TuningObjective(
        weights=weights,
        risk=table.risk,
        tail=_TAIL if table.tail is None else table.tail,
        limits=limits,
        relative_to=table.relative_to,
        combine=table.combine,
    )


LARGEST = "largest_command"
"""Name of the largest command of a law among its settings."""
DEAD_ZONE, COMMAND_SLOPE = "dead_zone", "command_slope"
"""Names of what is done to the command of any law, among the settings of a tuned one."""
SHAPING_SPANS: Mapping[str, Span] = {
    DEAD_ZONE: Span(lower=1e-3, upper=0.3, of=(("rate", 1.0),), free=False),
    # Rate over stroke is the first natural frequency.
    COMMAND_SLOPE: Span(
        lower=0.3, upper=100.0, of=(("command", 1.0), ("rate", 1.0), ("stroke", -1.0)), free=False
    ),
}
"""Ranges of these, for every law of a current or voltage."""
BUDGET_SCALE = "budget_scale"
"""Name of the factor of the budget of designed weights among the settings of a law."""
_SHARES = 10
_OF_COMMAND = (LARGEST, *SHAPING_SPANS)


@dataclass(frozen=True, slots=True)
class LawCandidate:
    """Settings of a law and of its command, in SI, and in words where they are from.

    Settings of the command are the largest one [A or V], and where they change it the dead zone [m/s] and the slope
    [A/s or V/s].
    """

    _made_by: ClassVar[str] = "mr.tune(study)"

    settings: Mapping[str, Any]
    origin: str = field(default="", compare=False, repr=False)

    @property
    def of_law(self) -> dict[str, Any]:
        """The settings that only this law has."""
        return {name: value for name, value in self.settings.items() if name not in _OF_COMMAND}

    @property
    def of_command(self) -> dict[str, float]:
        """The settings of the command, which any law has."""
        return {name: self.settings[name] for name in _OF_COMMAND if name in self.settings}

    @property
    def largest_command(self) -> float:
        """Command to which the law is limited [A or V]."""
        return float(self.settings[LARGEST])

    @property
    def shape(self) -> tuple[float, float]:
        """Dead zone [m/s] and slope of the command [A/s or V/s]; 0 and infinite where they change nothing."""
        return self.settings.get(DEAD_ZONE, 0.0), self.settings.get(COMMAND_SLOPE, math.inf)


def follows_command(law: str) -> bool:
    """Whether the dampers follow a current or voltage that the law chooses, so that it has a largest one."""
    return not (control_law(law).commands_force or SETTINGS[law].constant)


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeSetting:
    """A setting with the ends of its range; a search is uniform in it or its logarithm.

    `levels` is the number of equal steps that it takes, 0 for all numbers; `entry` its index in a setting that is an
    array; `start` the coordinate of the unit cube where a search begins.
    """

    name: str
    lower: float
    upper: float
    scale: Literal["linear", "log"] = "log"
    levels: Whole = 0
    entry: Whole | None = None
    start: Share = 0.5

    @property
    def label(self) -> str:
        """Its name, with the index of an entry."""
        return self.name if self.entry is None else f"{self.name}[{self.entry}]"

    def value(self, unit: float, *, exact: bool = False) -> float:
        """The value at a coordinate of the unit cube, with the digits that a study file states unless `exact`."""
        last = self.levels - 1
        share = min(int(unit * self.levels), last) / last if self.levels else unit
        if self.scale == "log":
            value = math.exp(math.log(self.lower) + share * math.log(self.upper / self.lower))
        else:
            value = self.lower + share * (self.upper - self.lower)
        return value if exact else round_to(value)

    def unit(self, value: float) -> float | None:
        """The coordinate of a value; `None` outside the range."""
        if not self.lower - 1e-3 * abs(self.lower) <= value <= self.upper + 1e-3 * abs(self.upper):
            return None
        if self.scale == "log":
            share = math.log(value / self.lower) / math.log(self.upper / self.lower)
        else:
            share = (value - self.lower) / (self.upper - self.lower)
        share = min(max(share, 0.0), 1.0)
        # The middle of the step of a level.
        return (round(share * (self.levels - 1)) + 0.5) / self.levels if self.levels else share


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class SettingSpace(Summarised):
    """The free settings of a law, and those that are held.

    Other weights than the held ones are tried first where they are `any_weights`: the table states neither weights nor
    bounds of their R.
    """

    law: str
    held: Mapping[str, Any]
    free: tuple[FreeSetting, ...]
    largest_command: float
    any_weights: bool

    @property
    def continuous(self) -> bool:
        """Whether a free setting takes all numbers of its range."""
        return any(not setting.levels for setting in self.free)

    @property
    def start(self) -> Floats:
        """The point of the unit cube where a search begins, shape (n_free,)."""
        return np.array([setting.start for setting in self.free])

    def candidate(self, unit: Floats, *, exact: bool = False) -> LawCandidate:
        """The candidate at a point of the unit cube, shape (n_free,); `exact` without rounding of its settings."""
        values: dict[str, Any] = {}
        for setting, share in zip(self.free, unit, strict=True):
            value = setting.value(float(share), exact=exact)
            values[setting.name] = value if setting.entry is None else (*values.get(setting.name, ()), value)
        of_command = {name: values.pop(name) for name in _OF_COMMAND if name in values}
        return LawCandidate({**self.held, **values, LARGEST: self.largest_command, **of_command})

    def unit(self, candidate: LawCandidate) -> Floats | None:
        """The point of a candidate, shape (n_free,); `None` where it is outside of the space.

        A weight or dead zone that is free and that the candidate does not have is taken for the least of its range, a
        slope for the largest.
        """
        names = {setting.name for setting in self.free}
        if {name: value for name, value in candidate.of_law.items() if name not in names} != self.held:
            return None
        given, places = candidate.settings, []
        for setting in self.free:
            value = given.get(setting.name, setting.upper if setting.name == COMMAND_SLOPE else setting.lower)
            if setting.entry is not None and isinstance(value, tuple) and setting.entry < len(value):
                value = value[setting.entry]
            share = setting.unit(value) if isinstance(value, int | float) else None
            if share is None:
                return None
            places.append(share)
        return np.array(places)

    def every(self) -> list[LawCandidate]:
        """All candidates of a space without continuous settings."""
        levels = [(np.arange(setting.levels) + 0.5) / setting.levels for setting in self.free]
        return [self.candidate(np.array(unit)) for unit in product(*levels)]


def space_of(table: TuneTable, law: str, magnitudes: Magnitudes) -> SettingSpace:
    """The free settings of a law with their ranges, from a table and from what the law declares."""
    kind, entries = SETTINGS[law], {entry.name: entry for entry in keys_of(SETTINGS[law])}
    ranges, weight = table.free or {}, "control_weight"
    for name in table.settings or {}:
        with keyed("settings", name):
            sentence = f"{law} has no setting {name!r}"
            check_known(name, [*entries], sentence, otherwise="it has", kind=SettingError)
    any_weights = not kind.weight_names() & {*(table.settings or {}), *ranges}
    held = {**(table.settings or {}), **(kind.weighed_by_default if any_weights else {})}
    spans = {name: entry.says.span for name, entry in entries.items() if entry.says.span is not None}
    spans |= SHAPING_SPANS if follows_command(law) else {}
    if magnitudes.shares:
        # What is in A or V has no range where dampers of both units follow the commands.
        in_units = {name for name, entry in entries.items() if entry.says.unit == COMMAND_UNIT}
        spans = {name: span for name, span in spans.items() if name not in {*in_units, COMMAND_SLOPE}}
    magnitudes = replace(magnitudes, cost=kind.cost(held, magnitudes))
    chosen = _free_names(table, law, spans, held)
    free = [
        setting
        for name in chosen
        for setting in _free(name, ranges.get(name, ()), spans.get(name), magnitudes)
    ]
    held = {name: value for name, value in held.items() if name not in chosen}
    if is_semi_active(held) and weight in spans and weight not in chosen:
        held.setdefault(weight, 1.0)
    for name, span in spans.items():
        if name not in chosen and name not in held and span.start is not None:
            held[name] = round_to(span.start * span.unit(magnitudes))
    for name, entry in entries.items():
        # A regulator has its control weight or a finished gain.
        regulated = name == weight and kind.is_regulator and held.get("gain") is None
        if (entry.is_required or regulated) and name not in held and name not in chosen:
            sentence = f"{law} has no {name}; give it among the settings, or as free with its range"
            raise InvalidSettingError("settings", sentence)
    if not free:
        raise InvalidSettingError("free", f"no setting of {law} is free; leave some out of its settings")
    return SettingSpace(
        law=law,
        held=held,
        free=tuple(free),
        largest_command=magnitudes.command,
        any_weights=any_weights and not ranges.get(weight),
    )


def is_last(law: str, setting: FreeSetting, unit: float) -> bool:
    """Whether the law permits no value of the setting beyond the end of its range that is nearer to the coordinate."""
    if law not in SETTINGS:
        # Beyond the ranges of a law of the user whose file was not run nothing is known.
        return True
    within = next((entry.within for entry in keys_of(SETTINGS[law]) if entry.name == setting.name), Within())
    end, far = (setting.lower, -math.inf) if unit < 0.5 else (setting.upper, math.inf)
    return bool(within.excludes(math.nextafter(end, far)))


def is_semi_active(settings: Mapping[str, Any]) -> bool:
    """Whether settings have designed weights with a semi-active condition, whose budget decides the law."""
    designed = settings.get("designed")
    return isinstance(designed, Mapping) and designed.get("semi_active") is not None


def _free_names(table: TuneTable, law: str, spans: Mapping[str, Span], held: Mapping[str, Any]) -> list[str]:
    """Names of the free settings: what the table names, or what the law frees by itself."""
    kind, stated = SETTINGS[law], table.settings or {}
    commands = [LARGEST] if follows_command(law) and not kind.chooses_levels else []
    if table.free is None:
        # A weight of the energy and designed weights exclude other weights.
        excluded = kind.weight_names() if {"energy", "designed"} & held.keys() else frozenset[str]()
        free = {name: span.free for name, span in spans.items()}
        if is_semi_active(held):
            free |= {name: name == BUDGET_SCALE for name in (BUDGET_SCALE, "control_weight") if name in free}
        names = [name for name in spans if free[name] and name not in stated and name not in excluded]
        return [*names, *commands]
    for name in table.free:
        with keyed("free", name):
            sentence = f"{law} has no setting {name!r} that can be searched"
            check_known(name, [*spans, *commands], sentence, otherwise="it has", kind=SettingError)
            if name in spans and spans[name].held:
                raise SettingError(f"{name} of {law} is not searched: {spans[name].held}")
            if name in stated:
                raise SettingError(f"{name} is held among the settings and free; keep one")
    return list(table.free)


def _free(name: str, ends: Sequence[float], span: Span | None, magnitudes: Magnitudes) -> list[FreeSetting]:
    scale = "linear" if span is None else span.scale
    if ends:
        if len(ends) != 2 or not ends[0] < ends[1] or (scale == "log" and ends[0] <= 0.0):
            positive = " of positive numbers" if scale == "log" else ""
            sentence = f"the range of {name} takes its lower and its upper end{positive}, as [1e-14, 1e-9]"
            raise InvalidSettingError(("free", name), sentence)
        lower, upper = ends
    elif span is None:
        lower, upper = magnitudes.command / _SHARES, magnitudes.command
    else:
        lower, upper = (end * span.unit(magnitudes) for end in (span.lower, span.upper))
    if name == LARGEST and not 0.0 < lower <= upper <= magnitudes.command * (1.0 + 1e-9):
        sentence = f"{LARGEST} may be from above 0 to {of_unit(magnitudes.command, '', 4)}, the largest of the dampers"
        raise InvalidSettingError(("free", name), sentence)
    levels = _SHARES if name == LARGEST else 0
    whole = FreeSetting(name=name, lower=float(lower), upper=float(upper), scale=scale, levels=levels)
    if span is None or not span.entries:
        return [whole]
    starts = np.clip(span.entries, lower, upper)
    return [
        replace(whole, entry=entry, start=float(whole.unit(float(start)) or 0.0))
        for entry, start in enumerate(starts)
    ]
