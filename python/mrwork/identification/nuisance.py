"""What may differ from test to test without being the damper's: offset, level and delay of the force channel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.spec import DamperSpec
from mrwork.records.observation import delayed

NuisanceName = Literal["offset", "level", "delay"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Nuisance:
    """Estimates for one test: `F = level f(t - delay) + offset`, offset [N], delay [s]."""

    offset: float = 0.0
    level: float = 1.0
    delay: float = 0.0

    @property
    def in_words(self) -> str:
        """The estimates, for people; empty where nothing was estimated."""
        parts = [
            (self.offset, f"offset by {self.offset:.4g} N"),
            (self.level - 1.0, f"times {self.level:.4g}"),
            (self.delay, f"late by {1e3 * self.delay:.3g} ms"),
        ]
        return ", ".join(text for value, text in parts if value != 0.0)

    def applied(self, force: NDArray[np.float64], dt: float) -> NDArray[np.float64]:
        """`force` [N], shape (n_time,), sampled every `dt` [s], as the channel of this test would have it."""
        return np.asarray(self.level * delayed(force, self.delay / dt) + self.offset)


NONE = Nuisance()


def offsets_left_to(names: tuple[NuisanceName, ...], spec: DamperSpec) -> dict[str, tuple[float, float]]:
    """Bounds that hold at zero what offsets the force of a model, where each test has an offset of its own."""
    if "offset" not in names:
        return {}
    shifts = {each.name for each in spec.plain if each.scale == "offset" and each.unit in ("N", "m")}
    return {name: (0.0, 0.0) for name in spec.names if name.partition(".")[0] in shifts}


def without_nuisance(
    force: NDArray[np.float64], measured: NDArray[np.float64], names: tuple[NuisanceName, ...]
) -> NDArray[np.float64]:
    """Residuals [N] of `force`, shape (n_batch, n_time), once the nuisance parameters are at their best.

    They are linear (the delay to first order), so the best ones follow in closed form for each row and no search
    has to look for them.
    """
    residuals = force - measured
    if names:
        coefficients, columns = _best(force, residuals, names)
        residuals = residuals - np.einsum("kb,kbt->bt", coefficients, columns)
    return residuals


def linearised_without_nuisance(
    force: NDArray[np.float64],
    slope: NDArray[np.float64],
    measured: NDArray[np.float64],
    names: tuple[NuisanceName, ...],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The same with derivatives, from those of the force, shape (n_batch, n_params, n_time).

    Residuals are r = y - C c with c = C^+ y, and the columns C follow the force too, but for the offset's. So

        dr = P (dy - dC c) - (C^+)' dC' r,  P = 1 - C C^+

    (Golub, Pereyra, SIAM J. Numer. Anal. 10, 1973, 413-432); exact, the delay being a column like the others.
    """
    residuals = force - measured
    if not names:
        return residuals, slope
    coefficients, columns = _best(force, residuals, names)
    residuals = residuals - np.einsum("kb,kbt->bt", coefficients, columns)
    change = np.stack([_slope(name, slope) for name in names])
    moved = slope - np.einsum("kb,kbpt->bpt", coefficients, change)
    along = np.einsum("kbpt,bt->kbp", change, residuals)
    derivative = np.empty_like(slope)
    for row in range(len(force)):
        own = columns[:, row]
        # Rows of the pseudo-inverse, in columns of unit length as in `_best`.
        length = np.maximum(np.linalg.norm(own, axis=-1), np.finfo(float).tiny)
        unit = own / length[:, None]
        inverse = np.linalg.pinv(unit @ unit.T) @ unit
        seen = moved[row] - (moved[row] @ inverse.T) @ unit
        derivative[row] = seen - (along[:, row] / length[:, None]).T @ inverse
    return residuals, derivative


def nuisance_of(
    force: NDArray[np.float64], measured: NDArray[np.float64], dt: float, names: tuple[NuisanceName, ...]
) -> Nuisance:
    """The best nuisance parameters for one `force` [N], shape (n_time,)."""
    if not names:
        return NONE
    coefficients, _ = _best(force[None], (force - measured)[None], names)
    best = dict(zip(names, -coefficients[:, 0], strict=True))
    return Nuisance(
        offset=float(best.get("offset", 0.0)),
        level=1.0 + float(best.get("level", 0.0)),
        delay=-float(best.get("delay", 0.0)) * dt,
    )


def _best(
    force: NDArray[np.float64], residuals: NDArray[np.float64], names: tuple[NuisanceName, ...]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least-squares coefficients, shape (n_names, n_batch), of the columns, (n_names, n_batch, n_time)."""
    columns = np.stack([_column(name, force) for name in names])
    # In columns of unit length: a force of 1e3 N and its slope per sample differ by far.
    length = np.maximum(np.linalg.norm(columns, axis=-1), np.finfo(float).tiny)
    unit = columns / length[..., None]
    gram = np.einsum("jbt,kbt->bjk", unit, unit)
    right = np.einsum("jbt,bt->bj", unit, residuals)
    return (np.linalg.pinv(gram) @ right[..., None])[..., 0].T / length, columns


def _column(name: NuisanceName, force: NDArray[np.float64]) -> NDArray[np.float64]:
    """What the residuals change by, to first order, with each nuisance parameter."""
    if name == "offset":
        return np.ones_like(force)
    return force if name == "level" else np.gradient(force, axis=-1)


def _slope(name: NuisanceName, slope: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivative of the column."""
    return np.zeros_like(slope) if name == "offset" else _column(name, slope)
