"""Steels of the magnetic circuit as data: curves of flux density against the field, with saturation.

A steel is one entry of `STEELS`; one that is not listed is an object of the same class.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.arguments import Within, checked
from mrwork.dampers.design.fluids import VACUUM_PERMEABILITY
from mrwork.errors import SettingError, UnknownNameError
from mrwork.summary import Summarised

Floats = NDArray[np.float64]
FluxDensities = Annotated[ArrayLike, Within(least=0.0, most=1e6)]


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Steel(Summarised):
    """A soft magnetic steel by the points of its initial magnetisation curve, straight between them.

    Beyond the last point the flux density grows with the permeability of the vacuum.

    Parameters
    ----------
    field, flux_density
        Points of the curve [A/m] and [T], both increasing from 0.
    source
        Where the curve is from.

    Raises
    ------
    SettingError
        If the points are not two or more, in pairs, and increasing from 0.
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

    @checked
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
    """Return the steel with this name.

    Raises
    ------
    UnknownNameError
        If there is no such steel; the message lists all names.
    """
    for each in STEELS:
        if each.name == name:
            return each
    known = ", ".join(each.name for each in STEELS)
    raise UnknownNameError(f"no steel is called {name!r}; choose one of {known}, or make a `Steel`")
