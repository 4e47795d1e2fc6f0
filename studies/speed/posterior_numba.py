"""The density of `study.py posterior` with misfits from numba."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrwork.uncertainty import Target
from studies.speed.numba_objective import NumbaObjective
from studies.speed.posterior_job import Rows


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NumbaTarget:
    """The target with misfits from numba."""

    target: Target
    objective: NumbaObjective

    def __call__(self, position: Rows) -> Rows:
        """Log posterior of each row."""
        target = self.target
        values, inside = target.space.values(position)
        density = np.full(len(position), -np.inf)
        rows = np.flatnonzero(inside)
        if rows.size:
            n_params, n_time = target.space.n_params, target.objective.n_time
            # The squared misfit is the mean of squared residuals in deviations of the force.
            squared = n_time * self.objective.misfits(np.ascontiguousarray(values[rows, :n_params])) ** 2
            density[rows] = target.temper * target.noise.log_likelihood_of_sum(
                squared, n_time, values[rows, n_params:]
            )
        return density
