"""Exact derivatives in the sampled coordinates agree with differences of the residuals of the target."""

import numpy as np
import pytest
from posterior_samples import small_fit, small_test

from mrwork import identify
from mrwork.uncertainty import NOISES
from mrwork.uncertainty.posterior.laplace import fisher_information, residual_slope
from mrwork.uncertainty.posterior.sample import SamplingProblem


@pytest.mark.parametrize("model", ["viscous_dahl", "normalised_bouc_wen"])
def test_slope_is_that_of_the_residuals_over_the_position(model: str) -> None:
    fit = small_fit() if model == small_fit().model else identify(model, small_test(), rng=0, threads=1)
    target = SamplingProblem.of_fit(
        fit, (small_test(),), noise="iid", priors={}, tempering=0.5, walkers=32, rng=0, threads=1
    ).target
    theta = np.asarray(target.form.box.inside(target.form.from_model(np.array(fit.theta))))
    values = target.space.box.inside(np.concatenate([theta, NOISES["iid"].parameters and [0.05]]))
    position = np.asarray(target.space.position(values))
    residual, slope = residual_slope(target, position)

    def residuals(at: np.ndarray) -> np.ndarray:
        own = np.ascontiguousarray(target.space.values(at)[0][:, : target.space.n_params])
        return np.concatenate([each for each, _, _ in target.residuals(own)], axis=1)

    np.testing.assert_allclose(residuals(position[None])[0], residual, rtol=1e-9, atol=1e-12)
    # A step that changes the residuals by about a thousandth of their size, not more.
    for index, own in enumerate(slope):
        step = min(1e-3 * np.linalg.norm(residual) / np.linalg.norm(own), 1e-5)
        offset = step * np.eye(position.size)[index]
        ahead, behind = residuals(np.stack([position + offset, position - offset]))
        quotient = (ahead - behind) / (2.0 * step)
        np.testing.assert_allclose(quotient, own, atol=2e-3 * np.abs(own).max())


def test_information_of_what_the_data_do_not_see_is_that_of_an_even_spread() -> None:
    fit = small_fit()
    target = SamplingProblem.of_fit(
        fit, (small_test(),), noise="iid", priors={}, tempering=1e-20, walkers=32, rng=0, threads=1
    ).target
    theta = np.asarray(target.form.box.inside(np.array(fit.theta)))
    position = np.asarray(target.space.position(target.space.box.inside(np.append(theta, 0.05))))
    np.testing.assert_allclose(np.diag(fisher_information(target, position)), 12.0, rtol=0.2)
