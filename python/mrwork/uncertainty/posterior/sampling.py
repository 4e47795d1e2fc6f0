"""A sampling under way: what it rests on, and the draws that can be made of its chain at any time."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork import _rust
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec
from mrwork.identification.fit import Provenance
from mrwork.store import digest_of
from mrwork.uncertainty.posterior.diagnosis import (
    LARGEST_RHAT,
    Diagnosis,
    autocorrelation_times,
    diagnose,
    kept,
)
from mrwork.uncertainty.posterior.draws import Draws, DrawsStatus, DrawSummary, summary_of
from mrwork.uncertainty.posterior.ensemble import Ensemble
from mrwork.uncertainty.posterior.prior import Prior
from mrwork.uncertainty.posterior.space import NOISE
from mrwork.uncertainty.posterior.target import Target

Array = NDArray[np.float64]

_PACKAGES = ("mrwork", "numpy", "emcee", "arviz-stats")
# Rows of a walker that summaries are computed from, at most.
_MOST_ROWS = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampling:
    """What stays the same from the first step to the draws; `start` is in the form that is sampled."""

    spec: DamperSpec
    target: Target
    bounds: Mapping[str, tuple[float, float]]
    priors: Mapping[str, Prior]
    start: Array
    walkers: int
    rng: int

    def premises(self) -> dict[str, Any]:
        """All that the chain follows from, bit for bit: what a file and who resumes it share."""
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
            "nuisances": list(objective.nuisances),
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
                for test in objective.tests
            ],
            "version": {name: version(name) for name in _PACKAGES},
        }

    def diagnosis(self, ensemble: Ensemble) -> Diagnosis:
        """How the chain stands, after its burn-in."""
        space = self.target.space
        values, _ = space.values(ensemble.positions[kept(ensemble.n_steps)])
        return diagnose(np.asarray(values)[..., np.array(space.box.free)], space.names)

    def draws(
        self, ensemble: Ensemble, diagnosis: Diagnosis, *, seconds: float, interrupted: bool = False
    ) -> Draws:
        """The draws of a chain of at least one step."""
        rows = kept(ensemble.n_steps)
        space = self.target.space
        values = np.moveaxis(np.asarray(space.values(ensemble.positions[rows])[0]), 0, 1)
        chains = np.asarray(self.target.form.back(values[..., : space.n_params]))
        noise_chains = values[..., space.n_params :]
        summaries = self._summaries(np.concatenate([chains, noise_chains], axis=-1))
        longest = float(np.nanmax([1.0, *diagnosis.tau]))
        thin = max(1, int(longest / 2.0))
        shortcomings = diagnosis.shortcomings
        status: DrawsStatus = "not_converged" if shortcomings else "converged"
        return Draws(
            model=self.spec.name,
            names=self.spec.names,
            noise_model=self.target.noise.name,
            noise_names=self._noise_names,
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

    @property
    def _noise_names(self) -> tuple[str, ...]:
        return tuple(NOISE + each.name for each in self.target.noise.parameters)

    def _summaries(self, chains: Array) -> tuple[DrawSummary, ...]:
        """Of each parameter of the model asked for, then of the noise; chains (n_walkers, n_kept, n_all)."""
        asked = Box.of(self.spec).with_bounds(self.bounds)
        noise = self.target.noise.parameters
        names = self.spec.names + self._noise_names
        units = [parameter.unit for parameter in self.spec.parameters] + ["1"] * len(noise)
        pairs = [
            *zip(asked.lower, asked.upper, strict=True),
            *((each.lower, each.upper) for each in noise),
        ]
        tau = autocorrelation_times(np.moveaxis(chains, 0, 1))
        strided = chains[:, :: max(1, ceil(chains.shape[1] / _MOST_ROWS))]
        return tuple(
            summary_of(
                np.ascontiguousarray(strided[..., index]),
                name=name,
                unit=units[index],
                bounds=pairs[index],
                tau=float(tau[index]),
            )
            for index, name in enumerate(names)
        )

    def _verdict(self, n_steps: int, diagnosis: Diagnosis, summaries: tuple[DrawSummary, ...]) -> str:
        shortcomings = diagnosis.shortcomings
        if shortcomings:
            said = f"Not converged after {n_steps} steps: {'; '.join(shortcomings)}."
        else:
            ess = float(min(diagnosis.ess_bulk.min(), diagnosis.ess_tail.min()))
            said = (
                f"Converged after {n_steps} steps: R-hat below {LARGEST_RHAT} throughout, at least {ess:.0f} effective "
                f"draws, a chain of {diagnosis.length:.0f} autocorrelation times."
            )
        if self.target.temper < 1.0:
            n_time = self.target.objective.n_time
            said += (
                f" The {n_time} residuals were counted as {self.target.temper * n_time:.0f} independent ones."
            )
        for each in summaries:
            if each.remark.startswith("piles"):
                said += f" {each.name} {each.remark}: there its interval ends with the box, not where the data say."
        return said

    def _provenance(self) -> Provenance:
        objective = self.target.objective
        misfit = float(objective.plain(self.start[None])[0])
        return Provenance(
            versions={"python": platform.python_version()} | {name: version(name) for name in _PACKAGES},
            instruction_set=_rust.instruction_set(),
            inputs={test.path or test.name: test.sha256 for test in objective.tests},
            settings=self.premises() | {"nrmse": misfit},
            rng=self.rng,
            created=datetime.now(UTC).isoformat(timespec="seconds"),
        )


def _fields(prior: Prior) -> dict[str, Any]:
    # Priors are dataclasses; a protocol cannot say so.
    return asdict(prior)  # type: ignore[call-overload,no-any-return]
