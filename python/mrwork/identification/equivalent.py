"""Equivalent forms without redundant parameters, and search ranges that suit the tests.

Some models are identified in a form of other parameters, with exact conversions. The ranges in which a search samples
the parameters follow from the stroke, speed and force of the tests. Coefficients of current laws are fitted to values
of the plain model at several commands, and have ranges that follow from its own.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from mrwork.base.arguments import checked
from mrwork.base.units import unit_of
from mrwork.base.values import Floats
from mrwork.dampers.conversions import (
    BOUC_WEN_FROM_NORMALISED,
    NORMALISED_FROM_BOUC_WEN,
    Conversion,
    of_modified,
)
from mrwork.dampers.coordinates import Box
from mrwork.dampers.parameters import DRIVER_RATES
from mrwork.dampers.spec import DamperSpec, by_parameter, damper, law_limits
from mrwork.errors import SettingError
from mrwork.records import DamperTest


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """The model whose parameters are searched, with its bounds and the conversions to and from the requested model.

    Parameters of the requested model in `fixed` are constants of the form. Parameters in `mirrored` (indices) can
    change sign together with little effect: a small k of either sign gives the same offset -k x0, but a local
    minimisation cannot cross k = 0, where x0 is infinite.
    """

    spec: DamperSpec
    box: Box
    to_model: Conversion
    from_model: Conversion
    fixed: tuple[str, ...] = ()
    mirrored: tuple[int, ...] = ()


def identifiable_form(spec: DamperSpec, bounds: Mapping[str, tuple[float, float]]) -> Form:
    """Return the form in which a model is identified, with the user's bounds.

    A Spencer form of Bouc-Wen is searched in its normalised form: alpha, gamma, beta and A are determined only up to
    a common scale. A is fixed at the value that the bounds give, or else at its nominal value.
    """
    equivalent = _EQUIVALENTS.get(spec.name)
    if equivalent is not None and spec.command_unit is not None:
        raise SettingError(
            f"{spec.name} with current laws is identified as {equivalent.name}, whose parameters the data settle; "
            "give the laws to that model"
        )
    bounded = Box.of(spec).with_bounds(bounds)
    if equivalent is None:
        mirrored = _find_mirrored(spec, bounded)
        return Form(spec=spec, box=bounded, to_model=_IDENTITY, from_model=_IDENTITY, mirrored=mirrored)
    index = spec.names.index("A")
    scale = spec.parameters[index].nominal
    translated: dict[str, tuple[float, float]] = {}
    for name, (lower, upper) in bounds.items():
        if name == "A" and lower == upper:
            scale = bounded.lower[index]
        elif name in equivalent.shared:
            translated[equivalent.shared[name]] = (lower, upper)
        else:
            raise SettingError(
                f"bounds of {name} cannot be kept: in {spec.name} the data settle alpha, gamma, beta and A only up to "
                f"a common scale; fix A=VALUE to choose the scale, or identify {equivalent.name}"
            )
    normalised = damper(equivalent.name)
    box = Box.of(normalised).with_bounds(translated)
    return Form(
        spec=normalised,
        box=box,
        to_model=equivalent.to_model.at(scale),
        from_model=equivalent.from_model,
        fixed=("A",),
        mirrored=_find_mirrored(normalised, box),
    )


def _find_mirrored(spec: DamperSpec, box: Box) -> tuple[int, ...]:
    """Stiffness and free length of the model's spring, where both are free and may have either sign."""
    pair = spec.spring_indices or ()
    return pair if all(box.lower[index] < 0.0 < box.upper[index] for index in pair) else ()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Equivalent:
    """The normalised form of a model, the conversions to and from the model, and the parameters that both have."""

    name: str
    to_model: Conversion
    from_model: Conversion
    shared: Mapping[str, str]


_IDENTITY = Conversion(lambda theta: theta)

_EQUIVALENTS = {
    "bouc_wen": _Equivalent(
        name="normalised_bouc_wen",
        to_model=BOUC_WEN_FROM_NORMALISED,
        from_model=NORMALISED_FROM_BOUC_WEN,
        shared={"c0": "c", "k0": "k", "x0": "x0", "n": "n"},
    ),
    "modified_bouc_wen": _Equivalent(
        name="normalised_modified_bouc_wen",
        to_model=of_modified(BOUC_WEN_FROM_NORMALISED),
        from_model=of_modified(NORMALISED_FROM_BOUC_WEN),
        shared={name: name for name in ("c0", "k0", "c1", "k1", "x0", "n")},
    ),
}


# Smallest and largest multiple of the tests' scale of a unit: for example damping that gives a thousandth of the
# measured force up to twice that force. The models' admissible ranges are far wider; local minimisations may use them.
_POSITIVE = {
    "N s/m": (1e-3, 2.0),
    "N s2/m2": (1e-3, 2.0),
    "N/m": (1e-2, 1e3),
    "N": (1e-2, 2.0),
    "m": (1e-4, 20.0),
    "1/m": (1.0, 300.0),
    "s/m": (0.1, 1e3),
    "m/s": (1e-2, 2.0),
    "1/s": (1e-3, 3.0),
    # Ratio of unloading to loading stiffness of a Bouc-Wen loop; outside these values loops do not differ visibly.
    "1": (0.1, 100.0),
}
_SIGNED = {"N/m": (-1.0, 1.0), "m": (-2.0, 2.0), "N": (-1.0, 1.0), "1": (-4.0, 4.0), "m/s": (-0.5, 0.5)}
# Of any other unit.
_POSITIVE_OTHERS, _SIGNED_OTHERS = (1e-3, 1e3), (-2.0, 2.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class _HalfRanges:
    """Half of the largest peak-to-peak `stroke` [m], `speed` [m/s] and `force` [N] of tests."""

    stroke: float
    speed: float
    force: float

    @classmethod
    def of(cls, tests: tuple[DamperTest, ...]) -> _HalfRanges:
        stroke, speed, force = (
            max(float(np.ptp(getattr(test, channel))) / 2 for test in tests)
            for channel in ("displacement", "velocity", "force")
        )
        return cls(stroke=stroke, speed=speed, force=force)

    def of_unit(self, unit: str) -> float | None:
        """Size of a parameter of this unit in SI, as force/speed^3 of N s3/m3; `None` if it is not of kg, m and s."""
        read = unit_of(unit)
        if read is None or not read.powers.keys() <= {"kg", "m", "s"}:
            return None
        mass, length, time = (read.powers.get(base, 0) for base in ("kg", "m", "s"))
        # A force is kg m/s2, a speed m/s: what is left of m and s is that of the speed, then of the stroke.
        of_speed = -(time + 2 * mass)
        powers = ((self.force, mass), (self.stroke, length - mass - of_speed), (self.speed, of_speed))
        over = math.prod(size**power for size, power in powers if power > 0)
        return over / math.prod(size**-power for size, power in powers if power < 0)


@checked
def search_box(spec: DamperSpec, bounds: Box, tests: tuple[DamperTest, ...]) -> Box:
    """Narrow the bounds to the range that suits the stroke, speed and force of the tests.

    Parameters for which that range would be empty, or whose unit is not of N, m and s, keep their bounds.
    """
    if not tests:
        raise SettingError("a range that suits the tests needs a test; give at least one")
    ranges = _HalfRanges.of(tests)
    narrowed: dict[str, tuple[float, float]] = {}
    for index, parameter in enumerate(spec.parameters):
        scale = ranges.of_unit(parameter.unit)
        if scale is None:
            continue
        if parameter.scale == "log":
            least, most = _POSITIVE.get(parameter.unit, _POSITIVE_OTHERS)
        else:
            least, most = _SIGNED.get(parameter.unit, _SIGNED_OTHERS)
        lower = max(bounds.lower[index], least * scale)
        upper = min(bounds.upper[index], most * scale)
        if lower < upper:
            narrowed[parameter.name] = (float(lower), float(upper))
    return bounds.with_bounds(narrowed)


# Multiple of the searched range within which minima are looked for.
_WIDER = 10.0


def widened(searched: Box, box: Box) -> Box:
    """The searched ranges ten times as wide to either side, within the box."""
    bounds = {}
    for index, name in enumerate(searched.names):
        lower, upper = searched.lower[index], searched.upper[index]
        if searched.log[index]:
            lower, upper = lower / _WIDER, upper * _WIDER
        else:
            middle, half = (lower + upper) / 2, (upper - lower) / 2
            lower, upper = middle - _WIDER * half, middle + _WIDER * half
        bounds[name] = (max(lower, box.lower[index]), min(upper, box.upper[index]))
    return box.with_bounds(bounds)


# Largest exponent of a law [1/A or 1/V], either sign.
_EXPONENT = 5.0
# Coefficients may reach this multiple of the range that is searched.
_MARGIN = 10.0


def fitted_coefficients(spec: DamperSpec, commands: Floats, values: Floats) -> Floats:
    """Coefficients of the laws, shape (n_params,), by least squares from `values`, shape (n_levels, n_plain)."""
    if spec.command_unit is None:
        return np.asarray(values[0])
    theta: list[float] = []
    for (parameter, law), column in zip(spec.law_pairs, values.T, strict=True):
        theta += law.through(parameter, commands, column)
    theta += [rate.nominal for rate in DRIVER_RATES[spec.lag]]
    box = Box.of(spec)
    return np.clip(theta, box.lower, box.upper)


def in_other_dependences(earlier: DamperSpec, theta: Floats, spec: DamperSpec, commands: Floats) -> Floats:
    """Coefficients of other laws of the same model, shape (n_params,), for values `theta` of the earlier ones.

    A law that is the same keeps its coefficients; another one is fitted to the values of the earlier one at these
    commands: exactly where both are polynomials, or both by values, and it has no fewer coefficients.
    """
    values: list[float] = []
    *coefficients, rest = by_parameter(earlier, theta)
    for (parameter, old), new, block in zip(earlier.law_pairs, spec.laws, coefficients, strict=True):
        if new == old:
            values += list(block)
        else:
            column = old.values(block, commands)
            values += new.through(parameter, commands, column)
    box = Box.of(spec)
    return np.asarray(np.clip([*values, *rest], box.lower, box.upper))


def leaves_range(spec: DamperSpec, theta: Floats, commands: Floats) -> tuple[str, ...]:
    """Parameters whose law is clipped to its admissible range at or between these increasing commands."""
    limits = law_limits(spec, theta, (float(commands[0]), float(commands[-1])))
    return tuple(limit.parameter for limit in limits if limit.value != limit.used)


def within_range(spec: DamperSpec, theta: Floats, commands: Floats) -> Floats:
    """Coefficients, shape (n_params,), of laws that stay within their ranges at and between these commands.

    A law that leaves its range becomes the straight line between its values at the first and the last command.
    """
    leaving = leaves_range(spec, theta, commands)
    ends = commands[[0, -1]]
    values: list[float] = []
    *coefficients, rest = by_parameter(spec, theta)
    for (parameter, law), block in zip(spec.law_pairs, coefficients, strict=True):
        if parameter.name in leaving:
            at_ends = law.values(block, ends)
            line = np.interp(commands, ends, np.clip(at_ends, parameter.lower, parameter.upper))
            values += law.through(parameter, commands, line)
        else:
            values += block.tolist()
    return np.array([*values, *rest])


def plain_of(form: Form) -> tuple[DamperSpec, Box]:
    """The plain model of a form with current laws, with the bounds of the parameters that are constant."""
    plain = form.spec.without_laws
    return plain, Box.of(plain).with_bounds(bounds_of(form.box, plain.names))


def bounds_of(box: Box, names: Collection[str]) -> dict[str, tuple[float, float]]:
    """Bounds of the parameters of a box that have one of these names."""
    ranges = zip(box.names, box.lower, box.upper, strict=True)
    return {name: (lower, upper) for name, lower, upper in ranges if name in names}


def joint_box(form: Form, tests: tuple[DamperTest, ...], commands: Floats) -> Box:
    """The box of a joint fit: ranges of coefficients follow from the stroke, speed, force and commands of the tests.

    They are `_MARGIN` times as wide as the searched ranges of the plain model imply: a coefficient may have either
    sign, and at the largest command its term reaches the end of the parameter's range. Local minimisations run in the
    logit of the range, which resolves useful values poorly for a range of +-1e9. What the user has bounded stays.
    """
    spec, searched, admissible = form.spec, search_box(*plain_of(form), tests), Box.of(form.spec)
    largest = max(float(np.max(np.abs(commands))), 1e-3)
    bounds: dict[str, tuple[float, float]] = {}
    for index, parameter in enumerate(spec.parameters):
        coefficient = parameter.coefficient
        lower, upper = admissible.lower[index], admissible.upper[index]
        if coefficient is None or (form.box.lower[index], form.box.upper[index]) != (lower, upper):
            continue
        plain = searched.names.index(coefficient.parameter)
        reach = _MARGIN * max(abs(searched.lower[plain]), abs(searched.upper[plain]))
        if parameter.scale == "log":
            # Its logarithm resolves the admissible range, as of a constant parameter.
            continue
        if coefficient.is_rate:
            reach = _EXPONENT
        elif spec.laws[plain].degree is not None:
            reach /= largest**coefficient.number
        bounds[parameter.name] = (max(-reach, lower), min(reach, upper))
    return form.box.with_bounds(bounds)


def levels_needed(spec: DamperSpec) -> int:
    """Number of commands that the laws of a model need."""
    return 1 + max(law.fitted_degree for law in spec.laws)
