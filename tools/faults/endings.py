"""Every long verb, ended in every way that a machine or a user has; then continued, to the same result.

    python -m tools.faults.endings [--verb NAME] [--way NAME] [--points N] [--part K/N] [--stages DIR] [--quick]

A job is a command that takes some seconds on one thread. It is run once undisturbed; then again and again, each time
in a fresh folder, and ended: killed, interrupted, on a disk that is full, beside a second process. After each end its
exit status, what it said, its files and the CPU time that it still used are checked, and the command is continued. At
every second point the folder has a complete earlier run.

The script prints a line per job and way, at the end the table, and exits with 1 where anything failed.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from tools.faults.ended_jobs import JOBS, Job, same_results, written_results

MOST_CPU_AFTER = 0.2
# CPU seconds of the first points: the interpreter and the first modules are loaded.
FIRST = (0.03, 0.08, 0.13, 0.2, 0.3)
PATIENCE = 600.0
TICK = 1.0 / os.sysconf("SC_CLK_TCK")
PAUSE = 0.002


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """How a process ended: status, what it printed, CPU seconds in all and after it was disturbed, if it was."""

    status: int
    stdout: str
    stderr: str
    cpu: float
    after: float | None
    # Whether the program had begun to answer signals by then; before, the interpreter answers in its way.
    begun: bool


@dataclass(slots=True)
class Row:
    """A line of the table."""

    job: str
    way: str
    # Which of all points: every so manieth, from this one on.
    part: tuple[int, int] = (0, 1)
    points: int = 0
    right: int = 0
    early: int = 0
    late: int = 0
    worst: float = 0.0
    seconds: float = 0.0
    skipped: str = ""
    failures: list[str] = field(default_factory=list)

    def numbers(self, points: int) -> range:
        """Numbers of the points to be tried, of so many."""
        first, step = self.part
        return range(first, points, step)

    def add(self, label: str, complaints: Sequence[str], ended: Ended | None = None) -> None:
        """Count a point."""
        self.points += 1
        self.right += not complaints
        if complaints:
            self.failures.append(f"{self.job}, {self.way} {label}: {'; '.join(complaints)}")
        print(
            f"  {'WRONG ' + self.failures[-1] if complaints else f'{self.job}, {self.way} {label}'}",
            flush=True,
        )
        if ended is not None and ended.after is not None:
            self.worst = max(self.worst, ended.after)

    @property
    def text(self) -> str:
        """The line."""
        if self.skipped:
            return f"{self.job:12} {self.way:14} skipped: {self.skipped}"
        return (
            f"{self.job:12} {self.way:14} {self.points:6} {self.right:6} {self.early:6} {self.late:6} "
            f"{self.worst:8.2f} {self.seconds:8.0f}"
        )


HEAD = f"{'job':12} {'way':14} {'points':>6} {'right':>6} {'early':>6} {'late':>6} {'CPU [s]':>8} {'took [s]':>8}"


# Processes


def environment() -> dict[str, str]:
    """One thread, and this package."""
    root = Path(__file__).resolve().parents[2] / "python"
    return os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": str(root), "PYTHONWARNINGS": "default"}


def cpu_of(pid: int) -> float:
    """CPU seconds of a process and of its children that have ended; OSError where it has ended itself."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    if fields[0] == "Z":
        raise ProcessLookupError(pid)
    return TICK * sum(int(each) for each in fields[11:15])


def answers(pid: int) -> bool:
    """Whether a process has a handler for SIGTERM, which the program sets as soon as it can."""
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("SigCgt:"):
            return bool(int(line.split()[1], 16) >> (signal.SIGTERM - 1) & 1)
    return False


def run(
    words: Sequence[str],
    folder: Path,
    *,
    at: float | None = None,
    disturb: Callable[[int], None] | None = None,
    limit: int | None = None,
) -> Ended:
    """Run mrwork in a folder; at that many CPU seconds, `disturb` is called with the process."""
    after = None
    begun = False
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        process = subprocess.Popen(
            [sys.executable, "-m", "mrwork", *words],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=err,
            env=environment(),
        )
        if limit is not None:
            resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (limit, limit))
        give_up = time.monotonic() + PATIENCE
        spent = 0.0
        while True:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                break
            if time.monotonic() > give_up:
                process.kill()
            elif disturb is not None and at is not None:
                with contextlib.suppress(OSError, IndexError, ValueError):
                    spent = cpu_of(process.pid)
                    if spent >= at:
                        begun = answers(process.pid)
                        disturb(process.pid)
                        after, disturb = spent, None
            time.sleep(PAUSE)
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        err.seek(0)
        cpu = usage.ru_utime + usage.ru_stime
        return Ended(
            status=process.returncode,
            stdout=out.read(),
            stderr=err.read(),
            cpu=cpu,
            after=None if after is None else max(cpu - after, 0.0),
            begun=begun,
        )


def said_well(ended: Ended, statuses: Sequence[int]) -> list[str]:
    """What is wrong with the end of a process, by its status and what it printed."""
    wrong = []
    if ended.status not in statuses:
        wrong.append(f"exit status {ended.status} where {statuses} is right")
    if "Traceback" in ended.stderr + ended.stdout:
        wrong.append("a traceback")
    lines = ended.stderr.splitlines()
    if any(not line.startswith("mrwork: ") for line in lines):
        wrong.append("a line on stderr that is not of mrwork")
    if ended.status not in (0, -signal.SIGKILL) and not lines:
        wrong.append("nothing is said")
    if wrong:
        wrong.append(f"stderr: {ended.stderr[-300:]!r}")
    return wrong


# Folders


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """A job with its folders, one before the first run and one with an earlier run, and what its run gives."""

    job: Job
    fresh: Path
    earlier: Path
    whole: dict[str, object]
    before: dict[bool, dict[str, object]]
    cpu: float

    @classmethod
    def of(cls, job: Job, place: Path) -> Stage:
        """Make the folders and run the job undisturbed, unless that was done in this place."""
        fresh, earlier, end = place / "fresh", place / "earlier", place / "whole"
        if not end.exists():
            shutil.rmtree(place, ignore_errors=True)
            fresh.mkdir(parents=True)
            job.prepare(fresh)
            for words in job.base:
                done(words, fresh)
            shutil.copytree(fresh, earlier)
            done(job.former, earlier)
            # Under the name that the points have, which the files state.
            folder = copied(earlier, place / "point")
            (folder / "cpu").write_text(str(done(job.words, folder).cpu))
            folder.rename(end)
        return cls(
            job=job,
            fresh=fresh,
            earlier=earlier,
            whole=written_results(end, job),
            before={True: written_results(earlier, job), False: written_results(fresh, job)},
            cpu=float((end / "cpu").read_text()),
        )

    @contextlib.contextmanager
    def folder(self, number: int) -> Iterator[tuple[Path, bool]]:
        """A fresh folder for a point, and whether an earlier run is in it."""
        with_earlier = number % 2 == 1
        place = copied(self.earlier if with_earlier else self.fresh, self.fresh.with_name("point"))
        try:
            yield place, with_earlier
        finally:
            shutil.rmtree(place)

    def kept(self, folder: Path, with_earlier: bool) -> list[str]:
        """What is wrong with the files: they must be those of before or of the whole run."""
        found = written_results(folder, self.job)
        against = [same_results(found, each) for each in (self.whole, self.before[with_earlier])]
        if not all(against):
            return []
        if not with_earlier and self.job.partial(folder):
            return []
        return [f"files are neither those of before nor of a whole run: {'; '.join(against[1])}"]

    def continued(self, folder: Path, ended: Ended) -> list[str]:
        """What is wrong after the command is given again, with --resume where the job has it."""
        found = written_results(folder, self.job)
        if (
            ended.status in (0, 130, 143)
            and not same_results(found, self.whole)
            and not self.job.pending(folder)
        ):
            return []
        wrong = []
        again = run([*self.job.words, *self.job.resume], folder)
        told = "--resume to continue" in ended.stderr
        if self.job.resume and again.status == 2 and not told and "without --resume" in again.stderr:
            again = run(self.job.words, folder)
        wrong += [f"continued: {each}" for each in said_well(again, (0,))]
        wrong += same_results(written_results(folder, self.job), self.whole)
        wrong += [f"left behind: {each}" for each in self.job.leftovers(folder)]
        return wrong


def done(words: Sequence[str], folder: Path) -> Ended:
    """Run what must succeed."""
    ended = run(words, folder)
    if ended.status != 0:
        raise RuntimeError(f"mrwork {' '.join(words)} ended with {ended.status}: {ended.stderr}")
    return ended


def copied(source: Path, target: Path) -> Path:
    """A copy of a folder."""
    shutil.rmtree(target, ignore_errors=True)
    return Path(shutil.copytree(source, target))


# Ways


def moments(cpu: float, points: int, shift: float) -> list[float]:
    """CPU seconds of the points: some at the start, the others spread over the run."""
    first = FIRST[: points // 4]
    rest = points - len(first)
    return [*first, *(0.3 + (cpu - 0.35) * (number + shift) / rest for number in range(rest))]


def signalled(number: signal.Signals, shift: float) -> Callable[[Stage, Row, int], None]:
    """A signal at points of the run."""

    def tried(stage: Stage, row: Row, points: int) -> None:
        for count in row.numbers(points):
            at = moments(stage.cpu, points, shift)[count]
            with stage.folder(count) as (folder, with_earlier):
                ended = run(stage.job.words, folder, at=at, disturb=lambda pid: os.kill(pid, number))
                if ended.after is None:
                    row.late += 1
                    continue
                complaints = []
                if number == signal.SIGKILL:
                    complaints += said_well(ended, (-signal.SIGKILL,))
                elif not ended.begun:
                    # The interpreter is starting: it ends by the signal, or says so itself.
                    row.early += 1
                    if ended.status not in (-number, 1, 130):
                        complaints.append(f"exit status {ended.status} while the interpreter starts")
                else:
                    # A signal may come when all is done.
                    complaints += said_well(ended, (128 + number, 0))
                    if ended.after > MOST_CPU_AFTER:
                        complaints.append(f"{ended.after:.2f} s of CPU after the signal")
                complaints += stage.kept(folder, with_earlier)
                complaints += stage.continued(folder, ended)
                row.add(f"at {at:.2f} of {stage.cpu:.2f} s", complaints, ended if ended.begun else None)

    return tried


def full_disk(stage: Stage, row: Row, points: int) -> None:
    """A disk of which so much is free, from nothing to all that is needed."""
    if refusal := mount_refused():
        row.skipped = refusal
        return
    for number in row.numbers(points):
        with stage.folder(number) as (folder, with_earlier):
            free = round((number / points) ** 2 * 1.5 * stage.job.needs) // 4096 * 4096
            with mounted("-t", "tmpfs", "-o", "size=1g", "tmpfs") as disk:
                shutil.copytree(folder, disk / "work")
                found = os.statvfs(disk)
                size = (found.f_blocks - found.f_bfree) * found.f_frsize + free
                subprocess.run(["mount", "-o", f"remount,size={size}", str(disk)], check=True)
                ended = run(stage.job.words, disk / "work")
                complaints = said_well(ended, (2, 0))
                copied(disk / "work", folder)
            complaints += space_is_named(ended)
            complaints += stage.kept(folder, with_earlier)
            complaints += stage.continued(folder, ended)
            row.add(f"with {free // 1024} KiB", complaints)


def file_limit(stage: Stage, row: Row, points: int) -> None:
    """Files that cannot grow beyond a size."""
    for number in row.numbers(points):
        with stage.folder(number) as (folder, with_earlier):
            limit = round(1000 * (stage.job.needs / 1000) ** (number / max(points - 1, 1)))
            ended = run(stage.job.words, folder, limit=limit)
            complaints = said_well(ended, (2, 0)) + space_is_named(ended)
            complaints += stage.kept(folder, with_earlier)
            complaints += stage.continued(folder, ended)
            row.add(f"to {limit} bytes", complaints)


def space_is_named(ended: Ended) -> list[str]:
    """Whether the message of a full disk says what is wrong."""
    words = ("space", "disk is full", "File too large", "make room")
    named = ended.status == 0 or any(word in ended.stderr for word in words)
    return [] if named else [f"does not name the disk: {ended.stderr!r}"]


def two_at_once(stage: Stage, row: Row, points: int) -> None:
    """Second processes on the run folder while the first runs."""
    for count in row.numbers(points):
        with stage.folder(count) as (folder, _):
            rivals: list[tuple[int, Ended]] = []
            words = stage.job.rivals[count % len(stage.job.rivals)]
            compete = partial(rival, words=words, folder=folder, ended=rivals)
            # From when the options have been read and the folder is locked.
            start = stage.job.locked
            at = start + (stage.cpu - start - 0.3) * (count + 0.5) / points
            ended = run(stage.job.words, folder, at=at, disturb=compete)
            complaints = said_well(ended, (0,))
            complaints += same_results(written_results(folder, stage.job), stage.whole)
            if not rivals:
                row.late += not complaints
                if complaints:
                    row.add(f"at {at:.2f} of {stage.cpu:.2f} s, alone", complaints)
                continue
            pid, second = rivals[0]
            complaints += [f"the second: {each}" for each in said_well(second, (2,))]
            if f"process {pid} " not in second.stderr:
                complaints.append(f"the second does not name the first: {second.stderr!r}")
            row.add(f"at {at:.2f} of {stage.cpu:.2f} s", complaints)


def rival(pid: int, *, words: Sequence[str], folder: Path, ended: list[tuple[int, Ended]]) -> None:
    """Run a second process, while the first one stands still and cannot end before it.

    Where the first has given its locks back it has written all, and is about to end.
    """
    os.kill(pid, signal.SIGSTOP)
    try:
        if any(line.split()[4] == str(pid) for line in Path("/proc/locks").read_text().splitlines()):
            ended.append((pid, run(words, folder)))
    finally:
        os.kill(pid, signal.SIGCONT)


def read_only(stage: Stage, row: Row, points: int) -> None:
    """A folder that cannot be written."""
    if refusal := mount_refused():
        row.skipped = refusal
        return
    for number in row.numbers(min(points, 2)):
        with stage.folder(number) as (folder, with_earlier):
            with mounted("--bind", str(folder)) as seen:
                subprocess.run(["mount", "-o", "remount,ro,bind", str(seen)], check=True)
                ended = run(stage.job.words, seen)
            complaints = said_well(ended, (2,))
            complaints += stage.kept(folder, with_earlier)
            complaints += stage.continued(folder, ended)
            row.add("with" if with_earlier else "without", complaints)


def deleted(stage: Stage, row: Row, points: int) -> None:
    """The folder of the run, and that of its journal, removed while it runs."""
    for number in row.numbers(points):
        with stage.folder(number) as (folder, _):
            at = 0.5 + (stage.cpu - 0.8) * (number + 0.5) / points

            def remove(pid: int, folder: Path = folder) -> None:
                for place in folder.glob("*run*"):
                    shutil.rmtree(place, ignore_errors=True)

            ended = run(stage.job.words, folder, at=at, disturb=remove)
            if ended.after is None:
                row.late += 1
                continue
            complaints = said_well(ended, (2, 0))
            copied(stage.fresh, folder)
            again = run(stage.job.words, folder)
            complaints += [f"run again: {each}" for each in said_well(again, (0,))]
            complaints += same_results(written_results(folder, stage.job), stage.whole)
            row.add(f"at {at:.2f} of {stage.cpu:.2f} s", complaints)


@contextlib.contextmanager
def mounted(*what: str) -> Iterator[Path]:
    """A file system, mounted at a new folder."""
    with tempfile.TemporaryDirectory() as place:
        subprocess.run(["mount", *what, place], check=True, capture_output=True)
        try:
            yield Path(place)
        finally:
            subprocess.run(["umount", "-l", place], check=True)


def mount_refused() -> str:
    """Why no file system can be mounted; empty where one can."""
    try:
        with mounted("-t", "tmpfs", "-o", "size=64k", "tmpfs"):
            return ""
    except (OSError, subprocess.CalledProcessError) as reason:
        return f"no file system can be mounted here ({reason})"


WAYS: dict[str, Callable[[Stage, Row, int], None]] = {
    "kill": signalled(signal.SIGKILL, 0.2),
    "SIGINT": signalled(signal.SIGINT, 0.5),
    "SIGTERM": signalled(signal.SIGTERM, 0.8),
    "full disk": full_disk,
    "file limit": file_limit,
    "two at once": two_at_once,
    "read-only": read_only,
    "deleted": deleted,
}


def tried(
    names: Sequence[str], ways: Sequence[str], points: int, *, part: tuple[int, int], stages: Path | None
) -> list[Row]:
    """Try jobs in ways; return the lines of the table."""
    rows = []
    for job in JOBS:
        if job.name not in names:
            continue
        with tempfile.TemporaryDirectory() as place:
            stage = Stage.of(job, Path(stages or place) / job.name)
            print(f"{job.name}: {stage.cpu:.1f} s of CPU undisturbed", flush=True)
            for way in ways:
                began = time.monotonic()
                rows.append(row := Row(job.name, way, part))
                WAYS[way](stage, row, points)
                row.seconds = time.monotonic() - began
                print(row.text, flush=True)
    return rows


def main() -> int:
    """Run, print, and return the exit status."""
    parser = argparse.ArgumentParser(description="End long verbs in every way, and continue them.")
    parser.add_argument(
        "--verb", action="append", choices=[job.name for job in JOBS], help="only this job; repeat"
    )
    parser.add_argument("--way", action="append", choices=list(WAYS), help="only this way; repeat")
    parser.add_argument("--points", type=int, default=20, help="points of each way, default 20")
    parser.add_argument("--quick", action="store_true", help="three points of each way")
    parser.add_argument(
        "--part", default="0/1", metavar="K/N", help="of the points every N-th, from the K-th on"
    )
    parser.add_argument(
        "--stages", type=Path, metavar="DIR", help="keep the folders of the jobs here, and use them again"
    )
    options = parser.parse_args()
    first, _, step = options.part.partition("/")
    # A background job of a shell ignores Ctrl-C, and so would every process that it starts.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    print(HEAD)
    rows = tried(
        options.verb or [job.name for job in JOBS],
        options.way or list(WAYS),
        3 if options.quick else options.points,
        part=(int(first), int(step)),
        stages=options.stages,
    )
    failures = [each for row in rows for each in row.failures]
    print("\n".join(["", HEAD, *(row.text for row in rows), "", *failures]))
    print(f"{sum(row.points for row in rows)} points, {len(failures)} failures")
    return bool(failures)


if __name__ == "__main__":
    sys.exit(main())
