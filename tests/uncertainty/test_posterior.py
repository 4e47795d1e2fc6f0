"""The ensemble sampler: correct distributions, its stopping rule, and a resumed chain of the same bits."""

from collections.abc import Callable
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from posterior_samples import converged_draws, independent_errors, small_fit, small_test
from refusals import refusal
from run_folders import write_fit
from scipy.stats import norm

import mrwork as mr
from mrwork.store.run_folder import DRAWS
from mrwork.store.run_writer import add_to_run
from mrwork.uncertainty.posterior.draws import diagnose, draws_content, next_check, summary_of
from mrwork.uncertainty.posterior.walkers import WalkerChain


def standard_normal(position: np.ndarray) -> np.ndarray:
    return norm.logpdf(position).sum(axis=1)


def nobody(steps: int) -> None:
    pass


def test_moves_keep_a_standard_normal() -> None:
    start = np.random.default_rng(1).standard_normal((32, 6))
    ensemble = WalkerChain.begin(standard_normal, start, rng=2)
    ensemble.advance(4000, nobody)
    chain = ensemble.positions[500:]
    tau = float(diagnose(chain, tuple("abcdef")).tau.max())
    effective = 3501 * 32 / tau
    # The error of a mean is 1/sqrt(effective), of a variance sqrt(2/effective): four of each, of twelve numbers.
    np.testing.assert_allclose(chain.mean(axis=(0, 1)), 0.0, atol=4.0 / np.sqrt(effective))
    np.testing.assert_allclose(chain.var(axis=(0, 1)), 1.0, atol=4.0 * np.sqrt(2.0 / effective))
    assert effective > 3000


def test_a_chain_in_pieces_is_the_chain_in_one() -> None:
    start = np.random.default_rng(1).standard_normal((16, 3))
    whole, pieces = (WalkerChain.begin(standard_normal, start, rng=2) for _ in range(2))
    whole.advance(60, nobody)
    for until in (1, 17, 60):
        pieces.advance(until, nobody)
    np.testing.assert_array_equal(pieces.positions, whole.positions)
    np.testing.assert_array_equal(whole.densities[60], standard_normal(whole.positions[60]))


def test_checks_depend_on_the_steps_alone_and_grow_by_a_quarter() -> None:
    checks = [0]
    while checks[-1] < 10_000:
        checks.append(next_check(checks[-1]))
    assert checks[1:4] == [200, 250, 313]
    assert all(next_check(step - 1) == step for step in checks[1:])


def test_a_chain_that_memory_may_not_hold_is_refused_with_an_estimate() -> None:
    refusal(mr.sample, small_fit(), small_test(), walkers=10_000, most_steps=10_000_000, match="4,800 GB")


def test_walkers_that_disagree_or_never_move_have_not_converged() -> None:
    chain = np.random.default_rng(3).standard_normal((2000, 16, 2))
    assert diagnose(chain, ("a", "b")).shortcomings == ()
    chain[:, 0, 1] += 3.0
    assert any("walkers disagree most on b" in each for each in diagnose(chain, ("a", "b")).shortcomings)
    chain[:, :, 0] = 1.0
    assert "0 autocorrelation times" in diagnose(chain, ("a", "b")).shortcomings[0]


@pytest.mark.parametrize(
    ("draws", "state"),
    [
        (np.abs, "piles up at its lower bound"),
        (lambda normal: np.where(normal < -2.0, 1.0, normal + 2.0), ""),
        (lambda normal: 10.0 - np.abs(normal), "piles up at its upper bound"),
        (np.zeros_like, "fixed"),
    ],
)
def test_draws_that_pile_up_at_a_bound_are_said_to(draws: Callable[[Any], Any], state: str) -> None:
    normal = np.random.default_rng(4).standard_normal((8, 500))
    chain = draws(normal)
    assert summary_of(chain, name="a", unit="1", bounds=(0.0, 10.0), tau=1.0).state == state


@pytest.fixture(scope="module")
def draws() -> mr.Draws:
    return converged_draws()


def test_a_sampling_stops_by_itself_and_says_why(draws: mr.Draws) -> None:
    assert draws.status == "converged"
    assert draws.sentence.startswith(f"Converged after {draws.n_steps} steps: R-hat below 1.01")
    assert all(each.rhat < 1.01 and each.ess_bulk > 400 and each.ess_tail > 400 for each in draws.summaries)
    assert draws.theta.shape == (draws.densities.size, 4)
    assert draws.noise.shape == (draws.densities.size, 1)


def test_where_noise_is_white_and_the_model_right_the_posterior_is_that_of_least_squares(
    draws: mr.Draws,
) -> None:
    for summary, estimate, error in zip(
        draws.summaries, small_fit().estimates, independent_errors(small_fit()), strict=False
    ):
        # 131 samples tell four parameters well: the posterior is normal but for some per cent.
        assert summary.mean == pytest.approx(estimate.value, abs=0.15 * error)
        assert summary.deviation == pytest.approx(error, rel=0.1)
        assert summary.lower_5 < summary.median < summary.upper_95


def test_draws_are_a_datatree_with_units_and_provenance(draws: mr.Draws, tmp_path: Path) -> None:
    tree = draws.as_datatree()
    assert tree["posterior"]["k_w"].attrs["units"] == "N"
    np.testing.assert_array_equal(tree["posterior"]["k_w"].values.ravel(), draws.theta[:, 1])
    np.testing.assert_array_equal(tree["sample_stats"]["lp"].values, draws.densities)
    assert tree.attrs["sentence"] == draws.sentence
    assert small_test().sha256 in tree.attrs["inputs"]
    assert tree["observed_data"]["small"].size == small_test().n_time
    run = write_fit(tmp_path / "run", small_fit())
    add_to_run(run, {DRAWS: draws_content(draws)})
    read = mr.load(run).draws
    assert read is not None
    same = ("names", "noise_names", "status", "sentence", "n_steps", "thinning")
    assert [getattr(read, name) for name in same] == [getattr(draws, name) for name in same]
    assert read.summaries == draws.summaries
    assert {each.verdict.word for each in read.summaries} >= {"identifiable"}
    assert "95 % posterior interval" in repr(small_fit().with_intervals(read.summaries))
    for name in ("theta", "noise", "densities"):
        np.testing.assert_array_equal(getattr(read, name), getattr(draws, name))


@pytest.mark.long
def test_a_given_prior_moves_what_the_data_leave_open() -> None:
    prior = mr.uncertainty.Normal(mean=2000.0, deviation=86.0)
    given = mr.sample(small_fit(), small_test(), tempering=1.0, walkers=32, threads=1, priors={"k_x": prior})
    k_x = small_fit().estimates[0]
    # Two normals of about one width meet half-way, and are narrower by the square root of two.
    assert given.summaries[0].mean == pytest.approx(0.5 * (k_x.value + 2000.0), rel=0.03)
    assert given.summaries[0].deviation == pytest.approx(86.0 / np.sqrt(2.0), rel=0.1)


def test_threads_change_no_bit_and_an_interrupted_chain_is_kept() -> None:
    sampled = partial(mr.sample, small_fit(), small_test(), walkers=16, rng=7)
    one, two = (sampled(most_steps=60, threads=threads) for threads in (1, 2))
    np.testing.assert_array_equal(one.theta, two.theta)
    np.testing.assert_array_equal(one.densities, two.densities)

    def interrupt(progress: mr.Progress) -> None:
        if progress.numbers["steps"] > 40:
            raise KeyboardInterrupt

    with pytest.raises(mr.errors.Interrupted) as interrupted:
        sampled(most_steps=20_000, threads=1, on_progress=interrupt)
    kept = interrupted.value.result
    assert kept.status == "interrupted"
    assert 40 < kept.n_steps < 20_000


def test_another_sampling_is_not_gone_on_with(tmp_path: Path) -> None:
    store = tmp_path / "chain.jsonl"

    def sampled(rng: int, *, resume: bool) -> mr.Draws:
        with closing(mr.Journal(store, resume=resume)) as journal:
            return mr.sample(
                small_fit(), small_test(), walkers=16, rng=rng, most_steps=5, threads=1, journal=journal
            )

    first = sampled(1, resume=False)
    assert first.status == "not_converged"
    assert "Not converged after 5 steps" in first.sentence
    refusal(sampled, 2, resume=True, match="seed is 1 there and 2 here")
    np.testing.assert_array_equal(sampled(1, resume=True).theta, first.theta)


def test_too_few_walkers_and_a_prior_that_excludes_the_fit_are_refused() -> None:
    refusal(mr.sample, small_fit(), small_test(), walkers=8, match="`walkers` is 8 for 5 parameters")
    prior = {"rho": mr.uncertainty.Uniform(lower=1.0, upper=2.0)}
    refusal(mr.sample, small_fit(), small_test(), priors=prior, match="64 of 64 walkers")
