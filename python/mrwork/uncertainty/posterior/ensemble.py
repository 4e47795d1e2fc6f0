"""An ensemble of walkers on its way: emcee, a chain that grows, and a random stream that can be put aside.

Walkers move by differences of their past. The snooker move is left out: as emcee 3.1.6 has it, it samples something
else (a standard normal of 8 dimensions comes out with a variance of 0.63).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# As `numpy.random.RandomState.get_state` gives it.
RandomState = tuple[str, NDArray[np.uint32], int, int, float]


@dataclass(slots=True, kw_only=True, eq=False)
class Ensemble:
    """Positions, shape (n_steps + 1, n_walkers, n_dim), and log densities, (n_steps + 1, n_walkers), so far.

    The first is the start. `at` is the number of steps and the state of the random stream after them, in one: an
    interrupt never comes between the two. The arrays may have room for more.
    """

    target: Callable[[Array], Array]
    positions: Array
    densities: Array
    at: tuple[int, RandomState]

    @classmethod
    def begin(cls, target: Callable[[Array], Array], walkers: Array, rng: int) -> Ensemble:
        """At the start, with a stream of its own."""
        # emcee draws from the legacy generator alone.
        stream = np.random.RandomState(np.random.MT19937(np.random.SeedSequence(rng)))
        return cls(
            target=target,
            positions=walkers[None].copy(),
            densities=target(walkers)[None],
            at=(0, _state_of(stream.get_state())),
        )

    @property
    def n_steps(self) -> int:
        """Steps done."""
        return self.at[0]

    @property
    def n_walkers(self) -> int:
        """Walkers."""
        return int(self.positions.shape[1])

    def advance(self, until: int, on_step: Callable[[int], None]) -> None:
        """Go on until so many steps are done; `on_step` is called after each."""
        # emcee takes a second to load.
        from emcee import EnsembleSampler, State

        from mrwork.uncertainty.posterior.past_differences import PastDifferences

        done, random_state = self.at
        self._make_room(until + 1)
        # The past is the chain itself, so a chain that is resumed has the past that it had.
        move = PastDifferences(lambda: self.positions[: self.n_steps + 1])
        sampler = EnsembleSampler(
            self.n_walkers, self.positions.shape[2], self.target, moves=move, vectorize=True
        )
        # emcee's wrapper would print the place where Ctrl-C meets a simulation.
        sampler.log_prob_fn = self.target
        start = State(self.positions[done], log_prob=self.densities[done], random_state=random_state)
        steps = sampler.sample(start, iterations=until - done, store=False, skip_initial_state_check=True)
        for step, state in enumerate(steps, done + 1):
            self.positions[step] = state.coords
            self.densities[step] = state.log_prob
            self.at = (step, _state_of(state.random_state))
            on_step(step)

    def _make_room(self, rows: int) -> None:
        missing = rows - len(self.positions)
        if missing > 0:
            self.positions = np.concatenate([self.positions, np.empty((missing, *self.positions.shape[1:]))])
            self.densities = np.concatenate([self.densities, np.empty((missing, self.n_walkers))])


def _state_of(legacy: Any) -> RandomState:
    name, keys, position, has_gauss, cached = legacy
    return name, keys, int(position), int(has_gauss), float(cached)
