"""The jobs of search and refinement in numba: the equations, splines and sub-steps of our kernel, in parallel blocks.

The non-symmetric Bouc-Wen model, or the normalised one, whose velocity has no offset, on one or several tests. A
candidate takes as many sub-steps as our stepping rule gives it on a test: a power of two that keeps the product of step
and stiffness bound at 1.4 or below. Pairs of a test and a candidate are sorted by that number, gathered in blocks that
have a test and a number in common, and dealt to the threads in turns, so that all threads have alike to do. Several
candidates innermost let the processor overlap their powers; how many, and with which power and fast-math, is tried out;
`exp_log` writes power and tanh by `math.exp`, which numba evaluates faster.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from mrwork.identification import Objective
from studies.former.arrays import Floats
from studies.speed.numba_peer import NumbaVariant
from studies.speed.refine_job import RefineJob
from studies.speed.search_job import SearchJob
from studies.speed.timing import TimedPeer, fastest_variant, timed
from studies.speed.workload import Run

RESOLUTION = 1.4
MAX_SUBSTEPS = 256
# All liberties of fast-math but that of taking infinity for impossible: it marks a failure.
FASTMATH = {"reassoc", "contract", "arcp", "nsz", "afn"}
# Parameters of a model whose velocity has an offset.
_OFFSET = 10

START = NumbaVariant(block=8, form="exp_log")
CHANGES: tuple[Callable[[NumbaVariant], NumbaVariant], ...] = (
    lambda variant: replace(variant, fastmath=True),
    lambda variant: replace(variant, block=32),
    lambda variant: replace(variant, block=1),
    lambda variant: replace(variant, form="power"),
)
LAYOUTS = tuple(
    NumbaVariant(block=block, threads=threads, fastmath=fastmath, form=form)
    for threads in dict.fromkeys((numba.get_num_threads(), 1))
    for block in (1, 4, 8)
    for fastmath in (False, True)
    for form in ("exp_log", "power")
)


class Records(NamedTuple):
    """What is simulated: samples of the tests one after another, and numbers of each test.

    The splines of the velocity have the lowest power first in the share of a sample interval, the last sample a row of
    its own. A test begins at `begin`, its first sample that counts is number `first`, its residuals begin at `out`.
    """

    velocity: Floats
    displacement: Floats
    force: Floats
    begin: NDArray[np.int64]
    first: NDArray[np.int64]
    out: NDArray[np.int64]
    weight: Floats
    dt: Floats
    peak_velocity: Floats
    reversal_acceleration: Floats

    @classmethod
    def of(cls, objective: Objective) -> Records:
        """Those of our objective."""
        tests, histories = objective.tests, objective.histories
        pieces: list[Floats] = []
        for test in tests:
            own = CubicSpline(np.arange(test.n_time, dtype=np.float64), test.velocity)
            pieces.append(np.vstack([own.c[::-1].T, [test.velocity[-1], 0.0, 0.0, 0.0]]))
        return cls(
            velocity=np.ascontiguousarray(np.concatenate(pieces)),
            displacement=np.concatenate([test.displacement for test in tests]),
            force=np.concatenate([test.force for test in tests]),
            begin=np.concatenate([[0], np.cumsum([test.n_time for test in tests])]),
            first=np.array([test.n_settle for test in tests]),
            out=np.concatenate([[0], np.cumsum([test.n_time - test.n_settle for test in tests])]),
            weight=np.array([compared.weight(len(tests)) for compared in objective.compared]),
            dt=np.array([test.dt for test in tests]),
            peak_velocity=np.array([history.peak_velocity for history in histories]),
            reversal_acceleration=np.array([history.reversal_acceleration for history in histories]),
        )


class NumbaObjective:
    """Misfits and residuals of a batch, as our `Objective` has them."""

    def __init__(self, objective: Objective, variant: NumbaVariant) -> None:
        self.variant = variant
        self.spec = objective.spec
        self.records = Records.of(objective)
        # Of named tuples numba looks up the type anew on every call.
        self._plain_records = tuple(self.records)
        commands = [
            0.0 if history.command is None else float(history.command[0]) for history in objective.histories
        ]
        self.command = np.array(commands)

    def __call__(self, theta: Floats, thresholds: Floats | None = None) -> Floats:
        """Misfit of each row, shape (m,), infinite where a simulation failed; all run to their ends."""
        squared = self._run(theta, np.empty((0, 0)))
        return np.sqrt(np.where(np.isfinite(squared), squared, math.inf))

    def residuals(self, theta: Floats) -> Floats:
        """Weighted residuals of each row, shape (m, n_counted); one everywhere where a simulation failed."""
        residuals = np.empty((len(theta), self.records.out[-1]))
        squared = self._run(theta, residuals)
        residuals[~np.isfinite(squared)] = 1.0
        return residuals

    def substeps(self, theta: Floats) -> NDArray[np.int64]:
        """Sub-steps per sample in each test, shape (n_tests, m), 0 where a row is too stiff."""
        count: NDArray[np.int64] = substeps_of(self.plain(theta), self._plain_records)
        return count

    def plain(self, theta: Floats) -> Floats:
        """Parameters of the plain model in each test, shape (n_tests, m, n_plain)."""
        if self.spec.current is None:
            return np.broadcast_to(theta, (len(self.command), *theta.shape))
        result = np.empty((len(self.command), len(theta), len(self.spec.plain)))
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

    def _run(self, theta: Floats, residuals: Floats) -> Floats:
        """Squared misfit of each row."""
        if self.variant.threads:
            numba.set_num_threads(self.variant.threads)
        plain = self.plain(theta)
        dealt = dealt_of(plain, self._plain_records, self.variant.block, numba.get_num_threads())
        kernel = _compiled(self.variant, plain.shape[2] == _OFFSET, bool(residuals.size))
        squared: Floats = kernel(plain, dealt, self._plain_records, residuals)
        return self.records.weight**2 @ squared


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


def _substeps(theta: Floats, records: Any) -> NDArray[np.int64]:
    """Sub-steps per sample of each candidate on each test, shape (n_tests, m)."""
    dts, peaks, reversals = records[7], records[8], records[9]
    n_tests, n_rows, n_params = theta.shape
    count = np.zeros((n_tests, n_rows), np.int64)
    for test in range(n_tests):
        dt, peak, reversal = dts[test], peaks[test], reversals[test]
        for row in range(n_rows):
            p = theta[test, row]
            mu, w_s = (p[7], p[9]) if n_params == 10 else (0.0, 1.0)
            count[test, row] = steps_of(p[4], p[5], p[6], mu, w_s, dt, peak, reversal)
    return count


substeps_of: Any = numba.njit(error_model="numpy")(_substeps)


def _dealt(theta: Floats, records: Any, block: int, threads: int) -> tuple[NDArray[np.int64], ...]:
    """Sub-steps, pairs of test and candidate in order, where blocks of them begin, and the order of the blocks.

    Most sub-steps come first; the pairs of a block have a test and a number in common.
    """
    count = substeps_of(theta, records).ravel()
    n_tests, n_rows = theta.shape[:2]
    test = np.arange(count.size) // n_rows
    order = np.argsort(test - count * n_tests, kind="mergesort")
    starts = np.empty(count.size + 1, np.int64)
    n_blocks = 0
    for place in range(count.size):
        pair, before = order[place], order[max(place - 1, 0)]
        alike = count[pair] == count[before] and test[pair] == test[before]
        if n_blocks == 0 or not alike or place - starts[n_blocks - 1] == block:
            starts[n_blocks] = place
            n_blocks += 1
    starts[n_blocks] = count.size
    # A thread takes a run of consecutive turns.
    turns = np.empty(n_blocks, np.int64)
    turn = 0
    for thread in range(threads):
        for dealt in range(thread, n_blocks, threads):
            turns[turn] = dealt
            turn += 1
    return count, order, starts, turns


dealt_of: Any = numba.njit(error_model="numpy")(_dealt)


@cache
def _compiled(variant: NumbaVariant, offset: bool, keep: bool) -> Any:
    fastmath = FASTMATH if variant.fastmath else False
    inlined = numba.njit(inline="always", fastmath=fastmath)
    power, hyperbolic = (inlined(function) for function in FORMS[variant.form])
    block = variant.block

    def _shifted(v: float, w: float, mu: float, per_w_s: float) -> float:
        shifted: float = v - mu * hyperbolic(w * per_w_s)
        return shifted

    def _unshifted(v: float, w: float, mu: float, per_w_s: float) -> float:
        return v

    driving = inlined(_shifted if offset else _unshifted)

    def _rate(v: float, w: float, rho: float, sigma: float, n: float, mu: float, per_w_s: float) -> float:
        g = driving(v, w, mu, per_w_s)
        opposing = sigma * math.copysign(abs(g), w) - (sigma - 1.0) * g
        slope: float = rho * (g - power(abs(w), n) * opposing)
        return slope

    rate = inlined(_rate)

    def kernel(theta: Floats, dealt: Any, records: Any, residuals: Floats) -> Floats:
        count, order, starts, turns = dealt
        velocity, displacement, force, begins, firsts, out, weight, dts, _, _ = records
        n_tests, n_rows, n_params = theta.shape
        squared = np.empty((n_tests, n_rows))
        for turn in numba.prange(turns.size):
            begin = starts[turns[turn]]
            width = starts[turns[turn] + 1] - begin
            test = order[begin] // n_rows
            # Without an offset the rows of its parameters stay zero.
            p = np.zeros((10, block))
            w = np.zeros(block)
            total = np.zeros(block)
            rows = order[begin : begin + width] - test * n_rows
            for j in range(width):
                for q in range(n_params):
                    p[q, j] = theta[test, rows[j], q]
                p[9, j] = 1.0 / p[9, j] if offset else 0.0
            c, k, x0, k_w, rho, sigma, n, mu, share, per_w_s = p
            steps = count[order[begin]]
            # A candidate that is too stiff is not simulated.
            total[:] = 0.0 if steps else math.inf
            share_of_interval = 1.0 / steps if steps else 0.0
            step = dts[test] * share_of_interval
            start, end = begins[test], begins[test + 1] if steps else begins[test]
            first = start + firsts[test]
            for i in range(start, end):
                if i >= first:
                    for j in range(width):
                        g = driving(velocity[i, 0], w[j], share[j] * mu[j], per_w_s[j])
                        elastic = k[j] * (displacement[i] - x0[j])
                        residual = c[j] * g + elastic + k_w[j] * w[j] - force[i]
                        total[j] += residual * residual
                        if keep:
                            residuals[rows[j], out[test] + i - first] = residual * weight[test]
                if i == end - 1:
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
                squared[test, rows[j]] = total[j]
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
        objective = built[variant.describe()] = NumbaObjective(job.objective, variant)
        return lambda: objective(theta)

    _, compiling = timed(lambda: (prepare(START)(), built[START.describe()].residuals(theta[:2])))
    changes = CHANGES if choose else ()
    peer = TimedPeer(start=START, changes=changes, prepare=prepare)
    _, described = fastest_variant("numba", peer, expected[np.isfinite(expected)])
    return built[described], described, compiling


def fastest_layout(job: RefineJob, layouts: tuple[NumbaVariant, ...] = LAYOUTS) -> NumbaObjective:
    """The layout whose residuals for a Jacobian, followed by those of a single simulation, take the least time."""
    rows = np.repeat(job.starts[:1], 1 + len(job.box.free), axis=0)

    def seconds(objective: NumbaObjective) -> float:
        spent = [
            timed(lambda: (objective.residuals(rows), objective.residuals(rows[:1])))[1] for _ in range(6)
        ]
        # The first compiles.
        return float(np.median(spent[1:]))

    return min((NumbaObjective(job.objective, layout) for layout in layouts), key=seconds)
