"""Least squares from each start of a search, with the Jacobian by central differences simulated in lanes.

A Jacobian costs one batch of two candidates per parameter, a few milliseconds where the twin takes a hundred; so all
starts can be brought close to their minima, and only the best are finished with exact derivatives.
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
_FIRST_EVALUATIONS = 15
_SEMIFINALISTS = 4
_LAST_EVALUATIONS = 60
_CLOSE = 0.01
_ELSEWHERE = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Screened:
    """Where a start led: parameters (n_params,) and their misfit."""

    theta: NDArray[np.float64]
    misfit: float


def best_few(
    objective: Objective,
    box: Box,
    searched: Box,
    starts: NDArray[np.float64],
    *,
    mirrored: tuple[int, ...],
    on_start: Callable[[Screened, float], None],
) -> list[Screened]:
    """Descend a little from every start, shape (n_starts, n_params), and to the end from the best of them.

    Returns one or two minima, best first: a second one only if it is as good within 1 % and lies elsewhere.

    Parameters
    ----------
    mirrored
        Parameters whose signs can be changed together with little effect, but through a barrier that no
        descent crosses; the best minimum is tried again from its mirror image.
    on_start
        Called after every descent with the best so far and the share of the work done.
    """
    done = 0
    total = len(starts) + min(_SEMIFINALISTS, len(starts)) + bool(mirrored)
    found: list[Screened] = []

    def descend(start: NDArray[np.float64], max_evaluations: int) -> Screened:
        nonlocal done
        screened = screen(objective, box, searched, start, max_evaluations=max_evaluations)
        found.append(screened)
        done += 1
        on_start(min(found, key=_misfit), done / total)
        return screened

    first = sorted((descend(start, _FIRST_EVALUATIONS) for start in starts), key=_misfit)
    last = sorted((descend(each.theta, _LAST_EVALUATIONS) for each in first[:_SEMIFINALISTS]), key=_misfit)
    if mirrored:
        image = last[0].theta.copy()
        image[list(mirrored)] *= -1.0
        last = sorted([*last, descend(image, _LAST_EVALUATIONS)], key=_misfit)
    best = last[0]
    others = [
        each
        for each in last[1:]
        if each.misfit <= (1.0 + _CLOSE) * best.misfit
        and np.abs(box.unit_from_theta(each.theta) - box.unit_from_theta(best.theta)).max() > _ELSEWHERE
    ]
    return [best, *others[:1]]


def _misfit(screened: Screened) -> float:
    return screened.misfit


def screen(
    objective: Objective, box: Box, searched: Box, start: NDArray[np.float64], *, max_evaluations: int
) -> Screened:
    """Descend from `start`, shape (n_params,), inside `box`, with so many residuals and Jacobians at most.

    Parameters
    ----------
    searched
        The narrower box of the search, which gives each parameter a scale.
    """
    free = np.array(box.free)
    width = np.array(searched.upper) - np.array(searched.lower)
    log = np.array(box.log)

    def residuals(latent: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(objective.residuals(box.theta_from_latent(latent)[None])[0])

    def jacobian(latent: NDArray[np.float64]) -> NDArray[np.float64]:
        theta = box.theta_from_latent(latent)
        step = _STEP * np.where(log, theta, np.maximum(np.abs(theta), width))[free]
        offsets = np.zeros((len(free), len(theta)))
        offsets[np.arange(len(free)), free] = step
        ahead, behind = np.split(objective.residuals(np.concatenate([theta + offsets, theta - offsets])), 2)
        slope = np.exp(box.log_slope(latent))
        return np.asarray(((ahead - behind) / (2.0 * step[:, None]) * slope[:, None]).T)

    solution = least_squares(
        residuals,
        box.latent_from_theta(box.inside(start)),
        jac=jacobian,
        method="lm",
        x_scale="jac",
        ftol=_TOLERANCE,
        xtol=_TOLERANCE,
        max_nfev=max_evaluations,
    )
    theta = box.theta_from_latent(solution.x)
    candidates = np.stack([start, theta])
    misfits = objective(candidates)
    best = int(np.argmin(misfits))
    return Screened(theta=candidates[best], misfit=float(misfits[best]))
