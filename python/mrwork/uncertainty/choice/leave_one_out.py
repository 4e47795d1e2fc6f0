"""PSIS-LOO of fitted families: leave-one-block-out densities by Pareto-smoothed importance sampling.

All families share the tempering of the likelihood and the blocks, which are whole cycles longer than the
autocorrelation time of the residuals, hence nearly independent.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import numpy as np

from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import SettingError
from mrwork.identification.covariance import autocorrelation_time, effective_samples
from mrwork.identification.equivalent import identifiable_form
from mrwork.identification.fit import Fit
from mrwork.records import DamperTest
from mrwork.records.motion import whole_cycles
from mrwork.store.codec import digest_of
from mrwork.store.journal import Journal
from mrwork.uncertainty.noise import NOISES, Noise
from mrwork.uncertainty.posterior.laplace import draw_about
from mrwork.uncertainty.posterior.target import Target, in_chunks, target_of

# Pareto k above which the estimate for a block is unreliable, because its importance weights have heavy tails (Vehtari,
# Gelman and Gabry, Statistics and Computing 27, 2017, 1413-1432).
UNRELIABLE = 0.7
# Draws for each family.
_N_DRAWS = 2000


@array_dataclass()
class LeaveOneOut:
    """Expected log predictive density of each block given the others, and its Pareto k, shape (n_blocks,)."""

    elpd: Floats
    pareto_k: Floats


def leave_one_out(log_densities: Floats, log_ratio: Floats) -> LeaveOneOut:
    """PSIS-LOO from log densities, (n_draws, n_blocks), and log of posterior over proposal density, (n_draws,)."""
    n_draws, n_blocks = log_densities.shape
    if n_blocks < 2:
        raise SettingError("the records make one block only, so none can be left out; give longer ones")
    if n_draws < 100:
        raise SettingError(f"{n_draws} draws fell where the posterior is; leave-one-out needs 100 or more")
    # ArviZ takes seconds to load, and has no type annotations.
    statistics: Any = import_module("arviz_stats.base").array_stats
    if np.ptp(log_ratio) == 0.0:
        elpd, pareto_k, _ = statistics.loo(log_densities.T[:, None, :])
    else:
        ratio = np.broadcast_to(log_ratio, (n_blocks, 1, n_draws))
        elpd, pareto_k, _ = statistics.loo_approximate_posterior(
            log_densities.T[:, None, :], ratio, np.zeros_like(ratio)
        )
    return LeaveOneOut(
        elpd=np.asarray(elpd, dtype=np.float64), pareto_k=np.asarray(pareto_k, dtype=np.float64)
    )


def block_densities(
    target: Target, theta: Floats, noise: Floats, blocks: Sequence[Sequence[slice]]
) -> Floats:
    """Tempered log density of the blocks of all tests, (n_draws, n_blocks), under draws in the target's form."""

    def of_rows(theta: Floats, noise: Floats) -> Floats:
        columns = []
        for (residual, force, failed), of_test in zip(target.residuals(theta), blocks, strict=True):
            density = target.temper * target.noise.log_densities(residual, force, noise)
            density[failed] = -np.inf
            columns += [density[:, block].sum(axis=1) for block in of_test]
        return np.stack(columns, axis=1)

    return in_chunks(of_rows, theta, noise)


def blocks_of(test: DamperTest, least: float) -> tuple[slice, ...]:
    """Adjacent blocks of whole cycles, of at least `least` counted samples; the ends belong to the outer blocks."""
    displacement = test.displacement[test.counted]
    cycles = whole_cycles(displacement)
    edges = [cycle.start for cycle in cycles[1:]]
    end = cycles[-1].stop if cycles else displacement.size
    cuts = [0]
    for edge in edges:
        if edge - cuts[-1] >= least and end - edge >= least:
            cuts.append(edge)
    return tuple(slice(first, last) for first, last in zip(cuts, [*cuts[1:], displacement.size], strict=True))


def longest_autocorrelation_times(residuals: Sequence[Sequence[Floats]]) -> tuple[float, ...]:
    """Longest autocorrelation time [samples] of each test, shape (n_tests,), over the residuals of several models."""
    return tuple(
        max(autocorrelation_time(each) for each in of_test) for of_test in zip(*residuals, strict=True)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedLikelihood:
    """A likelihood of `noise` on tests, tempered by `temper`, with `blocks` of the counted samples, test by test.

    Draws come from a chain where it is `sampled`, else from importance sampling about the fit.
    """

    tests: tuple[DamperTest, ...]
    blocks: tuple[tuple[slice, ...], ...]
    temper: float
    noise: Noise
    sampled: bool
    rng: int
    threads: int

    @classmethod
    def of(
        cls,
        fits: Sequence[Fit],
        tests: tuple[DamperTest, ...],
        *,
        noise: Noise,
        sampled: bool,
        rng: int,
        threads: int,
    ) -> SharedLikelihood:
        """Tempering by n_eff of the best fit, and blocks longer than the autocorrelation time of every fit."""
        residuals = [residuals_of(fit, tests) for fit in fits]
        best = residuals[int(np.argmin([fit.nrmse for fit in fits]))]
        times = longest_autocorrelation_times(residuals)
        return cls(
            tests=tests,
            blocks=tuple(blocks_of(test, least) for test, least in zip(tests, times, strict=True)),
            temper=effective_samples(best) / sum(test.n_counted for test in tests),
            noise=noise,
            sampled=sampled,
            rng=rng,
            threads=threads,
        )

    @property
    def n_blocks(self) -> int:
        """Number of blocks of all tests."""
        return sum(len(of_test) for of_test in self.blocks)

    def on_one_thread(self) -> SharedLikelihood:
        """The same for a worker."""
        return replace(self, threads=1)

    def recorded(
        self, fit: Fit, journal: Journal | None, *, compute: Callable[[Fit], LeaveOneOut]
    ) -> LeaveOneOut:
        """PSIS-LOO of a fitted family from a journal, or computed and recorded there."""
        if journal is None:
            return compute(fit)
        facts = digest_of(fit.model, fit.theta, self.temper, self.blocks, self.noise.name, self.rng)
        step = "chain" if self.sampled else "ellipsoid"
        return journal.once(step, facts, LeaveOneOut, lambda: compute(fit))

    def leave_one_out(self, fit: Fit) -> LeaveOneOut:
        """PSIS-LOO of a fitted family."""
        target, start = target_of(fit, self.tests, self.noise, tempering=self.temper, threads=self.threads)
        if self.sampled:
            theta, noise = self._chain(fit, target)
            log_ratio = np.zeros(len(theta))
        else:
            draws = draw_about(target, start, _N_DRAWS, np.random.default_rng(self.rng))
            theta, noise = np.split(np.asarray(target.space.values(draws.position)[0]), [start.size], axis=1)
            log_ratio = draws.log_ratio
        return leave_one_out(block_densities(target, theta, noise, self.blocks), log_ratio)

    def _chain(self, fit: Fit, target: Target) -> tuple[Floats, Floats]:
        """Evenly spaced draws of a chain: parameters in the target's form, and noise."""
        # emcee and HDF5 take a while to load.
        from mrwork.uncertainty.posterior.sample import sample

        draws = sample(
            fit, self.tests, noise=self.noise.name, tempering=self.temper, rng=self.rng, threads=self.threads
        )
        rows = np.linspace(0, len(draws.theta) - 1, min(_N_DRAWS, len(draws.theta))).round().astype(int)
        theta = np.stack([np.asarray(target.form.from_model(row)) for row in draws.theta[rows]])
        return theta, draws.noise[rows]


def residuals_of(fit: Fit, tests: tuple[DamperTest, ...]) -> tuple[Floats, ...]:
    """Residuals of a fit, test by test, in deviations of the test's measured force, shape (n_counted,)."""
    target, theta = target_of(fit, tests, NOISES["iid"], tempering=1.0)
    return tuple(residual[0] for residual, _, _ in target.residuals(theta[None]))


def variance_of(fit: Fit, tests: tuple[DamperTest, ...]) -> float:
    """Mean square of the residuals of all tests."""
    return float(np.mean(np.concatenate(residuals_of(fit, tests)) ** 2))


def free_parameters(fit: Fit) -> int:
    """Number of free parameters in the form that was identified."""
    return len(identifiable_form(fit.spec, fit.settings.bounds).box.free)
