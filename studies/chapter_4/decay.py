"""Decay of the error over many runs: levels, simulations to reach them, and where a rule would end a run."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from mrwork.search import StopRules
from studies.chapter_4.search_cells import Integers, Replicates
from studies.former.arrays import Floats

# Share of the attainable decay that is done at the level: our definition of the 95 % error level.
LEVEL = 0.95


def error_level(runs: list[Replicates]) -> float:
    """Misfit at which 95 % of the attainable decay is done, the same for all searches of a model on a test.

    The decay is attainable from the mean of the initial populations' best to the least misfit of any run.
    """
    start = float(np.mean([each.best[:, 0] for each in runs]))
    least = min(float(each.final.min()) for each in runs)
    return least + (1.0 - LEVEL) * (start - least)


def evaluations_to(found: Replicates, level: float) -> Floats:
    """Simulations until each run was at or below the level, shape (n_replicates,); `inf` where it never was."""
    reached = found.best <= level
    first = np.argmax(reached, axis=1)
    cost = found.evaluations[np.arange(len(first)), first]
    return np.where(reached.any(axis=1), cost, np.inf)


def expected_evaluations(found: Replicates, level: float) -> float:
    """Simulations per success: those of all runs, each until it succeeds or ends, over the number that succeed.

    This is the mean cost of repeating runs until one succeeds; `inf` where none does.
    """
    cost = evaluations_to(found, level)
    successes = np.count_nonzero(np.isfinite(cost))
    spent = np.where(np.isfinite(cost), cost, found.evaluations[:, -1]).sum()
    return float(spent / successes) if successes else np.inf


def at_budget(found: Replicates, budget: Floats | Integers) -> Floats:
    """Misfit of each run within a budget of simulations; `inf` before its first generation.

    `budget` has shape (n_replicates,) or (n_budgets, 1); the result broadcasts the two.
    """
    budget = np.broadcast_to(budget, np.broadcast_shapes(np.shape(budget), (len(found.best),)))
    place = np.empty(budget.shape, dtype=np.int64)
    for run, spent in enumerate(found.evaluations):
        place[..., run] = np.searchsorted(spent, budget[..., run], side="right") - 1
    misfit = found.best[np.arange(len(found.best)), np.maximum(place, 0)]
    return np.where(place < 0, np.inf, misfit)


def ending(found: Replicates, rule: StopRules) -> Integers:
    """Generation at which a rule would have ended each run, -1 if it would not, shape (n_replicates,).

    All runs went on to the last generation, which is where -1 points to.

    A rule reads only the past of a search, so the run would have been the same up to its end. Rules that read the
    population cannot be evaluated, because it was not kept.
    """
    generation = np.full(len(found.best), -1)
    nowhere = np.zeros((len(found.best), 1, 1))
    for last in range(found.best.shape[1]):
        judged = rule.ended(
            trace=found.best[:, : last + 1],
            evaluations=found.evaluations[:, last],
            population=nowhere,
            best_unit=nowhere[:, 0],
        )
        generation[(generation < 0) & (judged != 0)] = last
    return generation


def at_end(traces: NDArray[np.generic], generation: Integers) -> Floats:
    """Entries of traces, shape (n_replicates, n_generations), at the ends of the runs."""
    return np.asarray(traces[np.arange(len(generation)), generation], dtype=np.float64)


def rules(confidence: float) -> dict[str, StopRules]:
    """Rules that end a run, each alone: the literal hypothesis test, the test on the attainable error, and a stall."""
    none = StopRules(
        max_generations=np.iinfo(np.int64).max,
        spread_tolerance=None,
        confidence=None,
        stall_generations=None,
        min_generations=1,
    )
    return {
        LITERAL: replace(none, confidence=confidence),
        ATTAINABLE: replace(none, confidence=confidence, floor_share=1.0),
        STALL: replace(none, stall_generations=StopRules().stall_generations),
    }


LITERAL, ATTAINABLE, STALL = "hypothesis test", "the same above the least error", "stall"


@dataclass(frozen=True, slots=True, kw_only=True)
class Advantage:
    """Share of pairs in which the first sample is lower, ties counted as half, and the p-value of no difference."""

    share: float
    p_value: float


def advantage(first: Floats, second: Floats) -> Advantage:
    """Compare pairs by Wilcoxon's signed-rank test, two-sided."""
    share = float(np.mean(first < second) + 0.5 * np.mean(first == second))
    if np.array_equal(first, second):
        return Advantage(share=share, p_value=1.0)
    return Advantage(share=share, p_value=float(stats.wilcoxon(first, second).pvalue))


def holm(p_values: Floats) -> Floats:
    """p-values adjusted for how many are looked at (Holm, Scand. J. Statist. 6, 1979, 65-70)."""
    order = np.argsort(p_values)
    scaled = (len(p_values) - np.arange(len(p_values))) * p_values[order]
    adjusted = np.empty(len(p_values))
    adjusted[order] = np.minimum(np.maximum.accumulate(scaled), 1.0)
    return adjusted
