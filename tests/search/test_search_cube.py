"""Points of the cube and random numbers: hypercube, reflection, draws of others, streams, elite."""

import math

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from mrwork.search import EliteRule
from mrwork.search.rules import distinct_best
from mrwork.search.unit_cube import Streams, latin_hypercube, others, reflect

# Streams


def test_a_stream_depends_on_seed_generation_and_purpose_alone():
    drawn = Streams(rng=3, generation=4).uniform(2, 5)
    assert np.array_equal(drawn.ravel(), Streams(rng=3, generation=4).uniform(10))
    everything = [
        drawn,
        Streams(rng=3, generation=5).uniform(10),
        Streams(rng=4, generation=4).uniform(10),
        Streams(rng=3, generation=4).normal(10),
    ]
    assert np.unique(np.concatenate([each.ravel() for each in everything])).size == 40


def test_neighbouring_streams_are_uncorrelated():
    drawn = [Streams(rng=rng, generation=k).uniform(2000) for rng in range(20) for k in range(3)]
    correlation = np.corrcoef(drawn)[~np.eye(60, dtype=bool)]
    # Five standard deviations of 1770 correlations, 1/sqrt(2000) each.
    assert np.abs(correlation).max() < 5 / math.sqrt(2000)


# The cube


@pytest.mark.parametrize("n_params", [1, 6])
def test_hypercube_has_one_point_in_each_stratum_of_each_gene(n_params):
    points = latin_hypercube(Streams(rng=3), 50, n_params)
    strata = np.sort((points * 50).astype(int), axis=0)
    assert np.array_equal(strata, np.broadcast_to(np.arange(50)[:, None], (50, n_params)))


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
    drawn = np.array([others(uniform) for uniform in np.random.default_rng(1).random((n_draws, size, 3))])
    everyone = np.concatenate([np.broadcast_to(np.arange(size)[:, None], (n_draws, size, 1)), drawn], axis=2)
    assert np.all(np.diff(np.sort(everyone, axis=2), axis=2) > 0)
    assert drawn.min() == 0
    assert drawn.max() == size - 1
    # Of the first member: 4 * 3 * 2 ordered choices; five standard deviations of a binomial share.
    _, counts = np.unique(drawn[:, 0] @ [25, 5, 1], return_counts=True)
    assert counts.size == 24
    assert np.all(np.abs(counts / n_draws - 1 / 24) < 5 * math.sqrt(1 / 24 / n_draws))


# Elite


@examples(50)
@given(rng=st.integers(0, 10**6), count=st.integers(1, 12), distance=st.floats(0.0, 1.0))
def test_distinct_best_leaves_out_only_what_is_worse_and_near(rng, count, distance):
    draw = np.random.default_rng(rng)
    population, misfit = draw.random((30, 2)), draw.random(30)
    misfit[draw.random(30) < 0.3] = np.inf
    taken = distinct_best(population, misfit, EliteRule(count=count, distance=distance))
    assert len(set(taken)) == len(taken) <= count
    assert np.all(np.isfinite(misfit[taken]))
    assert np.all(np.diff(misfit[taken]) >= 0.0)
    gap = np.abs(population[taken][:, None] - population[taken][None]).max(axis=2)
    assert np.all(gap[~np.eye(len(taken), dtype=bool)] >= distance)
    for row in set(np.flatnonzero(np.isfinite(misfit))) - set(taken):
        better = taken[misfit[taken] <= misfit[row]]
        near = np.abs(population[better] - population[row]).max(axis=1, initial=0.0) < distance
        assert near.any() or len(better) == count
