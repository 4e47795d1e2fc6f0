"""`study.py identify`: simulations and seconds until a search is near the best known fit, ours beside others."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

from mrwork.errors import SettingError
from studies.speed.attempt import AttemptResult
from studies.speed.bars import USUAL, Bar, bars_of
from studies.speed.early_abort import EarlyAbort
from studies.speed.identify_worker import IdentifySettings, Setup
from studies.speed.processes import cores_for, run_worker
from studies.speed.search_rows import SearchRow, TestRow, extrapolated, row_of, test_row_of
from studies.speed.usual_way import UsualWay


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchBenchmark:
    """All that one run found; `interrupted` before all seeds had their turn."""

    rows: tuple[SearchRow, ...]
    early_abort: tuple[EarlyAbort, ...]
    tests: tuple[TestRow, ...]
    bars: tuple[Bar, ...]
    setups: tuple[Setup, ...]
    usual_way: UsualWay | None
    seconds: float
    interrupted: bool

    def as_dict(self) -> dict[str, Any]:
        """Plain nested dictionaries and lists, ready for JSON."""
        return asdict(self) | {"bars": [asdict(bar) | {"met": bar.met} for bar in self.bars]}


@dataclass(slots=True, kw_only=True)
class _Received:
    """Messages of the workers so far."""

    setups: list[Setup]
    outcomes: dict[tuple[int, str, str], list[AttemptResult]]
    on_tests: dict[tuple[str, float], list[AttemptResult]]
    early_abort: list[EarlyAbort]
    usual_way: UsualWay | None = None

    def take(self, kind: str, content: Any) -> None:
        if kind == "setup":
            self.setups.append(Setup(**content))
        elif kind == "outcome":
            key = content.pop("threads"), content.pop("method"), content.pop("objective")
            self.outcomes.setdefault(key, []).append(AttemptResult(**content))
        elif kind == "on_test":
            about = content.pop("test"), content.pop("best_known_percent")
            self.on_tests.setdefault(about, []).append(AttemptResult(**content))
        elif kind == "early_abort":
            self.early_abort.append(EarlyAbort(**content))
        elif kind == "usual_way":
            self.usual_way = UsualWay(**content)


def bench_identify(
    *,
    seeds: int = 20,
    threads: tuple[int, ...] = (),
    budget: int = 5000,
    quick: bool = False,
    all_tests: bool = False,
    on_progress: Callable[[str], None] | None = None,
) -> SearchBenchmark:
    """Let our searches and those of other libraries look for the same fit, in turns, seed by seed.

    Each number of threads gets a process of its own, pinned to that many cores. Loading, compiling and choosing the
    fastest numba come first and are not timed. The target is within 0.2 points of the best fit that a long multistart
    of least squares found at the start of the same run. Ctrl-C ends the run; what was measured until then is returned.

    Parameters
    ----------
    seeds : attempts of each method.
    threads : numbers of threads, none above the cores of this machine; without any, 1 and all.
    budget : simulations after which an attempt has failed.
    quick : a rough look: smaller allowances, one thread unless set otherwise, the first numba that comes.
    all_tests : also the default of `identify` on the five currents of the reference test.
    on_progress : called with one line of text: what runs, and about how long it will take.
    """
    if min(seeds, budget, *threads, 1) < 1:
        raise SettingError("`seeds`, `budget` and `threads` must be 1 or more; give positive numbers")
    cores = cores_for(threads or (1,))
    counts = threads or ((1,) if quick else tuple(dict.fromkeys((1, len(cores)))))
    settings = IdentifySettings(
        seeds=seeds,
        budget=budget,
        known_budget=1000 if quick else 10_000,
        abort_generations=10 if quick else 60,
        abort_seeds=1 if quick else 5,
        usual_candidates=2 if quick else 20,
        choose_variant=not quick,
        all_tests=all_tests,
        last=False,
    )
    received = _Received(setups=[], outcomes={}, on_tests={}, early_abort=[])
    began = time.perf_counter()
    interrupted = False
    try:
        for place, count in enumerate(counts):
            arguments = [json.dumps(asdict(replace(settings, last=place == len(counts) - 1)))]
            turns_began = 0.0
            for kind, content in run_worker("studies.speed.identify_worker", cores[:count], arguments):
                if kind == "setup":
                    turns_began = time.perf_counter()
                if kind != "progress":
                    received.take(kind, content)
                elif on_progress is not None:
                    left = _time_left(received, count, seeds, turns_began)
                    on_progress(f"{count} thread(s), {content}{left}")
    except KeyboardInterrupt:
        interrupted = True
    rows = _rows(received)
    tests = tuple(test_row_of(about, outcomes) for about, outcomes in received.on_tests.items())
    return SearchBenchmark(
        rows=rows,
        early_abort=tuple(received.early_abort),
        tests=tests,
        bars=tuple(bars_of(rows, tests, received.early_abort)),
        setups=tuple(received.setups),
        usual_way=received.usual_way,
        seconds=time.perf_counter() - began,
        interrupted=interrupted,
    )


def _time_left(received: _Received, threads: int, seeds: int, began: float) -> str:
    """How long the turns of this number of threads go on; empty before their first and after their last."""
    done = sum(len(outcomes) for (count, *_), outcomes in received.outcomes.items() if count == threads)
    if not done:
        return ""
    total = len(received.setups[-1].contenders) * seeds
    left = (time.perf_counter() - began) * (total - done) / done
    return f"; about {left:.0f} s of {total - done} attempts left" if done < total else ""


def _rows(received: _Received) -> tuple[SearchRow, ...]:
    rows: list[SearchRow] = []
    for setup in received.setups:
        for method, objective, settings in setup.contenders:
            outcomes = received.outcomes.get((setup.threads, method, objective), [])
            if outcomes:
                rows.append(row_of(method, objective, setup.threads, settings, outcomes))
    usual = received.usual_way
    if usual is not None:
        threads = received.setups[-1].threads
        swarms = [row for row in rows if row.method == USUAL and row.threads == threads]
        rows += [row for swarm in swarms[:1] for row in extrapolated(swarm, usual)]
    return tuple(rows)


def format_identify(benchmark: SearchBenchmark) -> str:
    """Return the benchmark as aligned text: medians over the attempts that came near, their share, the aims."""
    return "\n".join(_lines(benchmark))


def _lines(benchmark: SearchBenchmark) -> Iterator[str]:
    if not benchmark.setups:
        yield "interrupted before anything was measured"
        return
    setup = benchmark.setups[0]
    kind = "SYNTHETIC, the measured record is not here" if setup.synthetic else "measured"
    yield (
        f"searches of non_symmetric_bouc_wen on {setup.test} ({kind}), {setup.n_time} samples, {len(setup.free)} free "
        "parameters:"
    )
    yield f"simulations and seconds to within 0.2 points of the best known fit, {setup.best_known_percent:.2f} %"
    yield f"(multistart of least squares, {setup.known_simulations} simulations, in the same box)"
    yield ""
    yield (
        f"{'method':<29} {'objective':<19} {'threads':>7} {'simulations':>11} {'seconds':>9} {'success':>8} "
        f"{'seeds':>6} {'s/success':>9} {'gap, points':>11}"
    )
    for row in benchmark.rows:
        yield _line(row)
    yield ""
    yield "Medians over the attempts that came near; s/success counts what failures spent. Compiling and loading are"
    yield "not counted; of seeds run at once each has its share. ~ extrapolated. identify is its whole run, and may"
    yield "leave the box: its gap can be negative. A simulation with its derivatives counts as one, as in the local"
    yield "minimisations of identify and multistart; for the difference quotients of SciPy each column counts."
    yield ""
    for abort in benchmark.early_abort:
        same = "the same to the last bit" if abort.identical else "NOT THE SAME RESULT"
        yield (
            f"early abort, {abort.method}, {abort.threads} thread(s), {abort.generations} generations: "
            f"{abort.steps_share_done:.0%} of the steps, {abort.seconds_ratio:.0%} of the time, {same}"
        )
    for test in benchmark.tests:
        yield (
            f"identify on {test.test}: {test.success:.0%} of {test.n_seeds} seeds near "
            f"{test.best_known_percent:.2f} %, {test.evaluations:.0f} simulations, {test.seconds:.2f} s"
        )
    yield ""
    for bar in benchmark.bars:
        measured = "never near" if bar.measured is None else f"{bar.measured:.3g}"
        met = "met" if bar.met else "NOT MET"
        yield f"{met:<8} {bar.claim}, {bar.threads} thread(s): {measured}, aim {bar.aim:g}"
    yield ""
    for each in dict.fromkeys((row.method, row.settings) for row in benchmark.rows):
        yield f"{each[0]}: {each[1]}"
    for setup in benchmark.setups:
        if setup.numba_variant:
            yield f"fastest numba, {setup.threads} thread(s): {setup.numba_variant}"
    first = ", ".join(f"{name} {seconds:.1f}" for name, seconds in setup.first_call_seconds.items())
    yield f"first calls, with loading and compiling [s]: {first}"
    if setup.missing:
        yield f"not installed: {', '.join(setup.missing)}; to compare, run: pip install 'mrwork[bench]'"
    if benchmark.interrupted:
        yield "interrupted: the rows hold the attempts made until then"


def _line(row: SearchRow) -> str:
    mark = "~" if row.extrapolated else ""
    evaluations = "-" if row.evaluations is None else f"{row.evaluations:.0f}"
    seconds = "-" if row.seconds is None else f"{mark}{row.seconds:.3g}"
    expected = "-" if row.expected_seconds is None else f"{row.expected_seconds:.3g}"
    return (
        f"{row.method:<29} {row.objective:<19} {row.threads:>7} {evaluations:>11} {seconds:>9} {row.success:>8.0%} "
        f"{row.n_seeds:>6} {expected:>9} {row.gap_points:>11.2f}"
    )
