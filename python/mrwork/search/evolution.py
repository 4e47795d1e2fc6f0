"""Evolution of a population in the unit cube: genetic algorithms, and differential evolution.

The efficient genetic algorithm is by Kwok et al., ISA Trans. 46, 2007, 167-179; the standard one is its baseline.

**Standard.** Roulette selection (Holland 1975; Goldberg 1989), arithmetic crossover (Michalewicz 1992), Gaussian
mutation, elitism. Details that the sources leave open (our definitions):

- *Fitness* is defined as in the efficient algorithm, `F = (e_max - e)/(e_max - e_min)`, 0 for failures. Where all have
  fitness 0, all have the same probability of selection.
- *Crossover* of parents a and b gives the children `a + l (b - a)` and `b + l (a - b)`, one `l ~ U(0, 1)` per pair.
- *Mutation* affects each gene independently and adds N(0, deviation); genes that leave the box are reflected in both.
- *A child equal to its parent* has its parent's misfit and is not simulated again, as in the efficient algorithm.
- *Elitism*: the best chromosome is copied unchanged to the first slot.

**Efficient.** Crossover includes selection, mutation depends on fitness, and only chromosomes that
changed are simulated again. Details that the source leaves open (our definitions):

- *Fitness* `F = (e_max - e)/(e_max - e_min)` uses the extremes of the simulations that succeeded; failures have
  fitness 0. Where all errors are equal the first chromosome has fitness 1 and the others 0, so that the best never
  mutates, the others always do, and there is no division by zero.
- *One simulation per generation*: crossover, mutation and elitism all use the fitness before the generation. A
  chromosome that is drawn twice in the `P` crossover draws changes twice in succession.
- *Ties* are broken in favour of the lower index, so that the best is a single chromosome, which never changes; of two
  failures neither is fitter, and both remain.
- *Spread* of the initial population is its standard deviation per gene, about `1/sqrt(12)` of the box. It does not
  shrink, so mutation explores throughout the search and only crossover converges.
- *Elite copies* replace random slots after mutation; their misfit is known and needs no simulation. The best is one
  chromosome; its copies have fitness 0, so they mutate in the next generation and explore its neighbourhood. With the
  fitness of the best they would never change and would displace the others, one more in each generation.

**Differential evolution** (Storn & Price, J. Glob. Optim. 11, 1997, 341-359). The defaults follow
`scipy.optimize.differential_evolution` with deferred updating: best/1/bin, a random mutation factor F for each
generation ("dither"), binomial crossover with at least one gene from the mutant. Two things differ: genes that leave
the box are reflected, not drawn again, and a trial that only equals its parent is rejected.
"""

from __future__ import annotations

import math
from dataclasses import field, replace
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import AnyNumbers, Seed, Share, Within, checked
from mrwork.base.values import Floats
from mrwork.errors import SettingError
from mrwork.search.course import Course, Dimension, Proposal, State
from mrwork.search.rules import LARGEST_POPULATION, Elite, EliteRule, SearchName, Stop, StopRules
from mrwork.search.unit_cube import others, reflect


@checked
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
    """

    name: SearchName = "standard_ga"
    population: Annotated[int, Within(least=4, most=LARGEST_POPULATION)] = 60
    crossover_probability: Share = 0.8
    mutation_probability: Share = 0.05
    mutation_deviation: Share = 0.1
    stop: Stop = field(default_factory=lambda: StopRules(max_generations=200))
    elite: Elite = field(default_factory=EliteRule)

    @checked
    def start(self, n_params: Dimension, rng: Seed) -> State:
        """Initial state with Latin hypercube samples of the unit cube."""
        return State.sampled(n_params, rng, self.population)

    @checked
    def ask(self, state: State) -> Proposal:
        """Children of the present generation; those that differ from their parents are simulated."""
        course, parents = state.course, state.population
        if not course.generation:
            return Proposal.of(parents)
        size, n_params = parents.shape
        pairs = -(-size // 2)
        uniform = course.streams.uniform(4 * pairs + size * n_params)
        chosen = _roulette(relative_fitness(state.misfit), uniform[: 2 * pairs])
        first, second = parents[chosen[:pairs]], parents[chosen[pairs:]]
        crossed = uniform[2 * pairs : 3 * pairs] < self.crossover_probability
        move = np.where(crossed, uniform[3 * pairs : 4 * pairs], 0.0)[:, None] * (second - first)
        children = np.concatenate([first + move, second - move])[:size]
        mutated = uniform[4 * pairs :].reshape(children.shape) < self.mutation_probability
        step = self.mutation_deviation * course.streams.normal(int(mutated.sum()))
        children[mutated] = reflect(children[mutated] + step)
        of = chosen[:size]
        changed = np.any(children != parents[of], axis=1)
        return _keep_best(course, children, state.misfit[of], changed, np.array([0]))

    @checked
    def tell(self, state: State, proposal: Proposal, misfit: AnyNumbers) -> State:
        """State after the simulations of the proposal; `misfit` (n_ask,), `inf` marks a failed one."""
        return state.with_generation(proposal, misfit, self)


def _roulette(fitness: Floats, uniform: Floats) -> NDArray[np.int64]:
    """Members selected in proportion to fitness, one for each number in [0, 1)."""
    slot = np.cumsum(fitness if fitness.any() else np.ones_like(fitness))
    member = np.searchsorted(slot, uniform * slot[-1], side="right")
    # By rounding a ball may equal the end of the last slot.
    return np.asarray(np.minimum(member, fitness.size - 1))


def _keep_best(
    course: Course, population: Floats, misfit: Floats, changed: NDArray[np.bool_], slots: NDArray[np.int64]
) -> Proposal:
    """The proposal of a population with copies of the best of the run, where there is one, in these slots."""
    if np.isfinite(course.best_misfit):
        population[slots], misfit[slots], changed[slots] = course.best_unit, course.best_misfit, False
    return Proposal(population=population, known=misfit, changed=changed)


def relative_fitness(misfit: Floats) -> Floats:
    """`F = (e_max - e)/(e_max - e_min)` in a population, shape (n_population,).

    The extremes are taken over simulations that succeeded. Failures have fitness 0; where all errors are equal, all
    have fitness 0.
    """
    succeeded = np.isfinite(misfit)
    best, worst = np.min(misfit), np.max(misfit[succeeded], initial=-math.inf)
    if worst <= best:
        return np.zeros(misfit.size)
    return np.where(succeeded, worst - misfit, 0.0) / (worst - best)


@checked
class EfficientGA:
    """Settings of the efficient genetic algorithm; its methods are pure functions of the state.

    Parameters
    ----------
    population
        Chromosomes P, at least 4.
    elite_share
        Share of the slots that copies of the best replace in each generation; at least one slot.
    """

    name: SearchName = "genetic"
    population: Annotated[int, Within(least=4, most=LARGEST_POPULATION)] = 60
    elite_share: Share = 0.01
    stop: Stop = field(default_factory=StopRules)
    elite: Elite = field(default_factory=EliteRule)

    @checked
    def start(self, n_params: Dimension, rng: Seed) -> State:
        """Initial state with Latin hypercube samples of the unit cube, whose standard deviation is `extra`."""
        state = State.sampled(n_params, rng, self.population)
        return replace(state, extra=state.population.std(axis=0))

    @checked
    def ask(self, state: State) -> Proposal:
        """Chromosomes of the next generation; those that changed are simulated."""
        course, before, misfit = state.course, state.population, state.misfit
        if not course.generation:
            return Proposal.of(before)
        size, n_params = before.shape
        uniform = course.streams.uniform(2 + 3 * size)
        drawn = uniform[2:].reshape(3, size)
        first = (drawn[0] * size).astype(np.int64)
        second = (first + 1 + (drawn[1] * (size - 1)).astype(np.int64)) % size
        population = _crossover(before, misfit, uniform[0], first, second)
        mutated = _fitness(before, misfit) < uniform[1]
        step = state.extra * course.streams.normal(int(mutated.sum()), n_params)
        population[mutated] = reflect(population[mutated] + step)
        # Compared with the old population, because crossover of equal chromosomes changes nothing.
        changed = np.any(population != before, axis=1)
        copies = max(1, round(self.elite_share * size))
        slots = np.argpartition(drawn[2], copies - 1)[:copies]
        return _keep_best(course, population, misfit.copy(), changed, slots)

    @checked
    def tell(self, state: State, proposal: Proposal, misfit: AnyNumbers) -> State:
        """State after the simulations of the proposal; `misfit` (n_ask,), `inf` marks a failed one."""
        return state.with_generation(proposal, misfit, self)


def _fitness(population: Floats, misfit: Floats) -> Floats:
    """Fitness, shape (n_population,): 1 for the best, 0 for its copies."""
    fitness = relative_fitness(misfit)
    leader = np.argmin(misfit)
    fitness[np.all(population == population[leader], axis=1)] = 0.0
    fitness[leader] = np.isfinite(misfit[leader])
    return fitness


def _crossover(
    population: Floats, misfit: Floats, share: float, first: NDArray[np.int64], second: NDArray[np.int64]
) -> Floats:
    """In each pair, one pair after the other, the less fit moves by a share r towards the fitter, which stays."""
    rank = np.argsort(np.argsort(misfit, kind="stable"))
    fitter, moved = np.where(rank[first] < rank[second], (first, second), (second, first))
    crossed = population.copy()
    # No chromosome moves towards a failure.
    counts = np.isfinite(misfit[fitter])
    for to, at in zip(fitter[counts], moved[counts], strict=True):
        # r*fitter + (1-r)*less_fit, in the form that leaves equal chromosomes equal bit for bit.
        crossed[at] += share * (crossed[to] - crossed[at])
    return crossed


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
    """

    name: SearchName = "differential_evolution"
    population: Annotated[int, Within(least=5, most=LARGEST_POPULATION)] = 60
    base: Literal["best", "random"] = "best"
    factor: Annotated[tuple[float, float], Within(least=0.0, most=2.0)] = (0.5, 1.0)
    crossover_probability: Share = 0.7
    stop: Stop = field(default_factory=StopRules)
    elite: Elite = field(default_factory=EliteRule)

    def __post_init__(self) -> None:
        least, greatest = self.factor
        if least > greatest:
            raise SettingError(f"`factor` is from {least:g} to {greatest:g}; give the smaller one first")

    @checked
    def start(self, n_params: Dimension, rng: Seed) -> State:
        """Initial state with Latin hypercube samples of the unit cube."""
        return State.sampled(n_params, rng, self.population)

    @checked
    def ask(self, state: State) -> Proposal:
        """One trial for each member."""
        course, parents = state.course, state.population
        if not course.generation:
            return Proposal.of(parents)
        size, n_params = parents.shape
        uniform = course.streams.uniform(1 + size * (4 + n_params))
        least, greatest = self.factor
        factor = least + (greatest - least) * uniform[0]
        first, second, third = others(uniform[1 : 1 + 3 * size].reshape(size, 3)).T
        base = course.best_unit if self.base == "best" else parents[third]
        mutant = reflect(base + factor * (parents[first] - parents[second]))
        certain = (uniform[1 + 3 * size : 1 + 4 * size] * n_params).astype(np.int64)
        crossed = uniform[1 + 4 * size :].reshape(parents.shape) < self.crossover_probability
        crossed |= np.arange(n_params) == certain[:, None]
        return Proposal.of(np.where(crossed, mutant, parents))

    @checked
    def tell(self, state: State, proposal: Proposal, misfit: AnyNumbers) -> State:
        """State after the simulations of the proposal; `misfit` (n_ask,), `inf` marks a failed one."""
        return state.with_better_members(proposal, misfit, self)
