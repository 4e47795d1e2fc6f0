"""Differential evolution of SciPy behind ask and tell.

SciPy calls the objective, we call the optimiser: it runs in a thread of its own that waits, in its vectorised
objective, for the misfits of a whole generation. The thread ends with the search, or when nothing refers to it.
"""

from __future__ import annotations

import math
import threading
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, field
from queue import SimpleQueue

import numpy as np
from numpy.typing import NDArray

from mrwork.search.course import Course
from mrwork.search.cube import latin_hypercube
from mrwork.search.elite import EliteRule
from mrwork.search.peers.peer import PeerState, ask_peers, peers_begun, tell_peers
from mrwork.search.proposal import Proposal
from mrwork.search.ranges import check_ranges
from mrwork.search.stop_rules import StopRules


@dataclass(frozen=True, slots=True, kw_only=True)
class ScipyDifferentialEvolution:
    """Settings of SciPy's differential evolution: best1bin with deferred updating, all else as it comes.

    Parameters
    ----------
    population
        Members, at least 5; 120 is SciPy's own choice for 8 parameters.
    stop
        When to end.
    elite
        Which finds of the run are kept.
    """

    population: int = 120
    stop: StopRules = field(default_factory=StopRules)
    elite: EliteRule = field(default_factory=EliteRule)

    def __post_init__(self) -> None:
        check_ranges({"population": (self.population, 5, math.inf)})

    def start(self, n_params: int, rng: int, replicates: Sequence[int] = (0,)) -> PeerState:
        """One evolution for each replicate, from a Latin hypercube."""
        course = Course.begun(n_params, rng, replicates, self.elite)
        populations = iter(latin_hypercube(course.streams, self.population, n_params))
        return peers_begun(course, self.population, lambda seed: _Evolution(next(populations), seed))

    def ask(self, state: PeerState) -> Proposal:
        """What the evolutions ask."""
        return ask_peers(state)

    def tell(self, state: PeerState, proposal: Proposal, misfit: NDArray[np.float64]) -> PeerState:
        """State after the simulations asked for; `misfit` (n_ask,), `inf` marks a failed one."""
        return tell_peers(state, proposal, misfit, elite=self.elite, stop=self.stop)


class _Evolution:
    def __init__(self, population: NDArray[np.float64], seed: int) -> None:
        self._asked: SimpleQueue[NDArray[np.float64] | Exception] = SimpleQueue()
        self._told: SimpleQueue[NDArray[np.float64] | None] = SimpleQueue()
        arguments = (population, seed, self._asked, self._told)
        threading.Thread(target=_evolve, args=arguments, daemon=True).start()
        weakref.finalize(self, self._told.put, None)

    def ask(self) -> NDArray[np.float64]:
        asked = self._asked.get()
        if isinstance(asked, Exception):
            raise asked
        return asked

    def tell(self, misfit: NDArray[np.float64]) -> None:
        self._told.put(misfit)


class _AbandonedError(Exception):
    """Nobody will tell any more."""


def _evolve(
    population: NDArray[np.float64],
    seed: int,
    asked: SimpleQueue[NDArray[np.float64] | Exception],
    told: SimpleQueue[NDArray[np.float64] | None],
) -> None:
    def misfits(units: NDArray[np.float64]) -> NDArray[np.float64]:
        asked.put(units.T.copy())
        answer = told.get()
        if answer is None:
            raise _AbandonedError
        return answer

    try:
        # Slow to load, and needed here only.
        from scipy.optimize import Bounds, differential_evolution

        differential_evolution(
            misfits,  # type: ignore[arg-type] # the stubs know no vectorised objective
            Bounds(np.zeros(population.shape[1]), np.ones(population.shape[1])),
            init=population,
            rng=np.random.default_rng(seed),
            vectorized=True,
            updating="deferred",
            polish=False,
            # Our rules end it, not those of the library.
            tol=0.0,
            atol=-1.0,
            maxiter=10**9,
        )
    except _AbandonedError:
        pass
    except Exception as error:
        # Raised again where the search is asked, which would otherwise wait for ever.
        asked.put(error)
