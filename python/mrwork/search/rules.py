"""Settings of every optimiser: rules that end a search, points that are kept as elite.

**Hypothesis test** of Kwok et al. (2007). The test reads the trace `e_g` of the least misfit per generation. From the
first improvement `g0` on, the errors are taken as exponentially distributed with mean `mu`. The first and greatest of
them then belongs to the same population with probability `exp(-max(e)/mu)`; once this is below the significance
`a_s = 1 - confidence` the errors have decayed significantly and the search may end::

    mean(e_g) / max(e_g) <= 1 / ln(1/a_s)            0.334 at 95 %, 0.217 at 99 %

The exact statistic is our definition, since the source's was not available.

**Floor.** On a measured record a model error `e_inf > 0` remains however long the search is. The ratio then
tends to `e_inf / e_g0`, which is above the threshold unless the initial error is at least three times the final
one: the published test ends few searches on measured tests. There are two alternatives, both our definition:

- `has_stalled`: the best misfit has not fallen by a given share for a given number of generations. By default the
  search uses it together with the published test and reports the first that applies.
- `floor`: the same statistic on `e_g - floor`. With the least misfit so far as floor it measures the share of the
  attainable decay, and meets the threshold on every trace that decreases twice and then levels off. It applies
  early: use it only with enough `min_generations`.
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import AnyNumbers, Count, Level, NotNegative, Share, checked
from mrwork.base.hints import Says
from mrwork.base.values import Floats

# Why a search ended, in words; a search of another library has reasons of its own.
_ENDED = {
    "agreed": "once two routes had agreed on the minimum",
    "max_rounds": "at the limit of rounds, without the agreement of two routes",
    "max_steps": "at the limit of time steps, without the agreement of two routes",
    "hypothesis_test": "by the hypothesis test on its decay",
    "stall": "when the best no longer improved",
    "spread": "when the population had drawn together",
    "max_generations": "at the limit of generations",
    "max_evaluations": "at the limit of simulations",
    "max_seconds": "at the limit of time",
    "target": "at the target misfit",
    "callback": "on request",
    "interrupted": "by an interrupt",
}


def ended_in_words(stop_reason: str) -> str:
    """Why a search ended, in words."""
    return _ENDED.get(stop_reason, stop_reason)


def threshold(confidence: float) -> float:
    """Value `1/ln(1/(1 - confidence))` that the statistic must not exceed."""
    return -1.0 / math.log1p(-confidence)


def statistic(best: Floats, *, floor: float = 0.0) -> float:
    """Mean over maximum of `e_g - floor` from the first improvement on, in (0, 1]; 1 before any decay.

    `best` is the least misfit up to each generation, shape (n_generations,), never rising; a first finite value after
    `inf` is an improvement. `floor` is a lower bound of the misfit, of which 0 gives the published statistic.
    """
    improved = np.flatnonzero(best[1:] < best[:-1]) + 1
    first = improved[0] if improved.size else best.size
    excess = np.where(np.arange(best.size) >= first, best - floor, 0.0)
    greatest = excess.max(initial=0.0)
    # Division before the sum avoids overflow.
    return float(np.sum(excess / greatest) / (best.size - first)) if greatest > 0.0 else 1.0


def has_stalled(best: Floats, *, generations: int, tolerance: float) -> bool:
    """Whether the best misfit of a trace fell by less than the share `tolerance` in the last `generations`."""
    # As a product, so that 0 after 0 and inf after inf count as stalled.
    return best.size > generations and bool(best[-1] >= best[-1 - generations] * (1.0 - tolerance))


LARGEST_POPULATION = 1_000_000
"""Most candidates of a generation."""


@checked
class StopRules:
    """Rules that end a search; the description of each begins with its stop reason. `None` switches a rule off.

    Where several rules apply, the first of target, max_generations, max_evaluations, spread, hypothesis_test and stall
    is the reason.

    Parameters
    ----------
    target
        `target`: the best misfit is at or below this.
    max_generations
        `max_generations`: this number of generations has been simulated.
    max_evaluations
        `max_evaluations`: one more population could exceed this number of simulations. The number is never
        exceeded.
    spread_tolerance
        `spread`: half the population lies within this distance (largest gene difference) of the best.
    confidence, floor_share
        `hypothesis_test`: the decay of the best misfit is significant at this confidence. The test uses the misfit
        above this share of the least misfit so far: 0 is the published statistic, 1 (our definition) measures the
        share of the attainable decay. See above.
    stall_generations, stall_tolerance
        `stall`: the best misfit has not fallen by this share within this number of generations (our definition). It
        ends searches on measured data, where the published test is rarely met.
    min_generations
        `spread`, `hypothesis_test` and `stall` do not apply before this generation.
    max_seconds
        `max_seconds`: the loop has run for this time; checked between generations. This rule alone depends on the
        machine, so the loop applies it without changing the state, which can be resumed.
    """

    target: NotNegative | None = None
    max_generations: Count = 300
    max_evaluations: Count | None = None
    spread_tolerance: Share | None = 1e-6
    confidence: Level | None = 0.95
    floor_share: Share = 0.0
    stall_generations: Count | None = 80
    stall_tolerance: Share = 1e-3
    min_generations: Count = 80
    max_seconds: NotNegative | None = None

    @checked
    def ended(self, *, trace: AnyNumbers, evaluations: int, population: Floats, best_unit: Floats) -> str:
        """The rule that ends a search, empty for none.

        `trace` is the least misfit up to each generation, shape (n_generations,), `evaluations` the simulations so far;
        `population` (n_population, n_params) has the best member `best_unit` (n_params,).
        """
        best = float(trace[-1])
        if self.target is not None and best <= self.target:
            return "target"
        if trace.size >= self.max_generations:
            return "max_generations"
        if self.max_evaluations is not None and evaluations + len(population) > self.max_evaluations:
            return "max_evaluations"
        if trace.size < self.min_generations:
            return ""
        away = np.median(np.abs(population - best_unit).max(axis=1))
        if self.spread_tolerance is not None and away <= self.spread_tolerance:
            return "spread"
        decay = statistic(trace, floor=self.floor_share * best) if math.isfinite(best) else math.inf
        if self.confidence is not None and decay <= threshold(self.confidence):
            return "hypothesis_test"
        length = self.stall_generations
        if length is not None and has_stalled(trace, generations=length, tolerance=self.stall_tolerance):
            return "stall"
        return ""


@checked
class EliteRule:
    """Elite of a run: its best mutually distant points, which are kept as starts of a local minimisation.

    At most `count` points, with at least `distance` (largest gene difference, a share of the box; 0 allows copies)
    between any two.
    """

    count: Count = 16
    distance: Share = 0.2


def distinct_best(population: Floats, misfit: Floats, rule: EliteRule) -> NDArray[np.int64]:
    """Indices of the best mutually distant members of a population, best first, at most `rule.count`.

    Greedy selection: the best first, then the next best whose distance to all selected ones is at least the distance of
    the rule. Local minimisations from close points would end at the same minimum. Failures (`inf`) are never selected.
    """
    order = np.argsort(misfit, kind="stable")
    left = order[np.isfinite(misfit[order])]
    taken: list[int] = []
    while left.size and len(taken) < rule.count:
        taken.append(left[0])
        gap = np.abs(population[left[1:]] - population[left[0]]).max(axis=1)
        left = left[1:][gap >= rule.distance]
    return np.array(taken, dtype=np.int64)


SearchName = Annotated[str, Says("name of the search in records of fits")]
Stop = Annotated[StopRules, Says("when to end")]
Elite = Annotated[EliteRule, Says("which points of the run are kept as starts of a local minimisation")]
