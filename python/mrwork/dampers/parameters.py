"""Parameters of damper models, and the laws that relate them to the command."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from types import ModuleType
from typing import Any, ClassVar, Literal

import numpy as np

from mrwork import _rust
from mrwork.base.keys import check_known, suggestion
from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats
from mrwork.errors import UnknownChoiceError

# NumPy or JAX array; no annotation covers both without importing JAX.
Array = Any

Scale = Literal["linear", "log", "offset"]
# A name of `current_laws`, or that of a law by values at commands, such as "values:0,0.5,1" or "quadratic:0,0.5,1".
LawName = str


# Most commands at which a law may have values; the compiled module refuses more.
_MOST_NODES = 8
# Commands in the name of a law have twelve digits.
_ROUNDED = 1.0 - 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Coefficient:
    """Plain parameter that follows the command, number of its coefficient, and command of a law by values."""

    parameter: str
    number: int
    is_exponent: bool = False
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
    def scales_with_force(self) -> bool:
        """Whether the newton is in the numerator of the unit, as in N, N/m and N s/m."""
        return self.unit.replace("/", " ").split(" ")[0] == "N"


@dataclass(frozen=True, slots=True, kw_only=True)
class CurrentLaws:
    """Laws by which the parameters of the plain model depend on the command, which is in `unit`.

    With `u` the command received by the coil: constant `p = p.0`; linear, quadratic and cubic
    `p = p.0 + p.1 u + p.2 u^2 + p.3 u^3`; exponential `p = p.0 + p.1 exp(p.2 u)`; "quadratic:0,0.5,1" is the polynomial
    through values at these commands, "values:0,0.5,1" the one through their logarithms where the scale of the parameter
    is logarithmic; beyond the first and the last command they continue along their tangents. A parameter that follows
    the command is limited to the admissible range of the plain model. A lagged driver has `u' = -eta (u - command)`.
    """

    _made_by: ClassVar[str] = "spec.with_current_laws(laws).current"

    unit: CommandUnit
    laws: tuple[LawName, ...]
    lagged: bool


def laws_in_order(
    plain: tuple[ParamSpec, ...], laws: Mapping[str, LawName], model: str
) -> tuple[LawName, ...]:
    """Return one law per parameter of the plain model; those not named are constant."""
    names = [parameter.name for parameter in plain]
    for name in laws:
        check_known(
            name, names, f"{model} has no parameter {name!r} to follow the command", otherwise="it has"
        )
    return tuple(law_named(laws.get(name, polynomial_laws()[0])).name for name in names)


def coefficients(plain: tuple[ParamSpec, ...], current: CurrentLaws) -> tuple[ParamSpec, ...]:
    """Parameters of a model with current laws: the coefficients of each law, then the rate of a lagged driver."""
    parameters: list[ParamSpec] = []
    for parameter, law in zip(plain, current.laws, strict=True):
        parameters += _coefficients(parameter, law_named(law), current.unit)
    return (*parameters, _DRIVER_RATE) if current.lagged else tuple(parameters)


def law_equations(plain: tuple[ParamSpec, ...], current: CurrentLaws) -> list[str]:
    """Equations of the laws that are not constant, and of the driver."""
    pairs = zip(plain, map(law_named, current.laws), strict=True)
    lines = [_equation(parameter, law, current.unit) for parameter, law in pairs if law.degree != 0]
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
    """A law by which a parameter follows the command; `degree` is that of a polynomial by its coefficients, or `None`.

    A law by values has them at `nodes`; one that `takes_logarithms` interpolates those of a positive parameter.
    """

    name: LawName
    n_coefficients: int
    degree: int | None
    nodes: tuple[float, ...] = ()
    takes_logarithms: bool = False

    @property
    def is_exponential(self) -> bool:
        """Whether this is `p.0 + p.1 exp(p.2 u)`."""
        return self.degree is None and not self.nodes

    def values(self, coefficients: Floats, command: Floats, *, log: bool = False) -> Floats:
        """The parameter at commands, (n,), perhaps beyond its range; `log` says whether its scale is logarithmic."""
        if self.nodes:
            return np.asarray(
                interpolate(self.nodes, coefficients, command, log=log and self.takes_logarithms)
            )
        if self.is_exponential:
            at_zero, factor, exponent = coefficients
            return np.asarray(at_zero + factor * np.exp(exponent * command))
        return np.asarray(np.polynomial.polynomial.polyval(command, coefficients))

    def _through(self, coefficients: Floats, commands: Floats, *, log: bool) -> Floats:
        """The polynomial through the values on the last axis, itself at any commands, (n,)."""
        there = _powers(self.nodes, commands) @ _basis(self.nodes)
        log = log and self.takes_logarithms
        given = np.log(coefficients) if log else coefficients
        return np.asarray(np.exp(given @ there.T) if log else given @ there.T)

    def rescale_command(self, coefficients: Floats, factor: float, *, log: bool = False) -> Floats:
        """Coefficients, on the last axis, of the parameter as a function of the command over `factor`: p(factor u)."""
        if self.nodes:
            return self._through(coefficients, factor * np.array(self.nodes), log=log)
        powers = np.arange(coefficients.shape[-1], dtype=np.float64)
        scale = np.array([1.0, 1.0, factor]) if self.is_exponential else np.power(factor, powers)
        return np.asarray(coefficients * scale)

    def rewrite(
        self, coefficients: Floats, other: CurrentLaw, parameter: ParamSpec, largest: float
    ) -> Floats | None:
        """Coefficients of another law for the curve from 0 to `largest`, on the last axis; `None` if it has none."""
        if other.name == self.name:
            return coefficients
        padded = [(0, 0)] * (coefficients.ndim - 1) + [(0, other.n_coefficients - self.n_coefficients)]
        if self.degree == 0:
            # What follows the command is limited to its range.
            if not ((parameter.lower <= coefficients) & (coefficients <= parameter.upper)).all():
                return None
            return np.pad(coefficients, padded, mode="edge" if other.nodes else "constant")
        log = parameter.scale == "log"
        if self.is_exponential or self.n_coefficients > other.n_coefficients:
            return None
        if not other.nodes:
            both = self.degree is not None and other.degree is not None
            return np.pad(coefficients, padded) if both else None
        # Beyond its nodes a law goes on straight, as one of two coefficients does anyway.
        ends = (self.nodes[0], self.nodes[-1]) if self.nodes else (-np.inf, np.inf)
        low, high = zip(ends, (other.nodes[0], other.nodes[-1]), strict=True)
        covers = max(low) <= 0.0 or low[0] == low[1], min(high) >= largest * _ROUNDED or high[0] == high[1]
        logarithms = (log and self.takes_logarithms, log and other.takes_logarithms)
        if logarithms[0] != logarithms[1] or not (self.n_coefficients == 2 or all(covers)):
            return None
        if self.nodes:
            return self._through(coefficients, np.array(other.nodes), log=log)
        return np.asarray(coefficients @ np.vander(other.nodes, self.n_coefficients, increasing=True).T)

    def is_special_case_of(self, other: CurrentLaw) -> bool:
        """Whether this law is the other one with some coefficients at zero, or all of its values equal."""
        if self.degree is None:
            return False
        return self.degree == 0 if other.degree is None else self.degree < other.degree


def interpolate(
    nodes: tuple[float, ...], values: Array, command: Array, *, log: bool, xp: ModuleType = np
) -> Array:
    """Polynomial through values at the nodes, (n_nodes,), its tangent beyond; of the logarithms where `log`."""
    coefficients = _basis(nodes) @ (xp.log(values) if log else values)
    t = _place(nodes, command)
    inside = xp.clip(t, -1.0, 1.0)
    value, slope = 0.0 * inside, 0.0 * inside
    for power in reversed(range(len(nodes))):
        slope = slope * inside + value
        value = value * inside + coefficients[power]
    curve = value + slope * (t - inside)
    return xp.exp(curve) if log else curve


def _place(nodes: tuple[float, ...], command: Array) -> Array:
    """-1 at the first node, 1 at the last."""
    return (command - 0.5 * (nodes[0] + nodes[-1])) * (2.0 / (nodes[-1] - nodes[0]))


def _powers(nodes: tuple[float, ...], command: Floats) -> Floats:
    """Powers of the place of each command, shape (n_commands, n_nodes)."""
    return np.asarray(np.vander(_place(nodes, command), len(nodes), increasing=True))


@cache
def _basis(nodes: tuple[float, ...]) -> Floats:
    """Coefficients of the polynomial in the place of the command for a value of 1 at each node, one column each."""
    return np.asarray(np.linalg.inv(_powers(nodes, np.array(nodes))), dtype=np.float64)


_VALUES = "values"


def law_at(law: LawName, commands: Iterable[float]) -> LawName:
    """Name of a law by values at these commands, as in "values:0,0.5,1"; `law` is what precedes the colon."""
    return f"{law}:{','.join(f'{command:.12g}' for command in commands)}"


@cache
def law_named(name: LawName) -> CurrentLaw:
    """The law of a name, such as "quadratic", "quadratic:0,0.5,1" or "values:0,0.5,1"."""
    if name in current_laws():
        return current_laws()[name]
    law, _, commands = name.partition(":")
    try:
        nodes = tuple(float(text) for text in commands.split(","))
    except ValueError:
        nodes = ()
    rising = all(before < after for before, after in pairwise(nodes)) and bool(np.isfinite(nodes).all())
    polynomials = [
        each.n_coefficients for each in current_laws().values() if each.name == law and each.degree
    ]
    counts = range(2, _MOST_NODES + 1) if law == _VALUES else polynomials
    if not (rising and len(nodes) in counts):
        near = suggestion(law, [*current_laws(), _VALUES]) if law == name else ""
        raise UnknownChoiceError(
            f"no current law is called {name!r}{near}; a law by values takes rising commands: two to {_MOST_NODES}, as "
            "in values:0,0.5,1, or as many as a polynomial has coefficients, as in quadratic:0,0.5,1"
        )
    return CurrentLaw(
        name=law_at(law, nodes),
        n_coefficients=len(nodes),
        degree=None,
        nodes=nodes,
        takes_logarithms=law == _VALUES,
    )


def law_by_values(law: LawName, commands: Sequence[float]) -> LawName:
    """A polynomial as the law by as many values at commands of the tests; another law as it is."""
    return _at_nodes(law, _VALUES, commands)


def common_law(
    curves: Sequence[tuple[CurrentLaw, Floats, float]], parameter: ParamSpec
) -> tuple[LawName, list[Floats]] | None:
    """The law of fewest coefficients that writes every curve, and the coefficients of each; `None` if there is none.

    A curve has a law, coefficients on the last axis, and a largest command. Polynomials have the highest degree of all;
    laws by values the commands of one of them, or as many evenly spaced from 0 to the largest command.
    """
    tried = sorted({law.name: law for law, _, _ in curves}.values(), key=lambda law: law.n_coefficients)
    count = tried[-1].n_coefficients
    if any(law.nodes for law in tried):
        by_values = parameter.scale != "log" or any(law.takes_logarithms for law in tried)
        commands = np.linspace(0.0, max(largest for _, _, largest in curves), count)
        if by_values or count <= len(polynomial_laws()):
            tried.append(law_named(law_at(_VALUES if by_values else polynomial_laws()[count - 1], commands)))
    for other in tried:
        written = [law.rewrite(each, other, parameter, largest) for law, each, largest in curves]
        if all(each is not None for each in written):
            return other.name, [each for each in written if each is not None]
    return None


def law_through(law: LawName, commands: Sequence[float]) -> LawName:
    """A polynomial by its coefficients as the same one through values at tested commands; another law as it is."""
    return _at_nodes(law, law, commands)


def _at_nodes(law: LawName, by_values: LawName, commands: Sequence[float]) -> LawName:
    """The nodes are the commands, each taken once, that are nearest to evenly spaced ones."""
    degree = law_named(law).degree
    if not degree or len(commands) <= degree:
        return law
    levels = sorted(set(commands))
    nodes: list[float] = []
    for wanted in np.linspace(levels[0], levels[-1], degree + 1):
        left = [level for level in levels if level not in nodes]
        nodes.append(min(left, key=lambda level: abs(level - float(wanted))))
    return law_at(by_values, sorted(nodes))


def other_form(law: CurrentLaw, parameter: ParamSpec) -> LawName:
    """The law through the same values of a positive parameter, direct or in logarithms; empty where there is none."""
    if not law.nodes or parameter.scale != "log" or len(law.nodes) > len(polynomial_laws()):
        return ""
    return law_at(polynomial_laws()[len(law.nodes) - 1] if law.takes_logarithms else _VALUES, law.nodes)


@cache
def current_laws() -> Mapping[LawName, CurrentLaw]:
    """The current laws that have a name of their own; polynomials in order of their degree."""
    laws = (
        CurrentLaw(name=name, n_coefficients=count, degree=degree)
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
    if law.nodes:
        return [
            replace(
                parameter,
                name=f"{parameter.name}@{node:g}{unit}",
                coefficient=Coefficient(parameter=parameter.name, number=number, command=node),
                description=f"{parameter.description}; at {node:g} {unit}",
            )
            for number, node in enumerate(law.nodes)
        ]
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


def _equation(parameter: ParamSpec, law: CurrentLaw, unit: CommandUnit) -> str:
    name = parameter.name
    if law.nodes:
        what = f"ln {name}" if parameter.scale == "log" and law.takes_logarithms else name
        return f"{what} = polynomial in u through its values at {', '.join(f'{node:g}' for node in law.nodes)} {unit}"
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
