"""The loop in numba: parallel over blocks of runs, the building's rows written out, one run in a lane.

A block of 1 is the loop that one writes first, with the tanh of the C library. In wider blocks LLVM fills its vectors
with runs, where nothing in the step is a call: they take a tanh of their own, e^(-2|x|) by a Taylor series of the
argument over 128, squared seven times, good to 1e-14.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from studies.speed.loop_numba_kernel import compiled
from studies.speed.loop_workload import (
    LAG,
    LARGEST_COMMAND,
    STEP,
    Floats,
    LoopWorkload,
    averaged,
    chain_springs,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopNumbaVariant:
    """One way to compile the loop."""

    block: int = 1
    tanh: Literal["library", "series"] = "library"
    fastmath: bool = True

    def describe(self) -> str:
        """In a few words, for the table."""
        layout = "scalar loop" if self.block == 1 else f"blocks of {self.block}"
        return f"{layout}, tanh of the {self.tanh}, fastmath {'on' if self.fastmath else 'off'}"


LIBRARY = (LoopNumbaVariant(), LoopNumbaVariant(fastmath=False), LoopNumbaVariant(block=8))
SERIES = tuple(LoopNumbaVariant(block=block, tanh="series") for block in (8, 16, 32))


def prepare(workload: LoopWorkload, variant: LoopNumbaVariant) -> Callable[[], Floats]:
    """Compile `variant`; the call returns (n_motions, n_candidates, N_REDUCTIONS)."""
    kernel = compiled(variant.block, variant.tanh, variant.fastmath)
    per_mass = np.concatenate(
        [_chain(workload.stiffness, workload.mass), _chain(workload.damping, workload.mass)]
    )
    springs = chain_springs(workload.stiffness)
    decay = math.exp(-0.5 * LAG * STEP)
    inputs = per_mass, springs, workload.mass, workload.device, workload.gains, workload.ground

    def run() -> Floats:
        found: Floats = kernel(*inputs, STEP, decay, LARGEST_COMMAND)
        return averaged(found, workload.n_steps)

    return run


def _chain(matrix: Floats, mass: Floats) -> Floats:
    """Below, on and above the diagonal of M^-1 times a tridiagonal matrix, zeros at the ends, shape (3, 5)."""
    below, on, above = np.zeros((3, mass.size))
    on[:] = np.diag(matrix) / mass
    below[1:] = np.diag(matrix, -1) / mass[1:]
    above[:-1] = np.diag(matrix, 1) / mass[:-1]
    return np.stack([below, on, above])
