"""Posterior sampling of an identified damper by an ensemble of walkers, until the chain has converged."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from math import ceil
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from mrwork.base.arguments import Threads, checked
from mrwork.base.hints import Within
from mrwork.base.progress import OnProgress, Progress
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.coordinates import Box
from mrwork.errors import JournalError, SettingError
from mrwork.identification.covariance import Slopes
from mrwork.identification.fit import Fit, beside_likelihood
from mrwork.identification.problem import provenance_with
from mrwork.identification.verdicts import judge_interval, parameter_scales
from mrwork.records import DamperTest
from mrwork.records.damper_test import as_tests
from mrwork.records.observation import Effect
from mrwork.store.codec import digest_of, package_version
from mrwork.store.journal import Journal
from mrwork.store.long_call import LongCall
from mrwork.uncertainty.noise import noise_model
from mrwork.uncertainty.posterior.draws import (
    LARGEST_RHAT,
    Diagnosis,
    Draws,
    DrawsStatus,
    DrawSummary,
    autocorrelation_times,
    diagnose,
    next_check,
    select_kept_rows,
    summary_of,
)
from mrwork.uncertainty.posterior.laplace import first_walkers, mode_near
from mrwork.uncertainty.posterior.target import Prior, Steps, Target, Tempering, Walkers

if TYPE_CHECKING:
    from mrwork.uncertainty.posterior.walkers import WalkerChain


_PACKAGES = ("mrwork", "numpy", "emcee", "arviz-stats")
# Largest number of draws per walker from which summaries are computed.
_MOST_ROWS = 1000


@array_dataclass()
class SamplingProblem:
    """Target and settings of a sampling run."""

    fit: Fit
    target: Target
    priors: Mapping[str, Prior]
    walkers: int
    rng: int

    @classmethod
    def of_fit(
        cls,
        fit: Fit,
        tests: tuple[DamperTest, ...],
        *,
        noise: str,
        priors: Mapping[str, Prior],
        tempering: Tempering | None,
        walkers: int,
        rng: int,
        threads: int,
    ) -> SamplingProblem:
        """The problem that `sample` solves, from the same arguments."""
        target = Target.of_fit(
            fit, tests, noise_model(noise), tempering=tempering, priors=priors, threads=threads
        )
        if not np.isfinite(target.objective(target.start[None])[0]):
            raise SettingError(
                f"the fit of {fit.model} cannot be simulated on these tests; give the tests of the fit"
            )
        n_dim = target.space.n_dim
        if walkers < 2 * n_dim or walkers % 2:
            raise SettingError(
                f"`walkers` is {walkers} for {n_dim} parameters of model and noise; "
                f"give an even number, at least {2 * n_dim}"
            )
        return cls(fit=fit, target=target, priors=priors, walkers=walkers, rng=rng)

    def fingerprint(self) -> dict[str, Any]:
        """All inputs that determine the chain to the bit; a stored chain is resumed only if they agree."""
        objective, laws = self.target.objective, self.fit.spec.current_laws
        bounds = objective.settings.bounds
        return {
            "model": self.fit.spec.name,
            "current_laws": None if laws is None else asdict(laws),
            "noise": self.target.noise.name,
            "bounds": {name: list(bounds[name]) for name in sorted(bounds)},
            "priors": {
                # Priors are dataclasses, which a protocol cannot state.
                name: {"kind": type(prior).__name__} | asdict(prior)  # type: ignore[call-overload] # priors are dataclasses
                for name, prior in sorted(self.priors.items())
            },
            "each": [effect.name for effect in objective.settings.observing.of_each],
            "temper": self.target.temper,
            "start": digest_of(self.target.start),
            "walkers": self.walkers,
            "seed": self.rng,
            "test": [
                {
                    "name": test.name,
                    "sha256": test.sha256,
                    "signals": digest_of(
                        test.dt, test.n_settle, test.displacement, test.velocity, test.force, test.observation
                    ),
                }
                | ({"uncompared": test.uncompared} if test.uncompared else {})
                for test in objective.tests
            ],
            "version": {name: package_version(name) for name in _PACKAGES},
        }

    @property
    def _effects(self) -> dict[str, Effect]:
        return {effect.parameter: effect for effect in self.target.objective.compared[0].free}

    def diagnosis(self, ensemble: WalkerChain) -> Diagnosis:
        """Convergence diagnostics of a chain after its burn-in."""
        space = self.target.space
        values, _ = space.values(ensemble.positions[select_kept_rows(ensemble.n_steps)])
        return diagnose(np.asarray(values)[..., np.array(space.box.free)], space.names)

    def draws(
        self, ensemble: WalkerChain, diagnosis: Diagnosis, *, seconds: float, interrupted: bool = False
    ) -> Draws:
        """Draws from a chain of at least one step, after its burn-in and thinned."""
        rows = select_kept_rows(ensemble.n_steps)
        space = self.target.space
        values = np.moveaxis(np.asarray(space.values(ensemble.positions[rows])[0]), 0, 1)
        # Parameters of the model, and effects on the recorded force that are free.
        chains = np.asarray(self.target.form.to_model(values[..., : space.n_params]))
        noise_chains = values[..., space.n_params :]
        summaries = self._summaries(np.concatenate([chains, noise_chains], axis=-1))
        longest = float(np.nanmax([1.0, *diagnosis.tau]))
        thin = max(1, int(longest / 2.0))
        status: DrawsStatus = "not_converged" if diagnosis.shortcomings else "converged"
        return Draws(
            model=self.fit.spec.name,
            names=(*self.fit.spec.names, *self._effects),
            n_params=len(self.fit.spec.names),
            noise_model=self.target.noise.name,
            noise_names=space.box.names[space.n_params :],
            chains=np.ascontiguousarray(chains[:, ::thin]),
            noise_chains=np.ascontiguousarray(noise_chains[:, ::thin]),
            densities=np.ascontiguousarray(ensemble.densities[rows].T[:, ::thin]),
            summaries=summaries,
            status="interrupted" if interrupted else status,
            sentence=self._sentence(ensemble.n_steps, diagnosis, summaries),
            temper=self.target.temper,
            n_steps=ensemble.n_steps,
            thinning=thin,
            seconds=seconds,
            provenance=provenance_with(
                self.fingerprint() | {"nrmse": float(self.target.objective(self.target.start[None])[0])},
                self.target.objective.tests,
                packages=_PACKAGES,
                rng=self.rng,
            ),
            measured={test.name: test.force for test in self.target.objective.tests},
            remarks=tuple(
                beside_likelihood(self.fit, {summary.name: summary.deviation for summary in summaries})
            ),
        )

    def _summaries(self, chains: Floats) -> tuple[DrawSummary, ...]:
        """Summaries of the model's parameters, of effects and of the noise; chains (n_walkers, n_kept, n_all)."""
        box, space = (
            Box.of(self.fit.spec).with_bounds(self.target.objective.settings.bounds),
            self.target.space,
        )
        n_form, effects = space.n_params - len(self._effects), self._effects.values()
        names = self.fit.spec.names + space.box.names[n_form:]
        units = [parameter.unit for parameter in self.fit.spec.parameters] + [
            effect.unit for effect in effects
        ]
        units += ["1"] * len(self.target.noise.parameters)
        lower = box.lower + space.box.lower[n_form:]
        upper = box.upper + space.box.upper[n_form:]
        tau = autocorrelation_times(np.moveaxis(chains, 0, 1))
        strided = chains[:, :: max(1, ceil(chains.shape[1] / _MOST_ROWS))]
        summaries = [
            summary_of(
                np.ascontiguousarray(strided[..., index]),
                name=name,
                unit=units[index],
                bounds=(lower[index], upper[index]),
                tau=float(tau[index]),
            )
            for index, name in enumerate(names)
        ]
        theta = np.asarray(self.target.form.to_model(self.target.start))[: len(self.fit.spec.names)]
        objective = self.target.objective
        scales = parameter_scales(self.fit.spec, box, objective.tests, theta)
        sensitivities = np.linalg.norm(
            Slopes.at(objective, self.target.form, self.target.start).by_model(), axis=0
        ).tolist()
        # The sensitivities are of the effects on the recorded force, too, which have no verdict.
        for index, (scale, sensitivity) in enumerate(zip(scales, sensitivities, strict=False)):
            interval = summaries[index].interval
            if interval is not None and names[index] not in objective.settings.ties:
                verdict = judge_interval(interval, scale, sensitivity, self.fit.coherent)
                summaries[index] = replace(summaries[index], verdict=verdict)
        return tuple(summaries)

    def _sentence(self, n_steps: int, diagnosis: Diagnosis, summaries: tuple[DrawSummary, ...]) -> str:
        if diagnosis.shortcomings:
            text = f"Not converged after {n_steps} steps: {'; '.join(diagnosis.shortcomings)}."
        else:
            ess = float(min(diagnosis.ess_bulk.min(), diagnosis.ess_tail.min()))
            text = (
                f"Converged after {n_steps} steps: R-hat below {LARGEST_RHAT} throughout, effective sample size at "
                f"least {ess:.0f}, a chain of {diagnosis.length:.0f} autocorrelation times."
            )
        if self.target.temper < 1.0:
            n_time = self.target.objective.n_time
            text += f" The {n_time} residuals were counted as {self.target.temper * n_time:.0f} effective samples."
        for summary in summaries:
            if summary.interval is not None and summary.interval.is_open:
                text += (
                    f" {summary.name} {summary.state}: its interval is limited by the bound, not by the data."
                )
        return text


# Seconds between two progress reports.
_REPORT_EVERY = 0.2
# Bytes of the longest chain, which memory may not hold before it ends; its diagnosis takes as much again.
_MOST_BYTES = 16 << 30


@checked
def sample(
    fit: Fit,
    tests: DamperTest | Sequence[DamperTest],
    *,
    noise: str = "iid",
    priors: Mapping[str, Prior] | None = None,
    tempering: Tempering | None = None,
    walkers: Walkers = 64,
    most_steps: Steps = 20_000,
    rng: Annotated[int, Within(least=0, most=2**32 - 1)] = 0,
    threads: Threads = 0,
    journal: Journal | None = None,
    on_progress: OnProgress | None = None,
) -> Draws:
    """Sample the posterior of a damper's parameters and of the noise, with an ensemble of walkers about a fit.

    Sampling stops when the chain is 50 autocorrelation times long, the rank-normalised R-hat of every parameter is
    below 1.01, and there are at least 400 effective draws of its bulk and of its tails. The first quarter of the chain
    is discarded as burn-in. Bounds and observation models are as in the fit.

    Parameters
    ----------
    fit
        The fit near which walkers start, about the mode of the posterior; its bounds are the box of the prior. A fit of
        a Spencer form is sampled in the normalised form, and mapped back.
    tests
        The tests of the fit, or others of the same damper.
    noise
        Noise model of the force. "iid" is independent, "ar1" of first-order autocorrelation.
    priors
        Prior of a parameter, by default uniform over its range; `noise.sigma` and so on for the noise. Give the names
        of the form that is sampled. The default is uniform over the box, on the parameter's own scale; for a stiffness
        k and its free length x0, uniform in k and k x0.
    tempering
        Factor of the log-likelihood, or "effective": the ratio of effective to all samples at the fit; by default
        "effective", and 1 for "ar1". With it correlated residuals are not counted as independent; see `Target.of_fit`.
    walkers
        Number of walkers, even and at least twice the number of parameters of model and noise.
    most_steps
        Largest number of steps; the sentence on a chain that reaches it says what is missing.
    rng
        Seed of the walkers. The same seed gives the same bits on any number of threads.
    journal
        To it goes the log density of every step, from which the chain is built again: a journal that is resumed
        continues the chain to the same bits as without the interruption. Only `most_steps` and `threads` may differ.
    on_progress
        Called about five times a second.

    Returns
    -------
    Draws
        Draws of parameters and noise, diagnostics, provenance.

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
        On Ctrl-C, carrying the `Draws` so far, `None` before the first step; the chain is in the journal, too.

    Examples
    --------
    >>> import mrwork as mr
    >>> test = mr.synthetic_test("spencer1997")
    >>> fit = mr.identify("normalised_bouc_wen", test)  # doctest: +SKIP
    >>> draws = mr.sample(fit, test)  # doctest: +SKIP
    >>> print(draws.sentence)  # doctest: +SKIP
    """
    call = _Sampling(most_steps=most_steps, on_progress=on_progress, journal=journal)
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
    per_step = 8 * walkers * (problem.target.space.n_dim + 1)
    if most_steps * per_step > _MOST_BYTES:
        raise SettingError(
            f"{most_steps:,} steps of {walkers:,} walkers in {problem.target.space.n_dim} dimensions may take "
            f"{most_steps * per_step / 1e9:,.0f} GB; give {_MOST_BYTES // per_step:,} steps at most, or fewer walkers"
        )
    density: Callable[[Floats], Floats] = problem.target
    if journal is not None:
        journal.agree("sampling", problem.fingerprint())

        def density(positions: Floats) -> Floats:
            # Tables are written in a tenth of the time of lists.
            return np.asarray(call.array("step", lambda: problem.target(positions)[None], positions)[0])

    mode = mode_near(problem.target, problem.target.start)
    origins = first_walkers(problem.target, mode, walkers, np.random.default_rng(rng))
    # emcee takes half a second to load.
    from mrwork.uncertainty.posterior.walkers import WalkerChain

    ensemble = WalkerChain.begin(density, origins, rng)
    if journal is not None and not np.isfinite(ensemble.densities[0]).all():
        # Walkers start where it is.
        raise JournalError(
            f"{journal.path} begins with densities that are not finite; run again with --replace, not --resume"
        )

    def so_far() -> Draws | None:
        if ensemble.n_steps == 0:
            return None
        return problem.draws(ensemble, problem.diagnosis(ensemble), seconds=call.seconds, interrupted=True)

    call.so_far = so_far
    with call.keeping("sampling"):
        diagnosis = _run(problem, ensemble, call)
    return problem.draws(ensemble, diagnosis, seconds=call.seconds)


def _run(problem: SamplingProblem, ensemble: WalkerChain, call: _Sampling) -> Diagnosis:
    """Diagnosis after convergence or the last step; a check that the journal passed is not repeated."""
    while True:
        done = ensemble.n_steps
        ends = done >= call.most_steps
        if done and (ends or (done == next_check(done - 1) and not call.recalling)):
            diagnosis = call.diagnosis = problem.diagnosis(ensemble)
            if ends or not diagnosis.shortcomings:
                return diagnosis
        until = min(next_check(done), call.most_steps)
        ensemble.advance(until, call.update)


@dataclass(slots=True, kw_only=True, eq=False)
class _Sampling(LongCall[Draws]):
    """A sampling that runs; the rate is of computed steps, without the first, which includes the set-up."""

    most_steps: int
    diagnosis: Diagnosis | None = None
    reported: float = -math.inf

    def update(self, steps: int) -> None:
        """Report the steps, called after each step of the ensemble; where it must be longer, for how long at least."""
        if self.seconds - self.reported < _REPORT_EVERY and not self.recalling:
            return
        self.reported = self.seconds
        least, said = 0.0, list[str]()
        if self.diagnosis is not None:
            least, rhat = self.diagnosis.least_steps, float(self.diagnosis.rhat.max())
            said = [f"R-hat {rhat:.3f}, {self.diagnosis.length:.0f} autocorrelation times"]
        needed = f" of at least {least:.0f}" if steps < least < self.most_steps else ""
        self.report(
            Progress(
                stage="sampling",
                said=(f"step {steps}{needed}", *said),
                share=steps / self.most_steps,
                at_most=True,
                numbers={"steps": steps},
                rated=("steps",),
            )
        )
