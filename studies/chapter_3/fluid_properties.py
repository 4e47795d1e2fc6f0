"""Tables 3.1 and 3.2: properties of fluids with a yield stress, and the fluids of the package.

The text of the thesis was not at hand. Table 3.1 has the form of the comparison that papers on these fluids print
(Carlson, Catanzarite, St. Clair 1995; Spencer, Yang, Carlson, Sain 1998); its ranges are remembered.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mrwork.dampers import design
from mrwork.report import Table
from studies.former.table import table_of

FIELD = 150e3
"""Field of the columns of table 3.2 [A/m]."""


@dataclass(frozen=True, slots=True)
class Range:
    """A remembered range of magnetorheological fluids in SI, and how table 3.1 prints it."""

    least: float
    most: float
    factor: float
    text: str
    unit: str
    electro: str


RANGES = {
    "yield stress": Range(50e3, 100e3, 1e-3, "50 to 100", "kPa", "2 to 5 kPa"),
    "plastic viscosity": Range(0.1, 1.0, 1.0, "0.1 to 1", "Pa s", "0.1 to 1 Pa s"),
    "density": Range(3000.0, 4000.0, 1e-3, "3 to 4", "g/cm3", "1 to 2 g/cm3"),
    "viscosity over yield stress squared": Range(
        1e-11, 1e-10, 1.0, "1e-11 to 1e-10", "s/Pa", "1e-8 to 1e-7 s/Pa"
    ),
}
_WORDS = (
    ("largest field", "about 250 kA/m", "about 4 kV/mm"),
    ("temperature", "-40 to 150 C", "10 to 90 C"),
    ("impurities", "hardly any effect", "not tolerated"),
    ("supply", "2 to 25 V, 1 to 2 A", "2 to 5 kV, 1 to 10 mA"),
)


def properties() -> dict[str, dict[str, float]]:
    """Properties of the fluids of the package, in SI, by name of the fluid."""
    return {
        fluid.name: {
            "particle fraction": fluid.particle_fraction,
            "plastic viscosity": fluid.viscosity,
            "density": fluid.density,
            "yield stress": fluid.largest_yield_stress,
            "yield stress at 150 kA/m": float(fluid.yield_stress(FIELD)),
            "flux density at 150 kA/m": float(fluid.flux_density(FIELD)),
            "viscosity over yield stress squared": fluid.viscosity / fluid.largest_yield_stress**2,
        }
        for fluid in design.FLUIDS
    }


def within(found: dict[str, dict[str, float]]) -> dict[str, int]:
    """For each range of table 3.1 the number of fluids of the package in it."""
    return {
        name: sum(limits.least <= fluid[name] <= limits.most for fluid in found.values())
        for name, limits in RANGES.items()
    }


def tables(found: dict[str, Any]) -> tuple[Table, Table]:
    """Tables 3.1 and 3.2 in form."""
    fluids, counts = found["properties"], found["within"]
    rows = []
    for name, each in RANGES.items():
        values = sorted(fluid[name] * each.factor for fluid in fluids.values())
        ours = f"{values[0]:.3g} to {values[-1]:.3g} {each.unit}, {counts[name]} of {len(fluids)} within"
        rows.append((name, f"{each.text} {each.unit}", each.electro, ours))
    general = Table(
        title="Table 3.1 in form: fluids with a yield stress",
        columns=("property", "magnetorheological", "electrorheological", "fluids of the package"),
        rows=(*rows, *((*words, "") for words in _WORDS)),
        note="The second and third columns are remembered. Yield stress is that at saturation.",
    )
    named = table_of(
        "Table 3.2 in form: the fluids of the package",
        "fluid",
        {fluid.name: fluids[fluid.name] for fluid in design.FLUIDS if fluid.name in fluids},
        {
            "particles by volume": "{particle fraction:.2f}",
            "viscosity [Pa s]": "{plastic viscosity:.3f}",
            "density [kg/m3]": "{density:.0f}",
            "yield stress [kPa]": lambda fluid: f"{1e-3 * fluid['yield stress']:.1f}",
            "at 150 kA/m [kPa]": lambda fluid: f"{1e-3 * fluid['yield stress at 150 kA/m']:.1f}",
            "flux density there [T]": "{flux density at 150 kA/m:.3f}",
            "eta/tau2 [s/Pa]": "{viscosity over yield stress squared:.1e}",
        },
        note="Yield stress and flux density by Carlson's formulas from the particle fraction; the first yield "
        f"stress is that at saturation. Sources: {_sources()}.",
    )
    return general, named


def _sources() -> str:
    """Each source once, with the fluids that have it."""
    fluids: dict[str, list[str]] = {}
    for fluid in design.FLUIDS:
        fluids.setdefault(fluid.source, []).append(fluid.name)
    return ". ".join(f"{' and '.join(names)}: {source}" for source, names in fluids.items())
