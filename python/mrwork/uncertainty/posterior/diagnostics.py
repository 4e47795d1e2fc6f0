"""Convergence of a Markov chain: autocorrelation time, R-hat, effective sizes, and when they are computed."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from math import ceil
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import Shape, Within, checked

Array = NDArray[np.float64]

# Limits on R-hat and effective sizes: Vehtari et al. (2021); on the length in autocorrelation times: emcee.
LARGEST_RHAT = 1.01
LEAST_ESS = 400.0
LEAST_LENGTH = 50.0
# Share of the chain that is discarded.
BURN_IN = 0.25
# Largest number of evenly spaced steps from which R-hat and effective sizes are computed.
_MOST_DRAWS = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis:
    """Convergence diagnostics, shape (n_params,): autocorrelation time in steps, R-hat, bulk and tail ESS.

    They are NaN for a parameter that did not vary. `n_steps` is the number of steps after the burn-in.
    """

    names: tuple[str, ...]
    n_steps: int
    tau: Array
    rhat: Array
    ess_bulk: Array
    ess_tail: Array

    @property
    def length(self) -> float:
        """Number of steps per longest autocorrelation time; 0 where a walker never moved."""
        longest = float(np.max(self.tau))
        return self.n_steps / longest if longest > 0.0 else 0.0

    @property
    def shortcomings(self) -> tuple[str, ...]:
        """Criteria that are not met, in words; empty where the chain has converged."""
        found = []
        if not self.length >= LEAST_LENGTH:
            found.append(
                f"the chain is {self.length:.0f} autocorrelation times long where {LEAST_LENGTH:.0f} are required"
            )
        worst = int(np.argmax(np.where(np.isnan(self.rhat), np.inf, self.rhat)))
        if not self.rhat[worst] < LARGEST_RHAT:
            found.append(
                f"walkers disagree most on {self.names[worst]} (R-hat {self.rhat[worst]:.3f}, below {LARGEST_RHAT} "
                "is required)"
            )
        ess = np.minimum(self.ess_bulk, self.ess_tail)
        least = int(np.argmin(np.where(np.isnan(ess), -np.inf, ess)))
        if not ess[least] >= LEAST_ESS:
            found.append(
                f"{self.names[least]} has {ess[least]:.0f} effective draws where {LEAST_ESS:.0f} are required"
            )
        return tuple(found)


def diagnose(values: Array, names: tuple[str, ...]) -> Diagnosis:
    """Diagnose a chain without its burn-in, shape (n_steps, n_walkers, n_params); walkers count as chains."""
    n_steps = len(values)
    by_chain = np.moveaxis(values[:: max(1, ceil(n_steps / _MOST_DRAWS))], 0, 1)
    columns = [np.ascontiguousarray(by_chain[:, :, index]) for index in range(values.shape[2])]
    diagnostics = [convergence(column) for column in columns]
    return Diagnosis(
        names=names,
        n_steps=n_steps,
        tau=autocorrelation_times(values),
        rhat=np.array([each.rhat for each in diagnostics]),
        ess_bulk=np.array([each.ess_bulk for each in diagnostics]),
        ess_tail=np.array([each.ess_tail for each in diagnostics]),
    )


class Convergence(NamedTuple):
    """Convergence of one parameter; `mcse` is the Monte-Carlo standard error of its mean."""

    rhat: float
    ess_bulk: float
    ess_tail: float
    mcse: float


@checked
def convergence(chains: Annotated[Array, Shape(("n_chains", "n_draws"))]) -> Convergence:
    """Rank-normalised R-hat, effective sizes and Monte-Carlo error of draws, shape (n_chains, n_draws)."""
    # ArviZ takes a second to load, and has no type annotations.
    statistics: Any = import_module("arviz_stats.base").array_stats
    # A constant chain has zero variance.
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


@checked
def kept(n_steps: Annotated[int, Within(least=1, most=2**53)]) -> slice:
    """Rows of a chain after the burn-in; its first row is the start."""
    return slice(1 + int(BURN_IN * n_steps), n_steps + 1)


def next_check(n_steps: int, *, first: int = 200, growth: float = 1.25) -> int:
    """Step of the next convergence check, a function of the step alone: a resumed run ends at the same step."""
    check = first
    while check <= n_steps:
        check = ceil(check * growth)
    return check
