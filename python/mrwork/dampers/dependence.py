"""Laws of the command: how a parameter of a damper follows the command that reaches its coil."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
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
"""Text of a law: "linear", "exponential", or by values: "quadratic:0,0.5,1", "monotone:0,0.5,1,1.5", "tanh:0,1"."""

CurveForm = Literal[
    "polynomial", "monotone", "log_polynomial", "straight", "straight_log", "exponential", "tanh"
]
"""Curve through values: a polynomial, monotone cubics or straight lines, of which `log_polynomial` and `straight_log`
go through the logarithms; `exponential` and `tanh` saturate."""
SATURATING_FORMS: tuple[CurveForm, ...] = get_args(CurveForm)[5:]
"""Forms of two values and a rate."""
CURVE_FORMS: tuple[CurveForm, ...] = get_args(CurveForm)[:5]
"""Forms through any values, in the order in which they are taken where no test tells them apart."""
POLYNOMIAL_FORMS: tuple[CurveForm, ...] = ("polynomial", "log_polynomial")
_STRAIGHT: tuple[CurveForm, ...] = ("straight", "straight_log")
_LOGARITHMIC: tuple[CurveForm, ...] = ("log_polynomial", "straight_log")

_POLYNOMIALS = ("constant", "linear", "quadratic", "cubic")
MOST_DEGREE = len(_POLYNOMIALS) - 1
"""Largest degree of a polynomial by its coefficients."""
# Most commands at which a law may have values; the compiled module refuses more.
_MOST_NODES = 8
# A value of a positive parameter is at least this share of the largest to which its law is fitted.
_LEAST_SHARE = 1e-3
# Rate of a law that saturates, times the span of its commands: at the least an exponential is within .7 % of the rise
# of the straight line, and at the most it has saturated within a fifth of the span.
_LEAST_RISE, _MOST_RISE = 0.05, 20.0
# Rates among which the nearest curve is sought, round by round between the neighbours of the best.
_N_RATES, _ROUNDS = 25, 6
# Share of the values by which a curve may be farther from them than the nearest one, and count as equally near.
_EQUALLY_NEAR = 1e-10
# Imaginary part of a coefficient along which a law is differentiated: its square vanishes beside any value.
_IMAGINARY_STEP = 2.0**-200
# Denominators of a law that saturates are at least this: far below its commands they round to zero.
_LEAST_DENOMINATOR = 1e-300


@dataclass(frozen=True, slots=True)
class Dependence:
    """A law by which a parameter p follows the command u: a polynomial, an exponential, or a curve through values.

    A polynomial of a `degree` has its coefficients, p.0 + p.1 u + ...; degree 0 is constant. A law with `nodes` is a
    curve of this `form` through values at these commands, and goes on along its tangents beyond them. Straight lines
    and monotone cubics have no extremum between values. A saturating curve has a rate beside its two values, and goes
    on by its equation. An exponential without nodes is p.0 + p.1 exp(p.2 u); other forms have no coefficients, and want
    nodes before they have values.
    """

    degree: int | None = None
    nodes: tuple[float, ...] = ()
    form: CurveForm = "polynomial"

    def __str__(self) -> LawName:
        """Text of the law, from which `dependence_of` makes it again."""
        name: str = self.form
        if name in POLYNOMIAL_FORMS:
            name = ("log_" if self.has_logarithms else "") + _POLYNOMIALS[self.fitted_degree]
        return f"{name}:{','.join(f'{node:.12g}' for node in self.nodes)}" if self.nodes else name

    @property
    def n_coefficients(self) -> int:
        """Number of coefficients: one for each node and a rate, or those of the polynomial or the exponential."""
        return len(self.nodes) + self.saturates or (3 if self.degree is None else self.degree + 1)

    @property
    def is_constant(self) -> bool:
        """Whether the parameter does not follow the command."""
        return self.degree == 0

    @property
    def is_exponential(self) -> bool:
        """Whether the parameter is p.0 + p.1 exp(p.2 u)."""
        return self.form == "exponential" and not self.nodes

    @property
    def saturates(self) -> bool:
        """Whether the parameter has values at two commands and a rate."""
        return self.form in SATURATING_FORMS and bool(self.nodes)

    @property
    def wants_nodes(self) -> bool:
        """Whether the law has no coefficients before its nodes are given."""
        return not self.nodes and self.form not in ("polynomial", "exponential")

    @property
    def has_logarithms(self) -> bool:
        """Whether the curve goes through the logarithms of a positive parameter."""
        return self.form in _LOGARITHMIC

    @property
    def is_straight(self) -> bool:
        """Whether straight lines go through the values, or their logarithms."""
        return self.form in _STRAIGHT

    @property
    def fitted_degree(self) -> int:
        """Degree of the polynomial in the command that values determine: 1 for an exponential."""
        return 1 if self.is_exponential else self.n_coefficients - 1

    def is_determined_at(self, commands: Floats) -> bool:
        """Whether values at these commands, (n_commands,), determine every coefficient."""
        n = self.n_coefficients
        if n > len(commands):
            return False
        # Coefficients of no special case: rising, so that a rate has an effect.
        slopes = self.slopes(np.linspace(1.0, 2.0, n)[:, None], np.asarray(commands, dtype=np.float64))
        return bool(np.linalg.matrix_rank(slopes[..., 0]) == n)

    def values(self, coefficients: Array, command: Array, *, xp: ModuleType = np) -> Any:
        """The parameter at commands, perhaps beyond its range, of NumPy or, with `xp`, of JAX.

        The first axis of `coefficients` counts them; the others broadcast with `command`.
        """
        if self.saturates:
            return self._saturating(coefficients, command, xp)
        if self.nodes:
            through = _CURVES[self.form]
            node_values = xp.log(coefficients) if self.has_logarithms else coefficients
            curve = through(self.nodes, node_values, command, xp)
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
        # A step along the imaginary axis has no difference to cancel: the derivatives are exact to rounding.
        steps = 1j * _IMAGINARY_STEP * np.eye(len(coefficients))[..., None]
        return np.stack(
            [self.values(coefficients + step, commands[:, None]).imag / _IMAGINARY_STEP for step in steps]
        )

    def through(self, parameter: ParamSpec, commands: Floats, column: Floats) -> list[float]:
        """Coefficients by least squares from the values `column` of a parameter at commands, (n_commands,)."""
        if self.is_constant:
            return [float(np.median(column))]
        if self.saturates:
            return self._nearest_saturating(parameter, commands, column)
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
        values = np.asarray(np.polyval(np.polyfit(commands, ordinates, degree), self.nodes), dtype=np.float64)
        return _kept_positive(parameter, np.exp(values) if self.has_logarithms else values, column)

    def _nearest_saturating(self, parameter: ParamSpec, commands: Floats, column: Floats) -> list[float]:
        """Values and rate of the curve that is nearest to values at commands; of equal ones the rate of 1/span."""
        lowest, highest = _LEAST_RISE, _MOST_RISE
        mean, span = float(np.mean(column)), self.nodes[1] - self.nodes[0]
        for _ in range(_ROUNDS):
            rises = np.geomspace(lowest, highest, _N_RATES)
            share = self.values((0.0, 1.0, rises[:, None] / span), commands)
            basis = np.stack([1.0 - share, share], axis=-1)
            ends = np.asarray(mean + np.linalg.pinv(basis) @ (column - mean), dtype=np.float64)
            off = np.linalg.norm((basis @ ends[..., None])[..., 0] - column, axis=-1)
            near = off <= off.min() + _EQUALLY_NEAR * np.linalg.norm(column)
            best = int(np.argmin(np.where(near, np.abs(np.log(rises)), np.inf)))
            lowest, highest = rises[max(best - 1, 0)], rises[min(best + 1, _N_RATES - 1)]
        return [*_kept_positive(parameter, ends[best], column), float(rises[best] / span)]

    def coefficients_of(self, parameter: ParamSpec, unit: CommandUnit | None) -> list[ParamSpec]:
        """The coefficients as parameters of a model, for a command in `unit`; the nominal ones make it constant."""
        if self.is_constant:
            return [parameter]
        if self.wants_nodes:
            count = 2 if self.form in SATURATING_FORMS else self.n_coefficients
            counts = f"2 to {_MOST_NODES}" if self.form == "monotone" else count
            nodes, wanted = ",".join(map(str, range(count))), f"{parameter.name}={self}"
            raise SettingError(
                f"{wanted} goes through values at {counts} commands; give them, as in {wanted}:{nodes}"
            )
        assert unit is not None  # what follows a command has its unit
        if self.nodes:
            values = [
                replace(
                    parameter,
                    name=f"{parameter.name}@{node:g}{unit}",
                    coefficient=Coefficient(parameter=parameter.name, number=number, command=node),
                    description=f"{parameter.description}; at {node:g} {unit}",
                )
                for number, node in enumerate(self.nodes)
            ]
            return [*values, self._rate_of(parameter, unit)] if self.saturates else values
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
                    coefficient=Coefficient(parameter=parameter.name, number=power, is_rate=exponent),
                    nominal=parameter.nominal if power == 0 else -1.0 if exponent else 0.0,
                    description=f"{parameter.description}; coefficient {power} of its {self} law",
                )
            )
        return entries

    def _rate_of(self, parameter: ParamSpec, unit: CommandUnit) -> ParamSpec:
        """The rate at which the curve saturates, as a parameter of a model."""
        span = self.nodes[1] - self.nodes[0]
        return ParamSpec(
            name=f"{parameter.name}.rate",
            unit=_per("", unit, 1),
            scale="log",
            lower=_LEAST_RISE / span,
            upper=_MOST_RISE / span,
            nominal=1.0 / span,
            coefficient=Coefficient(parameter=parameter.name, number=2, is_rate=True),
            description=f"{parameter.description}; rate at which its {self.form} law saturates",
        )

    def equation(self, parameter: ParamSpec, unit: CommandUnit | None) -> str:
        """Equation of the parameter in the command u, in one line of text."""
        name = parameter.name
        if self.nodes:
            what = f"ln {name}" if self.has_logarithms else name
            at = ", ".join(f"{node:g}" for node in self.nodes)
            rate = f" with the rate {name}.rate" if self.saturates else ""
            return f"{what} = {_CURVE_WORDS[self.form]} in u through its values at {at} {unit}{rate}"
        if self.is_exponential:
            return f"{name} = {name}.0 + {name}.1 exp({name}.2 u)"
        powers = ["", " u", " u^2", " u^3"][: self.n_coefficients]
        return f"{name} = " + " + ".join(f"{name}.{power}{factor}" for power, factor in enumerate(powers))

    def at_commands(self, commands: Sequence[float]) -> Dependence:
        """A law without nodes as the one through as many values at tested commands; another law as it is.

        The nodes are the commands, each taken once, that are nearest to evenly spaced ones: as many as the polynomial
        has coefficients, two of a saturating curve, all of monotone cubics.
        """
        levels = sorted(set(commands))
        if not (self.degree or self.wants_nodes):
            return self
        if self.degree:
            count = self.degree + 1
        else:
            count = 2 if self.form in SATURATING_FORMS else max(2, min(len(levels), _MOST_NODES))
        if len(levels) < count:
            return self
        nodes: list[float] = []
        for wanted in np.linspace(levels[0], levels[-1], count):
            left = [level for level in levels if level not in nodes]
            nodes.append(min(left, key=lambda level: abs(level - float(wanted))))
        return dependence_through(sorted(nodes), self.form)

    def other_forms(self, parameter: ParamSpec) -> list[Dependence]:
        """The laws of a parameter through the same values in other forms, straight lines last.

        None without nodes, and none of a saturating curve, whose rate no value at a command tells.
        """
        if not self.nodes or self.saturates:
            return []
        # The force mostly follows a command that saturates, its shape and rates over decades.
        lines = _STRAIGHT if parameter.scales_with_force else _STRAIGHT[::-1]
        forms = [
            form
            for form in (*(form for form in CURVE_FORMS if form not in _STRAIGHT), *lines)
            if (parameter.is_positive or form not in _LOGARITHMIC)
            and (form not in POLYNOMIAL_FORMS or self.fitted_degree <= MOST_DEGREE)
            # Through two values they are the straight line.
            and (form != "monotone" or len(self.nodes) > 2)
        ]
        return [dependence_through(self.nodes, form) for form in forms if form != self.form]

    def _saturating(self, coefficients: Array, command: Array, xp: ModuleType) -> Array:
        """p0 + (p1 - p0) w(u)/w(u1) with w = t/(1 + s t), in which no nearly equal numbers are subtracted.

        Of a hyperbolic tangent t = tanh(c (u - u0)) and s = tanh(c u0); of an exponential tanh(c (u - u0)/2) and 1.
        """
        first, last, rate = coefficients
        is_tanh, (start, end) = self.form == "tanh", self.nodes
        rate = rate if is_tanh else 0.5 * rate
        share = xp.tanh(rate * start) if is_tanh else 1.0
        whole, part = xp.tanh(rate * (end - start)), xp.tanh(rate * (command - start))
        way = part / xp.maximum(1.0 + share * part, _LEAST_DENOMINATOR)
        return first + (last - first) * (1.0 + share * whole) / whole * way

    def rescale_command(self, coefficients: Floats, factor: float) -> Floats:
        """Coefficients, on the last axis, of the parameter as a function of the command over `factor`: p(factor u).

        Straight lines and monotone cubics keep their nodes, and agree there.
        """
        scaled = factor * np.array(self.nodes)
        if self.nodes and self.form in POLYNOMIAL_FORMS:
            there = (_powers(self.nodes, scaled) @ _basis(self.nodes)).T
            node_values = np.log(coefficients) if self.has_logarithms else coefficients
            return np.asarray(np.exp(node_values @ there) if self.has_logarithms else node_values @ there)
        if self.nodes:
            values = self.values(np.moveaxis(coefficients, -1, 0)[..., None], scaled)
            rate = factor * coefficients[..., len(self.nodes) :]
            return np.concatenate([values, rate], axis=-1)
        powers = np.arange(coefficients.shape[-1], dtype=np.float64)
        scale = np.array([1.0, 1.0, factor]) if self.is_exponential else np.power(factor, powers)
        return np.asarray(coefficients * scale)

    def is_special_case_of(self, other: Dependence) -> bool:
        """Whether this law is the other one with some coefficients at zero, or all of its values equal."""
        if self.degree is None:
            return False
        return self.is_constant if other.degree is None else self.degree < other.degree


CONSTANT = Dependence(0)
"""The law of a parameter that does not follow the command."""
EXPONENTIAL = Dependence(form="exponential")
"""p.0 + p.1 exp(p.2 u)."""
LAWS_AT_COMMANDS = (
    *(Dependence(degree, form="log_polynomial") for degree in range(1, MOST_DEGREE + 1)),
    Dependence(form="monotone"),
    Dependence(form="tanh"),
)
"""Laws that have coefficients at tested commands only."""


def dependence_through(commands: Iterable[float], form: CurveForm) -> Dependence:
    """The law through values at commands, given to twelve digits."""
    return Dependence(nodes=tuple(float(f"{command:.12g}") for command in commands), form=form)


@cache
def dependence_of(text: LawName | Dependence) -> Dependence:
    """The law of a text, as "quadratic", "log_quadratic:0,0.5,1" or "tanh:0,1"; a law is returned as it is.

    Raises
    ------
    UnknownChoiceError
        If there is no such law, or its commands are not as many rising numbers as it takes.
    """
    if isinstance(text, Dependence):
        return text
    named = {str(law): law for law in (*named_dependences(), *LAWS_AT_COMMANDS)}
    if text in named:
        return named[text]
    name, _, commands = text.partition(":")
    try:
        nodes = tuple(float(command) for command in commands.split(","))
    except ValueError:
        nodes = ()
    rising = all(before < after for before, after in pairwise(nodes)) and bool(np.isfinite(nodes).all())
    curves = {str(law): (law.form, [law.n_coefficients]) for law in named.values() if law.degree}
    curves |= {form: (form, [*range(2, _MOST_NODES + 1)]) for form in ("monotone", *_STRAIGHT)}
    curves |= {form: (form, [2]) for form in SATURATING_FORMS}
    form, counts = curves.get(name, (None, []))
    if form is None or len(nodes) not in counts or not rising:
        near = suggestion(name, [*named, *_STRAIGHT]) if name == text else ""
        raise UnknownChoiceError(
            f"no current law is called {text!r}{near}; a law by values takes rising commands: as many as a polynomial "
            "has coefficients, as in quadratic:0,0.5,1 or log_quadratic:0,0.5,1 (through the logarithms), two to "
            f"{_MOST_NODES}, as in monotone:0,0.5,1, straight:0,0.5,1 or straight_log:0,0.5,1, or two where it "
            "saturates, as in exponential:0,1 or tanh:0,1"
        )
    return dependence_through(nodes, form)


def named_dependences() -> tuple[Dependence, ...]:
    """The laws that have a name of their own: polynomials in order of their degree, and the exponential."""
    return (*map(Dependence, range(len(_POLYNOMIALS))), EXPONENTIAL)


def dependences_in_order(
    plain: tuple[ParamSpec, ...], laws: Mapping[str, LawName | Dependence], model: str
) -> tuple[Dependence, ...]:
    """Return one law per parameter of the plain model; those not named are constant."""
    names = [parameter.name for parameter in plain]
    for name in laws:
        check_known(
            name, names, f"{model} has no parameter {name!r} to follow the command", otherwise="it has"
        )
    found = tuple(dependence_of(laws.get(name, CONSTANT)) for name in names)
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


def _monotone(nodes: tuple[float, ...], values: Array, command: Array, xp: ModuleType) -> Array:
    """Cubics through values at the nodes, (n_nodes, ...), that are monotone where the values are; tangents beyond.

    The slopes at the nodes are those of Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5, 1984, 300.
    """
    widths = np.diff(nodes)
    secants = [
        (after - before) / width for before, after, width in zip(values, values[1:], widths, strict=False)
    ]
    slopes = _slopes_at_nodes(widths, secants, xp)
    start, value, slope = nodes[0], values[0], slopes[0]
    second, third = 0.0 * value, 0.0 * value
    for piece, node in enumerate(nodes):
        passed = command >= node
        start = xp.where(passed, node, start)
        value = xp.where(passed, values[piece], value)
        slope = xp.where(passed, slopes[piece], slope)
        # Beyond the last node there is no cubic.
        higher = (0.0, 0.0)
        if piece < len(widths):
            width, secant = widths[piece], secants[piece]
            above, ahead = slopes[piece] - secant, slopes[piece + 1] - secant
            higher = (-(2.0 * above + ahead) / width, (above + ahead) / width**2)
        second, third = xp.where(passed, higher[0], second), xp.where(passed, higher[1], third)
    along = command - start
    return value + along * (slope + along * (second + along * third))


def _slopes_at_nodes(widths: Floats, secants: Sequence[Array], xp: ModuleType) -> list[Array]:
    """Harmonic means of the slopes to either side, zero at an extremum; at the ends those of the parabola, limited."""
    if len(widths) == 1:
        return [secants[0], secants[0]]
    slopes = []
    for (before, after), (width_before, width_after) in zip(pairwise(secants), pairwise(widths), strict=True):
        share_before, share_after = 2.0 * width_after + width_before, width_after + 2.0 * width_before
        product, both = before * after, share_before * after + share_after * before
        rises = xp.real(product) > 0.0
        # The derivative of a quotient that is not taken must be a number, too.
        mean = product * (share_before + share_after) / xp.where(rises, both, 1.0)
        slopes.append(xp.where(rises, mean, 0.0))
    ends = []
    for near, far in ((0, 1), (-1, -2)):
        share = widths[near] / (widths[near] + widths[far])
        parabola = (1.0 + share) * secants[near] - share * secants[far]
        rising = xp.where(xp.real(parabola * secants[near]) > 0.0, parabola, 0.0)
        steep = abs(xp.real(rising)) > 3.0 * abs(xp.real(secants[near]))
        ends.append(xp.where(steep, 3.0 * secants[near], rising))
    return [ends[0], *slopes, ends[1]]


def _kept_positive(parameter: ParamSpec, values: Floats, column: Floats) -> list[float]:
    """Values of a law fitted to those of `column`; of a positive parameter with the least that it may have."""
    if not parameter.is_positive:
        return [float(value) for value in values]
    least = max(parameter.lower, _LEAST_SHARE * float(np.max(column)))
    return [max(float(value), least) for value in values]


_CURVES: dict[CurveForm, Callable[[tuple[float, ...], Array, Array, ModuleType], Array]] = {
    "polynomial": _polynomial,
    "log_polynomial": _polynomial,
    "monotone": _monotone,
    "straight": _straight_lines,
    "straight_log": _straight_lines,
}
_CURVE_WORDS: dict[CurveForm, str] = {
    "polynomial": "polynomial",
    "log_polynomial": "polynomial",
    "monotone": "monotone cubics",
    "straight": "straight lines",
    "straight_log": "straight lines",
    "exponential": "saturating exponential",
    "tanh": "tanh",
}


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
