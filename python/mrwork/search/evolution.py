"""Evolution of a population in the unit cube: genetic algorithms, and differential evolution.

The efficient genetic algorithm is that of Kwok et al., ISA Trans. 46, 2007, 167-179, the standard one its baseline.

**Standard.** Roulette selection (Holland 1975; Goldberg 1989), arithmetic crossover (Michalewicz 1992), Gaussian
mutation, elitism. Details that the sources leave open (our definitions):

- *Fitness* is that of the efficient algorithm, `F = (e_max - e)/(e_max - e_min)`, 0 for failures. Where all have
  fitness 0, all have the same probability of selection.
- *Crossover* of parents a and b gives the children `a + l (b - a)` and `b + l (a - b)`, one `l ~ U(0, 1)` per pair.
- *Mutation* affects each gene independently and adds N(0, deviation); genes that leave the box are reflected.
- *A child equal to its parent* has its parent's misfit and is not simulated again. With 8 parameters about one child
  in eight is equal to its parent; the efficient algorithm saves simulations in the same way.
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
- *Genes that leave the box* are reflected at its faces, see `reflect`.
- *Elite copies* replace random slots after mutation; their misfit is known and needs no simulation. The best is one
  chromosome; its copies have fitness 0, so they mutate in the next generation and explore its neighbourhood. With the
  fitness of the best they would never change and would displace the others, one more in each generation: with the
  static model on a 2 mm, 5 Hz, 1 A test the worst of eight runs then stayed at NRMSE 0.123 after 8000 simulations,
  compared with 0.105 (best known 0.100).

**Differential evolution** (Storn & Price, J. Glob. Optim. 11, 1997, 341-359). The defaults are those of
`scipy.optimize.differential_evolution` with deferred updating: best/1/bin, a random mutation factor F for each
generation ("dither"), binomial crossover with at least one gene from the mutant. Two things differ: genes that leave
the box are reflected, not drawn again, and a trial that only equals its parent is rejected, so that the simulation of
a trial may stop when its misfit reaches that of the parent.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import AnyNumbers, Seed, Share, Within, checked
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import SettingError
from mrwork.search.course import (
    Ceiling,
    Course,
    Dimension,
    PopulationState,
    Proposal,
    Replicate,
    propose,
    relative_fitness,
    with_better_members,
    with_generation,
)
from mrwork.search.rules import LARGEST_POPULATION, EliteRule, StopRules
from mrwork.search.unit_cube import latin_hypercube, others, reflect


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
    ceiling
        Misfit at which a chromosome counts as failed, so that its simulation may stop there.
    stop
        When to end; by default after 200 generations at most.
    elite
        Which points of the run are kept as starts of a local minimisation.
    """

    population: Annotated[int, Within(least=4, most=LARGEST_POPULATION)] = 60
    crossover_probability: Share = 0.8
    mutation_probability: Share = 0.05
    mutation_deviation: Share = 0.1
    ceiling: Ceiling = field(default_factory=Ceiling)
    stop: StopRules = field(default_factory=lambda: StopRules(max_generations=200))
    elite: EliteRule = field(default_factory=EliteRule)

    @checked
    def start(
        self, n_params: Dimension, rng: Seed, replicates: Sequence[Replicate] = (0,)
    ) -> PopulationState:
        """Initial state with Latin hypercube samples of the unit cube."""
        course = Course.begin(n_params, rng, replicates, self.elite)
        return PopulationState.begin(course, latin_hypercube(course.streams, self.population, n_params))

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
        known_best = np.isfinite(course.best_misfit[rows])
        children[known_best, 0] = course.best_unit[rows][known_best]
        known[known_best, 0] = course.best_misfit[rows][known_best]
        changed[known_best, 0] = False
        return propose(course, children, known=known, changed=changed, limit=self.ceiling.limit(course))

    @checked
    def tell(self, state: PopulationState, proposal: Proposal, misfit: AnyNumbers) -> PopulationState:
        """State after the simulations of the proposal; `misfit` (n_ask,), `inf` marks a failed one."""
        return with_generation(state, proposal, misfit, elite=self.elite, stop=self.stop)


def _roulette(fitness: Floats, uniform: Floats) -> NDArray[np.int64]:
    """Members selected in proportion to fitness, one for each number in [0, 1), shape (n_replicates, n_drawn)."""
    slot = np.cumsum(np.where(fitness.any(axis=1, keepdims=True), fitness, 1.0), axis=1)
    ball = uniform * slot[:, -1:]
    member = np.count_nonzero(slot[:, None, :] <= ball[:, :, None], axis=2)
    # By rounding a ball may equal the end of the last slot.
    return np.asarray(np.minimum(member, fitness.shape[1] - 1))


@array_dataclass(repr=False)
class GAState(Summarised):
    """State of the efficient genetic algorithm.

    `population` (n_replicates, n_population, n_params) with `misfit` (n_replicates, n_population) is the last
    simulated generation, or the initial one with misfit `inf` at generation 0. `mutation_spread` (n_replicates,
    n_params) is the standard deviation of the initial population.
    """

    _made_by: ClassVar[str] = "optimiser.start(n_params, rng)"

    course: Course
    population: Floats
    misfit: Floats
    mutation_spread: Floats


@checked
class EfficientGA:
    """Settings of the efficient genetic algorithm; its methods are pure functions of the state.

    Parameters
    ----------
    population
        Chromosomes P, at least 4.
    elite_share
        Share of the slots that copies of the best replace in each generation; at least one slot.
    ceiling
        Misfit at which a chromosome counts as failed, so that its simulation may stop there.
    stop
        When to end.
    elite
        Which points of the run are kept as starts of a local minimisation.

    Examples
    --------
    >>> import numpy as np
    >>> search = EfficientGA(population=20)
    >>> state = search.start(2, rng=0)
    >>> while state.course.running.size:
    ...     proposal = search.ask(state)
    ...     state = search.tell(state, proposal, np.sum((proposal.unit - 0.3) ** 2, axis=1))
    >>> bool(state.course.best_misfit[0] < 1e-2)
    True
    """

    population: Annotated[int, Within(least=4, most=LARGEST_POPULATION)] = 60
    elite_share: Share = 0.01
    ceiling: Ceiling = field(default_factory=Ceiling)
    stop: StopRules = field(default_factory=StopRules)
    elite: EliteRule = field(default_factory=EliteRule)

    @checked
    def start(self, n_params: Dimension, rng: Seed, replicates: Sequence[Replicate] = (0,)) -> GAState:
        """Initial state with Latin hypercube samples of the unit cube."""
        course = Course.begin(n_params, rng, replicates, self.elite)
        population = latin_hypercube(course.streams, self.population, n_params)
        return GAState(
            course=course,
            population=population,
            misfit=np.full(population.shape[:2], math.inf),
            mutation_spread=population.std(axis=1),
        )

    @checked
    def ask(self, state: GAState) -> Proposal:
        """Chromosomes of the next generation; those that changed are simulated."""
        course, rows = state.course, state.course.running
        before, misfit = state.population[rows], state.misfit[rows]
        if course.is_first:
            return propose(course, before, limit=self.ceiling.limit(course))
        population, known, changed = self._offspring(state, before, misfit)
        return propose(course, population, known=known, changed=changed, limit=self.ceiling.limit(course))

    @checked
    def tell(self, state: GAState, proposal: Proposal, misfit: AnyNumbers) -> GAState:
        """State after the simulations of the proposal; `misfit` (n_ask,), `inf` marks a failed one."""
        return with_generation(state, proposal, misfit, elite=self.elite, stop=self.stop)

    def _offspring(
        self, state: GAState, before: Floats, misfit: Floats
    ) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Next populations, known misfits, and which chromosomes changed."""
        course, rows = state.course, state.course.running
        size = misfit.shape[1]
        uniform = course.streams.uniform(2 + 3 * size)
        cross, mutate, drawn = uniform[:, 0], uniform[:, 1], uniform[:, 2:].reshape(-1, 3, size)
        population = _crossover(before, misfit, cross, _pairs(drawn[:, :2]))
        chosen = _fitness(before, misfit) < mutate[:, None]
        normal = course.streams.normal(np.count_nonzero(chosen, axis=1) * before.shape[2])
        spread = np.broadcast_to(state.mutation_spread[rows][:, None], before.shape)[chosen]
        population[chosen] = reflect(population[chosen] + spread * normal.reshape(spread.shape))
        # Compared with the old population, because crossover of equal chromosomes changes nothing.
        changed = np.any(population != before, axis=2)
        copies = max(1, round(self.elite_share * size))
        slots = np.argpartition(drawn[:, 2], copies - 1, axis=1)[:, :copies]
        known_best = np.flatnonzero(np.isfinite(course.best_misfit[rows]))[:, None]
        population[known_best, slots[known_best[:, 0]]] = course.best_unit[rows][known_best]
        misfit[known_best, slots[known_best[:, 0]]] = course.best_misfit[rows][known_best]
        changed[known_best, slots[known_best[:, 0]]] = False
        return population, misfit, changed


def _pairs(uniform: Floats) -> NDArray[np.int64]:
    """Two different chromosomes in each column, shape (n_replicates, 2, n_population), from numbers in [0, 1)."""
    size = uniform.shape[2]
    first = (uniform[:, 0] * size).astype(np.int64)
    second = (first + 1 + (uniform[:, 1] * (size - 1)).astype(np.int64)) % size
    return np.stack([first, second], axis=1)


def _fitness(population: Floats, misfit: Floats) -> Floats:
    """Fitness, shape (n_replicates, n_population): 1 for the best, 0 for its copies."""
    fitness = relative_fitness(misfit)
    among = np.arange(len(misfit))
    leader = np.argmin(misfit, axis=1)
    fitness[np.all(population == population[among, leader][:, None], axis=2)] = 0.0
    fitness[among, leader] = np.isfinite(misfit[among, leader])
    return fitness


def _crossover(population: Floats, misfit: Floats, share: Floats, pairs: NDArray[np.int64]) -> Floats:
    """In each pair, one pair after the other, the less fit moves by a share r towards the fitter, which stays."""
    n_replicates, size, n_params = population.shape
    rank = np.empty(misfit.shape, dtype=np.int64)
    np.put_along_axis(rank, np.argsort(misfit, axis=1, kind="stable"), np.arange(size)[None], axis=1)
    first, second = pairs[:, 0], pairs[:, 1]
    swap = np.take_along_axis(rank, first, axis=1) > np.take_along_axis(rank, second, axis=1)
    moved, guide = np.where(swap, first, second), np.where(swap, second, first)
    offset = size * np.arange(n_replicates)[:, None]
    # No chromosome moves towards a failure.
    counts = np.isfinite(np.take_along_axis(misfit, guide, axis=1))
    to, at = (guide + offset)[counts], (moved + offset)[counts]
    by = np.repeat(share, np.count_nonzero(counts, axis=1))
    crossed = population.reshape(-1, n_params).copy()
    while at.size:
        now = _independent(to, at, len(crossed))
        here = crossed[at[now]]
        # r*fitter + (1-r)*less_fit, in the form that leaves equal chromosomes equal bit for bit.
        crossed[at[now]] = here + by[now, None] * (crossed[to[now]] - here)
        to, at, by = to[~now], at[~now], by[~now]
    return crossed.reshape(population.shape)


def _independent(to: NDArray[np.int64], at: NDArray[np.int64], size: int) -> NDArray[np.bool_]:
    """Remaining pairs that can be crossed at once with the result of crossing one after the other.

    A pair must wait for earlier pairs that move one of its two chromosomes, or that use the one it moves. That takes
    about ten rounds instead of one per pair.
    """
    order = np.arange(at.size)
    first_to_move = np.full(size, at.size)
    first_to_guide = np.full(size, at.size)
    # Of repeated indices the last assignment remains; in reversed order that is the first pair.
    first_to_move[at[::-1]] = order[::-1]
    first_to_guide[to[::-1]] = order[::-1]
    alone = (first_to_move[at] == order) & (first_to_move[to] > order) & (first_to_guide[at] > order)
    return np.asarray(alone)


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

    population: Annotated[int, Within(least=5, most=LARGEST_POPULATION)] = 60
    base: Literal["best", "random"] = "best"
    factor: Annotated[tuple[float, float], Within(least=0.0, most=2.0)] = (0.5, 1.0)
    crossover_probability: Share = 0.7
    stop: StopRules = field(default_factory=StopRules)
    elite: EliteRule = field(default_factory=EliteRule)

    def __post_init__(self) -> None:
        least, greatest = self.factor
        if least > greatest:
            raise SettingError(f"`factor` is from {least:g} to {greatest:g}; give the smaller one first")

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
