"""The job of `study.py posterior`: one posterior, and the same density on each contender's simulation.

It is that of the searches' reference job: the non-symmetric Bouc-Wen model with 8 free parameters in the same box, and
independent Gaussian noise of unknown size, so 9 dimensions. The likelihood is tempered, for all alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork import identify
from mrwork.identification import identifiable_form
from mrwork.uncertainty import Iid, Target, first_walkers
from studies.speed.search_job import REFERENCE, SearchJob, record


@dataclass(frozen=True, slots=True, kw_only=True)
class PosteriorSettings:
    """How much is measured; `choose_variant` looks for the fastest way to compile the peers."""

    steps: int
    walkers: int
    nuts_warmup: int
    nuts_draws: int
    choose_variant: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """Values measured before the turns began; `missing` libraries are left out."""

    test: str
    synthetic: bool
    n_time: int
    n_dim: int
    fit_percent: float
    temper: float
    threads: int
    missing: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class SamplerRow:
    """One sampler: `seconds` without `compile_seconds`; the least bulk ESS of all parameters, after the burn-in.

    `simulating_share` is the part of the seconds spent in densities; those of NUTS have no such part.
    """

    sampler: str
    threads: int
    seconds: float
    compile_seconds: float
    ess_min: float
    ess_per_second: float
    rhat: float
    evaluations: int
    simulating_share: float | None
    settings: str


Rows = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PosteriorJob:
    """The target, where its walkers start, and the fit that they start about, (n_params,)."""

    search: SearchJob
    target: Target
    start: Rows
    walkers: Rows

    @classmethod
    def of(cls, *, threads: int, n_walkers: int) -> PosteriorJob:
        """Fit the reference test, and place walkers about the fit."""
        search = SearchJob.of(record(REFERENCE), threads)
        box = search.box
        bounds = {
            name: (lower, upper) for name, lower, upper in zip(box.names, box.lower, box.upper, strict=True)
        }
        fit = identify(search.spec, search.test, bounds=bounds, observe="none", rng=1, threads=threads)
        form = identifiable_form(search.spec, bounds)
        start = np.asarray(form.box.inside(np.array(fit.theta)))
        target = Target.of(form, search.objective, Iid(), start=start, priors={}, tempering="effective")
        walkers = first_walkers(target, start, n_walkers, np.random.default_rng(1))
        return cls(search=search, target=target, start=start, walkers=walkers)
