"""The model that is searched, and where: equivalent forms without redundant parameters, and ranges that suit the tests.

Some models are identified in a form of other parameters, with exact conversions. The ranges in which a search samples
the parameters follow from the stroke, speed and force of the tests.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mrwork.arguments import checked
from mrwork.dampers.conversions import (
    Conversion,
    Scales,
    bouc_wen_from_normalised,
    bouc_wen_from_normalised_jacobian,
    modified_bouc_wen_from_normalised,
    modified_bouc_wen_from_normalised_jacobian,
    normalised_from_bouc_wen,
    normalised_from_bouc_wen_jacobian,
    normalised_from_modified_bouc_wen,
    normalised_from_modified_bouc_wen_jacobian,
)
from mrwork.dampers.coordinates import Box
from mrwork.dampers.parameters import ParamSpec
from mrwork.dampers.spec import DamperSpec, damper
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
    if equivalent is not None and spec.current is not None:
        raise SettingError(
            f"{spec.name} with current laws is identified as {equivalent.name}, whose parameters the data settle; "
            "give the laws to that model"
        )
    if equivalent is None:
        box = Box.of(spec).with_bounds(bounds)
        return Form(
            spec=spec, box=box, to_model=_IDENTITY, from_model=_IDENTITY, mirrored=_find_mirrored(spec, box)
        )
    bounded = Box.of(spec).with_bounds(bounds)
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


_IDENTITY = Conversion(convert=lambda theta: theta, jacobian=lambda theta: np.eye(theta.shape[-1]))

_EQUIVALENTS = {
    "bouc_wen": _Equivalent(
        name="normalised_bouc_wen",
        to_model=Conversion(convert=bouc_wen_from_normalised, jacobian=bouc_wen_from_normalised_jacobian),
        from_model=Conversion(convert=normalised_from_bouc_wen, jacobian=normalised_from_bouc_wen_jacobian),
        shared={"c0": "c", "k0": "k", "x0": "x0", "n": "n"},
    ),
    "modified_bouc_wen": _Equivalent(
        name="normalised_modified_bouc_wen",
        to_model=Conversion(
            convert=modified_bouc_wen_from_normalised, jacobian=modified_bouc_wen_from_normalised_jacobian
        ),
        from_model=Conversion(
            convert=normalised_from_modified_bouc_wen, jacobian=normalised_from_modified_bouc_wen_jacobian
        ),
        shared={name: name for name in ("c0", "k0", "c1", "k1", "x0", "n")},
    ),
}


# Smallest and largest multiple of the tests' scale of each unit: for example damping that gives a thousandth of the
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


def half_ranges(tests: tuple[DamperTest, ...]) -> Scales:
    """Half of the largest peak-to-peak stroke [m], speed [m/s] and force [N] of the tests."""
    return Scales(
        stroke=max(float(np.ptp(test.displacement)) / 2 for test in tests),
        speed=max(float(np.ptp(test.velocity)) / 2 for test in tests),
        force=max(float(np.ptp(test.force)) / 2 for test in tests),
    )


@checked
def search_box(spec: DamperSpec, bounds: Box, tests: tuple[DamperTest, ...]) -> Box:
    """Narrow the bounds to the range that suits the stroke, speed and force of the tests.

    Parameters for which that range would be empty, or whose unit has no scale, keep their bounds.
    """
    if not tests:
        raise SettingError("a range that suits the tests needs a test; give at least one")
    ranges = half_ranges(tests)
    stroke, speed, force = ranges.stroke, ranges.speed, ranges.force
    scales = {
        "N s/m": force / speed,
        "N s2/m2": force / speed**2,
        "N/m": force / stroke,
        "N": force,
        "m": stroke,
        "1/m": 1 / stroke,
        "s/m": 1 / speed,
        "m/s": speed,
        "1/s": speed / stroke,
        "1": 1.0,
    }
    narrowed: dict[str, tuple[float, float]] = {}
    for index, parameter in enumerate(spec.parameters):
        multiples = _multiples(parameter)
        scale = scales.get(parameter.unit)
        if multiples is None or scale is None:
            continue
        lower = max(bounds.lower[index], multiples[0] * scale)
        upper = min(bounds.upper[index], multiples[1] * scale)
        if lower < upper:
            narrowed[parameter.name] = (float(lower), float(upper))
    return bounds.with_bounds(narrowed)


def _multiples(parameter: ParamSpec) -> tuple[float, float] | None:
    table = _POSITIVE if parameter.scale == "log" else _SIGNED
    return table.get(parameter.unit)
