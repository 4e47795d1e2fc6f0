"""The loop in numba: parallel over blocks of runs, the building's rows written out, one run in a lane.

A block of 1 is the loop that one writes first, with the tanh of the C library. In wider blocks LLVM fills its vectors
with runs, where nothing in the step is a call: they take a tanh of their own, e^(-2|x|) by a Taylor series of the
argument over 128, squared seven times, good to 1e-14.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numba
import numpy as np

from studies.former.arrays import Floats
from studies.speed.loop_workload import (
    LAG,
    LARGEST_COMMAND,
    N_REDUCTIONS,
    STEP,
    LoopWorkload,
    averaged,
    chain_springs,
)
from studies.speed.numba_peer import NumbaVariant

Five = tuple[float, float, float, float, float]
"""Of the floors, lowest first."""


def series_tanh(x: float) -> float:
    """Hyperbolic tangent without a call, to 1e-14."""
    size = min(abs(x), 20.0)
    y = size * (-2.0 / 128.0)
    # e^y - 1 over |y| < 0.32, to 1e-17.
    p = 1.0 / 479001600.0
    p = p * y + 1.0 / 39916800.0
    p = p * y + 1.0 / 3628800.0
    p = p * y + 1.0 / 362880.0
    p = p * y + 1.0 / 40320.0
    p = p * y + 1.0 / 5040.0
    p = p * y + 1.0 / 720.0
    p = p * y + 1.0 / 120.0
    p = p * y + 1.0 / 24.0
    p = p * y + 1.0 / 6.0
    p = p * y + 0.5
    p = (p * y + 1.0) * y
    # (1 + p)^2 - 1 = p (p + 2): what is near zero stays exact.
    p = p * (p + 2.0)
    p = p * (p + 2.0)
    p = p * (p + 2.0)
    p = p * (p + 2.0)
    p = p * (p + 2.0)
    p = p * (p + 2.0)
    p = p * (p + 2.0)
    return math.copysign(-p / (p + 2.0), x)


def _stage(q: Five, v: Five, pull: float, a_g: float, k: Any, c: Any, m: Any) -> tuple[Five, float, float]:
    """Accelerations of the floors relative to the ground, power of the ground and of the structure's damping."""
    d0 = c[0] * v[0] + c[1] * v[1]
    d1 = c[2] * v[0] + c[3] * v[1] + c[4] * v[2]
    d2 = c[5] * v[1] + c[6] * v[2] + c[7] * v[3]
    d3 = c[8] * v[2] + c[9] * v[3] + c[10] * v[4]
    d4 = c[11] * v[3] + c[12] * v[4]
    a = (
        -(d0 + k[0] * q[0] + k[1] * q[1] + pull * m[5] + a_g),
        -(d1 + k[2] * q[0] + k[3] * q[1] + k[4] * q[2] + a_g),
        -(d2 + k[5] * q[1] + k[6] * q[2] + k[7] * q[3] + a_g),
        -(d3 + k[8] * q[2] + k[9] * q[3] + k[10] * q[4] + a_g),
        -(d4 + k[11] * q[3] + k[12] * q[4] + a_g),
    )
    p = m[0] * v[0], m[1] * v[1], m[2] * v[2], m[3] * v[3], m[4] * v[4]
    entered = -a_g * (p[0] + p[1] + p[2] + p[3] + p[4])
    return a, entered, p[0] * d0 + p[1] * d1 + p[2] * d2 + p[3] * d3 + p[4] * d4


def _along(x: Five, step: float, rate: Five) -> Five:
    """Floors after a step along a rate."""
    return (
        x[0] + step * rate[0],
        x[1] + step * rate[1],
        x[2] + step * rate[2],
        x[3] + step * rate[3],
        x[4] + step * rate[4],
    )


def _note(sums: Floats, peak: int, square: int, j: int, value: float) -> None:
    """Keep the peak of a quantity, and add its square."""
    sums[peak, j] = max(sums[peak, j], abs(value))
    sums[square, j] += value * value


@cache
def compiled(variant: NumbaVariant) -> Any:
    """Compile the kernel, with the tanh of the C library or our series."""
    block, fastmath = variant.block, variant.fastmath
    inlined = numba.njit(forceinline=True, fastmath=fastmath, error_model="numpy")
    tanh: Any = math.tanh if variant.form == "library" else inlined(series_tanh)
    stage, along, note = inlined(_stage), inlined(_along), inlined(_note)

    @inlined
    def pair(x: float, v: float, i: float, device: Any) -> float:
        """f(x, v) - f(-x, -v) at the coil's current: twice what is odd of the model, that is all but f0."""
        c = device[0] + device[1] * i
        k = device[2] + device[3] * i
        alpha = device[4] + (device[5] + device[6] * i) * i
        delta = device[8] + device[9] * i
        hysteresis: float = tanh(device[7] * v + delta * tanh(device[10] * x))
        force: float = 2.0 * (c * v + k * x + alpha * hysteresis)
        return force

    def kernel(
        k: Any,
        c: Any,
        m: Any,
        springs: Any,
        device: Any,
        gains: Floats,
        ground: Floats,
        h: float,
        decay: float,
        largest: float,
    ) -> Floats:
        n_motions, n_candidates = ground.shape[0], gains.shape[0]
        n_blocks = (n_candidates + block - 1) // block
        n_steps = ground.shape[1]
        kept = np.empty((n_motions, n_candidates, N_REDUCTIONS))
        half, sixth = 0.5 * h, h / 6.0
        for group in numba.prange(n_motions * n_blocks):
            motion, first = group // n_blocks, (group % n_blocks) * block
            # A last, incomplete block repeats the last candidate: the loop below keeps a constant length.
            gain = np.empty((10, block))
            for j in range(block):
                for row in range(10):
                    gain[row, j] = gains[min(first + j, n_candidates - 1), row]
            state = np.zeros((11, block))
            sums = np.zeros((N_REDUCTIONS, block))
            for step in range(n_steps):
                g0, g1, g2 = ground[motion, step, 0], ground[motion, step, 1], ground[motion, step, 2]
                for j in range(block):
                    q = state[0, j], state[1, j], state[2, j], state[3, j], state[4, j]
                    v = state[5, j], state[6, j], state[7, j], state[8, j], state[9, j]
                    i0 = state[10, j]
                    f = pair(q[0], v[0], i0, device)
                    wanted = -(
                        gain[0, j] * q[0] + gain[1, j] * q[1] + gain[2, j] * q[2] + gain[3, j] * q[3]
                        + gain[4, j] * q[4] + gain[5, j] * v[0] + gain[6, j] * v[1] + gain[7, j] * v[2]
                        + gain[8, j] * v[3] + gain[9, j] * v[4]
                    )  # fmt: skip
                    command = largest if (wanted - f) * f > 0.0 else 0.0
                    i1 = (i0 - command) * decay + command
                    i2 = (i1 - command) * decay + command
                    state[10, j] = i2

                    a, entered, lost = stage(q, v, f, g0, k, c, m)
                    # Peaks and sums at the start of the step.
                    note(sums, 0, 5, j, q[0])
                    note(sums, 1, 6, j, q[1])
                    note(sums, 2, 7, j, q[2])
                    note(sums, 3, 8, j, q[3])
                    note(sums, 4, 9, j, q[4])
                    note(sums, 10, 15, j, a[0] + g0)
                    note(sums, 11, 16, j, a[1] + g0)
                    note(sums, 12, 17, j, a[2] + g0)
                    note(sums, 13, 18, j, a[3] + g0)
                    note(sums, 14, 19, j, a[4] + g0)
                    note(sums, 20, 25, j, q[0])
                    note(sums, 21, 26, j, q[1] - q[0])
                    note(sums, 22, 27, j, q[2] - q[1])
                    note(sums, 23, 28, j, q[3] - q[2])
                    note(sums, 24, 29, j, q[4] - q[3])
                    inertia = m[0] * a[0] + m[1] * a[1] + m[2] * a[2] + m[3] * a[3] + m[4] * a[4]
                    note(sums, 30, 31, j, m[6] * g0 + inertia)
                    note(sums, 32, 33, j, f)
                    sums[34, j] = max(sums[34, j], abs(q[0]))
                    sums[35, j] = max(sums[35, j], abs(v[0]))
                    note(sums, 36, 38, j, i0)
                    sums[37, j] += i0
                    taken = f * v[0]
                    # The second stage, from half a step along the first; the third, from half a step along the second.
                    v2, q2 = along(v, half, a), along(q, half, v)
                    f = pair(q2[0], v2[0], i1, device)
                    a2, power, loss = stage(q2, v2, f, g1, k, c, m)
                    entered, lost, taken = entered + 2.0 * power, lost + 2.0 * loss, taken + 2.0 * (f * v2[0])
                    v3, q3 = along(v, half, a2), along(q, half, v2)
                    f = pair(q3[0], v3[0], i1, device)
                    a3, power, loss = stage(q3, v3, f, g1, k, c, m)
                    entered, lost, taken = entered + 2.0 * power, lost + 2.0 * loss, taken + 2.0 * (f * v3[0])
                    # The fourth, from a whole step along the third.
                    v4, q4 = along(v, h, a3), along(q, h, v3)
                    f = pair(q4[0], v4[0], i2, device)
                    a4, power, loss = stage(q4, v4, f, g2, k, c, m)
                    sums[40, j] += sixth * (entered + power)
                    sums[43, j] += sixth * (lost + loss)
                    sums[39, j] += sixth * (taken + f * v4[0])
                    q = along(q, sixth, along(along(along(v, 2.0, v2), 2.0, v3), 1.0, v4))
                    v = along(v, sixth, along(along(along(a, 2.0, a2), 2.0, a3), 1.0, a4))
                    state[0, j], state[1, j], state[2, j], state[3, j], state[4, j] = q
                    state[5, j], state[6, j], state[7, j], state[8, j], state[9, j] = v
            for j in range(block):
                if first + j < n_candidates:
                    for column in range(N_REDUCTIONS):
                        kept[motion, first + j, column] = sums[column, j]
                    kinetic = strain = below = 0.0
                    for floor in range(5):
                        kinetic += 0.5 * m[floor] * state[5 + floor, j] ** 2
                        strain += 0.5 * springs[floor] * (state[floor, j] - below) ** 2
                        below = state[floor, j]
                    kept[motion, first + j, 41], kept[motion, first + j, 42] = kinetic, strain
        return kept

    return numba.njit(parallel=True, fastmath=fastmath, error_model="numpy")(kernel)


LIBRARY = (
    NumbaVariant(block=1, form="library", fastmath=True),
    NumbaVariant(block=1, form="library"),
    NumbaVariant(block=8, form="library", fastmath=True),
)
SERIES = tuple(NumbaVariant(block=block, form="series", fastmath=True) for block in (8, 16, 32))


def prepare(workload: LoopWorkload, variant: NumbaVariant) -> Callable[[], Floats]:
    """Compile `variant`; the call returns (n_motions, n_candidates, N_REDUCTIONS)."""
    kernel = compiled(variant)
    mass, device = workload.mass, workload.device
    k, c = _chain(workload.stiffness, mass), _chain(workload.damping, mass)
    m = (*mass.tolist(), 1.0 / float(mass[0]), float(mass.sum()))
    springs = tuple(chain_springs(workload.stiffness).tolist())
    laws = (*device[:10].tolist(), 1.0 / float(device[10]))
    decay = math.exp(-0.5 * LAG * STEP)

    def run() -> Floats:
        sums: Floats = kernel(
            k, c, m, springs, laws, workload.gains, workload.ground, STEP, decay, LARGEST_COMMAND
        )
        return averaged(sums, workload.n_steps)

    return run


def _chain(matrix: Floats, mass: Floats) -> tuple[float, ...]:
    """M^-1 times a tridiagonal matrix, row by row without the zeros."""
    rows = matrix / mass[:, None]
    return tuple(rows[np.abs(np.subtract.outer(range(mass.size), range(mass.size))) <= 1].tolist())
