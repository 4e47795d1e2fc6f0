"""The race: minimisations of a batch are independent, and routes go on until two agree on the minimum."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

import mrwork as mr
from mrwork.identification import Objective, Race, search_box
from mrwork.identification.equivalent import identifiable_form
from mrwork.identification.fit_progress import Found
from mrwork.identification.minimise.levenberg_marquardt import Hopeless, find_minima
from mrwork.identification.minimise.plain_search import POPULATION, SAMPLES, plain_routes
from mrwork.identification.minimise.race import (
    Raced,
    Route,
    distinct_minima,
    race,
    same_minimum,
    with_best_forces,
)
from mrwork.identification.residual import ObservedTest

TEST = mr.records.cut(mr.synthetic_test("spencer1997_fast"), every=2)
FORM = identifiable_form(mr.damper("normalised_bouc_wen"), {})
SEARCHED = search_box(FORM.spec, FORM.box, (TEST,))


def objective(threads: int = 1) -> Objective:
    return Objective.of(FORM.spec, (TEST,), threads=threads)


@pytest.fixture(scope="module")
def starts() -> NDArray[np.float64]:
    unit = np.random.default_rng(4).uniform(0.3, 0.7, (5, len(SEARCHED.free)))
    return np.asarray(SEARCHED.theta_from_unit(unit))


def test_a_minimisation_does_not_depend_on_the_others_of_its_batch(starts: NDArray[np.float64]) -> None:
    together = find_minima(objective(), FORM.box, starts, max_iterations=12)
    for index, start in enumerate(starts):
        alone = find_minima(objective(), FORM.box, start[None], max_iterations=12)
        np.testing.assert_array_equal(together.theta[index], alone.theta[0])
        assert together.misfit[index] == alone.misfit[0]


def test_a_minimisation_never_ends_above_its_start_and_agrees_with_another_method(
    starts: NDArray[np.float64],
) -> None:
    minima = find_minima(objective(), FORM.box, starts, max_iterations=80)
    assert np.all(minima.misfit <= objective()(starts))
    best = int(np.argmin(minima.misfit))
    assert minima.converged[best]
    latent = mr.identification.CandidateObjective(objective=objective(), box=FORM.box, coordinates="latent")
    there = least_squares(
        latent.residuals,
        np.asarray(FORM.box.latent_from_theta(minima.theta[best])),
        jac=latent.jacobian,
        x_scale="jac",
    )
    assert np.sqrt(2.0 * there.cost) == pytest.approx(minima.misfit[best], rel=1e-6)


def test_slow_starts_are_given_up_once_others_agree_and_change_no_bit_of_these() -> None:
    # Of these eight starts some creep along a valley, far above the misfit on which the others agree.
    unit = np.random.default_rng(0).uniform(0.02, 0.98, (8, len(SEARCHED.free)))
    starts = np.asarray(SEARCHED.theta_from_unit(unit))
    patient, hasty = objective(), objective()
    rule = Hopeless(after=12, factor=1e3, found=3, closeness=0.02)
    whole = find_minima(patient, FORM.box, starts, max_iterations=60, tolerance=1e-5)
    found = find_minima(hasty, FORM.box, starts, max_iterations=60, tolerance=1e-5, hopeless=rule)
    assert np.count_nonzero(found.converged) >= 3
    assert hasty.tally.simulations < patient.tally.simulations
    np.testing.assert_array_equal(found.theta[found.converged], whole.theta[found.converged])
    assert found.misfit.min() == whole.misfit.min()
    # Minima of earlier rounds count as those of this one; one alone is no agreement.
    one = find_minima(objective(), FORM.box, starts[:1], max_iterations=60, hopeless=rule)
    np.testing.assert_array_equal(
        one.theta, find_minima(objective(), FORM.box, starts[:1], max_iterations=60).theta
    )
    earlier = replace(rule, earlier=(0.5 * whole.misfit.min(),) * 3)
    assert find_minima(objective(), FORM.box, starts, max_iterations=60, hopeless=earlier).iterations < 60


def test_starts_that_cannot_be_simulated_do_not_move(starts: NDArray[np.float64]) -> None:
    stiff = starts.copy()
    stiff[1, FORM.spec.names.index("rho")] = 0.9 * FORM.box.upper[FORM.spec.names.index("rho")]
    assert not np.isfinite(objective()(stiff[1:2])[0])
    minima = find_minima(objective(), FORM.box, stiff, max_iterations=5)
    np.testing.assert_allclose(minima.theta[1], stiff[1], rtol=1e-9)
    assert not minima.converged[1]
    assert np.isfinite(minima.misfit[[0, 2, 3, 4]]).all()


@pytest.mark.filterwarnings("error")
def test_a_start_whose_derivatives_overflow_does_not_move(
    starts: NDArray[np.float64], monkeypatch: pytest.MonkeyPatch
) -> None:
    linearise = ObservedTest.linearise_residuals

    def overflowing(*arguments: Any, **named: Any) -> Any:
        residuals, jacobian, failed = linearise(*arguments, **named)
        jacobian[0] *= 1e200 if len(jacobian) > 1 else 1.0
        return residuals, jacobian, failed

    monkeypatch.setattr(ObservedTest, "linearise_residuals", overflowing)
    minima = find_minima(objective(), FORM.box, starts[:2], max_iterations=8)
    before = objective()(starts[:2])
    assert minima.misfit[0] == pytest.approx(before[0])
    assert not minima.converged[0]
    assert minima.misfit[1] < before[1]


def raced(rng: int = 0, *, threads: int = 1, told: list[Found] | None = None, **settings: Any) -> Raced:
    def tell(found: Found) -> None:
        if told is not None:
            told.append(found)

    compared, chosen = objective(threads), Race(**settings)
    routes = plain_routes(compared, FORM.box, chosen, rng=rng, on_search=tell)
    return race(compared, FORM.box, routes, chosen, searched=SEARCHED, rng=rng, on_search=tell)


def test_seeds_agree_on_the_minimum_and_threads_on_every_bit() -> None:
    found = [raced(rng) for rng in range(2)]
    least = min(each.misfit[0] for each in found)
    for each in found:
        assert each.misfit[0] <= same_minimum(least)
        assert each.trace.stop_reason == "agreed"
        assert not each.doubt
        assert list(each.trace.evaluations) == sorted(each.trace.evaluations)
        assert list(each.trace.best) == sorted(each.trace.best, reverse=True)
    np.testing.assert_array_equal(raced(threads=2).theta, found[0].theta)
    assert not np.array_equal(found[1].theta, found[0].theta)


def test_a_minimum_that_one_route_alone_has_met_is_doubted_and_what_was_tried_is_said() -> None:
    compared, settings = objective(), Race(most_rounds=2)
    at_minimum = raced().theta[:1]
    far = np.asarray(SEARCHED.theta_from_unit(np.full((1, len(SEARCHED.free)), 0.5)))
    # A route whose force is held far from the measured one never arrives.
    rounds = []

    def draw_far(number: int) -> NDArray[np.float64]:
        rounds.append(number)
        return far[:0]

    routes = (Route(name="the one", draw=lambda number: at_minimum), Route(name="the other", draw=draw_far))
    found = race(compared, FORM.box, routes, settings, searched=SEARCHED, rng=0)
    assert rounds == [0, 1]
    assert found.trace.stop_reason == "max_rounds"
    assert found.doubt.startswith(
        "only the one met the least one, in 2 rounds of the one and the other, with "
    )


def test_rounds_end_at_the_budget_of_steps() -> None:
    far = Route(
        name="none", draw=lambda number: SEARCHED.theta_from_unit(np.full((1, len(SEARCHED.free)), 0.4))
    )
    found = race(objective(), FORM.box, (far,), Race(most_steps=1.0), searched=SEARCHED, rng=0)
    assert found.trace.stop_reason == "max_steps"
    assert "met the least one, in 1 round of none, with " in found.doubt


def test_what_is_found_so_far_has_its_misfit_and_its_route() -> None:
    told: list[Found] = []
    raced(told=told)
    assert f"{SAMPLES} and {POPULATION}" in {found.route for found in told}
    local = [found for found in told if found.route]
    for found in (local[0], local[len(local) // 2], local[-1]):
        assert objective()(found.best()[None])[0] == pytest.approx(found.trace.best[-1], rel=1e-9)


def test_forces_of_points_are_those_of_the_best_fit() -> None:
    spec = mr.damper("viscous_dahl")
    compared = Objective.of(spec, (TEST,))
    box = mr.Box.of(spec)
    theta = np.array([[2e3, 500.0, 900.0, 10.0], [20.0, 5.0, 900.0, 0.1]])
    moved, misfit = with_best_forces(compared, box, theta)
    # The two differ by a factor on all forces only, and the force is linear in these.
    np.testing.assert_allclose(moved[0], moved[1], rtol=1e-6)
    np.testing.assert_allclose(compared(moved), misfit, rtol=1e-9)
    assert np.all(misfit < compared(theta))
    held = box.with_bounds({"k_w": (500.0, 500.0)})
    inside, _ = with_best_forces(compared, held, theta)
    np.testing.assert_array_equal(inside[:, 1], 500.0)


def test_a_force_that_would_be_negative_leaves_the_others_at_the_best_fit_beside_it() -> None:
    # Friction less a dashpot, which no positive damping describes.
    spec, box = mr.damper("viscous_dahl"), mr.Box.of(mr.damper("viscous_dahl"))
    velocity = TEST.velocity / np.abs(TEST.velocity).max()
    test = replace(TEST, force=800.0 * np.tanh(velocity / 0.05) - 500.0 * velocity)
    compared = Objective.of(spec, (test,))
    (moved,), (misfit,) = with_best_forces(compared, box, np.array([[2e3, 500.0, 2e4, 10.0]]))
    assert moved[0] == pytest.approx(0.1 * 2e3)
    for column in (1, 3):
        for factor in (0.99, 1.01):
            nearby = moved.copy()
            nearby[column] *= factor
            assert compared(nearby[None])[0] > misfit


def test_minima_that_are_close_count_once() -> None:
    box = mr.Box.of(FORM.spec)
    theta = np.asarray(box.theta_from_unit(np.full((3, len(box.free)), 0.5)))
    theta[1] = np.asarray(box.theta_from_unit(np.full(len(box.free), 0.51)))
    theta[2] = np.asarray(box.theta_from_unit(np.full(len(box.free), 0.6)))
    np.testing.assert_array_equal(distinct_minima(box, theta, np.array([1.0, 1.001, 1.002])), theta[[0, 2]])
    np.testing.assert_array_equal(distinct_minima(box, theta, np.array([1.0, 1.001, 1.02])), theta[:1])


def test_an_insensitive_parameter_does_not_move() -> None:
    # Without k the displacement at which it is free changes no force; alone it leaves a system of zeros.
    nominal = dict(zip(FORM.spec.names, FORM.spec.nominal, strict=True)) | {"k": 0.0}
    fixed = {name: (value, value) for name, value in nominal.items() if name != "x0"}
    form = identifiable_form(mr.damper("normalised_bouc_wen"), fixed)
    start = np.array([list(nominal.values())])
    minima = find_minima(objective(), form.box, start, max_iterations=9)
    np.testing.assert_allclose(minima.theta, start, rtol=1e-9)
    assert minima.misfit[0] == objective()(start)[0]
