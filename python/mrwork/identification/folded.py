"""Least-squares fits to several selections of the same tests at once: all tests, and all but those of each fold.

Every row of a batch has its own selection. The tests are simulated once for all rows, and the normal equations of each
test are kept apart, so that those of every selection are sums over its tests.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec
from mrwork.identification.levenberg_marquardt import within_stiffness
from mrwork.identification.objective import shares_of
from mrwork.identification.progress import on_every_test
from mrwork.identification.residual import ObservedTest
from mrwork.identification.settings import FitSettings
from mrwork.records import DamperTest
from mrwork.values import holds_arrays

Array = NDArray[np.float64]

# Convergence: relative decrease of the squared misfit in an iteration; largest number of iterations.
_TOLERANCE = 1e-5
_ITERATIONS = 30
# Factors on the present damping that are tried together; the first damping; above the last one a row has converged.
_DAMPING_FACTORS = (0.1, 1.0, 10.0)
_FIRST_DAMPING = 0.01
_MOST_DAMPING = 1e6
# Floor of the sensitivity of a parameter, relative to the largest one.
_LEAST_SENSITIVITY = 1e-7


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class NormalEquations:
    """Normal equations of the NRMSE of each test at each row, in latent coordinates.

    Shapes: `squared` NRMSE (n_rows, n_tests), `gradient` half the derivative of it, (n_rows, n_tests, n_free), `matrix`
    (n_rows, n_tests, n_free, n_free).
    """

    squared: Array
    gradient: Array
    matrix: Array


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class FoldedFit:
    """Parameters of each row, shape (n_rows, n_params), and its squared NRMSE of each test, (n_rows, n_tests)."""

    theta: Array
    squared: Array


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class FoldedTests:
    """Tests, and the rows' shares of them in the squared misfit, shape (n_rows, n_tests): 0 for a test left out.

    The squared misfit of a row is the mean of the squared NRMSE of its tests, weighted as in `Objective`.
    """

    observed: tuple[ObservedTest, ...]
    shares: Array
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
        shares = shares_of([each.deviation for each in observed], settings.force_exponent)
        included = np.tile(shares, (1 + len(folds), 1))
        for row, members in enumerate(folds, start=1):
            included[row, list(members)] = 0.0
        return cls(
            observed=observed,
            shares=included / included.sum(axis=1, keepdims=True),
            threads=threads,
        )

    def squared_nrmse(self, spec: DamperSpec, theta: Array) -> Array:
        """Squared NRMSE of each test, shape (n_batch, n_tests); infinite where a simulation failed."""
        squared = np.empty((len(theta), len(self.observed)))

        def fill(index: int, threads: int) -> None:
            each = replace(self.observed[index], spec=spec)
            residuals, failed = each.residuals(theta, threads=threads)
            squared[:, index] = np.einsum("bt,bt->b", residuals, residuals) * each.weight(1) ** 2
            squared[failed, index] = np.inf

        on_every_test(len(self.observed), self.threads, fill)
        return squared

    def linearise(self, spec: DamperSpec, box: Box, latent: Array) -> NormalEquations:
        """Normal equations of each test at latent coordinates, shape (n_batch, n_free)."""
        n_batch, n_free = latent.shape
        theta = np.asarray(box.theta_from_latent(latent))
        slope = np.exp(box.log_slope(latent))
        squared = np.empty((n_batch, len(self.observed)))
        gradient = np.empty((n_batch, len(self.observed), n_free))
        matrix = np.empty((n_batch, len(self.observed), n_free, n_free))

        def fill(index: int, threads: int) -> None:
            each = replace(self.observed[index], spec=spec)
            residuals, jacobian, failed = each.linearised(theta, box.free, threads=threads)
            residuals *= each.weight(1)
            jacobian *= each.weight(1) * slope[..., None]
            squared[:, index] = np.einsum("bt,bt->b", residuals, residuals)
            gradient[:, index] = np.einsum("bpt,bt->bp", jacobian, residuals)
            matrix[:, index] = jacobian @ jacobian.transpose(0, 2, 1)
            squared[failed, index] = np.inf

        on_every_test(len(self.observed), self.threads, fill)
        return NormalEquations(squared=squared, gradient=gradient, matrix=matrix)

    def misfit(self, squared: Array, shares: Array) -> Array:
        """Squared misfit of each row, shape (n_batch,); a test that is left out may have failed."""
        return np.asarray(np.sum(shares * np.where(shares > 0.0, squared, 0.0), axis=1))

    def fit(self, spec: DamperSpec, box: Box, starts: Array) -> FoldedFit:
        """Minimise the misfit of each row from its start, shape (n_rows, n_params), by Levenberg-Marquardt.

        Damping is relative to the sensitivity of each parameter, the largest so far (Moré, Lecture Notes in
        Mathematics 630, 1978, 105-116). The result of a row depends on its own tests and start only.
        """
        latent = np.asarray(box.latent_from_theta(box.inside(starts)))
        n_rows, n_free = latent.shape
        squared = self.squared_nrmse(spec, np.asarray(box.theta_from_latent(latent)))
        misfit = self.misfit(squared, self.shares)
        damping = np.full(n_rows, _FIRST_DAMPING)
        sensitivity = np.zeros((n_rows, n_free))
        running = np.isfinite(misfit)
        diagonal = np.arange(n_free)
        tests = [replace(each, spec=spec) for each in self.observed]
        for _ in range(_ITERATIONS):
            rows = np.flatnonzero(running)
            if not rows.size:
                break
            shares = self.shares[rows]
            here = self.linearise(spec, box, latent[rows])
            normal = np.einsum("rt,rtpq->rpq", shares, here.matrix)
            gradient = np.einsum("rt,rtp->rp", shares, here.gradient)
            sensitivity[rows] = np.maximum(sensitivity[rows], np.sqrt(normal[:, diagonal, diagonal]))
            floor = _LEAST_SENSITIVITY * sensitivity[rows].max(axis=1, keepdims=True)
            weight = np.maximum(sensitivity[rows], np.maximum(floor, np.finfo(float).tiny)) ** 2
            # (row, factor, free, free)
            dampings = damping[rows, None] * np.array(_DAMPING_FACTORS)
            damped = normal[:, None] + dampings[..., None, None] * (weight[:, None, :, None] * np.eye(n_free))
            step = -np.linalg.solve(damped, gradient[:, None, :, None])[..., 0]
            step = within_stiffness(tests, box, latent[rows], step, damped, gradient)
            tried = np.moveaxis(latent[rows, None] + step, 1, 0)
            candidates = np.asarray(box.theta_from_latent(tried.reshape(-1, n_free)))
            found = self.squared_nrmse(spec, candidates).reshape(len(tried), rows.size, -1)
            after = np.stack([self.misfit(each, shares) for each in found])
            best = np.argmin(after, axis=0)
            each = np.arange(rows.size)
            better = after[best, each] < misfit[rows]
            decrease = 1.0 - after[best, each] / misfit[rows]
            moved = rows[better]
            latent[moved] = tried[best, each][better]
            squared[moved] = found[best, each][better]
            misfit[moved] = after[best, each][better]
            factor = np.where(better, np.array(_DAMPING_FACTORS)[best] / 3.0, 100.0)
            damping[rows] = np.maximum(damping[rows] * factor, 1e-12)
            running[rows] = np.where(better, decrease > _TOLERANCE, damping[rows] < _MOST_DAMPING)
        return FoldedFit(theta=np.asarray(box.theta_from_latent(latent)), squared=squared)
