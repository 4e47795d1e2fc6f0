"""Several identifications that do not need each other: one after the other here, or by workers elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from operator import is_
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

from mrwork.base.progress import OnProgress, Progress
from mrwork.dampers.spec import DamperSpec
from mrwork.identification.fit import Fit
from mrwork.identification.identify import identify_with
from mrwork.identification.settings import FitSettings
from mrwork.records import DamperTest
from mrwork.store.input_file import bytes_of
from mrwork.store.journal import JOURNAL_FILE, Journal
from mrwork.workers.engine import present_workers

T = TypeVar("T")

JournalOf = Callable[[str], Journal]
"""Opens the journal of the named step; it is closed when the step is done."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FitTask:
    """An identification of a batch, as for `identify_with`; `step` names its journal."""

    spec: DamperSpec
    tests: tuple[DamperTest, ...]
    settings: FitSettings
    examines: bool = True
    step: str = ""

    def fit(self, journal: Journal | None, *, threads: int, on_progress: OnProgress | None = None) -> Fit:
        """Fit the model of the task to its tests; what the journal has is recalled."""
        return identify_with(
            self.spec,
            self.tests,
            self.settings,
            threads=threads,
            on_progress=on_progress,
            journal=journal,
            warns=False,
            examines=self.examines,
        )


@dataclass(slots=True, kw_only=True)
class FitBatch:
    """Fits of tasks, to be asked for in their order.

    Without workers each is made when it is asked for, else all from the first question on, with their journals as
    each is done. `on_progress` is called with the number of the task that is fitted, or asked for, and the progress of
    its fit or of the workers, if any; `on_fit` with each fit as it is made.
    """

    tasks: Sequence[FitTask]
    threads: int
    journal_of: JournalOf | None = None
    on_progress: Callable[[int, Progress | None], None] = lambda number, progress: None
    on_fit: Callable[[int, Fit], None] = lambda number, fit: None
    _asked: int = field(default=0, init=False)
    _made: Iterator[tuple[int, Future[tuple[Fit, bytes]]]] | None = field(default=None, init=False)

    def fit(self, number: int) -> Fit:
        """The fit of a task; an error of it is raised."""
        self._asked = number
        self._report_asked()
        if self._made is None and present_workers() is not None and len(self.tasks) > 1:
            self._made = enumerate(self._made_elsewhere())
        if self._made is None:
            task = self.tasks[number]
            report = partial(self.on_progress, number)
            fit = with_journal(
                self.journal_of, task.step, partial(task.fit, threads=self.threads, on_progress=report)
            )
            self.on_fit(number, fit)
            return fit
        future = next(future for index, future in self._made if index == number)
        return self._whole(number, future.result()[0])

    def _made_elsewhere(self) -> Iterator[Future[tuple[Fit, bytes]]]:
        workers = present_workers()
        assert workers is not None
        chunks = [
            (task, with_journal(self.journal_of, task.step, lambda journal: journal and journal.lines))
            for task in self.tasks
        ]

        def arrived(number: int, future: Future[tuple[Fit, bytes]]) -> None:
            if future.exception() is None:
                fit, lines = future.result()
                fit = self._whole(number, fit)
                if self.journal_of is not None:
                    with closing(self.journal_of(self.tasks[number].step)) as journal:
                        journal.adopt(lines)
                self.on_fit(number, fit)
            self._report_asked()

        return workers.futures(tuple, fit_on_worker, (), chunks, on_done=arrived)

    def _report_asked(self) -> None:
        workers = present_workers()
        self.on_progress(
            self._asked, None if workers is None else Progress(stage="chunks", said=(workers.in_words,))
        )

    def _whole(self, number: int, fit: Fit) -> Fit:
        """A fit with its tests, which a worker leaves out where they are the tests of the task."""
        return fit if fit.tests else replace(fit, tests=self.tasks[number].tests)


def with_journal(journal_of: JournalOf | None, step: str, work: Callable[[Journal | None], T]) -> T:
    """Do the work of a step with its own journal, if any, which is closed afterwards."""
    if journal_of is None:
        return work(None)
    with closing(journal_of(step)) as journal:
        return work(journal)


def fit_on_worker(_: object, task: FitTask, lines: bytes | None) -> tuple[Fit, bytes]:
    """The fit of a task on one thread, and the lines of its journal, which go on after `lines`."""

    def without_tests(fit: Fit) -> Fit:
        same = len(fit.tests) == len(task.tests) and all(map(is_, fit.tests, task.tests))
        return replace(fit, tests=()) if same else fit

    if lines is None:
        return without_tests(task.fit(None, threads=1)), b""
    with TemporaryDirectory(prefix="mrwork-") as folder:
        path = Path(folder) / "fit.jsonl"
        with closing(Journal(path)) as journal:
            journal.adopt(lines)
        with closing(Journal(path, resume=bool(lines))) as journal:
            fit = task.fit(journal, threads=1)
        return without_tests(fit), bytes_of(path, JOURNAL_FILE)
