"""A posterior to be sampled about a fit: its target and settings, and the draws made from a chain."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork import _rust
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.identification.covariance import derivatives_by_model
from mrwork.identification.fit import Fit, Provenance
from mrwork.identification.problem import Problem
from mrwork.records import DamperTest
from mrwork.store.fingerprint import digest_of, package_version
from mrwork.uncertainty.identifiability.curvature import Scale
from mrwork.uncertainty.noise import noise_model
from mrwork.uncertainty.posterior.diagnostics import (
    LARGEST_RHAT,
    Diagnosis,
    autocorrelation_times,
    diagnose,
    kept,
)
from mrwork.uncertainty.posterior.draws import Draws, DrawsStatus, DrawSummary, summary_of
from mrwork.uncertainty.posterior.ensemble import Ensemble
from mrwork.uncertainty.posterior.prior import Prior
from mrwork.uncertainty.posterior.target import Target, Tempering
from mrwork.values import holds_arrays

Array = NDArray[np.float64]

_PACKAGES = ("mrwork", "numpy", "emcee", "arviz-stats")
# Largest number of draws per walker from which summaries are computed.
_MOST_ROWS = 1000


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class SamplingProblem:
    """Target and settings of a sampling run; `start`, shape (n_params,), is in the form that is sampled."""

    spec: DamperSpec
    target: Target
    bounds: Mapping[str, tuple[float, float]]
    priors: Mapping[str, Prior]
    start: Array
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
        """The problem that `sample` solves, from the same arguments.

        Raises
        ------
        SettingError
            Where the fit cannot be simulated on these tests, or a setting or a prior is impossible.
        UnknownNameError
            Where there is no such noise model, or a prior names an unknown parameter.
        """
        problem = Problem.of_fit(fit, tests, threads=threads)
        form, objective = problem.form, problem.objective
        theta = problem.inside(fit.theta)
        if not np.isfinite(objective(theta[None])[0]):
            raise SettingError(
                f"the fit of {fit.model} cannot be simulated on these tests; give those of the fit"
            )
        target = Target.of(
            form, objective, noise_model(noise), start=theta, priors=priors, tempering=tempering
        )
        n_dim = target.space.n_dim
        if walkers < 2 * n_dim or walkers % 2:
            raise SettingError(
                f"`walkers` is {walkers} for {n_dim} parameters with those of the noise; "
                f"give an even number, at least {2 * n_dim}"
            )
        return cls(
            spec=fit.spec,
            target=target,
            bounds=problem.settings.bounds,
            priors=priors,
            start=theta,
            walkers=walkers,
            rng=rng,
        )

    def fingerprint(self) -> dict[str, Any]:
        """Everything that determines the chain bit for bit; a stored chain is resumed only where it agrees."""
        objective = self.target.objective
        return {
            "model": self.spec.name,
            "current_laws": None if self.spec.current is None else asdict(self.spec.current),
            "noise": self.target.noise.name,
            "bounds": {name: list(self.bounds[name]) for name in sorted(self.bounds)},
            "priors": {
                name: {"kind": type(self.priors[name]).__name__} | _fields(self.priors[name])
                for name in sorted(self.priors)
            },
            "nuisances": list(objective.settings.nuisances),
            "temper": self.target.temper,
            "start": digest_of(self.start),
            "walkers": self.walkers,
            "seed": self.rng,
            "test": [
                {
                    "name": test.name,
                    "sha256": test.sha256,
                    "signals": digest_of(
                        test.dt,
                        test.n_settle,
                        test.displacement,
                        test.velocity,
                        test.force,
                        test.observation,
                    ),
                }
                | ({"uncompared": test.uncompared} if test.uncompared else {})
                for test in objective.tests
            ],
            "version": {name: package_version(name) for name in _PACKAGES},
        }

    def diagnosis(self, ensemble: Ensemble) -> Diagnosis:
        """Convergence diagnostics of a chain after its burn-in."""
        space = self.target.space
        values, _ = space.values(ensemble.positions[kept(ensemble.n_steps)])
        return diagnose(np.asarray(values)[..., np.array(space.box.free)], space.names)

    def draws(
        self, ensemble: Ensemble, diagnosis: Diagnosis, *, seconds: float, interrupted: bool = False
    ) -> Draws:
        """Draws from a chain of at least one step, after its burn-in and thinned."""
        rows = kept(ensemble.n_steps)
        space = self.target.space
        values = np.moveaxis(np.asarray(space.values(ensemble.positions[rows])[0]), 0, 1)
        chains = np.asarray(self.target.form.to_model(values[..., : space.n_params]))
        noise_chains = values[..., space.n_params :]
        summaries = self._summaries(np.concatenate([chains, noise_chains], axis=-1))
        longest = float(np.nanmax([1.0, *diagnosis.tau]))
        thin = max(1, int(longest / 2.0))
        status: DrawsStatus = "not_converged" if diagnosis.shortcomings else "converged"
        return Draws(
            model=self.spec.name,
            names=self.spec.names,
            noise_model=self.target.noise.name,
            noise_names=space.box.names[space.n_params :],
            chains=np.ascontiguousarray(chains[:, ::thin]),
            noise_chains=np.ascontiguousarray(noise_chains[:, ::thin]),
            densities=np.ascontiguousarray(ensemble.densities[rows].T[:, ::thin]),
            summaries=summaries,
            status="interrupted" if interrupted else status,
            verdict=self._verdict(ensemble.n_steps, diagnosis, summaries),
            temper=self.target.temper,
            n_steps=ensemble.n_steps,
            thinning=thin,
            seconds=seconds,
            provenance=self._provenance(),
            measured={test.name: test.force for test in self.target.objective.tests},
        )

    def _summaries(self, chains: Array) -> tuple[DrawSummary, ...]:
        """Summaries of the model's parameters, then the noise parameters; chains (n_walkers, n_kept, n_all)."""
        own, space = Box.of(self.spec).with_bounds(self.bounds), self.target.space
        names = self.spec.names + space.box.names[space.n_params :]
        units = [parameter.unit for parameter in self.spec.parameters] + ["1"] * len(
            self.target.noise.parameters
        )
        lower = own.lower + space.box.lower[space.n_params :]
        upper = own.upper + space.box.upper[space.n_params :]
        tau = autocorrelation_times(np.moveaxis(chains, 0, 1))
        strided = chains[:, :: max(1, ceil(chains.shape[1] / _MOST_ROWS))]
        found = [
            summary_of(
                np.ascontiguousarray(strided[..., index]),
                name=name,
                unit=units[index],
                bounds=(lower[index], upper[index]),
                tau=float(tau[index]),
            )
            for index, name in enumerate(names)
        ]
        theta = np.asarray(self.target.form.to_model(self.start))
        objective = self.target.objective
        scale = Scale.of(self.spec, own, objective.tests, theta)
        _, derivative = derivatives_by_model(objective.plain, self.target.form, self.start)
        judged = [
            each.judged(scale.of_parameter(self.spec, index, derivative[:, index]))
            for index, each in enumerate(found[: theta.size])
        ]
        return (*judged, *found[theta.size :])

    def _verdict(self, n_steps: int, diagnosis: Diagnosis, summaries: tuple[DrawSummary, ...]) -> str:
        if diagnosis.shortcomings:
            text = f"Not converged after {n_steps} steps: {'; '.join(diagnosis.shortcomings)}."
        else:
            ess = float(min(diagnosis.ess_bulk.min(), diagnosis.ess_tail.min()))
            text = (
                f"Converged after {n_steps} steps: R-hat below {LARGEST_RHAT} throughout, at least {ess:.0f} effective "
                f"draws, a chain of {diagnosis.length:.0f} autocorrelation times."
            )
        if self.target.temper < 1.0:
            n_time = self.target.objective.n_time
            text += (
                f" The {n_time} residuals were counted as {self.target.temper * n_time:.0f} independent ones."
            )
        for each in summaries:
            if each.at_bound:
                text += f" {each.name} {each.remark}: its interval is limited by the bound, not by the data."
        return text

    def _provenance(self) -> Provenance:
        objective = self.target.objective
        misfit = float(objective.plain(self.start[None])[0])
        return Provenance(
            versions={"python": platform.python_version()}
            | {name: package_version(name) for name in _PACKAGES},
            instruction_set=_rust.instruction_set(),
            inputs={test.label: test.sha256 for test in objective.tests},
            settings=self.fingerprint() | {"nrmse": misfit},
            rng=self.rng,
            created=datetime.now(UTC).isoformat(timespec="seconds"),
        )


def _fields(prior: Prior) -> dict[str, Any]:
    # Priors are dataclasses, which a protocol cannot state.
    return asdict(prior)  # type: ignore[call-overload,no-any-return]
