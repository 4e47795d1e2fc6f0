"""Whether walkers have told enough: autocorrelation time, rank-normalised R-hat, effective sample sizes."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from math import ceil
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Vehtari et al. (2021) for R-hat and the effective sizes; emcee's own rule for the length of a chain.
LARGEST_RHAT = 1.01
LEAST_ESS = 400.0
LEAST_LENGTH = 50.0
# While walkers find their way their past says nothing.
BURN_IN = 0.25
# R-hat and effective sizes are computed from so many steps at most, evenly taken.
_MOST_DRAWS = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis:
    """Per parameter, shape (n_params,): integrated autocorrelation time in steps, R-hat, bulk and tail ESS.

    Not a number where a parameter did not vary at all. `n_steps` of each walker count, those after the burn-in.
    """

    names: tuple[str, ...]
    n_steps: int
    tau: Array
    rhat: Array
    ess_bulk: Array
    ess_tail: Array

    @property
    def length(self) -> float:
        """Steps in units of the longest autocorrelation time; 0 where a walker never moved."""
        longest = float(np.max(self.tau))
        return self.n_steps / longest if longest > 0.0 else 0.0

    @property
    def shortcomings(self) -> tuple[str, ...]:
        """What is not as it should be, in words; none where the chain has converged."""
        found = []
        if not self.length >= LEAST_LENGTH:
            found.append(
                f"the chain is {self.length:.0f} autocorrelation times long where {LEAST_LENGTH:.0f} are wanted"
            )
        worst = int(np.argmax(np.where(np.isnan(self.rhat), np.inf, self.rhat)))
        if not self.rhat[worst] < LARGEST_RHAT:
            found.append(
                f"walkers disagree most on {self.names[worst]} (R-hat {self.rhat[worst]:.3f}, below {LARGEST_RHAT} "
                "is wanted)"
            )
        ess = np.minimum(self.ess_bulk, self.ess_tail)
        least = int(np.argmin(np.where(np.isnan(ess), -np.inf, ess)))
        if not ess[least] >= LEAST_ESS:
            found.append(
                f"{self.names[least]} has {ess[least]:.0f} effective draws where {LEAST_ESS:.0f} are wanted"
            )
        return tuple(found)


def diagnose(values: Array, names: tuple[str, ...]) -> Diagnosis:
    """Diagnose a chain, shape (n_steps, n_walkers, n_params), walkers as chains; its burn-in is left out before."""
    n_steps = len(values)
    by_chain = np.moveaxis(values[:: max(1, ceil(n_steps / _MOST_DRAWS))], 0, 1)
    columns = [np.ascontiguousarray(by_chain[:, :, index]) for index in range(values.shape[2])]
    told = [convergence(column) for column in columns]
    return Diagnosis(
        names=names,
        n_steps=n_steps,
        tau=autocorrelation_times(values),
        rhat=np.array([each.rhat for each in told]),
        ess_bulk=np.array([each.ess_bulk for each in told]),
        ess_tail=np.array([each.ess_tail for each in told]),
    )


class Convergence(NamedTuple):
    """Of one parameter; `mcse` is the Monte-Carlo standard error of its mean."""

    rhat: float
    ess_bulk: float
    ess_tail: float
    mcse: float


def convergence(chains: Array) -> Convergence:
    """Rank-normalised R-hat, effective sizes and Monte-Carlo error of draws, shape (n_chains, n_draws)."""
    # ArviZ takes a second to load, and leaves these functions unannotated.
    statistics: Any = import_module("arviz_stats.base").array_stats
    # What did not vary has no variance to divide by.
    with np.errstate(all="ignore"):
        return Convergence(
            rhat=float(statistics.rhat(chains, method="rank")),
            ess_bulk=float(statistics.ess(chains, method="bulk")),
            ess_tail=float(statistics.ess(chains, method="tail", prob=(0.05, 0.95))),
            mcse=float(statistics.mcse(chains, method="mean")),
        )


def autocorrelation_times(values: Array) -> Array:
    """Integrated autocorrelation time in steps, shape (n_params,), of a chain, (n_steps, n_walkers, n_params)."""
    from emcee.autocorr import integrated_time

    with np.errstate(all="ignore"):
        return np.asarray(integrated_time(values, tol=0, has_walkers=True))


def kept(n_steps: int) -> slice:
    """The rows of a chain, whose first is the start, that come after the burn-in."""
    return slice(1 + int(BURN_IN * n_steps), n_steps + 1)


def next_check(n_steps: int, *, first: int = 200, growth: float = 1.25) -> int:
    """When to diagnose next: a function of the steps alone, so that a resumed run ends where the other did."""
    check = first
    while check <= n_steps:
        check = ceil(check * growth)
    return check
