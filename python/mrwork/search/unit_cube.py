"""Random numbers of a search, and points of the unit cube.

The random numbers of a generation are a function of seed and generation. Philox is a counter-based generator: `key` and
`counter` are its whole state, so the stream of any generation is available without drawing those before it. The key is
(seed, 0), the upper half of the counter (purpose, generation); the lower half counts the numbers drawn (Salmon et al.,
SC'11, 2011).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats

_UNIFORM, _NORMAL, _LIBRARY_SEED = range(3)


@dataclass(frozen=True, slots=True, kw_only=True)
class Streams:
    """Random streams of a generation under one seed, one for each purpose; every call begins its stream anew."""

    rng: int
    generation: int = 0

    def uniform(self, *shape: int) -> Floats:
        """Uniform random numbers in [0, 1) of this shape."""
        return self._generator(_UNIFORM).random(shape)

    def normal(self, *shape: int) -> Floats:
        """Standard normal random numbers of this shape."""
        return self._generator(_NORMAL).standard_normal(shape)

    def library_seed(self) -> int:
        """Seed in [0, 2^31) for an optimiser of another library, which has its own generator."""
        return int(self._generator(_LIBRARY_SEED).integers(2**31))

    def _generator(self, purpose: int) -> np.random.Generator:
        key = np.array([self.rng, 0], dtype=np.uint64)
        return np.random.Generator(np.random.Philox(key=key, counter=[0, 0, purpose, self.generation]))


def latin_hypercube(streams: Streams, count: int, n_params: int) -> Floats:
    """One point per stratum of each gene, shape (count, n_params)."""
    drawn = streams.uniform(2, count, n_params)
    strata = np.argsort(drawn[0], axis=0, kind="stable")
    return np.asarray((strata + drawn[1]) / count)


def reflect(unit: Floats) -> Floats:
    """Reflect the real line into [0, 1] at 0 and 1; points inside keep their bits.

    Clipping would concentrate points on the faces of the cube; reflection keeps a uniform population uniform.
    """
    folded = unit.copy()
    outside = (unit < 0.0) | (unit > 1.0)
    folded[outside] = 1.0 - np.abs(1.0 - np.abs(unit[outside]) % 2.0)
    return folded


def others(uniform: Floats) -> NDArray[np.int64]:
    """Distinct other members for each member of a population, all equally likely, shape (n_population, n_others).

    `uniform` are numbers in [0, 1) of that shape.
    """
    size, n_others = uniform.shape
    taken = np.arange(size)[:, None]
    for index in range(n_others):
        # Index among the remaining members, converted to an index among all by skipping those taken, lowest first.
        member = (uniform[:, index] * (size - 1 - index)).astype(np.int64)
        for lower in np.sort(taken, axis=1).T:
            member += member >= lower
        taken = np.concatenate([taken, member[:, None]], axis=1)
    return taken[:, 1:]
