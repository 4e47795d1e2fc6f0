"""Draws as ArviZ takes them: every group, units of every variable, and leave-one-out that runs."""

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from posterior_samples import NOISE_N, converged_draws, small_draws, small_fit, small_test
from refusals import refusal

from mrwork import uncertainty

GROUPS = {*("posterior", "sample_stats", "log_likelihood", "posterior_predictive", "observed_data")}


@pytest.fixture(scope="module")
def draws() -> uncertainty.Draws:
    return converged_draws()


def tree_of(draws: uncertainty.Draws, **settings: Any) -> Any:
    return uncertainty.inference_data(draws, small_fit(), small_test(), threads=1, **settings)


def test_every_group_is_there_and_every_variable_has_a_unit(draws: uncertainty.Draws) -> None:
    tree = tree_of(draws)
    assert set(tree.children) == GROUPS
    for group in tree.children.values():
        assert group.data_vars
        assert all("units" in each.attrs for each in group.data_vars.values()), group.name
    assert tree["posterior_predictive"]["small"].attrs["units"] == "N"
    assert tree["posterior"]["k_w"].attrs["units"] == "N"
    shapes = {tree[name].sizes["chain"] * tree[name].sizes["draw"] for name in GROUPS - {"observed_data"}}
    assert shapes == {tree["posterior"]["k_w"].size}
    assert tree["posterior"]["k_w"].size <= 1000


@pytest.mark.parametrize("pointwise", ["blocks", "samples"])
def test_leave_one_out_runs_on_it_and_is_finite(draws: uncertainty.Draws, pointwise: str) -> None:
    # Of the extra `arviz`.
    arviz_stats = pytest.importorskip("arviz_stats.loo")
    with warnings.catch_warnings():
        # The record is one block, whose density is all that there is.
        warnings.simplefilter("ignore" if pointwise == "blocks" else "error")
        found = arviz_stats.loo(tree_of(draws, pointwise=pointwise), pointwise=True)
    assert np.isfinite(found.elpd)
    assert np.isfinite(found.se)
    assert np.isfinite(np.asarray(found.elpd_i)).all()
    if pointwise == "samples":
        # White noise of the right model: the density of a normal residual, less one unit for each of five parameters
        # at most.
        test = small_test()
        sigma = NOISE_N / float(np.std(test.force[test.counted]))
        expected = test.n_counted * (-0.5 - np.log(sigma) - 0.5 * np.log(2.0 * np.pi))
        assert found.elpd == pytest.approx(expected, abs=4.0 * np.sqrt(0.5 * test.n_counted))
        assert 2.0 < found.p < 8.0


def test_blocks_and_samples_have_the_likelihood_that_was_sampled(draws: uncertainty.Draws) -> None:
    tempered = replace(draws, temper=0.25)
    sums = [
        tree_of(each, pointwise=pointwise)["log_likelihood"]["force"].values.sum(axis=-1)
        for each in (draws, tempered)
        for pointwise in ("blocks", "samples")
    ]
    for other, factor in ((sums[1], 1.0), (sums[2], 0.25), (sums[3], 0.25)):
        np.testing.assert_allclose(other, factor * sums[0], rtol=1e-10)
    # The prior is uniform in the coordinates: what is left of the log posterior is the likelihood.
    lp = tree_of(draws)["sample_stats"]["lp"].values
    assert np.ptp(lp - sums[0]) < 1e-6


def test_correlated_noise_has_finite_densities_and_predictions() -> None:
    tree = tree_of(small_draws("ar1"), most_draws=32, pointwise="samples")
    assert np.isfinite(tree["log_likelihood"]["force"].values).all()
    assert np.isfinite(tree["posterior_predictive"]["small"].values).all()


def test_predictions_cover_the_measured_force(draws: uncertainty.Draws) -> None:
    tree = tree_of(draws)
    predicted = tree["posterior_predictive"]["small"].values.reshape(-1, small_test().n_counted)
    lower, upper = np.quantile(predicted, [0.05, 0.95], axis=0)
    measured = tree["observed_data"]["small"].values
    np.testing.assert_array_equal(measured, small_test().force[small_test().counted])
    assert 0.8 < np.mean((measured > lower) & (measured < upper)) < 0.97
    assert np.median(np.abs(predicted.mean(axis=0) - measured)) < NOISE_N


def test_two_tests_have_times_of_their_own_and_one_likelihood(draws: uncertainty.Draws) -> None:
    tests = (small_test(), small_test(rng=6, n_time=200))
    tree = uncertainty.inference_data(draws, small_fit(), tests, most_draws=32, threads=1)
    assert list(tree["observed_data"].data_vars) == ["small", "small (2)"]
    assert tree["observed_data"]["small (2)"].dims == ("time_2",)
    assert set(tree["log_likelihood"]["test"].values.tolist()) == {"small", "small (2)"}


def test_draws_of_another_model_are_refused(draws: uncertainty.Draws) -> None:
    other = replace(draws, model="bingham")
    refusal(uncertainty.inference_data, other, small_fit(), small_test(), match="of bingham")
