"""Differential evolution (Storn & Price, J. Glob. Optim. 11, 1997, 341-359).

The defaults are those of `scipy.optimize.differential_evolution` with deferred updating: best/1/bin, a random mutation
factor F for each generation ("dither"), binomial crossover with at least one gene from the mutant. Two things differ:
genes that leave the box are reflected, not drawn again, and a trial that only equals its parent is rejected, so that
the simulation of a trial may stop when its misfit reaches that of the parent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import Literal

import numpy as np

from mrwork.arguments import AnyNumbers, Seed, checked
from mrwork.errors import SettingError
from mrwork.search.course import (
    Course,
    Dimension,
    PopulationState,
    Proposal,
    Replicate,
    propose,
    with_better_members,
)
from mrwork.search.rules import LARGEST_POPULATION, EliteRule, StopRules, check_ranges
from mrwork.search.unit_cube import latin_hypercube, others, reflect


@checked
class DifferentialEvolution:
    """Settings of differential evolution; its methods are pure functions of the state.

    Parameters
    ----------
    population
        Members, at least 5.
    base
        The vector that is mutated: the "best" of the population (best/1/bin), or a "random" member (rand/1/bin).
    factor
        Range of the mutation factor F, drawn uniformly for each generation.
    crossover_probability
        Probability CR that a gene comes from the mutant.
    stop
        When to end.
    elite
        Which points of the run are kept as starts of a local minimisation.
    """

    population: int = 60
    base: Literal["best", "random"] = "best"
    factor: tuple[float, float] = (0.5, 1.0)
    crossover_probability: float = 0.7
    stop: StopRules = field(default_factory=StopRules)
    elite: EliteRule = field(default_factory=EliteRule)

    def __post_init__(self) -> None:
        least, greatest = self.factor
        check_ranges(
            {
                "population": (self.population, 5, LARGEST_POPULATION),
                "factor": (least, 0.0, greatest),
                "factor, the greatest,": (greatest, 0.0, 2.0),
                "crossover_probability": (self.crossover_probability, 0.0, 1.0),
            }
        )
        if self.base not in ("best", "random"):
            raise SettingError(f"`base` is 'best' or 'random', got {self.base!r}")

    @checked
    def start(
        self, n_params: Dimension, rng: Seed, replicates: Sequence[Replicate] = (0,)
    ) -> PopulationState:
        """Initial state with Latin hypercube samples of the unit cube."""
        course = Course.begin(n_params, rng, replicates, self.elite)
        return PopulationState.begin(course, latin_hypercube(course.streams, self.population, n_params))

    @checked
    def ask(self, state: PopulationState) -> Proposal:
        """One trial for each member."""
        course, rows = state.course, state.course.running
        parents, misfit = state.population[rows], state.misfit[rows]
        if course.is_first:
            return propose(course, parents)
        size, n_params = parents.shape[1:]
        uniform = course.streams.uniform(1 + size * (4 + n_params))
        among = np.arange(len(rows))[:, None]
        least, greatest = self.factor
        factor = (least + (greatest - least) * uniform[:, 0])[:, None, None]
        partner = others(uniform[:, 1 : 1 + 3 * size].reshape(-1, size, 3), size)
        base = course.best_unit[rows][:, None] if self.base == "best" else parents[among, partner[..., 2]]
        mutant = reflect(base + factor * (parents[among, partner[..., 0]] - parents[among, partner[..., 1]]))
        certain = (uniform[:, 1 + 3 * size : 1 + 4 * size] * n_params).astype(np.int64)
        crossed = uniform[:, 1 + 4 * size :].reshape(parents.shape) < self.crossover_probability
        crossed |= np.arange(n_params) == certain[..., None]
        return propose(course, np.where(crossed, mutant, parents), limit=misfit)

    @checked
    def tell(self, state: PopulationState, proposal: Proposal, misfit: AnyNumbers) -> PopulationState:
        """State after the simulations of the proposal; `misfit` (n_ask,), `inf` marks a failed one."""
        return with_better_members(state, proposal, misfit, elite=self.elite, stop=self.stop)
