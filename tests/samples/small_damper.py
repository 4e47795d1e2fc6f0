"""A small damper of two coils, and modest wishes for one, as keywords of `DamperDesign` and `DamperWishes`."""

from typing import Any

from mrwork.dampers.design import fluid, steel

SMALL: dict[str, Any] = {
    "fluid": fluid("MRF-132DG"),
    "steel": steel("AISI 1010"),
    "bore": 0.05,
    "wall": 0.008,
    "rod": 0.012,
    "gap": 0.001,
    "stages": 2,
    "pole_length": 0.01,
    "coil_length": 0.015,
    "coil_depth": 0.01,
    "coil_clearance": 0.001,
    "turns": 150,
    "wire_gauge": 22,
    "largest_current": 2.0,
    "stroke": 0.03,
    "velocity": 0.1,
    "friction": 20.0,
}
WISHES = {
    "force": 500.0,
    "dynamic_range": 2.0,
    "stroke": 0.02,
    "velocity": 0.05,
    "outer_diameter": 0.1,
    "length": 0.3,
    "voltage": 12.0,
    "current": 2.0,
}
