"""Flow of Bingham and Herschel-Bulkley fluids through a slot, against closed forms, published roots and limits."""

from collections.abc import Callable
from functools import partial
from typing import get_args

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from mrwork.dampers.design import Slot, pressure_drop
from mrwork.dampers.design.flow import FlowModel

Pressure = Callable[..., np.ndarray]

SLOT = Slot(inner_radius=0.05, gap=0.001, length=0.03)
PRESSURES: tuple[Pressure, ...] = tuple(
    partial(pressure_drop, flow_model=model) for model in get_args(FlowModel)
)
annular_pressure, plate_pressure, summed_pressure = PRESSURES
EXACT = PRESSURES[:2]
VISCOSITY = 0.3


def slot_of(ratio: float) -> Slot:
    """A slot whose inner radius is this share of its outer one, 0.1 m."""
    return Slot(inner_radius=0.1 * ratio, gap=0.1 * (1.0 - ratio), length=0.05)


@pytest.mark.parametrize("ratio", [0.1, 0.5, 0.9, 0.999])
def test_newtonian_annulus_has_its_closed_form(ratio: float) -> None:
    # Bird, Stewart, Lightfoot, Transport Phenomena, 2nd ed., eq. 2.4-17.
    slot, flow = slot_of(ratio), 2e-3
    shape = (1.0 - ratio**4) - (1.0 - ratio**2) ** 2 / np.log(1.0 / ratio)
    wanted = 8.0 * VISCOSITY * flow * slot.length / (np.pi * 0.1**4 * shape)
    # The closed form cancels 1/(1 - ratio)^3 of its digits.
    found = annular_pressure(slot, flow=flow, yield_stress=0.0, viscosity=VISCOSITY)
    assert found == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("ratio", [0.2, 0.6, 0.95])
@pytest.mark.parametrize("yield_stress", [10.0, 1e3, 1e5])
def test_bingham_annulus_has_the_flow_of_fredrickson_and_bird(ratio: float, yield_stress: float) -> None:
    slot, flow, radius = slot_of(ratio), 5e-4, 0.1
    drop = float(annular_pressure(slot, flow=flow, yield_stress=yield_stress, viscosity=VISCOSITY))
    phi = 2.0 * yield_stress * slot.length / (drop * radius)

    def condition(outer: float) -> float:
        logarithm = np.log((outer - phi) / (outer * ratio))
        return 2.0 * outer * (outer - phi) * logarithm - 1.0 + (phi + ratio) ** 2 + 2.0 * phi * (1.0 - outer)

    edge = float(brentq(condition, ratio + phi, 1.0, xtol=1e-15))
    shape = (
        (1.0 - ratio**4)
        - 2.0 * edge * (edge - phi) * (1.0 - ratio**2)
        - 4.0 / 3.0 * (1.0 + ratio**3) * phi
        + (2.0 * edge - phi) ** 3 * phi / 3.0
    )
    assert np.pi * drop * radius**4 / (8.0 * VISCOSITY * slot.length) * shape == pytest.approx(flow, rel=1e-5)


@given(ratio=st.floats(1e-3, 1e3), moving=st.floats(0.0, 0.5))
@examples(25)
def test_bingham_plates_have_the_roots_of_phillips(ratio: float, moving: float) -> None:
    # With P = w h^3 dp/(12 Q eta L), T = w h^2 tau_y/(12 Q eta) and V = -w h v/(2 Q), v against the flow.
    flow = 2e-4
    T, V = ratio, -moving
    drop = plate_pressure(
        SLOT,
        flow=flow,
        yield_stress=T * 12.0 * flow * VISCOSITY / (SLOT.width * SLOT.gap**2),
        viscosity=VISCOSITY,
        wall_speed=2.0 * flow * moving / (SLOT.width * SLOT.gap),
    )
    P = float(drop) * SLOT.width * SLOT.gap**3 / (12.0 * flow * VISCOSITY * SLOT.length)
    terms = (3.0 * (P - 2.0 * T) ** 2 * (P**3 - (1.0 + 3.0 * T - V) * P**2 + 4.0 * T**3), T * V**2 * P**2)
    # Where the plug is inside the slot, as it is here; sizes of the terms before they cancel.
    assert abs(V) < 3.0 * (P - 2.0 * T) ** 2 / P
    assert sum(terms) == pytest.approx(0.0, abs=1e-9 * (3.0 * (P - 2.0 * T) ** 2 * P**3 + terms[1]))


@pytest.mark.parametrize("flow_index", [0.5, 1.0, 1.4])
def test_herschel_bulkley_plates_have_the_flow_of_the_closed_form(flow_index: float) -> None:
    # Q = w h^2/(2 tau_w^2) K^(-1/n) (S^(2+1/n)/(2+1/n) + tau_y S^(1+1/n)/(1+1/n)), S = tau_w - tau_y.
    flow, tau = 3e-4, 4e3
    drop = float(
        plate_pressure(SLOT, flow=flow, yield_stress=tau, viscosity=VISCOSITY, flow_index=flow_index)
    )
    wall, power = drop * SLOT.gap / (2.0 * SLOT.length), 1.0 / flow_index
    excess = wall - tau
    found = (
        SLOT.width
        * SLOT.gap**2
        / (2.0 * wall**2)
        * VISCOSITY**-power
        * (excess ** (2.0 + power) / (2.0 + power) + tau * excess ** (1.0 + power) / (1.0 + power))
    )
    assert found == pytest.approx(flow, rel=1e-9)


@pytest.mark.parametrize("pressure", EXACT)
@pytest.mark.parametrize("wall_speed", [0.0, 0.3])
def test_herschel_bulkley_becomes_bingham(pressure: Pressure, wall_speed: float) -> None:
    given = {"flow": 1e-3, "yield_stress": 3e3, "viscosity": VISCOSITY, "wall_speed": wall_speed}
    near = [pressure(SLOT, **given, flow_index=1.0 + step) for step in (-1e-6, 0.0, 1e-6)]
    # The rate at the wall is 1e4/s at most, so that its power changes by 1e-5.
    assert near[0] == pytest.approx(near[1], rel=2e-5)
    assert near[1] == pytest.approx(0.5 * (near[0] + near[2]), rel=1e-9)


@pytest.mark.parametrize("pressure", EXACT)
def test_fluid_begins_to_flow_at_the_plug_that_fills_the_slot(pressure: Pressure) -> None:
    tau = np.array([0.0, 1e3, 5e4])
    at_rest = 2.0 * tau * SLOT.length / SLOT.gap
    assert pressure(SLOT, flow=0.0, yield_stress=tau, viscosity=VISCOSITY) == pytest.approx(at_rest)
    slow = pressure(SLOT, flow=1e-14, yield_stress=tau[1:], viscosity=VISCOSITY)
    assert slow == pytest.approx(at_rest[1:], rel=1e-4)


def test_annulus_becomes_plates_as_the_gap_squared() -> None:
    gaps = np.array([0.1, 0.05, 0.025])
    differences = []
    for gap in gaps:
        slot = Slot(inner_radius=1.0 - gap / 2.0, gap=float(gap), length=1.0)
        # Equal ratio of yield to viscous stress in all slots.
        given = {"flow": 1e-2 * slot.width * gap**2, "yield_stress": 5.0 * VISCOSITY, "viscosity": VISCOSITY}
        differences.append(float(annular_pressure(slot, **given) / plate_pressure(slot, **given)) - 1.0)
    orders = np.diff(np.log(np.abs(differences))) / np.diff(np.log(gaps))
    assert orders == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("flow_index", [0.6, 1.0, 1.4])
@pytest.mark.parametrize("wall_speed", [0.0, 0.05, 2.0])
def test_thin_annulus_is_plates_for_any_fluid_and_wall(flow_index: float, wall_speed: float) -> None:
    given = {
        "flow": np.array([1e-6, 1e-4, 1e-3]),
        "yield_stress": np.array([[0.0], [50.0], [5e4]]),
        "viscosity": VISCOSITY,
        "flow_index": flow_index,
        "wall_speed": wall_speed,
    }
    thin = Slot(inner_radius=0.05, gap=1e-4, length=0.03)
    # The difference of first order in the ratio of gap to radius, 1/500, is that of the moving wall.
    assert annular_pressure(thin, **given) == pytest.approx(plate_pressure(thin, **given), rel=2e-3)


@given(
    flow=st.floats(1e-7, 1e-2),
    tau=st.floats(0.0, 1e5),
    wall=st.floats(0.0, 1.0),
    index=st.sampled_from([0.6, 1.0, 1.3]),
    pressure=st.sampled_from(EXACT),
)
@examples(25)
def test_pressure_grows_with_flow_yield_stress_and_motion_of_the_wall(
    flow: float, tau: float, wall: float, index: float, pressure: Pressure
) -> None:
    def drop(flow: float, tau: float, wall: float) -> float:
        return float(
            pressure(
                SLOT, flow=flow, yield_stress=tau, viscosity=VISCOSITY, flow_index=index, wall_speed=wall
            )
        )

    base = drop(flow, tau, wall)
    assert base > 2.0 * tau * SLOT.length / SLOT.gap
    assert drop(1.1 * flow, tau, wall) > base
    assert drop(flow, tau + 100.0, wall) > base
    assert drop(flow, tau, wall + 0.1) > base * (1.0 - 1e-12)


def test_sum_is_near_the_exact_pressure() -> None:
    # Yang et al. 2002 state 4 % for 0 < T < 1000 and a slow wall.
    T, flow = np.logspace(-3, 3, 61), 2e-4
    tau = T * 12.0 * flow * VISCOSITY / (SLOT.width * SLOT.gap**2)
    given = {"flow": flow, "yield_stress": tau, "viscosity": VISCOSITY}
    exact = plate_pressure(SLOT, **given)
    assert np.abs(summed_pressure(SLOT, **given) / exact - 1.0).max() < 0.04


def test_sum_without_yield_stress_is_exact_for_plates() -> None:
    for index in (0.7, 1.0, 1.2):
        given = {"flow": 1e-3, "yield_stress": 0.0, "viscosity": VISCOSITY, "flow_index": index}
        assert summed_pressure(SLOT, **given) == pytest.approx(float(plate_pressure(SLOT, **given)), rel=1e-9)


def test_wall_that_moves_alone_sets_up_the_pressure_of_couette_flow() -> None:
    # No net flow: g = 6 eta U/h^2 for a Newtonian fluid.
    found = plate_pressure(SLOT, flow=0.0, yield_stress=0.0, viscosity=VISCOSITY, wall_speed=0.2)
    assert found == pytest.approx(6.0 * VISCOSITY * 0.2 * SLOT.length / SLOT.gap**2)


def test_pressures_broadcast() -> None:
    tau, flow = np.array([[0.0], [1e4]]), np.array([0.0, 1e-4, 1e-3])
    for pressure in PRESSURES:
        table = pressure(SLOT, flow=flow, yield_stress=tau, viscosity=VISCOSITY)
        assert table.shape == (2, 3)
        alone = pressure(SLOT, flow=1e-3, yield_stress=1e4, viscosity=VISCOSITY)
        assert table[1, 2] == pytest.approx(float(alone), rel=1e-12)
