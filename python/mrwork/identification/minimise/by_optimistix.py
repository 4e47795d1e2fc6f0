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
from mrwork.identification.minimise.levenberg_marquardt import LocalMinimum
from mrwork.identification.objective import NormalEquations, Objective
from mrwork.identification.traced import Residuals, arrays_of
from mrwork.twins.models import on_processor

# The minimisation has converged when this number of steps together lowers the squared misfit by less than this share.
_PATIENCE = 6
_TOLERANCE = 1e-8
_MAX_STEPS = 120

OnStep = Callable[[int, float], None]


@on_one_blas_thread
@on_processor()
def find_minimum_by_optimistix(
    objective: Objective, box: Box, start: Floats, *, on_step: OnStep | None = None
) -> LocalMinimum:
    """The minimum that is reached from `start`, shape (n_params,), inside `box`; it is not worse than the start.

    `on_step` is called with the number of steps and the misfit; not if the result is recalled from a journal.
    """
    return objective.once(
        "refinement", LocalMinimum, lambda: _minimise(objective, box, start, on_step), box, start
    )


def _minimise(objective: Objective, box: Box, start: Floats, on_step: OnStep | None) -> LocalMinimum:
    begin, advance = _method(Residuals.of(objective, columns=box.free, substeps=None, threads=1), box)
    origin = np.asarray(box.latent_from_theta(box.inside(start)))
    # Units of the coordinates in which they have equal effects on the residuals, as in Marquardt's scaling.
    every = np.ones((1, len(objective.compared)), dtype=np.bool_)
    equations = NormalEquations.at(objective, box, origin[None], every)
    sensitivity = np.sqrt(np.diagonal(equations.joint(objective.shares[None])[1][0]))
    scale = 1.0 / np.maximum(sensitivity, 1e-9 * max(float(np.max(sensitivity)), 1e-300))
    args = (jnp.asarray(origin), jnp.asarray(scale), arrays_of(objective))
    position = jnp.zeros_like(args[0])
    state = begin(position, args)
    squared: list[float] = []
    converged = False
    while len(squared) < _MAX_STEPS and not converged:
        position, state, done, value = advance(position, args, state)
        squared.append(float(value))
        objective.tally.simulations += 1
        if on_step is not None:
            on_step(len(squared), squared[-1] ** 0.5)
        recent = squared[-_PATIENCE - 1 :]
        stalled = len(recent) > _PATIENCE and recent[0] - recent[-1] <= _TOLERANCE * recent[0]
        converged = bool(done) or stalled
    candidates = np.stack([start, box.theta_from_latent(origin + scale * np.asarray(position))])
    misfits = objective(candidates)
    best = int(np.argmin(misfits))
    return LocalMinimum(
        theta=candidates[best], misfit=float(misfits[best]), steps=len(squared), converged=converged
    )


@cache
def _method(form: Residuals, box: Box) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Functions that begin and advance a method compiled for one form of residuals, box and shape of the data."""
    solver: Any = optx.LevenbergMarquardt(rtol=1e-9, atol=1e-9)
    options: dict[str, object] = {}
    tags: frozenset[object] = frozenset()

    def residuals(position: jax.Array, args: Any) -> tuple[jax.Array, None]:
        origin, scale, tests = args
        return form(box.theta_from_latent(origin + scale * position), tests), None

    @eqx.filter_jit
    def init(position: jax.Array, args: Any) -> Any:
        f_struct, aux_struct = jax.eval_shape(residuals, position, args)
        return solver.init(residuals, position, args, options, f_struct, aux_struct, tags)

    @eqx.filter_jit
    def step(position: jax.Array, args: Any, state: Any) -> tuple[jax.Array, Any, jax.Array, jax.Array]:
        position, state, _ = solver.step(residuals, position, args, options, state, tags)
        done, _ = solver.terminate(residuals, position, args, options, state, tags)
        return position, state, done, jnp.sum(state.f_info.residual**2)

    return init, step
