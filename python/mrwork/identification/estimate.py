"""From a minimum to estimates: values, units, and what is to be said of each parameter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec
from mrwork.identification.equivalent import Form
from mrwork.identification.fit import Estimate

# Closer to a face of the box than this share of its width is on it.
_ON_BOUND = 1e-4

Remark = Literal["", "fixed", "at lower bound", "at upper bound", "not identifiable"]


def estimates_of(
    spec: DamperSpec,
    form: Form,
    theta: NDArray[np.float64],
    errors: NDArray[np.float64] | None,
    bounds: Mapping[str, tuple[float, float]],
) -> tuple[Estimate, ...]:
    """Estimates in the order of the model asked for; without `errors` no standard error is given."""
    asked = Box.of(spec).with_bounds(bounds)
    values = np.asarray(form.back(theta))
    result = []
    for index, parameter in enumerate(spec.parameters):
        value = float(values[index])
        remark: Remark = ""
        if parameter.name in form.held:
            remark = "fixed"
        elif form.spec == spec:
            remark = remark_of(form.box, index, value)
        error = None
        if errors is not None and remark == "":
            error = float(errors[index])
            if not np.isfinite(error):
                error, remark = None, "not identifiable"
        result.append(
            Estimate(
                name=parameter.name,
                unit=parameter.unit,
                value=value,
                standard_error=error,
                lower=asked.lower[index],
                upper=asked.upper[index],
                remark=remark,
            )
        )
    return tuple(result)


def remark_of(box: Box, index: int, value: float) -> Remark:
    """Whether a parameter is fixed or lies on a face of the box."""
    lower, upper = box.lower[index], box.upper[index]
    if lower == upper:
        return "fixed"
    if box.log[index]:
        lower, upper, value = np.log(lower), np.log(upper), np.log(value)
    unit = (value - lower) / (upper - lower)
    if unit < _ON_BOUND:
        return "at lower bound"
    return "at upper bound" if unit > 1.0 - _ON_BOUND else ""
