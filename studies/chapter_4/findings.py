"""Findings in numbers, one for each search of a model on a test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrwork.records import DamperTest
from studies.chapter_4.decay import (
    Advantage,
    advantage,
    at_budget,
    at_end,
    ending,
    error_level,
    evaluations_to,
    expected_evaluations,
    holm,
    rules,
)
from studies.chapter_4.search_cells import Cell, Replicates
from studies.chapter_4.search_settings import BASELINES, EFFICIENT, ComparisonSettings, Model
from studies.chapter_4.termination import expected_termination
from studies.former.arrays import Floats
from studies.former.damper_tests import TestSet

# Of a run in twenty on either side.
QUANTILES = (0.05, 0.5, 0.95)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trial:
    """One model on one test, by every search."""

    model: Model
    test: DamperTest
    runs: dict[str, Replicates]

    @property
    def level(self) -> float:
        return error_level(list(self.runs.values()))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison:
    """All trials on one set of tests: model by model, currents rising."""

    tests: TestSet
    trials: tuple[Trial, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RuleFinding:
    """Effect of a rule: the share of runs that it ends, and the generation of these at the quantiles.

    `evaluations` is the mean over all runs, ended or not; `excess` the median over the ended ones of their error there
    over that after the last generation, less 1. `nan` where it ends none.
    """

    share: float
    generation: tuple[float, ...]
    evaluations: float
    excess: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchFinding:
    """One cell. Errors are NRMSE after the last generation; `below` is the share at or below the 95 % error level.

    `reaching` are simulations per run that reaches it. `expected_generation` with its `likelihood` comes from the decay
    of the mean error, `own_generation`, at the quantiles, from that of each run. `spared` is the share of steps that
    early abort saved.
    """

    mean_error: float
    deviation: float
    below: float
    evaluations: float
    reaching: float
    median_reaching: float
    expected_generation: float
    likelihood: float
    own_generation: tuple[float, ...]
    rules: dict[str, RuleFinding]
    spared: float
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialFinding:
    """All searches of a model on a test, and the efficient algorithm against each baseline.

    After as many generations, and after as many simulations as the efficient one took; p-values as yet of this
    comparison alone.
    """

    model: str
    current: float
    level: float
    least: float
    searches: dict[str, SearchFinding]
    same_generations: dict[str, Advantage]
    same_simulations: dict[str, Advantage]


def comparisons_of(
    sets: Sequence[TestSet], cells: Sequence[Cell], found: Sequence[Replicates]
) -> tuple[Comparison, ...]:
    """Gather what the cells found by set, model and test."""
    comparisons = []
    for tests in sets:
        gathered: dict[tuple[str, float | None], Trial] = {}
        for cell, runs in zip(cells, found, strict=True):
            if cell.tests == tests.name:
                key = (cell.model.label, cell.test.current)
                trial = gathered.setdefault(key, Trial(model=cell.model, test=cell.test, runs={}))
                trial.runs[cell.search] = runs
        comparisons.append(Comparison(tests=tests, trials=tuple(gathered.values())))
    return tuple(comparisons)


def findings_of(comparison: Comparison, settings: ComparisonSettings) -> tuple[TrialFinding, ...]:
    return tuple(_trial(trial, settings.confidence) for trial in comparison.trials)


def adjusted(advantages: Sequence[Advantage]) -> Floats:
    """Their p-values for being looked at together."""
    return holm(np.array([each.p_value for each in advantages]))


def _trial(trial: Trial, confidence: float) -> TrialFinding:
    level = trial.level
    efficient = trial.runs[EFFICIENT]
    budget = efficient.evaluations[:, -1]
    return TrialFinding(
        model=trial.model.label,
        current=float(trial.test.current or 0.0),
        level=level,
        least=min(float(runs.final.min()) for runs in trial.runs.values()),
        searches={search: _search(runs, level, confidence) for search, runs in trial.runs.items()},
        same_generations={name: advantage(efficient.final, trial.runs[name].final) for name in BASELINES},
        same_simulations={
            name: advantage(efficient.final, at_budget(trial.runs[name], budget)) for name in BASELINES
        },
    )


def _search(runs: Replicates, level: float, confidence: float) -> SearchFinding:
    expected = expected_termination(runs.best.mean(axis=0), confidence)
    own = [expected_termination(trace, confidence).generation for trace in runs.best]
    cost = evaluations_to(runs, level)
    # Of infinite costs a median between two of them would be no number.
    median = float(np.quantile(cost, 0.5, method="inverted_cdf"))
    return SearchFinding(
        mean_error=float(runs.final.mean()),
        deviation=float(runs.final.std(ddof=1)),
        below=float(np.isfinite(cost).mean()),
        evaluations=float(runs.evaluations[:, -1].mean()),
        reaching=expected_evaluations(runs, level),
        median_reaching=median,
        expected_generation=np.nan if expected.generation is None else expected.generation,
        likelihood=expected.likelihood,
        own_generation=_quantiles([generation for generation in own if generation is not None]),
        rules={name: _rule(runs, name, confidence) for name in rules(confidence)},
        spared=runs.spared,
        seconds=runs.seconds,
    )


def _rule(runs: Replicates, name: str, confidence: float) -> RuleFinding:
    ends = ending(runs, rules(confidence)[name])
    ended = ends >= 0
    ratio = (at_end(runs.best, ends) / runs.final)[ended]
    return RuleFinding(
        share=float(ended.mean()),
        generation=_quantiles(ends[ended].astype(float)),
        evaluations=float(at_end(runs.evaluations, ends).mean()),
        excess=float(np.median(ratio) - 1.0) if ratio.size else np.nan,
    )


def _quantiles(values: Floats | Sequence[float]) -> tuple[float, ...]:
    if not len(values):
        return (np.nan,) * len(QUANTILES)
    return tuple(float(value) for value in np.quantile(values, QUANTILES))
