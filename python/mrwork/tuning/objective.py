"""The objective of a tuning: criteria over those at i = 0, as one number by a named risk."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, NoReturn

import numpy as np
from numpy.typing import NDArray

from mrwork.closed_loop.evaluation import SCORE, criteria, criterion
from mrwork.errors import SettingError
from mrwork.keys import Place, suggestion
from mrwork.study.batches import RunCriteria
from mrwork.study.schema import Baseline, Combination, Risk, TuneTable
from mrwork.summary import Summarised
from mrwork.units import number_in

Floats = NDArray[np.float64]

COMMAND = "A or V"
"""Unit of the criteria of the command."""
_TAIL = 0.2
PENALTY = 10.0
"""What is added to the objective for a constraint that is exceeded by its own limit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """The largest admissible value of a criterion, in SI."""

    criterion: str
    limit: float


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Objective(Summarised):
    """What a tuning minimises.

    The score of a run is the mean (or the largest, by `combine`) of its criteria over those of the baseline
    `relative_to` under the same motion and realisation, with `weights`. `risk` takes one number of the scores of all
    motions and realisations: their mean, the largest, or the mean of the worst share `tail` (conditional value at risk;
    Rockafellar & Uryasev, J. Risk 2, 2000, 21-41).
    """

    _made_by: ClassVar[str] = "mr.tune(study)"

    weights: Mapping[str, float]
    risk: Risk = "mean"
    tail: float = _TAIL
    limits: tuple[Limit, ...] = ()
    relative_to: Baseline = "passive_off"
    combine: Combination = "mean"

    def run_scores(self, found: RunCriteria, baseline: RunCriteria) -> Floats:
        """Score of each run, shape (n_candidates, n_motions, n_realisations); infinite where a run has none."""
        ratios = {name: over(found.of(name), baseline.of(name)) for name in self.weights}
        if self.combine == "largest":
            return np.asarray(
                np.max([weight * ratios[name] for name, weight in self.weights.items()], axis=0)
            )
        total = sum(self.weights.values())
        parts = [weight / total * ratios[name] for name, weight in self.weights.items()]
        return np.asarray(np.sum(parts, axis=0))

    def value(self, scores: Floats) -> Floats:
        """The risk of the scores of runs, shape (n_candidates,)."""
        return risk_of(scores.reshape(len(scores), -1), self.risk, self.tail)

    def violation(self, found: RunCriteria) -> Floats:
        """By how much each candidate exceeds its limits, relative to these and summed, shape (n_candidates,)."""
        violation = np.zeros(found.numbers.shape[1])
        for each in self.limits:
            largest = found.of(each.criterion).max(axis=(1, 2))
            violation += np.maximum(largest / each.limit - 1.0, 0.0)
        return violation

    def in_words(self, *, robust: bool) -> str:
        """What is minimised, as the end of a sentence; `robust` where the realisations belong to it."""
        names = " and ".join(_weighted(name, weight) for name, weight in self.weights.items())
        motions = "motions and realisations" if robust else "motions"
        risk = {
            "mean": f"mean over all {motions}",
            "max": f"largest over all {motions}",
            "cvar": f"mean of the worst {self.tail:.0%} of all {motions}",
        }[self.risk]
        taken = "mean" if self.combine == "mean" else "largest"
        under = "at i = 0" if self.relative_to == "passive_off" else "under the best constant command"
        return f"{risk} of the {taken} of {names}, each over its value {under}"


def _weighted(name: str, weight: float) -> str:
    text = criterion(name).title.lower().replace("rms", "RMS")
    return text if weight == 1.0 else f"{weight:g} x {text}"


def over(numbers: Floats, baseline: Floats) -> Floats:
    """Ratios to the values of a baseline; infinite where a run has no value, 1 where both are zero."""
    below = np.broadcast_to(baseline, numbers.shape)
    ratios = np.full(numbers.shape, math.inf)
    np.divide(numbers, below, out=ratios, where=np.isfinite(numbers) & (below > 0.0) & np.isfinite(below))
    return np.where((numbers == 0.0) & (below == 0.0), 1.0, ratios)


def risk_of(scores: Floats, risk: Risk, tail: float) -> Floats:
    """The risk of each row of scores, shape (n_candidates,).

    The worst share is weighted exactly: of 10 scores, a tail of 0.25 is the mean of the two largest and half the third.
    """
    if risk == "max":
        return np.asarray(scores.max(axis=1))
    if risk == "mean":
        return np.asarray(scores.mean(axis=1))
    n = scores.shape[1]
    weights = np.clip(tail * n - np.arange(n), 0.0, 1.0)
    worst = -np.sort(-scores, axis=1)
    # Infinity times a weight of zero is no number.
    parts = np.where(weights > 0.0, worst, 0.0) * weights
    return np.asarray(parts.sum(axis=1) / weights.sum())


def objective_of(table: TuneTable, command_unit: str) -> Objective:
    """The objective of a table."""
    given = table.criteria or SCORE
    weights = dict(given) if isinstance(given, Mapping) else dict.fromkeys(given, 1.0)
    for name, weight in weights.items():
        scored_criterion(table, "criteria", name)
        if not (weight > 0.0 and math.isfinite(weight)):
            _refuse(table, "criteria", f"the weight of {name} is {weight:g}; give a positive number")
    if table.tail is not None and table.risk != "cvar":
        _refuse(
            table,
            "tail",
            f'tail has no effect on the risk {table.risk!r}; leave it out, or give risk = "cvar"',
        )
    limits = tuple(
        Limit(criterion=name, limit=_limit(table, name, value, command_unit))
        for name, value in (table.constraints or {}).items()
    )
    return Objective(
        weights=weights,
        risk=table.risk,
        tail=_TAIL if table.tail is None else table.tail,
        limits=limits,
        relative_to=table.relative_to,
        combine=table.combine,
    )


def known_criterion(table: TuneTable, key: str, name: str) -> None:
    """Refuse a name that is no criterion."""
    known = [entry.name for entry in criteria()]
    if name not in known:
        _refuse(table, key, f"no criterion is called {name!r}{suggestion(name, known)}")


def scored_criterion(table: TuneTable, key: str, name: str) -> None:
    """Refuse a name that is no criterion, or one that is zero at i = 0 and so has no ratio to it."""
    known_criterion(table, key, name)
    if criterion(name).unit == COMMAND:
        _refuse(table, key, f"{name} is 0 at i = 0, so no ratio to it exists; limit it among the constraints")


def _limit(table: TuneTable, name: str, value: float | str, command_unit: str) -> float:
    known_criterion(table, "constraints", name)
    unit = criterion(name).unit
    if isinstance(value, str):
        number = number_in(value, command_unit if unit == COMMAND else unit)
        if isinstance(number, str):
            _refuse(table, "constraints", f"{name} {number}")
        value = number
    if not (value > 0.0 and math.isfinite(value)):
        _refuse(table, "constraints", f"{name} is {value:g}; give a positive limit [{unit}]")
    return value


def _refuse(table: TuneTable, key: str, sentence: str) -> NoReturn:
    refuse_within(table, sentence, key)


def refuse_within(table: TuneTable, sentence: str, *keys: str) -> NoReturn:
    """Raise a SettingError with the place in the study file, where the table has one."""
    place: Place | None = table.place
    if place is None:
        raise SettingError(sentence)
    place.within(*keys).refuse(sentence)
