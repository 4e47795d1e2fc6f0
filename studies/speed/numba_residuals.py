"""Residuals of the normalised Bouc-Wen model in numba, for one or several tests: the simulation under the usual peer.

The same equations, spline, stepping rule and observation as our kernel. Pairs of a test and a few rows are dealt to the
threads; the rows of a pair run innermost, so that the processor overlaps their powers. How many, and with which
power and fast-math, is tried out on a Jacobian.
"""

from __future__ import annotations

import math
import time
from functools import cache
from typing import Any

import numba
import numpy as np
from scipy.interpolate import CubicSpline

from studies.common.arrays import Floats
from studies.speed.numba_objective import FASTMATH, FORMS, steps_of
from studies.speed.numba_peer import NumbaVariant
from studies.speed.refine_job import RefineJob

LAYOUTS = tuple(
    NumbaVariant(block=block, threads=threads, fastmath=fastmath, form=form)
    for threads in dict.fromkeys((numba.get_num_threads(), 1))
    for block in (1, 4, 8)
    for fastmath in (False, True)
    for form in ("exp_log", "power")
)


class NumbaResiduals:
    """Weighted residuals of rows of `theta`, as `Objective.residuals` has them."""

    def __init__(self, job: RefineJob, layout: NumbaVariant) -> None:
        self.layout = layout
        self.spec = job.spec
        tests, histories = job.objective.tests, job.objective.histories
        pieces: list[Floats] = []
        for test in tests:
            # Lowest power first, in the share of a sample interval; the last sample has a row of its own.
            own = CubicSpline(np.arange(test.n_time, dtype=np.float64), test.velocity)
            pieces.append(np.vstack([own.c[::-1].T, [test.velocity[-1], 0.0, 0.0, 0.0]]))
        kept = [test.n_time - test.n_settle for test in tests]
        self.n_residuals = sum(kept)
        # Of the tests: samples one after another, where each begins, its first that counts, its place in the results.
        self.records = (
            np.ascontiguousarray(np.concatenate(pieces)),
            np.concatenate([test.displacement for test in tests]),
            np.concatenate([test.force for test in tests]),
            np.concatenate([[0], np.cumsum([test.n_time for test in tests])]),
            np.array([test.n_settle for test in tests]),
            np.concatenate([[0], np.cumsum(kept)]),
            np.array([compared.weight(len(tests)) for compared in job.objective.compared]),
            np.array([test.dt for test in tests]),
            np.array([history.peak_velocity for history in histories]),
            np.array([history.reversal_acceleration for history in histories]),
        )
        commands = [0.0 if history.command is None else float(history.command[0]) for history in histories]
        self.command = np.array(commands)

    def plain(self, theta: Floats) -> Floats:
        """Parameters of the plain model in each test, shape (n_tests, n_rows, 7)."""
        n_tests = len(self.command)
        if self.spec.current is None:
            return np.broadcast_to(theta, (n_tests, *theta.shape)).copy()
        result = np.empty((n_tests, len(theta), len(self.spec.plain)))
        column = 0
        degree = {"constant": 0, "linear": 1, "quadratic": 2, "cubic": 3}
        for index, (parameter, law) in enumerate(zip(self.spec.plain, self.spec.current.laws, strict=True)):
            powers = self.command[:, None] ** np.arange(degree[law] + 1)
            value = powers @ theta[:, column : column + degree[law] + 1].T
            column += degree[law] + 1
            result[:, :, index] = (
                value if law == "constant" else np.clip(value, parameter.lower, parameter.upper)
            )
        return result

    def __call__(self, theta: Floats) -> Floats:
        """Shape (n_rows, n_residuals); one where a simulation failed."""
        residuals = np.empty((len(theta), self.n_residuals))
        numba.set_num_threads(self.layout.threads)
        _compiled(self.layout)(self.plain(theta), self.records, residuals)
        return np.where(np.isfinite(residuals), residuals, 1.0)


def fastest_layout(job: RefineJob, layouts: tuple[NumbaVariant, ...] = LAYOUTS) -> NumbaResiduals:
    """The layout whose batch of a Jacobian, followed by a single simulation, takes the least time."""
    rows = np.repeat(job.starts[:1], 1 + len(job.box.free), axis=0)

    def seconds(residuals: NumbaResiduals) -> float:
        residuals(rows), residuals(rows[:1])
        spent = []
        for _ in range(5):
            began = time.perf_counter()
            residuals(rows), residuals(rows[:1])
            spent.append(time.perf_counter() - began)
        return float(np.median(spent))

    return min((NumbaResiduals(job, layout) for layout in layouts), key=seconds)


@cache
def _compiled(layout: NumbaVariant) -> Any:
    block, form = layout.block, layout.form
    fastmath = FASTMATH if layout.fastmath else False
    power = numba.njit(inline="always", fastmath=fastmath)(FORMS[form][0])

    @numba.njit(error_model="numpy")
    def substeps(p: Floats, dt: float, peak: float, reversal: float) -> int:
        # Without the offset of the velocity, which is that of another model.
        steps: int = steps_of(p[4], p[5], p[6], 0.0, 1.0, dt, peak, reversal)
        return steps

    def _rate(v: float, w: float, rho: float, sigma: float, n: float) -> float:
        opposing = sigma * math.copysign(abs(v), w) + (1.0 - sigma) * v
        slope: float = rho * (v - power(abs(w), n) * opposing)
        return slope

    rate = numba.njit(inline="always", fastmath=fastmath)(_rate)

    def kernel(theta: Floats, records: Any, residuals: Floats) -> None:
        velocity, displacement, force, begin, first, out, weight, dt, peak, reversal = records
        n_tests, n_rows = theta.shape[:2]
        n_blocks = (n_rows + block - 1) // block
        for item in numba.prange(n_tests * n_blocks):
            t, low = item // n_blocks, item % n_blocks * block
            high = min(low + block, n_rows)
            while low < high:
                # Rows that take as many sub-steps run together.
                steps = substeps(theta[t, low], dt[t], peak[t], reversal[t])
                width = 1
                while low + width < high and steps == substeps(
                    theta[t, low + width], dt[t], peak[t], reversal[t]
                ):
                    width += 1
                p = np.empty((7, block))
                for j in range(width):
                    for q in range(7):
                        p[q, j] = theta[t, low + j, q]
                c, k, x0, k_w, rho, sigma, n = p
                w = np.zeros(block)
                share = 1.0 / steps if steps else 0.0
                step = dt[t] * share
                for i in range(begin[t], begin[t + 1]):
                    place = i - begin[t] - first[t]
                    if place >= 0:
                        for j in range(width):
                            elastic = k[j] * (displacement[i] - x0[j]) + k_w[j] * w[j]
                            residual = c[j] * velocity[i, 0] + elastic - force[i]
                            residuals[low + j, out[t] + place] = residual * weight[t] if steps else math.inf
                    if i == begin[t + 1] - 1:
                        break
                    a0, a1, a2, a3 = velocity[i, 0], velocity[i, 1], velocity[i, 2], velocity[i, 3]
                    for s in range(steps):
                        u0, u1, u2 = s * share, (s + 0.5) * share, (s + 1.0) * share
                        v0 = a0 + u0 * (a1 + u0 * (a2 + u0 * a3))
                        v1 = a0 + u1 * (a1 + u1 * (a2 + u1 * a3))
                        v2 = a0 + u2 * (a1 + u2 * (a2 + u2 * a3))
                        for j in range(width):
                            z = w[j]
                            k1 = rate(v0, z, rho[j], sigma[j], n[j])
                            k2 = rate(v1, z + 0.5 * step * k1, rho[j], sigma[j], n[j])
                            k3 = rate(v1, z + 0.5 * step * k2, rho[j], sigma[j], n[j])
                            k4 = rate(v2, z + step * k3, rho[j], sigma[j], n[j])
                            w[j] = z + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
                low += width

    return numba.njit(parallel=True, fastmath=fastmath, error_model="numpy")(kernel)
