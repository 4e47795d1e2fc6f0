"""Levenberg-Marquardt on the JAX twin, in latent coordinates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.identification.objective import Objective
from mrwork.identification.twin_residuals import RecordArrays, TwinResiduals, arrays_of
from mrwork.twins._base import keep_compiled

# A descent has arrived when this many steps together lower the squared misfit by less than this share.
_PATIENCE = 6
_TOLERANCE = 1e-8
_MAX_STEPS = 120
# A solution that asks for other sub-steps than its descent had is descended again with what it asks for.
_ROUNDS = 3

OnStep = Callable[[int, float], None]
_Data = tuple[RecordArrays, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Refined:
    """A local minimum: parameters (n_params,), misfit, steps taken, whether the descent arrived."""

    theta: NDArray[np.float64]
    misfit: float
    steps: int
    converged: bool


def refine(
    objective: Objective, box: Box, start: NDArray[np.float64], *, on_step: OnStep | None = None
) -> Refined:
    """Descend from `start`, shape (n_params,), to a minimum of the misfit.

    The misfit is judged by the Rust core with the sub-steps that its stiffness bound asks for, so a minimum
    never rests on too coarse a step of the twin.

    Parameters
    ----------
    on_step
        Called after every step with the number of steps so far and the misfit; not if the refinement is recalled
        from a journal.
    """
    return objective.once("refinement", Refined, lambda: _refined(objective, box, start, on_step), box, start)


def _refined(objective: Objective, box: Box, start: NDArray[np.float64], on_step: OnStep | None) -> Refined:
    refined = Refined(theta=start, misfit=float(objective(start[None])[0]), steps=0, converged=False)
    for _ in range(_ROUNDS):
        substeps = _substeps(objective, refined.theta)
        refined = _descend(objective, box, refined, substeps, on_step)
        # Fewer would do as well, but move the minimum: it is to be that of the lanes.
        if refined.converged and _substeps(objective, refined.theta) == substeps:
            break
    return refined


def _descend(
    objective: Objective, box: Box, start: Refined, substeps: tuple[int, ...], on_step: OnStep | None
) -> Refined:
    """One descent with fixed sub-steps; never returns anything worse than its start."""
    descent = _descent(TwinResiduals.of(objective), box)
    data = arrays_of(objective, substeps)
    latent = jnp.asarray(box.latent_from_theta(box.inside(start.theta)))
    args = (latent, descent.scale(latent, data), data)
    position = jnp.zeros_like(latent)
    state = descent.init(position, args)
    squared: list[float] = []
    converged = False
    while len(squared) < _MAX_STEPS and not converged:
        position, state, done, value = descent.step(position, args, state)
        squared.append(float(value))
        if on_step is not None:
            on_step(start.steps + len(squared), squared[-1] ** 0.5)
        recent = squared[-_PATIENCE - 1 :]
        stalled = len(recent) > _PATIENCE and recent[0] - recent[-1] <= _TOLERANCE * recent[0]
        converged = bool(done) or stalled
    theta = np.asarray(box.theta_from_latent(latent + args[1] * position))
    misfit = float(objective(theta[None])[0])
    if misfit > start.misfit:
        theta, misfit = start.theta, start.misfit
    return Refined(theta=theta, misfit=misfit, steps=start.steps + len(squared), converged=converged)


def _substeps(objective: Objective, theta: NDArray[np.float64]) -> tuple[int, ...]:
    return tuple(max(1, int(misfits.substeps[0])) for misfits in objective.misfits(theta[None]))


class _Descent(NamedTuple):
    """A compiled Levenberg-Marquardt method for one model, box and shape of the data: the same for other data of it."""

    scale: Callable[[jax.Array, _Data], jax.Array]
    init: Callable[[jax.Array, Any], Any]
    step: Callable[[jax.Array, Any, Any], tuple[jax.Array, Any, jax.Array, jax.Array]]


@cache
def _descent(twin: TwinResiduals, box: Box) -> _Descent:
    keep_compiled()
    method: Any = optx.LevenbergMarquardt(rtol=1e-9, atol=1e-9)
    options = {"jac": "fwd"}
    tags: frozenset[object] = frozenset()

    def residuals(position: jax.Array, args: tuple[jax.Array, jax.Array, _Data]) -> tuple[jax.Array, None]:
        latent, scale, data = args
        return twin(box.theta_from_latent(latent + scale * position), data), None

    @eqx.filter_jit
    def scale(latent: jax.Array, data: _Data) -> jax.Array:
        # Latent coordinates of unit sensitivity, as in Marquardt's own scaling: a stiffness that may span
        # a billion and an exponent between 1 and 6 then take steps of like effect.
        args = (latent, jnp.ones_like(latent), data)
        sensitivity = jax.jacfwd(lambda position: residuals(position, args)[0])(jnp.zeros_like(latent))
        norm = jnp.linalg.norm(sensitivity, axis=0)
        return 1.0 / jnp.maximum(norm, 1e-9 * jnp.max(norm))

    @eqx.filter_jit
    def init(position: jax.Array, args: Any) -> Any:
        f_struct, aux_struct = jax.eval_shape(residuals, position, args)
        return method.init(residuals, position, args, options, f_struct, aux_struct, tags)

    @eqx.filter_jit
    def step(position: jax.Array, args: Any, state: Any) -> tuple[jax.Array, Any, jax.Array, jax.Array]:
        position, state, _ = method.step(residuals, position, args, options, state, tags)
        done, _ = method.terminate(residuals, position, args, options, state, tags)
        return position, state, done, jnp.sum(state.f_info.residual**2)

    return _Descent(scale=scale, init=init, step=step)
