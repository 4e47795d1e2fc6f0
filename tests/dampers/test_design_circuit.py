"""Fluids, steels, and the magnetic circuit of a coil, against hand formulas and limits."""

from dataclasses import replace

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st
from refusals import refusal

from mrwork.dampers.design import MagneticCircuit, MRFluid, Steel, fluid, steel
from mrwork.dampers.design.damper_design import wire_diameter
from mrwork.dampers.design.materials import FLUIDS, STEELS, VACUUM_PERMEABILITY

FLUID = fluid("MRF-132DG")
CIRCUIT = MagneticCircuit(
    fluid=FLUID,
    steel=steel("AISI 1010"),
    turns=200,
    gap=1e-3,
    gap_area=5e-4,
    areas=(3e-4, 4e-4),
    lengths=(0.05, 0.06),
)


@pytest.mark.parametrize("each", FLUIDS, ids=lambda each: each.name)
def test_a_fluid_saturates(each: MRFluid) -> None:
    field = np.linspace(0.0, 1e6, 201)
    stress, density = each.yield_stress(field), each.flux_density(field)
    assert stress[0] == density[0] == 0.0
    assert np.all(np.diff(stress) > 0.0)
    assert np.all(np.diff(stress, 2) <= 1e-9)
    # Far in saturation the particles add nothing to the vacuum.
    far = np.array([1e7, 2e7])
    assert np.diff(each.flux_density(far)) == pytest.approx(VACUUM_PERMEABILITY * 1e7, rel=1e-9)
    assert each.yield_stress(far) == pytest.approx(each.largest_yield_stress)


def test_more_particles_are_stronger_thicker_and_heavier() -> None:
    ordered = sorted(FLUIDS, key=lambda each: each.particle_fraction)
    for name in ("largest_yield_stress", "viscosity", "density"):
        assert np.all(np.diff([getattr(each, name) for each in ordered]) > 0.0)


@pytest.mark.parametrize("each", STEELS, ids=lambda each: each.name)
def test_a_steel_saturates_and_goes_on_as_vacuum(each: Steel) -> None:
    assert each.field_of(each.flux_density) == pytest.approx(each.field)
    beyond = each.flux_density[-1] + np.array([0.0, 1.0])
    assert np.diff(each.field_of(beyond)) == pytest.approx(1.0 / VACUUM_PERMEABILITY)
    # The last piece of the curve is that of the vacuum or a little steeper; the tables have four digits.
    slope = np.diff(each.flux_density)[-1] / np.diff(each.field)[-1] / VACUUM_PERMEABILITY
    assert 1.0 - 1e-3 < slope < 1.2


def test_circuit_without_saturation_is_the_sum_of_reluctances() -> None:
    current = 1e-4
    permeability = VACUUM_PERMEABILITY * (1.0 + 1.91 * FLUID.particle_fraction**1.133 * 10.97)
    iron = CIRCUIT.steel.flux_density[1] / CIRCUIT.steel.field[1]
    reluctance = 2.0 * CIRCUIT.gap / (permeability * CIRCUIT.gap_area) + sum(
        length / (iron * area) for area, length in zip(CIRCUIT.areas, CIRCUIT.lengths, strict=True)
    )
    assert CIRCUIT.flux(current) == pytest.approx(CIRCUIT.turns * current / reluctance, rel=1e-4)
    assert CIRCUIT.inductance([0.0, current]) == pytest.approx(CIRCUIT.turns**2 / reluctance, rel=1e-4)


@given(current=st.floats(0.0, 50.0))
@examples(50)
def test_field_has_its_ampere_turns(current: float) -> None:
    field = CIRCUIT.field(current)
    assert CIRCUIT.ampere_turns(field) == pytest.approx(CIRCUIT.turns * current, rel=1e-9, abs=1e-12)
    assert 0.0 <= field <= CIRCUIT.turns * current / (2.0 * CIRCUIT.gap)


def test_inductance_is_the_derivative_of_the_linkage_and_falls() -> None:
    current = np.linspace(0.05, 6.0, 40)
    step = 1e-3
    linkage = CIRCUIT.turns * (CIRCUIT.flux(current + step) - CIRCUIT.flux(current - step)) / (2.0 * step)
    # The curve of the steel has corners, where a difference over a step is a mean.
    assert np.median(np.abs(CIRCUIT.inductance(current) / linkage - 1.0)) < 1e-3
    assert CIRCUIT.inductance(6.0) < 0.5 * CIRCUIT.inductance(0.05)


def test_steel_of_little_area_limits_the_flux() -> None:
    narrow = replace(CIRCUIT, areas=(1e-4,), lengths=(0.05,))
    assert narrow.flux(2.0) < 0.6 * CIRCUIT.flux(2.0)
    assert narrow.flux(2.0) / 1e-4 > 1.5


def test_unsaturated_coil_rises_with_its_time_constant() -> None:
    current, resistance = 1e-4, 2.0
    constant = float(CIRCUIT.inductance(current)) / resistance
    assert CIRCUIT.rise_time(current=current, resistance=resistance) == pytest.approx(constant, rel=1e-3)
    driven = CIRCUIT.rise_time(current=current, resistance=resistance, supply=1.0)
    share = (1.0 - np.exp(-1.0)) * resistance * current / 1.0
    # A driver of 1 V for a current that takes a thousandth of it has little left to wait for; 1 mV is the least supply.
    assert driven == pytest.approx(-constant * np.log1p(-share), rel=1e-3)


def test_saturated_coil_rises_sooner_than_its_first_inductance_says() -> None:
    resistance = 2.0
    assert CIRCUIT.rise_time(current=6.0, resistance=resistance) < float(CIRCUIT.inductance(0.0)) / resistance


def test_no_curve_of_a_steel_and_a_weak_supply_are_refused() -> None:
    refusal(Steel, name="x", field=(0.0, 1.0, 1.0), flux_density=(0.0, 1.0, 2.0), match="increase from 0")
    refusal(CIRCUIT.rise_time, current=3.0, resistance=2.0, supply=2.0, match=r"more than the 3\.79 V")


@pytest.mark.parametrize(("gauge", "millimetres"), [(0, 8.251), (16, 1.291), (22, 0.6438), (30, 0.2546)])
def test_wire_has_the_diameter_of_the_tables(gauge: int, millimetres: float) -> None:
    # ASTM B258.
    assert 1e3 * wire_diameter(gauge) == pytest.approx(millimetres, rel=1e-3)
