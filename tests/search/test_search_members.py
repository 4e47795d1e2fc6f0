"""Genetic algorithms, particle swarm, differential evolution: what each saves and does to its members."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from search_problems import (
    all_failing,
    flat,
    generations_of,
    half_failing,
    only_capped,
    ripples,
    rosenbrock,
    sphere,
    states,
)

from mrwork.search import DifferentialEvolution, EfficientGA, ParticleSwarm, StandardGA, run_search
from mrwork.search.evolution import _crossover, _fitness, _roulette
from mrwork.search.particle_swarm import CONSTRICTION

# The efficient algorithm


@pytest.mark.parametrize("optimiser", [EfficientGA(), StandardGA()])
def test_no_chromosome_that_is_known_is_simulated_again(optimiser):
    for before, proposal, after in itertools.islice(
        generations_of(optimiser, half_failing, n_params=3, rng=4, most=40), 1, None
    ):
        known = {row.tobytes() for row in before.population}
        asked = [row.tobytes() for row in proposal.unit]
        assert not known.intersection(asked)
        assert after.course.evaluations - before.course.evaluations == len(asked)
        changed = {row.tobytes() for row in after.population} - known
        assert changed - {before.course.best_unit.tobytes()} == set(asked)


@pytest.mark.parametrize("optimiser", [EfficientGA(), StandardGA()])
def test_known_misfits_belong_to_their_chromosomes(optimiser):
    for state in states(optimiser, half_failing, n_params=3, rng=9, generations=40)[1:]:
        assert np.allclose(state.misfit, half_failing(state.population), rtol=1e-12, atol=0.0)


def test_mutation_spread_is_that_of_the_initial_population():
    state = EfficientGA().start(5, rng=1)
    assert np.array_equal(state.extra, state.population.std(axis=0))
    # One point per stratum: the spread of a uniform density to within the size of a stratum.
    assert np.allclose(state.extra, 1.0 / math.sqrt(12.0), atol=1.0 / 60)


@pytest.mark.parametrize("rng", range(5))
def test_fewer_simulations_than_population_times_generations(rng):
    state = states(only_capped(100), sphere, n_params=4, rng=rng, generations=100)[-1]
    full = 60 * 100
    # Crossover alone leaves (1 - e^-2)/2 = 43 % as they are; mutation and elitism move that a little.
    assert full / 3 < state.course.evaluations < 2 * full / 3 + 60


@pytest.mark.parametrize("optimiser", [EfficientGA(elite_share=0.1), StandardGA()])
@pytest.mark.parametrize("rng", range(5))
def test_best_chromosome_survives(optimiser, rng):
    for state in states(optimiser, sphere, n_params=3, rng=rng, generations=30)[1:]:
        assert np.any(np.all(state.population == state.course.best_unit, axis=1))
        assert state.misfit.min() == state.course.best_misfit


def test_copies_of_the_best_do_not_crowd_the_population_out():
    state = states(only_capped(200), flat, n_params=3, rng=0, generations=200)[-1]
    copies = np.count_nonzero(np.all(state.population == state.course.best_unit, axis=1))
    # The best, this generation's copy and no heap of old ones, although no generation improved.
    assert copies <= 2


@given(st.lists(st.floats(0.0, 1e300) | st.just(math.inf), min_size=4, max_size=20))
def test_fitness_is_one_for_the_best_alone_where_any_succeed_and_zero_for_failures(misfits):
    misfit = np.array(misfits)
    population = np.arange(misfit.size, dtype=float)[:, None]
    fitness = _fitness(population, misfit)
    assert np.all((fitness >= 0.0) & (fitness <= 1.0))
    assert np.all(fitness[np.isinf(misfit)] == 0.0)
    assert (fitness[np.argmin(misfit)] == 1.0) == np.isfinite(misfit).any()
    finite = np.isfinite(misfit)
    order = np.argsort(misfit[finite], kind="stable")
    assert np.all(np.diff(fitness[finite][order][1:]) <= 0.0)


def test_of_each_pair_the_less_fit_moves_towards_the_fitter_one_pair_after_the_other():
    population, misfit = np.array([[0.0], [1.0], [0.0], [0.25]]), np.array([2.0, 1.0, np.inf, np.inf])
    first, second = np.array([0, 2, 2, 1]), np.array([1, 0, 3, 0])
    # 0 towards 1, 2 towards where 0 then is, neither of two failures, 0 towards 1 again.
    crossed = _crossover(population, misfit, 0.5, first, second)
    assert crossed.ravel() == pytest.approx([0.75, 1.0, 0.25, 0.25])


@pytest.mark.parametrize("rng", range(2))
@pytest.mark.parametrize(
    ("objective", "n_params", "optimum", "tolerance"),
    # Mutation never shrinks, so the search is coarse by design and a local refinement goes on from there.
    # Along the floor of the curved valley the misfit hardly changes: 4e-4 at a distance of 0.01.
    [(sphere, 4, 0.3, 0.001), (rosenbrock, 2, 0.75, 0.05)],
)
def test_minimum_is_found(objective, n_params, optimum, tolerance, rng):
    result = run_search(only_capped(300), objective, rng=rng, n_params=n_params)
    assert np.abs(result.best_unit - optimum).max() < tolerance


def test_least_of_many_minima_is_mostly_the_best_and_nearly_always_among_the_elite():
    runs = [run_search(only_capped(300), ripples, rng=rng, n_params=4) for rng in range(10)]
    best = sum(np.abs(run.best_unit - 0.4).max() < 0.03 for run in runs)
    # The neighbouring minima lie 0.25 away: a start within 0.1 is in the right basin.
    elite = sum(np.abs(run.elite - 0.4).max(axis=1).min() < 0.1 for run in runs)
    assert best >= 7
    assert elite >= 9


def test_a_single_success_among_failures_is_kept():
    optimiser = EfficientGA()
    start = optimiser.start(2, rng=0)
    proposal = optimiser.ask(start)
    state = optimiser.tell(start, proposal, np.where(np.arange(60) == 7, 1.0, np.inf))
    assert np.array_equal(state.course.best_unit, start.population[7])
    proposal = optimiser.ask(state)
    after = optimiser.tell(state, proposal, all_failing(proposal.unit))
    assert np.array_equal(after.course.best_unit, start.population[7])
    assert after.misfit.min() == 1.0


# The standard algorithm


def test_roulette_draws_in_proportion_to_fitness():
    for fitness, expected in (([0.0, 1.0, 3.0, 0.0], [0.0, 0.25, 0.75, 0.0]), ([0.0] * 4, [0.25] * 4)):
        drawn = _roulette(np.array(fitness), np.random.default_rng(0).random(40_000))
        # Five standard deviations of a binomial share of one half.
        assert np.bincount(drawn, minlength=4) / drawn.size == pytest.approx(expected, abs=0.0125)


def test_without_crossover_and_mutation_nothing_new_is_simulated():
    optimiser = StandardGA(crossover_probability=0.0, mutation_probability=0.0)
    state = states(optimiser, sphere, n_params=3, rng=0, generations=5)[-1]
    assert state.course.evaluations == 60


@pytest.mark.parametrize("population", [7, 8])
def test_an_odd_population_keeps_its_size(population):
    run = states(replace(StandardGA(), population=population), sphere, n_params=3, rng=0, generations=3)
    assert all(state.population.shape == (population, 3) for state in run)


@pytest.mark.parametrize("swarm", [ParticleSwarm(), CONSTRICTION])
def test_no_particle_moves_beyond_the_velocity_limit(swarm):
    run = states(swarm, half_failing, n_params=3, rng=1, generations=30)
    for before, after in itertools.pairwise(run):
        assert np.abs(after.extra.position - before.extra.position).max() <= swarm.velocity_limit + 1e-15
    assert np.abs(run[0].extra.velocity).max() <= swarm.velocity_limit


def test_without_attraction_a_swarm_coasts():
    swarm = ParticleSwarm(own_attraction=0.0, common_attraction=0.0, inertia=(0.5, 0.5))
    run = states(swarm, sphere, n_params=2, rng=0, generations=3)
    inside = np.abs(run[1].extra.position - 0.5) + np.abs(run[0].extra.velocity) < 0.5
    moved = run[2].extra.position - run[1].extra.position
    assert inside.sum() > 60
    assert np.allclose(moved[inside], 0.5 * run[0].extra.velocity[inside], atol=1e-15)


def test_inertia_falls_over_the_generations_allowed():
    swarm = ParticleSwarm(own_attraction=0.0, common_attraction=0.0, velocity_limit=0.01)
    swarm = replace(swarm, stop=replace(swarm.stop, max_generations=10, confidence=None))
    run = states(swarm, sphere, n_params=2, rng=0, generations=10)
    inside = np.all([np.abs(state.extra.position - 0.5) < 0.45 for state in run], axis=0)
    speed = [np.abs(state.extra.velocity[inside]).max() for state in run[1:]]
    ratio = np.array(speed[1:]) / speed[:-1]
    assert ratio == pytest.approx(0.9 - 0.05 * np.arange(1, 10), rel=1e-9)


@pytest.mark.parametrize("optimiser", [ParticleSwarm(), DifferentialEvolution()])
def test_a_member_gives_way_only_to_a_better_one(optimiser):
    for before, proposal, after in generations_of(optimiser, half_failing, n_params=3, rng=0, most=30):
        simulated = half_failing(proposal.unit)
        assert np.array_equal(after.misfit, np.minimum(before.misfit, simulated))
        stays = simulated >= before.misfit
        assert np.array_equal(after.population[stays], before.population[stays])


@pytest.mark.parametrize("base", ["best", "random"])
def test_a_trial_has_a_gene_of_the_mutant_and_may_keep_all_others(base):
    evolution = DifferentialEvolution(base=base, crossover_probability=0.0)
    run = generations_of(evolution, sphere, n_params=5, rng=0, most=10)
    for before, proposal, _ in itertools.islice(run, 1, None):
        differs = proposal.population != before.population
        # The best itself may be the mutant's base, and two partners share a gene: then none differs.
        assert differs.sum(axis=1).max() == 1
        assert np.mean(differs.sum(axis=1) == 1) > 0.9
