"""An ensemble of walkers that moves by differential evolution on the past, with the sampler of emcee.

The snooker move is left out: as implemented in emcee 3.1.6 it samples another density (a standard normal of 8
dimensions comes out with a variance of 0.63). The module stands apart because emcee and SciPy take long to load.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from emcee import EnsembleSampler, State
from emcee.moves import Move
from numpy.typing import NDArray

from mrwork.base.summary import Summarised
from mrwork.base.values import Floats
from mrwork.errors import SettingError

# As returned by `numpy.random.RandomState.get_state`.
RandomState = tuple[str, NDArray[np.uint32], int, int, float]

# Share of steps with gamma = 1, which jump between modes (ter Braak 2006).
_JUMPS = 0.1
# Relative scatter of gamma, so that a walker can reach every position.
_SCATTER = 1e-5


class PastDifferences(Move):  # type: ignore[misc] # a base class without types
    """Differential evolution with the past (DE-MCZ, ter Braak and Vrugt 2008).

    A walker at x proposes x + gamma (z1 - z2), gamma = 2.38 / sqrt(2 n_dim), with two states z1 and z2 from the second
    half of all walkers' past; so all walkers are one batch for the target, not one after the other as in emcee.
    """

    def __init__(self, target: Callable[[Floats], Floats], past: Callable[[], Floats]) -> None:
        self._target = target
        self._past = past

    def propose(self, model: Any, state: Any) -> tuple[Any, NDArray[np.bool_]]:
        """One proposal for each walker; `past` returns positions, shape (n_past, n_walkers, n_dim)."""
        random = model.random
        n_walkers, n_dim = state.coords.shape
        past = self._past()
        states = past[len(past) // 2 :].reshape(-1, n_dim)
        first = random.randint(len(states), size=n_walkers)
        second = (first + 1 + random.randint(len(states) - 1, size=n_walkers)) % len(states)
        gamma = 1.0 if random.rand() < _JUMPS else 2.38 / np.sqrt(2.0 * n_dim)
        factor = gamma * (1.0 + _SCATTER * random.randn(n_walkers, 1))
        tried = state.coords + factor * (states[first] - states[second])
        densities = self._target(tried)
        if np.isnan(densities).any():
            raise SettingError(
                "the log density is not a number; give a target that is -inf where there is none"
            )
        accepted = np.log(random.rand(n_walkers)) < densities - state.log_prob
        return self.update(state, State(tried, log_prob=densities), accepted), accepted


@dataclass(slots=True, kw_only=True, eq=False, repr=False)
class WalkerChain(Summarised):
    """Chain of positions, shape (n_steps + 1, n_walkers, n_dim), and log densities, (n_steps + 1, n_walkers).

    `at` holds the number of steps and the random state after them in one tuple, so that an interrupt cannot separate
    the two. The arrays may be longer than the chain.
    """

    target: Callable[[Floats], Floats]
    positions: Floats
    densities: Floats
    at: tuple[int, RandomState]

    @classmethod
    def begin(cls, target: Callable[[Floats], Floats], walkers: Floats, rng: int) -> WalkerChain:
        """An ensemble at its start, shape (n_walkers, n_dim), with its own random stream."""
        # emcee uses the legacy generator.
        stream = np.random.RandomState(np.random.MT19937(np.random.SeedSequence(rng)))
        return cls(
            target=target,
            positions=walkers[None].copy(),
            densities=target(walkers)[None],
            at=(0, _state_of(stream.get_state())),
        )

    @property
    def n_steps(self) -> int:
        """Number of steps done."""
        return self.at[0]

    @property
    def n_walkers(self) -> int:
        """Number of walkers, the second axis of the positions."""
        return int(self.positions.shape[1])

    def advance(self, until: int, on_step: Callable[[int], None]) -> None:
        """Advance to step `until`; `on_step` is called after each step."""
        done, random_state = self.at
        missing = until + 1 - len(self.positions)
        if missing > 0:
            self.positions = np.concatenate([self.positions, np.empty((missing, *self.positions.shape[1:]))])
            self.densities = np.concatenate([self.densities, np.empty((missing, self.n_walkers))])
        # The past is the chain itself, so a resumed chain has the same past.
        move = PastDifferences(self.target, lambda: self.positions[: self.n_steps + 1])
        sampler = EnsembleSampler(
            self.n_walkers, self.positions.shape[2], self.target, moves=move, vectorize=True
        )
        start = State(self.positions[done], log_prob=self.densities[done], random_state=random_state)
        steps = sampler.sample(start, iterations=until - done, store=False, skip_initial_state_check=True)
        for step, state in enumerate(steps, done + 1):
            self.positions[step] = state.coords
            self.densities[step] = state.log_prob
            self.at = (step, _state_of(state.random_state))
            on_step(step)


def _state_of(legacy: Any) -> RandomState:
    name, keys, position, has_gauss, cached = legacy
    return name, keys, int(position), int(has_gauss), float(cached)
