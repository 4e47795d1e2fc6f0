"""Progress of the verbs on stderr."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeVar

from mrwork.cli.terminal import note, write_stderr
from mrwork.progress_display import ProgressLine, Told

if TYPE_CHECKING:
    from mrwork.identification.settings import OnRead

Report = TypeVar("Report")

PATIENCE = 2.0
"""Seconds until the progress line appears, for computations that are often shorter."""


def in_words(report: Told) -> str:
    """What a report says itself."""
    return report.in_words


@contextmanager
def progress_line(
    described: Callable[[Report], str], *, quiet: bool, patience: float = PATIENCE
) -> Iterator[ProgressLine[Report]]:
    """A line of progress, which is cleared at the end."""
    with ProgressLine(described, write=write_stderr, note=note, quiet=quiet, patience=patience) as line:
        yield line


@contextmanager
def reading_line(*, quiet: bool) -> Iterator[OnRead]:
    """Progress line with the number of tests that have been read."""
    with progress_line(_reading_described, quiet=quiet, patience=0.0) as line:
        yield lambda done, total: line((done, total))


def _reading_described(read: tuple[int, int]) -> str:
    done, total = read
    return "reading the test" if total == 1 else f"reading {done + 1} of {total} tests"


@contextmanager
def task_line(task: str, *, quiet: bool) -> Iterator[None]:
    """A line that names a task while it is done."""
    with progress_line(str, quiet=quiet, patience=0.0) as line:
        line(task)
        yield
