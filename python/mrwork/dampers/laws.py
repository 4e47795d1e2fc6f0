"""Laws of the command: how a parameter of a damper follows the command that reaches its coil."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from types import ModuleType
from typing import Any, ClassVar, Literal, get_args

import numpy as np

from mrwork.base.keys import check_known, suggestion
from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats
from mrwork.dampers.parameters import Coefficient, Lag, ParamSpec
from mrwork.errors import SettingError, UnknownChoiceError

# NumPy or JAX array; no annotation covers both without importing JAX.
Array = Any

LawName = str
"""Text of a law: "linear", "exponential", or by values: "quadratic:0,0.5,1", "log_linear:0,1", "straight:0,0.5,1"."""

CurveForm = Literal["log_polynomial", "polynomial", "straight", "straight_log"]
"""Curve: polynomial or straight lines; `log_polynomial` and `straight_log` go through the logarithms of values."""
CURVE_FORMS: tuple[CurveForm, ...] = get_args(CurveForm)
POLYNOMIAL_FORMS = CURVE_FORMS[:2]
_STRAIGHT = CURVE_FORMS[2:]
_LOGARITHMIC: tuple[CurveForm, ...] = ("log_polynomial", "straight_log")

_POLYNOMIALS = ("constant", "linear", "quadratic", "cubic")
_EXPONENTIAL = "exponential"
MOST_DEGREE = len(_POLYNOMIALS) - 1
"""Largest degree of a polynomial by its coefficients."""
# Most commands at which a law may have values; the compiled module refuses more.
_MOST_NODES = 8
# A value of a positive parameter is at least this share of the largest to which its law is fitted.
_LEAST_SHARE = 1e-3


@dataclass(frozen=True, slots=True)
class CommandLaw:
    """A law by which a parameter p follows the command u: a polynomial, an exponential, or a curve through values.

    A polynomial of a `degree` has its coefficients, p.0 + p.1 u + ...; degree 0 is constant. A law with `nodes` is a
    curve of this `form` through values at these commands, and goes on along its tangents beyond them. Straight lines
    have no extremum between values. Without a degree and nodes the law is p.0 + p.1 exp(p.2 u). A polynomial of the
    logarithm has no coefficients, and wants nodes before it has values.
    """

    degree: int | None = None
    nodes: tuple[float, ...] = ()
    form: CurveForm = "polynomial"

    def __str__(self) -> LawName:
        """Text of the law, from which `law_of` makes it again."""
        if self.is_exponential:
            return _EXPONENTIAL
        logarithm = "log_" if self.has_logarithms else ""
        name = self.form if self.form in _STRAIGHT else logarithm + _POLYNOMIALS[self.fitted_degree]
        return f"{name}:{','.join(f'{node:.12g}' for node in self.nodes)}" if self.nodes else name

    @property
    def n_coefficients(self) -> int:
        """Number of coefficients: one for each node, or those of the polynomial or the exponential."""
        return len(self.nodes) or (3 if self.degree is None else self.degree + 1)

    @property
    def is_constant(self) -> bool:
        """Whether the parameter does not follow the command."""
        return self.degree == 0

    @property
    def is_exponential(self) -> bool:
        """Whether the parameter is p.0 + p.1 exp(p.2 u)."""
        return self.degree is None and not self.nodes

    @property
    def has_logarithms(self) -> bool:
        """Whether the curve goes through the logarithms of a positive parameter."""
        return self.form in _LOGARITHMIC

    @property
    def fitted_degree(self) -> int:
        """Degree of the polynomial in the command that values determine: 1 for an exponential."""
        return 1 if self.is_exponential else self.n_coefficients - 1

    def values(self, coefficients: Array, command: Array, *, xp: ModuleType = np) -> Any:
        """The parameter at commands, perhaps beyond its range, of NumPy or, with `xp`, of JAX.

        The first axis of `coefficients` counts them; the others broadcast with `command`.
        """
        if self.nodes:
            curve = self._curve(xp.log(coefficients) if self.has_logarithms else coefficients, command, xp)
            return xp.exp(curve) if self.has_logarithms else curve
        if self.is_exponential:
            at_zero, factor, exponent = coefficients
            return at_zero + factor * xp.exp(exponent * command)
        value = coefficients[-1] + 0.0 * command
        for coefficient in coefficients[-2::-1]:
            value = coefficient + value * command
        return value

    def slopes(self, coefficients: Floats, commands: Floats) -> Floats:
        """Derivatives of the values by each coefficient, (n_coefficients, n_commands, n_rows), of rows of them.

        `coefficients` have shape (n_coefficients, n_rows), `commands` (n_commands,).
        """
        at = commands[:, None]
        if self.nodes:
            by_node = self._curve(np.eye(len(self.nodes)), at).T[..., None]
            if self.has_logarithms:
                by_node = by_node * self.values(coefficients, at) / coefficients[:, None]
        elif self.is_exponential:
            _, factor, exponent = coefficients
            rise = np.exp(exponent * at)
            by_node = np.stack([np.ones_like(rise), rise, factor * at * rise])
        else:
            by_node = np.power(commands, np.arange(self.n_coefficients)[:, None])[..., None]
        return np.broadcast_to(by_node, (len(coefficients), len(commands), coefficients.shape[1]))

    def through(self, parameter: ParamSpec, commands: Floats, column: Floats) -> list[float]:
        """Coefficients by least squares from the values `column` of a parameter at commands, (n_commands,)."""
        if self.is_constant:
            return [float(np.median(column))]
        if self.nodes:
            return self._values_at_nodes(parameter, commands, column)
        full = self.fitted_degree
        degree = min(full, len(commands) - 1)
        fitted = np.polyfit(commands, column, degree)[::-1]
        polynomial = [*map(float, fitted), *[0.0] * (full - degree)]
        if self.is_exponential:
            # a + b exp(-u) with the values of the straight line at the lowest and highest command.
            lowest, highest = commands.min(), commands.max()
            rise = polynomial[1] * (highest - lowest) / (np.exp(-highest) - np.exp(-lowest) or 1.0)
            polynomial = [polynomial[0] + polynomial[1] * lowest - rise * np.exp(-lowest), rise, -1.0]
        return polynomial

    def _values_at_nodes(self, parameter: ParamSpec, commands: Floats, column: Floats) -> list[float]:
        """Values at the nodes of the curve that is nearest to the values at the commands, logarithms to logarithms."""
        ordinates = np.log(np.maximum(column, parameter.lower)) if self.has_logarithms else column
        degree = min(len(self.nodes), len(commands)) - 1
        values = np.polyval(np.polyfit(commands, ordinates, degree), self.nodes)
        if not parameter.is_positive:
            return [float(value) for value in values]
        least = max(parameter.lower, _LEAST_SHARE * float(np.max(column)))
        return [max(float(value), least) for value in (np.exp(values) if self.has_logarithms else values)]

    def coefficients_of(self, parameter: ParamSpec, unit: CommandUnit | None) -> list[ParamSpec]:
        """The coefficients as parameters of a model, for a command in `unit`; the nominal ones make it constant."""
        if self.is_constant:
            return [parameter]
        if self.has_logarithms and not self.nodes:
            nodes, wanted = ",".join(map(str, range(self.n_coefficients))), f"{parameter.name}={self}"
            raise SettingError(
                f"{wanted} goes through values at {self.n_coefficients} commands; give them, as in {wanted}:{nodes}"
            )
        assert unit is not None  # what follows a command has its unit
        if self.nodes:
            return [
                replace(
                    parameter,
                    name=f"{parameter.name}@{node:g}{unit}",
                    coefficient=Coefficient(parameter=parameter.name, number=number, command=node),
                    description=f"{parameter.description}; at {node:g} {unit}",
                )
                for number, node in enumerate(self.nodes)
            ]
        widest = max(abs(parameter.lower), abs(parameter.upper))
        entries = []
        for power in range(self.n_coefficients):
            exponent = self.is_exponential and power == 2
            bound = 20.0 if exponent else widest
            # An exponential law has two coefficients in the unit of the parameter, and the exponent in 1/unit.
            order = int(exponent) if self.is_exponential else power
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
                    description=f"{parameter.description}; coefficient {power} of its {self} law",
                )
            )
        return entries

    def equation(self, parameter: ParamSpec, unit: CommandUnit | None) -> str:
        """Equation of the parameter in the command u, in one line of text."""
        name = parameter.name
        if self.nodes:
            what = f"ln {name}" if self.has_logarithms else name
            at = ", ".join(f"{node:g}" for node in self.nodes)
            curve = "straight lines" if self.form in _STRAIGHT else "polynomial"
            return f"{what} = {curve} in u through its values at {at} {unit}"
        if self.is_exponential:
            return f"{name} = {name}.0 + {name}.1 exp({name}.2 u)"
        powers = ["", " u", " u^2", " u^3"][: self.n_coefficients]
        return f"{name} = " + " + ".join(f"{name}.{power}{factor}" for power, factor in enumerate(powers))

    def at_commands(self, commands: Sequence[float]) -> CommandLaw:
        """A polynomial without nodes as the one through as many values at tested commands; another law as it is.

        The nodes are the commands, each taken once, that are nearest to evenly spaced ones.
        """
        if not self.degree or len(commands) <= self.degree:
            return self
        levels = sorted(set(commands))
        nodes: list[float] = []
        for wanted in np.linspace(levels[0], levels[-1], self.degree + 1):
            left = [level for level in levels if level not in nodes]
            nodes.append(min(left, key=lambda level: abs(level - float(wanted))))
        return law_through(sorted(nodes), self.form)

    def other_forms(self, parameter: ParamSpec) -> list[CommandLaw]:
        """The laws of a parameter through the same values in other forms, straight lines last, none without nodes."""
        # The force mostly follows a command that saturates, its shape and rates over decades.
        lines = _STRAIGHT if parameter.scales_with_force else _STRAIGHT[::-1]
        curves = POLYNOMIAL_FORMS if self.fitted_degree <= MOST_DEGREE else ()
        forms = (*curves, *lines) if parameter.is_positive else _STRAIGHT[:1]
        laws = dict.fromkeys(law_through(self.nodes, form) for form in forms if self.nodes)
        return [law for law in laws if law != self]

    def _curve(self, values: Array, command: Array, xp: ModuleType = np) -> Array:
        return (_straight_lines if self.form in _STRAIGHT else _polynomial)(self.nodes, values, command, xp)

    def rescale_command(self, coefficients: Floats, factor: float) -> Floats:
        """Coefficients, on the last axis, of the parameter as a function of the command over `factor`: p(factor u).

        Straight lines keep their nodes, and agree there.
        """
        if self.nodes:
            scaled = factor * np.array(self.nodes)
            if self.form in _STRAIGHT:
                there = self._curve(np.eye(len(self.nodes))[..., None], scaled)
            else:
                there = (_powers(self.nodes, scaled) @ _basis(self.nodes)).T
            node_values = np.log(coefficients) if self.has_logarithms else coefficients
            return np.asarray(np.exp(node_values @ there) if self.has_logarithms else node_values @ there)
        powers = np.arange(coefficients.shape[-1], dtype=np.float64)
        scale = np.array([1.0, 1.0, factor]) if self.is_exponential else np.power(factor, powers)
        return np.asarray(coefficients * scale)

    def is_special_case_of(self, other: CommandLaw) -> bool:
        """Whether this law is the other one with some coefficients at zero, or all of its values equal."""
        if self.degree is None:
            return False
        return self.is_constant if other.degree is None else self.degree < other.degree


CONSTANT = CommandLaw(0)
"""The law of a parameter that does not follow the command."""
EXPONENTIAL = CommandLaw()
"""p.0 + p.1 exp(p.2 u)."""
LOGARITHMIC_LAWS = tuple(CommandLaw(degree, form="log_polynomial") for degree in range(1, MOST_DEGREE + 1))
"""Polynomials of the logarithm, in order of their degree."""


def law_through(commands: Iterable[float], form: CurveForm) -> CommandLaw:
    """The law through values at commands, given to twelve digits."""
    return CommandLaw(nodes=tuple(float(f"{command:.12g}") for command in commands), form=form)


@cache
def law_of(text: LawName | CommandLaw) -> CommandLaw:
    """The law of a text, as "quadratic", "log_quadratic:0,0.5,1" or "straight:0,0.5,1"; a law is returned as it is.

    Raises
    ------
    UnknownChoiceError
        If there is no such law, or its commands are not as many rising numbers as it takes.
    """
    if isinstance(text, CommandLaw):
        return text
    named = {str(law): law for law in (*named_laws(), *LOGARITHMIC_LAWS)}
    if text in named:
        return named[text]
    name, _, commands = text.partition(":")
    try:
        nodes = tuple(float(command) for command in commands.split(","))
    except ValueError:
        nodes = ()
    rising = all(before < after for before, after in pairwise(nodes)) and bool(np.isfinite(nodes).all())
    curves = {str(law): (law.form, [law.n_coefficients]) for law in named.values() if law.degree}
    curves |= {form: (form, [*range(2, _MOST_NODES + 1)]) for form in _STRAIGHT}
    form, counts = curves.get(name, (None, []))
    if form is None or len(nodes) not in counts or not rising:
        near = suggestion(name, [*named, *_STRAIGHT]) if name == text else ""
        raise UnknownChoiceError(
            f"no current law is called {text!r}{near}; a law by values takes rising commands: as many as a polynomial "
            "has coefficients, as in quadratic:0,0.5,1 or log_quadratic:0,0.5,1 (through the logarithms), or two to "
            f"{_MOST_NODES}, as in straight:0,0.5,1 or straight_log:0,0.5,1"
        )
    return law_through(nodes, form)


def named_laws() -> tuple[CommandLaw, ...]:
    """The laws that have a name of their own: polynomials in order of their degree, and the exponential."""
    return (*map(CommandLaw, range(len(_POLYNOMIALS))), EXPONENTIAL)


def laws_in_order(
    plain: tuple[ParamSpec, ...], laws: Mapping[str, LawName | CommandLaw], model: str
) -> tuple[CommandLaw, ...]:
    """Return one law per parameter of the plain model; those not named are constant."""
    names = [parameter.name for parameter in plain]
    for name in laws:
        check_known(
            name, names, f"{model} has no parameter {name!r} to follow the command", otherwise="it has"
        )
    found = tuple(law_of(laws.get(name, CONSTANT)) for name in names)
    for name, parameter, law in zip(names, plain, found, strict=True):
        if law.has_logarithms and not parameter.is_positive:
            other = replace(law, form="straight" if law.form in _STRAIGHT else "polynomial")
            raise SettingError(
                f"{name}={law} takes logarithms, and {name} may be negative; give {name}={other}"
            )
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class CurrentLaws:
    """Laws of a model as files have them: text of the law of each plain parameter, unit of the command, and the lag.

    `lagged` says whether the driver has a lag, `two_rates` whether that has one rate for a rising current and another
    for a falling one.

    `DamperSpec.with_current_laws` takes these laws.
    """

    _made_by: ClassVar[str] = "fit.current"

    unit: CommandUnit
    laws: tuple[LawName, ...]
    lagged: bool
    two_rates: bool = False

    @property
    def lag(self) -> Lag:
        """The lag of the driver."""
        if not self.lagged:
            return "none"
        return "two_rates" if self.two_rates else "one_rate"


def _polynomial(nodes: tuple[float, ...], values: Array, command: Array, xp: ModuleType) -> Array:
    """Polynomial through values at the nodes, (n_nodes, ...), its tangent beyond."""
    coefficients = _basis(nodes) @ values
    t = _between(nodes, command)
    inside = xp.clip(t, -1.0, 1.0)
    value, slope = 0.0 * inside, 0.0 * inside
    for power in reversed(range(len(nodes))):
        slope = slope * inside + value
        value = value * inside + coefficients[power]
    return value + slope * (t - inside)


def _straight_lines(nodes: tuple[float, ...], values: Array, command: Array, xp: ModuleType) -> Array:
    """Straight lines through values at the nodes, (n_nodes, ...), of which the outer ones go on."""
    widths = np.diff(nodes).reshape(-1, *(1,) * (values.ndim - 1))
    first, *others = slopes = (values[1:] - values[:-1]) / widths
    curve = values[0] + first * (command - nodes[0])
    for before, after, node in zip(slopes, others, nodes[1:], strict=False):
        curve = curve + (after - before) * xp.maximum(command - node, 0.0)
    return curve


def _between(nodes: tuple[float, ...], command: Array) -> Array:
    """-1 at the first node, 1 at the last."""
    return (command - 0.5 * (nodes[0] + nodes[-1])) * (2.0 / (nodes[-1] - nodes[0]))


def _powers(nodes: tuple[float, ...], command: Floats) -> Floats:
    """Powers of each command between the outer nodes, shape (n_commands, n_nodes)."""
    return np.asarray(np.vander(_between(nodes, command), len(nodes), increasing=True))


@cache
def _basis(nodes: tuple[float, ...]) -> Floats:
    """Coefficients of the polynomials that are 1 at one node and 0 at the others, a column for each node."""
    return np.asarray(np.linalg.inv(_powers(nodes, np.array(nodes))), dtype=np.float64)


def _per(unit: str, command: CommandUnit, power: int) -> str:
    """`unit` divided by a power of the unit of the command, in the notation of this package: N/(m A), 1/A."""
    if power == 0:
        return unit
    divisor = command if power == 1 else f"{command}^{power}"
    if unit in ("", "1"):
        return f"1/{divisor}"
    numerator, slash, denominator = unit.partition("/")
    return f"{numerator}/({denominator} {divisor})" if slash else f"{numerator}/{divisor}"
