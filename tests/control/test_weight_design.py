"""Designed weights: what is claimed of rms values and of the least ratio holds by equations that are written out."""

from contextlib import suppress
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg
from control_samples import shear_frame
from loop_samples import design_problem
from refusals import refusal

import mrwork as mr
from mrwork.buildings import Building
from mrwork.control.laws.weights import WeightWishes
from mrwork.control.linear.plant import deformation_rates, stack_outputs
from mrwork.control.weights.limits import LimitedOutputs, RmsLimits
from mrwork.control.weights.system import design_system
from mrwork.motions import KanaiTajimi

LIMITS = {"rms_drift": 4e-3, "rms_acceleration": 5.2}
BUDGET = 900.0


def frame() -> Building:
    return mr.building("uts")


@cache
def designed() -> mr.control.DesignedWeights:
    """Five storeys, where a drift and an acceleration bind."""
    return mr.control.design_weights(frame(), frame().storeys[:1], limits=LIMITS, budget=BUDGET)


def design(building: Building, n_devices: int = 1, **given: Any) -> mr.control.DesignedWeights:
    return mr.control.design_weights(building, building.storeys[:n_devices], **given)


def in_si(building: Building) -> tuple[np.ndarray, ...]:
    """A, B, intensity of the ground, C and D of building and soil, typed once more."""
    plant, spectrum = mr.control.plant_of(building, building.storeys[:1]), KanaiTajimi()
    soil, n = spectrum.filter_matrices(), 2 * plant.n_coordinates
    A = np.block([[plant.A, np.outer(plant.E, soil.output)], [np.zeros((2, n)), soil.state]])
    B = np.vstack([plant.B, np.zeros((2, 1))])
    w = np.concatenate([np.zeros(n), soil.noise]) * np.sqrt(2.0 * np.pi * spectrum.intensity)
    y = stack_outputs(mr.control.drifts(plant), mr.control.accelerations(plant))
    return A, B, np.outer(w, w), np.hstack([y.C, np.zeros((len(y.C), 2))]), y.D


def rms(building: Building, gain: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rms of drifts and accelerations, and of the force, with a gain on all states or on those of the building."""
    A, B, ground, C, D = in_si(building)
    gain = np.pad(gain, ((0, 0), (0, len(A) - gain.shape[1])))
    X = scipy.linalg.solve_continuous_lyapunov(A - B @ gain, -ground)
    closed = C - D @ gain
    return np.sqrt(np.diag(closed @ X @ closed.T)), np.sqrt(np.diag(gain @ X @ gain.T))


def limits_of(building: Building) -> np.ndarray:
    return np.repeat([LIMITS["rms_drift"], LIMITS["rms_acceleration"]], len(building.floors))


def lightly_damped() -> Building:
    ten = mr.buildings.shear_building(name="ten", masses=[1e5] * 10, stiffnesses=[2e8] * 10)
    return mr.buildings.with_modal_damping(ten, ratios=[0.002])


@pytest.mark.parametrize(
    ("building", "budget"),
    [
        (frame(), 800.0),
        (frame(), 3e3),
        (mr.building("dyke1996"), 60.0),
        (shear_frame(8), 4e6),
        (lightly_damped(), 2e5),
    ],
)
def test_the_least_ratio_is_attained_and_no_law_passes_the_bound(building: Building, budget: float) -> None:
    """The value of the dual by SciPy's Riccati equation, and the rms values of its gain by a Lyapunov equation."""
    limits = {"rms_drift": 2e-3, "rms_acceleration": 2.5}
    found = design(building, limits=limits, budget=budget)
    A, B, ground, C, D = in_si(building)
    over = np.repeat([1.0 / each for each in limits.values()], len(building.floors))
    W = np.diag(found.output_weights)
    assert np.sum(found.output_weights / over**2) == pytest.approx(1.0)
    R = found.control_weight * budget**2
    B, D = budget * B, budget * D
    weight = R + D.T @ W @ D
    P = scipy.linalg.solve_continuous_are(A, B, C.T @ W @ C, weight, s=C.T @ W @ D)
    gain = np.linalg.solve(weight, B.T @ P + D.T @ W @ C)
    X = scipy.linalg.solve_continuous_lyapunov(A - B @ gain, -ground)
    attained = np.sqrt(np.max(over**2 * np.diag((C - D @ gain) @ X @ (C - D @ gain).T)))
    assert (gain @ X @ gain.T)[0, 0] <= 1.0 + 1e-4
    bound = np.sqrt(np.sum(ground * P) - R[0])
    assert attained <= (1.0 + 1e-4) * bound
    assert found.reachable_ratio == pytest.approx(attained, rel=1e-5)
    assert found.certificate.bound == pytest.approx(bound, rel=1e-5)
    assert 0.0 <= found.certificate.gap <= 1e-4


@pytest.mark.long
def test_a_tall_building_is_designed_on_modes_and_certified_on_all_of_them() -> None:
    found = design(shear_frame(30), limits={"rms_drift": 0.01, "rms_acceleration": 1.0}, budget=4e6)
    assert "20 of 30 modes" in found.engine
    assert found.certificate.gap <= 0.01
    assert len(found.system.A) == 62


def test_modes_that_are_left_out_follow_at_once() -> None:
    """A design on few modes has nearly the value of all; without their flexibility it would not be half as good."""
    plant, outputs = mr.control.plant_of(shear_frame(8), shear_frame(8).storeys[:1]), RmsLimits(rms_drift=1.0)
    limited = LimitedOutputs.of(outputs, plant)
    whole, few = (design_system(plant, limited, KanaiTajimi(), n_modes=each) for each in (None, 3))
    static = [each.D - each.C @ np.linalg.solve(each.A, each.B) for each in (whole, few)]
    np.testing.assert_allclose(static[1], static[0], rtol=1e-8, atol=1e-8 * np.abs(static[0]).max())


def test_rms_values_are_those_of_a_lyapunov_equation_in_si() -> None:
    found = designed()
    of_law, force = rms(frame(), found.gain)
    check = found.certificate
    assert np.max(of_law / limits_of(frame())) == pytest.approx(check.law_ratio, rel=1e-7)
    assert force[0] / BUDGET == pytest.approx(check.law_force, rel=1e-7)
    # With the gain on the soil, from the Riccati equation of building and soil.
    A, B, _, C, D = in_si(frame())
    W = np.diag(found.output_weights)
    P = scipy.linalg.solve_continuous_are(A, B, C.T @ W @ C, found.R, s=C.T @ W @ D)
    whole, force = rms(frame(), np.linalg.solve(found.R, B.T @ P + D.T @ W @ C))
    np.testing.assert_allclose(whole, found.certificate.rms, rtol=1e-5)
    assert np.max(whole / limits_of(frame())) == pytest.approx(found.reachable_ratio, rel=1e-5)
    assert force[0] == pytest.approx(BUDGET, rel=1e-5)


def test_the_gain_is_that_of_the_weights_in_the_settings_of_a_law() -> None:
    found, plant = designed(), mr.control.plant_of(frame(), frame().storeys[:1])
    for scale in (1.0, 1e-3):
        settings = mr.control.RegulatorSettings(**found.settings(scale))
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
    over = found.certificate.rms / found.outputs.limits / found.reachable_ratio
    weighs = found.output_weights * found.outputs.limits**2 > 1e-4
    assert 2 <= weighs.sum() < len(weighs), "choose limits of which several bind"
    np.testing.assert_allclose(over[weighs], 1.0, rtol=1e-4)
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


def test_limits_out_of_reach_are_explained_with_a_budget_that_reaches_them() -> None:
    found = design(frame(), limits={"rms_drift": 4e-3}, budget=100.0)
    assert found.reachable_ratio > 1.0
    assert found.remarks[0].code == "limits_unreachable"
    enough = design(frame(), limits={"rms_drift": 4e-3}, budget=100.0 * found.budget_factor)
    assert enough.reachable_ratio == pytest.approx(1.0, rel=1e-4)
    never = design(frame(), limits={"rms_acceleration": 1e-3}, budget=100.0)
    assert never.budget_factor == np.inf
    assert "100 times the budget" in never.remarks[0].message


def test_each_device_has_its_budget() -> None:
    found = design(frame(), 2, limits=LIMITS, budget=[600.0, 200.0])
    assert found.gain.shape == (2, 10)
    np.testing.assert_allclose(found.certificate.forces, [600.0, 200.0], rtol=1e-4)
    assert found.reachable_ratio < design(frame(), limits=LIMITS, budget=600.0).reachable_ratio


def test_a_force_may_be_limited_with_the_others() -> None:
    found = design(frame(), limits={"rms_drift": 4e-3, "rms_force": 600.0}, budget=5e3)
    check = found.certificate
    assert check.forces[0] == pytest.approx(600.0 * found.reachable_ratio, rel=1e-4)
    assert check.forces[0] < 5e3


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"limits": {"rms_drift": [1e-3, 2e-3]}}, "2 numbers for 5 storeys"),
        ({"limits": {"rms_drift": "4 kN"}}, "its unit may be m"),
        ({"limits": {"rms_force": 10.0}}, "no response is limited"),
        ({"budget": [1.0, 2.0]}, "2 numbers for 1 device"),
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


def test_the_semi_active_condition_is_met() -> None:
    for share in (0.2, 0.1):
        free, condition = designed(), mr.control.SemiActiveCondition(share=share)
        found = design(frame(), limits=LIMITS, budget=BUDGET, semi_active=condition)
        assert found.reachable_ratio >= free.reachable_ratio
        assert found.certificate.gap <= 1e-4
        for each, binds in ((found, True), (free, False)):
            correlation = force_and_rate(each)
            assert (correlation >= np.sqrt(1.0 - share**2) - 1e-4) == binds
        refusal(found.settings, match="the key designed")
        P = scipy.linalg.solve_continuous_are(found.plant.A, found.plant.B, found.Q, found.R, s=found.N)
        gain = np.linalg.solve(found.R, found.plant.B.T @ P + found.N.T)
        np.testing.assert_allclose(
            (gain - found.gain) @ found.plant.scaling,
            0.0,
            atol=1e-4 * np.linalg.norm(found.gain @ found.plant.scaling),
        )


@pytest.mark.parametrize(
    ("n_devices", "budget"), [(1, BUDGET), (1, 2e4), pytest.param(2, 2e4, marks=pytest.mark.long)]
)
def test_dampings_of_a_semi_active_condition_are_those_of_the_least_ratio(
    n_devices: int, budget: float
) -> None:
    """The force follows the condition, so that to take its damping for the next one creeps to the optimum."""
    case: dict[str, Any] = {"n_devices": n_devices, "limits": {"rms_drift": 2e-3}, "budget": budget}
    found = design(frame(), **case, semi_active=mr.control.SemiActiveCondition(share=0.1))
    ratios = []
    for dampings in product(np.geomspace(1e1, 1e5, 13 if n_devices == 1 else 4), repeat=n_devices):
        condition = mr.control.SemiActiveCondition(share=0.1, damping=tuple(dampings))
        with suppress(mr.errors.SettingError):
            ratios.append(design(frame(), **case, semi_active=condition).reachable_ratio)
    assert len(ratios) >= 6
    assert found.reachable_ratio <= 1.0005 * min(ratios)


@pytest.mark.long
def test_a_budget_that_a_semi_active_design_does_not_use_leaves_a_control_weight() -> None:
    """Its multiplier may be zero; a law gives one size of R as a ratio to the control weight."""
    found = design(
        frame(), limits={"rms_drift": 1e-3}, budget=2e5, semi_active=mr.control.SemiActiveCondition(share=0.1)
    )
    assert 0.0 < found.control_weight[0] <= 1e-3 * found.R[0, 0]


def force_and_rate(found: mr.control.DesignedWeights) -> float:
    """Correlation of desired force and rate of elongation under the Riccati gain on all states."""
    A, B, ground, _, _ = in_si(frame())
    Q, N = (np.pad(each, ((0, 2), (0, 2 * (each.shape[1] > 1)))) for each in (found.Q, found.N))
    P = scipy.linalg.solve_continuous_are(A, B, Q, found.R, s=N)
    gain = np.linalg.solve(found.R, B.T @ P + N.T)
    X = scipy.linalg.solve_continuous_lyapunov(A - B @ gain, -ground)
    force, rate = -gain[0], np.pad(deformation_rates(found.plant).C[0], (0, 2))
    return float(force @ X @ rate / np.sqrt((force @ X @ force) * (rate @ X @ rate)))


def test_a_condition_that_cannot_be_is_refused() -> None:
    two = mr.control.SemiActiveCondition(share=0.2, damping=(1e3, 1e3))
    refusal(
        design,
        frame(),
        limits=LIMITS,
        budget=BUDGET,
        semi_active=two,
        match="damping has 2 numbers for 1 device",
    )


def test_the_weights_of_a_record_follow_its_content(tmp_path: Path) -> None:
    record, found = tmp_path / "record.csv", []
    wishes = WeightWishes(rms_drift=2e-3, budget=500.0, record=str(record))
    for frequency in (2.0, 6.0):
        time = 0.01 * np.arange(2001)
        swing = np.sin(2.0 * np.pi * frequency * time) + 0.3 * np.sin(7.0 * time)
        rows = [f"{t:.2f},{a:.6f}" for t, a in zip(time, swing, strict=True)]
        record.write_text("\n".join(["time [s],acceleration [m/s2]", *rows]), encoding="utf-8")
        found.append(wishes.of_problem(design_problem()).reachable_ratio)
    assert abs(found[0] / found[1] - 1.0) > 0.1
