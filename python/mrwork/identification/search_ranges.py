"""Where a search looks first: ranges of the parameters at the scales of the record itself."""

from __future__ import annotations

import numpy as np

from mrwork.dampers.coordinates import Box
from mrwork.dampers.parameters import ParamSpec
from mrwork.dampers.spec import DamperSpec
from mrwork.records import DamperTest

# Multiples of the record's own scale of the unit, smallest and largest: a dashpot that makes a
# thousandth of the force up to one that makes twice of it, a knee as wide as the stroke down to a
# thousandth of it. The models' admissible ranges are far wider; refinement may use all of them.
_POSITIVE = {
    "N s/m": (1e-3, 2.0),
    "N/m": (1e-2, 1e3),
    "N": (1e-2, 2.0),
    "m": (1e-4, 20.0),
    "1/m": (1.0, 300.0),
    "s/m": (0.1, 1e3),
    "m/s": (1e-2, 2.0),
    "1/s": (1e-3, 3.0),
    # Of a Bouc-Wen loop, how much steeper it unloads than it loads: beyond this at once, to any eye.
    "1": (0.1, 100.0),
}
_SIGNED = {"N/m": (-1.0, 1.0), "m": (-2.0, 2.0), "N": (-1.0, 1.0), "1": (-4.0, 4.0), "m/s": (-0.5, 0.5)}


def search_box(spec: DamperSpec, bounds: Box, tests: tuple[DamperTest, ...]) -> Box:
    """Narrow the bounds to what tests of this stroke, speed and force can ask for.

    A range that would come out empty, and a unit without a scale, keep the bounds as they are.
    """
    stroke = max(np.ptp(test.displacement) / 2 for test in tests)
    speed = max(np.ptp(test.velocity) / 2 for test in tests)
    force = max(np.ptp(test.force) / 2 for test in tests)
    scales = {
        "N s/m": force / speed,
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
