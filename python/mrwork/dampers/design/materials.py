"""Materials of a damper as data: magnetorheological fluids, and steels of the magnetic circuit.

A fluid has its yield stress and flux density against the field, viscosity and density; a steel its curve of flux
density against the field, with saturation. One is an entry of `FLUIDS` or `STEELS`; what is not listed is an object of
the class.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from mrwork.base.arguments import checked
from mrwork.base.hints import Within
from mrwork.base.keys import look_up
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats
from mrwork.errors import SettingError

Viscosity = Annotated[float, Within(least=1e-6, most=1e6)]
FlowIndex = Annotated[float, Within(least=0.1, most=3.0)]
Fields = Annotated[ArrayLike, Within(least=0.0, most=1e9)]
Carrier = Literal["hydrocarbon oil", "silicone oil", "water"]

VACUUM_PERMEABILITY = 4e-7 * np.pi
"""Of the vacuum [H/m]."""

# Factor C of the yield stress.
_CARRIER_FACTORS: Mapping[Carrier, float] = {"hydrocarbon oil": 1.0, "silicone oil": 0.95, "water": 1.16}


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class MRFluid(Summarised):
    """A fluid by the volume fraction of its iron particles, 0.05 to 0.5, by Carlson's formulas for carbonyl iron.

    Shear stress `tau_y(H) + K (du/dy)^n`: Bingham where the exponent n is 1, Herschel-Bulkley otherwise. Yield stress
    and flux density follow from the particle fraction phi and the field H [A/m],

        tau_y = C 271700 phi^1.5239 tanh(6.33e-6 H) Pa,
        B = 1.91 phi^1.133 (1 - exp(-10.97 mu0 H)) + mu0 H

    with C of the carrier (Carlson, Int. J. Mod. Phys. B 19, 2005, 1463-1470; two restatements of the formulas agree, C
    for water is remembered). `viscosity` is plastic, or the consistency K [Pa s^n]; `flow_index` is the exponent n.
    """

    _units: ClassVar[Mapping[str, str]] = {"viscosity": "Pa s^n", "density": "kg/m^3"}

    name: str
    particle_fraction: Annotated[float, Within(least=0.01, most=0.6)]
    viscosity: Viscosity
    density: Annotated[float, Within(least=100.0, most=2e4)]
    carrier: Carrier = "hydrocarbon oil"
    flow_index: FlowIndex = 1.0
    source: str = ""

    @property
    def largest_yield_stress(self) -> float:
        """Yield stress at saturation [Pa]."""
        return _CARRIER_FACTORS[self.carrier] * 271700.0 * float(self.particle_fraction**1.5239)

    def yield_stress(self, field: Fields) -> Floats:
        """Yield stress [Pa] in a field [A/m] of any shape."""
        stress: Floats = self.largest_yield_stress * np.tanh(6.33e-6 * np.asarray(field, dtype=np.float64))
        return stress

    def flux_density(self, field: Fields) -> Floats:
        """Flux density [T] in a field [A/m] of any shape."""
        vacuum = VACUUM_PERMEABILITY * np.asarray(field, dtype=np.float64)
        density: Floats = vacuum - 1.91 * self.particle_fraction**1.133 * np.expm1(-10.97 * vacuum)
        return density


_SHEET = "Lord technical data: viscosity at 40 C and density, means of the stated ranges"
_REMEMBERED = "remembered, as is the particle fraction in the name"

FLUIDS = (
    MRFluid(name="MRF-122EG", particle_fraction=0.22, viscosity=0.042, density=2380.0,
        source=f"{_SHEET}; {_REMEMBERED}"),
    MRFluid(name="MRF-132DG", particle_fraction=0.32, viscosity=0.112, density=3050.0,
        source=f"{_SHEET}; the same numbers in a second source"),
    MRFluid(name="MRF-140CG", particle_fraction=0.40, viscosity=0.280, density=3640.0,
        source=f"{_SHEET}; {_REMEMBERED}"),
)  # fmt: skip
"""Fluids by name."""


@checked
def fluid(name: str) -> MRFluid:
    """Return the fluid with this name.

    Examples
    --------
    >>> import mrwork as mr
    >>> round(mr.dampers.design.fluid("MRF-132DG").largest_yield_stress)
    47862
    """
    fluids = {entry.name: entry for entry in FLUIDS}
    return look_up(
        name, fluids, f"no fluid is called {name!r}", otherwise="make an `MRFluid`, or choose one of"
    )


FluxDensities = Annotated[ArrayLike, Within(least=0.0, most=1e6)]


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Steel(Summarised):
    """A soft magnetic steel by the points of its initial magnetisation curve, straight between them, from 0.

    Beyond the last point the flux density grows with the permeability of the vacuum.
    """

    _units: ClassVar[Mapping[str, str]] = {"field": "A/m", "flux_density": "T"}

    name: str
    field: tuple[float, ...]
    flux_density: tuple[float, ...]
    source: str = ""

    def __post_init__(self) -> None:
        for name, values in (("field", self.field), ("flux_density", self.flux_density)):
            if len(values) < 2 or values[0] != 0.0 or not np.all(np.diff(values) > 0.0):
                raise SettingError(
                    f"`{name}` of Steel {self.name!r} is no curve; give numbers that increase from 0"
                )
        if len(self.field) != len(self.flux_density):
            raise SettingError(
                f"Steel {self.name!r} has {len(self.field)} fields and {len(self.flux_density)} flux densities; "
                "give them in pairs"
            )

    def field_of(self, flux_density: FluxDensities) -> Floats:
        """Field [A/m] at a flux density [T] of any shape."""
        density = np.asarray(flux_density, dtype=np.float64)
        beyond = np.maximum(density - self.flux_density[-1], 0.0) / VACUUM_PERMEABILITY
        return np.interp(density, self.flux_density, self.field) + beyond


STEELS = (
    Steel(
        name="AISI 1010",
        field=(
            *(0.0, 238.7, 318.3, 358.1, 437.7, 477.5, 636.6, 795.8, 1114.1, 1273.2, 1591.5, 2228.2),
            *(3183.1, 4774.6, 6366.2, 7957.7, 15915.5, 47746.5, 63662.0, 79577.5, 159155.0, 318310.0),
        ),
        flux_density=(
            *(0.0, 0.2003, 0.3204, 0.40045, 0.50055, 0.5606, 0.7908, 0.931, 1.1014, 1.2016, 1.302, 1.4028),
            *(1.524, 1.626, 1.698, 1.73, 1.87, 2.04, 2.07, 2.095, 2.2, 2.4),
        ),
        source="curve of 1010 steel as finite-element programs for electric machines ship it",
    ),
    Steel(
        name="AISI 1018",
        field=(
            *(0.0, 238.7, 795.8, 1591.5, 2387.3, 3978.9, 7957.7, 15915.5, 23873.2, 39788.7, 79577.5),
            *(159155.0, 318310.0),
        ),
        flux_density=(0.0, 0.2503, 0.925, 1.25, 1.39, 1.525, 1.71, 1.87, 1.955, 2.02, 2.11, 2.225, 2.43),
        source="remembered: the curve of 1018 steel in the library of FEMM (Meeker)",
    ),
)
"""Steels by name."""


@checked
def steel(name: str) -> Steel:
    """Return the steel of `STEELS` with this name."""
    steels = {entry.name: entry for entry in STEELS}
    return look_up(name, steels, f"no steel is called {name!r}", otherwise="make a `Steel`, or choose one of")
