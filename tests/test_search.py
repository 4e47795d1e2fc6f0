"""Search of the unit cube: the efficient genetic algorithm, its stops, and the loop around it."""

from __future__ import annotations

import itertools
import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrwork.errors import SettingError
from mrwork.search import (
    EfficientGA,
    SearchInterrupted,
    distinct_best,
    expected_termination,
    run_search,
)
from mrwork.search.genetic import _crossover, _fitness, _reflect
from mrwork.search.termination import first_improvement, hypothesis_test, stalled, statistic, threshold


def sphere(unit):
    """Minimum 0 at 0.3 in every gene; the misfit at distance d is d squared."""
    return np.sum((unit - 0.3) ** 2, axis=1)


def rosenbrock(unit):
    """Curved valley on [-2, 2]^2, minimum 0 at (1, 1), that is 0.75 in the cube."""
    x, y = 4.0 * unit.T - 2.0
    return (1.0 - x) ** 2 + 100.0 * (y - x**2) ** 2


def ripples(unit):
    """Rastrigin's shape on [-1.6, 2.4]^n: a dozen local minima >= 0.97, the least 0 at 0.4 in every gene."""
    x = 4.0 * (unit - 0.4)
    return np.sum(x**2 + 2.0 * (1.0 - np.cos(2.0 * np.pi * x)), axis=1)


def half_failing(unit):
    """Sphere with a forbidden half: every simulation with a first gene above 0.5 diverges."""
    return np.where(unit[:, 0] > 0.5, np.inf, sphere(unit))


def never_stopping(**settings_):
    """Settings whose only stop is the cap on generations, to look at the algorithm alone."""
    return EfficientGA(min_generations=10**9, **settings_)


def states(optimiser, objective, *, n_params, rng, generations):
    """Every state of a run, from the start."""
    run = [optimiser.start(n_params, rng)]
    for _ in range(generations):
        run.append(optimiser.tell(run[-1], objective(optimiser.ask(run[-1]))))
    return run


def assert_same_bits(one, other):
    for name in ("population", "misfit", "mutation_spread", "best_unit", "elite_unit", "elite_misfit"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name
    for name in ("evaluations", "best", "median"):
        assert getattr(one.trace, name).tobytes() == getattr(other.trace, name).tobytes(), name
    for name in ("rng", "generation", "evaluations", "best_misfit"):
        assert getattr(one, name) == getattr(other, name), name


# The algorithm


@pytest.mark.parametrize("objective", [sphere, ripples, half_failing])
@pytest.mark.parametrize("rng", range(3))
def test_best_never_worsens_and_is_the_least_misfit_ever_told(objective, rng):
    least = []

    def watched(unit):
        misfit = objective(unit)
        least.append(misfit.min())
        return misfit

    run = states(EfficientGA(), watched, n_params=4, rng=rng, generations=60)
    best = run[-1].trace.best
    assert np.all(np.diff(best) <= 0.0)
    assert np.array_equal(best, np.minimum.accumulate(least))
    assert objective(run[-1].best_unit[None])[0] == run[-1].best_misfit


def test_exactly_the_chromosomes_that_changed_are_simulated():
    optimiser = EfficientGA()
    run = states(optimiser, half_failing, n_params=3, rng=4, generations=40)
    for before, after in itertools.pairwise(run[1:]):
        known = {row.tobytes() for row in before.population} | {before.best_unit.tobytes()}
        asked = [row.tobytes() for row in optimiser.ask(before)]
        assert not known.intersection(asked)
        changed = [row.tobytes() for row in after.population if row.tobytes() not in known]
        assert asked == changed
        assert after.evaluations - before.evaluations == len(asked)


def test_known_misfits_belong_to_their_chromosomes():
    for state in states(EfficientGA(), half_failing, n_params=3, rng=9, generations=40)[1:]:
        # One row at a time: NumPy may sum a batch in another order than a single row.
        assert np.allclose(state.misfit, half_failing(state.population), rtol=1e-12, atol=0.0)


def test_first_generation_simulates_everyone_and_covers_every_stratum():
    optimiser = EfficientGA(population=50)
    initial = optimiser.ask(optimiser.start(6, rng=3))
    assert initial.shape == (50, 6)
    strata = np.sort((initial * 50).astype(int), axis=0)
    assert np.array_equal(strata, np.tile(np.arange(50)[:, None], (1, 6)))


def test_mutation_spread_is_that_of_the_initial_population():
    state = EfficientGA().start(5, rng=1)
    assert np.array_equal(state.mutation_spread, state.population.std(axis=0))
    # One point per stratum: the spread of a uniform density to within the size of a stratum.
    assert np.allclose(state.mutation_spread, 1.0 / math.sqrt(12.0), atol=1.0 / 60)


@pytest.mark.parametrize("rng", range(5))
def test_fewer_simulations_than_population_times_generations(rng):
    state = states(EfficientGA(), sphere, n_params=4, rng=rng, generations=100)[-1]
    full = 60 * 100
    # Crossover alone leaves (1 - e^-2)/2 = 43 % as they are; mutation and elitism move that a little.
    assert full / 3 < state.evaluations < 2 * full / 3 + 60


@pytest.mark.parametrize("rng", range(5))
def test_best_chromosome_survives_and_elite_copies_are_free(rng):
    for state in states(EfficientGA(elite_share=0.1), sphere, n_params=3, rng=rng, generations=30)[1:]:
        assert np.any(np.all(state.population == state.best_unit, axis=1))
        assert state.misfit.min() == state.best_misfit


def test_copies_of_the_best_do_not_crowd_the_population_out():
    state = states(EfficientGA(), lambda unit: 1.0 + 0.0 * unit[:, 0], n_params=3, rng=0, generations=200)[-1]
    copies = np.count_nonzero(np.all(state.population == state.best_unit, axis=1))
    # The best, this generation's copy and no heap of old ones, although no generation improved.
    assert copies <= 2


def test_population_stays_in_the_unit_cube():
    for state in states(EfficientGA(), sphere, n_params=4, rng=2, generations=50):
        assert state.population.min() >= 0.0
        assert state.population.max() <= 1.0


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


def test_of_two_failures_neither_moves():
    population = np.random.default_rng(0).random((6, 3))
    misfit = np.array([np.inf, 2.0, np.inf, np.inf, np.inf, np.inf])
    failed = _crossover(np.random.default_rng(1), population, np.full(6, np.inf))
    assert np.array_equal(failed, population)
    # With one success, every failure that moves does so on the line towards it.
    for before, after in zip(
        population, _crossover(np.random.default_rng(1), population, misfit), strict=True
    ):
        offset, way = after - before, population[1] - before
        assert np.allclose(np.outer(offset, way), np.outer(way, offset), atol=1e-15)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=20))
def test_reflection_stays_inside_and_leaves_the_inside_alone(genes):
    gene = np.array(genes)
    folded = _reflect(gene)
    assert np.all((folded >= 0.0) & (folded <= 1.0))
    inside = (gene >= 0.0) & (gene <= 1.0)
    assert np.array_equal(folded[inside], gene[inside])


def test_reflection_mirrors_at_both_faces():
    assert _reflect(np.array([-0.25, 1.25, 2.25, -1.75])) == pytest.approx([0.25, 0.75, 0.25, 0.25])


def test_reflected_mutation_leaves_a_uniform_population_uniform_where_clipping_would_not():
    rng = np.random.default_rng(5)
    gene = rng.random(200_000) + 0.29 * rng.standard_normal(200_000)
    share = np.histogram(_reflect(gene), bins=20, range=(0, 1))[0] / gene.size
    # Four standard deviations of a binomial share of 1/20.
    assert np.all(np.abs(share - 0.05) < 4 * math.sqrt(0.05 * 0.95 / gene.size))
    assert np.mean(np.clip(gene, 0, 1) == 0.0) > 0.1


@pytest.mark.parametrize("rng", range(5))
@pytest.mark.parametrize(
    ("objective", "n_params", "optimum", "tolerance"),
    # Mutation never shrinks, so the search is coarse by design and a local refinement goes on from there.
    # Along the floor of the curved valley the misfit hardly changes: 4e-4 at a distance of 0.01.
    [(sphere, 4, 0.3, 0.001), (rosenbrock, 2, 0.75, 0.05)],
)
def test_minimum_is_found(objective, n_params, optimum, tolerance, rng):
    result = run_search(never_stopping(max_generations=300), objective, rng=rng, n_params=n_params)
    assert np.abs(result.best_unit - optimum).max() < tolerance


def test_least_of_many_minima_is_mostly_the_best_and_nearly_always_among_the_elite():
    runs = [
        run_search(never_stopping(max_generations=300), ripples, rng=rng, n_params=4) for rng in range(10)
    ]
    best = sum(np.abs(run.best_unit - 0.4).max() < 0.03 for run in runs)
    # The neighbouring minima lie 0.25 away: a start within 0.1 is in the right basin.
    elite = sum(np.abs(run.elite - 0.4).max(axis=1).min() < 0.1 for run in runs)
    assert best >= 7
    assert elite >= 9


@pytest.mark.parametrize("rng", range(3))
def test_search_beats_pure_chance_at_equal_cost(rng):
    result = run_search(never_stopping(max_generations=100), ripples, rng=rng, n_params=4)
    chance = np.random.default_rng(rng).random((result.evaluations, 4))
    assert result.best_misfit < 0.5 * ripples(chance).min()


# Failures


def test_generations_that_fail_wholly_do_not_break_it():
    optimiser = EfficientGA()
    calls = []

    def late(unit):
        calls.append(len(unit))
        return np.full(len(unit), np.inf) if len(calls) <= 3 else sphere(unit)

    with np.errstate(all="raise"):
        run = states(optimiser, late, n_params=3, rng=0, generations=30)
    assert run[3].best_misfit == math.inf
    assert run[3].elite_unit.shape == (0, 3)
    assert np.all(np.isfinite(run[-1].population))
    assert not np.isnan(run[-1].trace.median).any()
    assert run[-1].best_misfit < 0.01


def test_failures_everywhere_end_as_a_stall_with_nothing_found():
    result = run_search(
        EfficientGA(), lambda unit: np.full(len(unit), np.inf), rng=0, n_params=2, max_evaluations=10_000
    )
    assert result.stop_reason == "stall"
    assert result.best_misfit == math.inf
    assert result.elite.shape == (0, 2)


def test_a_single_success_among_failures_is_kept():
    def lonely(unit):
        return np.where(np.arange(len(unit)) == 7, 1.0, np.inf)

    optimiser = EfficientGA()
    start = optimiser.start(2, rng=0)
    state = optimiser.tell(start, lonely(optimiser.ask(start)))
    assert np.array_equal(state.best_unit, start.population[7])
    after = optimiser.tell(state, np.full(len(optimiser.ask(state)), np.inf))
    assert np.array_equal(after.best_unit, start.population[7])
    assert after.misfit.min() == 1.0


@pytest.mark.parametrize("bad", [math.nan, -1.0, -math.inf])
def test_a_misfit_that_is_no_misfit_is_refused_by_row(bad):
    optimiser = EfficientGA()
    state = optimiser.start(2, rng=0)
    misfit = np.ones(60)
    misfit[11] = bad
    with pytest.raises(SettingError, match="row 11"):
        optimiser.tell(state, misfit)


def test_misfits_of_the_wrong_number_are_refused():
    optimiser = EfficientGA()
    with pytest.raises(SettingError, match="60 chromosomes"):
        optimiser.tell(optimiser.start(2, rng=0), np.ones(59))


@pytest.mark.parametrize(
    "setting",
    [
        {"population": 3},
        {"elite_share": 1.5},
        {"confidence": 1.0},
        {"confidence": 0.0},
        {"max_generations": 0},
        {"stall_generations": 0},
        {"floor_share": math.nan},
    ],
)
def test_settings_out_of_range_are_refused_by_name(setting):
    with pytest.raises(SettingError, match=f"`{next(iter(setting))}`"):
        EfficientGA(**setting)


# Randomness


def test_same_seed_same_bits_and_other_seeds_differ():
    runs = [states(EfficientGA(), half_failing, n_params=4, rng=rng, generations=25)[-1] for rng in (7, 7, 8)]
    assert_same_bits(runs[0], runs[1])
    assert not np.array_equal(runs[0].population, runs[2].population)


def test_ask_and_tell_are_pure():
    optimiser = EfficientGA()
    state = states(optimiser, sphere, n_params=3, rng=1, generations=5)[-1]
    before = pickle.dumps(state)
    first = optimiser.ask(state)
    optimiser.tell(state, sphere(first))
    assert np.array_equal(optimiser.ask(state), first)
    assert pickle.dumps(state) == before


@pytest.mark.parametrize("stop", [1, 2, 13, 39])
def test_resumed_run_equals_uninterrupted_bit_for_bit(stop):
    optimiser = never_stopping(max_generations=40)
    whole = run_search(optimiser, half_failing, rng=3, n_params=4)
    part = run_search(
        optimiser, half_failing, rng=3, n_params=4, on_generation=lambda event: event.generation == stop
    )
    assert (part.stop_reason, part.generations) == ("callback", stop)
    stored = pickle.loads(pickle.dumps(part.state))
    resumed = run_search(optimiser, half_failing, rng=3, n_params=4, state=stored)
    assert_same_bits(whole.state, resumed.state)
    assert resumed.stop_reason == whole.stop_reason == "max_generations"


def test_resuming_another_search_is_refused():
    state = EfficientGA().start(3, rng=5)
    with pytest.raises(SettingError, match="rng=5 and n_params=3"):
        run_search(EfficientGA(), sphere, rng=6, n_params=3, state=state)
    with pytest.raises(SettingError, match="rng=5 and n_params=3"):
        run_search(EfficientGA(), sphere, rng=5, n_params=4, state=state)


# Stops


def with_floor(unit):
    """What measured data does: a model error of 0.1 that no parameters remove."""
    return 0.1 + 0.1 * sphere(unit)


def flat(unit):
    return np.ones(len(unit))


@pytest.mark.parametrize(
    ("reason", "optimiser", "objective"),
    [
        ("hypothesis_test", EfficientGA(), sphere),
        ("hypothesis_test", EfficientGA(floor_share=1.0), with_floor),
        ("stall", EfficientGA(), with_floor),
        ("stall", EfficientGA(), flat),
        ("max_generations", EfficientGA(max_generations=10), sphere),
        (
            "spread",
            # Long enough for crossover alone to draw half the population onto the best.
            EfficientGA(confidence=0.999999, stall_generations=10**6, max_generations=2000),
            with_floor,
        ),
    ],
)
def test_every_stop_is_reached_and_named(reason, optimiser, objective):
    result = run_search(optimiser, objective, rng=0, n_params=3)
    assert result.stop_reason == reason
    assert optimiser.stop_reason(result.state) == reason


def test_literal_test_never_stops_on_a_model_error_floor_and_the_floored_one_does():
    literal = never_stopping(max_generations=300)
    trace = run_search(literal, with_floor, rng=0, n_params=3).trace.best
    assert not hypothesis_test(trace)
    assert hypothesis_test(trace, floor=trace[-1])


@pytest.mark.parametrize("rng", range(3))
def test_nothing_but_the_cap_stops_before_the_least_generations(rng):
    result = run_search(EfficientGA(min_generations=25, population=30), sphere, rng=rng, n_params=2)
    assert result.generations >= 25


def test_callback_returning_none_or_false_goes_on():
    answers = iter([None, False, True])
    result = run_search(EfficientGA(), sphere, rng=0, n_params=2, on_generation=lambda event: next(answers))
    assert (result.generations, result.stop_reason) == (3, "callback")


@pytest.mark.parametrize("most", [60, 61, 500])
def test_evaluations_never_exceed_their_cap(most):
    result = run_search(EfficientGA(), sphere, rng=0, n_params=3, max_evaluations=most)
    assert result.stop_reason == "max_evaluations"
    assert most - 60 < result.evaluations <= most


def test_a_cap_below_the_first_generation_is_refused():
    with pytest.raises(SettingError, match="first generation alone takes 60"):
        run_search(EfficientGA(), sphere, rng=0, n_params=3, max_evaluations=59)


# The loop


def test_events_report_what_the_result_holds():
    events = []
    result = run_search(EfficientGA(), half_failing, rng=2, n_params=3, on_generation=events.append)
    assert [event.generation for event in events] == list(range(1, result.generations + 1))
    assert [event.evaluations for event in events] == list(result.trace.evaluations)
    assert [event.best_misfit for event in events] == list(result.trace.best)
    assert [event.median_misfit for event in events] == list(result.trace.median)
    assert np.all(np.diff([event.seconds for event in events]) >= 0.0)
    assert events[-1].state is result.state
    assert np.array_equal(events[-1].best_unit, result.best_unit)
    assert result.evaluations == events[-1].evaluations


@pytest.mark.parametrize("completed", [0, 5])
def test_interrupt_carries_what_the_completed_generations_found(completed):
    calls = []

    def interrupted(unit):
        if len(calls) == completed:
            raise KeyboardInterrupt
        calls.append(unit)
        return sphere(unit)

    with pytest.raises(SearchInterrupted) as caught:
        run_search(EfficientGA(), interrupted, rng=0, n_params=3)
    result = caught.value.result
    assert isinstance(caught.value, KeyboardInterrupt)
    assert (result.stop_reason, result.generations) == ("interrupted", completed)
    assert result.best_misfit == min((sphere(unit).min() for unit in calls), default=math.inf)
    assert result.evaluations == sum(len(unit) for unit in calls)


def test_interrupted_search_goes_on_as_if_it_never_was():
    optimiser = never_stopping(max_generations=20)
    whole = run_search(optimiser, sphere, rng=0, n_params=3)
    left = iter(range(7))

    def interrupted(unit):
        if next(left, None) is None:
            raise KeyboardInterrupt
        return sphere(unit)

    with pytest.raises(SearchInterrupted) as caught:
        run_search(optimiser, interrupted, rng=0, n_params=3)
    resumed = run_search(optimiser, sphere, rng=0, n_params=3, state=caught.value.result.state)
    assert_same_bits(whole.state, resumed.state)


# Starts of a refinement


def test_elite_is_good_distant_and_led_by_the_best():
    optimiser = EfficientGA(elite_count=5, elite_distance=0.15)
    result = run_search(optimiser, ripples, rng=1, n_params=2)
    assert np.array_equal(result.elite[0], result.best_unit)
    assert np.all(np.diff(result.elite_misfit) >= 0.0)
    assert np.allclose(ripples(result.elite), result.elite_misfit, rtol=1e-12)
    gap = np.abs(result.elite[:, None] - result.elite[None]).max(axis=2)
    assert len(result.elite) == 5
    assert np.all(gap[~np.eye(5, dtype=bool)] >= 0.15)


@settings(max_examples=50, deadline=None)
@given(rng=st.integers(0, 10**6), count=st.integers(1, 12), distance=st.floats(0.0, 1.0))
def test_distinct_best_leaves_out_only_what_is_worse_and_near(rng, count, distance):
    draw = np.random.default_rng(rng)
    population, misfit = draw.random((30, 2)), draw.random(30)
    misfit[draw.random(30) < 0.3] = np.inf
    taken = distinct_best(population, misfit, count, distance)
    assert len(set(taken)) == len(taken) <= count
    assert np.all(np.isfinite(misfit[taken]))
    assert np.all(np.diff(misfit[taken]) >= 0.0)
    gap = np.abs(population[taken][:, None] - population[taken][None]).max(axis=2)
    assert np.all(gap[~np.eye(len(taken), dtype=bool)] >= distance)
    for row in set(np.flatnonzero(np.isfinite(misfit))) - set(taken):
        better = taken[misfit[taken] <= misfit[row]]
        near = np.abs(population[better] - population[row]).max(axis=1, initial=0.0) < distance
        assert near.any() or len(better) == count


def test_distinct_best_of_failures_is_empty():
    assert distinct_best(np.zeros((3, 2)), np.full(3, np.inf), 2, 0.1).size == 0


# The hypothesis test


def test_thresholds_are_those_of_the_source():
    # 0.334 at 95 % and 0.217 at 99 %.
    assert threshold(0.95) == pytest.approx(0.334, abs=5e-4)
    assert threshold(0.99) == pytest.approx(0.217, abs=5e-4)


def test_statistic_counts_from_the_first_improvement():
    best = np.array([np.inf, 9.0, 9.0, 4.0, 2.0])
    assert first_improvement(best) == 1
    assert statistic(best) == pytest.approx((9 + 9 + 4 + 2) / 4 / 9)
    assert first_improvement(np.array([9.0, 9.0, 4.0, 2.0])) == 2
    assert statistic(np.array([9.0, 9.0, 4.0, 2.0])) == pytest.approx(0.75)


@pytest.mark.parametrize("best", [[], [1.0], [1.0, 1.0], [np.inf, np.inf], [2.0, 0.0], [0.0, 0.0]])
def test_nothing_decayed_means_no_stop(best):
    assert not hypothesis_test(np.array(best))


def test_statistic_does_not_depend_on_the_unit_of_the_misfit():
    best = np.exp(-0.1 * np.arange(40))
    assert statistic(best * 1e300) == pytest.approx(statistic(best), rel=1e-12)


def test_stall_is_relative_and_needs_its_generations():
    best = np.array([2.0, 1.0, 0.9995, 0.9995])
    assert stalled(best, generations=2, tolerance=1e-3)
    assert not stalled(best, generations=2, tolerance=1e-4)
    assert not stalled(best, generations=3, tolerance=1e-3)
    assert not stalled(best, generations=4, tolerance=1e-3)
    assert stalled(np.zeros(5), generations=3, tolerance=1e-3)
    assert stalled(np.full(5, np.inf), generations=3, tolerance=1e-3)


@pytest.mark.parametrize("rate", [0.01, 0.07, 0.3, 1.0])
@pytest.mark.parametrize("confidence", [0.9, 0.95, 0.99])
@pytest.mark.parametrize("flat_start", [0, 4])
def test_expected_termination_is_where_the_test_stops_on_an_exponential(rate, confidence, flat_start):
    decay = np.concatenate([np.full(flat_start, 3.0), 3.0 * np.exp(-rate * np.arange(2000))])
    stop = next(g for g in range(1, decay.size) if hypothesis_test(decay[: g + 1], confidence=confidence))
    seen = decay[: flat_start + 6]
    expected = expected_termination(seen, confidence)
    assert expected.generation == stop
    assert expected.likelihood == pytest.approx(1.0)


def test_expected_termination_sees_the_decay_above_a_floor():
    excess = np.exp(-0.2 * np.arange(30))
    plain, floored = expected_termination(excess), expected_termination(0.1 + excess, floor=0.1)
    assert floored.generation == plain.generation


def test_noise_on_the_decay_lowers_the_likelihood():
    rng = np.random.default_rng(0)
    likelihood = []
    for noise in (0.001, 0.03, 0.3):
        trace = np.exp(-0.2 * np.arange(30) + noise * rng.standard_normal(30))
        expected = expected_termination(trace)
        likelihood.append(expected.likelihood)
    assert likelihood == sorted(likelihood, reverse=True)
    assert 0.0 < likelihood[-1] < likelihood[0] <= 1.0


@pytest.mark.parametrize("noise", [0.3, 1.0])
def test_likelihood_is_the_share_of_likely_rates_that_end_in_the_same_generation(noise):
    rng = np.random.default_rng(2)
    age = np.arange(40)
    logarithm = -0.2 * age + noise * rng.standard_normal(age.size)
    # A first entry far above, so that the fit starts at the second whatever the noise.
    seen = expected_termination(np.concatenate([[9.0], np.exp(logarithm)]))
    (slope, _), covariance = np.polyfit(age, logarithm, 1, cov=True)
    rates = -slope + math.sqrt(covariance[0, 0]) * rng.standard_normal(4000)
    exact = [np.concatenate([[9.0], np.exp(-rate * age)]) for rate in rates]
    ends = [expected_termination(trace).generation for trace in exact]
    share = np.mean(np.array(ends) == seen.generation)
    assert 0.1 < share < 0.95
    # Four standard deviations of a share counted in 4000 draws.
    assert seen.likelihood == pytest.approx(share, abs=4 * 0.5 / math.sqrt(4000))


@pytest.mark.parametrize("best", [[1.0, 1.0, 1.0], [2.0, 1.0, 1.0, 1.0, 1.0], [np.inf, 2.0, 1.0]])
def test_no_decay_no_expected_termination(best):
    assert expected_termination(np.array(best)) == (None, 0.0)
