"""CMA-ES of the library `cma` (Hansen & Ostermeier, Evol. Comput. 9, 2001, 159-195)."""

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
class CMAEvolution:
    """Settings of CMA-ES, from the middle of the box.

    Parameters
    ----------
    population
        Candidates of a generation; 10 is the library's own choice for 8 parameters.
    deviation
        The initial one of each gene, a share of the box.
    stop
        When to end.
    elite
        Which finds of the run are kept.
    """

    population: int = 10
    deviation: float = 0.3
    stop: StopRules = field(default_factory=lambda: StopRules(max_generations=1000))
    elite: EliteRule = field(default_factory=EliteRule)

    def __post_init__(self) -> None:
        check_ranges(
            {"population": (self.population, 4, math.inf), "deviation": (self.deviation, 1e-12, 1.0)}
        )

    def start(self, n_params: int, rng: int, replicates: Sequence[int] = (0,)) -> PeerState:
        """One evolution strategy for each replicate."""
        course = Course.begun(n_params, rng, replicates, self.elite)
        cma = library("cma")

        def begin(seed: int) -> _Evolution:
            options = {
                "bounds": [0.0, 1.0],
                "popsize": self.population,
                "verbose": -9,
                # Left to itself it seeds and uses the one generator that all of NumPy shares.
                "seed": math.nan,
                "randn": _Normal(seed),
            }
            return _Evolution(cma.CMAEvolutionStrategy(np.full(n_params, 0.5), self.deviation, options))

        return peers_begun(course, self.population, begin)

    def ask(self, state: PeerState) -> Proposal:
        """What the strategies ask."""
        return ask_peers(state)

    def tell(self, state: PeerState, proposal: Proposal, misfit: NDArray[np.float64]) -> PeerState:
        """State after the simulations asked for; `misfit` (n_ask,), `inf` marks a failed one."""
        return tell_peers(state, proposal, misfit, elite=self.elite, stop=self.stop)


class _Normal:
    """Random numbers of one strategy, as the library calls them."""

    def __init__(self, seed: int) -> None:
        self._generator = np.random.default_rng(seed)

    def __call__(self, *shape: int) -> NDArray[np.float64]:
        return self._generator.standard_normal(shape)


class _Evolution:
    def __init__(self, strategy: Any) -> None:
        self._strategy = strategy
        self._asked: list[NDArray[np.float64]] = []

    def ask(self) -> NDArray[np.float64]:
        self._asked = self._strategy.ask()
        return np.array(self._asked)

    def tell(self, misfit: NDArray[np.float64]) -> None:
        self._strategy.tell(self._asked, misfit.tolist())
