"""The tests of a choice of laws: fits to all and without each split, predictions of what is left out, and promises.

A promise is the error of laws that are not simulated, by the tests linearised about the fits of other laws.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec, by_parameter
from mrwork.identification.minimise.levenberg_marquardt import LocalMinima, find_minima
from mrwork.identification.objective import NormalEquations, Objective
from mrwork.uncertainty.choice.splits import Splits

# Convergence of the fits: relative decrease of the squared misfit in an iteration; largest number of iterations.
_TOLERANCE = 1e-5
_ITERATIONS = 30
# Steps of the linearised fits, their damping, relative to the sensitivity of each parameter, and the step in latent
# coordinates by which the slopes of laws are found.
_STEPS = 3
_DAMPING = 1e-2
_SMALL = 1e-4


@array_dataclass()
class FoldedFit:
    """Parameters of each row, (n_rows, n_params), and squared NRMSE of tests by the first, (n_tests,).

    The first row is fitted to all tests, the others to those that remain without each split.
    """

    theta: Floats
    squared: Floats


@array_dataclass()
class Linearised:
    """Tests linearised about the laws of each row, whose curves in latent parameters are `here`."""

    here: Floats
    normal: NormalEquations


@array_dataclass()
class LawFolds:
    """Tests that laws are fitted to, `excerpts`, and the `whole` ones that they predict.

    Each row of `shares`, (n_rows, n_tests), weighs the excerpts, for all tests, then without each split. They are
    linearised in the parameters of their model: the plain one at each of the `commands` or, where a command varies
    within a test, the model with every law by values at these. Any laws are curves in its parameters, shape
    (n_rows, n_levels, n_model). `levels` has the number of the command of each test.
    """

    whole: Objective
    excerpts: Objective
    shares: Floats
    commands: Floats
    levels: NDArray[np.intp]
    splits: Splits
    unit: CommandUnit

    @property
    def model(self) -> DamperSpec:
        """The model in whose parameters tests are linearised."""
        return self.excerpts.spec

    @property
    def varies(self) -> bool:
        """Whether a command varies within a test, which then shows the laws at all commands."""
        return self.model.command_unit is not None

    def fit(self, spec: DamperSpec, box: Box, starts: Floats) -> FoldedFit:
        """Fit every row; rows that no simulation could start from begin at the best of the others."""
        objective = self.excerpts.with_laws(spec)

        def minimise(starts: Floats) -> LocalMinima:
            return find_minima(
                objective, box, starts, max_iterations=_ITERATIONS, tolerance=_TOLERANCE, shares=self.shares
            )

        minima = minimise(starts)
        failed = ~np.isfinite(minima.misfit)
        if failed.any() and not failed.all():
            minima = minimise(np.where(failed[:, None], minima.best.theta, minima.theta))
        (squared,) = objective.squared_nrmse(minima.theta[:1])
        return FoldedFit(theta=minima.theta, squared=squared)

    def predict(self, sets: list[tuple[DamperSpec, Floats]]) -> Floats:
        """NRMSE of the whole tests of each split by the fits of sets of laws without them, shape (n_sets, n_pairs).

        At its constant command each test is of the plain model, so that all sets are one batch. It may be infinite.
        """
        pairs = [
            (row, index) for row, members in enumerate(self.splits.members, start=1) for index in members
        ]
        rows, indices = np.array(pairs).T
        included = np.arange(len(self.whole.tests)) == indices[:, None]
        if self.varies:
            parts = [self.whole.with_laws(spec).squared_nrmse(theta[rows], included) for spec, theta in sets]
            squared = np.concatenate(parts)
        else:
            commands = np.array([np.mean(test.command_in(self.unit) or 0.0) for test in self.whole.tests])
            plain = [_plain_curves(*law_set, commands)[rows, indices] for law_set in sets]
            squared = self.whole.squared_nrmse(np.concatenate(plain), np.tile(included, (len(sets), 1)))
        return np.sqrt(squared.reshape(len(sets), len(pairs), -1)[:, included])

    def linearise(self, spec: DamperSpec, theta: Floats) -> Linearised:
        """Simulate the excerpts at the laws of each row of `theta`, with derivatives."""
        box, levels = Box.of(self.model), self.levels
        here = np.asarray(box.latent_from_theta(box.inside(self._curves(spec, theta))))
        n_rows, n_levels, n_model = here.shape
        included = np.tile(levels == np.arange(n_levels)[:, None], (n_rows, 1))
        latent = here.reshape(-1, n_model)
        every = NormalEquations.at(self.excerpts, box, np.asarray(box.theta_from_latent(latent)), included)
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
            latent = latent - np.linalg.solve(scaled, (down / scale)[..., None])[..., 0] / scale
            curves = curves_at(latent)
        away = (curves - here)[:, self.levels]
        nrmse = np.sqrt(np.clip(np.nan_to_num(normal.after(away), nan=1.0), 0.0, 1.0))
        left_out = [nrmse[row, members] for row, members in enumerate(self.splits.members, start=1)]
        return float(np.mean(self.splits.errors(left_out)))

    def _of_levels(self, of_tests: Floats) -> Floats:
        """Sums over the tests of each command that a row is fitted to, for values of tests, (n_rows, n_tests, ...)."""
        shares = self.shares.reshape(self.shares.shape + (1,) * (of_tests.ndim - 2))
        weighted = shares * of_tests
        levels = range(self.commands.size if not self.varies else 1)
        return np.stack([weighted[:, self.levels == level].sum(axis=1) for level in levels], axis=1)

    def _curves(self, spec: DamperSpec, theta: Floats) -> Floats:
        """Parameters of the model of the folds by the laws of each row of `theta`."""
        curves = _plain_curves(spec, theta, self.commands)
        if not self.varies:
            return curves
        values = curves.transpose(0, 2, 1).reshape(len(theta), 1, -1)
        rates = theta[:, None, theta.shape[1] - self.model.n_rates :]
        return np.concatenate([values, rates], axis=-1)


def _plain_curves(spec: DamperSpec, theta: Floats, commands: Floats) -> Floats:
    """Parameters of the plain model, (n_rows, n_commands, n_plain), at commands by the laws of each row of `theta`."""
    columns = []
    for (parameter, law), coefficients in zip(spec.law_pairs, by_parameter(spec, theta), strict=False):
        values = law.values(coefficients.T, commands[:, None]).T
        columns.append(np.clip(values, parameter.lower, parameter.upper))
    return np.stack(columns, axis=-1)
