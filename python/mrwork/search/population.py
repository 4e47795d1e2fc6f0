"""What optimisers have in common whose memory is one population: its state, and a generation of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.search.course import Course, put
from mrwork.search.elite import EliteRule
from mrwork.search.proposal import Proposal
from mrwork.search.stop_rules import StopRules


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
