"""`study.py loop`: thousands of closed-loop runs of a building, beside numba, jax, SciPy and python-control."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial

import numpy as np

from mrwork.errors import SettingError
from studies.former.arrays import Floats
from studies.former.table import table_of
from studies.speed.loop_workload import STEP, LoopWorkload, loop_workload
from studies.speed.timing import require_agreement, timed
from studies.speed.workers import Benchmark, Say, cores_for, rows_of, silent

Prepare = Callable[[LoopWorkload], Callable[[], Floats]]

OURS = "mrwork"
# One run, the rest extrapolated.
_ALONE = ("solve_ivp", "python_control")
# Contenders with the package that each needs. The series is numba with a tanh of its own, fit for vectors.
_TOOLS = {
    OURS: "mrwork",
    "numba": "numba",
    "numba_series": "numba",
    "jax": "jax",
    "solve_ivp": "scipy",
    "python_control": "control",
}
# Runs of 30 000 steps in double precision whose sums are formed in different orders, against the largest of a column.
AGREEMENT = 1e-9
# A method of another order on the same loop.
_LOOSE_AGREEMENT = 1e-2
# Variants are compared on this part of the record, best of three.
_TRIAL_STEPS = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopRow:
    """One contender on one number of threads.

    Attributes
    ----------
    runs, seconds : all of them, and the median time they take. Where `extrapolated`, one run was timed on one core,
        and the others are taken to be like it, shared without loss among the threads.
    ratio : its seconds over ours, `None` where we did not take part.
    compile_seconds : apart from `seconds`.
    variant : the fastest layout, which was timed.
    difference : largest deviation of what is kept of the runs from what we find, against the largest of its kind.
    """

    tool: str
    threads: int
    runs: int
    seconds: float
    ratio: float | None
    extrapolated: bool
    compile_seconds: float
    variant: str
    difference: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopBenchmark(Benchmark):
    """All rows of one run; `left_out` names contenders that are not installed."""

    rows: tuple[LoopRow, ...]
    left_out: tuple[str, ...]
    candidates: int
    motions: int
    seconds: float
    step: float
    rounds: int

    def text(self) -> Iterator[str]:
        """Seconds of all runs, and how many times ours they are."""
        yield (
            f"{self.candidates} candidates x {self.motions} motions of {self.seconds:g} s: clipped-optimal "
            f"control of a five-storey building, command and step {1e3 * self.step:g} ms; medians of "
            f"{self.rounds} rounds, compilation apart"
        )
        yield ""
        yield from table_of(
            "",
            "tool",
            ((row.tool, asdict(row)) for row in self.rows),
            {
                "threads": "{threads}",
                "seconds": lambda row: (
                    f"{row['seconds']:.2f}" if row["seconds"] < 1000 else f"{row['seconds'] / 3600:.1f} h"
                ),
                "ours x": lambda row: "-" if row["ratio"] is None else f"{row['ratio']:.1f}",
                "compiled": "{compile_seconds:.1f} s",
                "differs": "{difference:.0e}",
            },
        ).lines()
        yield ""
        for row in self.rows:
            mark = ", one run extrapolated" if row.extrapolated else ""
            yield f"{row.tool}, {row.threads} thread(s): {row.variant}{mark}"
        yield ""
        yield "numba_series: numba with a tanh written out for vectors instead of the library's."
        if self.left_out:
            yield f"not installed: {', '.join(self.left_out)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """Median seconds of the runs of one contender, what compiling took, and the way it was laid out.

    `kept` is what it keeps of the runs, nested lists of shape (n_motions, n_candidates, N_REDUCTIONS).
    """

    kept: list[list[list[float]]]
    seconds: float
    compile_seconds: float
    variant: str


def bench_loop(
    *,
    candidates: int = 1000,
    motions: int = 4,
    seconds: float = 30.0,
    threads: Sequence[int] = (1, 2),
    rounds: int = 3,
    say: Say = silent,
) -> LoopBenchmark:
    """Clipped-optimal control of a five-storey building, candidates under motions; see `loop_workload`.

    Each contender has a process of its own for each number of threads, pinned to that many cores; they follow one
    another. The peers' layout is searched on a short piece and the fastest is timed; compilation is measured
    separately. What is kept of the runs must agree.
    """
    if not threads or min(*threads, candidates, motions, rounds) < 1 or not seconds >= STEP:
        raise SettingError(
            "`candidates`, `motions`, `threads` and `rounds` must be 1 or more, `seconds` a step or more"
        )
    cores = cores_for(threads)
    present = [tool for tool, package in _TOOLS.items() if importlib.util.find_spec(package) is not None]
    rows: list[LoopRow] = []
    whole = {"candidates": candidates, "motions": motions, "rounds": rounds}
    for count in threads:
        measured: dict[str, Measured] = {}
        for tool in present:
            size = dict.fromkeys(whole, 1) if tool in _ALONE else whole
            own = cores[: 1 if tool in _ALONE else count]
            settings = {"tool": tool, "seconds": seconds, **size}
            (measured[tool],) = rows_of(measure, own, settings, say)
            say(f"{count} thread(s): {tool}, {measured[tool].seconds:.2f} s")
        rows += summarise(measured, runs=candidates * motions, threads=count)
    return LoopBenchmark(
        rows=tuple(rows),
        left_out=tuple(tool for tool in _TOOLS if tool not in present),
        candidates=candidates,
        motions=motions,
        seconds=seconds,
        step=STEP,
        rounds=rounds,
    )


def summarise(measured: Mapping[str, Measured], *, runs: int, threads: int) -> list[LoopRow]:
    """Rows of one number of threads, of contenders that agree with the first one."""
    reference, first = next(iter(measured.items()))
    expected = np.array(first.kept)
    rows: list[LoopRow] = []
    for tool, item in measured.items():
        kept = np.array(item.kept)
        n_motions, n_candidates = kept.shape[:2]
        against = expected[:n_motions, :n_candidates]
        difference = float(np.max(np.abs(kept - against) / np.abs(against).max(axis=(0, 1))))
        allowed = _LOOSE_AGREEMENT if tool == "solve_ivp" else AGREEMENT
        require_agreement(f"{tool} and {reference}", "run", difference, allowed)
        extrapolated = n_motions * n_candidates != runs
        seconds = item.seconds * runs / threads if extrapolated else item.seconds
        rows.append(
            LoopRow(
                tool=tool,
                threads=threads,
                runs=runs,
                seconds=seconds,
                ratio=seconds / measured[OURS].seconds if OURS in measured else None,
                extrapolated=extrapolated,
                compile_seconds=item.compile_seconds,
                variant=item.variant,
                difference=difference,
            )
        )
    return rows


def measure(
    *, threads: int, tool: str, candidates: int, motions: int, seconds: float, rounds: int
) -> Iterator[Measured]:
    """Find the fastest variant of a contender on a short piece, then time it on the whole."""
    workload = loop_workload(candidates, motions, seconds)
    n_steps = min(_TRIAL_STEPS, workload.n_steps)
    piece = workload.cut(candidates=candidates, motions=motions, n_steps=n_steps)
    choices = [(name, prepare, *_trial(prepare, piece)) for name, prepare in _ways(tool, threads)]
    name, prepare, _, compiling = min(choices, key=lambda choice: choice[2])
    run = prepare(workload)
    if rounds > 1:
        run()  # compiles what is compiled for these shapes
    passes = [timed(run) for _ in range(rounds)]
    yield Measured(
        kept=passes[-1][0].tolist(),
        seconds=float(np.median([spent for _, spent in passes])),
        compile_seconds=compiling,
        variant=name,
    )


def _ways(tool: str, threads: int) -> Iterator[tuple[str, Prepare]]:
    """The variants of a contender, each with its name."""
    match tool:
        case "mrwork":
            from mrwork import dampers as core
            from studies.speed.loop_ours import prepare

            yield f"simulate_loop, {core.instruction_set().used}", partial(prepare, threads=threads)
        case "numba" | "numba_series":
            from studies.speed import loop_numba

            for way in loop_numba.LIBRARY if tool == "numba" else loop_numba.SERIES:
                yield way.describe(), partial(loop_numba.prepare, variant=way)
        case "jax":
            from studies.speed import loop_jax

            for form in loop_jax.VARIANTS:
                yield form.describe(), partial(loop_jax.prepare, variant=form)
        case "solve_ivp":
            from studies.speed.loop_plain import by_solve_ivp

            yield "RK45, called anew every control sample", by_solve_ivp
        case "python_control":
            from studies.speed.loop_plain import by_python_control

            yield "input_output_response, our step as its update", by_python_control


def _trial(prepare: Prepare, piece: LoopWorkload) -> tuple[float, float]:
    """Seconds of the piece, and what the first pass took beyond that."""
    run, preparing = timed(lambda: prepare(piece))
    first = preparing + timed(run)[1]
    best = min(timed(run)[1] for _ in range(3))
    return best, max(0.0, first - best)
