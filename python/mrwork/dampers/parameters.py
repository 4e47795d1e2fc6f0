"""Parameters of damper models, and the laws that relate them to the command."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import ClassVar, Literal, cast

import numpy as np
from numpy.typing import NDArray

from mrwork import _rust
from mrwork.errors import UnknownNameError

Scale = Literal["linear", "log", "offset"]
LawName = Literal["constant", "linear", "quadratic", "cubic", "exponential"]
CommandUnit = Literal["A", "V"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Coefficient:
    """Place of a parameter in a current law: the plain parameter that follows the command, and the number from 0."""

    _made_by: ClassVar[str] = "spec.parameters"

    parameter: str
    number: int
    is_exponent: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ParamSpec:
    """One parameter: SI unit, scale, admissible range, nominal value.

    `coefficient` is `None` for a parameter that is not a coefficient of a current law.
    """

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
    def scales_with_force(self) -> bool:
        """Whether the newton is in the numerator of the unit, as in N, N/m and N s/m."""
        return self.unit.replace("/", " ").split(" ")[0] == "N"


@dataclass(frozen=True, slots=True, kw_only=True)
class CurrentLaws:
    """Laws by which the parameters of the plain model depend on the command, which is in `unit`.

    With `u` the command received by the coil: constant `p = p.0`; linear, quadratic and cubic
    `p = p.0 + p.1 u + p.2 u^2 + p.3 u^3`; exponential `p = p.0 + p.1 exp(p.2 u)`. A parameter that follows the
    command is limited to the admissible range of the plain model. A lagged driver has `u' = -eta (u - command)`.
    """

    _made_by: ClassVar[str] = "spec.with_current_laws(laws).current"

    unit: CommandUnit
    laws: tuple[LawName, ...]
    lagged: bool


def laws_in_order(
    plain: tuple[ParamSpec, ...], laws: Mapping[str, LawName], model: str
) -> tuple[LawName, ...]:
    """Return one law per parameter of the plain model; those not named are constant.

    Raises
    ------
    UnknownNameError
        If `model` has no such parameter, or there is no such law.
    """
    names = [parameter.name for parameter in plain]
    for name, law in laws.items():
        if name not in names:
            raise UnknownNameError(
                f"{model} has no parameter {name!r} to follow the command; it has {', '.join(names)}"
            )
        if law not in current_laws():
            known = ", ".join(current_laws())
            raise UnknownNameError(f"no current law is called {law!r}; choose one of {known}")
    return tuple(laws.get(name, polynomial_laws()[0]) for name in names)


def coefficients(plain: tuple[ParamSpec, ...], current: CurrentLaws) -> tuple[ParamSpec, ...]:
    """Parameters of a model with current laws: the coefficients of each law, then the rate of a lagged driver."""
    parameters: list[ParamSpec] = []
    for parameter, law in zip(plain, current.laws, strict=True):
        parameters += _coefficients(parameter, current_laws()[law], current.unit)
    return (*parameters, _DRIVER_RATE) if current.lagged else tuple(parameters)


def law_equations(plain: tuple[ParamSpec, ...], current: CurrentLaws) -> list[str]:
    """Equations of the laws that are not constant, and of the driver."""
    laws = [current_laws()[name] for name in current.laws]
    pairs = zip(plain, laws, strict=True)
    lines = [_equation(parameter.name, law) for parameter, law in pairs if law.degree != 0]
    driver = "u' = -eta (u - command)" if current.lagged else "u = command"
    return [*lines, f"{driver} [{current.unit}]"]


# Lag of the coil and driver of an MR damper: 190 1/s in Spencer et al. 1997 and Dyke et al. 1996.
_DRIVER_RATE = ParamSpec(
    name="eta",
    unit="1/s",
    scale="log",
    lower=1.0,
    upper=1e5,
    nominal=190.0,
    description="rate of the driver's first-order lag",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CurrentLaw:
    """A law by which a parameter follows the command; `degree` is `None` for the one law that is not polynomial."""

    name: LawName
    n_coefficients: int
    degree: int | None

    @property
    def is_exponential(self) -> bool:
        """Whether this is `p.0 + p.1 exp(p.2 u)`, the only law that is not polynomial."""
        return self.degree is None

    def values(self, coefficients: NDArray[np.float64], command: NDArray[np.float64]) -> NDArray[np.float64]:
        """The parameter at commands, shape (n,); it may lie outside the admissible range of the model."""
        if self.is_exponential:
            at_zero, factor, exponent = coefficients
            return np.asarray(at_zero + factor * np.exp(exponent * command))
        return np.asarray(np.polynomial.polynomial.polyval(command, coefficients))

    def stretched(self, coefficients: NDArray[np.float64], factor: float) -> NDArray[np.float64]:
        """Coefficients, on the last axis, of the parameter as a function of the command over `factor`: p(factor u)."""
        powers = np.arange(coefficients.shape[-1], dtype=np.float64)
        scale = np.array([1.0, 1.0, factor]) if self.is_exponential else np.power(factor, powers)
        return np.asarray(coefficients * scale)

    def is_special_case_of(self, other: CurrentLaw) -> bool:
        """Whether this law is the other one with some coefficients at zero."""
        if self.degree is None:
            return False
        return self.degree == 0 if other.degree is None else self.degree < other.degree


@cache
def current_laws() -> Mapping[LawName, CurrentLaw]:
    """All current laws by name; polynomials in order of their degree."""
    laws = (
        CurrentLaw(name=cast("LawName", name), n_coefficients=count, degree=degree)
        for name, count, degree in _rust.current_laws()
    )
    return {law.name: law for law in laws}


@cache
def polynomial_laws() -> tuple[LawName, ...]:
    """Names of the polynomial laws in order of their degree: entry n has n + 1 coefficients."""
    polynomials = [law for law in current_laws().values() if law.degree is not None]
    return tuple(law.name for law in sorted(polynomials, key=lambda law: law.n_coefficients))


def _coefficients(parameter: ParamSpec, law: CurrentLaw, unit: CommandUnit) -> list[ParamSpec]:
    """Coefficients of the law of a parameter; the nominal ones make it constant."""
    if law.degree == 0:
        return [parameter]
    widest = max(abs(parameter.lower), abs(parameter.upper))
    entries = []
    for power in range(law.n_coefficients):
        exponent = law.is_exponential and power == 2
        bound = 20.0 if exponent else widest
        # An exponential law has two coefficients in the unit of the parameter, and the exponent in 1/unit.
        order = int(exponent) if law.is_exponential else power
        entries.append(
            replace(
                parameter,
                name=f"{parameter.name}.{power}",
                unit=_per("" if exponent else parameter.unit, unit, order),
                scale="linear",
                lower=-bound,
                upper=bound,
                coefficient=Coefficient(parameter=parameter.name, number=power, is_exponent=exponent),
                nominal=parameter.nominal if power == 0 else -1.0 if exponent else 0.0,
                description=f"{parameter.description}; coefficient {power} of its {law.name} law",
            )
        )
    return entries


def _equation(name: str, law: CurrentLaw) -> str:
    if law.is_exponential:
        return f"{name} = {name}.0 + {name}.1 exp({name}.2 u)"
    powers = ["", " u", " u^2", " u^3"][: law.n_coefficients]
    return f"{name} = " + " + ".join(f"{name}.{power}{factor}" for power, factor in enumerate(powers))


def _per(unit: str, command: CommandUnit, power: int) -> str:
    """`unit` divided by a power of the unit of the command, in the notation of this package: N/(m A), 1/A."""
    if power == 0:
        return unit
    divisor = command if power == 1 else f"{command}^{power}"
    if unit in ("", "1"):
        return f"1/{divisor}"
    numerator, slash, denominator = unit.partition("/")
    return f"{numerator}/({denominator} {divisor})" if slash else f"{numerator}/{divisor}"
