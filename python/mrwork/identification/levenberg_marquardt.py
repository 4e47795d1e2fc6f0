"""Levenberg-Marquardt with exact Jacobians, simulated in lanes: SciPy's from one start, and a batch from many starts.

Residuals and Jacobian come from one simulation, which takes a quarter longer than one of the residuals alone. One
simulation of a few candidates takes as long as one of about fifty, because the time steps of a record are sequential.
The batch therefore simulates the Jacobians of all starts together, and also all trial steps, several of different
damping for each start.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.identification.linearisation import linearised
from mrwork.identification.objective import Objective

# Convergence: the share by which squared misfits still fall; for SciPy also the relative length of a step.
_TOLERANCE = 1e-7
# SciPy's longest first step, in root sum of squares of the normalised residuals.
_FIRST_STEP = 0.3
# Of the batch: rows whose Jacobians are held in memory at once.
_ROWS = 16
# Floor for insensitive parameters; keeps the normal matrix non-singular.
_LEAST_SENSITIVITY = 1e-150
# Factors on the present damping that are tried together.
_LADDER = (0.1, 1.0, 10.0)
_FIRST_DAMPING = 0.1
# With more damping steps are too short to lower the misfit: the descent has converged.
_MOST_DAMPING = 1e8


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalMinimum:
    """End of a descent: parameters (n_params,), misfit, number of residuals computed, whether it converged."""

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
) -> LocalMinimum:
    """Minimise from `start`, shape (n_params,), inside `box`, by the Levenberg-Marquardt method of SciPy.

    Parameters
    ----------
    max_evaluations
        Largest number of residuals with their Jacobians.
    on_step
        Called with the number of residuals so far and their misfit; not if the descent is recalled from a journal.
    """
    return objective.once(
        "descent",
        LocalMinimum,
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
) -> LocalMinimum:
    from scipy.optimize import least_squares  # slow to load, and not needed for plain models

    at = _Linearisations(objective, box, on_step)
    # Coordinates are scaled to unit sensitivity at the start, so that the length of a step is about the change of the
    # residuals. MINPACK's first step is up to a hundred of its units, which could leave the basin of the minimum.
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
    return LocalMinimum(
        theta=candidates[best],
        misfit=float(misfits[best]),
        evaluations=at.evaluations,
        converged=bool(solution.status > 0),
    )


class _Linearisations:
    """Residuals and their derivative in latent coordinates; those of the last two points are kept."""

    def __init__(self, objective: Objective, box: Box, on_step: Callable[[int, float], None] | None) -> None:
        self.objective = objective
        self.box = box
        self.on_step = on_step
        self.evaluations = 0
        self._known: list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]] = []

    def __call__(self, latent: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Residuals (n_residuals,) and derivative (n_free, n_residuals)."""
        for known, residuals, jacobian in self._known:
            if np.array_equal(known, latent):
                return residuals, jacobian
        theta = np.asarray(self.box.theta_from_latent(latent))
        (residuals,), (jacobian,) = linearised(self.objective, theta[None], self.box.free)
        jacobian *= np.exp(self.box.log_slope(latent))[:, None]
        # Two, because after a rejected step the method asks for the point before it.
        self._known = [(latent.copy(), residuals, jacobian), *self._known[:1]]
        self.evaluations += 1
        if self.on_step is not None:
            self.on_step(self.evaluations, float(np.linalg.norm(residuals)))
        return residuals, jacobian


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalMinima:
    """Ends of several descents: parameters (n_starts, n_params), misfits (n_starts,), which converged, iterations."""

    theta: NDArray[np.float64]
    misfit: NDArray[np.float64]
    arrived: NDArray[np.bool_]
    iterations: int


def descend_all(
    objective: Objective,
    box: Box,
    starts: NDArray[np.float64],
    *,
    max_iterations: int,
    on_iteration: Callable[[LocalMinima], None] | None = None,
) -> LocalMinima:
    """Minimise from every start, shape (n_starts, n_params), inside `box`, by the batched Levenberg-Marquardt method.

    Damping is relative to the sensitivity of each parameter, the largest so far (Moré, Lecture Notes in Mathematics
    630, 1978, 105-116). The result of a start does not depend on the other starts.

    Parameters
    ----------
    on_iteration
        Called after each iteration with the present points of the descents.
    """
    state = _begun(objective, box, starts)
    iterations = 0
    while iterations < max_iterations and state.running.any():
        iterations += 1
        state = _recorded_iteration(objective, box, state)
        if on_iteration is not None:
            on_iteration(_minima(box, state, iterations))
    return _minima(box, state, iterations)


@dataclass(frozen=True, slots=True, kw_only=True)
class _State:
    """State of the descents, one row each; `normal` and `gradient` are those at the last accepted point."""

    latent: NDArray[np.float64]
    misfit: NDArray[np.float64]
    damping: NDArray[np.float64]
    sensitivity: NDArray[np.float64]
    normal: NDArray[np.float64]
    gradient: NDArray[np.float64]
    moved: NDArray[np.bool_]
    arrived: NDArray[np.bool_]
    running: NDArray[np.bool_]


def _begun(objective: Objective, box: Box, starts: NDArray[np.float64]) -> _State:
    latent = np.asarray(box.latent_from_theta(box.inside(starts)))
    misfit = objective(np.asarray(box.theta_from_latent(latent)))
    n_starts, n_free = latent.shape
    return _State(
        latent=latent,
        misfit=misfit,
        damping=np.full(n_starts, _FIRST_DAMPING),
        sensitivity=np.zeros((n_starts, n_free)),
        normal=np.zeros((n_starts, n_free, n_free)),
        gradient=np.zeros((n_starts, n_free)),
        moved=np.ones(n_starts, dtype=np.bool_),
        arrived=np.zeros(n_starts, dtype=np.bool_),
        running=np.isfinite(misfit),
    )


def _recorded_iteration(objective: Objective, box: Box, state: _State) -> _State:
    return objective.once(
        "iteration",
        _State,
        lambda: _iteration(objective, box, state),
        box,
        state.latent,
        state.misfit,
        state.damping,
        state.running,
    )


def _iteration(objective: Objective, box: Box, state: _State) -> _State:
    """Linearise the descents that have moved, then try several dampings for every running descent."""
    latent, misfit, damping = state.latent.copy(), state.misfit.copy(), state.damping.copy()
    sensitivity, normal, gradient = state.sensitivity.copy(), state.normal.copy(), state.gradient.copy()
    moved, arrived, running = state.moved.copy(), state.arrived.copy(), state.running.copy()
    fresh = np.flatnonzero(running & moved)
    for index, residuals, jacobian in _linearised(objective, box, latent, fresh):
        sensitivity[index] = np.maximum(sensitivity[index], np.linalg.norm(jacobian, axis=1))
        normal[index] = jacobian @ jacobian.T
        gradient[index] = jacobian @ residuals
    active = np.flatnonzero(running)
    floor = 1e-9 * sensitivity[active].max(axis=1, keepdims=True)
    weight = np.maximum(sensitivity[active], np.maximum(floor, _LEAST_SENSITIVITY)) ** 2
    ladder = damping[active, None] * np.array(_LADDER)
    # (active, rung, free, free)
    damped = normal[active, None] + ladder[..., None, None] * (
        weight[:, None, :, None] * np.eye(latent.shape[1])
    )
    step = -np.linalg.solve(damped, gradient[active, None, :, None])[..., 0]
    tried = latent[active, None] + step
    before = misfit[active]
    theta = np.asarray(box.theta_from_latent(tried))
    after = objective(theta.reshape(-1, theta.shape[-1]), np.repeat(before, len(_LADDER)))
    after = after.reshape(-1, len(_LADDER))
    rung = np.argmin(after, axis=1)
    each = np.arange(active.size)
    better = after[each, rung] < before
    moved[active] = better
    winners = active[better]
    latent[winners] = tried[each, rung][better]
    misfit[winners] = after[each, rung][better]
    # A third of the damping that was best; above all that were tried where none lowered the misfit.
    factor = np.where(better, np.array(_LADDER)[rung] / 3.0, 100.0)
    damping[active] = np.maximum(damping[active] * factor, 1e-12)
    fall = 1.0 - (misfit[active] / before) ** 2
    arrived[active] = np.where(better, fall < _TOLERANCE, damping[active] > _MOST_DAMPING)
    running[active] = ~arrived[active]
    return _State(
        latent=latent,
        misfit=misfit,
        damping=damping,
        sensitivity=sensitivity,
        normal=normal,
        gradient=gradient,
        moved=moved,
        arrived=arrived,
        running=running,
    )


def _minima(box: Box, state: _State, iterations: int) -> LocalMinima:
    return LocalMinima(
        theta=np.asarray(box.theta_from_latent(state.latent)),
        misfit=state.misfit,
        arrived=state.arrived,
        iterations=iterations,
    )


def _linearised(
    objective: Objective, box: Box, latent: NDArray[np.float64], rows: NDArray[np.intp]
) -> Iterator[tuple[int, NDArray[np.float64], NDArray[np.float64]]]:
    """Residuals (n_residuals,) and their derivative (n_free, n_residuals) at these rows of `latent`, one at a time."""
    for at in range(0, len(rows), _ROWS):
        some = rows[at : at + _ROWS]
        theta = np.asarray(box.theta_from_latent(latent[some]))
        slope = np.exp(box.log_slope(latent[some]))
        residuals, jacobian = linearised(objective, theta, box.free)
        jacobian *= slope[..., None]
        yield from zip(some.tolist(), residuals, jacobian, strict=True)
