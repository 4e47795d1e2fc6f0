"""The search job in numba: the same equations, spline and sub-steps as our kernel, parallel over blocks of candidates.

A candidate takes as many sub-steps as our stepping rule gives it: a power of two that keeps the product of step and
stiffness bound at 1.4 or below. Candidates are sorted by that number and dealt to the threads in turns, so that all
threads have alike to do. Several candidates innermost let the processor overlap their powers; how many, and with
which power and fast-math, is tried out; `exp_log` writes power and tanh by `math.exp`, which numba evaluates faster.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from studies.common.arrays import Floats
from studies.speed.numba_peer import NumbaVariant
from studies.speed.search_job import SearchJob
from studies.speed.timing import TimedPeer, fastest_variant, timed
from studies.speed.workload import Run

RESOLUTION = 1.4
MAX_SUBSTEPS = 256
# All liberties of fast-math but that of taking infinity for impossible: it marks a failure.
FASTMATH = {"reassoc", "contract", "arcp", "nsz", "afn"}


START = NumbaVariant(block=8, form="exp_log")
CHANGES: tuple[Callable[[NumbaVariant], NumbaVariant], ...] = (
    lambda variant: replace(variant, fastmath=True),
    lambda variant: replace(variant, block=32),
    lambda variant: replace(variant, block=1),
    lambda variant: replace(variant, form="power"),
)


class Record(NamedTuple):
    """What is simulated: the splines of the velocity, lowest power first in the share of a sample interval; the rest
    at the samples, of which those from `first` on count.
    """

    velocity: Floats
    displacement: Floats
    force: Floats
    dt: float
    first: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NumbaObjective:
    """Misfits and residuals of a batch, as `Objective` has them."""

    variant: NumbaVariant
    record: Record
    weight: float
    peak_velocity: float
    reversal_acceleration: float

    @classmethod
    def of(cls, job: SearchJob, variant: NumbaVariant) -> NumbaObjective:
        """Spline the velocity; the displacement is needed at the samples only."""
        test, (history,) = job.test, job.objective.histories
        coefficients = CubicSpline(np.arange(test.n_time, dtype=np.float64), test.velocity).c[::-1].T
        velocity = np.ascontiguousarray(coefficients)
        return cls(
            variant=variant,
            record=Record(velocity, test.displacement, test.force, test.dt, test.n_settle),
            weight=job.objective.compared[0].weight(1),
            peak_velocity=history.peak_velocity,
            reversal_acceleration=history.reversal_acceleration,
        )

    def __call__(self, theta: Floats, thresholds: Floats | None = None) -> Floats:
        """Misfit of each row, shape (m,), infinite where a simulation failed; all run to their ends."""
        squared = self._run(theta, np.empty((0, 0)))
        return np.sqrt(np.where(np.isfinite(squared), squared, math.inf)) * self.weight

    def residuals(self, theta: Floats) -> Floats:
        """Weighted residuals of each row, shape (m, n_counted); one everywhere where a simulation failed."""
        residuals = np.zeros((len(theta), self.record.force.size - self.record.first))
        squared = self._run(theta, residuals)
        residuals *= self.weight
        residuals[~np.isfinite(squared)] = 1.0
        return residuals

    def substeps(self, theta: Floats) -> NDArray[np.int64]:
        """Sub-steps per sample of each row, shape (m,), 0 where it is too stiff."""
        count: NDArray[np.int64] = substeps_of(
            theta, self.record.dt, self.peak_velocity, self.reversal_acceleration
        )
        return count

    def _run(self, theta: Floats, residuals: Floats) -> Floats:
        count = self.substeps(theta)
        order = np.argsort(-count, kind="stable")
        starts = block_starts(count[order], self.variant.block)
        # Dealt in turns: a thread takes a run of consecutive blocks.
        threads = numba.get_num_threads()
        turns = np.concatenate([np.arange(len(starts) - 1)[thread::threads] for thread in range(threads)])
        kernel = _compiled(self.variant, bool(residuals.size))
        squared: Floats = kernel(theta, (count, order, starts, turns), self.record, residuals)
        return squared


def _steps(
    rho: float,
    sigma: float,
    n: float,
    mu: float,
    w_s: float,
    dt: float,
    peak_velocity: float,
    reversal: float,
) -> int:
    """Sub-steps per sample, 0 for a candidate that is too stiff: the rule of `integrate.rs`."""
    peak = peak_velocity + mu
    excess = abs(2.0 * sigma - 1.0)
    travel = min(math.log(1.0 + excess), 0.25 / (n - 1.0)) / (excess * rho)
    unloading = min(peak, math.sqrt(2.0 * reversal * travel))
    wanted = dt * (n * rho * max(peak, excess * unloading) + rho * mu / w_s) / RESOLUTION
    steps = 1
    while steps < wanted and steps <= MAX_SUBSTEPS:
        steps *= 2
    return steps if steps <= MAX_SUBSTEPS and math.isfinite(wanted) else 0


# Any: numba's annotations lose the signature.
steps_of: Any = numba.njit(error_model="numpy")(_steps)


def _substeps(theta: Floats, dt: float, peak_velocity: float, reversal: float) -> NDArray[np.int64]:
    """Sub-steps per sample of each candidate, shape (m,)."""
    count = np.zeros(theta.shape[0], np.int64)
    for row in range(theta.shape[0]):
        rho, sigma, n, mu, w_s = theta[row, 4], theta[row, 5], theta[row, 6], theta[row, 7], theta[row, 9]
        count[row] = steps_of(rho, sigma, n, mu, w_s, dt, peak_velocity, reversal)
    return count


def _block_starts(count: NDArray[np.int64], block: int) -> NDArray[np.int64]:
    """Where blocks begin among sorted candidates, and the end; those of a block take the same sub-steps."""
    starts = np.empty(count.size + 1, np.int64)
    n_blocks = 0
    for row in range(count.size):
        if n_blocks == 0 or count[row] != count[row - 1] or row - starts[n_blocks - 1] == block:
            starts[n_blocks] = row
            n_blocks += 1
    starts[n_blocks] = count.size
    return starts[: n_blocks + 1]


substeps_of: Any = numba.njit(error_model="numpy")(_substeps)
block_starts: Any = numba.njit(_block_starts)


@cache
def _compiled(variant: NumbaVariant, keep: bool) -> Any:
    fastmath = FASTMATH if variant.fastmath else False
    inlined = numba.njit(inline="always", fastmath=fastmath)
    power, hyperbolic = (inlined(function) for function in FORMS[variant.form])
    block = variant.block

    def _rate(v: float, w: float, rho: float, sigma: float, n: float, mu: float, per_w_s: float) -> float:
        g = v - mu * hyperbolic(w * per_w_s)
        opposing = sigma * math.copysign(abs(g), w) - (sigma - 1.0) * g
        slope: float = rho * (g - power(abs(w), n) * opposing)
        return slope

    rate = inlined(_rate)

    def kernel(theta: Floats, dealt: Any, record: Record, residuals: Floats) -> Floats:
        count, order, starts, turns = dealt
        velocity, displacement, force, dt, first = record
        squared = np.empty(theta.shape[0])
        for turn in numba.prange(turns.size):
            begin = starts[turns[turn]]
            width = starts[turns[turn] + 1] - begin
            p = np.empty((10, block))
            w = np.zeros(block)
            total = np.zeros(block)
            for j in range(width):
                for q in range(10):
                    p[q, j] = theta[order[begin + j], q]
                p[9, j] = 1.0 / p[9, j]
            c, k, x0, k_w, rho, sigma, n, mu, share, per_w_s = p
            steps = count[order[begin]]
            # A candidate that is too stiff is not simulated.
            total[:] = 0.0 if steps else math.inf
            share_of_interval = 1.0 / steps if steps else 0.0
            step = dt * share_of_interval
            for i in range(force.size if steps else 0):
                v_end = velocity[i, 0] if i < force.size - 1 else velocity[i - 1].sum()
                if i >= first:
                    for j in range(width):
                        g = v_end - share[j] * mu[j] * hyperbolic(w[j] * per_w_s[j])
                        elastic = k[j] * (displacement[i] - x0[j])
                        residual = c[j] * g + elastic + k_w[j] * w[j] - force[i]
                        total[j] += residual * residual
                        if keep:
                            residuals[order[begin + j], i - first] = residual
                if i == force.size - 1:
                    break
                a0, a1, a2, a3 = velocity[i, 0], velocity[i, 1], velocity[i, 2], velocity[i, 3]
                for s in range(steps):
                    u0 = s * share_of_interval
                    u1 = (s + 0.5) * share_of_interval
                    u2 = (s + 1.0) * share_of_interval
                    v0 = a0 + u0 * (a1 + u0 * (a2 + u0 * a3))
                    v1 = a0 + u1 * (a1 + u1 * (a2 + u1 * a3))
                    v2 = a0 + u2 * (a1 + u2 * (a2 + u2 * a3))
                    for j in range(width):
                        z = w[j]
                        k1 = rate(v0, z, rho[j], sigma[j], n[j], mu[j], per_w_s[j])
                        k2 = rate(v1, z + 0.5 * step * k1, rho[j], sigma[j], n[j], mu[j], per_w_s[j])
                        k3 = rate(v1, z + 0.5 * step * k2, rho[j], sigma[j], n[j], mu[j], per_w_s[j])
                        k4 = rate(v2, z + step * k3, rho[j], sigma[j], n[j], mu[j], per_w_s[j])
                        w[j] = z + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            for j in range(width):
                squared[order[begin + j]] = total[j]
        return squared

    return numba.njit(parallel=True, fastmath=fastmath, error_model="numpy")(kernel)


def _power(w: float, n: float) -> float:
    return math.pow(w, n)


def _tanh(w: float) -> float:
    return math.tanh(w)


def _exp_log(w: float, n: float) -> float:
    return math.exp(n * math.log(w))


def _tanh_by_exp(w: float) -> float:
    return 1.0 - 2.0 / (1.0 + math.exp(2.0 * w))


FORMS: dict[str, tuple[Any, Any]] = {"power": (_power, _tanh), "exp_log": (_exp_log, _tanh_by_exp)}


def fastest_numba(job: SearchJob, threads: int, *, choose: bool) -> tuple[NumbaObjective, str, float]:
    """The fastest numba objective that agrees with ours, what it is, and the seconds of its first two calls.

    Half of the candidates of the trial are scattered over the box, half lie close together, as in a search.
    """
    numba.set_num_threads(threads)
    unit = np.random.default_rng(1).random((60, job.n_params))
    unit[30:] = 0.5 + 0.05 * (unit[30:] - 0.5)
    theta = job.theta(unit)
    expected = job.objective(theta)
    theta = theta[np.isfinite(expected)]
    built: dict[str, NumbaObjective] = {}

    def prepare(variant: NumbaVariant) -> Run:
        objective = built[variant.describe()] = NumbaObjective.of(job, variant)
        return lambda: objective(theta)

    _, compiling = timed(lambda: (prepare(START)(), built[START.describe()].residuals(theta[:2])))
    changes = CHANGES if choose else ()
    peer = TimedPeer(start=START, changes=changes, prepare=prepare)
    _, described = fastest_variant("numba", peer, expected[np.isfinite(expected)])
    return built[described], described, compiling
