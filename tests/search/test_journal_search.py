"""A search that was cut off anywhere goes on from its journal to the bits of the uninterrupted one."""

from dataclasses import replace

import pytest
from refusals import refusal
from search_problems import arrays_of, half_failing, optimiser_named

from mrwork import Journal
from mrwork.search import OPTIMISERS, PEERS, EfficientGA, StopRules, run_search


def shortened(name):
    """An optimiser with seven generations at most."""
    optimiser = optimiser_named(name)
    return replace(optimiser, stop=replace(optimiser.stop, max_generations=7, target=None))


def searched(optimiser, journal, *, rng=5, objective=half_failing):
    """Result of a search, and how many candidates were simulated for it."""
    simulated = []

    def counted(unit):
        simulated.append(len(unit))
        return objective(unit)

    try:
        run = run_search(optimiser, counted, rng=rng, n_params=3, journal=journal)
    finally:
        if journal is not None:
            journal.close()
    return run, sum(simulated)


def bits(run):
    """Course, population and misfits of a search: all that its optimiser told."""
    state = run.state
    arrays = arrays_of(state.course) | {"population": state.population, "misfit": state.misfit}
    return {name: array.tobytes() for name, array in arrays.items()}


@pytest.mark.parametrize("name", [*OPTIMISERS, *PEERS])
def test_every_optimiser_goes_on_from_any_generation(name, tmp_path):
    optimiser, path = shortened(name), tmp_path / "journal.jsonl"
    without, n_simulated = searched(optimiser, None)
    whole, _ = searched(optimiser, Journal(path))
    assert bits(whole) == bits(without)
    lines = path.read_bytes().splitlines(keepends=True)
    assert len(lines) == 1 + 7
    for kept in range(len(lines) + 1):
        path.write_bytes(b"".join(lines[:kept]))
        resumed, n_again = searched(optimiser, Journal(path, resume=True))
        assert bits(resumed) == bits(whole)
        assert resumed.stop_reason == whole.stop_reason
        done = max(kept - 1, 0)
        assert n_again == n_simulated - (whole.trace.evaluations[done - 1] if done else 0)


def test_another_search_is_refused_by_name(tmp_path):
    path = tmp_path / "journal.jsonl"
    genetic = shortened("genetic")
    searched(genetic, Journal(path))
    for optimiser, changed, word in (
        (genetic, {"rng": 6}, "seed is 5 there and 6 here"),
        (replace(genetic, population=61), {}, "settings.population is 60 there"),
        (shortened("standard_ga"), {}, "optimiser is genetic there"),
    ):
        refusal(searched, optimiser, Journal(path, resume=True), **changed, match=word)


def test_a_limit_of_time_ends_a_resumed_search_where_it_ended_it_before(tmp_path):
    path = tmp_path / "journal.jsonl"
    optimiser = EfficientGA(
        stop=StopRules(min_generations=10**6, max_generations=10**6, max_seconds=0.05), population=10
    )
    whole, _ = searched(optimiser, Journal(path))
    assert whole.stop_reason == "max_seconds"
    resumed, n_again = searched(optimiser, Journal(path, resume=True))
    assert (bits(resumed), n_again) == (bits(whole), 0)
    assert resumed.stop_reason == "max_seconds"
