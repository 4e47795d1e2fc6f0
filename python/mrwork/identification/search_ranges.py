"""Ranges in which a search samples the parameters, from the stroke, speed and force of the tests."""

from __future__ import annotations

import numpy as np

from mrwork.arguments import checked
from mrwork.dampers.coordinates import Box
from mrwork.dampers.nesting import Scales
from mrwork.dampers.parameters import ParamSpec
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.records import DamperTest

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
