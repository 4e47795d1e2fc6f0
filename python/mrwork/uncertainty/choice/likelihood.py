"""The likelihood that families of models are compared by: the same tempering and the same blocks for all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.identification.equivalent import identifiable_form
from mrwork.identification.fit import Fit
from mrwork.identification.problem import Problem
from mrwork.records import DamperTest
from mrwork.store import Journal, digest_of
from mrwork.uncertainty.autocorrelation import effective_samples
from mrwork.uncertainty.choice.blocks import blocks_of, longest_memory
from mrwork.uncertainty.choice.laplace import draw_about
from mrwork.uncertainty.choice.psis import LeaveOneOut, block_densities, leave_one_out
from mrwork.uncertainty.noise import NOISES, Noise
from mrwork.uncertainty.posterior.target import Target

Array = NDArray[np.float64]

N_DRAWS = 2000


@dataclass(frozen=True, slots=True, kw_only=True)
class Likelihood:
    """How densities are told: the noise, and whether draws come from a chain or from an ellipsoid about the fit."""

    noise: Noise
    sampled: bool = False
    rng: int = 0
    threads: int = 0

    def shared(self, fits: Sequence[Fit], tests: tuple[DamperTest, ...]) -> SharedLikelihood:
        """What all families share: n_eff is that of the fit with the least misfit, blocks outlast every memory."""
        best = min(fits, key=lambda fit: fit.nrmse)
        residuals = [residuals_of(fit, tests) for fit in fits]
        n_time = sum(test.n_time - test.n_settle for test in tests)
        blocks = tuple(
            blocks_of(test, least) for test, least in zip(tests, longest_memory(residuals), strict=True)
        )
        return SharedLikelihood(
            likelihood=self,
            tests=tests,
            blocks=blocks,
            temper=effective_samples(residuals_of(best, tests)) / n_time,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedLikelihood:
    """A likelihood on tests, tempered by `temper`, in `blocks` of the samples that count, test by test."""

    likelihood: Likelihood
    tests: tuple[DamperTest, ...]
    blocks: tuple[tuple[slice, ...], ...]
    temper: float

    @property
    def n_blocks(self) -> int:
        """Blocks of all tests together."""
        return sum(len(of_test) for of_test in self.blocks)

    def leave_one_out(self, fit: Fit, journal: Journal | None = None) -> LeaveOneOut:
        """PSIS-LOO of a fitted family.

        Raises
        ------
        SettingError
            Where there are too few blocks, or draws.
        """
        if journal is None:
            return self._left_out(fit)
        facts = digest_of(
            fit.model, fit.theta, self.temper, self.blocks, self.likelihood.noise.name, self.likelihood.rng
        )
        step = "chain" if self.likelihood.sampled else "ellipsoid"
        return journal.once(step, facts, LeaveOneOut, lambda: self._left_out(fit))

    def _left_out(self, fit: Fit) -> LeaveOneOut:
        own = self.likelihood
        target, start = target_of(fit, self.tests, own.noise, temper=self.temper, threads=own.threads)
        if own.sampled:
            theta, noise = self._chain(fit, target)
            log_ratio = np.zeros(len(theta))
        else:
            draws = draw_about(target, start, N_DRAWS, np.random.default_rng(own.rng))
            theta, noise = np.split(np.asarray(target.space.values(draws.position)[0]), [start.size], axis=1)
            log_ratio = draws.log_ratio
        return leave_one_out(block_densities(target, theta, noise, self.blocks), log_ratio)

    def _chain(self, fit: Fit, target: Target) -> tuple[Array, Array]:
        """Draws of the target's form and of the noise, evenly from the whole chain."""
        # emcee and HDF5 take a while to load.
        from mrwork.uncertainty.posterior.sample import sample_posterior

        own = self.likelihood
        draws = sample_posterior(
            fit.spec,
            self.tests,
            start=fit,
            noise=own.noise.name,
            tempering=self.temper,
            rng=own.rng,
            threads=own.threads,
        )
        rows = np.linspace(0, len(draws.theta) - 1, min(N_DRAWS, len(draws.theta))).round().astype(int)
        theta = np.stack([np.asarray(target.form.forth(row)) for row in draws.theta[rows]])
        return theta, draws.noise[rows]


def target_of(
    fit: Fit, tests: tuple[DamperTest, ...], noise: Noise, *, temper: float, threads: int = 0
) -> tuple[Target, Array]:
    """The posterior of a fit's family with even priors, and where the fit lies, shape (n_params,) of its form."""
    problem = Problem.of_fit(fit, tests, threads=threads)
    theta = problem.inside(fit.theta)
    target = Target.of(problem.form, problem.objective, noise, start=theta, priors={}, tempering=temper)
    return target, theta


def residuals_of(fit: Fit, tests: tuple[DamperTest, ...]) -> tuple[Array, ...]:
    """Residuals of a fit, test by test, in deviations of the test's measured force, shape (n_counted,)."""
    target, theta = target_of(fit, tests, NOISES["iid"], temper=1.0)
    return tuple(residual[0] for residual, _, _ in target.residuals(theta[None]))


def variance_of(fit: Fit, tests: tuple[DamperTest, ...]) -> float:
    """Mean square of the residuals of all tests."""
    return float(np.mean(np.concatenate(residuals_of(fit, tests)) ** 2))


def free_parameters(fit: Fit) -> int:
    """How many parameters were free, in the form that was searched."""
    return len(identifiable_form(fit.spec, fit.settings.bounds).box.free)
