"""Random numbers of a search, and points of the unit cube.

The random numbers of a generation are a function of seed, replicate and generation. Philox is a counter-based
generator: `key` and `counter` are its whole state, so the stream of any generation is available without drawing those
before it. The key is (seed, replicate), the upper half of the counter (purpose, generation); the lower half counts the
numbers drawn (Salmon et al., SC'11, 2011).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import Seed, Shape, checked
from mrwork.base.hints import Within
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import SettingError

# Most numbers of one call, 8 bytes each.
_MOST = 10**9


def latin_hypercube(
    streams: Streams,
    count: Annotated[int, Within(least=1, most=10**6)],
    n_params: Annotated[int, Within(least=1, most=10_000)],
) -> Floats:
    """One point per stratum of each gene, shape (n_replicates, count, n_params)."""
    drawn = streams.uniform(2 * count * n_params).reshape(-1, 2, count, n_params)
    strata = np.argsort(drawn[:, 0], axis=1, kind="stable")
    return (strata + drawn[:, 1]) / count


def reflect(unit: Floats) -> Floats:
    """Reflect the real line into [0, 1] at 0 and 1; points inside keep their bits.

    Clipping would concentrate points on the faces of the cube; reflection keeps a uniform population uniform.
    """
    folded = unit.copy()
    outside = (unit < 0.0) | (unit > 1.0)
    folded[outside] = 1.0 - np.abs(1.0 - np.abs(unit[outside]) % 2.0)
    return folded


def others(uniform: Floats, size: int) -> NDArray[np.int64]:
    """Distinct other members for each member of a group of `size`, shape (..., size, n_others), all equally likely.

    `uniform` are numbers in [0, 1), shape (..., size, n_others); those of member j along the last axis.
    """
    n_others = uniform.shape[-1]
    taken = np.broadcast_to(np.arange(size)[:, None], (*uniform.shape[:-1], 1))
    for k in range(n_others):
        # Index among the remaining members, converted to an index among all by skipping those taken, lowest first.
        member = (uniform[..., k] * (size - 1 - k)).astype(np.int64)
        for lower in np.moveaxis(np.sort(taken, axis=-1), -1, 0):
            member += member >= lower
        taken = np.concatenate([taken, member[..., None]], axis=-1)
    return taken[..., 1:]


_UNIFORM, _NORMAL, _LIBRARY_SEED = range(3)


@checked
@array_dataclass(repr=False)
class Streams(Summarised):
    """Random streams of replicates with these numbers (n,) at these generations (n,), under one seed."""

    rng: Seed
    replicate: Annotated[NDArray[np.int64], Shape(("n",))]
    generation: Annotated[NDArray[np.int64], Shape(("n",))]

    def uniform(self, count: Annotated[int, Within(least=0, most=_MOST)]) -> Floats:
        """Numbers in [0, 1), shape (n, count)."""
        drawn = np.empty((len(self.replicate), count))
        for row, generator in enumerate(self._generators(_UNIFORM)):
            generator.random(out=drawn[row])
        return drawn

    def normal(
        self, count: Annotated[NDArray[np.int64], Shape(("n",)), Within(least=0, most=_MOST)]
    ) -> Floats:
        """Standard normal numbers, `count` (n,) for each replicate, concatenated, shape (sum of count,)."""
        if count.size != self.replicate.size:
            raise SettingError(
                f"`count` has {count.size} numbers; give one for each of {self.replicate.size} replicates"
            )
        stop = np.cumsum(count)
        drawn = np.empty(int(stop[-1]) if stop.size else 0)
        for first, last, generator in zip(stop - count, stop, self._generators(_NORMAL), strict=True):
            generator.standard_normal(out=drawn[first:last])
        return drawn

    def seeds(self) -> NDArray[np.int64]:
        """Seed in [0, 2^31) of each replicate for a library that takes one, shape (n,)."""
        return np.array(
            [int(each.integers(2**31)) for each in self._generators(_LIBRARY_SEED)], dtype=np.int64
        )

    def _generators(self, purpose: int) -> Iterator[np.random.Generator]:
        # One generator is set to each stream in turn; a new generator for each would take twenty times as long.
        philox = np.random.Philox(key=0)
        generator = np.random.Generator(philox)
        state = philox.state
        for replicate, generation in zip(self.replicate.tolist(), self.generation.tolist(), strict=True):
            state["state"]["key"][:] = (self.rng, replicate)
            state["state"]["counter"][:] = (0, 0, purpose, generation)
            philox.state = state
            yield generator
