"""A damper whose parameters follow the command, from its coefficients by name."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mrwork.dampers import DamperSpec, LawName, damper
from studies.former.arrays import Floats

Coefficients = Mapping[str, float | tuple[float, ...]]
"""A number for a parameter that does not follow the command, else its coefficients, lowest power first; 0 if absent."""


def driven(
    model: str,
    coefficients: Coefficients,
    *,
    unit: str = "A",
    rate: float | None = None,
    of_three: LawName = "quadratic",
) -> tuple[DamperSpec, Floats]:
    """The model with current laws, and its numbers; with the `rate` [1/s] of a driver, behind its lag.

    Two coefficients are a linear law, three the law `of_three`.
    """
    kinds: dict[int, LawName] = {2: "linear", 3: of_three}
    given = {name: value if isinstance(value, tuple) else (value,) for name, value in coefficients.items()}
    laws = {name: kinds[len(values)] for name, values in given.items() if len(values) > 1}
    plain = damper(model)
    spec = plain.with_current_laws(laws, unit=unit, lagged=rate is not None)
    theta = [value for name in plain.names for value in given.get(name, (0.0,))]
    return spec, np.array(theta if rate is None else [*theta, rate])
