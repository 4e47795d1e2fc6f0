"""Differential evolution of SciPy with the ask/tell interface."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable
from dataclasses import dataclass, field
from queue import SimpleQueue

import numpy as np
from numpy.typing import NDArray

from mrwork.search.course import Course
from mrwork.search.peers import Peer, PeerOptimiser
from mrwork.search.rules import LARGEST_POPULATION, EliteRule, StopRules, check_ranges
from mrwork.search.unit_cube import latin_hypercube


@dataclass(frozen=True, slots=True, kw_only=True)
class ScipyDifferentialEvolution(PeerOptimiser):
    """Differential evolution of SciPy: best1bin with deferred updating, otherwise with its defaults.

    Parameters
    ----------
    population
        Members, at least 5; 120 is SciPy's default for 8 parameters.
    stop
        When to end.
    elite
        Which points of the run are kept as starts of a local minimisation.
    """

    population: int = 120
    stop: StopRules = field(default_factory=StopRules)
    elite: EliteRule = field(default_factory=EliteRule)

    def __post_init__(self) -> None:
        check_ranges({"population": (self.population, 5, LARGEST_POPULATION)})

    def _starter(self, course: Course, n_params: int) -> Callable[[int], Peer]:
        populations = iter(latin_hypercube(course.streams, self.population, n_params))
        return lambda seed: _ScipyPeer(next(populations), seed)


class _ScipyPeer:
    """SciPy calls the objective, so it runs in a thread, where the objective waits for the misfits of a generation.

    The thread ends with the search, or when this object is garbage-collected.
    """

    def __init__(self, population: NDArray[np.float64], seed: int) -> None:
        self._candidates: SimpleQueue[NDArray[np.float64] | Exception] = SimpleQueue()
        self._misfits: SimpleQueue[NDArray[np.float64] | None] = SimpleQueue()
        arguments = (population, seed, self._candidates, self._misfits)
        threading.Thread(target=_evolve, args=arguments, daemon=True).start()
        weakref.finalize(self, self._misfits.put, None)

    def ask(self) -> NDArray[np.float64]:
        candidates = self._candidates.get()
        if isinstance(candidates, Exception):
            raise candidates
        return candidates

    def tell(self, misfit: NDArray[np.float64]) -> None:
        self._misfits.put(misfit)


class _AbandonedError(Exception):
    """The search was abandoned: there are no more misfits."""


def _evolve(
    population: NDArray[np.float64],
    seed: int,
    candidates: SimpleQueue[NDArray[np.float64] | Exception],
    misfits: SimpleQueue[NDArray[np.float64] | None],
) -> None:
    def objective(units: NDArray[np.float64]) -> NDArray[np.float64]:
        candidates.put(units.T.copy())
        answer = misfits.get()
        if answer is None:
            raise _AbandonedError
        return answer

    try:
        from scipy.optimize import Bounds, differential_evolution

        differential_evolution(
            objective,  # type: ignore[arg-type] # the stubs do not have vectorised objectives
            Bounds(np.zeros(population.shape[1]), np.ones(population.shape[1])),
            init=population,
            rng=np.random.default_rng(seed),
            vectorized=True,
            updating="deferred",
            polish=False,
            # Our stop rules end the search, not the tolerances of SciPy.
            tol=0.0,
            atol=-1.0,
            maxiter=10**9,
        )
    except _AbandonedError:
        pass
    except Exception as error:
        # Passed on to `ask`, which would otherwise wait for ever.
        candidates.put(error)
