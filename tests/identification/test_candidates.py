"""Candidates in a call: forces, exact derivatives and the misfit as a function, as a user's own search calls them."""

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from refusals import refusal
from scipy.optimize import approx_fprime, least_squares, minimize
from sentences import Refused

import mrwork as mr
from mrwork.dampers.simulation import simulate_forces, simulate_sensitivities
from mrwork.identification import CandidateObjective, FitSettings, Objective
from mrwork.records import cut


@pytest.fixture(scope="module")
def test() -> mr.DamperTest:
    return cut(mr.synthetic_test("spencer1997"), every=8)


@pytest.fixture(scope="module")
def theta() -> np.ndarray:
    """Bingham dampers about the published one."""
    spread = np.random.default_rng(0).uniform(0.8, 1.2, (5, 4))
    return spread * mr.damper("bingham").nominal


def test_forces_and_derivatives_have_the_bits_of_the_compiled_batch(
    test: mr.DamperTest, theta: np.ndarray
) -> None:
    spec = mr.damper("bingham")
    history = mr.Loading(dt=test.dt, displacement=test.displacement, velocity=test.velocity).history()
    by_hand = simulate_sensitivities(spec, theta, history)
    found = mr.sensitivities("bingham", theta, test)
    assert np.array_equal(mr.simulate("bingham", theta, test), simulate_forces(spec, theta, history).force)
    assert np.array_equal(found.force, by_hand.force)
    assert np.array_equal(found.by("c0"), by_hand.jacobian[:, 2])
    alone = mr.sensitivities(spec, theta[1], test)
    assert np.array_equal(alone.jacobian, found.jacobian[1])
    assert np.array_equal(mr.simulate(spec, theta[1], test), found.force[1])


def test_a_loading_takes_the_place_of_a_test_with_its_command() -> None:
    preset = mr.damper("static_hysteretic").preset("kwok2006")
    time = 1e-3 * np.arange(500)
    loading = mr.Loading(dt=1e-3, displacement=0.01 * np.sin(6.0 * time), command=1.0, command_unit="A")
    force = mr.simulate(preset.spec, preset.theta, loading)
    assert np.array_equal(force, mr.simulate_force(preset.spec, preset.theta, loading))


def test_a_record_without_the_command_of_the_model_is_not_simulated(test: mr.DamperTest) -> None:
    preset = mr.damper("static_hysteretic").preset("kwok2006")
    refusal(mr.simulate, preset.spec, preset.theta, test, match="command in A, the test has none")
    motion = mr.Loading(dt=test.dt, displacement=test.displacement)
    refusal(mr.simulate, preset.spec, preset.theta, motion, match="`command_unit`")


def test_the_objective_is_the_one_of_the_identification(test: mr.DamperTest, theta: np.ndarray) -> None:
    other = cut(mr.synthetic_test("spencer1997_fast"), every=4)
    settings = FitSettings(force_exponent=0.5)
    by_hand = Objective.of(mr.damper("bingham"), (test, other), settings)
    objective = mr.objective("bingham", (test, other), force_exponent=0.5)
    assert objective.names == mr.damper("bingham").names
    assert np.array_equal(objective(theta), by_hand(theta))
    assert np.array_equal(objective.residuals(theta), by_hand.residuals(theta))
    assert objective(theta[2]) == by_hand(theta)[2]
    assert objective(theta).shape == (5,)
    assert isinstance(objective(theta[0]), float)


VARIANTS: dict[str, dict[str, object]] = {
    "plain": {},
    "unit": {"coordinates": "unit"},
    "held": {"bounds": {"v_s": (0.005, 0.005), "f_c": (300.0, 900.0)}},
    "of each test": {"observe": "offset=each"},
    "huber": {"loss": "huber", "loss_scale": 60.0},
    "soft_l1": {"loss": "soft_l1", "loss_scale": 60.0, "coordinates": "unit"},
    "cauchy": {"loss": "cauchy", "loss_scale": 60.0},
    "arctan": {"loss": "arctan", "loss_scale": 200.0},
    "own loss": {"loss": lambda z: np.stack([np.log1p(z), 1.0 / (1.0 + z)]), "loss_scale": 60.0},
    "weights": {"weights": [np.linspace(0.0, 2.0, 251)]},
    "mask": {"masks": [np.arange(251) > 125]},
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_derivatives_are_those_of_residuals_and_misfit(test: mr.DamperTest, variant: str) -> None:
    objective = mr.objective("bingham", test, **VARIANTS[variant])  # type: ignore[arg-type] # of many types
    point = 0.9 * objective.start
    jacobian = objective.jacobian(point)
    numeric = approx_fprime(point, objective.residuals, 1e-7 * np.maximum(np.abs(point), 1e-3))
    scale = np.abs(jacobian).max(axis=0)
    assert np.abs(jacobian - numeric).max() <= 1e-4 * scale.max()
    assert np.abs((jacobian - numeric) / scale).max() < 1e-4
    assert np.linalg.norm(objective.residuals(point)) == pytest.approx(objective(point), rel=1e-12)
    slope = approx_fprime(point, objective, 1e-7 * np.maximum(np.abs(point), 1e-3))
    assert objective.gradient(point) == pytest.approx(slope, rel=1e-3, abs=1e-6)
    many = np.stack([point, objective.start])
    assert np.array_equal(objective.jacobian(many)[0], jacobian)


def test_unit_and_physical_points_are_the_same_candidates(test: mr.DamperTest) -> None:
    unit, physical = (mr.objective("bingham", test, coordinates=each) for each in ("unit", "theta"))
    assert unit.theta(unit.start) == pytest.approx(physical.start, rel=1e-12)
    assert unit(unit.start) == pytest.approx(physical(physical.start), rel=1e-12)
    assert unit.bounds == ((0.0, 1.0),) * 4


def test_bounds_given_are_kept_and_held_parameters_are_no_coordinates(test: mr.DamperTest) -> None:
    objective = mr.objective("bingham", test, bounds={"c0": (1.0, 1e6), "f0": (0.0, 0.0)})
    assert objective.names == ("f_c", "v_s", "c0")
    assert objective.bounds[2] == (1.0, 1e6)
    assert objective.theta(objective.start)[3] == 0.0
    assert objective.theta(np.tile(objective.start, (3, 1))).shape == (3, 4)


def test_samples_that_are_masked_have_no_effect(test: mr.DamperTest, theta: np.ndarray) -> None:
    force = test.force.copy()
    force[100:110] += 1e5
    mask = np.ones(test.n_time, dtype=bool)
    mask[100:110] = False
    spoilt = replace(test, force=force)
    masked = [mr.objective("bingham", each, masks=[mask]) for each in (test, spoilt)]
    assert np.array_equal(masked[0](theta), masked[1](theta))
    assert mr.objective("bingham", spoilt)(theta[0]) != masked[0](theta[0])


def test_an_outlier_moves_a_robust_fit_less(test: mr.DamperTest) -> None:
    force = test.force.copy()
    force[60:240:20] += 4000.0
    spoilt = replace(test, force=force)

    def damping(record: mr.DamperTest, **loss: Any) -> float:
        objective: CandidateObjective = mr.objective("bingham", record, coordinates="unit", **loss)
        found = least_squares(
            objective.residuals,
            objective.start,
            jac=objective.jacobian,
            bounds=(objective.lower, objective.upper),
        )
        return float(objective.theta(found.x)[2])

    reference, robust, plain = damping(test), damping(spoilt, loss="cauchy", loss_scale=50.0), damping(spoilt)
    assert abs(robust - reference) < 0.2 * abs(plain - reference)


def test_scipy_minimises_it_with_its_gradient(test: mr.DamperTest) -> None:
    objective = mr.objective("bingham", test, coordinates="unit")
    found = minimize(objective, objective.start, jac=objective.gradient, bounds=objective.bounds)
    fit = mr.identify("bingham", test)
    assert objective.theta(found.x) == pytest.approx(fit.theta, rel=1e-2)
    assert found.fun == pytest.approx(fit.nrmse, rel=1e-4)


def test_a_search_of_the_package_takes_it_and_keeps_its_budget(test: mr.DamperTest) -> None:
    objective = mr.objective("bingham", test, coordinates="unit")
    search = mr.search.EfficientGA()
    n_params = len(objective.names)
    until = mr.search.run_search(search, objective, rng=0, n_params=n_params, until=0.2)
    assert until.stop_reason == "target"
    assert until.best_misfit <= 0.2
    at_once = mr.search.run_search(search, objective, rng=0, n_params=n_params, seconds=0.0)
    assert (at_once.stop_reason, at_once.generations) == ("max_seconds", 0)


def test_it_goes_to_another_process(test: mr.DamperTest) -> None:
    objective = mr.objective("bingham", test)
    assert pickle.loads(pickle.dumps(objective))(objective.start) == objective(objective.start)


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ({"loss": "huber"}, "`loss_scale`"),
        ({"weights": [1.0], "observe": "offset=each"}, "`weights`"),
        ({"observe": "mass=free"}, "leaves mass to a fit"),
        ({"masks": [np.zeros(251, dtype=bool)]}, "none of its 251 samples"),
    ],
)
def test_settings_that_do_not_go_together_are_said(
    test: mr.DamperTest, settings: dict[str, Any], word: str
) -> None:
    refusal(mr.objective, "bingham", test, **settings, match=word)


def test_a_point_outside_the_cube_and_a_loss_without_its_slope_are_refused(test: mr.DamperTest) -> None:
    unit = mr.objective("bingham", test, coordinates="unit")
    refusal(unit, [0.5, 0.5, 0.5, 1.5], match="from 0 to 1")
    objective = mr.objective("bingham", test, loss=lambda z: z, loss_scale=3.0)
    refusal(objective, mr.damper("bingham").nominal, match="derivative")


def test_arrays_become_a_test_with_the_remarks_of_a_file() -> None:
    known = mr.synthetic_test("rd1005_1a")
    made = mr.test_from_arrays(
        known.time, known.displacement, -known.force, command=1.0, command_unit="A", name="mine"
    )
    assert (made.name, made.current, made.command) == ("mine", 1.0, None)
    assert {"velocity_derived", "force_sign_flipped"} <= {each.code for each in made.remarks}
    assert np.array_equal(made.force, known.force)
    opening = mr.test_from_arrays(known.time, known.displacement, known.force, command=30.0, command_unit="%")
    assert (opening.current, opening.command, opening.command_unit) == (None, 30.0, "%")


def test_a_command_without_a_unit_or_given_twice_is_refused(test: mr.DamperTest, refused: Refused) -> None:
    channels = (test.time, test.displacement, test.force)
    refused(mr.test_from_arrays, *channels, command=1.0)
    refused(mr.test_from_arrays, *channels, command=1.0, command_unit="A", current=2.0)
    refused(mr.test_from_arrays, *channels, name="mine", comand=1.0)
