"""Coefficients of current laws: fitted to values of the plain model at several commands, and their ranges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.dampers.parameters import CurrentLaw, LawName, ParamSpec, law_named
from mrwork.dampers.spec import DamperSpec, damper, law_limits
from mrwork.identification.equivalent import Form, search_box
from mrwork.records import DamperTest

# Largest exponent of a law [1/A or 1/V], either sign.
_EXPONENT = 5.0
# Coefficients may reach this multiple of the range that is searched.
_MARGIN = 10.0
# A value of a positive parameter is at least this share of the largest to which its law is fitted.
_LEAST_SHARE = 1e-3


def fitted_laws(
    spec: DamperSpec, commands: NDArray[np.float64], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Coefficients of the laws, shape (n_params,), by least squares from `values`, shape (n_levels, n_plain)."""
    if spec.current is None:
        return np.asarray(values[0])
    theta: list[float] = []
    for parameter, law, column in zip(spec.plain, spec.current.laws, values.T, strict=True):
        theta += fitted_law(law, parameter, commands, column)
    if spec.current.lagged:
        theta.append(spec.parameters[-1].nominal)
    box = Box.of(spec)
    return np.clip(theta, box.lower, box.upper)


def fitted_law(
    law: LawName, parameter: ParamSpec, commands: NDArray[np.float64], column: NDArray[np.float64]
) -> list[float]:
    """Coefficients of the law of a parameter by least squares from its values at these commands."""
    kind = law_named(law)
    if kind.degree == 0:
        return [float(np.median(column))]
    if kind.nodes:
        return _values_at_nodes(kind, parameter, commands, column)
    full = _fitted_degree(law)
    degree = min(full, len(commands) - 1)
    polynomial = [float(each) for each in np.polyfit(commands, column, degree)[::-1]] + [0.0] * (
        full - degree
    )
    if kind.is_exponential:
        # a + b exp(-u) with the values of the straight line at the lowest and highest command.
        lowest, highest = commands.min(), commands.max()
        rise = polynomial[1] * (highest - lowest) / (np.exp(-highest) - np.exp(-lowest) or 1.0)
        polynomial = [polynomial[0] + polynomial[1] * lowest - rise * np.exp(-lowest), rise, -1.0]
    return polynomial


def _values_at_nodes(
    law: CurrentLaw, parameter: ParamSpec, commands: NDArray[np.float64], column: NDArray[np.float64]
) -> list[float]:
    """Values at the nodes of the curve that is nearest to the values at the commands, logarithms to logarithms."""
    log = parameter.scale == "log" and law.takes_logarithms
    given = np.log(np.maximum(column, parameter.lower)) if log else column
    degree = min(len(law.nodes), len(commands)) - 1
    values = np.polyval(np.polyfit(commands, given, degree), law.nodes)
    if parameter.scale != "log":
        return [float(value) for value in values]
    least = max(parameter.lower, _LEAST_SHARE * float(np.max(column)))
    return [max(float(value), least) for value in (np.exp(values) if log else values)]


def with_other_laws(
    earlier: DamperSpec, theta: NDArray[np.float64], spec: DamperSpec, commands: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Coefficients of other laws of the same model, shape (n_params,), for values `theta` of the earlier ones.

    A law that is the same keeps its coefficients; another one is fitted to the values of the earlier one at these
    commands: exactly where both are polynomials, or both by values, and it has no fewer coefficients.
    """
    assert earlier.current is not None
    assert spec.current is not None
    values: list[float] = []
    place = 0
    for parameter, old, new in zip(spec.plain, earlier.current.laws, spec.current.laws, strict=True):
        law = law_named(old)
        own = theta[place : place + law.n_coefficients]
        place += law.n_coefficients
        column = law.values(own, commands, log=parameter.scale == "log")
        values += list(own) if new == old else fitted_law(new, parameter, commands, column)
    box = Box.of(spec)
    return np.asarray(np.clip([*values, *theta[place:]], box.lower, box.upper))


def leaves_range(
    spec: DamperSpec, theta: NDArray[np.float64], commands: NDArray[np.float64]
) -> tuple[str, ...]:
    """Parameters whose law leaves the admissible range at these commands, in rising order, or between them.

    There the parameter is limited to its range, and does not change with the coefficients.
    """
    limits = law_limits(spec, theta, (float(commands[0]), float(commands[-1])))
    return tuple(each.parameter for each in limits if each.value != each.used)


def within_range(
    spec: DamperSpec, theta: NDArray[np.float64], commands: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Coefficients, shape (n_params,), of laws that do not leave their ranges at these commands and between them.

    A law that leaves its range becomes the straight line between its values at the first and the last command.
    """
    assert spec.current is not None
    leaving = leaves_range(spec, theta, commands)
    ends = commands[[0, -1]]
    values: list[float] = []
    for parameter, name in zip(spec.plain, spec.current.laws, strict=True):
        law = law_named(name)
        own = theta[len(values) : len(values) + law.n_coefficients]
        if parameter.name in leaving:
            at_ends = law.values(own, ends, log=parameter.scale == "log")
            line = np.interp(commands, ends, np.clip(at_ends, parameter.lower, parameter.upper))
            values += fitted_law(name, parameter, commands, line)
        else:
            values += own.tolist()
    return np.array([*values, *theta[len(values) :]])


def plain_of(form: Form) -> tuple[DamperSpec, Box]:
    """The plain model of a form with current laws, with the bounds of the parameters that are constant."""
    plain = damper(form.spec.name)
    bounds = {
        name: (form.box.lower[index], form.box.upper[index])
        for index, name in enumerate(form.box.names)
        if name in plain.names
    }
    return plain, Box.of(plain).with_bounds(bounds)


def joint_box(form: Form, tests: tuple[DamperTest, ...], commands: NDArray[np.float64]) -> Box:
    """The box of a joint fit: ranges of coefficients follow from the stroke, speed, force and commands of the tests."""
    searched = search_box(*plain_of(form), tests)
    return _limit_box(form, _law_box(form.spec, searched, commands, margin=_MARGIN))


def _law_box(spec: DamperSpec, searched: Box, commands: NDArray[np.float64], *, margin: float = 1.0) -> Box:
    """Ranges of the coefficients of the laws, `margin` times as wide as the searched ranges of the plain model imply.

    A coefficient may have either sign, and at the largest command its term reaches the end of the parameter's range.
    """
    largest = max(float(np.max(np.abs(commands))), 1e-3)
    bounds: dict[str, tuple[float, float]] = {}
    admissible = Box.of(spec)
    for index, parameter in enumerate(spec.parameters):
        coefficient = parameter.coefficient
        if coefficient is None:
            continue
        plain = searched.names.index(coefficient.parameter)
        reach = margin * max(abs(searched.lower[plain]), abs(searched.upper[plain]))
        if coefficient.command is not None and parameter.scale == "log":
            # Its logarithm resolves the admissible range, as that of a constant parameter does.
            continue
        if coefficient.is_exponent:
            reach = _EXPONENT
        elif spec.current is not None and law_named(spec.current.laws[plain]).degree is not None:
            reach /= largest**coefficient.number
        bounds[parameter.name] = (max(-reach, admissible.lower[index]), min(reach, admissible.upper[index]))
    return admissible.with_bounds(bounds)


def _limit_box(form: Form, limits: Box) -> Box:
    """The box of a form, where parameters that the user has not bounded have the range of `limits`.

    Local minimisations run in the logit of the range; for a range of +-1e9 the logit resolves useful values poorly.
    """
    admissible = Box.of(form.spec)
    narrowed = {}
    for index, name in enumerate(admissible.names):
        own = (form.box.lower[index], form.box.upper[index])
        if own == (admissible.lower[index], admissible.upper[index]):
            narrowed[name] = (limits.lower[index], limits.upper[index])
    return form.box.with_bounds(narrowed)


def levels_needed(spec: DamperSpec) -> int:
    """Number of commands that the laws of a model need."""
    return 1 + max((_fitted_degree(law) for law in spec.current.laws), default=0) if spec.current else 1


def _fitted_degree(law: LawName) -> int:
    """Degree of the polynomial that is fitted to values over the command; 1 for an exponential law."""
    kind = law_named(law)
    if kind.nodes:
        return len(kind.nodes) - 1
    return 1 if kind.degree is None else kind.degree
