"""The posterior density: coordinates, prior, likelihood and tempering."""

from dataclasses import replace

import numpy as np
import pytest
from posterior_samples import MODEL, independent_errors, small_fit, small_sampling, small_test
from refusals import refusal
from scipy.stats import lognorm, norm, uniform

import mrwork as mr
from mrwork.identification.equivalent import identifiable_form
from mrwork.uncertainty import Lognormal, Normal, noise_model
from mrwork.uncertainty.noise import NOISES
from mrwork.uncertainty.posterior.laplace import first_walkers, fisher_information, mode_near
from mrwork.uncertainty.posterior.target import Space, prior_of_text

SPENCER = mr.damper("normalised_bouc_wen")


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(11)


def positions(rng: np.random.Generator, n: int = 6) -> np.ndarray:
    sampling = small_sampling()
    return first_walkers(sampling.target, sampling.target.start, n, rng)


def space(**priors: Normal | Lognormal) -> Space:
    bounds = {"k": (-4000.0, 6000.0), "x0": (-0.2, 0.1), "sigma": (0.5, 0.5)}
    return Space.of(identifiable_form(SPENCER, bounds), noise_model("ar1"), priors)


def test_a_position_is_its_parameters_and_a_fixed_one_has_none(rng: np.random.Generator) -> None:
    known = space()
    values = np.asarray(known.box.theta_from_unit(rng.random((50, known.n_dim))))
    position = known.position(values)
    assert position.shape == (50, known.n_dim)
    assert "sigma" not in known.names
    again, inside = known.values(position)
    assert np.all(inside)
    np.testing.assert_allclose(again, values, rtol=1e-9)


def test_outside_the_box_and_without_stiffness_nothing_is_inside(rng: np.random.Generator) -> None:
    known = space()
    values = np.asarray(known.box.theta_from_unit(rng.random((3, known.n_dim))))
    position = known.position(values)
    position[0, 0] = -0.01
    position[1, known.pair[1]] *= 1e3  # type: ignore[index] # that of k and x0
    position[2, known.pair[0]] = 0.4  # type: ignore[index] # k = 0
    assert not known.values(position)[1].any()


def test_a_prior_is_turned_into_one_of_the_position_by_the_volume(rng: np.random.Generator) -> None:
    given = space(x0=Normal(mean=0.01, deviation=0.03), c=Lognormal(median=900.0, deviation=0.4))
    values = np.asarray(given.box.theta_from_unit(rng.random((20, given.n_dim))))
    names = given.box.names
    free = np.array(given.box.free)
    volumes = []
    for value in values:
        # Derivative of the values by the position, by differences of its inverse.
        steps = 1e-6 * np.maximum(np.abs(value), 1e-4)[free]
        columns = []
        for index, step in zip(free, steps, strict=True):
            offset = np.zeros(value.size)
            offset[index] = step
            columns.append((given.position(value + offset) - given.position(value - offset)) / (2.0 * step))
        # Those spread evenly on their scale have density one in that coordinate.
        volumes.append(columns)
    own = [given.names.index("x0"), given.names.index("c")]
    expected = norm(0.01, 0.03).logpdf(values[:, names.index("x0")]) + lognorm(0.4, scale=900.0).logpdf(
        values[:, names.index("c")]
    )
    expected -= [sum(np.log(abs(columns[i][i])) for i in own) for columns in volumes]
    difference = given.log_prior(values) - expected
    np.testing.assert_allclose(difference, difference[0], atol=1e-6)
    np.testing.assert_array_equal(space().log_prior(values), 0.0)


def test_priors_of_what_there_is_not_and_of_what_is_held_are_refused() -> None:
    refusal(space, k_v=Normal(mean=0.0, deviation=1.0), match="'k_v'")
    refusal(space, sigma=Normal(mean=0.0, deviation=1.0), match="sigma, which is held")


def test_the_likelihood_of_independent_noise_is_that_of_its_residuals(rng: np.random.Generator) -> None:
    target = small_sampling().target
    position = positions(rng)
    test = small_test()
    loading = mr.Loading(dt=test.dt, displacement=test.displacement, velocity=test.velocity)
    measured = test.force[test.counted]
    for row, value in zip(target.space.values(position)[0], target(position), strict=True):
        force = mr.simulate_force(mr.damper(MODEL), row[:4], loading)[test.counted]
        expected = norm(0.0, row[4] * measured.std()).logpdf(measured - force).sum()
        # Densities of force over its deviation, and of force, differ by its logarithm per sample.
        assert value == pytest.approx(expected + measured.size * np.log(measured.std()), rel=1e-10)


@pytest.mark.parametrize("name", NOISES)
def test_a_row_has_the_same_density_alone_and_in_a_batch(name: str, rng: np.random.Generator) -> None:
    sampling = small_sampling(name)
    position = first_walkers(sampling.target, sampling.target.start, 5, rng)
    position[3, 1] = 1.5
    together = sampling.target(position)
    assert np.isneginf(together[3])
    assert np.isfinite(np.delete(together, 3)).all()
    np.testing.assert_array_equal(np.concatenate([sampling.target(row[None]) for row in position]), together)


def test_histories_and_sums_of_squares_tell_the_same(rng: np.random.Generator) -> None:
    target = small_sampling().target
    position = positions(rng)
    # A gain of 1 + 1e-13 wants the history, and changes nothing that shows.
    observed = replace(small_test(), observation=mr.records.Observation(gain=1.0 + 1e-13))
    objective = target.objective
    of_histories = replace(target, objective=objective.on(objective.spec, (observed,)))
    assert not of_histories.objective.is_direct
    np.testing.assert_allclose(of_histories(position), target(position), rtol=1e-9)


def test_a_candidate_that_cannot_be_simulated_is_impossible() -> None:
    sampling = small_sampling()
    box: mr.Box = sampling.target.space.box
    position = np.asarray(sampling.target.space.position(np.array([[1e8, 700.0, 1e7, 0.0, 0.1]])))
    assert box.upper[2] == 1e7
    # Too stiff for the sampling step by far.
    np.testing.assert_array_equal(sampling.target(position), -np.inf)


def test_tempering_is_the_share_of_independent_residuals_only_where_noise_does_not_know() -> None:
    assert small_sampling("ar1", tempering=None).target.temper == 1.0
    # The noise of the small test is white.
    assert 0.7 < small_sampling(tempering=None).target.temper <= 1.0
    assert small_sampling(tempering=0.25).target.temper == 0.25


def test_walkers_start_where_the_fisher_information_says(rng: np.random.Generator) -> None:
    sampling = small_sampling()
    position = first_walkers(sampling.target, sampling.target.start, 400, rng)
    theta = np.asarray(sampling.target.space.values(position)[0])[:, :4]
    errors = independent_errors(small_fit())
    for index, estimate in enumerate(small_fit().estimates):
        # The deviation of 400 draws is known to 3.5 %.
        assert theta[:, index].std() == pytest.approx(errors[index], rel=0.2)
        assert theta[:, index].mean() == pytest.approx(estimate.value, abs=0.3 * errors[index])


def test_a_chain_starts_at_the_mode_whatever_weights_the_fit_had() -> None:
    weak = small_test()
    # Thrice the force, and another loop: no parameters are right for both, so weights decide.
    strong = replace(weak, name="strong", force=3.0 * weak.force + 2000.0 * weak.velocity)
    behind = {}
    for exponent in (1.0, 0.0):
        fit = mr.identify("bingham", (weak, strong), force_exponent=exponent, rng=0)
        sampling = small_sampling("iid", fit, weak, strong)
        target = sampling.target
        mode = mode_near(target, sampling.target.start)
        at_start, at_mode = target(
            np.stack([target.position_of(sampling.target.start), target.position_of(mode)])
        ).tolist()
        behind[exponent] = at_mode - at_start
        # From the mode there is nowhere to go.
        again = float(target(target.position_of(mode_near(target, mode))[None])[0])
        assert again == pytest.approx(at_mode, abs=2e-3)
    assert behind[0.0] > 10.0 > behind[1.0] >= 0.0


VALUES = np.array([-1.0, 0.3, 2.0, 7.0])


@pytest.mark.parametrize(
    ("text", "known"),
    [
        ("normal:2:3", norm(2.0, 3.0)),
        ("lognormal:2:0.5", lognorm(0.5, scale=2.0)),
        ("uniform:0:5", uniform(0.0, 5.0)),
    ],
)
def test_a_prior_is_the_density_it_is_called(text: str, known: object) -> None:
    prior = prior_of_text(text)
    np.testing.assert_allclose(prior.log_density(VALUES), known.logpdf(VALUES), rtol=1e-13)  # type: ignore[attr-defined] # a distribution of SciPy


@pytest.mark.parametrize("text", ["c", "cauchy:1:2", "normal:1:x"])
def test_another_form_is_refused_with_the_forms_there_are(text: str) -> None:
    refusal(prior_of_text, text, match="normal:MEAN:DEVIATION")


@pytest.mark.parametrize("model", ["viscous_dahl", "normalised_bouc_wen"])
def test_information_is_that_of_the_residuals_over_the_position(model: str) -> None:
    fit = small_fit() if model == small_fit().model else mr.identify(model, small_test(), rng=0, threads=1)
    target = small_sampling("iid", fit, tempering=0.5).target
    theta = np.asarray(target.form.box.inside(target.form.from_model(np.array(fit.theta))))
    values = target.space.box.inside(np.concatenate([theta, NOISES["iid"].parameters and [0.05]]))
    position = np.asarray(target.space.position(values))

    def residuals(at: np.ndarray) -> np.ndarray:
        own = np.ascontiguousarray(target.space.values(at)[0][:, : target.space.n_params])
        return np.concatenate([each for each, _ in target.residuals(own)], axis=1)

    (residual,) = residuals(position[None])
    n_free = position.size - 1
    information = fisher_information(target, position)[:n_free, :n_free] - 12.0 * np.eye(n_free)
    information *= np.mean(residual**2) / target.temper
    slopes = []
    for offset in np.eye(position.size)[:n_free]:
        # A step that changes the residuals by about a thousandth of their size, not more.
        step = min(1e-3 * np.linalg.norm(residual) / np.sqrt(information.diagonal()[len(slopes)]), 1e-5)
        ahead, behind = residuals(np.stack([position + step * offset, position - step * offset]))
        slopes.append((ahead - behind) / (2.0 * step))
    size = np.linalg.norm(slopes, axis=1)
    apart = (np.array(slopes) @ np.transpose(slopes) - information) / np.outer(size, size)
    assert np.abs(apart).max() < 4e-3


def test_information_of_what_the_data_do_not_see_is_that_of_an_even_spread() -> None:
    target = small_sampling(tempering=1e-20).target
    theta = np.asarray(target.form.box.inside(np.array(small_fit().theta)))
    position = np.asarray(target.space.position(target.space.box.inside(np.append(theta, 0.05))))
    np.testing.assert_allclose(np.diag(fisher_information(target, position)), 12.0, rtol=0.2)
