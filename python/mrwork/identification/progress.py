"""Run of an identification: tests in parallel on threads, counts of simulations, progress reports, interruption."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from mrwork.base.numbers import duration_in_words, format_rate
from mrwork.base.progress import ProgressReport
from mrwork.base.values import Floats, array_dataclass
from mrwork.store.long_call import LongCall, wait_for

if TYPE_CHECKING:
    from mrwork.identification.fit import SearchTrace

T = TypeVar("T")


def on_every_test(n_tests: int, threads: int, work: Callable[[int, int], T]) -> list[T]:
    """Results of `work(index, threads)` of every test, in the order of the tests.

    As many tests as there are threads run at once, on one thread each; what is left over shares all threads. `threads`
    are 0 for all. Where `work` fails, its error of the first such test is raised. After Ctrl-C no test is started, and
    those that run are abandoned; the threads of these end with the process.
    """
    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    available = threads or processors
    if n_tests == 1 or available == 1:
        return [work(index, threads) for index in range(n_tests)]
    left_over = n_tests % available
    shared = available // left_over if left_over else 1
    queue = iter([(index, 1 if index < n_tests - left_over else shared) for index in range(n_tests)])
    results: dict[int, T] = {}
    failures: dict[int, BaseException] = {}

    def share() -> None:
        # An iterator of a list gives each of its items to one thread only.
        for index, n_threads in queue:
            if failures:
                return
            try:
                results[index] = work(index, n_threads)
            except BaseException as error:  # raised again on the caller's thread
                failures[index] = error

    others = [
        threading.Thread(target=share, name="mrwork-test", daemon=True)
        for _ in range(min(available, n_tests) - 1)
    ]
    try:
        for thread in others:
            thread.start()
        share()
        if not any(isinstance(error, KeyboardInterrupt) for error in failures.values()):
            for thread in others:
                wait_for(thread)
    except KeyboardInterrupt as interrupt:
        failures[-1] = interrupt
    if failures:
        raise min(failures.items(), key=lambda failure: (isinstance(failure[1], Exception), failure[0]))[1]
    return [results[index] for index in range(n_tests)]


# Seconds until the remaining time of a stage is first estimated.
_FIRST_ESTIMATE = 1.0

Stage = Literal["search", "screening", "refinement"]
Unit = Literal["simulations", "steps"]


@dataclass(slots=True)
class Tally:
    """How many candidates have been simulated, with or without their derivatives, and in how many time steps."""

    simulations: int = 0
    steps: int = 0

    def as_record(self) -> Mapping[str, object]:
        """The counts as a journal stores them."""
        return asdict(self)

    def restore(self, record: Mapping[str, Any]) -> None:
        """Go on from the counts that a journal has stored."""
        self.simulations, self.steps = int(record["simulations"]), int(record["steps"])


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress(ProgressReport):
    """Progress of an identification; `share` is the used part of what the stage allows at most.

    `fit_percent` is the best fit so far of what is `fitted`, as "dahl on excerpts"; empty for the model on all samples.
    `generation` counts in the search, and `median_percent` is the median fit of its population; 0 and NaN outside a
    search. `evaluations` and `steps` are the candidates and time steps simulated so far, `rates` how many in a second
    of this stage, and `left` is the time that the stage takes at most [s]; 0 and `None` before they are known.
    """

    stage: Stage
    count: int
    unit: Unit
    fit_percent: float
    share: float = field()
    seconds: float
    generation: int
    median_percent: float
    evaluations: int
    steps: int
    fitted: str = ""
    route: str = ""
    rates: tuple[float, float] = (0.0, 0.0)
    left: float | None = None

    @property
    def best_in_words(self) -> str:
        """The best fit, and of what it is where that is not the model on all samples."""
        return f"best {self.fit_percent:.2f} %{f' ({self.fitted})' if self.fitted else ''}"

    @property
    def in_words(self) -> str:
        """Stage, generation, fits and rates in one line; what is unknown is left out."""
        generation = f" {self.generation}" if self.generation else ""
        parts = [f"{self.stage}{generation}", self.best_in_words]
        if self.route:
            parts.append(f"by {self.route}")
        if math.isfinite(self.median_percent):
            parts.append(f"median {self.median_percent:.2f} %")
        if self.unit == "steps":
            parts.append(f"{self.count} steps")
        if self.rates[1] > 0.0:
            parts += [f"{format_rate(self.rates[0])} evaluations/s", f"{format_rate(self.rates[1])} steps/s"]
        parts.append(duration_in_words(self.seconds))
        if self.left is not None:
            parts.append(f"at most {duration_in_words(self.left)} of this stage left")
        return ", ".join(parts)


def since(began: Progress, progress: Progress) -> Progress:
    """The progress with the rates of the stage that `began` there, and the time that it takes at most."""
    running, done = progress.seconds - began.seconds, min(progress.share, 1.0) - began.share
    if running <= 0.0:
        return progress
    rates = (
        (progress.evaluations - began.evaluations) / running,
        (progress.steps - began.steps) / running,
    )
    is_known = running >= _FIRST_ESTIMATE and done > 0.0
    return replace(
        progress, rates=rates, left=running * (1.0 - began.share - done) / done if is_known else None
    )


@array_dataclass()
class Found:
    """What a search has found: its `best` point, (n_params,), its trace, and the share of iterations that are done.

    `fitted` as of `Progress`; `route` is what of the search is at work.
    """

    best: Callable[[], Floats]
    trace: SearchTrace
    share: float
    fitted: str = ""
    route: str = ""


EXCERPTS = "excerpts"
"""What the searches fit that compare parts of the tests."""


OnSearch = Callable[[Found], None]
"""Called after an iteration of a search with what is found so far."""


def part_of(
    on_search: OnSearch,
    before: float,
    share: float,
    *,
    fitted: str = "",
    best: Callable[[Floats], Floats] = lambda theta: theta,
) -> OnSearch:
    """The callback of a search that is a `share` of a whole, after what is done `before`, on what is `fitted`.

    `best` makes the point of the whole from that of the part.
    """

    def report(found: Found) -> None:
        on_search(
            Found(
                best=lambda: best(found.best()),
                trace=found.trace,
                share=before + share * found.share,
                fitted=" on ".join(filter(None, (found.fitted, fitted))),
                route=found.route,
            )
        )

    return report


@dataclass(slots=True, kw_only=True, eq=False)
class Identifying(LongCall[Progress, "tuple[Floats, SearchTrace]"]):
    """An identification that runs, with the counts of its tally; so far it has a point and the trace that led to it.

    `least` is the least misfit of each stage and what it fits: searches and local minimisations follow each other, of
    which each begins anew.
    """

    tally: Tally
    least: dict[tuple[Stage, str], float] = field(default_factory=dict)
    stage_began: Progress | None = None

    def on_search(self, found: Found) -> None:
        """Keep the best point of a search for an interrupt, and report the search."""
        trace = found.trace
        self.so_far = lambda: (found.best(), replace(trace, stop_reason="interrupted"))
        progress = self._progress("search", trace.best[-1], self.tally.simulations, found.fitted)
        median = 100.0 * (1.0 - trace.median[-1])
        self._report(
            replace(
                progress,
                share=found.share,
                generation=len(trace.best),
                median_percent=median,
                route=found.route,
            )
        )

    def on_steps(self, stage: Stage, steps: int, misfit: float, fitted: str = "") -> None:
        """Report local minimisations of what is `fitted`."""
        self._report(self._progress(stage, misfit, steps, fitted))

    def _progress(self, stage: Stage, misfit: float, count: int, fitted: str) -> Progress:
        least = self.least[stage, fitted] = min(misfit, self.least.get((stage, fitted), math.inf))
        return Progress(
            stage=stage,
            count=count,
            unit="simulations" if stage == "search" else "steps",
            fit_percent=100.0 * (1.0 - least),
            share=0.0,
            seconds=self.seconds,
            generation=0,
            median_percent=math.nan,
            evaluations=self.tally.simulations,
            steps=self.tally.steps,
            fitted=fitted,
        )

    def _report(self, progress: Progress) -> None:
        if self.stage_began is None or self.stage_began.stage != progress.stage or self.recalling:
            self.stage_began = progress
        self.report(since(self.stage_began, progress))
