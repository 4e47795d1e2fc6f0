"""Points of the cube and random numbers: hypercube, reflection, draws of others, streams, elite."""

from __future__ import annotations

import math

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from mrwork.search import EliteRule
from mrwork.search.rules import distinct_best
from mrwork.search.unit_cube import Streams, latin_hypercube, others, reflect


def streams(rng=0, replicates=(0,), generation=0):
    number = np.array(replicates)
    return Streams(rng=rng, replicate=number, generation=np.full(number.shape, generation))


# Streams


def test_a_stream_depends_on_seed_replicate_generation_and_purpose_alone():
    drawn = streams(3, [0, 1, 9], 4).uniform(5)
    assert np.array_equal(drawn[2:], streams(3, [9], 4).uniform(5))
    everything = [
        drawn,
        streams(3, [0, 1, 9], 5).uniform(5),
        streams(4, [0, 1, 9], 4).uniform(5),
        streams(3, [0, 1, 9], 4).normal(np.array([5, 5, 5])),
    ]
    assert np.unique(np.concatenate([each.ravel() for each in everything])).size == 60


def test_normal_numbers_are_counted_for_each_replicate():
    few = streams(3, [0, 1, 9]).normal(np.array([2, 0, 3]))
    many = streams(3, [0, 1, 9]).normal(np.array([4, 4, 4])).reshape(3, 4)
    assert np.array_equal(few, np.concatenate([many[0, :2], many[2, :3]]))


def test_neighbouring_streams_are_uncorrelated():
    drawn = np.concatenate([streams(0, range(20), generation).uniform(2000) for generation in range(3)])
    correlation = np.corrcoef(drawn)[~np.eye(60, dtype=bool)]
    # Five standard deviations of 1770 correlations, 1/sqrt(2000) each.
    assert np.abs(correlation).max() < 5 / math.sqrt(2000)


# The cube


@pytest.mark.parametrize("n_params", [1, 6])
def test_hypercube_has_one_point_in_each_stratum_of_each_gene(n_params):
    points = latin_hypercube(streams(3, [0, 1]), 50, n_params)
    strata = np.sort((points * 50).astype(int), axis=1)
    assert np.array_equal(strata, np.broadcast_to(np.arange(50)[:, None], (2, 50, n_params)))
    assert not np.array_equal(points[0], points[1])


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=20))
def test_reflection_stays_inside_and_leaves_the_inside_alone(genes):
    gene = np.array(genes)
    folded = reflect(gene)
    assert np.all((folded >= 0.0) & (folded <= 1.0))
    inside = (gene >= 0.0) & (gene <= 1.0)
    assert np.array_equal(folded[inside], gene[inside])


def test_reflection_mirrors_at_both_faces():
    assert reflect(np.array([-0.25, 1.25, 2.25, -1.75])) == pytest.approx([0.25, 0.75, 0.25, 0.25])


def test_reflected_mutation_leaves_a_uniform_population_uniform_where_clipping_would_not():
    rng = np.random.default_rng(5)
    gene = rng.random(200_000) + 0.29 * rng.standard_normal(200_000)
    share = np.histogram(reflect(gene), bins=20, range=(0, 1))[0] / gene.size
    # Four standard deviations of a binomial share of 1/20.
    assert np.all(np.abs(share - 0.05) < 4 * math.sqrt(0.05 * 0.95 / gene.size))
    assert np.mean(np.clip(gene, 0, 1) == 0.0) > 0.1


def test_others_are_different_and_every_choice_is_equally_likely():
    size, n_draws = 5, 20_000
    drawn = others(np.random.default_rng(1).random((n_draws, size, 3)), size)
    everyone = np.concatenate([np.broadcast_to(np.arange(size)[:, None], (n_draws, size, 1)), drawn], axis=2)
    assert np.all(np.diff(np.sort(everyone, axis=2), axis=2) > 0)
    assert drawn.min() == 0
    assert drawn.max() == size - 1
    # Of the first member: 4 * 3 * 2 ordered choices; five standard deviations of a binomial share.
    _, counts = np.unique(drawn[:, 0] @ [25, 5, 1], return_counts=True)
    assert counts.size == 24
    assert np.all(np.abs(counts / n_draws - 1 / 24) < 5 * math.sqrt(1 / 24 / n_draws))


# Elite


def taken_of(population, misfit, count, distance):
    kept = distinct_best(population[None], misfit[None], EliteRule(count=count, distance=distance))[0]
    return kept[kept >= 0]


@examples(50)
@given(rng=st.integers(0, 10**6), count=st.integers(1, 12), distance=st.floats(0.0, 1.0))
def test_distinct_best_leaves_out_only_what_is_worse_and_near(rng, count, distance):
    draw = np.random.default_rng(rng)
    population, misfit = draw.random((30, 2)), draw.random(30)
    misfit[draw.random(30) < 0.3] = np.inf
    taken = taken_of(population, misfit, count, distance)
    assert len(set(taken)) == len(taken) <= count
    assert np.all(np.isfinite(misfit[taken]))
    assert np.all(np.diff(misfit[taken]) >= 0.0)
    gap = np.abs(population[taken][:, None] - population[taken][None]).max(axis=2)
    assert np.all(gap[~np.eye(len(taken), dtype=bool)] >= distance)
    for row in set(np.flatnonzero(np.isfinite(misfit))) - set(taken):
        better = taken[misfit[taken] <= misfit[row]]
        near = np.abs(population[better] - population[row]).max(axis=1, initial=0.0) < distance
        assert near.any() or len(better) == count


def test_distinct_best_of_many_populations_is_that_of_each():
    draw = np.random.default_rng(0)
    population, misfit = draw.random((6, 40, 3)), draw.random((6, 40))
    misfit[draw.random(misfit.shape) < 0.3] = np.inf
    misfit[4] = np.inf
    rule = EliteRule(count=7, distance=0.3)
    together = distinct_best(population, misfit, rule)
    alone = [distinct_best(population[[row]], misfit[[row]], rule)[0] for row in range(6)]
    assert np.array_equal(together, alone)
    assert np.all(together[4] == -1)
