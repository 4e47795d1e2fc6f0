"""Magnetorheological fluids as data: yield stress and flux density against the field, viscosity, density.

A fluid is one entry of `FLUIDS`; one that is not listed is an object of the same class.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import Within, checked
from mrwork.dampers.design.ranges import Fields, FlowIndex, Viscosity
from mrwork.errors import UnknownNameError
from mrwork.summary import Summarised

Floats = NDArray[np.float64]
Carrier = Literal["hydrocarbon oil", "silicone oil", "water"]

VACUUM_PERMEABILITY = 4e-7 * np.pi
"""Of the vacuum [H/m]."""

# Factor C of the yield stress.
_CARRIER_FACTORS: Mapping[Carrier, float] = {"hydrocarbon oil": 1.0, "silicone oil": 0.95, "water": 1.16}


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class MRFluid(Summarised):
    """A fluid by the volume fraction of its iron particles, by Carlson's formulas for fluids of carbonyl iron.

    Shear stress `tau_y(H) + K (du/dy)^n`: Bingham where the exponent n is 1, Herschel-Bulkley otherwise. Yield stress
    and flux density follow from the particle fraction phi and the field H [A/m],

        tau_y = C 271700 phi^1.5239 tanh(6.33e-6 H) Pa,
        B = 1.91 phi^1.133 (1 - exp(-10.97 mu0 H)) + mu0 H

    with C of the carrier (Carlson, Int. J. Mod. Phys. B 19, 2005, 1463-1470; two restatements of the formulas agree, C
    for water is remembered).

    Parameters
    ----------
    particle_fraction
        Volume fraction of the particles; the formulas were fitted from 0.05 to 0.5.
    viscosity
        Plastic viscosity, or the consistency K [Pa s^n].
    density
        [kg/m^3].
    flow_index
        The exponent n.
    source
        Where the numbers are from.
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

    @checked
    def yield_stress(self, field: Fields) -> Floats:
        """Yield stress [Pa] in a field [A/m] of any shape."""
        stress: Floats = self.largest_yield_stress * np.tanh(6.33e-6 * np.asarray(field, dtype=np.float64))
        return stress

    @checked
    def flux_density(self, field: Fields) -> Floats:
        """Flux density [T] in a field [A/m] of any shape."""
        vacuum = VACUUM_PERMEABILITY * np.asarray(field, dtype=np.float64)
        density: Floats = vacuum - 1.91 * self.particle_fraction**1.133 * np.expm1(-10.97 * vacuum)
        return density


_SHEET = "Lord technical data: viscosity at 40 C and density, means of the stated ranges"
_REMEMBERED = "remembered, as is the particle fraction in the name"

FLUIDS = (
    MRFluid(
        name="MRF-122EG",
        particle_fraction=0.22,
        viscosity=0.042,
        density=2380.0,
        source=f"{_SHEET}; {_REMEMBERED}",
    ),
    MRFluid(
        name="MRF-132DG",
        particle_fraction=0.32,
        viscosity=0.112,
        density=3050.0,
        source=f"{_SHEET}; the same numbers in a second source",
    ),
    MRFluid(
        name="MRF-140CG",
        particle_fraction=0.40,
        viscosity=0.280,
        density=3640.0,
        source=f"{_SHEET}; {_REMEMBERED}",
    ),
)
"""Fluids by name."""


@checked
def fluid(name: str) -> MRFluid:
    """Return the fluid with this name.

    Raises
    ------
    UnknownNameError
        If there is no such fluid; the message lists all names.

    Examples
    --------
    >>> import mrwork as mr
    >>> round(mr.dampers.design.fluid("MRF-132DG").largest_yield_stress)
    47862
    """
    for each in FLUIDS:
        if each.name == name:
            return each
    known = ", ".join(each.name for each in FLUIDS)
    raise UnknownNameError(f"no fluid is called {name!r}; choose one of {known}, or make an `MRFluid`")
