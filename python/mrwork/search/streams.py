"""Random numbers of one generation of many replicates: a function of (seed, replicate, generation) alone.

Philox is a counter-based generator: `key` and `counter` are all of its state, so the stream of any generation of
any replicate is there without drawing those before it. The key is (seed, replicate), the upper half of the
counter (purpose, generation); the lower half counts the numbers drawn (Salmon et al., SC'11, 2011).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_UNIFORM, _NORMAL, _FOREIGN = range(3)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Streams:
    """The streams of some replicates: their numbers (n,) and their generations (n,) under one seed."""

    rng: int
    replicate: NDArray[np.int64]
    generation: NDArray[np.int64]

    def uniform(self, count: int) -> NDArray[np.float64]:
        """Numbers in [0, 1), shape (n, count)."""
        drawn = np.empty((len(self.replicate), count))
        for row, generator in enumerate(self._generators(_UNIFORM)):
            generator.random(out=drawn[row])
        return drawn

    def normal(self, count: NDArray[np.int64]) -> NDArray[np.float64]:
        """Standard normal numbers, `count` (n,) of each replicate one after the other, shape (sum of count,)."""
        stop = np.cumsum(count)
        drawn = np.empty(int(stop[-1]) if stop.size else 0)
        for first, last, generator in zip(stop - count, stop, self._generators(_NORMAL), strict=True):
            generator.standard_normal(out=drawn[first:last])
        return drawn

    def seeds(self) -> NDArray[np.int64]:
        """One number in [0, 2^31) of each replicate, for a library that takes a seed, shape (n,)."""
        return np.array([int(each.integers(2**31)) for each in self._generators(_FOREIGN)], dtype=np.int64)

    def _generators(self, purpose: int) -> Iterator[np.random.Generator]:
        # One generator moved from stream to stream: making a new one takes twenty times as long.
        philox = np.random.Philox(key=0)
        generator = np.random.Generator(philox)
        place = philox.state
        for replicate, generation in zip(self.replicate.tolist(), self.generation.tolist(), strict=True):
            place["state"]["key"][:] = (self.rng, replicate)
            place["state"]["counter"][:] = (0, 0, purpose, generation)
            philox.state = place
            yield generator
