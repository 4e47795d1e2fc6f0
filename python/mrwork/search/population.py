"""What population-based optimisers share: their state, a generation of it, fitness, and the ceiling of misfits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.search.course import Course, Proposal, put
from mrwork.search.rules import EliteRule, StopRules, check_ranges


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PopulationState:
    """A population and its misfits, (n_replicates, n_population, n_params) and (n_replicates, n_population).

    They are the last generation told, or the initial one with misfit `inf` at generation 0.
    """

    course: Course
    population: NDArray[np.float64]
    misfit: NDArray[np.float64]

    @classmethod
    def begun(cls, course: Course, population: NDArray[np.float64]) -> PopulationState:
        """Nothing simulated yet."""
        return cls(course=course, population=population, misfit=np.full(population.shape[:2], math.inf))


def proposed(
    course: Course,
    population: NDArray[np.float64],
    *,
    known: NDArray[np.float64] | None = None,
    changed: NDArray[np.bool_] | None = None,
    limit: NDArray[np.float64] | float = math.inf,
) -> Proposal:
    """Ask for this population of the replicates that run, or for those `changed` where the others are `known`.

    Misfits at or above `limit`, one number, (n_running, 1) or (n_running, n_population), count as failures.
    """
    shape = population.shape[:2]
    changed = np.ones(shape, np.bool_) if changed is None else changed
    return Proposal(
        number=course.replicate[course.running],
        population=population,
        known=np.full(shape, math.inf) if known is None else np.where(changed, math.inf, known),
        changed=changed,
        limit=np.broadcast_to(limit, shape),
    )


def generation_told(
    state: PopulationState,
    proposal: Proposal,
    misfit: NDArray[np.float64],
    *,
    elite: EliteRule,
    stop: StopRules,
) -> PopulationState:
    """The proposed population takes the place of the old one."""
    told = proposal.told(misfit)
    after = np.where(proposal.changed, told, proposal.known)
    return _replaced(state, proposal, told, proposal.population, after, elite, stop)


def better_told(
    state: PopulationState,
    proposal: Proposal,
    misfit: NDArray[np.float64],
    *,
    elite: EliteRule,
    stop: StopRules,
) -> PopulationState:
    """Each proposed member takes the place of the old one where it is better."""
    rows = state.course.running
    told = proposal.told(misfit)
    better = told < state.misfit[rows]
    population = np.where(better[..., None], proposal.population, state.population[rows])
    after = np.where(better, told, state.misfit[rows])
    return _replaced(state, proposal, told, population, after, elite, stop)


def _replaced(
    state: PopulationState,
    proposal: Proposal,
    told: NDArray[np.float64],
    population: NDArray[np.float64],
    misfit: NDArray[np.float64],
    elite: EliteRule,
    stop: StopRules,
) -> PopulationState:
    """The replicates that run have this population with these misfits now."""
    rows = state.course.running
    return PopulationState(
        course=state.course.after(
            proposal, told, population=population, misfit=misfit, elite=elite, stop=stop
        ),
        population=put(state.population, rows, population),
        misfit=put(state.misfit, rows, misfit),
    )


def relative_fitness(misfit: NDArray[np.float64]) -> NDArray[np.float64]:
    """`F = (e_max - e)/(e_max - e_min)` in each population, shape (n_replicates, n_population).

    The extremes are those of the simulations that succeeded. Failures have 0, and all have where all errors are equal.
    """
    succeeded = np.isfinite(misfit)
    best = np.min(misfit, axis=1, keepdims=True)
    worst = np.max(np.where(succeeded, misfit, -math.inf), axis=1, keepdims=True)
    varied = succeeded & (worst > best)
    above = np.where(varied, worst, 0.0) - np.where(varied, misfit, 0.0)
    span = np.where(varied, worst, 1.0) - np.where(varied, best, 0.0)
    return np.asarray(above / span)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ceiling:
    """A chromosome with a misfit at or above it counts as failed; the lower of the two holds, `None` is none.

    Parameters
    ----------
    absolute
        A misfit. For one that is an NRMSE, 1 is natural: at 1 a constant force does as well.
    over_median
        A multiple, at least 1, of the median misfit of the generation before.
    """

    absolute: float | None = None
    over_median: float | None = None

    def __post_init__(self) -> None:
        check_ranges(
            {"absolute": (self.absolute, 0.0, math.inf), "over_median": (self.over_median, 1.0, math.inf)}
        )

    def limit(self, course: Course) -> NDArray[np.float64]:
        """The ceiling of each replicate that runs, shape (n_running, 1); `inf` where there is none."""
        rows = course.running
        limit = np.full((rows.size, 1), math.inf if self.absolute is None else self.absolute)
        if self.over_median is None or course.is_first:
            return limit
        return np.asarray(np.minimum(limit, self.over_median * course.trace.median[rows, -1:]))
