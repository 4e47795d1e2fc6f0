"""Fits of a model to all tests and without each of several selections at once.

Every row of a batch has its own selection of the tests. The tests are simulated once for all rows, and the normal
equations of each test are kept apart, so that those of a selection are sums over its tests.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec
from mrwork.identification.minimise.levenberg_marquardt import within_stiffness
from mrwork.identification.objective import shares_of
from mrwork.identification.progress import on_every_test
from mrwork.identification.residual import ObservedTest
from mrwork.identification.settings import FitSettings
from mrwork.records import DamperTest

# Convergence: relative decrease of the squared misfit in an iteration; largest number of iterations.
_TOLERANCE = 1e-5
_ITERATIONS = 30
# Factors on the present damping that are tried together; the first damping; above the last one a row has converged.
_DAMPING_FACTORS = (0.1, 1.0, 10.0)
_FIRST_DAMPING = 0.01
_MOST_DAMPING = 1e6
# Floor of the sensitivity of a parameter, relative to the largest one.
_LEAST_SENSITIVITY = 1e-7


@array_dataclass()
class NormalEquations:
    """Squared NRMSE (n_rows, n_tests), half its latent gradient (..., n_free), and J'J (..., n_free, n_free).

    Of a test that a row leaves out the squared NRMSE is infinite and the rest zero.
    """

    squared: Floats
    gradient: Floats
    matrix: Floats


@array_dataclass()
class FoldedFit:
    """Parameters of each row, (n_rows, n_params), and its squared NRMSE of each test, as in `NormalEquations`."""

    theta: Floats
    squared: Floats


@array_dataclass()
class FoldedTests:
    """Tests, and their shares in the mean squared NRMSE of each row, shape (n_rows, n_tests): 0 for a test left out."""

    observed: tuple[ObservedTest, ...]
    shares: Floats
    threads: int = 0

    @classmethod
    def of(
        cls,
        spec: DamperSpec,
        tests: Sequence[DamperTest],
        folds: Sequence[Sequence[int]],
        settings: FitSettings | None = None,
        *,
        threads: int = 0,
    ) -> FoldedTests:
        """Row 0 has all tests, row k all but those with the indices of fold k - 1."""
        settings = settings or FitSettings()
        observed = tuple(ObservedTest.of(spec, test, settings.nuisances) for test in tests)
        shares = shares_of(observed, settings)
        included = np.tile(shares, (1 + len(folds), 1))
        for row, members in enumerate(folds, start=1):
            included[row, list(members)] = 0.0
        return cls(observed=observed, shares=included / included.sum(axis=1, keepdims=True), threads=threads)

    def squared_nrmse(self, spec: DamperSpec, theta: Floats, shares: Floats) -> Floats:
        """Squared NRMSE of each test, (n_batch, n_tests); infinite where it fails, or is left out by a share of 0."""
        squared = np.full((len(theta), len(self.observed)), np.inf)

        def fill(index: int, threads: int) -> None:
            rows = np.flatnonzero(shares[:, index])
            if not rows.size:
                return
            each = replace(self.observed[index], spec=spec)
            residuals, failed = each.residuals(theta[rows], threads=threads)
            own = np.einsum("bt,bt->b", residuals, residuals) * each.weight(1) ** 2
            squared[rows, index] = np.where(failed, np.inf, own)

        on_every_test(len(self.observed), self.threads, fill)
        return squared

    def linearise(self, spec: DamperSpec, box: Box, latent: Floats, shares: Floats) -> NormalEquations:
        """Normal equations of tests at latent coordinates, (n_batch, n_free); those of share 0 are not simulated."""
        n_batch, n_free = latent.shape
        theta = np.asarray(box.theta_from_latent(latent))
        slope = np.exp(box.log_slope(latent))
        squared = np.full((n_batch, len(self.observed)), np.inf)
        gradient = np.zeros((n_batch, len(self.observed), n_free))
        matrix = np.zeros((n_batch, len(self.observed), n_free, n_free))

        def fill(index: int, threads: int) -> None:
            rows = np.flatnonzero(shares[:, index])
            if not rows.size:
                return
            each = replace(self.observed[index], spec=spec)
            residuals, jacobian, failed = each.linearise_residuals(theta[rows], box.free, threads=threads)
            residuals *= each.weight(1)
            jacobian *= each.weight(1) * slope[rows][..., None]
            own = np.einsum("bt,bt->b", residuals, residuals)
            squared[rows, index] = np.where(failed, np.inf, own)
            gradient[rows, index] = np.einsum("bpt,bt->bp", jacobian, residuals)
            matrix[rows, index] = jacobian @ jacobian.transpose(0, 2, 1)

        on_every_test(len(self.observed), self.threads, fill)
        return NormalEquations(squared=squared, gradient=gradient, matrix=matrix)

    def misfit(self, squared: Floats, shares: Floats) -> Floats:
        """Squared misfit of each row, shape (n_batch,); a test that is left out may have failed."""
        return np.asarray(np.sum(shares * np.where(shares > 0.0, squared, 0.0), axis=1))

    def fit(self, spec: DamperSpec, box: Box, starts: Floats) -> FoldedFit:
        """Minimise the misfit of each row from its start, shape (n_rows, n_params), by Levenberg-Marquardt.

        Damping is as in `find_minima`. The result of a row depends on its own tests and start only.
        """
        latent = np.asarray(box.latent_from_theta(box.inside(starts)))
        n_rows, n_free = latent.shape
        squared = self.squared_nrmse(spec, np.asarray(box.theta_from_latent(latent)), self.shares)
        misfit = self.misfit(squared, self.shares)
        damping = np.full(n_rows, _FIRST_DAMPING)
        sensitivity = np.zeros((n_rows, n_free))
        normal, gradient = np.zeros((n_rows, n_free, n_free)), np.zeros((n_rows, n_free))
        moved = np.ones(n_rows, dtype=np.bool_)
        running = np.isfinite(misfit)
        diagonal = np.arange(n_free)
        tests = [replace(each, spec=spec) for each in self.observed]
        for _ in range(_ITERATIONS):
            rows = np.flatnonzero(running)
            if not rows.size:
                break
            # A row that has not moved since has the same normal equations.
            fresh = np.flatnonzero(running & moved)
            here = self.linearise(spec, box, latent[fresh], self.shares[fresh])
            normal[fresh] = np.einsum("rt,rtpq->rpq", self.shares[fresh], here.matrix)
            gradient[fresh] = np.einsum("rt,rtp->rp", self.shares[fresh], here.gradient)
            sensitivity[fresh] = np.maximum(sensitivity[fresh], np.sqrt(normal[fresh][:, diagonal, diagonal]))
            floor = _LEAST_SENSITIVITY * sensitivity[rows].max(axis=1, keepdims=True)
            weight = np.maximum(sensitivity[rows], np.maximum(floor, np.finfo(float).tiny)) ** 2
            # (row, factor, free, free)
            dampings = damping[rows, None] * np.array(_DAMPING_FACTORS)
            damped = normal[rows, None] + dampings[..., None, None] * (
                weight[:, None, :, None] * np.eye(n_free)
            )
            step = -np.linalg.solve(damped, gradient[rows, None, :, None])[..., 0]
            step = within_stiffness(tests, box, latent[rows], step, damped, gradient[rows])
            tried = latent[rows, None] + step
            shares = np.repeat(self.shares[rows], len(_DAMPING_FACTORS), axis=0)
            candidates = np.asarray(box.theta_from_latent(tried.reshape(-1, n_free)))
            errors = self.squared_nrmse(spec, candidates, shares)
            after = self.misfit(errors, shares).reshape(rows.size, -1)
            best = np.argmin(after, axis=1)
            each = np.arange(rows.size)
            better = after[each, best] < misfit[rows]
            decrease = 1.0 - after[each, best] / misfit[rows]
            moved[rows] = better
            accepted = rows[better]
            latent[accepted] = tried[each, best][better]
            squared[accepted] = errors.reshape(*after.shape, -1)[each, best][better]
            misfit[accepted] = after[each, best][better]
            factor = np.where(better, np.array(_DAMPING_FACTORS)[best] / 3.0, 100.0)
            damping[rows] = np.maximum(damping[rows] * factor, 1e-12)
            running[rows] = np.where(better, decrease > _TOLERANCE, damping[rows] < _MOST_DAMPING)
        return FoldedFit(theta=np.asarray(box.theta_from_latent(latent)), squared=squared)
