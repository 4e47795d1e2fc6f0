"""What every optimiser promises: one that is listed in the registry is tested, without an edit here."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from refusals import refusal
from search_problems import (
    all_failing,
    bits,
    generations_of,
    half_failing,
    optimiser_named,
    rosenbrock,
    sphere,
    states,
)

from mrwork.errors import SettingError
from mrwork.search import OPTIMISERS, PEERS, EliteRule, StopRules, run_search

SHORT = StopRules(max_generations=15, min_generations=1, confidence=None, spread_tolerance=None)


@pytest.fixture(params=OPTIMISERS)
def own(request):
    """Every optimiser of our own in turn, whose states are plain data."""
    return OPTIMISERS[request.param]


@pytest.fixture(params=[*OPTIMISERS, *PEERS])
def optimiser(request):
    """Every optimiser in turn, those of other libraries included."""
    return optimiser_named(request.param)


# Randomness


def test_one_seed_repeats_and_two_differ(optimiser):
    runs = [states(optimiser, half_failing, n_params=4, rng=rng, generations=10)[-1] for rng in (7, 7, 8)]
    assert bits(runs[0].course) == bits(runs[1].course)
    assert np.array_equal(runs[0].population, runs[1].population)
    assert not np.array_equal(runs[0].population, runs[2].population)


# Asking


def test_what_is_asked_lies_in_the_cube(optimiser):
    optimiser = replace(optimiser, stop=SHORT)
    for _, proposal, _ in generations_of(optimiser, half_failing, n_params=4, rng=2, most=15):
        unit = proposal.unit
        assert unit.shape == (np.count_nonzero(proposal.changed), 4)
        assert unit.min() >= 0.0
        assert unit.max() <= 1.0


def test_evaluations_are_those_asked_and_never_exceed_their_cap(optimiser):
    most = 3 * optimiser.population + 7
    asked = []

    def counted(unit):
        asked.append(len(unit))
        return sphere(unit)

    result = run_search(replace(optimiser, stop=StopRules(max_evaluations=most)), counted, rng=0, n_params=3)
    assert result.stop_reason == "max_evaluations"
    assert most - optimiser.population < result.evaluations == sum(asked) <= most


# Telling


def test_best_never_rises_and_is_the_least_ever_told(optimiser):
    least = []

    def watched(unit):
        misfit = half_failing(unit)
        least.append(misfit.min())
        return misfit

    course = states(optimiser, watched, n_params=4, rng=3, generations=40)[-1].course
    assert np.array_equal(course.trace.best, np.minimum.accumulate(least))
    assert half_failing(course.best_unit[None])[0] == pytest.approx(course.best_misfit, rel=1e-12)
    assert np.array_equal(course.elite[0], course.best_unit)


def test_failures_at_first_do_not_break_it(optimiser):
    calls = []

    def late(unit):
        calls.append(len(unit))
        return all_failing(unit) if len(calls) <= 3 else sphere(unit)

    with np.errstate(invalid="raise", divide="raise", over="raise"):
        run = states(optimiser, late, n_params=3, rng=0, generations=60)
    assert run[3].course.best_misfit == math.inf
    assert not run[3].course.elite_misfit.size
    assert np.all(np.isfinite(run[-1].population))
    assert not np.isnan(run[-1].course.trace.median).any()
    assert run[-1].course.best_misfit < 0.02


def test_failures_everywhere_end_as_a_stall_with_nothing_found(optimiser):
    result = run_search(optimiser, all_failing, rng=0, n_params=2)
    assert result.stop_reason == "stall"
    assert result.best_misfit == math.inf
    assert result.elite.shape == (0, 2)


@pytest.mark.parametrize("bad", [math.nan, -1.0, -math.inf])
def test_a_misfit_that_is_no_misfit_is_refused_by_row(optimiser, bad):
    state = optimiser.start(2, rng=0)
    proposal = optimiser.ask(state)
    misfit = np.ones(len(proposal.unit))
    misfit[3] = bad
    with pytest.raises(SettingError, match="row 3"):
        optimiser.tell(state, proposal, misfit)


# Stored states


def test_ask_and_tell_are_pure(own):
    state = states(own, sphere, n_params=3, rng=1, generations=5)[-1]
    before = pickle.dumps(state)
    proposal = own.ask(state)
    own.tell(state, proposal, sphere(proposal.unit))
    assert np.array_equal(own.ask(state).unit, proposal.unit)
    assert pickle.dumps(state) == before


@pytest.mark.parametrize("rng", [3, 2**64 - 1])
def test_a_pickled_state_goes_on(own, rng):
    own = replace(own, stop=SHORT)
    run = states(own, half_failing, n_params=3, rng=rng, generations=15)
    stored = pickle.loads(pickle.dumps(run[6]))
    rest = run_search(own, half_failing, rng=rng, n_params=3, state=stored)
    assert bits(rest.state) == bits(run[-1])


# Finding


# 6000 points at random come to 0.03 of the sphere, and in the median to 5.3 of the valley in four dimensions.
@pytest.mark.parametrize(("objective", "level"), [(sphere, 1e-4), (rosenbrock, 3.0)])
def test_level_is_reached_in_the_median_within_six_thousand_simulations(optimiser, objective, level):
    rules = StopRules(target=level, max_evaluations=6000, max_generations=10**4, confidence=None)
    search = replace(optimiser, stop=rules, elite=EliteRule(count=1))
    runs = [run_search(search, objective, rng=rng, n_params=4) for rng in range(7)]
    assert np.median([run.best_misfit for run in runs]) <= level


@pytest.mark.parametrize("name", PEERS)
def test_a_library_can_be_told_once(name):
    peer = optimiser_named(name)
    state = peer.start(2, rng=0)
    proposal = peer.ask(state)
    assert np.array_equal(peer.ask(state).unit, proposal.unit)
    peer.tell(state, proposal, sphere(proposal.unit))
    refusal(peer.tell, state, proposal, sphere(proposal.unit), match="library is at generation 1")


@pytest.mark.parametrize("name", PEERS)
def test_a_library_leaves_the_random_numbers_of_others_alone(name):
    peer = optimiser_named(name)
    # The one generator that all of NumPy shares is the very one meant here.
    np.random.seed(5)  # noqa: NPY002 - the global state is what is looked at
    before = np.random.get_state()[1].tobytes()  # noqa: NPY002 - the global state is what is looked at
    state = peer.start(2, rng=0)
    for _ in range(3):
        proposal = peer.ask(state)
        state = peer.tell(state, proposal, sphere(proposal.unit))
    assert np.random.get_state()[1].tobytes() == before  # noqa: NPY002 - the global state is what is looked at
