"""Posterior sampling of an identified damper by an ensemble of walkers, until the chain has converged."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import Threads, Within, checked
from mrwork.errors import Interrupted, JournalError, SettingError
from mrwork.identification.fit import Fit
from mrwork.records import DamperTest
from mrwork.records.damper_test import as_tests
from mrwork.store.codec import array_of
from mrwork.store.fingerprint import digest_of
from mrwork.store.journal import Journal
from mrwork.uncertainty.posterior.diagnostics import Diagnosis, next_check
from mrwork.uncertainty.posterior.draws import Draws
from mrwork.uncertainty.posterior.ensemble import Ensemble
from mrwork.uncertainty.posterior.laplace import first_walkers, mode_near
from mrwork.uncertainty.posterior.prior import Prior
from mrwork.uncertainty.posterior.problem import SamplingProblem
from mrwork.uncertainty.posterior.target import Tempering

Array = NDArray[np.float64]

# Seconds between two progress reports.
_REPORT_EVERY = 0.2
# Bytes of the longest chain; its diagnosis takes as much again.
_MOST_BYTES = 16 << 30


@dataclass(frozen=True, slots=True, kw_only=True)
class SamplingProgress:
    """Progress of a sampling run: steps done and allowed, steps per second, the latest diagnosis, if any."""

    steps: int
    most_steps: int
    seconds: float
    steps_per_second: float
    diagnosis: Diagnosis | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainSoFar:
    """An interrupted chain of `n_steps`; its draws are computed when `draws` is called, which takes a while."""

    n_steps: int
    draws: Callable[[], Draws]


@checked
def sample(
    fit: Fit,
    tests: DamperTest | Sequence[DamperTest],
    *,
    noise: str = "iid",
    priors: Mapping[str, Prior] | None = None,
    tempering: Tempering | None = None,
    walkers: Annotated[int, Within(least=2, most=10_000)] = 64,
    most_steps: Annotated[int, Within(least=1, most=10_000_000)] = 20_000,
    rng: Annotated[int, Within(least=0, most=2**32 - 1)] = 0,
    threads: Threads = 0,
    journal: Journal | None = None,
    on_progress: Callable[[SamplingProgress], None] | None = None,
) -> Draws:
    """Sample the posterior of a damper's parameters and of the noise, with an ensemble of walkers about a fit.

    Sampling stops when the chain is 50 autocorrelation times long, the rank-normalised R-hat of every parameter is
    below 1.01, and there are at least 400 effective draws of its bulk and of its tails. The first quarter of the chain
    is discarded as burn-in. Bounds, nuisance parameters and observation models are those of the fit.

    Parameters
    ----------
    fit
        The fit near which walkers start, about the mode of the posterior; its bounds are the box of the prior. A fit of
        a Spencer form is sampled in the normalised form, and mapped back.
    tests
        The tests of the fit, or others of the same damper.
    noise
        Noise model: one of `mrwork.uncertainty.NOISES`.
    priors
        By parameter name in the form that is sampled; `noise.sigma` and so on for the noise. The default is uniform
        over the box, on the parameter's own scale; for a stiffness k and its free length x0, uniform in k and k x0.
    tempering
        Factor of the log-likelihood, so that correlated residuals are not counted as independent: a number, or
        "effective", the share of independent residuals at the start. Default "effective" for "iid", "student_t" and
        "amplitude", 1 for noise models with correlation; see `Target.of`.
    walkers
        An even number, at least twice the number of parameters including those of the noise.
    most_steps
        Largest number of steps; the verdict of a chain that reaches it says what is missing.
    rng
        Seed. The same seed gives the same bits on any number of threads.
    threads
        Threads of the simulation, 0 for all.
    journal
        To it goes the log density of every step, from which the chain is built again: a journal that is resumed
        continues the chain to the same bits as without the interruption. Only `most_steps` and `threads` may differ.
    on_progress
        Called about five times a second.

    Returns
    -------
    Draws
        Draws of parameters and noise, diagnostics, verdict, provenance.

    Raises
    ------
    SettingError
        Where a setting, a prior or the start is impossible.
    UnknownNameError
        Where there is no such noise model, or a prior names an unknown parameter.
    JournalError
        If the journal belongs to another sampling, or is written by another process.
    OutputError
        If the journal cannot be written; it can be resumed.
    Interrupted
        On Ctrl-C, carrying a `ChainSoFar`; the chain is in the journal, too.

    Examples
    --------
    >>> import mrwork as mr
    >>> test = mr.synthetic_test("spencer1997")
    >>> fit = mr.identify("normalised_bouc_wen", test)  # doctest: +SKIP
    >>> draws = mr.sample(fit, test)  # doctest: +SKIP
    >>> print(draws.verdict)  # doctest: +SKIP
    """
    began = time.perf_counter()
    problem = SamplingProblem.of_fit(
        fit,
        as_tests(tests),
        noise=noise,
        priors=dict(priors or {}),
        tempering=tempering,
        walkers=walkers,
        rng=rng,
        threads=threads,
    )
    _check_size(walkers, most_steps, problem.target.space.n_dim)
    density: Callable[[Array], Array] = problem.target
    if journal is not None:
        journal.agree("sampling", problem.fingerprint())
        density = _Journalled(target=problem.target, journal=journal)
    mode = mode_near(problem.target, problem.start)
    origins = first_walkers(problem.target, mode, walkers, np.random.default_rng(rng))
    ensemble = Ensemble.begin(density, origins, rng)
    if journal is not None and not np.isfinite(ensemble.densities[0]).all():
        # Walkers start where it is.
        raise JournalError(
            f"{journal.path} begins with densities that are not finite; run again without --resume"
        )
    monitor = _Monitor(most_steps=most_steps, began=began, on_progress=on_progress, journal=journal)
    try:
        diagnosis = _run(problem, ensemble, monitor)
    except KeyboardInterrupt as interrupt:
        if ensemble.n_steps == 0:
            raise
        seconds = time.perf_counter() - began
        so_far = ChainSoFar(
            n_steps=ensemble.n_steps,
            draws=lambda: problem.draws(
                ensemble, problem.diagnosis(ensemble), seconds=seconds, interrupted=True
            ),
        )
        raise Interrupted(so_far, "sampling") from interrupt
    return problem.draws(ensemble, diagnosis, seconds=time.perf_counter() - began)


def _check_size(walkers: int, most_steps: int, n_dim: int) -> None:
    """Refuse a chain that memory may not hold before it ends."""
    each = 8 * walkers * (n_dim + 1)
    if most_steps * each > _MOST_BYTES:
        raise SettingError(
            f"{most_steps:,} steps of {walkers:,} walkers in {n_dim} dimensions may take "
            f"{most_steps * each / 1e9:,.0f} GB; give {_MOST_BYTES // each:,} steps at most, or fewer walkers"
        )


def _run(problem: SamplingProblem, ensemble: Ensemble, monitor: _Monitor) -> Diagnosis:
    """Advance until convergence or the last step; the steps of the checks depend on the number of steps alone.

    A check after which the journal goes on has found a shortcoming, and is not made again.
    """
    while True:
        done = ensemble.n_steps
        ends = done >= monitor.most_steps
        if done and (ends or (done == next_check(done - 1) and not monitor.recalling)):
            diagnosis = monitor.diagnosis = problem.diagnosis(ensemble)
            if ends or not diagnosis.shortcomings:
                return diagnosis
        until = min(next_check(done), monitor.most_steps)
        ensemble.advance(until, monitor.update)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Journalled:
    """Log density of proposals (n_walkers, n_dim), from the journal where it is recorded.

    All else in a step is arithmetic on random numbers of a seed: proposals and acceptance need not be recorded.
    """

    target: Callable[[Array], Array]
    journal: Journal

    def __call__(self, positions: Array) -> Array:
        inputs = digest_of(positions)
        recorded = self.journal.recall(
            "step", inputs, lambda record: _recorded_densities(record, len(positions))
        )
        if recorded is not None:
            return recorded
        densities = self.target(positions)
        # Tables are written in a tenth of the time of lists.
        self.journal.record("step", inputs, {"densities": densities[None]})
        return densities


def _recorded_densities(record: Mapping[str, Any], n_walkers: int) -> Array:
    """Log densities of a step, (n_walkers,), -inf outside the support; ValueError where one is no such number."""
    densities = array_of(record["densities"]).reshape(n_walkers)
    if not np.all(densities < np.inf):
        raise ValueError("a density is not a number")
    return densities


@dataclass(slots=True, kw_only=True)
class _Monitor:
    """Reports progress; the rate is that of steps that were not recalled."""

    most_steps: int
    began: float
    on_progress: Callable[[SamplingProgress], None] | None
    journal: Journal | None
    diagnosis: Diagnosis | None = None
    reported: float = 0.0
    recalled: tuple[int, float] = (0, 0.0)

    @property
    def recalling(self) -> bool:
        """Whether the next step is recorded."""
        return self.journal is not None and self.journal.recalling

    def update(self, steps: int) -> None:
        """Called after each step."""
        seconds = time.perf_counter() - self.began
        if self.recalling:
            self.recalled = (steps, seconds)
        first, before = self.recalled
        if self.on_progress is not None and seconds - self.reported >= _REPORT_EVERY:
            self.reported = seconds
            self.on_progress(
                SamplingProgress(
                    steps=steps,
                    most_steps=self.most_steps,
                    seconds=seconds,
                    steps_per_second=(steps - first) / max(seconds - before, 1e-9),
                    diagnosis=self.diagnosis,
                )
            )
