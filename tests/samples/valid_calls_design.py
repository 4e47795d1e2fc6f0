"""Valid calls on the design of dampers, for tests that make them wrong; see `valid_calls_dampers`."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from small_damper import SMALL, WISHES
from wrong_arguments import Calls, call, calls_with

import mrwork as mr
from mrwork.dampers import design

_FLUID, _STEEL = design.fluid("MRF-132DG"), design.steel("AISI 1010")
_SLOT = design.Slot(inner_radius=0.05, gap=0.001, length=0.03)
_WISHES = design.DamperWishes(**WISHES)


def _continue(_: design.SizingProgress) -> None:
    """A callback that ends nothing."""


@cache
def _circuit() -> design.MagneticCircuit:
    return design.twenty_ton_damper().circuit


def material_calls(_: Path) -> Calls:
    """Fluids, steels, slots and circuits."""
    flow = {"flow": np.array([0.0, 1e-4]), "yield_stress": 1e4, "viscosity": 0.3, "flow_index": 0.9}
    yield call(design.MRFluid, name="mine", particle_fraction=0.3, viscosity=0.1, density=3e3, flow_index=0.9)
    yield call(design.Steel, name="mine", field=(0.0, 300.0), flux_density=(0.0, 0.5))
    flow |= {"slot": _SLOT, "wall_speed": 0.1}
    yield from calls_with(flow, design.annular_pressure, design.plate_pressure)
    parts = {
        "fluid": _FLUID,
        "steel": _STEEL,
        "gap_area": 5e-4,
        "areas": (3e-4, 4e-4),
        "lengths": (0.05, 0.06),
    }
    yield call(design.MagneticCircuit, **parts, turns=200, gap=1e-3)
    yield call(_circuit().ampere_turns, field=np.array([0.0, 1e5]))
    currents = {"current": np.array([0.0, 1.0])}
    yield from calls_with(currents, _circuit().field, _circuit().flux, _circuit().inductance)
    yield call(_circuit().rise_time, current=1.0, resistance=7.0, supply=20.0, share=0.5)


def damper_design_calls(_: Path) -> Calls:
    """Designs, their model and drawing, and sizing."""
    large = design.twenty_ton_damper()
    yield call(design.DamperDesign, **SMALL)
    yield call(large.force, velocity=np.array([-0.1, 0.0, 0.1]), current=1.0, flow_model="plates")
    yield from calls_with({"current": np.array([0.0, 1.0])}, large.yield_stress, large.inductance)
    yield call(large.response_time, supply=100.0)
    yield call(large.as_model, supply=100.0, transition=0.01)
    yield call(mr.report.cross_section_figure, design=large)
    further = {
        "response_time": 1.0,
        "current_density": 4e6,
        "stress": 1e8,
        "least_gap": 5e-4,
        "friction": 10.0,
    }
    yield call(design.DamperWishes, **WISHES, **further)
    yield call(_WISHES.missed, design=large)
    values = {"wishes": _WISHES, "fluid": _FLUID, "steel": _STEEL, "rng": 0, "on_progress": _continue}
    yield from calls_with({**values, "search": "differential_evolution", "budget": 60}, design.size_damper)
    yield call(design.size_front, wishes=_WISHES, fluid=_FLUID, steel=_STEEL, population=12, budget=60)


ROOMS = (material_calls, damper_design_calls)
