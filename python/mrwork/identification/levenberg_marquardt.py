"""Levenberg-Marquardt of SciPy with exact Jacobians, simulated in lanes.

Residuals and Jacobian come out of one simulation, which takes a quarter longer than one of the residuals alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.identification.linearisation import linearised
from mrwork.identification.objective import Objective

_TOLERANCE = 1e-7
# Longest first step, in root sum of squares of the normalised residuals.
_FIRST_STEP = 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class Descended:
    """Where a start led: parameters (n_params,), their misfit, residuals computed, whether the descent arrived."""

    theta: NDArray[np.float64]
    misfit: float
    evaluations: int
    converged: bool


def descend(
    objective: Objective,
    box: Box,
    start: NDArray[np.float64],
    *,
    max_evaluations: int,
    on_step: Callable[[int, float], None] | None = None,
) -> Descended:
    """Descend from `start`, shape (n_params,), inside `box`, with so many residuals and Jacobians at most.

    Parameters
    ----------
    on_step
        Called with the number of residuals so far and their misfit; not if the descent is recalled from a journal.
    """
    return objective.once(
        "descent",
        Descended,
        lambda: _descended(objective, box, start, max_evaluations, on_step),
        box,
        start,
        max_evaluations,
    )


def _descended(
    objective: Objective,
    box: Box,
    start: NDArray[np.float64],
    max_evaluations: int,
    on_step: Callable[[int, float], None] | None,
) -> Descended:
    from scipy.optimize import least_squares  # slow to load, and no need of plain models

    at = _Linearisations(objective, box, on_step)
    # In coordinates of unit sensitivity from the start on, so that the length of a step is about the change of the
    # residuals that it makes. MINPACK's first step is up to a hundred of its units, which could leave the valley.
    origin = np.asarray(box.latent_from_theta(box.inside(start)))
    sensitivity = np.linalg.norm(at(origin)[1], axis=1)
    scale = 1.0 / np.maximum(sensitivity, 1e-9 * max(float(np.max(sensitivity)), 1e-300))

    def residuals_at(position: NDArray[np.float64]) -> NDArray[np.float64]:
        return at(origin + scale * position)[0]

    def jacobian_at(position: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(at(origin + scale * position)[1].T * scale)

    solution = least_squares(
        residuals_at,
        np.zeros_like(origin),
        jac=jacobian_at,
        method="lm",
        x_scale=_FIRST_STEP / 100.0,
        ftol=_TOLERANCE,
        xtol=_TOLERANCE,
        max_nfev=max_evaluations,
    )
    candidates = np.stack([start, box.theta_from_latent(origin + scale * solution.x)])
    misfits = objective(candidates)
    best = int(np.argmin(misfits))
    return Descended(
        theta=candidates[best],
        misfit=float(misfits[best]),
        evaluations=at.evaluations,
        converged=bool(solution.status > 0),
    )


class _Linearisations:
    """Residuals and their derivative in latent coordinates; asked again for the last place, nothing is simulated."""

    def __init__(self, objective: Objective, box: Box, on_step: Callable[[int, float], None] | None) -> None:
        self.objective = objective
        self.box = box
        self.on_step = on_step
        self.evaluations = 0
        self._known: list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]] = []

    def __call__(self, latent: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Residuals (n_residuals,) and derivative (n_free, n_residuals)."""
        for place, residuals, jacobian in self._known:
            if np.array_equal(place, latent):
                return residuals, jacobian
        theta = np.asarray(self.box.theta_from_latent(latent))
        (residuals,), (jacobian,) = linearised(self.objective, theta[None], self.box.free)
        jacobian *= np.exp(self.box.log_slope(latent))[:, None]
        # The last two: after a step that was no use the method asks for where it was.
        self._known = [(latent.copy(), residuals, jacobian), *self._known[:1]]
        self.evaluations += 1
        if self.on_step is not None:
            self.on_step(self.evaluations, float(np.linalg.norm(residuals)))
        return residuals, jacobian
