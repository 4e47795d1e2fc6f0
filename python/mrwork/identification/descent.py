"""Levenberg-Marquardt with the Jacobian by central differences, simulated in lanes.

A Jacobian costs one batch of two candidates per parameter, a few milliseconds where the twin takes a hundred.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from mrwork.coordinates import Box
from mrwork.identification.objective import Objective

# Of the size of a parameter, or of the width it was searched over: rounding and curvature both stay below 1e-8.
_STEP = 1e-6
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
    searched: Box,
    start: NDArray[np.float64],
    *,
    max_evaluations: int,
    on_step: Callable[[int, float], None] | None = None,
) -> Descended:
    """Descend from `start`, shape (n_params,), inside `box`, with so many residuals and Jacobians at most.

    Parameters
    ----------
    searched
        The narrower box of the search, which gives each parameter a scale.
    on_step
        Called with the number of residuals so far and their misfit; not if the descent is recalled from a journal.
    """
    return objective.once(
        "descent",
        Descended,
        lambda: _descended(objective, box, searched, start, max_evaluations, on_step),
        box,
        searched,
        start,
        max_evaluations,
    )


def _descended(
    objective: Objective,
    box: Box,
    searched: Box,
    start: NDArray[np.float64],
    max_evaluations: int,
    on_step: Callable[[int, float], None] | None,
) -> Descended:
    steps = 0

    def residuals(latent: NDArray[np.float64]) -> NDArray[np.float64]:
        nonlocal steps
        found = np.asarray(objective.residuals(box.theta_from_latent(latent)[None])[0])
        steps += 1
        if on_step is not None:
            on_step(steps, float(np.linalg.norm(found)))
        return found

    def jacobian(latent: NDArray[np.float64]) -> NDArray[np.float64]:
        theta = box.theta_from_latent(latent)
        slope = np.asarray(np.exp(box.log_slope(latent)))
        return np.asarray(difference_quotient(objective, box, theta, searched) * slope)

    # In coordinates of unit sensitivity from the start on, so that the length of a step is about the change of the
    # residuals that it makes. MINPACK's first step is up to a hundred of its units, which could leave the valley.
    origin = np.asarray(box.latent_from_theta(box.inside(start)))
    sensitivity = np.linalg.norm(jacobian(origin), axis=0)
    scale = 1.0 / np.maximum(sensitivity, 1e-9 * max(float(np.max(sensitivity)), 1e-300))

    def residuals_at(position: NDArray[np.float64]) -> NDArray[np.float64]:
        return residuals(origin + scale * position)

    def jacobian_at(position: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(jacobian(origin + scale * position) * scale)

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
        evaluations=steps,
        converged=bool(solution.status > 0),
    )


def difference_quotient(
    objective: Objective, box: Box, theta: NDArray[np.float64], searched: Box
) -> NDArray[np.float64]:
    """Derivative of the residuals with respect to the free parameters, shape (n_residuals, n_free)."""
    free = np.array(box.free)
    width = np.array(searched.upper) - np.array(searched.lower)
    step = _STEP * np.where(np.array(box.log), theta, np.maximum(np.abs(theta), width))[free]
    offsets = np.zeros((len(free), len(theta)))
    offsets[np.arange(len(free)), free] = step
    ahead, behind = np.split(objective.residuals(np.concatenate([theta + offsets, theta - offsets])), 2)
    return np.asarray(((ahead - behind) / (2.0 * step[:, None])).T)
