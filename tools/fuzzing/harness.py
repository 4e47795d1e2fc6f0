"""Mutants of all readers, spread over processes; what they led to, as a table."""

from __future__ import annotations

import json
import os
import selectors
import shutil
import signal
import tempfile
import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from tools.fuzzing.reader import Reader
from tools.fuzzing.trial import SECONDS, Tally, start

# Mutants that a process reads, where it reads them itself and where it starts a child for each.
_MANY: Final = 1000
_FEW: Final = 25
# Seconds without progress after which a process is taken to hang, on a busy machine.
_PATIENCE: Final = 20.0 * SECONDS
_BETWEEN_LINES: Final = 10.0
# Failures of one cause that are kept as files.
_KEPT: Final = 3
_MEMORY: Final = Path("/dev/shm")


@dataclass(slots=True, kw_only=True)
class Row:
    """What the mutants of a reader led to."""

    reader: Reader
    planned: int
    results: int = 0
    refusals: int = 0
    ended: int = 0
    failures: int = 0
    longest: float = 0.0
    slowest: int = -1
    peak: float = 0.0
    seconds: float = 0.0
    causes: Counter[str] = field(default_factory=Counter)

    @property
    def mutants(self) -> int:
        """How many have been read."""
        return self.results + self.refusals + self.ended + self.failures


@dataclass(slots=True, kw_only=True)
class _Trial:
    """A process at work."""

    row: Row
    numbers: range
    folder: Path
    tally: Tally
    process: int
    pipe: int
    began: float
    seen: float
    moved: float
    told: bytes = b""


class Harness:
    """Reads mutants in processes, at most `n_processes` at a time; failures become files in the folder `kept`."""

    def __init__(
        self, readers: Sequence[Reader], n_mutants: int, *, n_processes: int, kept: Path, first: int = 0
    ) -> None:
        whole = sum(reader.share for reader in readers)
        self.rows = [
            Row(reader=reader, planned=max(1, round(n_mutants * reader.share / whole))) for reader in readers
        ]
        self._n_processes = n_processes
        self._kept = kept
        self._waiting: deque[tuple[Row, range]] = deque()
        left = {id(row): range(first, first + row.planned) for row in self.rows}
        # Every reader gets its turn, so that an early end leaves none out.
        while left:
            for row in self.rows:
                numbers = left.get(id(row))
                if numbers is not None:
                    size = _FEW if row.reader.in_child else _MANY
                    self._waiting.append((row, numbers[:size]))
                    left[id(row)] = numbers[size:]
                    if not left[id(row)]:
                        del left[id(row)]
        self._running: list[_Trial] = []

    def run(self, note: Callable[[str], None]) -> None:
        """Read all mutants; Ctrl-C ends it at once, with what has been counted."""
        began, said = time.monotonic(), time.monotonic()
        note(f"{sum(row.planned for row in self.rows):,} mutants for {len(self.rows)} readers")
        root = Path(tempfile.mkdtemp(prefix="mrwork-faults-", dir=_MEMORY if _MEMORY.is_dir() else None))
        try:
            while self._waiting or self._running:
                while self._waiting and len(self._running) < self._n_processes:
                    # An interrupt while a process is forked would be lost, or the process would.
                    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
                    self._begin(*self._waiting.popleft(), root)
                    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
                self._listen()
                if time.monotonic() - said > _BETWEEN_LINES:
                    said = time.monotonic()
                    note(self._progress(said - began))
        finally:
            for trial in self._running:
                with suppress(ProcessLookupError):
                    os.killpg(trial.process, signal.SIGKILL)
                self._add(trial, until=int(trial.tally.number))
            shutil.rmtree(root, ignore_errors=True)

    def _begin(self, row: Row, numbers: range, root: Path) -> None:
        folder, tally = Path(tempfile.mkdtemp(dir=root)), Tally()
        process, pipe = start(row.reader, numbers, folder, tally)
        now = time.monotonic()
        self._running.append(
            _Trial(
                row=row,
                numbers=numbers,
                folder=folder,
                tally=tally,
                process=process,
                pipe=pipe,
                began=now,
                seen=tally.number,
                moved=now,
            )
        )

    def _listen(self) -> None:
        """Wait until a process tells of a failure or ends."""
        with selectors.DefaultSelector() as selector:
            for trial in self._running:
                selector.register(trial.pipe, selectors.EVENT_READ, trial)
            ready = [key.data for key, _ in selector.select(timeout=0.5)]
        for trial in ready:
            piece = os.read(trial.pipe, 1 << 20)
            trial.told += piece
            if not piece:
                self._end(trial)
        now = time.monotonic()
        for trial in self._running:
            if trial.tally.number != trial.seen:
                trial.seen, trial.moved = trial.tally.number, now
            elif now - trial.moved > _PATIENCE:
                trial.moved = now
                os.killpg(trial.process, signal.SIGKILL)

    def _end(self, trial: _Trial) -> None:
        self._running.remove(trial)
        os.close(trial.pipe)
        _, status = os.waitpid(trial.process, 0)
        # What a killed reader has started.
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(trial.process, signal.SIGKILL)
        shutil.rmtree(trial.folder, ignore_errors=True)
        here = int(trial.tally.number)
        self._add(trial, until=here)
        if os.WIFSIGNALED(status):
            number = os.WTERMSIG(status)
            if trial.row.reader.in_child is False:
                trial.row.ended += 1
            else:
                trial.row.failures += 1
                late = number in (signal.SIGPROF, signal.SIGKILL)
                why = "takes too long" if late else f"ended by {signal.Signals(number).name}"
                self._keep(trial.row, here, why)
        if here + 1 < trial.numbers.stop:
            self._waiting.appendleft((trial.row, range(here + 1, trial.numbers.stop)))

    def _add(self, trial: _Trial, *, until: int) -> None:
        row, tally = trial.row, trial.tally
        row.results += int(tally.results)
        row.refusals += int(tally.refusals)
        row.failures += int(tally.failures)
        row.peak = max(row.peak, tally.peak)
        if tally.longest > row.longest:
            row.longest, row.slowest = tally.longest, int(tally.slowest)
        row.seconds += time.monotonic() - trial.began
        for line in trial.told.splitlines():
            with suppress(ValueError):
                failure = json.loads(line)
                if failure["number"] < 0:
                    row.failures += 1
                    row.causes[failure["why"]] += 1
                    continue
                self._keep(row, failure["number"], failure["why"])

    def _keep(self, row: Row, number: int, why: str) -> None:
        """Keep the file of a failure with what makes it again, a few of each cause."""
        lines = why.strip().splitlines()
        place = next((line.strip() for line in reversed(lines[:-1]) if line.lstrip().startswith("File ")), "")
        cause = f"{lines[-1].partition(':')[0]}, {place}" if place else lines[0].partition(": ")[0]
        row.causes[cause] += 1
        if row.causes[cause] > _KEPT:
            return
        seed, content = row.reader.mutant(number)
        folder = self._kept / f"{row.reader.name.replace(' ', '_').replace('/', '_')}-{number}"
        path = folder / seed.file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
        recipe = {"reader": row.reader.name, "seed": seed.file, "number": number, "why": why}
        (folder / "recipe.json").write_text(json.dumps(recipe, indent=2))

    def _progress(self, elapsed: float) -> str:
        running = sum(
            int(each.tally.results + each.tally.refusals + each.tally.failures) for each in self._running
        )
        done = sum(row.mutants for row in self.rows) + running
        planned = sum(row.planned for row in self.rows)
        failures = sum(row.failures for row in self.rows)
        rate = done / max(elapsed, 1e-9)
        minutes = (planned - done) / max(rate, 1e-9) / 60.0
        return f"{done:,} of {planned:,} mutants, {rate:,.0f} in a second, {minutes:.1f} min left, {failures} failures"

    def table(self) -> str:
        """Counts of every reader, and of all."""
        head = (
            "reader",
            "mutants",
            "results",
            "refusals",
            "ended",
            "failures",
            "longest [s]",
            "peak [MB]",
            "in a second",
        )
        lines: list[tuple[str, ...]] = [head]
        for row in self.rows:
            rate = row.mutants / row.seconds if row.seconds else 0.0
            lines.append(
                (
                    row.reader.name,
                    *(
                        f"{each:,}"
                        for each in (row.mutants, row.results, row.refusals, row.ended, row.failures)
                    ),
                    f"{row.longest:.2f}",
                    f"{row.peak / 1e6:.0f}",
                    f"{rate:,.0f}",
                )
            )
        sums = [
            sum(getattr(row, name) for row in self.rows)
            for name in ("mutants", "results", "refusals", "ended", "failures")
        ]
        lines.append(
            (
                "all",
                *(f"{each:,}" for each in sums),
                f"{max(row.longest for row in self.rows):.2f}",
                f"{max(row.peak for row in self.rows) / 1e6:.0f}",
                "",
            )
        )
        widths = [max(len(line[column]) for line in lines) for column in range(len(head))]
        return "\n".join(
            "  ".join(
                text.ljust(width) if not column else text.rjust(width)
                for column, (text, width) in enumerate(zip(line, widths, strict=True))
            )
            for line in lines
        )

    def causes(self) -> list[str]:
        """One line for each cause of failures."""
        return [
            f"{row.reader.name}: {count} x {cause}"
            for row in self.rows
            for cause, count in row.causes.most_common()
        ]

    @property
    def n_failures(self) -> int:
        """How many mutants led to what is not allowed."""
        return sum(row.failures for row in self.rows)
