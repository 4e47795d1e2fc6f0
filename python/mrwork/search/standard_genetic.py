"""The standard genetic algorithm, the baseline for the efficient one (Kwok et al., ISA Trans. 46, 2007, 167-179).

Real-coded in the unit cube: roulette selection (Holland 1975; Goldberg 1989), arithmetic crossover (Michalewicz
1992), Gaussian mutation, elitism. Details that the sources leave open (our definitions):

- *Fitness* is that of the efficient algorithm, `F = (e_max - e)/(e_max - e_min)`, 0 for failures. Where all have
  fitness 0, all have the same probability of selection.
- *Crossover* of parents a and b gives the children `a + l (b - a)` and `b + l (a - b)`, one `l ~ U(0, 1)` per pair.
- *Mutation* affects each gene independently and adds N(0, deviation); genes that leave the box are reflected.
- *A child equal to its parent* has its parent's misfit and is not simulated again. With 8 parameters about one child
  in eight is equal to its parent; the efficient algorithm saves simulations in the same way.
- *Elitism*: the best chromosome is copied unchanged to the first slot.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import AnyNumbers, Seed, checked
from mrwork.search.course import Course, Dimension, Proposal, Replicate
from mrwork.search.population import Ceiling, PopulationState, propose, relative_fitness, with_generation
from mrwork.search.rules import LARGEST_POPULATION, EliteRule, StopRules, check_ranges
from mrwork.search.unit_cube import latin_hypercube, reflect


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class StandardGA:
    """Settings of the standard genetic algorithm; its methods are pure functions of the state.

    Parameters
    ----------
    population
        Chromosomes P, at least 4.
    crossover_probability
        Probability p_c that a pair of parents is crossed.
    mutation_probability
        Probability p_m that a gene is mutated.
    mutation_deviation
        Standard deviation of the mutation, a share of the box.
    ceiling
        Misfit at which a chromosome counts as failed, so that its simulation may stop there.
    stop
        When to end; by default after 200 generations at most.
    elite
        Which points of the run are kept as starts of a local minimisation.
    """

    population: int = 60
    crossover_probability: float = 0.8
    mutation_probability: float = 0.05
    mutation_deviation: float = 0.1
    ceiling: Ceiling = field(default_factory=Ceiling)
    stop: StopRules = field(default_factory=lambda: StopRules(max_generations=200))
    elite: EliteRule = field(default_factory=EliteRule)

    def __post_init__(self) -> None:
        check_ranges(
            {
                "population": (self.population, 4, LARGEST_POPULATION),
                "crossover_probability": (self.crossover_probability, 0.0, 1.0),
                "mutation_probability": (self.mutation_probability, 0.0, 1.0),
                "mutation_deviation": (self.mutation_deviation, 0.0, 1.0),
            }
        )

    @checked
    def start(
        self, n_params: Dimension, rng: Seed, replicates: Sequence[Replicate] = (0,)
    ) -> PopulationState:
        """Initial state with Latin hypercube samples of the unit cube."""
        course = Course.begun(n_params, rng, replicates, self.elite)
        return PopulationState.begun(course, latin_hypercube(course.streams, self.population, n_params))

    @checked
    def ask(self, state: PopulationState) -> Proposal:
        """Children of the present generation; those that differ from their parents are simulated."""
        course, rows = state.course, state.course.running
        parents, misfit = state.population[rows], state.misfit[rows]
        if course.is_first:
            return propose(course, parents, limit=self.ceiling.limit(course))
        size, n_params = parents.shape[1:]
        pairs = -(-size // 2)
        uniform = course.streams.uniform(4 * pairs + size * n_params)
        among = np.arange(len(rows))[:, None]
        chosen = _roulette(relative_fitness(misfit), uniform[:, : 2 * pairs])
        first, second = chosen[:, :pairs], chosen[:, pairs:]
        crossed = uniform[:, 2 * pairs : 3 * pairs] < self.crossover_probability
        share = np.where(crossed, uniform[:, 3 * pairs : 4 * pairs], 0.0)[..., None]
        difference = parents[among, second] - parents[among, first]
        children = np.concatenate(
            [parents[among, first] + share * difference, parents[among, second] - share * difference], axis=1
        )[:, :size]
        of = np.concatenate([first, second], axis=1)[:, :size]
        mutated = uniform[:, 4 * pairs :].reshape(children.shape) < self.mutation_probability
        step = course.streams.normal(np.count_nonzero(mutated, axis=(1, 2)))
        children[mutated] = reflect(children[mutated] + self.mutation_deviation * step)
        changed = np.any(children != parents[among, of], axis=2)
        known = misfit[among, of]
        found = np.isfinite(course.best_misfit[rows])
        children[found, 0] = course.best_unit[rows][found]
        known[found, 0] = course.best_misfit[rows][found]
        changed[found, 0] = False
        return propose(
            course,
            children,
            known=known,
            changed=changed,
            limit=self.ceiling.limit(course),
        )

    @checked
    def tell(self, state: PopulationState, proposal: Proposal, misfit: AnyNumbers) -> PopulationState:
        """State after the simulations of the proposal; `misfit` (n_ask,), `inf` marks a failed one."""
        return with_generation(state, proposal, misfit, elite=self.elite, stop=self.stop)


def _roulette(fitness: NDArray[np.float64], uniform: NDArray[np.float64]) -> NDArray[np.int64]:
    """Members selected in proportion to fitness, one for each number in [0, 1), shape (n_replicates, n_drawn)."""
    slot = np.cumsum(np.where(fitness.any(axis=1, keepdims=True), fitness, 1.0), axis=1)
    ball = uniform * slot[:, -1:]
    member = np.count_nonzero(slot[:, None, :] <= ball[:, :, None], axis=2)
    # By rounding a ball may equal the end of the last slot.
    return np.asarray(np.minimum(member, fitness.shape[1] - 1))
