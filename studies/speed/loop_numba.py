"""The loop in numba: parallel over blocks of runs, the building's rows written out, one run in a lane.

A block of 1 is the loop that one writes first, with the tanh of the C library. In wider blocks LLVM fills its vectors
with runs, where nothing in the step is a call: they take a tanh of their own, e^(-2|x|) by a Taylor series of the
argument over 128, squared seven times, good to 1e-14.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numba
import numpy as np

from studies.speed.loop_workload import (
    LAG,
    LARGEST_COMMAND,
    N_REDUCTIONS,
    STEP,
    Floats,
    LoopWorkload,
    averaged,
    chain_springs,
)


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


def _stage(
    q0: float, q1: float, q2: float, q3: float, q4: float,
    v0: float, v1: float, v2: float, v3: float, v4: float,
    pull: float, a_g: float, k: Any, c: Any, m: Any,
) -> tuple[float, float, float, float, float, float, float]:  # fmt: skip
    """Accelerations of the floors relative to the ground, power of the ground and of the structure's damping."""
    d0 = c[0] * v0 + c[1] * v1
    d1 = c[2] * v0 + c[3] * v1 + c[4] * v2
    d2 = c[5] * v1 + c[6] * v2 + c[7] * v3
    d3 = c[8] * v2 + c[9] * v3 + c[10] * v4
    d4 = c[11] * v3 + c[12] * v4
    a0 = -(d0 + k[0] * q0 + k[1] * q1 + pull * m[5] + a_g)
    a1 = -(d1 + k[2] * q0 + k[3] * q1 + k[4] * q2 + a_g)
    a2 = -(d2 + k[5] * q1 + k[6] * q2 + k[7] * q3 + a_g)
    a3 = -(d3 + k[8] * q2 + k[9] * q3 + k[10] * q4 + a_g)
    a4 = -(d4 + k[11] * q3 + k[12] * q4 + a_g)
    p0, p1, p2, p3, p4 = m[0] * v0, m[1] * v1, m[2] * v2, m[3] * v3, m[4] * v4
    entered = -a_g * (p0 + p1 + p2 + p3 + p4)
    return a0, a1, a2, a3, a4, entered, p0 * d0 + p1 * d1 + p2 * d2 + p3 * d3 + p4 * d4


@cache
def compiled(block: int, tanh_kind: Literal["library", "series"], fastmath: bool) -> Any:
    """Compile the kernel for blocks of `block` runs, with the tanh of the C library or our series."""
    inlined = numba.njit(forceinline=True, fastmath=fastmath, error_model="numpy")
    tanh: Any = math.tanh if tanh_kind == "library" else inlined(series_tanh)
    stage = inlined(_stage)

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
        per_mass: Floats,
        springs: Floats,
        mass: Floats,
        damper: Floats,
        gains: Floats,
        ground: Floats,
        h: float,
        decay: float,
        largest: float,
    ) -> Floats:
        n_motions, n_candidates = ground.shape[0], gains.shape[0]
        n_blocks = (n_candidates + block - 1) // block
        n_steps = ground.shape[1] // 2
        kept = np.empty((n_motions, n_candidates, N_REDUCTIONS))
        k = (
            per_mass[1, 0],
            per_mass[2, 0],
            per_mass[0, 1],
            per_mass[1, 1],
            per_mass[2, 1],
            per_mass[0, 2],
            per_mass[1, 2],
            per_mass[2, 2],
            per_mass[0, 3],
            per_mass[1, 3],
            per_mass[2, 3],
            per_mass[0, 4],
            per_mass[1, 4],
        )
        c = (
            per_mass[4, 0],
            per_mass[5, 0],
            per_mass[3, 1],
            per_mass[4, 1],
            per_mass[5, 1],
            per_mass[3, 2],
            per_mass[4, 2],
            per_mass[5, 2],
            per_mass[3, 3],
            per_mass[4, 3],
            per_mass[5, 3],
            per_mass[3, 4],
            per_mass[4, 4],
        )
        m = (mass[0], mass[1], mass[2], mass[3], mass[4], 1.0 / mass[0], mass.sum())
        device = (
            damper[0],
            damper[1],
            damper[2],
            damper[3],
            damper[4],
            damper[5],
            damper[6],
            damper[7],
            damper[8],
            damper[9],
            1.0 / damper[10],
        )
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
                g0, g1, g2 = (
                    ground[motion, 2 * step],
                    ground[motion, 2 * step + 1],
                    ground[motion, 2 * step + 2],
                )
                for j in range(block):
                    q0, q1, q2, q3, q4 = state[0, j], state[1, j], state[2, j], state[3, j], state[4, j]
                    v0, v1, v2, v3, v4 = state[5, j], state[6, j], state[7, j], state[8, j], state[9, j]
                    i0 = state[10, j]
                    f = pair(q0, v0, i0, device)
                    wanted = -(
                        gain[0, j] * q0 + gain[1, j] * q1 + gain[2, j] * q2 + gain[3, j] * q3 + gain[4, j] * q4
                        + gain[5, j] * v0 + gain[6, j] * v1 + gain[7, j] * v2 + gain[8, j] * v3 + gain[9, j] * v4
                    )  # fmt: skip
                    command = largest if (wanted - f) * f > 0.0 else 0.0
                    i1 = (i0 - command) * decay + command
                    i2 = (i1 - command) * decay + command
                    state[10, j] = i2

                    a0, a1, a2, a3, a4, entered, lost = stage(
                        q0, q1, q2, q3, q4, v0, v1, v2, v3, v4, f, g0, k, c, m
                    )  # fmt: skip
                    # Peaks and sums at the start of the step.
                    sums[0, j] = max(sums[0, j], abs(q0))
                    sums[5, j] += q0 * q0
                    sums[1, j] = max(sums[1, j], abs(q1))
                    sums[6, j] += q1 * q1
                    sums[2, j] = max(sums[2, j], abs(q2))
                    sums[7, j] += q2 * q2
                    sums[3, j] = max(sums[3, j], abs(q3))
                    sums[8, j] += q3 * q3
                    sums[4, j] = max(sums[4, j], abs(q4))
                    sums[9, j] += q4 * q4
                    value = a0 + g0
                    sums[10, j] = max(sums[10, j], abs(value))
                    sums[15, j] += value * value
                    value = a1 + g0
                    sums[11, j] = max(sums[11, j], abs(value))
                    sums[16, j] += value * value
                    value = a2 + g0
                    sums[12, j] = max(sums[12, j], abs(value))
                    sums[17, j] += value * value
                    value = a3 + g0
                    sums[13, j] = max(sums[13, j], abs(value))
                    sums[18, j] += value * value
                    value = a4 + g0
                    sums[14, j] = max(sums[14, j], abs(value))
                    sums[19, j] += value * value
                    sums[20, j] = max(sums[20, j], abs(q0))
                    sums[25, j] += q0 * q0
                    value = q1 - q0
                    sums[21, j] = max(sums[21, j], abs(value))
                    sums[26, j] += value * value
                    value = q2 - q1
                    sums[22, j] = max(sums[22, j], abs(value))
                    sums[27, j] += value * value
                    value = q3 - q2
                    sums[23, j] = max(sums[23, j], abs(value))
                    sums[28, j] += value * value
                    value = q4 - q3
                    sums[24, j] = max(sums[24, j], abs(value))
                    sums[29, j] += value * value
                    value = m[6] * g0 + m[0] * a0 + m[1] * a1 + m[2] * a2 + m[3] * a3 + m[4] * a4
                    sums[30, j] = max(sums[30, j], abs(value))
                    sums[31, j] += value * value
                    sums[32, j] = max(sums[32, j], abs(f))
                    sums[33, j] += f * f
                    sums[34, j] = max(sums[34, j], abs(q0))
                    sums[35, j] = max(sums[35, j], abs(v0))
                    sums[36, j] = max(sums[36, j], abs(i0))
                    sums[37, j] += i0
                    sums[38, j] += i0 * i0
                    taken = f * v0
                    # The second stage, from half a step along the first.
                    w0, w1, w2, w3, w4 = (
                        v0 + half * a0,
                        v1 + half * a1,
                        v2 + half * a2,
                        v3 + half * a3,
                        v4 + half * a4,
                    )
                    x0, x1, x2, x3, x4 = (
                        q0 + half * v0,
                        q1 + half * v1,
                        q2 + half * v2,
                        q3 + half * v3,
                        q4 + half * v4,
                    )
                    f = pair(x0, w0, i1, device)
                    b0, b1, b2, b3, b4, power, loss = stage(
                        x0, x1, x2, x3, x4, w0, w1, w2, w3, w4, f, g1, k, c, m
                    )  # fmt: skip
                    entered, lost, taken = entered + 2.0 * power, lost + 2.0 * loss, taken + 2.0 * (f * w0)
                    s0, s1, s2, s3, s4 = (
                        v0 + 2.0 * w0,
                        v1 + 2.0 * w1,
                        v2 + 2.0 * w2,
                        v3 + 2.0 * w3,
                        v4 + 2.0 * w4,
                    )
                    a0, a1, a2, a3, a4 = (
                        a0 + 2.0 * b0,
                        a1 + 2.0 * b1,
                        a2 + 2.0 * b2,
                        a3 + 2.0 * b3,
                        a4 + 2.0 * b4,
                    )
                    # The third, from half a step along the second.
                    x0, x1, x2, x3, x4 = (
                        q0 + half * w0,
                        q1 + half * w1,
                        q2 + half * w2,
                        q3 + half * w3,
                        q4 + half * w4,
                    )
                    w0, w1, w2, w3, w4 = (
                        v0 + half * b0,
                        v1 + half * b1,
                        v2 + half * b2,
                        v3 + half * b3,
                        v4 + half * b4,
                    )
                    f = pair(x0, w0, i1, device)
                    b0, b1, b2, b3, b4, power, loss = stage(
                        x0, x1, x2, x3, x4, w0, w1, w2, w3, w4, f, g1, k, c, m
                    )  # fmt: skip
                    entered, lost, taken = entered + 2.0 * power, lost + 2.0 * loss, taken + 2.0 * (f * w0)
                    s0, s1, s2, s3, s4 = (
                        s0 + 2.0 * w0,
                        s1 + 2.0 * w1,
                        s2 + 2.0 * w2,
                        s3 + 2.0 * w3,
                        s4 + 2.0 * w4,
                    )
                    a0, a1, a2, a3, a4 = (
                        a0 + 2.0 * b0,
                        a1 + 2.0 * b1,
                        a2 + 2.0 * b2,
                        a3 + 2.0 * b3,
                        a4 + 2.0 * b4,
                    )
                    # The fourth, from a whole step along the third.
                    x0, x1, x2, x3, x4 = q0 + h * w0, q1 + h * w1, q2 + h * w2, q3 + h * w3, q4 + h * w4
                    w0, w1, w2, w3, w4 = v0 + h * b0, v1 + h * b1, v2 + h * b2, v3 + h * b3, v4 + h * b4
                    f = pair(x0, w0, i2, device)
                    b0, b1, b2, b3, b4, power, loss = stage(
                        x0, x1, x2, x3, x4, w0, w1, w2, w3, w4, f, g2, k, c, m
                    )  # fmt: skip
                    sums[40, j] += sixth * (entered + power)
                    sums[43, j] += sixth * (lost + loss)
                    sums[39, j] += sixth * (taken + f * w0)
                    state[0, j] = q0 + sixth * (s0 + w0)
                    state[1, j] = q1 + sixth * (s1 + w1)
                    state[2, j] = q2 + sixth * (s2 + w2)
                    state[3, j] = q3 + sixth * (s3 + w3)
                    state[4, j] = q4 + sixth * (s4 + w4)
                    state[5, j] = v0 + sixth * (a0 + b0)
                    state[6, j] = v1 + sixth * (a1 + b1)
                    state[7, j] = v2 + sixth * (a2 + b2)
                    state[8, j] = v3 + sixth * (a3 + b3)
                    state[9, j] = v4 + sixth * (a4 + b4)
            for j in range(block):
                if first + j < n_candidates:
                    q0, q1, q2, q3, q4 = state[0, j], state[1, j], state[2, j], state[3, j], state[4, j]
                    v0, v1, v2, v3, v4 = state[5, j], state[6, j], state[7, j], state[8, j], state[9, j]
                    for column in range(N_REDUCTIONS):
                        kept[motion, first + j, column] = sums[column, j]
                    kept[motion, first + j, 41] = 0.5 * (
                        m[0] * v0 * v0 + m[1] * v1 * v1 + m[2] * v2 * v2 + m[3] * v3 * v3 + m[4] * v4 * v4
                    )
                    kept[motion, first + j, 42] = 0.5 * (
                        springs[0] * q0**2
                        + springs[1] * (q1 - q0) ** 2
                        + springs[2] * (q2 - q1) ** 2
                        + springs[3] * (q3 - q2) ** 2
                        + springs[4] * (q4 - q3) ** 2
                    )
        return kept

    return numba.njit(parallel=True, fastmath=fastmath, error_model="numpy")(kernel)


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
