"""A damper from its geometry: forces, the published damper of 20 tons, and the model that simulations take."""

from dataclasses import replace

import numpy as np
import pytest
from refusals import refusal
from small_damper import SMALL

import mrwork as mr
from mrwork.dampers.design import DamperDesign, pressure_drop, twenty_ton_damper

LARGE = twenty_ton_damper()
SMALL_DAMPER = DamperDesign(**SMALL)


@pytest.mark.parametrize("design", [SMALL_DAMPER, LARGE], ids=["small", "large"])
def test_force_is_odd_dissipates_and_grows_with_velocity_and_current(design: DamperDesign) -> None:
    velocity = design.velocity * np.linspace(-1.0, 1.0, 9)
    current = design.largest_current * np.linspace(0.0, 1.0, 4)
    force = design.force(velocity, current[:, None])
    assert np.array_equal(force, -force[:, ::-1])
    assert np.all(force[:, 4] == 0.0)
    assert np.all((force * velocity)[:, velocity != 0.0] > 0.0)
    assert np.all(np.diff(force, axis=1) > 0.0)
    assert np.all(np.diff(force[:, 5:], axis=0) > 0.0)


@pytest.mark.parametrize("design", [SMALL_DAMPER, LARGE], ids=["small", "large"])
def test_flow_models_agree(design: DamperDesign) -> None:
    velocity, current = (
        design.velocity * np.array([0.1, 0.3, 1.0]),
        np.array([[0.0], [design.largest_current]]),
    )
    exact = design.force(velocity, current)
    assert design.force(velocity, current, flow_model="plates") == pytest.approx(exact, rel=3e-3)
    assert design.force(velocity, current, flow_model="sum") == pytest.approx(exact, rel=0.045)


def test_off_state_force_is_that_of_a_newtonian_slot() -> None:
    # 12 eta Q L/(w h^3) in each slot and the wall in motion, on the piston and half the slot.
    speed = 0.05
    flow = SMALL_DAMPER.piston_area * speed
    drop = sum(
        12.0
        * SMALL_DAMPER.fluid.viscosity
        * slot.length
        * (flow + slot.width * slot.gap * speed / 2.0)
        / (slot.width * slot.gap**3)
        for slot in (SMALL_DAMPER.active_slot, SMALL_DAMPER.passive_slot)
    )
    area = SMALL_DAMPER.piston_area + SMALL_DAMPER.active_slot.width * SMALL_DAMPER.gap / 2.0
    # The slots are annuli of 4 % of their radius.
    assert SMALL_DAMPER.force(speed, 0.0) == pytest.approx(drop * area + SMALL_DAMPER.friction, rel=1e-3)


def test_the_20_ton_damper_is_near_what_was_published() -> None:
    # Spencer, Yang, Carlson, Sain 1998: 200 kN, 3 x 7.3 ohm, less than 50 W, 90 cm^3 of active fluid, about 5 l of all.
    assert LARGE.largest_force == pytest.approx(200e3, rel=0.1)
    assert LARGE.resistance == pytest.approx(3 * 7.3, rel=0.1)
    assert 40.0 < LARGE.power < 50.0
    assert LARGE.active_slot.volume == pytest.approx(90e-6, rel=0.2)
    assert LARGE.fluid_mass / LARGE.fluid.density == pytest.approx(5e-3, rel=0.15)
    # About 6 H; the coils are half saturated, and what was measured at which current is not known.
    at_full, at_rest = LARGE.inductance([1.5, 0.0])
    assert 6.0 < at_full < 10.0 < at_rest
    # 10.1 at 0.1 m/s.
    assert LARGE.dynamic_range == pytest.approx(10.1, rel=0.15)


def test_the_winding_of_the_20_ton_damper_decides_its_range() -> None:
    assert replace(LARGE, coil_clearance=0.0).dynamic_range == pytest.approx(3.6, abs=0.05)
    # Poles alone, no rod, walls at rest, published yield stress: the viscous part is 25.2 kN, the whole 227 kN.
    slot, flow = LARGE.active_slot, np.pi * LARGE.piston_radius**2 * LARGE.velocity
    on, off = (
        float(pressure_drop(slot, "plates", flow=flow, yield_stress=tau, viscosity=1.3))
        for tau in (62e3, 0.0)
    )
    assert on / off == pytest.approx(9.03, abs=0.01)


def test_large_coils_rise_slowly_and_a_current_driver_helps() -> None:
    slow, fast = LARGE.response_time(), LARGE.response_time(supply=120.0)
    assert 0.3 < slow < 2.0
    assert fast < 0.4 * slow
    refusal(LARGE.response_time, supply=10.0, match="more than the 6.59 V")


@pytest.mark.parametrize("design", [SMALL_DAMPER, LARGE], ids=["small", "large"])
def test_model_has_the_forces_of_the_design(design: DamperDesign) -> None:
    model = design.as_model()
    assert model.nrmse < 0.02
    n_time, dt = 4001, 5e-4
    time = dt * np.arange(n_time)
    for current in (0.0, 0.5 * design.largest_current, design.largest_current):
        loading = mr.Loading(
            dt=dt,
            displacement=-design.velocity / np.pi * np.cos(np.pi * time),
            velocity=design.velocity * np.sin(np.pi * time),
            command=np.full(n_time, current),
            command_unit="A",
        )
        force = mr.simulate_force(model.spec, model.theta, loading)
        force, speed = force[::50], loading.velocity[::50]
        wanted = design.force(speed, current)
        # Slower parts lie within the smoothed change of sign.
        fast = np.abs(speed) > 0.1 * design.velocity
        assert np.sqrt(np.mean((force - wanted)[fast] ** 2) / np.mean(wanted[fast] ** 2)) < 0.02


def test_what_cannot_be_built_is_refused() -> None:
    for changed, word in (
        ({"coil_depth": 0.02}, "a core thicker than the rod"),
        ({"coil_clearance": 0.01}, "a smaller `coil_clearance`"),
        ({"turns": 1000}, "fewer turns"),
    ):
        refusal(replace, SMALL_DAMPER, **changed, match=word)
