"""Levenberg-Marquardt method of optimistix in latent coordinates: a check of the lanes by another minimisation."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from mrwork.base.blas import on_one_blas_thread
from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box
from mrwork.identification.minimise.levenberg_marquardt import LocalMinimum, OnStep
from mrwork.identification.objective import NormalEquations, Objective, once
from mrwork.identification.traced_objective import Residuals, arrays_of
from mrwork.twins.model_twins import on_processor

# Relative and absolute tolerance of the squared misfit and of the coordinates.
_TOLERANCE = 1e-7
_MAX_STEPS = 120


@on_one_blas_thread
@on_processor()
def find_minimum_by_optimistix(
    objective: Objective, box: Box, start: Floats, *, on_step: OnStep | None = None
) -> LocalMinimum:
    """The minimum that is reached from `start`, shape (n_params,), inside `box`; it is not worse than the start.

    `on_step` is called at its end with the number of steps and the misfit; not if it is recalled from a journal.
    """
    return once(
        objective, "refinement", LocalMinimum, lambda: _minimise(objective, box, start, on_step), box, start
    )


def _minimise(objective: Objective, box: Box, start: Floats, on_step: OnStep | None) -> LocalMinimum:
    minimise = _method(Residuals.of(objective, columns=box.free), box)
    origin = np.asarray(box.latent_from_theta(box.inside(start)))
    # Units of the coordinates in which they have equal effects on the residuals, as in Marquardt's scaling.
    every = np.ones((1, len(objective.compared)), dtype=np.bool_)
    equations = NormalEquations.at(objective, box, np.asarray(box.theta_from_latent(origin))[None], every)
    sensitivity = np.sqrt(np.diagonal(equations.joint(objective.shares[None])[1][0]))
    sensitivity = sensitivity * np.exp(box.log_slope(origin))
    scale = 1.0 / np.maximum(sensitivity, 1e-9 * max(float(np.max(sensitivity)), 1e-300))
    position, steps, converged = minimise((jnp.asarray(origin), jnp.asarray(scale), arrays_of(objective)))
    objective.tally.simulations += int(steps)
    candidates = np.stack([start, box.theta_from_latent(origin + scale * np.asarray(position))])
    misfits = objective(candidates)
    best = int(np.argmin(misfits))
    minimum = LocalMinimum(
        theta=candidates[best], misfit=float(misfits[best]), steps=int(steps), converged=bool(converged)
    )
    if on_step is not None:
        on_step(minimum.steps, minimum.misfit)
    return minimum


@cache
def _method(form: Residuals, box: Box) -> Callable[..., Any]:
    """The method compiled for one form of residuals, box and shape of the data."""
    solver: Any = optx.LevenbergMarquardt(rtol=_TOLERANCE, atol=_TOLERANCE)

    def residuals(position: jax.Array, args: Any) -> jax.Array:
        origin, scale, tests = args
        return form(box.theta_from_latent(origin + scale * position), tests)

    @eqx.filter_jit
    def minimise(args: Any) -> Any:
        solution: Any = optx.least_squares(
            residuals, solver, jnp.zeros_like(args[0]), args, max_steps=_MAX_STEPS, throw=False
        )
        return solution.value, solution.stats["num_steps"], solution.result == optx.RESULTS.successful

    return minimise
