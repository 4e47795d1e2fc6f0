"""Flow through the slot: parallel plates and the sum formula beside the annulus, and every one beside closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np

from mrwork.dampers import design
from mrwork.report import Table
from studies.former.arrays import Floats
from studies.former.table import table_of

# A slot 20 mm wide and 50 mm long; the errors depend on gap over radius and the dimensionless yield stress alone.
RADIUS, LENGTH, VISCOSITY = 0.02, 0.05, 0.1
GAPS = (0.02, 0.1, 0.3)
"""Gaps over the inner radius."""
STRESSES = np.geomspace(1e-2, 1e3, 41)
"""Dimensionless yield stresses `T = w h^2 tau_y/(12 Q eta)`."""
SHOWN = (0.01, 0.1, 1.0, 10.0, 100.0, 1000.0)
"""Those of the table."""


def slot_of(gap: float) -> design.Slot:
    """The slot with a gap in units of its inner radius."""
    return design.Slot(inner_radius=RADIUS, gap=gap * RADIUS, length=LENGTH)


def yield_stress(slot: design.Slot, flow: float, stresses: Floats) -> Floats:
    """Yield stress [Pa] of dimensionless ones."""
    return np.asarray(12.0 * flow * VISCOSITY * stresses / (slot.width * slot.gap**2))


def errors(stresses: Floats = STRESSES) -> dict[str, Floats]:
    """Pressure drop of each approximation over that of the annulus, minus 1, over the dimensionless yield stress."""
    flow = 1e-5
    found = {}
    for gap in GAPS:
        slot = slot_of(gap)
        tau = yield_stress(slot, flow, stresses)
        arguments = {"flow": flow, "yield_stress": tau, "viscosity": VISCOSITY}
        exact = design.annular_pressure(slot, **arguments)
        found[f"plates, gap {gap:g} R"] = design.plate_pressure(slot, **arguments) / exact - 1.0
        if gap == GAPS[0]:
            for name, coefficient in (("sum, c of Yang", None), ("sum, c = 2", 2.0), ("sum, c = 3", 3.0)):
                summed = design.summed_pressure(slot, **arguments, coefficient=coefficient)
                found[name] = summed / exact - 1.0
    return found


def largest_errors() -> dict[str, float]:
    """The largest of each over the dimensionless yield stress."""
    return {name: float(abs(each).max()) for name, each in errors().items()}


def closed_forms() -> dict[str, float]:
    """Relative differences to solutions in closed form, the largest of a few flows."""
    flows = np.geomspace(1e-7, 1e-3, 9)
    wide, thin = slot_of(0.3), slot_of(0.02)
    inner, outer = wide.inner_radius, wide.inner_radius + wide.gap
    area = (outer**4 - inner**4) - (outer**2 - inner**2) ** 2 / np.log(outer / inner)
    newtonian = 8.0 * VISCOSITY * LENGTH * flows / (np.pi * area)
    moving = 12.0 * VISCOSITY * LENGTH * (flows + thin.width * thin.gap * 0.1 / 2.0)
    index = 0.7
    power = (2.0 * (2.0 * index + 1.0) / index * flows / (thin.width * thin.gap**2)) ** index
    return {
        "annulus, Newtonian": _far(
            design.annular_pressure(wide, flow=flows, yield_stress=0.0, viscosity=VISCOSITY), newtonian
        ),
        "plates, Newtonian, moving wall": _far(
            design.plate_pressure(thin, flow=flows, yield_stress=0.0, viscosity=VISCOSITY, wall_speed=0.1),
            moving / (thin.width * thin.gap**3),
        ),
        "plates, power law, n = 0.7": _far(
            design.plate_pressure(thin, flow=flows, yield_stress=0.0, viscosity=VISCOSITY, flow_index=index),
            2.0 * VISCOSITY * LENGTH / thin.gap * power,
        ),
        "plates, Bingham, cubic of Phillips": _phillips(thin),
        "annulus, about to flow": _far(
            design.annular_pressure(wide, flow=0.0, yield_stress=2e4, viscosity=VISCOSITY),
            2.0 * 2e4 * LENGTH / wide.gap,
        ),
    }


def order_in_the_gap() -> float:
    """Order in which a Newtonian annulus becomes plates as the gap over the radius goes to 0."""

    def error(gap: float) -> float:
        slot = slot_of(gap)
        plates, annulus = (
            float(pressure(slot, flow=1e-5, yield_stress=0.0, viscosity=VISCOSITY))
            for pressure in (design.plate_pressure, design.annular_pressure)
        )
        return abs(plates / annulus - 1.0)

    return float(np.log2(error(0.1) / error(0.05)))


def _phillips(slot: design.Slot) -> float:
    """Residual of `P^3 - (1 + 3 T) P^2 + 4 T^3 = 0` over its largest term, P the pressure over the viscous one."""
    flow = 1e-5
    pressure = design.plate_pressure(
        slot, flow=flow, yield_stress=yield_stress(slot, flow, STRESSES), viscosity=VISCOSITY
    )
    p = pressure * slot.width * slot.gap**3 / (12.0 * flow * VISCOSITY * LENGTH)
    terms = np.stack([p**3, -(1.0 + 3.0 * STRESSES) * p**2, 4.0 * STRESSES**3])
    return float(np.max(abs(terms.sum(axis=0)) / abs(terms).max(axis=0)))


def _far(values: Floats, closed: Floats | float) -> float:
    return float(np.max(abs(values / closed - 1.0)))


def tables(found: dict[str, Any]) -> tuple[Table, Table]:
    """Errors at a few dimensionless yield stresses with the largest of each, and the closed forms."""
    at = errors(np.array(SHOWN))
    compared = Table(
        title="Pressure drop of the approximations over that of the annulus, error [%]",
        columns=("approximation", *(f"T = {stress:g}" for stress in SHOWN), "largest"),
        rows=tuple(
            (name, *map(_percent, values), _percent(found["largest_errors"][name]))
            for name, values in at.items()
        ),
        note="T = w h2 tau/(12 Q eta). The sums are those of the slot with a gap of 0.02 R.",
    )
    closed = table_of(
        "Flow beside closed forms",
        "case",
        found["closed_forms"],
        {"largest relative difference": "{:.0e}"},
    )
    return compared, closed


def _percent(share: float) -> str:
    return f"{100.0 * share:.2f}"
