"""The tests of a choice of laws, linearised: promises of laws that are not simulated.

A promise is the error of the predictions of laws by the tests linearised about the fits of other laws.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec
from mrwork.identification.objective import NormalEquations
from mrwork.uncertainty.choice.folds import FoldedFit, Folds, plain_curves

# Steps of the linearised fits, their damping, relative to the sensitivity of each parameter, and the step in latent
# coordinates by which the slopes of laws are found.
_STEPS = 3
_DAMPING = 1e-2
_SMALL = 1e-4
# Latent coordinate at which a parameter is on its bound to rounding.
_AT_BOUND = 30.0


@array_dataclass()
class Linearised:
    """Tests linearised about the laws of each row, whose curves in latent parameters are `here`."""

    here: Floats
    normal: NormalEquations


@array_dataclass()
class Promises:
    """Folds of one plain model whose laws are chosen, with the model in whose parameters the tests are linearised.

    It is the plain one at each of the `commands` or, where a command varies within a test, the model with every law by
    values at these. Any laws are curves in its parameters, shape (n_rows, n_levels, n_model). `levels` has the number
    of the command of each test.
    """

    folds: Folds
    model: DamperSpec
    commands: Floats
    levels: NDArray[np.intp]

    @property
    def varies(self) -> bool:
        """Whether a command varies within a test."""
        return self.model.command_unit is not None

    def linearise(self, spec: DamperSpec, fit: FoldedFit) -> Linearised:
        """Simulate the excerpts at the laws and with the effects of each row, with derivatives by the laws."""
        box, levels = Box.of(self.model), self.levels
        here = np.asarray(box.latent_from_theta(box.inside(self._curves(spec, fit.theta))))
        n_rows, n_levels, n_model = here.shape
        included = np.tile(levels == np.arange(n_levels)[:, None], (n_rows, 1))
        latent = here.reshape(-1, n_model)
        effects = np.repeat(fit.effects, n_levels, axis=0)
        theta = np.hstack([np.asarray(box.theta_from_latent(latent)), effects])
        every = NormalEquations.at(self.folds.excerpts.with_laws(self.model), box, theta, included)
        every = every.by(np.exp(box.log_slope(latent))[:, :, None] * np.eye(n_model))
        own = n_levels * np.arange(n_rows)[:, None] + levels, np.arange(levels.size)
        normal = NormalEquations(
            squared=every.squared[own], gradient=every.gradient[own], matrix=every.matrix[own]
        )
        return Linearised(here=here, normal=normal)

    def promise(self, about: Linearised, spec: DamperSpec, box: Box, starts: Floats) -> float:
        """Mean error of the predictions by laws that are fitted from `starts`, shape (n_rows, n_params)."""
        box_of_model, here, normal = Box.of(self.model), about.here, about.normal
        latent = np.asarray(box.latent_from_theta(starts))
        n_rows, n_free = latent.shape
        gradient, matrix = self._of_levels(normal.gradient), self._of_levels(normal.matrix)

        def curves_at(rows: Floats) -> Floats:
            theta = np.asarray(box.theta_from_latent(rows))
            inside = box_of_model.inside(self._curves(spec, theta))
            return np.asarray(box_of_model.latent_from_theta(inside))

        curves = curves_at(latent)
        for _ in range(_STEPS):
            moved = latent[:, None] + _SMALL * np.eye(n_free)
            shifted = curves_at(moved.reshape(-1, n_free)).reshape(n_rows, n_free, *curves.shape[1:])
            slope = (shifted - curves[:, None]) / _SMALL
            pull = gradient + np.einsum("rcpq,rcq->rcp", matrix, curves - here)
            hessian = np.einsum("rfcp,rcpq,rgcq->rfg", slope, matrix, slope, optimize=True)
            down = np.einsum("rfcp,rcp->rf", slope, pull)
            scale = np.sqrt(np.maximum(np.diagonal(hessian, axis1=1, axis2=2), np.finfo(float).tiny))
            scaled = hessian / scale[:, :, None] / scale[:, None] + _DAMPING * np.eye(n_free)
            step = np.linalg.solve(scaled, (down / scale)[..., None])[..., 0] / scale
            latent = np.clip(latent - np.nan_to_num(step), -_AT_BOUND, _AT_BOUND)
            curves = curves_at(latent)
        away = (curves - here)[:, self.levels]
        nrmse = np.sqrt(np.clip(np.nan_to_num(normal.after(away), nan=1.0), 0.0, 1.0))
        left_out = [nrmse[row, members] for row, members in enumerate(self.folds.splits.members, start=1)]
        return float(np.mean(self.folds.splits.errors(left_out)))

    def _of_levels(self, of_tests: Floats) -> Floats:
        """Sums over the tests of each command that a row is fitted to, for values of tests, (n_rows, n_tests, ...)."""
        shares = self.folds.shares.reshape(self.folds.shares.shape + (1,) * (of_tests.ndim - 2))
        weighted = shares * of_tests
        levels = range(self.commands.size if not self.varies else 1)
        return np.stack([weighted[:, self.levels == level].sum(axis=1) for level in levels], axis=1)

    def _curves(self, spec: DamperSpec, theta: Floats) -> Floats:
        """Parameters of the model of the folds by the laws of each row of `theta`."""
        curves = plain_curves(spec, theta, self.commands)
        if not self.varies:
            return curves
        values = curves.transpose(0, 2, 1).reshape(len(theta), 1, -1)
        rates = theta[:, None, theta.shape[1] - self.model.n_rates :]
        return np.concatenate([values, rates], axis=-1)
