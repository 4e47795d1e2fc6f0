"""Settings of every optimiser: rules that end a replicate, and points that are kept as elite; range checks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import AnyNumbers, Shape, checked
from mrwork.errors import SettingError
from mrwork.search.termination import hypothesis_test, stalled, threshold

LARGEST_POPULATION = 1_000_000
"""Most candidates of a generation."""

# The index is the code in `Course.ended`. Where several rules apply, the first is reported.
_REASONS = (
    None,
    "target",
    "max_generations",
    "max_evaluations",
    "spread",
    "hypothesis_test",
    "stall",
)
_CODE = {reason: code for code, reason in enumerate(_REASONS)}


def reason_of(code: int) -> str | None:
    """Name of the rule with this code; `None` for 0, no rule."""
    return _REASONS[code]


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class StopRules:
    """Rules that end a replicate; the description of each begins with its stop reason. `None` switches a rule off.

    Parameters
    ----------
    target
        `target`: the best misfit is at or below this.
    max_generations
        `max_generations`: this number of generations has been simulated.
    max_evaluations
        `max_evaluations`: one more population could exceed this number of simulations of a replicate. The number is
        never exceeded.
    spread_tolerance
        `spread`: half the population lies within this distance (largest gene difference) of the best.
    confidence, floor_share
        `hypothesis_test`: the decay of the best misfit is significant at this confidence. The test uses the misfit
        above this share of the least misfit so far: 0 is the published statistic, 1 (our definition) measures the
        share of the attainable decay. See `termination`.
    stall_generations, stall_tolerance
        `stall`: the best misfit has not fallen by this share within this number of generations (our definition). It
        ends searches on measured data, where the published test is rarely met.
    min_generations
        `spread`, `hypothesis_test` and `stall` do not apply before this generation.
    max_seconds
        `max_seconds`: the loop has run for this time; checked between generations. This rule alone depends on the
        machine, so it does not change the state: the loop applies it to all running replicates, and their state can
        be resumed.
    """

    target: float | None = None
    max_generations: int = 300
    max_evaluations: int | None = None
    spread_tolerance: float | None = 1e-6
    confidence: float | None = 0.95
    floor_share: float = 0.0
    stall_generations: int | None = 80
    stall_tolerance: float = 1e-3
    min_generations: int = 80
    max_seconds: float | None = None

    def __post_init__(self) -> None:
        if self.confidence is not None:
            threshold(self.confidence)
        check_ranges(
            {
                "target": (self.target, 0.0, math.inf),
                "max_generations": (self.max_generations, 1, math.inf),
                "max_evaluations": (self.max_evaluations, 1, math.inf),
                "spread_tolerance": (self.spread_tolerance, 0.0, 1.0),
                "floor_share": (self.floor_share, 0.0, 1.0),
                "stall_generations": (self.stall_generations, 1, math.inf),
                "stall_tolerance": (self.stall_tolerance, 0.0, 1.0),
                "min_generations": (self.min_generations, 1, math.inf),
                "max_seconds": (self.max_seconds, 0.0, math.inf),
            }
        )

    @checked
    def ended(
        self,
        *,
        trace: AnyNumbers,
        evaluations: NDArray[np.int64],
        population: NDArray[np.float64],
        best_unit: NDArray[np.float64],
    ) -> NDArray[np.int8]:
        """Code of the rule that ends each replicate, shape (n,), 0 for none; `reason_of` gives its name.

        Parameters
        ----------
        trace
            Least misfit up to each generation, shape (n, n_generations).
        evaluations
            Simulations so far, shape (n,).
        population
            Shape (n, n_population, n_params).
        best_unit
            Shape (n, n_params).
        """
        ended = np.zeros(len(trace), np.int8)
        generation, best = trace.shape[1], trace[:, -1]

        def end(where: NDArray[np.bool_], reason: str) -> None:
            ended[(ended == 0) & where] = _CODE[reason]

        if self.target is not None:
            end(best <= self.target, "target")
        if generation >= self.max_generations:
            end(np.ones(len(trace), np.bool_), "max_generations")
        if self.max_evaluations is not None:
            end(evaluations + population.shape[1] > self.max_evaluations, "max_evaluations")
        if generation < self.min_generations:
            return ended
        if self.spread_tolerance is not None:
            away = np.abs(population - best_unit[:, None]).max(axis=2)
            end(np.median(away, axis=1) <= self.spread_tolerance, "spread")
        found = np.isfinite(best)
        if self.confidence is not None:
            floor = self.floor_share * np.where(found, best, 0.0)
            end(found & hypothesis_test(trace, confidence=self.confidence, floor=floor), "hypothesis_test")
        if self.stall_generations is not None:
            end(stalled(trace, generations=self.stall_generations, tolerance=self.stall_tolerance), "stall")
        return ended


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class EliteRule:
    """Elite of a run: its best mutually distant points, which are kept as starts of a local minimisation.

    Parameters
    ----------
    count
        Largest number of points; with 1 only the best is kept.
    distance
        Least distance (largest gene difference) between any two, a share of the box; 0 allows copies.
    """

    count: int = 16
    distance: float = 0.2

    def __post_init__(self) -> None:
        check_ranges({"count": (self.count, 1, np.inf), "distance": (self.distance, 0.0, 1.0)})


@checked
def distinct_best(
    population: Annotated[NDArray[np.float64], Shape(("n_replicates", "n", "n_params"))],
    misfit: Annotated[AnyNumbers, Shape(("n_replicates", "n"))],
    rule: EliteRule,
) -> NDArray[np.int64]:
    """Best mutually distant members of each population.

    Greedy selection: the best first, then the next best whose distance to all selected ones is at least that of the
    rule. Local minimisations from close points would end at the same minimum.

    Parameters
    ----------
    population
        Candidates in the unit cube, shape (n_replicates, n, n_params).
    misfit
        Shape (n_replicates, n); failures (`inf`) are never selected.
    rule
        Number and least distance.

    Returns
    -------
    NDArray of int
        Indices, shape (n_replicates, rule.count), best first, padded with -1 where fewer are distant enough.
    """
    n_replicates, size = misfit.shape
    n_params = population.shape[2]
    order = np.argsort(misfit, axis=1, kind="stable")
    finite = np.isfinite(np.take_along_axis(misfit, order, axis=1))
    row = size * np.arange(n_replicates)
    gene = np.ascontiguousarray(population.reshape(-1, n_params).T)
    taken = np.full((n_replicates, rule.count), -1, dtype=np.int64)
    n_taken = np.zeros(n_replicates, dtype=np.int64)
    # Empty slots lie outside the cube, far from every member.
    taken_gene = np.full((n_params, n_replicates, rule.count), 9.0)
    # Vectorised over replicates: the j-th best of each.
    for j in range(int(np.count_nonzero(finite, axis=1).max(initial=0))):
        if n_taken.min() == rule.count:
            break
        member = order[:, j]
        candidate = gene[:, row + member]
        gap = np.abs(taken_gene - candidate[..., None]).max(axis=0).min(axis=1)
        enters = np.flatnonzero(finite[:, j] & (gap >= rule.distance) & (n_taken < rule.count))
        taken[enters, n_taken[enters]] = member[enters]
        taken_gene[:, enters, n_taken[enters]] = candidate[:, enters]
        n_taken[enters] += 1
    return taken


def check_ranges(ranges: Mapping[str, tuple[float | None, float, float]]) -> None:
    """Refuse the first setting whose value is not in [lower, upper]; `None` passes.

    Parameters
    ----------
    ranges
        Name to (value, lower, upper).

    Raises
    ------
    SettingError
        Naming the setting, its range and its value.
    """
    for name, (value, lower, upper) in ranges.items():
        # This form refuses NaN too.
        if value is not None and not lower <= value <= upper:
            raise SettingError(f"`{name}` lies between {lower} and {upper}, got {value}")
