"""What an optimiser asks: candidates of the replicates that run, and from where on their misfit does not matter."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Proposal:
    """One generation of the replicates that run, to be simulated in one call.

    `population` (n_running, n_population, n_params) with `known` misfits (n_running, n_population). Those `changed` are
    asked, `known` is `inf` there. A misfit at or above its `limit` (n_running, n_population) counts as a failure,
    whatever it is exactly: a simulation may stop as soon as it gets there. `number` (n_running,) names the replicates.
    """

    number: NDArray[np.int64]
    population: NDArray[np.float64]
    known: NDArray[np.float64]
    changed: NDArray[np.bool_]
    limit: NDArray[np.float64]

    @property
    def unit(self) -> NDArray[np.float64]:
        """Candidates to simulate, shape (n_ask, n_params), replicate by replicate."""
        return self.population[self.changed]

    @property
    def replicate(self) -> NDArray[np.int64]:
        """Number of the replicate that asks each row, shape (n_ask,)."""
        return np.repeat(self.number, np.count_nonzero(self.changed, axis=1))

    @property
    def threshold(self) -> NDArray[np.float64]:
        """Misfit from which on a row's exact value does not matter, shape (n_ask,); `inf` where it always does."""
        return self.limit[self.changed]

    def accepted(self, misfit: NDArray[np.float64]) -> NDArray[np.float64]:
        """Misfits as the optimiser takes them, shape (n_ask,): `inf` at or above the threshold.

        They are the same whether a simulation went on to its end or stopped at its threshold.

        Parameters
        ----------
        misfit
            Shape (n_ask,), not negative; `inf` marks a failed or stopped simulation.

        Raises
        ------
        SettingError
            Where there is not one misfit per row, or one is no misfit.
        """
        misfit = np.asarray(misfit, dtype=np.float64)
        n_ask = np.count_nonzero(self.changed)
        if misfit.shape != (n_ask,):
            raise SettingError(
                f"`misfit` has shape {misfit.shape}, {n_ask} candidates were asked; "
                "give one misfit per row of the proposal's `unit`, in its order"
            )
        if not np.all(misfit >= 0.0):
            row = int(np.argmin(misfit >= 0.0))
            raise SettingError(
                f"a misfit is a number >= 0 or inf, row {row} has {misfit[row]}; "
                "mark a failed simulation with inf"
            )
        return np.where(misfit >= self.threshold, math.inf, misfit)

    def told(self, misfit: NDArray[np.float64]) -> NDArray[np.float64]:
        """Accepted misfits in their places, shape (n_running, n_population), `inf` where nothing was asked."""
        told = np.full(self.known.shape, math.inf)
        told[self.changed] = self.accepted(misfit)
        return told
