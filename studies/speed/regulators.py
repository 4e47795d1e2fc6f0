"""`study.py regulators`: Riccati gains of many plants beside `scipy.linalg.solve_continuous_are`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass

import numpy as np
import scipy.linalg

from mrwork.control import regulator_gains
from mrwork.errors import MrworkError, SettingError
from studies.former.arrays import Floats
from studies.former.table import table_of
from studies.speed.timing import require_agreement, timed
from studies.speed.workers import Benchmark, Say, cores_for, rows_of, silent

# Equations of a batch by states: about a tenth of a second of ours on one thread.
_BATCHES = {6: 8192, 10: 4096, 20: 512, 40: 64}
# SciPy takes its time, and its equations are solved one after another.
_OF_SCIPY = 64
# Relative difference of gains that two solvers of a well-scaled equation may have.
AGREEMENT = 1e-7
_RANDOM_SEED = 16


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
class RegulatorBenchmark(Benchmark):
    """All rows of one run."""

    rows: tuple[RegulatorRow, ...]
    rounds: int

    def text(self) -> Iterator[str]:
        """Designs per second, their ratio, and how well the equations are solved."""
        yield "Riccati gains of shear frames with one device, a plant and a weight each; designs per second,"
        yield f"medians of {self.rounds} rounds"
        yield ""
        yield from table_of(
            "",
            "states",
            ((str(row.states), asdict(row)) for row in self.rows),
            {
                "batch": "{batch}",
                "threads": "{threads}",
                "ours": "{ours:.0f}",
                "scipy": "{scipy:.0f}",
                "ratio": "{ratio:.1f}",
                "residual": "{residual:.1e}",
                "of scipy": "{scipy_residual:.1e}",
                "gains differ": "{difference:.0e}",
            },
        ).lines()


def bench_regulators(
    *,
    states: Sequence[int] = (6, 10, 20, 40),
    threads: Sequence[int] = (1, 2),
    rounds: int = 7,
    batch: int | None = None,
    say: Say = silent,
) -> RegulatorBenchmark:
    """Regulators of shear frames, each with its own plant and weight; see `frames`."""
    if (
        not threads
        or not states
        or min(*threads, *states, rounds, batch or 1) < 1
        or any(n % 2 for n in states)
    ):
        raise SettingError("`threads`, `rounds` and `batch` must be 1 or more, `states` even and positive")
    cores = cores_for(threads)
    rows: list[RegulatorRow] = []
    for count in threads:
        for n in states:
            size = batch or _BATCHES.get(n, max(8, 4_000_000 // n**3))
            (row,) = rows_of(measure, cores[:count], {"states": n, "batch": size, "rounds": rounds}, say)
            rows.append(row)
            say(f"{count} thread(s), {n} states: {row.ours:.0f} designs/s")
    return RegulatorBenchmark(rows=tuple(rows), rounds=rounds)


def frames(states: int, batch: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Shear frames of 330 kg and 1.45 MN/m a storey, +-10 %, 1 to 3 % of damping, a device across the first storey.

    A, B, Q and R of a batch, shapes (batch, n, n), (batch, n, 1), (n, n), (batch, 1, 1). The coordinates are those in
    which s's is twice the energy of the frame, so that SciPy meets well-scaled matrices; the energy is weighed, with R
    from 1e-9 to 1e-5 1/N^2.
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
    return A, B, np.eye(states), R


def measure(*, threads: int, states: int, batch: int, rounds: int) -> Iterator[RegulatorRow]:
    """Check that both find the same gains, then time them in turns."""
    A, B, Q, R = frames(states, batch)
    few = min(batch, _OF_SCIPY)

    def ours() -> tuple[Floats, Floats]:
        designed = regulator_gains(A, B, Q, R, scaling=np.eye(states), threads=threads)
        if not designed.solved.all():
            missing = int(np.sum(~designed.solved))
            raise MrworkError(f"{missing} of the regulators of {states} states were not found")
        return designed.gain, designed.P

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
        require_agreement("mrwork and SciPy", f"gain of {states} states", difference, AGREEMENT)
        turns = [(timed(ours)[1], timed(peer)[1]) for _ in range(rounds)]
    of_ours, of_peer = np.array([batch, few]) / np.median(turns, axis=0)
    yield RegulatorRow(
        states=states,
        batch=batch,
        threads=threads,
        ours=float(of_ours),
        scipy=float(of_peer),
        ratio=float(of_ours / of_peer),
        residual=residual(A, B, Q, R, P),
        scipy_residual=residual(A[:few], B[:few], Q, R[:few], other),
        difference=difference,
    )


def residual(A: Floats, B: Floats, Q: Floats, R: Floats, P: Floats) -> float:
    """Largest residual of a batch, relative to the norms of the terms."""
    PA, PB = P @ A, P @ B
    terms = (np.swapaxes(PA, 1, 2), PA, -PB @ np.swapaxes(PB, 1, 2) / R, np.broadcast_to(Q, A.shape))
    norms = [np.linalg.norm(term, axis=(1, 2)) for term in terms]
    return float(np.max(np.linalg.norm(np.sum(terms, axis=0), axis=(1, 2)) / np.sum(norms, axis=0)))
