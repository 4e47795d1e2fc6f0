"""One process of the regulator benchmark: plants, weights, our gains and those of SciPy, timed in turns.

Run as `python -m studies.speed.regulators_worker CORES SETTINGS` by `bench_regulators`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from mrwork.control import regulator_gains
from mrwork.errors import MrworkError
from studies.speed.processes import send, serve

Floats = NDArray[np.float64]

# Relative difference of gains that two solvers of a well-scaled equation may have.
AGREEMENT = 1e-7
_RANDOM_SEED = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class RegulatorSettings:
    """States of each plant, equations of a batch, how many of them SciPy solves, and rounds."""

    states: int
    batch: int
    scipy_batch: int
    rounds: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RegulatorRow:
    """Designs per second on one number of threads, medians of the rounds.

    Attributes
    ----------
    ours, scipy : designs per second of `regulator_gains` and of `scipy.linalg.solve_continuous_are`.
    ratio : ours over SciPy's.
    residual, scipy_residual : largest of the equations `A'P + P A - P B R^-1 B'P + Q`, relative to the norms of their
        terms, in the coordinates that both are given.
    difference : largest relative difference of a gain.
    """

    states: int
    batch: int
    threads: int
    ours: float
    scipy: float
    ratio: float
    residual: float
    scipy_residual: float
    difference: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Equations:
    """A, B, Q and R of a batch, shapes (batch, n, n), (batch, n, 1), (n, n), (batch, 1, 1)."""

    A: Floats
    B: Floats
    Q: Floats
    R: Floats


def frames(states: int, batch: int) -> Equations:
    """Shear frames of 330 kg and 1.45 MN/m a storey, +-10 %, 1 to 3 % of damping, a device across the first storey.

    The coordinates are those in which s's is twice the energy of the frame, so that SciPy meets well-scaled matrices;
    the energy is weighed, with R from 1e-9 to 1e-5 1/N^2.
    """
    rng = np.random.default_rng(_RANDOM_SEED)
    n = states // 2
    A, B = np.zeros((batch, states, states)), np.zeros((batch, states, 1))
    for row in range(batch):
        stiffness = 1.448e6 * rng.uniform(0.9, 1.1, n)
        mass = 330.0 * rng.uniform(0.9, 1.1, n)
        # Each spring is stretched by the difference of two floors: K = E' diag(k) E.
        stretch = np.sqrt(stiffness)[:, None] * (np.eye(n) - np.eye(n, k=-1)) / np.sqrt(mass)
        frequencies = np.linalg.svd(stretch, compute_uv=False)
        damping = 2.0 * rng.uniform(0.01, 0.03) / (frequencies[0] + frequencies[-1])
        A[row, :n, n:] = stretch
        A[row, n:, :n] = -stretch.T
        A[row, n:, n:] = -damping * (stretch.T @ stretch + frequencies[0] * frequencies[-1] * np.eye(n))
        B[row, n, 0] = -1.0 / np.sqrt(mass[0])
    R = rng.permutation(np.geomspace(1e-9, 1e-5, batch)).reshape(-1, 1, 1)
    return Equations(A=A, B=B, Q=np.eye(states), R=R)


def measure(settings: RegulatorSettings, threads: int) -> None:
    """Check that both find the same gains, then time them in turns."""
    equations = frames(settings.states, settings.batch)
    A, B, Q, R = equations.A, equations.B, equations.Q, equations.R
    few = settings.scipy_batch

    def ours() -> tuple[Floats, Floats]:
        found = regulator_gains(A, B, Q, R, scaling=np.eye(settings.states), threads=threads)
        if not found.solved.all():
            raise MrworkError(f"{int(np.sum(~found.solved))} of the regulators of {settings} were not found")
        return found.gain, found.P

    def of_scipy(row: int) -> Floats:
        return np.asarray(scipy.linalg.solve_continuous_are(A[row], B[row], Q, R[row]), dtype=np.float64)

    with ThreadPoolExecutor(threads) as pool:

        def peer() -> Floats:
            # LAPACK is called without the interpreter, so threads gain something.
            rows = range(few)
            return np.array([of_scipy(row) for row in rows] if threads == 1 else [*pool.map(of_scipy, rows)])

        gain, P = ours()
        other = peer()
        gain_of_other = np.swapaxes(B[:few], 1, 2) @ other / R[:few]
        sizes = np.linalg.norm(gain[:few], axis=(1, 2))
        difference = float(np.max(np.linalg.norm(gain_of_other - gain[:few], axis=(1, 2)) / sizes))
        if not difference <= AGREEMENT:
            raise MrworkError(
                f"mrwork and SciPy were expected to agree on every gain of {settings.states} states to {AGREEMENT:g}, "
                f"they differ by {difference:.2e} (relative); do not trust the times, find which one is wrong"
            )
        times: tuple[list[float], list[float]] = ([], [])
        for _ in range(settings.rounds):
            for run, spent in zip((ours, peer), times, strict=True):
                spent.append(_seconds(run))
    per_second = settings.batch / float(np.median(times[0]))
    of_peer = few / float(np.median(times[1]))
    row = RegulatorRow(
        states=settings.states,
        batch=settings.batch,
        threads=threads,
        ours=per_second,
        scipy=of_peer,
        ratio=per_second / of_peer,
        residual=residual(A, B, Q, R, P),
        scipy_residual=residual(A[:few], B[:few], Q, R[:few], other),
        difference=difference,
    )
    send("row", asdict(row))


def residual(A: Floats, B: Floats, Q: Floats, R: Floats, P: Floats) -> float:
    """Largest residual of a batch, relative to the norms of the terms."""
    PA, PB = P @ A, P @ B
    terms = (np.swapaxes(PA, 1, 2), PA, -PB @ np.swapaxes(PB, 1, 2) / R, np.broadcast_to(Q, A.shape))
    norms = [np.linalg.norm(term, axis=(1, 2)) for term in terms]
    return float(np.max(np.linalg.norm(np.sum(terms, axis=0), axis=(1, 2)) / np.sum(norms, axis=0)))


def _seconds(run: Callable[[], object]) -> float:
    began = time.perf_counter()
    run()
    return time.perf_counter() - began


if __name__ == "__main__":
    serve(RegulatorSettings, measure)
