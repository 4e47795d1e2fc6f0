"""Passive devices: what enters the matrices, published optima, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from refusals import refusal
from scipy.integrate import solve_ivp
from scipy.linalg import solve_continuous_lyapunov
from scipy.optimize import minimize

import mrwork as mr
from mrwork.buildings import Building
from mrwork.buildings.passive_devices import column_length, head_loss_of, liquid_column_optimum
from mrwork.closed_loop.evaluation import STANDARD_GRAVITY

FRAME = mr.building("uts")
of = mr.buildings


def test_the_elastic_share_of_a_yielding_damper_is_in_the_stiffness() -> None:
    found = of.with_yielding_damper(
        FRAME, storey=2, yield_force=1e3, yield_displacement=2e-3, post_yield_ratio=0.2
    )
    row = FRAME.storeys[1]
    np.testing.assert_allclose(found.stiffness - FRAME.stiffness, 0.2 * 1e3 / 2e-3 * np.outer(row, row))
    (element,) = found.elements
    assert element.yield_force / element.yield_displacement + element.stiffness == pytest.approx(1e3 / 2e-3)


def test_rows_of_elements_follow_their_building_into_other_coordinates() -> None:
    one = of.with_friction_damper(FRAME, storey=2, slip_load=100.0, stiffness=1e5)
    tuned = of.with_tuned_mass(one, floor=5, mass=30.0, frequency=2.9, ratio=0.1)
    np.testing.assert_array_equal(tuned.elements[0].row, tuned.storey_row(2))
    slab = of.with_base_isolation_of_period(tuned, mass=300.0, period=2.0, ratio=0.1)
    np.testing.assert_array_equal(slab.elements[0].row, slab.storey_row("storey 2"))
    both = of.with_liquid_column(
        slab, floor="floor 5", mass=9.0, frequency=2.0, width_ratio=0.6, head_loss=2.0
    )
    np.testing.assert_array_equal(both.elements[0].row, both.storey_row("storey 2"))
    np.testing.assert_array_equal(both.elements[1].row, both.storey_row("liquid column"))
    modal = of.modal_truncation(one, n_modes=3)
    np.testing.assert_array_equal(modal.elements[0].row, modal.storey_row(2))


def test_bearings_are_isolators_with_a_core() -> None:
    rubber = of.with_base_isolation_of_period(FRAME, mass=330.0, period=2.0, ratio=0.05)
    lead = of.with_lead_rubber_bearings(FRAME, mass=330.0, period=2.0, ratio=0.05, yield_force=800.0)
    np.testing.assert_array_equal(lead.stiffness, rubber.stiffness)
    np.testing.assert_array_equal(lead.damping, rubber.damping)
    (element,) = lead.elements
    # The stiffness and the damping of the slab on the rubber, with the building rigid.
    assert element.stiffness == pytest.approx(rubber.influence @ rubber.stiffness @ rubber.influence)
    assert element.damping == pytest.approx(rubber.influence @ rubber.damping @ rubber.influence)


def test_bearings_by_their_strength_and_stiffness_are_those_by_period() -> None:
    total = FRAME.total_mass + 330.0
    by_period = of.with_lead_rubber_bearings(FRAME, mass=330.0, period=2.0, yield_force=800.0)
    textbook = of.with_lead_rubber_bearings(
        FRAME, mass=330.0, post_yield_stiffness=total * np.pi**2, characteristic_strength=800.0
    )
    np.testing.assert_allclose(textbook.stiffness, by_period.stiffness, rtol=1e-12)
    assert textbook.elements[0].numbers == pytest.approx(by_period.elements[0].numbers)


def test_bearings_accelerate_the_roof_as_a_bilinear_loop_does() -> None:
    bare = {"masses": [1e5] * 3, "stiffnesses": [2e8, 1.5e8, 1e8], "modal_damping": {"ratios": [0.02]}}
    bearings = {
        "mass": 1e5, "period": 2.5, "ratio": 0.02, "yield_force": 196e3, "yield_displacement": 0.01
    }  # fmt: skip
    motion = {"synthetic": "kanai_tajimi", "duration": 12, "pga": "0.4 g", "seed": 1}

    def of_roof(**knee: float) -> float:
        building = {**bare, "lead_rubber": {**bearings, **knee}}
        runs = mr.run_study(mr.study_of(building=building, motions=[motion])).quantities
        return float(runs.peak_acceleration[0, 0, 0, -1])

    study = mr.study_of(building={**bare, "lead_rubber": bearings}, motions=[motion])
    peak = bilinear_peak(study.building, study.grounds[0], force=196e3, displacement=0.01)
    assert of_roof() == pytest.approx(peak, rel=0.01)
    # A round knee, as many bearing programs have it, hides a part of the acceleration.
    assert of_roof(sharpness=2.0) < 0.95 * peak


def bilinear_peak(building: Building, ground: mr.GroundMotion, *, force: float, displacement: float) -> float:
    """Peak absolute acceleration of the roof on a lead that is elastic, then plastic: an own integration."""
    mass, slab, factor = np.linalg.inv(building.mass), building.storeys[0], 20
    step, stiffness = ground.dt / factor, force / displacement
    instants = np.arange(2 * factor * (len(ground.acceleration) - 1) + 1) / (2 * factor)
    shaking = np.interp(instants, np.arange(len(ground.acceleration)), ground.acceleration)
    q, v, yielded, peak = np.zeros(len(mass)), np.zeros(len(mass)), 0.0, 0.0

    def relative(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        lead = np.clip(stiffness * (slab @ q - yielded), -force, force)
        return -mass @ (building.damping @ v + building.stiffness @ q + slab * lead)

    for at in range(0, len(shaking) - 1, 2):
        first = relative(q, v) - shaking[at]
        second = relative(q + 0.5 * step * v, v + 0.5 * step * first) - shaking[at + 1]
        third = relative(q + 0.5 * step * (v + 0.5 * step * first), v + 0.5 * step * second) - shaking[at + 1]
        moved, faster = q + step * (v + 0.5 * step * second), v + step * third
        fourth = relative(moved, faster) - shaking[at + 2]
        q = q + step * v + step**2 / 6.0 * (first + second + third)
        v = v + step / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
        stretched = float(slab @ q) - yielded
        if abs(stretched) > displacement:
            yielded += stretched - np.sign(stretched) * displacement
        peak = max(peak, abs(float(relative(q, v)[-1])))
    return peak


@pytest.mark.parametrize("sharpness", [1.0, 2.0, 5.0])
def test_the_knee_of_bearings_is_passed_at_five_yield_displacements(sharpness: float) -> None:
    lead = of.with_lead_rubber_bearings(
        FRAME,
        mass=330.0,
        post_yield_stiffness=2e4,
        characteristic_strength=800.0,
        yield_displacement=0.01,
        sharpness=sharpness,
    ).elements[0]
    # w' = (1 - w^n) / x_y under a push from rest.
    rate = 1.0 / lead.yield_displacement
    pushed = solve_ivp(lambda _, w: (1.0 - w**sharpness) * rate, (0.0, 0.05), [0.0], rtol=1e-10, atol=1e-12)
    force = lead.stiffness * 0.05 + lead.yield_force * pushed.y[0, -1]
    assert force == pytest.approx(2e4 * 0.05 + 800.0, rel=0.01)


def test_a_liquid_column_has_the_mass_and_the_length_of_its_liquid() -> None:
    found = of.with_liquid_column(FRAME, floor=5, mass=50.0, frequency=0.5, width_ratio=0.7, head_loss=3.0)
    assert found.total_mass == pytest.approx(FRAME.total_mass + 50.0)
    length = column_length(0.5)
    assert np.sqrt(2.0 * STANDARD_GRAVITY / length) / (2.0 * np.pi) == pytest.approx(0.5)
    # rho A xi / 2, with rho A = m / L.
    assert found.elements[0].head_loss == pytest.approx(0.5 * 3.0 * 50.0 / length)
    # Pushed by the floor through its horizontal part only.
    assert (found.mass @ found.influence)[-1] == pytest.approx(0.7 * 50.0)


def mean_square(mass_ratio: float, width_ratio: float, frequency_ratio: float, ratio: float) -> float:
    """Mean square displacement of an undamped mass under a white force, with a column of linear damping."""
    one = of.shear_building(name="one", masses=[1.0], stiffnesses=[(2.0 * np.pi) ** 2])
    found = of.with_liquid_column(
        one, floor=1, mass=mass_ratio, frequency=frequency_ratio, width_ratio=width_ratio, head_loss=0.0
    )
    damping = np.diag([0.0, 2.0 * ratio * mass_ratio * 2.0 * np.pi * frequency_ratio])
    A, _, _ = replace(found, damping=damping).state_matrices()
    push = np.concatenate([np.zeros(2), np.linalg.solve(found.mass, [1.0, 0.0])])
    return float(solve_continuous_lyapunov(A, -np.outer(push, push))[0, 0])


@pytest.mark.parametrize(("mass_ratio", "width_ratio"), [(0.01, 0.8), (0.02, 0.6), (0.05, 0.9)])
def test_the_published_optimum_of_a_liquid_column_is_the_minimum(
    mass_ratio: float, width_ratio: float
) -> None:
    published = liquid_column_optimum(mass_ratio, width_ratio)
    found = minimize(
        lambda at: mean_square(mass_ratio, width_ratio, at[0], at[1]),
        np.array([1.0, 0.05]),
        method="Nelder-Mead",
        options={"xatol": 1e-7, "fatol": 1e-12},
    )
    np.testing.assert_allclose(published, found.x, rtol=2e-4)


def test_the_head_loss_of_a_damping_ratio_dissipates_as_much() -> None:
    ratio, frequency, rms = 0.08, 0.7, 0.3
    xi = head_loss_of(ratio, frequency, rms)
    velocity = rms * np.random.default_rng(5).normal(size=2_000_000)
    # Power per rho A of the loss of head, and of the dashpot 2 zeta omega L.
    lost = np.mean(0.5 * xi * np.abs(velocity) ** 3)
    linear = 2.0 * ratio * 2.0 * np.pi * frequency * column_length(frequency) * rms**2
    assert lost == pytest.approx(linear, rel=3e-3)


def test_numbers_that_no_device_has_are_refused() -> None:
    refusal(of.with_lead_rubber_bearings, FRAME, mass=1.0, yield_force=1.0, match="period")
    refusal(of.with_lead_rubber_bearings, FRAME, mass=1.0, period=2.0, match="yield_force")
    column = {"mass": 1.0, "frequency": 1.0, "width_ratio": 1.0, "head_loss": 1.0}
    refusal(of.with_liquid_column, FRAME, floor=1, **column, match="width_ratio")
