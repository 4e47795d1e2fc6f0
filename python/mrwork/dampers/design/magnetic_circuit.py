"""Magnetic circuit of one coil of the piston: from current to field, flux, inductance and rise time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import exp
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import Share, checked
from mrwork.dampers.design.materials import MRFluid, Steel
from mrwork.dampers.design.ranges import Current, Currents, Fields, Length, Turns, Voltage, roots_between
from mrwork.errors import SettingError
from mrwork.hints import Within
from mrwork.summary import Summarised

Floats = NDArray[np.float64]
Area = Annotated[float, Within(least=1e-12, most=1e4)]
Resistance = Annotated[float, Within(least=1e-9, most=1e9)]

COPPER_RESISTIVITY = 1.72e-8
"""Of copper at 20 C [ohm m]."""

_TIME_CONSTANT_SHARE = 1.0 - exp(-1.0)
"""Share of its end value that a first-order lag reaches within its time constant."""

# The least field at which an inductance is taken [A/m], far below saturation, and the relative step of its difference.
_LEAST_FIELD, _STEP = 1.0, 1e-4
# Fields of the integral of a rise time; the error of the trapezoidal rule is far below that of the circuit.
_N_FIELDS = 200


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class MagneticCircuit(Summarised):
    """Coil, steel parts in series, and the gap, which the flux crosses twice.

    The flux is continuous, `Phi = B A` in every part, and `N i = 2 H_f g + sum H_s l_s`. Leakage, hysteresis and eddy
    currents are left out.

    Parameters
    ----------
    turns
        Turns N of the coil.
    gap, gap_area
        Length [m] and area [m^2] of one crossing of the gap.
    areas, lengths
        Cross-sections [m^2] of the parts of steel, and lengths [m] of the path of the flux in them.

    Raises
    ------
    SettingError
        If there is no part of steel, or not a length for each area.
    """

    _units: ClassVar[Mapping[str, str]] = {"gap": "m", "gap_area": "m^2", "areas": "m^2", "lengths": "m"}

    fluid: MRFluid
    steel: Steel
    turns: Turns
    gap: Length
    gap_area: Area
    areas: tuple[Area, ...]
    lengths: tuple[Length, ...]

    def __post_init__(self) -> None:
        if len(self.areas) != len(self.lengths) or not self.areas:
            raise SettingError(
                f"the steel of the magnetic circuit has {len(self.areas)} areas and {len(self.lengths)} lengths; give "
                "them in pairs, one or more"
            )

    @checked
    def ampere_turns(self, field: Fields) -> Floats:
        """Ampere-turns N i [A] that give a field in the gap [A/m] of any shape."""
        field = np.asarray(field, dtype=np.float64)
        flux = self.gap_area * self.fluid.flux_density(field)
        steel = self.steel.field_of(flux[..., None] / np.array(self.areas))
        total: Floats = 2.0 * self.gap * field + steel @ np.array(self.lengths)
        return total

    @checked
    def field(self, current: Currents) -> Floats:
        """Field in the gap [A/m] at a current [A] of any shape."""
        wanted = self.turns * np.asarray(current, dtype=np.float64)
        return roots_between(
            lambda field: self.ampere_turns(field) - wanted, np.zeros_like(wanted), wanted / (2.0 * self.gap)
        )

    @checked
    def flux(self, current: Currents) -> Floats:
        """Flux [Wb] at a current [A] of any shape."""
        return self.gap_area * self.fluid.flux_density(self.field(current))

    @checked
    def inductance(self, current: Currents) -> Floats:
        """Differential inductance `N dPhi/di` [H] at currents [A] of any shape; unsaturated, N^2 over reluctance."""
        field = np.maximum(self.field(current), _LEAST_FIELD)
        below, above = (1.0 - _STEP) * field, (1.0 + _STEP) * field
        flux = self.gap_area * (self.fluid.flux_density(above) - self.fluid.flux_density(below))
        return self.turns**2 * flux / (self.ampere_turns(above) - self.ampere_turns(below))

    @checked
    def rise_time(
        self,
        *,
        current: Current,
        resistance: Resistance,
        supply: Voltage | None = None,
        share: Share = _TIME_CONSTANT_SHARE,
    ) -> float:
        """Time [s] until a share of a current [A] flows after a step, from `d(N Phi)/dt + R i = V`.

        Without a `supply` the voltage V is R times the current, so that an unsaturated coil takes L/R to the default
        share, 63 %. A current driver applies its whole `supply` voltage [V] until the current is reached.

        Raises
        ------
        SettingError
            If the supply cannot drive the current.
        """
        voltage = resistance * current if supply is None else supply
        reached = share * current
        if resistance * reached >= voltage and reached > 0.0:
            raise SettingError(
                f"a supply of {voltage:g} V drives {voltage / resistance:.3g} A through {resistance:.3g} ohm; give "
                f"more than the {resistance * reached:.3g} V that {reached:.3g} A take"
            )
        fields = np.linspace(0.0, float(self.field(reached)), _N_FIELDS)
        linkage = self.turns * self.gap_area * self.fluid.flux_density(fields)
        rate = 1.0 / (voltage - resistance * self.ampere_turns(fields) / self.turns)
        return float(np.sum(0.5 * (rate[1:] + rate[:-1]) * np.diff(linkage)))


def wire_diameter(gauge: Annotated[int, Within(least=0, most=50)]) -> float:
    """Diameter of the bare copper of an American wire gauge [m], `0.127 mm 92^((36 - gauge)/39)`."""
    return 0.127e-3 * float(92.0 ** ((36.0 - gauge) / 39.0))
