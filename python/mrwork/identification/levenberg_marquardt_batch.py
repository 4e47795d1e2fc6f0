"""Levenberg-Marquardt from many starts side by side, simulated in lanes.

One simulation of a few candidates takes as long as one of some fifty: the steps of a record follow one another. So the
exact Jacobians of all starts are one batch, and so are all steps they try, several of different damping for each start.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.identification.linearisation import linearised
from mrwork.identification.objective import Objective

# Squared misfits that fall by less than this share have arrived.
_TOLERANCE = 1e-7
# Jacobians held in memory at once.
_ROWS = 16
# Of a parameter that the residuals do not feel: its square is still a number, so the system stays regular.
_LEAST_SENSITIVITY = 1e-150
# Times the present damping, all tried at once.
_LADDER = (0.1, 1.0, 10.0)
_FIRST_DAMPING = 0.1
# Where even so short a step leads nowhere, there is nowhere to go.
_MOST_DAMPING = 1e8


@dataclass(frozen=True, slots=True, kw_only=True)
class Minima:
    """Where the starts led: parameters (n_starts, n_params), misfits (n_starts,), which descents arrived, and when."""

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
    on_iteration: Callable[[Minima], None] | None = None,
) -> Minima:
    """Descend from every start, shape (n_starts, n_params), inside `box`.

    Damping is relative to the sensitivity of each parameter, the largest that the descent has met (Moré, Lecture Notes
    in Mathematics 630, 1978, 105-116). A descent depends on its own start alone.

    Parameters
    ----------
    on_iteration
        Called after each iteration with how far the descents have come.
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
    """Descents under way, one for each row; `normal` and `gradient` belong to where each moved last."""

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
    """Linearise the descents that have moved, then try steps of several lengths for all that run."""
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
    # The rung that won, eased; or beyond the ladder where none did.
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


def _minima(box: Box, state: _State, iterations: int) -> Minima:
    return Minima(
        theta=np.asarray(box.theta_from_latent(state.latent)),
        misfit=state.misfit,
        arrived=state.arrived,
        iterations=iterations,
    )


def _linearised(
    objective: Objective, box: Box, latent: NDArray[np.float64], rows: NDArray[np.intp]
) -> Iterator[tuple[int, NDArray[np.float64], NDArray[np.float64]]]:
    """Residuals (n_residuals,) and their derivative (n_free, n_residuals) at these rows of `latent`, in turn."""
    for at in range(0, len(rows), _ROWS):
        some = rows[at : at + _ROWS]
        theta = np.asarray(box.theta_from_latent(latent[some]))
        slope = np.exp(box.log_slope(latent[some]))
        residuals, jacobian = linearised(objective, theta, box.free)
        jacobian *= slope[..., None]
        yield from zip(some.tolist(), residuals, jacobian, strict=True)
