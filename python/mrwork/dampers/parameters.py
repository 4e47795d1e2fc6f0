"""Parameters of damper models, and the finest step at which these are simulated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import ClassVar, Literal

Scale = Literal["linear", "log", "offset"]

MOST_SUBSTEPS = 256
"""Sub-steps per sample above which a candidate is not simulated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Coefficient:
    """Plain parameter that follows the command, number of its coefficient, and command of a law by values.

    A rate has the unit of the command in its denominator alone.
    """

    parameter: str
    number: int
    is_rate: bool = False
    command: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ParamSpec:
    """One parameter: SI unit, scale, range and nominal value; `coefficient` is set for one of a current law."""

    _made_by: ClassVar[str] = "spec.parameters"

    name: str
    unit: str
    scale: Scale
    lower: float
    upper: float
    nominal: float
    description: str
    coefficient: Coefficient | None = None

    @property
    def plain_name(self) -> str:
        """Name of the parameter of the plain model, of which this one may be a coefficient."""
        return self.name if self.coefficient is None else self.coefficient.parameter

    @property
    def is_positive(self) -> bool:
        """Whether the scale is logarithmic."""
        return self.scale == "log"

    @property
    def scales_with_force(self) -> bool:
        """Whether the newton is in the numerator of the unit, as in N, N/m and N s/m."""
        return self.unit.replace("/", " ").split(" ")[0] == "N"


# Lag of the coil and driver of an MR damper: 190 1/s in Spencer et al. 1997 and Dyke et al. 1996.
DRIVER_RATE = ParamSpec(
    name="eta",
    unit="1/s",
    scale="log",
    lower=1.0,
    upper=1e5,
    nominal=190.0,
    description="rate of the driver's first-order lag",
)
Lag = Literal["none", "one_rate", "two_rates"]
"""How the current in the coil comes after its command: at once, or by a first-order lag with one rate, or with two.

Two rates are one of a current that is below its command and rises, and one of a current that falls: a driver raises a
current by its voltage, and lets it fall through a diode.
"""

DRIVER_RATES: Mapping[Lag, tuple[ParamSpec, ...]] = MappingProxyType(
    {
        "none": (),
        "one_rate": (DRIVER_RATE,),
        "two_rates": (
            replace(
                DRIVER_RATE, name="eta_rise", description="rate of the driver's lag for a rising current"
            ),
            replace(
                DRIVER_RATE, name="eta_fall", description="rate of the driver's lag for a falling current"
            ),
        ),
    }
)
"""The rates of each lag, the last parameters of a model with current laws."""
RATE_NAMES = frozenset(rate.name for rates in DRIVER_RATES.values() for rate in rates)
