"""The command of a study: the options that studies share, what is printed, and the exit status."""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, Protocol

from studies.former.expected import departures
from studies.former.records import ROOT, ground_motions

Say = Callable[[str], None]
"""Tells a person what is worked out now."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """How a study works: in its quick form or whole, on how many threads (0 for all), and who is told.

    `records` is the folder of the ground motions, `None` where there is none.
    """

    quick: bool = False
    threads: int = 0
    say: Say = lambda what: None
    records: Path | None = None

    @classmethod
    def of(cls, options: argparse.Namespace, say: Say) -> Work:
        """That of a command with the option `quick`, and perhaps `threads`."""
        records = ground_motions() if ground_motions().is_dir() else None
        threads = getattr(options, "threads", 0)
        return cls(quick=options.quick, threads=threads, say=say, records=records)


class Shown(Protocol):
    """What a study prints beside plain lines."""

    def markdown(self) -> str:
        """The text."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """What a study found.

    numbers
        Printed with `--json`.
    text
        Printed without it: tables, and lines.
    judged
        Compared with `expected.toml` where that is not all `numbers`.
    remark
        Printed after the text.
    agreement
        Printed where no figure is outside its limits.
    """

    numbers: Mapping[str, Any]
    text: Iterable[str | Shown]
    judged: Mapping[str, Any] | None = None
    remark: str = ""
    agreement: str = "Every figure agrees with expected.toml."


def run_chapter(
    file: str,
    about: str | None,
    *,
    quick: str,
    chapter_of: Callable[[Work], Any],
    write_page: Callable[[Any, Path], None],
    tables: Callable[[dict[str, Any]], Mapping[str, Iterable[Shown]]],
) -> int:
    """Run the command of a chapter that has a quick form; the page is that of the whole form."""

    def find(options: argparse.Namespace, say: Say) -> Findings:
        chapter = chapter_of(Work.of(options, say))
        if not options.quick:
            write_page(chapter, options.out / "report.html")
        text = chain(*tables(chapter.found).values())
        return Findings(numbers=chapter.found, text=text, remark=chapter.found.get("skipped", ""))

    return Command(file, about, quick=quick, threads=True, out=True).run(find)


class Command:
    """The command line of the study whose script is `file`; its `parser` takes more options.

    Parameters
    ----------
    quick
        What the quick form leaves out, if there is one.
    threads, workers, out
        Whether the study has these options; `workers` are for `mr.on_workers`.
    seed
        Default and meaning of the seed, if there is one.
    """

    def __init__(
        self,
        file: str,
        about: str | None,
        *,
        quick: str = "",
        threads: bool = False,
        workers: bool = False,
        out: bool = False,
        seed: tuple[int, str] | None = None,
    ) -> None:
        self.folder = Path(file).parent
        self.parser = argparse.ArgumentParser(
            description=about, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        add = self.parser.add_argument
        add("--json", action="store_true", help="one JSON object on stdout and nothing else")
        if quick:
            add("--quick", action="store_true", help=quick)
        if threads:
            add("--threads", type=int, default=0, help="threads of the simulations, 0 for all")
        if workers:
            add(
                "--workers",
                type=int,
                default=0,
                metavar="N",
                help="processes of this machine that do the work",
            )
            meaning = "the same by a Dask scheduler, whose workers have this folder in PYTHONPATH"
            add("--cluster", metavar="ADDRESS", help=meaning)
        if out:
            add("--out", type=Path, default=ROOT / "out" / self.folder.name, help="where the page goes")
        if seed is not None:
            add("--seed", type=int, default=seed[0], help=seed[1])

    def run(self, find: Callable[[argparse.Namespace, Say], Findings | int]) -> int:
        """Print what is found and return 0, or 1 where a figure is outside its limits; a status is passed on."""
        began = time.perf_counter()

        def say(what: str) -> None:
            print(f"{time.perf_counter() - began:6.0f} s  {what}", file=sys.stderr, flush=True)

        options = self.parser.parse_args()
        found = find(options, say)
        if isinstance(found, int):
            return found
        judged = found.numbers if found.judged is None else found.judged
        wrong = departures(judged, self.folder / "expected.toml") if judged else []
        if options.json:
            print(json.dumps(_finite({**found.numbers, "departures": wrong})))
        else:
            for each in found.text:
                print(each if isinstance(each, str) else each.markdown())
            print("\n".join([*filter(None, [found.remark]), *(wrong or [found.agreement])]))
        return 1 if wrong else 0


def _finite(value: Any) -> Any:
    """The same with null for what is not a finite number, as JSON has it."""
    if isinstance(value, Mapping):
        return {name: _finite(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def levels_command(
    file: str, about: str | None, levels: Iterable[str], *, quick: str, clairvoyants: int, resume: str
) -> Command:
    """The command of a study of laws at levels of the motions, with a clairvoyant under some of its test motions."""
    command = Command(file, about, quick=quick, threads=True, workers=True)
    add = command.parser.add_argument
    add("--level", action="append", choices=list(levels), help="one level of the motions; repeat for more")
    meaning = "test motions with a clairvoyant, minutes each; 0 for none"
    add("--clairvoyants", type=int, default=clairvoyants, help=meaning)
    add("--resume", action="store_true", help=resume)
    return command
