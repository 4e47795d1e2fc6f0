"""Run of an identification: tests in parallel on threads, counts of simulations, progress reports, interruption."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np

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
        for other in others:
            other.start()
        share()
        if not any(isinstance(error, KeyboardInterrupt) for error in failures.values()):
            for other in others:
                wait_for(other)
    except KeyboardInterrupt as interrupt:
        failures[-1] = interrupt
    if failures:
        raise min(failures.items(), key=lambda failure: (isinstance(failure[1], Exception), failure[0]))[1]
    return [results[index] for index in range(n_tests)]


Stage = Literal["search", "screening", "refinement"]
Unit = Literal["simulations", "steps"]


@dataclass(slots=True)
class Tally:
    """How many candidates have been simulated, with or without their derivatives, and in how many time steps."""

    simulations: int = 0
    steps: int = 0

    def as_record(self) -> Mapping[str, object]:
        """The counts, for a journal."""
        return asdict(self)

    def restore(self, record: Mapping[str, Any]) -> None:
        """Set the counts to recorded ones."""
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
    rates: tuple[float, float] = (0.0, 0.0)
    left: float | None = None

    @property
    def best_in_words(self) -> str:
        """The best fit, and of what it is where that is not the model on all samples."""
        return f"best {self.fit_percent:.2f} %{f' ({self.fitted})' if self.fitted else ''}"

    @property
    def in_words(self) -> str:
        """Progress in one line."""
        generation = f" {self.generation}" if self.generation else ""
        parts = [f"{self.stage}{generation}", self.best_in_words]
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


# Seconds until the remaining time of a stage is first estimated, and within which it follows the estimate.
_FIRST_ESTIMATE = 1.0
_STEADY = 5.0


@dataclass(slots=True)
class Pace:
    """Rates and the time left, from the reports of a stage since it `began`.

    The time left runs down with the clock, and approaches the estimate from the share that is done within some seconds:
    searches end early, and a share grows in steps.
    """

    began: Progress
    share: float = 0.0
    seconds: float = 0.0
    left: float | None = None

    def of(self, progress: Progress) -> Progress:
        """The progress with them."""
        began, running = self.began, progress.seconds - self.began.seconds
        self.share = max(self.share, min(progress.share, 1.0))
        passed, self.seconds = progress.seconds - self.seconds, progress.seconds
        if running <= 0.0:
            return progress
        rates = (progress.evaluations - began.evaluations) / running, (progress.steps - began.steps) / running
        if self.share > began.share and running >= _FIRST_ESTIMATE:
            estimate = running * (1.0 - self.share) / (self.share - began.share)
            run_down = estimate if self.left is None else max(self.left - passed, 0.0)
            self.left = estimate + (run_down - estimate) * math.exp(-passed / _STEADY)
        return replace(progress, rates=rates, left=self.left)


@array_dataclass()
class Found:
    """What a search has found: its `best` point, (n_params,), its trace, and the share of iterations that are done."""

    best: Callable[[], Floats]
    trace: SearchTrace
    share: float


@dataclass(slots=True, kw_only=True, eq=False)
class Identifying(LongCall[Progress, "tuple[Floats, SearchTrace]"]):
    """An identification that runs, with the counts of its tally; so far it has a point and the trace that led to it.

    `least` is the least misfit of each stage and what it fits: searches and local minimisations follow each other, of
    which each begins anew.
    """

    tally: Tally
    least: dict[tuple[Stage, str], float] = field(default_factory=dict)
    pace: Pace | None = None

    def on_search(self, fitted: str, found: Found) -> None:
        """Report a search of what is `fitted`."""
        self.so_far = lambda: (found.best(), replace(found.trace, stop_reason="interrupted"))
        self.tell(
            "search",
            self.tally.simulations,
            "simulations",
            found.trace.best[-1],
            found.share,
            generation=len(found.trace.best),
            median=found.trace.median[-1],
            fitted=fitted,
        )

    def tell(
        self,
        stage: Stage,
        count: int,
        unit: Unit,
        misfit: float,
        share: float,
        *,
        generation: int = 0,
        median: float = np.nan,
        fitted: str = "",
    ) -> None:
        """Report the progress of a stage."""
        least = self.least[stage, fitted] = min(misfit, self.least.get((stage, fitted), math.inf))
        progress = Progress(
            stage=stage,
            count=count,
            unit=unit,
            fit_percent=100.0 * (1.0 - least),
            share=share,
            seconds=self.seconds,
            generation=generation,
            median_percent=100.0 * (1.0 - median),
            evaluations=self.tally.simulations,
            steps=self.tally.steps,
            fitted=fitted,
        )
        if self.pace is None or self.pace.began.stage != stage or self.recalling:
            self.pace = Pace(progress)
        self.report(self.pace.of(progress))
