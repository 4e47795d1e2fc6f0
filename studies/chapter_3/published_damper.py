"""Table 3.3: the damper of 20 tons from fluid and coil beside its published figures, and what the deviations are."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from mrwork.dampers import design
from mrwork.report import Table
from studies.former.table import table_of

# Published figures, remembered: see `mr.dampers.design.twenty_ton_damper`. The power is an upper limit.
PUBLISHED = {
    "force [kN]": 200.0,
    "dynamic range": 10.1,
    "resistance of a coil [ohm]": 7.3,
    "inductance [H]": 6.0,
    "power [W]": 50.0,
    "active fluid [cm3]": 90.0,
    "whole fluid [l]": 5.0,
}
PUBLISHED_QUOTIENT = 2e-10
"""Published viscosity over yield stress squared [s/Pa], remembered."""
_WHY = {
    "force [kN]": "the yield stress of the steel circuit at 1.5 A, which is 3 % below that of saturation",
    "dynamic range": "viscosity and yield stress, which do not belong together as published; see below",
    "resistance of a coil [ohm]": "from turns, gauge and the assumed groove",
    "inductance [H]": "differential, at 1.5 A; it falls with the current, and that of the published one is not known",
    "power [W]": "published as less than 50 W",
    "active fluid [cm3]": "bore, gap and poles, which are published: these do not give 90 cm3",
    "whole fluid [l]": "from bore, stroke and the assumed rod",
}


def predicted() -> dict[str, float]:
    """What the design gives for each published figure."""
    damper = design.twenty_ton_damper()
    return {
        "force [kN]": 1e-3 * damper.largest_force,
        "dynamic range": damper.dynamic_range,
        "resistance of a coil [ohm]": damper.resistance / damper.stages,
        "inductance [H]": float(damper.inductance(damper.largest_current)),
        "power [W]": damper.power,
        "active fluid [cm3]": 1e6 * damper.active_slot.volume,
        "whole fluid [l]": 1e3 * damper.fluid_mass / damper.fluid.density,
    }


def deviations() -> dict[str, float]:
    """What changes the dynamic range, and other numbers behind the deviations."""
    damper = design.twenty_ton_damper()
    level = replace(damper, coil_clearance=0.0)
    return {
        "range, winding 4 mm below the poles": damper.dynamic_range,
        "range, winding level with the poles": level.dynamic_range,
        "range, viscosity of 2e-10 s/Pa": _at_quotient(damper).dynamic_range,
        "range, poles alone, no rod, wall at rest": _bare_range(damper),
        "force by plates [kN]": 1e-3 * _force(damper, "plates"),
        "force by the sum [kN]": 1e-3 * _force(damper, "sum"),
        "inductance at zero current [H]": float(damper.inductance(0.0)),
        "inductance, flux linkage over 1.5 A [H]": _linkage(damper) / damper.largest_current,
        "yield stress at 1.5 A [kPa]": 1e-3 * float(damper.yield_stress(damper.largest_current)),
        "viscosity over yield stress squared [1e-10 s/Pa]": 1e10 * damper.fluid.viscosity / 62e3**2,
        "response time, voltage of 1.5 A [s]": damper.response_time(),
        "response time, ten times the voltage [s]": damper.response_time(
            10.0 * damper.resistance * damper.largest_current
        ),
    }


def _force(damper: design.DamperDesign, flow_model: Any) -> float:
    return float(damper.force(damper.velocity, damper.largest_current, flow_model=flow_model))


def _at_quotient(damper: design.DamperDesign) -> design.DamperDesign:
    """The damper with the viscosity of the published quotient at the published yield stress of 62 kPa."""
    return replace(damper, fluid=replace(damper.fluid, viscosity=PUBLISHED_QUOTIENT * 62e3**2))


def _linkage(damper: design.DamperDesign) -> float:
    """Flux linkage of all coils at the largest current [Wb]."""
    return damper.stages * damper.turns * float(damper.circuit.flux(damper.largest_current))


def _bare_range(damper: design.DamperDesign) -> float:
    """Range of the poles at saturation, without rod and coils and by plates whose walls rest."""
    slot = damper.active_slot
    on, off = design.plate_pressure(
        slot,
        flow=np.pi * damper.piston_radius**2 * damper.velocity,
        yield_stress=np.array([damper.fluid.largest_yield_stress, 0.0]),
        viscosity=damper.fluid.viscosity,
    )
    return float(on / off)


def tables(found: dict[str, Any]) -> tuple[Table, Table]:
    """Table 3.3 in form, and the deviations."""
    predicted = found["predicted"]
    beside = table_of(
        "Table 3.3 in form: the damper of 20 tons at 0.1 m/s and 1.5 A",
        "figure",
        ((name, name) for name in PUBLISHED),
        {
            "published": lambda name: f"{'< ' if name.startswith('power') else ''}{PUBLISHED[name]:g}",
            "predicted": lambda name: f"{predicted[name]:.3g}",
            "over published": lambda name: f"{predicted[name] / PUBLISHED[name]:.2f}",
            "predicted from": lambda name: _WHY[name],
        },
        note="Published figures are remembered; what was not published is assumed, see twenty_ton_damper.",
    )
    behind = table_of(
        "What the deviations are",
        "quantity",
        found["deviations"],
        {"value": "{:.3g}"},
        note=f"The same published table has {1e10 * PUBLISHED_QUOTIENT:g}e-10 s/Pa for the viscosity over the "
        "yield stress squared: its numbers do not belong to one state of the fluid.",
    )
    return beside, behind
