"""Residuals of an objective once more on the JAX twin, so that they can be differentiated there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from mrwork.dampers.spec import DamperSpec
from mrwork.identification.nuisance import NuisanceName
from mrwork.identification.objective import Objective
from mrwork.simulate import loading_of
from mrwork.twins._base import simulate


class RecordArrays(NamedTuple):
    """One test: sampling step [s], motion at the stage times, command [A or V], measured force [N], its weight.

    The weight makes the sum of squared residuals of all tests the squared misfit.
    """

    dt: jax.Array
    motion: jax.Array
    command: jax.Array
    force: jax.Array
    weight: jax.Array


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinResiduals:
    """What residuals follow from beside parameters and arrays; two that are equal share what was compiled.

    `n_settle` are the samples of each test that do not count.
    """

    spec: DamperSpec
    n_settle: tuple[int, ...]
    nuisances: tuple[NuisanceName, ...]
    power: float

    @classmethod
    def of(cls, objective: Objective) -> TwinResiduals:
        """Those of `objective.residuals`.

        Raises
        ------
        SettingError
            Where a test has an observation model: the twin has none.
        """
        objective.refuse_observation()
        return cls(
            spec=objective.spec,
            n_settle=tuple(test.n_settle for test in objective.tests),
            nuisances=objective.nuisances,
            power=objective.power,
        )

    def __call__(self, theta: jax.Array, tests: tuple[RecordArrays, ...]) -> jax.Array:
        """Residuals of one set of parameters, (n_params,), shape (n_residuals,); one where they are not finite."""
        parts = [
            _without_nuisance(force[n_settle:], force[n_settle:] - test.force, self.nuisances) * test.weight
            for force, test, n_settle in zip(self._forces(theta, tests), tests, self.n_settle, strict=True)
        ]
        if self.power != 2.0:
            squared = len(parts) * jnp.array([jnp.sum(part**2) for part in parts])
            misfit = jnp.mean(squared ** (self.power / 2.0)) ** (1.0 / self.power)
            factors = (jnp.sqrt(squared) / misfit) ** (self.power / 2.0 - 1.0)
            parts = [factor * part for factor, part in zip(factors, parts, strict=True)]
        residuals = jnp.concatenate(parts)
        # A step into the unstable is then a bad step, to be taken back, and not the end of the arithmetic.
        return jnp.where(jnp.isfinite(residuals), residuals, 1.0)

    def _forces(self, theta: jax.Array, tests: tuple[RecordArrays, ...]) -> list[jax.Array]:
        """Force of each test, (n_time,); tests of equal sub-steps are one scan, for thirty take minutes to compile."""
        forces: dict[int, jax.Array] = {}
        for n_stages in sorted({test.motion.shape[1] for test in tests}):
            own = {index: test for index, test in enumerate(tests) if test.motion.shape[1] == n_stages}
            longest = max(len(test.motion) for test in own.values())
            found = jax.vmap(lambda *test: simulate(self.spec, theta, *test))(
                jnp.stack([_lengthened(test.motion, longest) for test in own.values()]),
                jnp.stack([test.dt for test in own.values()]),
                jnp.stack([test.command for test in own.values()]),
            )
            for row, (index, test) in enumerate(own.items()):
                forces[index] = found[row, : len(test.motion) + 1]
        return [forces[index] for index in range(len(tests))]


def arrays_of(objective: Objective, substeps: tuple[int, ...]) -> tuple[RecordArrays, ...]:
    """What the tests of an objective give the twin, with so many sub-steps each."""
    entries = []
    for each, count in zip(objective.compared, substeps, strict=True):
        command = loading_of(each.test, objective.spec).command
        entries.append(
            RecordArrays(
                dt=jnp.asarray(each.test.dt),
                motion=jnp.asarray(each.history.stages(count)),
                command=jnp.asarray(0.0 if command is None else command),
                force=jnp.asarray(each.measured),
                weight=jnp.asarray(each.weight(len(objective.compared))),
            )
        )
    return tuple(entries)


def _lengthened(motion: jax.Array, n_steps: int) -> jax.Array:
    """A motion, (n, n_stages, 2), that stays where it ended; what comes of it there is cut off."""
    end = jnp.broadcast_to(motion[-1, -1], (n_steps - len(motion), *motion.shape[1:]))
    return jnp.concatenate([motion, end])


def _without_nuisance(force: jax.Array, residuals: jax.Array, names: tuple[NuisanceName, ...]) -> jax.Array:
    """Residuals (n_counted,) once the nuisance parameters are at their best; see `nuisance.without_nuisance`."""
    if not names:
        return residuals
    columns = jnp.stack([_column(name, force) for name in names])
    unit = columns / jnp.maximum(jnp.linalg.norm(columns, axis=-1, keepdims=True), np.finfo(float).tiny)
    return residuals - (jnp.linalg.pinv(unit @ unit.T) @ (unit @ residuals)) @ unit


def _column(name: NuisanceName, force: jax.Array) -> jax.Array:
    if name == "offset":
        return jnp.ones_like(force)
    return force if name == "level" else jnp.asarray(jnp.gradient(force))
