"""The genetic algorithm of the library `pymoo` (Blank & Deb, IEEE Access 8, 2020, 89497-89509), as it comes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork.search.course import Course
from mrwork.search.elite import EliteRule
from mrwork.search.peers.peer import PeerState, ask_peers, library, peers_begun, tell_peers
from mrwork.search.proposal import Proposal
from mrwork.search.ranges import check_ranges
from mrwork.search.stop_rules import StopRules


@dataclass(frozen=True, slots=True, kw_only=True)
class PymooGA:
    """Settings of pymoo's GA: simulated binary crossover, polynomial mutation, survival of the fittest.

    Parameters
    ----------
    population
        Chromosomes.
    stop
        When to end.
    elite
        Which finds of the run are kept.
    """

    population: int = 60
    stop: StopRules = field(default_factory=StopRules)
    elite: EliteRule = field(default_factory=EliteRule)

    def __post_init__(self) -> None:
        check_ranges({"population": (self.population, 4, math.inf)})

    def start(self, n_params: int, rng: int, replicates: Sequence[int] = (0,)) -> PeerState:
        """One algorithm for each replicate."""
        course = Course.begun(n_params, rng, replicates, self.elite)
        problem = library("pymoo.core.problem").Problem(n_var=n_params, n_obj=1, xl=0.0, xu=1.0)
        termination = library("pymoo.core.termination").NoTermination
        genetic = library("pymoo.algorithms.soo.nonconvex.ga").GA

        def begin(seed: int) -> _Genetic:
            algorithm = genetic(pop_size=self.population)
            algorithm.setup(problem, termination=termination(), seed=seed, verbose=False)
            return _Genetic(algorithm)

        return peers_begun(course, self.population, begin)

    def ask(self, state: PeerState) -> Proposal:
        """What the algorithms ask."""
        return ask_peers(state)

    def tell(self, state: PeerState, proposal: Proposal, misfit: NDArray[np.float64]) -> PeerState:
        """State after the simulations asked for; `misfit` (n_ask,), `inf` marks a failed one."""
        return tell_peers(state, proposal, misfit, elite=self.elite, stop=self.stop)


class _Genetic:
    def __init__(self, algorithm: Any) -> None:
        self._algorithm = algorithm
        self._asked: Any = None

    def ask(self) -> NDArray[np.float64]:
        self._asked = self._algorithm.ask()
        return np.asarray(self._asked.get("X"), dtype=np.float64)

    def tell(self, misfit: NDArray[np.float64]) -> None:
        problem = library("pymoo.problems.static").StaticProblem(self._algorithm.problem, F=misfit[:, None])
        library("pymoo.core.evaluator").Evaluator().eval(problem, self._asked)
        self._algorithm.tell(infills=self._asked)
