"""Losses of residuals, by which outliers count less than their squares.

Apart from `residual`, which they enter in one line, because they are formulas of a residual alone. With z = (r/scale)^2
the sum of squares `sum r^2` becomes `scale^2 sum rho(z)`, as in `scipy.optimize.least_squares`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import ArrayLike

from mrwork.errors import SettingError
from mrwork.values import Floats

LossName = Literal["linear", "soft_l1", "huber", "cauchy", "arctan"]

LossFunction = Callable[[Floats], ArrayLike]
"""Maps z, of any shape, to rho(z) and its derivative, stacked along a first axis; further rows are not used."""


def _soft_l1(z: Floats) -> tuple[Floats, Floats]:
    root = np.sqrt(1.0 + z)
    return 2.0 * (root - 1.0), 1.0 / root


def _huber(z: Floats) -> tuple[Floats, Floats]:
    root = np.sqrt(np.maximum(z, 1.0))
    return np.where(z <= 1.0, z, 2.0 * root - 1.0), 1.0 / root


def _cauchy(z: Floats) -> tuple[Floats, Floats]:
    return np.log1p(z), 1.0 / (1.0 + z)


def _arctan(z: Floats) -> tuple[Floats, Floats]:
    return np.arctan(z), 1.0 / (1.0 + z**2)


_LOSSES: dict[str, Callable[[Floats], tuple[Floats, Floats]]] = {
    "soft_l1": _soft_l1,
    "huber": _huber,
    "cauchy": _cauchy,
    "arctan": _arctan,
}
# Below it rho(z)/z is that at zero, within rounding.
_SMALLEST = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class Loss:
    """A loss rho and the residual [N] from which on it differs from the square."""

    rho: LossFunction
    scale: float

    def transform(self, residuals: Floats) -> tuple[Floats, Floats]:
        """Residuals whose sum of squares is `scale^2 sum rho(z)`, and their derivatives by the residuals given."""
        z = (residuals / self.scale) ** 2
        value, slope = self._values(z)
        root = np.sqrt(np.maximum(value, 0.0))
        far = z > _SMALLEST
        length = np.sqrt(np.where(far, z, 1.0))
        factor = np.where(far, root / length, 1.0)
        derivative = np.where(far, slope * length / np.where(root > 0.0, root, 1.0), 1.0)
        return residuals * factor, derivative

    def _values(self, z: Floats) -> tuple[Floats, Floats]:
        found = np.asarray(self.rho(z), dtype=np.float64)
        if found.ndim != z.ndim + 1 or len(found) < 2 or found.shape[1:] != z.shape:
            raise SettingError(
                f"the loss returned shape {found.shape} for z of shape {z.shape}; return rho(z) and its derivative "
                f"stacked, shape {(2, *z.shape)}"
            )
        if not np.isfinite(found[:2]).all():
            raise SettingError(
                "the loss returned a number that is not finite; return finite rho(z) and derivatives"
            )
        return found[0], found[1]


def loss_of(loss: LossName | LossFunction, scale: float | None) -> Loss | None:
    """The loss of this name, or with this function; `None` for the square."""
    if loss == "linear":
        if scale is not None:
            raise SettingError(
                f"`loss_scale` is {scale:g}, and the linear loss has none; leave it out, or give a `loss`"
            )
        return None
    if scale is None:
        raise SettingError(
            "`loss` wants its `loss_scale` [N], the residual from which on it differs from the square, such as twice "
            "the noise of the force; give it"
        )
    named = _LOSSES.get(loss) if isinstance(loss, str) else None
    return Loss(rho=named or cast("Callable[[Floats], Any]", loss), scale=scale)
