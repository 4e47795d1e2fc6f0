"""Run of an identification: tests in parallel on threads, counts of simulations, progress reports, interruption."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from mrwork.base.progress import Progress
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


Stage = Literal["search", "screening", "refinement"]


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


@array_dataclass()
class Found:
    """What a search has found: its `best` point, (n_params,), its trace, and the share of iterations that are done.

    `fitted` is what the best fit is of, as "dahl on excerpts", empty for all samples; `route` is what of the
    search is at work.
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
class Identifying(LongCall["tuple[Floats, SearchTrace]"]):
    """An identification that runs, with the counts of its tally; so far it has a point and the trace that led to it.

    `least` is the least misfit of each stage and what it fits: searches and local minimisations follow each other, of
    which each begins anew.
    """

    tally: Tally
    least: dict[tuple[Stage, str], float] = field(default_factory=dict)

    def on_search(self, found: Found) -> None:
        """Keep the best point of a search for an interrupt, and report the search."""
        trace = found.trace
        self.so_far = lambda: (found.best(), replace(trace, stop_reason="interrupted"))
        median, generation = 100.0 * (1.0 - trace.median[-1]), len(trace.best)
        said = [f"by {found.route}"] if found.route else []
        if math.isfinite(median):
            said.append(f"median {median:.2f} %")
        numbers = {"generation": generation, "median_percent": median}
        self._report("search", f" {generation}", trace.best[-1], found.fitted, said, numbers, found.share)

    def on_steps(self, stage: Stage, steps: int, misfit: float, fitted: str = "") -> None:
        """Report local minimisations of what is `fitted`."""
        self._report(stage, "", misfit, fitted, [f"{steps} steps"], {"iterations": steps})

    def _report(
        self,
        stage: Stage,
        where: str,
        misfit: float,
        fitted: str,
        said: Sequence[str],
        numbers: Mapping[str, float],
        share: float | None = None,
    ) -> None:
        least = self.least[stage, fitted] = min(misfit, self.least.get((stage, fitted), math.inf))
        fit_percent = 100.0 * (1.0 - least)
        of = f" ({fitted})" if fitted else ""
        counts = {"evaluations": self.tally.simulations, "steps": self.tally.steps}
        self.report(
            Progress(
                stage=stage,
                said=(f"{stage}{where}", f"best {fit_percent:.2f} %{of}", *said),
                share=share,
                at_most=True,
                numbers={"fit_percent": fit_percent, **numbers, **counts},
                rated=tuple(counts),
            )
        )
