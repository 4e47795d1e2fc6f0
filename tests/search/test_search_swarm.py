"""Particle swarm and differential evolution: what they do to their members."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from search_problems import generations_of, half_failing, sphere, states
from sentences import Refused

from mrwork.search import CONSTRICTION, DifferentialEvolution, ParticleSwarm


@pytest.mark.parametrize("swarm", [ParticleSwarm(), CONSTRICTION])
def test_no_particle_moves_beyond_the_velocity_limit(swarm):
    run = states(swarm, half_failing, n_params=3, rng=1, generations=30)
    for before, after in itertools.pairwise(run):
        assert np.abs(after.position - before.position).max() <= swarm.velocity_limit + 1e-15
    assert np.abs(run[0].velocity).max() <= swarm.velocity_limit


def test_without_attraction_a_swarm_coasts():
    swarm = ParticleSwarm(own_attraction=0.0, common_attraction=0.0, inertia=(0.5, 0.5))
    run = states(swarm, sphere, n_params=2, rng=0, generations=3)
    inside = np.abs(run[1].position - 0.5) + np.abs(run[0].velocity) < 0.5
    moved = run[2].position - run[1].position
    assert inside.sum() > 60
    assert np.allclose(moved[inside], 0.5 * run[0].velocity[inside], atol=1e-15)


def test_inertia_falls_over_the_generations_allowed():
    swarm = ParticleSwarm(own_attraction=0.0, common_attraction=0.0, velocity_limit=0.01)
    swarm = replace(swarm, stop=replace(swarm.stop, max_generations=10, confidence=None))
    run = states(swarm, sphere, n_params=2, rng=0, generations=10)
    inside = np.all([np.abs(state.position - 0.5) < 0.45 for state in run], axis=0)
    speed = [np.abs(state.velocity[inside]).max() for state in run[1:]]
    ratio = np.array(speed[1:]) / speed[:-1]
    assert ratio == pytest.approx(0.9 - 0.05 * np.arange(1, 10), rel=1e-9)


@pytest.mark.parametrize("optimiser", [ParticleSwarm(), DifferentialEvolution()])
def test_a_member_gives_way_only_to_a_better_one(optimiser):
    for before, proposal, after in generations_of(optimiser, half_failing, n_params=3, rng=0, most=30):
        simulated = proposal.member_misfits(half_failing(proposal.unit))
        assert np.array_equal(after.misfit, np.minimum(before.misfit, simulated))
        assert np.array_equal(proposal.limit, before.misfit)
        stays = simulated >= before.misfit
        assert np.array_equal(after.population[stays], before.population[stays])


@pytest.mark.parametrize("base", ["best", "random"])
def test_a_trial_has_a_gene_of_the_mutant_and_may_keep_all_others(base):
    evolution = DifferentialEvolution(base=base, crossover_probability=0.0)
    run = generations_of(evolution, sphere, n_params=5, rng=0, most=10)
    for before, proposal, _ in itertools.islice(run, 1, None):
        differs = proposal.population != before.population
        # The best itself may be the mutant's base, and two partners share a gene: then none differs.
        assert differs.sum(axis=2).max() == 1
        assert np.mean(differs.sum(axis=2) == 1) > 0.9


def test_a_range_of_factors_begins_with_the_smaller(refused: Refused):
    refused(DifferentialEvolution, factor=(0.9, 0.5))
