"""Options that several verbs share."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

from mrwork.cli.command_parser import COMPUTATION, OUTPUT, CommandParser
from mrwork.cli.numbers import SEED, THREADS, add_number, named_path
from mrwork.cli.own_models import add_trust


def add_repeated(
    group: Any, option: str, metavar: str, help: str, *, dest: str | None = None, type: Any = None
) -> None:
    """Declare an option that may be given several times, as its help says."""
    group.add_argument(option, action="append", default=[], metavar=metavar, help=help, dest=dest, type=type)


def add_run(parser: CommandParser) -> None:
    """RUN, the folder of an identification, as `options.run_folder`."""
    parser.add_argument("run_folder", type=named_path, metavar="RUN", help="run folder of mrwork identify")
    parser.add_argument(
        "--changed",
        action="store_true",
        help="also read files of RUN that are not as mrwork has written them",
    )
    add_trust(parser)


def add_threads(parser: CommandParser) -> None:
    """--threads."""
    group = parser.group(COMPUTATION)
    add_number(group, "--threads", THREADS, "number of threads, default 0, all", default=0, metavar="N")


def add_seed(parser: CommandParser, of: str) -> None:
    """--seed, of what `of` names."""
    add_number(parser.group(COMPUTATION), "--seed", SEED, f"seed of {of}, default 0", default=0, metavar="N")


def add_out(parser: CommandParser, what: str) -> None:
    """--out, which `what` describes, and --replace."""
    output = parser.group(OUTPUT)
    output.add_argument("--out", type=named_path, metavar="DIR", help=what)
    output.add_argument(
        "--replace",
        action="store_true",
        help="replace the run in the folder also where it is unfinished or of another verb, where other verbs have "
        "added to it, or where a file has been changed; otherwise it is refused. Files that no verb has written are "
        "kept",
    )


def end_parser(
    parser: CommandParser,
    run: Callable[[argparse.Namespace], int],
    *,
    resume: str = "",
    quiet: str = "no progress line",
) -> None:
    """Declare --resume and --quiet, each where it has a help, and --json; `run` is what the verb does."""
    output = parser.group(OUTPUT)
    for option, help in (("--resume", resume), ("--quiet", quiet)):
        if help:
            output.add_argument(option, action="store_true", help=help)
    output.add_argument(
        "--json", action="store_true", help="print one JSON object on stdout and nothing else"
    )
    parser.set_defaults(run=run)
