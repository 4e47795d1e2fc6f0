"""Levenberg-Marquardt method on the JAX twin, in latent coordinates."""

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

from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec
from mrwork.identification.minimise.levenberg_marquardt import LocalMinimum, check_recalled_minimum
from mrwork.identification.objective import Objective
from mrwork.identification.residual import NuisanceName, columns_of, scale_columns
from mrwork.records import DamperTest
from mrwork.records.damper_test import loading_of
from mrwork.twins.models import begin, simulate


class RecordArrays(NamedTuple):
    """One test: sampling step [s], motion at the stage times, command [A or V], measured force [N], weight.

    The command has shape (), or (n_time,) in every test if it varies in any. With these weights the sum of squared
    residuals of all tests is the squared misfit.
    """

    dt: jax.Array
    motion: jax.Array
    command: jax.Array
    force: jax.Array
    weight: jax.Array


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinResiduals:
    """Static inputs of the residuals; equal values share one compilation.

    `counted` are the samples of each test that are compared: all from the first on, or each by its number.
    """

    spec: DamperSpec
    counted: tuple[int | tuple[int, ...], ...]
    nuisances: tuple[NuisanceName, ...]
    power: float

    @classmethod
    def of(cls, objective: Objective) -> TwinResiduals:
        """The twin's form of `objective.residuals`."""
        objective.refuse_observation()
        return cls(
            spec=objective.spec,
            counted=tuple(_select_counted(test) for test in objective.tests),
            nuisances=objective.settings.nuisances,
            power=objective.settings.power,
        )

    def __call__(self, theta: jax.Array, tests: tuple[RecordArrays, ...]) -> jax.Array:
        """Residuals, shape (n_residuals,), of one set of parameters, (n_params,); 1 where they are not finite."""
        compared = [
            force[counted:] if isinstance(counted, int) else force[jnp.array(counted)]
            for force, counted in zip(self._forces(theta, tests), self.counted, strict=True)
        ]
        parts = [
            _without_nuisance(force, force - test.force, self.nuisances) * test.weight
            for force, test in zip(compared, tests, strict=True)
        ]
        if self.power != 2.0:
            squared = len(parts) * jnp.array([jnp.sum(part**2) for part in parts])
            misfit = jnp.mean(squared ** (self.power / 2.0)) ** (1.0 / self.power)
            factors = (jnp.sqrt(squared) / misfit) ** (self.power / 2.0 - 1.0)
            parts = [factor * part for factor, part in zip(factors, parts, strict=True)]
        residuals = jnp.concatenate(parts)
        # With these values a step to unstable parameters raises the misfit and is rejected.
        return jnp.where(jnp.isfinite(residuals), residuals, 1.0)

    def _forces(self, theta: jax.Array, tests: tuple[RecordArrays, ...]) -> list[jax.Array]:
        """Force of each test, (n_time,); equal sub-steps share one scan, because thirty take minutes to compile."""
        forces: dict[int, jax.Array] = {}
        for n_stages in sorted({test.motion.shape[1] for test in tests}):
            own = {index: test for index, test in enumerate(tests) if test.motion.shape[1] == n_stages}
            longest = max(len(test.motion) for test in own.values())
            force = jax.vmap(lambda *test: simulate(self.spec, theta, *test))(
                jnp.stack([_lengthen_motion(test.motion, longest) for test in own.values()]),
                jnp.stack([test.dt for test in own.values()]),
                jnp.stack([_extend_command(test.command, longest + 1) for test in own.values()]),
            )
            for row, (index, test) in enumerate(own.items()):
                forces[index] = force[row, : len(test.motion) + 1]
        return [forces[index] for index in range(len(tests))]


def _select_counted(test: DamperTest) -> int | tuple[int, ...]:
    """The samples that are compared, as a value that a compilation can depend on."""
    counted = test.counted
    return counted.start if isinstance(counted, slice) else tuple(counted.tolist())


def arrays_of(objective: Objective, substeps: tuple[int, ...]) -> tuple[RecordArrays, ...]:
    """The tests of an objective as arrays of the twin, each with its number of sub-steps."""
    commands = [loading_of(each.test, objective.spec).command for each in objective.compared]
    varying = any(isinstance(command, np.ndarray) for command in commands)
    entries = []
    for each, command, count in zip(objective.compared, commands, substeps, strict=True):
        received = jnp.asarray(0.0 if command is None else command)
        entries.append(
            RecordArrays(
                dt=jnp.asarray(each.test.dt),
                motion=jnp.asarray(each.history.stages(count)),
                command=jnp.broadcast_to(received, (each.test.n_time,)) if varying else received,
                force=jnp.asarray(each.measured),
                weight=jnp.asarray(each.weight(len(objective.compared))),
            )
        )
    return tuple(entries)


def _lengthen_motion(motion: jax.Array, n_steps: int) -> jax.Array:
    """A motion, (n, n_stages, 2), extended by its last point; the forces there are discarded."""
    end = jnp.broadcast_to(motion[-1, -1], (n_steps - len(motion), *motion.shape[1:]))
    return jnp.concatenate([motion, end])


def _extend_command(command: jax.Array, n_time: int) -> jax.Array:
    """A command of shape () as it is, one of shape (n,) extended to (n_time,) by its last sample."""
    return command if command.ndim == 0 else jnp.pad(command, (0, n_time - len(command)), mode="edge")


def _without_nuisance(force: jax.Array, residuals: jax.Array, names: tuple[NuisanceName, ...]) -> jax.Array:
    """Residuals (n_counted,) with the nuisance parameters at their best values, as `residual.without_nuisance`."""
    if not names:
        return residuals
    unit: jax.Array = scale_columns(columns_of(force, names))[0]
    return residuals - (jnp.linalg.pinv(unit @ unit.T) @ (unit @ residuals)) @ unit


# The minimisation has converged when this number of steps together lowers the squared misfit by less than this share.
_PATIENCE = 6
_TOLERANCE = 1e-8
_MAX_STEPS = 120
# Largest number of minimisations: one is repeated if its minimum needs other numbers of sub-steps than it used.
_ROUNDS = 3

OnStep = Callable[[int, float], None]
_Data = tuple[RecordArrays, ...]


def find_minimum_on_twin(
    objective: Objective, box: Box, start: Floats, *, on_step: OnStep | None = None
) -> LocalMinimum:
    """The minimum that is reached from `start`, shape (n_params,), inside `box`, on the twin.

    The misfit of the result is that of the Rust core, with the numbers of sub-steps that the stiffness bound requires.
    Where these differ from those of the minimisation, it is repeated with them. Evaluations are steps; `on_step` is
    as in `find_minimum`.
    """
    minimum = objective.once(
        "refinement", LocalMinimum, lambda: _minimise_on_twin(objective, box, start, on_step), box, start
    )
    check_recalled_minimum(minimum.theta, box, start)
    return minimum


def _minimise_on_twin(objective: Objective, box: Box, start: Floats, on_step: OnStep | None) -> LocalMinimum:
    begin()
    misfit = float(objective(start[None])[0])
    minimum = LocalMinimum(theta=start, misfit=misfit, evaluations=0, converged=False)
    for _ in range(_ROUNDS):
        substeps = _substeps(objective, minimum.theta)
        minimum = _minimise_with_substeps(objective, box, minimum, substeps, on_step)
        # Fewer sub-steps would suffice too, but the minimum would differ from that of the lanes.
        if minimum.converged and _substeps(objective, minimum.theta) == substeps:
            break
    return minimum


def _minimise_with_substeps(
    objective: Objective, box: Box, start: LocalMinimum, substeps: tuple[int, ...], on_step: OnStep | None
) -> LocalMinimum:
    """One minimisation with fixed sub-steps; the result is not worse than the start."""
    method = _method(TwinResiduals.of(objective), box)
    data = arrays_of(objective, substeps)
    latent = jnp.asarray(box.latent_from_theta(box.inside(start.theta)))
    args = (latent, method.scale(latent, data), data)
    position = jnp.zeros_like(latent)
    state = method.init(position, args)
    squared: list[float] = []
    converged = False
    while len(squared) < _MAX_STEPS and not converged:
        position, state, done, value = method.step(position, args, state)
        squared.append(float(value))
        if on_step is not None:
            on_step(start.evaluations + len(squared), squared[-1] ** 0.5)
        recent = squared[-_PATIENCE - 1 :]
        stalled = len(recent) > _PATIENCE and recent[0] - recent[-1] <= _TOLERANCE * recent[0]
        converged = bool(done) or stalled
    theta = np.asarray(box.theta_from_latent(latent + args[1] * position))
    misfit = float(objective(theta[None])[0])
    if misfit > start.misfit:
        theta, misfit = start.theta, start.misfit
    evaluations = start.evaluations + len(squared)
    return LocalMinimum(theta=theta, misfit=misfit, evaluations=evaluations, converged=converged)


def _substeps(objective: Objective, theta: Floats) -> tuple[int, ...]:
    return tuple(max(1, int(misfits.substeps[0])) for misfits in objective.misfits(theta[None]))


class _Method(NamedTuple):
    """A Levenberg-Marquardt method compiled for one model, box and shape of the data."""

    scale: Callable[[jax.Array, _Data], jax.Array]
    init: Callable[[jax.Array, Any], Any]
    step: Callable[[jax.Array, Any, Any], tuple[jax.Array, Any, jax.Array, jax.Array]]


@cache
def _method(twin: TwinResiduals, box: Box) -> _Method:
    solver: Any = optx.LevenbergMarquardt(rtol=1e-9, atol=1e-9)
    options = {"jac": "fwd"}
    tags: frozenset[object] = frozenset()

    def residuals(position: jax.Array, args: tuple[jax.Array, jax.Array, _Data]) -> tuple[jax.Array, None]:
        latent, scale, data = args
        return twin(box.theta_from_latent(latent + scale * position), data), None

    @eqx.filter_jit
    def scale(latent: jax.Array, data: _Data) -> jax.Array:
        # Scale to unit sensitivity, as in Marquardt's scaling: steps then have similar effects along parameters with
        # ranges of very different width.
        args = (latent, jnp.ones_like(latent), data)
        sensitivity = jax.jacfwd(lambda position: residuals(position, args)[0])(jnp.zeros_like(latent))
        norm = jnp.linalg.norm(sensitivity, axis=0)
        return 1.0 / jnp.maximum(norm, 1e-9 * jnp.max(norm))

    @eqx.filter_jit
    def init(position: jax.Array, args: Any) -> Any:
        f_struct, aux_struct = jax.eval_shape(residuals, position, args)
        return solver.init(residuals, position, args, options, f_struct, aux_struct, tags)

    @eqx.filter_jit
    def step(position: jax.Array, args: Any, state: Any) -> tuple[jax.Array, Any, jax.Array, jax.Array]:
        position, state, _ = solver.step(residuals, position, args, options, state, tags)
        done, _ = solver.terminate(residuals, position, args, options, state, tags)
        return position, state, done, jnp.sum(state.f_info.residual**2)

    return _Method(scale=scale, init=init, step=step)
