"""Designed weights: the program agrees with Riccati equations, and what is claimed of rms values holds."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
import scipy.linalg
from control_samples import shear_frame
from loop_samples import design_problem
from refusals import refusal

import mrwork as mr
from mrwork.buildings import Building
from mrwork.control import DesignedWeights, accelerations, design_weights, drifts, plant_of
from mrwork.control.laws.regulator_settings import RegulatorSettings
from mrwork.control.linear.plant import stack_outputs
from mrwork.control.weights.weight_solver import WeightDesigner
from mrwork.motions import KanaiTajimi

LIMITS = {"rms_drift": 4e-3, "rms_acceleration": 5.2}
BUDGET = 900.0


def frame() -> Building:
    return mr.building("uts")


@cache
def designed() -> DesignedWeights:
    """Five storeys, where a drift and an acceleration bind."""
    return design_weights(frame(), frame().storeys[:1], limits=LIMITS, budget=BUDGET)


def design(building: Building, n_devices: int = 1, **given: Any) -> DesignedWeights:
    return design_weights(building, building.storeys[:n_devices], **given)


def in_si(building: Building) -> tuple[np.ndarray, ...]:
    """A, B, noise, C and D in SI, typed once more: building, soil, and a white noise of 2 % on each mode."""
    plant, spectrum = plant_of(building, building.storeys[:1]), KanaiTajimi()
    soil, n = spectrum.filter_matrices(), 2 * plant.n_coordinates
    A = np.block([[plant.A, np.outer(plant.E, soil.output)], [np.zeros((2, n)), soil.state]])
    B = np.vstack([plant.B, np.zeros((2, 1))])
    w = np.concatenate([np.zeros(n), soil.noise]) * np.sqrt(2.0 * np.pi * spectrum.intensity)
    modes = scipy.linalg.block_diag(building.modes, building.modes, np.eye(2))
    back = np.linalg.inv(modes)
    X = back @ scipy.linalg.solve_continuous_lyapunov(A, -np.outer(w, w)) @ back.T
    noise = np.outer(w, w) + 0.02**2 * building.frequencies[0] * (modes * np.diag(X)) @ modes.T
    y = stack_outputs(drifts(plant), accelerations(plant))
    return A, B, noise, np.hstack([y.C, np.zeros((len(y.C), 2))]), y.D


def rms(building: Building, gain: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rms of drifts and accelerations, and of the force, with a gain on all states or on those of the building."""
    A, B, noise, C, D = in_si(building)
    gain = np.pad(gain, ((0, 0), (0, len(A) - gain.shape[1])))
    X = scipy.linalg.solve_continuous_lyapunov(A - B @ gain, -noise)
    closed = C - D @ gain
    return np.sqrt(np.diag(closed @ X @ closed.T)), np.sqrt(np.diag(gain @ X @ gain.T))


def limits_of(building: Building) -> np.ndarray:
    return np.repeat([LIMITS["rms_drift"], LIMITS["rms_acceleration"]], len(building.floors))


@pytest.mark.parametrize(("name", "budget"), [("dyke1996", 60.0), ("uts", 500.0), ("uts", 3000.0)])
def test_the_program_agrees_with_riccati_equations_to_four_digits(name: str, budget: float) -> None:
    check = design(mr.building(name), limits=LIMITS, budget=budget).certificate
    assert check.program_ratio == pytest.approx(check.ratio, rel=1e-5)
    assert check.violation <= 1e-8
    # The noise that the design adds to the states counts for as much.
    assert 0.0 < check.gap <= 1e-2


def test_a_tall_building_is_designed_on_modes_and_finished_on_all_of_them() -> None:
    found = design(shear_frame(14), limits={"rms_drift": 0.01, "rms_acceleration": 1.0}, budget=4e6)
    assert "on 8 modes" in found.engine
    assert found.certificate.violation <= 1e-6


def test_rms_values_are_those_of_a_lyapunov_equation_in_si() -> None:
    found = designed()
    of_law, force = rms(frame(), found.gain)
    case = found.certificate.cases[0]
    assert np.max(of_law / limits_of(frame())) == pytest.approx(case.law_ratio, rel=1e-7)
    np.testing.assert_allclose(force, case.law_forces, rtol=1e-7)
    # With the gain on the soil, from the Riccati equation of building and soil.
    A, B, _, C, D = in_si(frame())
    W = np.diag(found.output_weights)
    P = scipy.linalg.solve_continuous_are(A, B, C.T @ W @ C, found.R, s=C.T @ W @ D)
    whole, force = rms(frame(), np.linalg.solve(found.R, B.T @ P + D.T @ W @ C))
    np.testing.assert_allclose(whole, found.certificate.rms, rtol=1e-5)
    assert np.max(whole / limits_of(frame())) == pytest.approx(found.reachable_ratio, rel=1e-5)
    assert force[0] == pytest.approx(BUDGET, rel=1e-5)


def lightly_damped() -> Building:
    ten = mr.buildings.shear_building(name="ten", masses=[1e5] * 10, stiffnesses=[2e8] * 10)
    return mr.buildings.with_modal_damping(ten, ratios=[0.002])


@pytest.mark.parametrize(
    ("building", "budget"),
    [(frame(), 800.0), (frame(), 400.0), (mr.building("dyke1996"), 60.0), (lightly_damped(), 2e5)],
)
def test_the_bound_is_of_the_ground_alone(building: Building, budget: float) -> None:
    """The same weights, and R such that the force under the ground alone is the budget, reach less than the ratio."""
    limits = {"rms_drift": 2e-3, "rms_acceleration": 2.5}
    found = design(building, limits=limits, budget=budget)
    A, B, _, C, D = in_si(building)
    soil = KanaiTajimi().filter_matrices()
    w = np.concatenate([np.zeros(2 * building.n_coordinates), soil.noise])
    ground = 2.0 * np.pi * KanaiTajimi().intensity * np.outer(w, w)
    W = np.diag(found.output_weights)

    def reached(share: float) -> tuple[float, float]:
        R = share * found.control_weight + D.T @ W @ D
        P = scipy.linalg.solve_continuous_are(A, B, C.T @ W @ C, R, s=C.T @ W @ D)
        gain = np.linalg.solve(R, B.T @ P + D.T @ W @ C)
        X = scipy.linalg.solve_continuous_lyapunov(A - B @ gain, -ground)
        y = np.einsum("ij,jk,ik->i", C - D @ gain, X, C - D @ gain)
        return float(np.sqrt((gain @ X @ gain.T)[0, 0])), float(np.sqrt(np.max(y)))

    share = scipy.optimize.brentq(lambda share: reached(share)[0] / budget - 1.0, 0.8, 1.0, xtol=1e-9)
    n = len(building.floors)
    over = np.concatenate(
        [np.full(n, 1.0 / limits["rms_drift"]), np.full(n, 1.0 / limits["rms_acceleration"])]
    )
    C, D = over[:, None] * C, over[:, None] * D
    W = np.diag(found.output_weights / over**2)
    attained = reached(share)[1]
    check = found.certificate
    # The weights are those of the program with noise, and so not quite those of the ground.
    assert check.bound <= attained * (1.0 + 1e-9)
    assert attained <= min(check.ratio, 1.005 * check.bound)


def test_the_gain_is_that_of_the_weights_in_the_settings_of_a_law() -> None:
    found, plant = designed(), plant_of(frame(), frame().storeys[:1])
    for scale in (1.0, 1e-3):
        settings = RegulatorSettings(**found.settings(scale))
        expected = settings.regulator(design_problem()).gain
        error = np.linalg.norm((found.gain_with(scale) - expected) @ plant.scaling)
        assert error <= 1e-7 * np.linalg.norm(expected @ plant.scaling)
    np.testing.assert_array_equal(found.gain_with(1.0), found.gain)
    P = scipy.linalg.solve_continuous_are(plant.A, plant.B, found.Q, found.R, s=found.N)
    np.testing.assert_allclose(
        (np.linalg.solve(found.R, plant.B.T @ P + found.N.T) - found.gain) @ plant.scaling,
        0.0,
        atol=1e-5 * np.linalg.norm(found.gain @ plant.scaling),
    )


def test_what_binds_has_weight_and_meets_its_limit() -> None:
    found = designed()
    over = found.certificate.rms / found.certificate.limits / found.reachable_ratio
    weighs = found.output_weights * found.certificate.limits**2 > 1e-4
    assert 2 <= weighs.sum() < len(weighs), "choose limits of which several bind"
    np.testing.assert_allclose(over[weighs], 1.0, rtol=1e-6)
    assert len(found.binding) == weighs.sum() + 1
    assert all(name in " ".join(found.binding) for name in np.array(found.outputs.names)[weighs])


def test_only_ratios_matter() -> None:
    """Limits against each other, and the budget against the ground."""
    found = designed()
    twice = design(frame(), limits={name: 2.0 * limit for name, limit in LIMITS.items()}, budget=BUDGET)
    assert twice.reachable_ratio == pytest.approx(0.5 * found.reachable_ratio, rel=1e-7)
    louder = design(frame(), limits=LIMITS, budget=2.0 * BUDGET, spectrum=KanaiTajimi(intensity=0.04))
    assert louder.reachable_ratio == pytest.approx(2.0 * found.reachable_ratio, rel=1e-7)
    for other in (twice, louder):
        np.testing.assert_allclose(other.gain, found.gain, rtol=1e-4, atol=1e-4 * np.abs(found.gain).max())


def test_a_designer_solves_again_what_a_new_one_finds() -> None:
    designer = WeightDesigner(frame(), frame().storeys[:1], limits=LIMITS, budget=BUDGET)
    other = {"rms_drift": 3e-3, "rms_acceleration": 5.0}
    again = designer.design(other, 700.0)
    fresh = design(frame(), limits=other, budget=700.0)
    assert again.certificate.program_ratio == pytest.approx(again.certificate.ratio, rel=1e-5)
    assert again.reachable_ratio == pytest.approx(fresh.reachable_ratio, rel=1e-8)
    refusal(designer.design, {"rms_drift": 1e-3}, match="another designer")


def test_limits_out_of_reach_are_explained_with_a_budget_that_reaches_them() -> None:
    found = design(frame(), limits={"rms_drift": 4e-3}, budget=100.0)
    assert found.reachable_ratio > 1.0
    assert "cannot be met with this budget" in found.in_words[0]
    enough = design(frame(), limits={"rms_drift": 4e-3}, budget=100.0 * found.budget_factor)
    assert 0.985 < enough.reachable_ratio <= 1.0 + 1e-6
    never = design(frame(), limits={"rms_acceleration": 1e-3}, budget=100.0)
    assert never.budget_factor == np.inf
    assert "100 times the budget" in never.in_words[0]


def test_each_device_has_its_budget() -> None:
    found = design(frame(), 2, limits=LIMITS, budget=[600.0, 200.0])
    assert found.gain.shape == (2, 10)
    np.testing.assert_allclose(found.certificate.forces, [600.0, 200.0], rtol=1e-6)
    assert found.reachable_ratio < design(frame(), limits=LIMITS, budget=600.0).reachable_ratio


def test_a_force_may_be_limited_with_the_others() -> None:
    found = design(frame(), limits={"rms_drift": 4e-3, "rms_force": 600.0}, budget=5e3)
    check = found.certificate
    assert check.forces[0] == pytest.approx(600.0 * found.reachable_ratio, rel=1e-6)
    assert check.forces[0] < 5e3


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"limits": {"rms_drift": [1e-3, 2e-3]}}, "2 limits, .* 5 storeys"),
        ({"limits": {"rms_drift": "4 kN"}}, "its unit may be m"),
        ({"limits": {"rms_force": 10.0}}, "no response is limited"),
        ({"budget": [1.0, 2.0]}, "2 forces"),
    ],
)
def test_a_wish_that_cannot_be_is_told(given: dict[str, object], words: str) -> None:
    refusal(design, frame(), **{"limits": LIMITS, "budget": BUDGET, **given}, match=words)


def test_an_undamped_mode_is_refused() -> None:
    undamped = mr.buildings.shear_building(name="undamped", masses=[1.0, 1.0], stiffnesses=[10.0, 10.0])
    refusal(design, undamped, limits=LIMITS, budget=1.0, match="give every mode damping")


def test_limits_and_budgets_may_have_units() -> None:
    limits = {"rms_drift": "4 mm", "rms_acceleration": ["5.2 m/s2"] * 5}
    found = design(frame(), limits=limits, budget=["0.9 kN"])
    assert found.reachable_ratio == designed().reachable_ratio
