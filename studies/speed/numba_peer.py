"""The workload of kernels in numba: parallel over blocks of candidates.

Candidates lie innermost, so that LLVM fills its vectors with them: two to twenty times faster than a loop over one.
The function is a plain Python function until `prepare` compiles it, so that the power form and the block size are
constants to the compiler.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import TypeAlias

import numba
import numpy as np

from studies.former.arrays import Floats
from studies.speed.workload import PowerForm, Run, Workload

Kernel: TypeAlias = Callable[[Floats, Floats, Floats, float], Floats]
Rate: TypeAlias = Callable[[float, float, float, float, float, float], float]


@dataclass(frozen=True, slots=True, kw_only=True)
class NumbaVariant:
    """One way to compile a loop: candidates of a block run innermost, `form` is how a power or a tanh is written.

    `threads` 0 are those of the process.
    """

    block: int
    fastmath: bool = False
    form: str = ""
    threads: int = 0

    def describe(self) -> str:
        """In a few words, for the table."""
        threads = f"{self.threads} thread(s)" if self.threads else ""
        fastmath = f"fastmath {'on' if self.fastmath else 'off'}"
        return ", ".join(filter(None, [threads, f"blocks of {self.block}", self.form, fastmath]))


START = NumbaVariant(block=32)
CHANGES: tuple[Callable[[NumbaVariant], NumbaVariant], ...] = (
    lambda variant: replace(variant, fastmath=True),
    lambda variant: replace(variant, block=2 * variant.block),
    # Halved as long as it pays; after a doubling that paid, the first halving is known already.
    lambda variant: replace(variant, block=variant.block // 2),
    lambda variant: replace(variant, block=variant.block // 2),
    lambda variant: replace(variant, block=1),
)


def prepare(workload: Workload, form: PowerForm, variant: NumbaVariant) -> Run:
    """Compile `variant` for the workload's shapes and return the call to be timed."""
    kernel = _compiled(form, variant)
    theta, stages, force, dt = workload.theta, workload.stages, workload.force, workload.dt
    return lambda: kernel(theta, stages, force, dt)


@cache
def _compiled(form: PowerForm, variant: NumbaVariant) -> Kernel:
    power = numba.njit(inline="always", fastmath=variant.fastmath)(_POWERS[form])

    def rate(v: float, speed: float, w: float, rho: float, sigma: float, n: float) -> float:
        return rho * (v - power(w, n) * (sigma * math.copysign(speed, w) - (sigma - 1.0) * v))

    inlined = numba.njit(inline="always", fastmath=variant.fastmath)(rate)
    kernel = _blocked_loop(inlined, variant.block)
    compiled: Kernel = numba.njit(parallel=True, fastmath=variant.fastmath, error_model="numpy")(kernel)
    return compiled


def _power(w: float, n: float) -> float:
    return math.pow(abs(w), n)


def _square(w: float, n: float) -> float:
    return w * w


def _exp_log(w: float, n: float) -> float:
    return math.exp(n * math.log(abs(w)))


_POWERS: dict[PowerForm, Callable[[float, float], float]] = {
    "power": _power,
    "square": _square,
    "exp_log": _exp_log,
}


def _blocked_loop(rate: Rate, block: int) -> Kernel:
    def kernel(theta: Floats, stages: Floats, force: Floats, dt: float) -> Floats:
        n_batch = theta.shape[0]
        misfit = np.empty(n_batch)
        half = 0.5 * dt
        for group in numba.prange((n_batch + block - 1) // block):
            columns = np.empty((7, block))
            w = np.zeros(block)
            total = np.empty(block)
            for j in range(block):
                # A last, incomplete block repeats the last candidate: the loops below keep a constant length.
                row = min(group * block + j, n_batch - 1)
                for q in range(7):
                    columns[q, j] = theta[row, q]
                residual = columns[0, j] * stages[0, 0, 1] + columns[1, j] * (stages[0, 0, 0] - columns[2, j])
                total[j] = (residual - force[0]) * (residual - force[0])
            c, k, x0, k_w = columns[0], columns[1], columns[2], columns[3]
            rho, sigma, n = columns[4], columns[5], columns[6]
            for i in range(force.shape[0] - 1):
                v_start, v_middle, v_end = stages[i, 0, 1], stages[i, 1, 1], stages[i, 2, 1]
                speed_start, speed_middle, speed_end = abs(v_start), abs(v_middle), abs(v_end)
                x_end, measured = stages[i, 2, 0], force[i + 1]
                for j in range(block):
                    z = w[j]
                    k1 = rate(v_start, speed_start, z, rho[j], sigma[j], n[j])
                    k2 = rate(v_middle, speed_middle, z + half * k1, rho[j], sigma[j], n[j])
                    k3 = rate(v_middle, speed_middle, z + half * k2, rho[j], sigma[j], n[j])
                    k4 = rate(v_end, speed_end, z + dt * k3, rho[j], sigma[j], n[j])
                    z += dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
                    w[j] = z
                    residual = c[j] * v_end + k[j] * (x_end - x0[j]) + k_w[j] * z - measured
                    total[j] += residual * residual
            for j in range(block):
                if group * block + j < n_batch:
                    misfit[group * block + j] = total[j]
        return misfit

    return kernel
