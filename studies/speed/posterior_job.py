"""The job of `study.py posterior`: one posterior, and the same density on each contender's simulation.

It is that of the searches' reference job: the non-symmetric Bouc-Wen model with 8 free parameters in the same box, and
independent Gaussian noise of unknown size, so 9 dimensions. The likelihood is tempered, for all alike.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mrwork import identify
from mrwork.identification import identifiable_form
from mrwork.uncertainty import Iid, Target, first_walkers
from studies.former.arrays import Floats
from studies.speed.attempt import BatchObjective
from studies.speed.search_job import REFERENCE, SearchJob, record

Density = Callable[[Floats], Floats]
"""Log posterior of each row."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PosteriorJob:
    """The target, where its walkers start, and the fit that they start about, (n_params,)."""

    search: SearchJob
    target: Target
    start: Floats
    walkers: Floats

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


def density_of(target: Target, objective: BatchObjective) -> Density:
    """The target with misfits from another simulation."""
    n_params, n_time = target.space.n_params, target.objective.n_time

    def density(position: Floats) -> Floats:
        values, inside = target.space.values(position)
        result = np.full(len(position), -np.inf)
        rows = np.flatnonzero(inside)
        if rows.size:
            # The squared misfit is the mean of squared residuals in deviations of the force.
            squared = n_time * objective(np.ascontiguousarray(values[rows, :n_params])) ** 2
            likelihood = target.noise.log_likelihood_of_sum(squared, n_time, values[rows, n_params:])
            result[rows] = target.temper * likelihood
        return result

    return density
