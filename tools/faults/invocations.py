"""Odd command lines for every verb: each must end in a result or in one sentence, soon and in little memory.

    python -m tools.faults.invocations [--verb NAME] [--most N] [--seed N] [--seconds S] [--quick]

Options come from the parser. Each is given odd values; files and folders are replaced by pipes, devices, loops of links
and damaged ones; files of a run are removed, cut and forged; options are combined at random. A command line is right
where it ends with 0, 2 or 130; where stderr has printable lines of mrwork, one of them, besides warnings, after
status 2; where stdout is one strict JSON object after `--json`; and where it takes at most 10 s of CPU time and 1 GiB
of memory.

The script prints what is wrong, at the end the counts by verb, and exits with 1 where anything was wrong.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import random
import resource
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from command_line import COMMAND, Ended, mrwork
from study_texts import study_text
from tuning_samples import study_file

from mrwork.cli.door import parser, verbs
from tools.faults.damage import damages
from tools.faults.options import (
    NO_NUMBERS,
    NO_PATHS,
    NO_TEXTS,
    arguments_of,
    is_number,
    options_of,
    written_record,
)

MOST_CPU = 10.0
MOST_MEMORY = 1 << 30
# Wall time, for a hang on a busy machine.
PATIENCE = 120
ADDED = ("profile", "sample", "calibrate", "predict", "report", "plan")
ON_STUDY = ("respond", "tune")
# In the place of a verb: command lines that run in processes of their own.
PROCESSES = "processes"
# A run that does not end at once is none of these tests: sizes are small where an invocation is right.
SMALL = {"--steps": "2", "--walkers": "16", "--generations": "1", "--population": "8"}


class HangError(Exception):
    """A command line that does not end."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Invocation:
    """A command line, what it is a case of, and what is done to the folder before."""

    verb: str
    case: str
    words: tuple[str, ...]
    before: Callable[[Path], None] | None = None


@dataclass(slots=True)
class Count:
    """Counts of a verb."""

    cases: Counter[str] = field(default_factory=Counter)
    statuses: Counter[object] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)
    cpu: float = 0.0
    memory: int = 0


# What is tried


def odd_files(folder: Path) -> list[Path]:
    """Files that are none, in a folder."""
    folder.mkdir(exist_ok=True)
    made = {
        name: folder / name for name in ("empty.csv", "binary.csv", "no_utf8.csv", "nested.json", "nul.toml")
    }
    made["empty.csv"].write_bytes(b"")
    made["binary.csv"].write_bytes(bytes(random.Random(0).randbytes(4096)))
    made["no_utf8.csv"].write_bytes(b"t_s,displacement_mm,force_N\n0,1,\xff\xfe\n")
    made["nested.json"].write_bytes(b"[" * 50_000)
    made["nul.toml"].write_bytes(b'title = "\x00"\n[[[[')
    for name, kind in (
        ("digits.csv", b"9" * 400),
        ("one_line.csv", b"1," * 200_000),
        ("header.csv", b"t_s,force_N\n"),
    ):
        made[name] = folder / name
        made[name].write_bytes(kind)
    os.mkfifo(folder / "pipe.csv")
    (folder / "loop.csv").symlink_to(folder / "loop.csv")
    (folder / "dangling.csv").symlink_to(folder / "nowhere.csv")
    (folder / "forbidden.csv").write_text("t_s,displacement_mm,force_N\n")
    (folder / "forbidden.csv").chmod(0)
    (folder / "folder.csv").mkdir()
    with (folder / "sparse.csv").open("wb") as sparse:
        sparse.truncate(1 << 40)
    with socket.socket(socket.AF_UNIX) as end, contextlib.chdir(folder):
        end.bind("socket.csv")
    for suffix in (".toml", ".mat", ".tdms", ".parquet", ".xlsx", ".lvm", ".npz"):
        (folder / f"binary{suffix}").write_bytes(made["binary.csv"].read_bytes())
    return [
        *sorted(folder.iterdir()),
        *(Path(name) for name in ("/dev/zero", "/dev/null", "/dev/full", "/dev/tty", "/", "/proc/self/mem")),
        *(folder / name for name in ("nowhere", "\udcff", "x" * 300, "\x1b[31m", "a\nb", "\u202e")),
        folder / "nul\0name",
    ]


def odd_studies(folder: Path) -> list[Path]:
    """Studies with a value that no study can have, or sizes that would not fit."""
    texts = [study_text("control_weight = 1e-13"), study_file(folder).read_text()]
    (folder / "study.toml").unlink()
    odd = (
        "1e12",
        "-1",
        "0",
        "nan",
        "inf",
        "1e400",
        '"x"',
        "[]",
        "{}",
        "9" * 30,
        '"\\u001b[31m"',
        "true",
        '"1e12 s"',
    )
    made = []
    for text in texts:
        lines = text.splitlines()
        for number, line in enumerate(lines):
            key, equals, _ = line.partition(" = ")
            if not equals:
                continue
            made += ["\n".join([*lines[:number], f"{key} = {value}", *lines[number + 1 :]]) for value in odd]
        made += [
            f"{text}\n{line}\n"
            for line in ("[building]", "x = 1", '"\\ud800" = 1', "a" * 70_000, "= 2", "[[tune]]")
        ]
    made += [
        f'[building]\nstoreys = {count}\nmass = "1 t"\nstiffness = "1 kN/m"\n\n[[motion]]\nsynthetic = "kanai_tajimi"\n'
        for count in ("1000000000", "-1", "1e9")
    ]
    paths = []
    for number, text in enumerate(made):
        path = folder / f"odd{number}.toml"
        path.write_text(text)
        paths.append(path)
    return paths


def value_for(option: argparse.Action, rng: random.Random, files: Sequence[Path]) -> str:
    """A value of an option, odd more often than not."""
    name = option.option_strings[0]
    if name in SMALL and rng.random() < 0.5:
        return SMALL[name]
    if is_number(option):
        return rng.choice(NO_NUMBERS) if rng.random() < 0.6 else rng.choice(("1", "0.5", "2", "0"))
    if option.choices:
        return rng.choice([*(str(each) for each in option.choices), "none", "x"])
    return str(
        rng.choice([*NO_TEXTS, *map(str, files)] if option.type is None else [*NO_PATHS, *map(str, files)])
    )


def invocations(place: Path, seed: int) -> Iterator[Invocation]:
    """All that is tried, in folders under `place`."""
    rng = random.Random(seed)
    record = written_record(place / "10mm1Hz.csv")
    files = odd_files(place / "odd")
    run = Path("run")
    whole = place / "run"
    studies = odd_studies(place)
    for verb in verbs():
        given = tuple(str(each) for each in arguments_of(verb, record, run, place))
        options = [each for each in options_of(verb) if each.option_strings]
        (commands,) = (
            each for each in parser([verb])._actions if isinstance(each, argparse._SubParsersAction)
        )
        flags = [each.option_strings[0] for each in commands.choices[verb]._actions if each.nargs == 0]
        flags = [each for each in flags if each != "-h"]
        quiet = ("--quiet",) if "--quiet" in flags else ()
        yield Invocation(verb=verb, case="missing", words=(verb,))
        yield Invocation(verb=verb, case="missing", words=(verb, "--no-such-option"))
        yield Invocation(verb=verb, case="help", words=(verb, "--help"))
        for option in options:
            name = option.option_strings[0]
            yield Invocation(verb=verb, case="missing", words=(verb, *given, name))
            odd = rng.sample(NO_NUMBERS, 6) if is_number(option) else rng.sample(NO_TEXTS, 6)
            for value in odd:
                yield Invocation(verb=verb, case="odd value", words=(verb, *given, *quiet, f"{name}={value}"))
            twice = [f"{name}={value_for(option, rng, files)}" for _ in range(2)]
            yield Invocation(verb=verb, case="repeated", words=(verb, *given, *quiet, *twice))
            if option.type is Path or (option.type is None and not option.choices):
                for path in rng.sample(files, 6):
                    words = (verb, *given, *quiet, f"{name}={path}")
                    yield Invocation(verb=verb, case="odd file", words=words)
        for path in files:
            first = (str(path),)
            if verb in ADDED:
                yield Invocation(verb=verb, case="odd file", words=(verb, *first))
            if verb in ("calibrate", "predict"):
                first = (str(run), str(path))
            elif verb == "convert":
                first = ("spencer", "--to", "normalised", str(path))
            yield Invocation(verb=verb, case="odd file", words=(verb, *first))
        for count in range(12):
            drawn = rng.sample(options, min(len(options), rng.randint(1, 4)))
            words = [f"{each.option_strings[0]}={value_for(each, rng, files)}" for each in drawn]
            words += rng.sample(flags, min(len(flags), rng.randint(0, 2)))
            if count % 2 and "--json" in flags:
                words.append("--json")
            words = [word for word in words if word not in ("--help", "--version")]
            yield Invocation(verb=verb, case="combined", words=(verb, *given, *words))
        if verb in ADDED:
            more = (str(record),) if verb in ("calibrate", "predict") else ()
            more = ("--steps", "2") if verb == "sample" else more
            for _, damage in rng.sample(damages(whole), 16):
                yield Invocation(
                    verb=verb, case="damaged run", words=(verb, "run", *more, "--json"), before=damage
                )
        if verb in ON_STUDY:
            for path in rng.sample(studies, 60):
                yield Invocation(
                    verb=verb,
                    case="odd study",
                    words=(verb, str(path), "--quiet", "--threads", "1", "--out", str(place / "studied")),
                )
    yield from sizes(place, record)


def sizes(place: Path, record: Path) -> Iterator[Invocation]:
    """Sizes that would not fit."""
    many = ",".join(str(0.0001 + 1e-6 * number) for number in range(150))
    table = place / "candidates.csv"
    table.write_text(
        "amplitude,frequency\n" + "\n".join(f"{1e-6 * n},{1.0}" for n in range(1, 20_001)) + "\n"
    )
    yield Invocation(
        verb="plan", case="size", words=("plan", "run", f"--amplitudes={many}", f"--frequencies={many}")
    )
    yield Invocation(verb="plan", case="size", words=("plan", "run", f"--candidates={table}"))
    for values in (("--walkers", "10000", "--steps", "10000000"), ("--walkers", "10000", "--resume")):
        yield Invocation(verb="sample", case="size", words=("sample", "run", *values))
    for name in (
        ["9" * 5000],
        ["--from", "1e9", "--until", "-1e9"],
        ["--every", "1000000"],
        ["--settle", "1e6"],
    ):
        yield Invocation(verb="check", case="size", words=("check", str(record), *name))
        yield Invocation(
            verb="identify", case="size", words=("identify", str(record), *name, "--out", str(place / "n"))
        )


# How it ends


def tried(invocation: Invocation, place: Path, whole: Path, count: Count) -> list[str]:
    """What is wrong with the end of a command line, in this process."""
    run = place / "run"
    shutil.rmtree(run, ignore_errors=True)
    shutil.copytree(whole, run)
    if invocation.before is not None:
        invocation.before(run)
    before, peak = cpu(), reset_peak()
    signal.alarm(PATIENCE)
    try:
        ended = mrwork(*invocation.words)
    except HangError:
        return ["it does not end"]
    except BaseException:
        return [f"a traceback: {traceback.format_exc()[-600:]}"]
    finally:
        signal.alarm(0)
    spent, memory = cpu() - before, peak_memory() - peak
    count.cpu, count.memory = max(count.cpu, spent), max(count.memory, memory)
    count.statuses[ended.returncode] += 1
    wrong = misprinted(ended, as_json="--json" in invocation.words and "--help" not in invocation.words)
    if spent > MOST_CPU:
        wrong.append(f"{spent:.1f} s of CPU time")
    if memory > MOST_MEMORY:
        wrong.append(f"{memory / 2**20:.0f} MiB of memory")
    return wrong


def misprinted(ended: Ended, *, as_json: bool) -> list[str]:
    """What is wrong with the status and what was printed."""
    wrong = []
    if ended.returncode not in (0, 2, 130):
        wrong.append(f"exit status {ended.returncode}")
    lines = ended.stderr.splitlines()
    said = [line for line in lines if not line.startswith("mrwork: warning: ")]
    if ended.returncode == 2 and len(said) != 1:
        wrong.append(f"{len(said)} sentences on stderr: {ended.stderr[-300:]!r}")
    if not all(line.isprintable() and line.startswith("mrwork") for line in ended.stderr.split("\n")[:-1]):
        wrong.append(f"stderr is {ended.stderr[-300:]!r}")
    if "Traceback" in ended.stderr + ended.stdout:
        wrong.append("a traceback")
    if not all(line.isprintable() for line in ended.stdout.split("\n")):
        wrong.append("stdout has characters that are not printable")
    # `check` describes the files that it cannot read, too.
    if as_json and ended.stdout:
        try:
            json.loads(ended.stdout, parse_constant=_no_number)
        except ValueError as reason:
            wrong.append(f"stdout is no strict JSON ({reason}): {ended.stdout[:100]!r}")
    return wrong


def _no_number(word: str) -> float:
    raise ValueError(f"it has {word}")


def cpu() -> float:
    """CPU seconds of this process and its children."""
    own, children = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
    return own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime


def reset_peak() -> int:
    """Begin to measure the peak of memory; return what is in use [bytes]."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
    return peak_memory()


def peak_memory() -> int:
    """Largest memory of this process since then [bytes]."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return 1024 * int(line.split()[1])
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


# In processes of their own


def in_processes(place: Path, whole: Path) -> Iterator[tuple[str, list[str]]]:
    """Command lines in odd surroundings, with what is wrong with each."""
    # Warnings of numbers, which the command line does not show otherwise, are to be found here.
    path = os.pathsep.join(path for path in sys.path if path)
    plain = os.environ | {"PYTHONPATH": path, "PYTHONWARNINGS": "always::RuntimeWarning"}
    gone = place / "gone"
    surroundings: list[tuple[str, dict[str, str], str]] = [
        ("ASCII", {"PYTHONIOENCODING": "ascii:strict"}, ""),
        ("no locale", {"LC_ALL": "C", "LANG": "", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}, ""),
        ("a narrow terminal", {"COLUMNS": "1", "LINES": "0", "TERM": "\x1b"}, ""),
        ("a width that is none", {"COLUMNS": "x" * 1000}, ""),
        ("no home", {"HOME": "/nonexistent", "TMPDIR": "/nonexistent", "MPLCONFIGDIR": "/nonexistent"}, ""),
        ("a folder that is gone", {}, f"mkdir -p {gone}; cd {gone}; rmdir {gone}; "),
        ("no stdin", {}, "exec 0<&-; "),
        ("few files", {}, "ulimit -n 16; "),
        ("an instruction set that is none", {"MRWORK_INSTRUCTION_SET": "x"}, ""),
    ]
    lines = [
        "models",
        "models bingham --json",
        "check synthetic:rd1005_1a",
        f"predict {whole} synthetic:rd1005_1a --json",
        "check $'\\xff\\xfe.csv'",
        f"respond {place}/none.toml",
    ]
    for name, changes, prefix in surroundings:
        for line in lines:
            ended = subprocess.run(
                ["bash", "-c", f'{prefix}"$@" {line}', "bash", *COMMAND],
                capture_output=True,
                env={**plain, **changes},
                check=False,
                timeout=PATIENCE,
                cwd=place,
            )
            wrong = misprinted(
                Ended(
                    returncode=ended.returncode,
                    stdout=ended.stdout.decode(errors="replace"),
                    stderr=ended.stderr.decode(errors="replace"),
                ),
                as_json="--json" in line,
            )
            yield f"{name}: mrwork {line}", wrong


# The script


def hang(number: int, frame: object) -> None:
    """End what does not end by itself."""
    raise HangError


def all_tried(
    names: Sequence[str], most: int, seed: int, *, full: bool = True, seconds: float = math.inf
) -> dict[str, Count]:
    """Try at most so many command lines of some verbs; return the counts by verb.

    In `full`, the run has what later verbs add. After `seconds`, no more are tried.
    """
    counts = {verb: Count() for verb in names}
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        place = Path(name)
        record = written_record(place / "10mm1Hz.csv")
        whole = place / "whole"
        words: list[tuple[object, ...]] = [
            ("identify", record, "--model", "static_hysteretic", "--out", whole),
            *(
                ("profile", whole),
                ("calibrate", whole, "synthetic:rd1005_1a"),
                ("sample", whole, "--steps", "2"),
            ),
        ]
        for each in words if full else words[:1]:
            made = mrwork(*each, "--quiet")
            if made.returncode != 0:
                raise RuntimeError(made.stderr)
        shutil.copytree(whole, place / "run")
        give_up = time.monotonic() + seconds
        of_verb: dict[str, list[Invocation]] = {verb: [] for verb in names if verb != PROCESSES}
        for invocation in invocations(place, seed):
            of_verb.get(invocation.verb, []).append(invocation)
        before = signal.signal(signal.SIGALRM, hang)
        rng = random.Random(seed)
        for verb, found in of_verb.items():
            count = counts[verb]
            for invocation in found if len(found) <= most else rng.sample(found, most):
                if time.monotonic() > give_up:
                    break
                count.cases[invocation.case] += 1
                wrong = tried(invocation, place, whole, count)
                if wrong:
                    said = f"mrwork {shlex.join(invocation.words)[:300]!r} ({invocation.case}): {'; '.join(wrong)}"
                    count.wrong.append(said)
                    print(f"  WRONG {said}", flush=True)
                if count.cases.total() % 50 == 0:
                    print(f"{verb}: {count.cases.total()} of {len(found)} tried", flush=True)
        signal.signal(signal.SIGALRM, before)
        count = counts.get(PROCESSES, Count())
        for line, wrong in in_processes(place, whole) if PROCESSES in counts else ():
            count.cases["surroundings"] += 1
            if wrong:
                count.wrong.append(f"{line!r}: {'; '.join(wrong)}")
                print(f"  WRONG {count.wrong[-1]}", flush=True)
            if time.monotonic() > give_up:
                break
    return counts


def table(counts: dict[str, Count]) -> str:
    """The counts, a line a verb."""
    cases = sorted({case for count in counts.values() for case in count.cases})
    head = f"{'':10} {'all':>6} {'wrong':>6} {'exit 0':>7} {'exit 2':>7} {'CPU [s]':>8} {'MiB':>6}  by case"
    lines = [head]
    for verb, count in counts.items():
        by_case = ", ".join(f"{case} {count.cases[case]}" for case in cases if count.cases[case])
        lines.append(
            f"{verb:10} {count.cases.total():6} {len(count.wrong):6} {count.statuses[0]:7} {count.statuses[2]:7} "
            f"{count.cpu:8.1f} {count.memory / 2**20:6.0f}  {by_case}"
        )
    total = sum(count.cases.total() for count in counts.values())
    return "\n".join(
        [*lines, f"{total} command lines, {sum(len(count.wrong) for count in counts.values())} wrong"]
    )


def main() -> int:
    """Run, print, and return the exit status."""
    options = argparse.ArgumentParser(description="Try odd command lines.")
    options.add_argument(
        "--verb", action="append", choices=[*verbs(), PROCESSES], help="only this verb; repeat for more"
    )
    options.add_argument("--most", type=int, default=1_000_000, help="at most so many of each verb")
    options.add_argument("--seed", type=int, default=0, help="seed of what is combined, default 0")
    options.add_argument(
        "--seconds", type=float, default=math.inf, help="begin no more after so many seconds"
    )
    options.add_argument(
        "--quick", action="store_true", help="at most 20 of each verb, none in a process of its own"
    )
    given = options.parse_args()
    began = time.monotonic()
    most = 20 if given.quick else given.most
    names = given.verb or [*verbs(), *([] if given.quick else [PROCESSES])]
    full = not given.quick and any(name in ADDED for name in names)
    counts = all_tried(names, most, given.seed, full=full, seconds=given.seconds)
    print(table(counts))
    print(f"{time.monotonic() - began:.0f} s")
    return any(count.wrong for count in counts.values())


if __name__ == "__main__":
    sys.exit(main())
