"""Laws through logarithms of values where the same ones through the values themselves describe the tests better.

Logarithms are the default because they predict measured forces between the commands better; a parameter that is nearly
zero at one command and grows as a polynomial is the exception.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.dampers.parameters import LawName, law_at, law_named, polynomial_laws
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.identification.levenberg_marquardt import find_minima
from mrwork.identification.objective import Objective

# The other laws are named where their misfit is below this share: less is no reason to choose them by the same tests.
_SHARE = 0.8
_MOST_ITERATIONS = 30


def law_shape_warnings(objective: Objective, box: Box, theta: NDArray[np.float64]) -> tuple[str, ...]:
    """A sentence where the laws through values themselves, fitted from `theta`, shape (n_params,), are far better."""
    spec = objective.spec
    through = _laws_through_values(spec)
    if spec.current is None or not through:
        return ()
    plain = damper(spec.name)
    laws = dict(zip(plain.names, spec.current.laws, strict=True)) | through
    # Their coefficients have the same names and ranges, because they are the values at the same commands.
    other = objective.on(
        plain.with_current_laws(laws, unit=spec.current.unit, lagged=spec.current.lagged), objective.tests
    )
    minimum = find_minima(other, box, theta[None], max_iterations=_MOST_ITERATIONS)
    own, found = float(objective.plain(theta[None])[0]), float(other.plain(minimum.theta)[0])
    if not found < _SHARE * own:
        return ()
    named = ", ".join(f"{name}={law}" for name, law in through.items())
    return (
        "laws through the values themselves, not through their logarithms, describe the tests better: "
        f"{100.0 * (1.0 - found):.2f} % against {100.0 * (1.0 - own):.2f} %; give {named} as laws",
    )


def _laws_through_values(spec: DamperSpec) -> dict[str, LawName]:
    """Laws through values for the parameters whose laws take logarithms, by name."""
    if spec.current is None:
        return {}
    polynomials = polynomial_laws()
    return {
        parameter.name: law_at(polynomials[len(law.nodes) - 1], law.nodes)
        for parameter, law in zip(spec.plain, map(law_named, spec.current.laws), strict=True)
        if law.takes_logarithms and parameter.scale == "log" and len(law.nodes) <= len(polynomials)
    }
