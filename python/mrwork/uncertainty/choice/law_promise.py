"""Errors that laws promise without being simulated, by the tests linearised about the fits of other laws."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec, by_parameter
from mrwork.identification.objective import NormalEquations, Objective
from mrwork.uncertainty.choice.splits import Splits

# Steps of the linearised fits, their damping, relative to the sensitivity of each parameter, and the step in latent
# coordinates by which the slopes of laws are found.
_STEPS = 3
_DAMPING = 1e-2
_SMALL = 1e-4


@array_dataclass()
class LinearisedTests:
    """Tests linearised about laws, in the latent parameters of a `model`.

    The model is the plain one at each command or, where a command varies within tests, the model with every law by
    values at the commands, once for all tests. Any laws are curves in its parameters, shape
    (n_rows, n_levels, n_model). `here` are those about which the tests are linearised, a row for all tests and one
    without each split; `levels` has the number of the level of each test.
    """

    model: DamperSpec
    commands: Floats
    levels: NDArray[np.intp]
    shares: Floats
    splits: Splits
    here: Floats
    normal: NormalEquations

    @classmethod
    def about(
        cls,
        spec: DamperSpec,
        theta: Floats,
        objective: Objective,
        shares: Floats,
        *,
        commands: Floats,
        levels: NDArray[np.intp],
        splits: Splits,
    ) -> LinearisedTests:
        """Simulate the tests of the objective's model at the laws of each row of `theta`, with derivatives."""
        model = objective.spec
        box = Box.of(model)
        here = np.asarray(box.latent_from_theta(box.inside(_curves_in(model, spec, theta, commands))))
        n_rows, n_levels, n_model = here.shape
        included = np.tile(levels == np.arange(n_levels)[:, None], (n_rows, 1))
        every = NormalEquations.at(objective, box, here.reshape(-1, n_model), included)
        own = n_levels * np.arange(n_rows)[:, None] + levels, np.arange(levels.size)
        return cls(
            model=model,
            commands=commands,
            levels=levels,
            shares=shares,
            splits=splits,
            here=here,
            normal=NormalEquations(
                squared=every.squared[own], gradient=every.gradient[own], matrix=every.matrix[own]
            ),
        )

    def error_of(self, spec: DamperSpec, box: Box, starts: Floats) -> float:
        """Mean error of the predictions by laws that are fitted from `starts`, shape (n_rows, n_params)."""
        box_of_model = Box.of(self.model)
        latent = np.asarray(box.latent_from_theta(starts))
        n_rows, n_free = latent.shape
        gradient, matrix = self._of_levels(self.normal.gradient), self._of_levels(self.normal.matrix)

        def curves_at(rows: Floats) -> Floats:
            theta = np.asarray(box.theta_from_latent(rows))
            inside = box_of_model.inside(_curves_in(self.model, spec, theta, self.commands))
            return np.asarray(box_of_model.latent_from_theta(inside))

        curves = curves_at(latent)
        for _ in range(_STEPS):
            moved = latent[:, None] + _SMALL * np.eye(n_free)
            shifted = curves_at(moved.reshape(-1, n_free)).reshape(n_rows, n_free, *curves.shape[1:])
            slope = (shifted - curves[:, None]) / _SMALL
            pull = gradient + np.einsum("rcpq,rcq->rcp", matrix, curves - self.here)
            normal = np.einsum("rfcp,rcpq,rgcq->rfg", slope, matrix, slope, optimize=True)
            down = np.einsum("rfcp,rcp->rf", slope, pull)
            scale = np.sqrt(np.maximum(np.diagonal(normal, axis1=1, axis2=2), np.finfo(float).tiny))
            scaled = normal / scale[:, :, None] / scale[:, None] + _DAMPING * np.eye(n_free)
            latent = latent - np.linalg.solve(scaled, (down / scale)[..., None])[..., 0] / scale
            curves = curves_at(latent)
        away = (curves - self.here)[:, self.levels]
        nrmse = np.sqrt(np.clip(np.nan_to_num(self.normal.after(away), nan=1.0), 0.0, 1.0))
        left_out = [nrmse[row, members] for row, members in enumerate(self.splits.members, start=1)]
        return float(np.mean(self.splits.errors(left_out)))

    def _of_levels(self, of_tests: Floats) -> Floats:
        """Sums over the tests of each command that a row is fitted to, for values of tests, (n_rows, n_tests, ...)."""
        shares = self.shares.reshape(self.shares.shape + (1,) * (of_tests.ndim - 2))
        weighted = shares * of_tests
        levels = range(self.here.shape[1])
        return np.stack([weighted[:, self.levels == level].sum(axis=1) for level in levels], axis=1)


def _curves_in(model: DamperSpec, spec: DamperSpec, theta: Floats, commands: Floats) -> Floats:
    """Parameters of the plain `model` at each command, or of the `model` with every law by values at the commands."""
    curves = plain_curves(spec, theta, commands)
    if model.command_unit is None:
        return curves
    values = curves.transpose(0, 2, 1).reshape(len(theta), 1, -1)
    return np.concatenate([values, theta[:, None, -1:]], axis=-1) if model.lagged else values


def plain_curves(spec: DamperSpec, theta: Floats, commands: Floats) -> Floats:
    """Parameters of the plain model, (n_rows, n_commands, n_plain), at commands by the laws of each row of `theta`."""
    columns = []
    for (parameter, law), coefficients in zip(spec.law_pairs, by_parameter(spec, theta), strict=False):
        values = law.values(coefficients.T, commands[:, None], positive=parameter.is_positive).T
        columns.append(np.clip(values, parameter.lower, parameter.upper))
    return np.stack(columns, axis=-1)
