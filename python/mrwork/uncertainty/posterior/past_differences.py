"""A move for emcee: every walker at once, by differences of states that the ensemble has been in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from emcee import State
from emcee.moves import Move
from numpy.typing import NDArray

Array = NDArray[np.float64]

# A tenth of the steps take whole differences, which jump from mode to mode (ter Braak 2006).
_JUMPS = 0.1
# A little scatter of the factor, so that a walker can reach every place.
_SCATTER = 1e-5


class PastDifferences(Move):  # type: ignore[misc] # a base class without types
    """Differential evolution with the past (DE-MCZ, ter Braak and Vrugt 2008).

    A walker at x tries x + gamma (z1 - z2), gamma = 2.38 / sqrt(2 n_dim), with two states z1 and z2 from the latter
    half of all walkers' past. What it tries depends on no other walker's present, so all are one batch, where a move
    that draws from the rest of the ensemble wants two. The past grows, so that the move changes ever less; its early
    half, which may not have arrived yet, is left out.
    """

    def __init__(self, past: Callable[[], Array]) -> None:
        self._past = past

    def propose(self, model: Any, state: Any) -> tuple[Any, NDArray[np.bool_]]:
        """Try once for each walker; `past` gives positions, shape (n_past, n_walkers, n_dim)."""
        random = model.random
        n_walkers, n_dim = state.coords.shape
        past = self._past()
        states = past[len(past) // 2 :].reshape(-1, n_dim)
        first = random.randint(len(states), size=n_walkers)
        second = (first + 1 + random.randint(len(states) - 1, size=n_walkers)) % len(states)
        gamma = 1.0 if random.rand() < _JUMPS else 2.38 / np.sqrt(2.0 * n_dim)
        factor = gamma * (1.0 + _SCATTER * random.randn(n_walkers, 1))
        tried = state.coords + factor * (states[first] - states[second])
        densities, _ = model.compute_log_prob_fn(tried)
        accepted = np.log(random.rand(n_walkers)) < densities - state.log_prob
        return self.update(state, State(tried, log_prob=densities), accepted), accepted
