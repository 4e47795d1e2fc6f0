"""Options that several verbs share; and the workers that they name."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from mrwork.base.arguments import Threads
from mrwork.cli.command_parser import COMPUTATION, OUTPUT, CommandParser
from mrwork.cli.derived import add_option_of
from mrwork.cli.number_texts import THREADS, named_path
from mrwork.cli.terminal import note
from mrwork.errors import SettingError
from mrwork.study.run_options import StudySeed


def add_run(parser: CommandParser) -> None:
    """RUN, the folder of an identification, as `options.run_folder`."""
    parser.add_argument("run_folder", type=named_path, metavar="RUN", help="run folder of mrwork identify")
    changed = "also read files of RUN that are not as mrwork has written them"
    parser.add_argument("--changed", action="store_true", help=changed)


def add_threads(parser: CommandParser, workers: str = "") -> None:
    """--threads; and --workers and --cluster, where `workers` says what they do."""
    add_option_of(parser, Threads, COMPUTATION, "threads", default=0, metavar="N")
    if not workers:
        return
    parser.option(
        COMPUTATION,
        "--workers",
        f"processes of this machine that do {workers}, on one thread each, default 0: this process does all; the "
        "results are the same",
        THREADS,
        default=0,
        metavar="N",
    )
    parser.option(
        COMPUTATION,
        "--cluster",
        "the same by the workers of a Dask scheduler: its address, as in tcp://HOST:8786, or its scheduler file; needs "
        "the extra cluster",
        metavar="ADDRESS",
    )


def add_seed(parser: CommandParser, also: str = "") -> None:
    """--seed of a study, and of what else it is."""
    add_option_of(parser, StudySeed, COMPUTATION, "seed", default=0, more=also)


def end_parser(
    parser: CommandParser,
    run: Callable[[argparse.Namespace], int],
    *,
    out: str = "",
    resume: str = "",
    quiet: str = "no progress line",
) -> None:
    """Declare --out with --replace, --resume and --quiet, each where it has a help, and --json; `run` is the verb."""
    if out:
        parser.option(OUTPUT, "--out", out, named_path, metavar="DIR")
    replace = (
        "replace the run in the folder also where it is unfinished or of another verb, where other verbs have added to "
        "it, or where a file has been changed; otherwise it is refused. Files that no verb has written are kept"
    )
    json = "print one JSON object on stdout and nothing else"
    flags = {"--replace": out and replace, "--resume": resume, "--quiet": quiet, "--json": json}
    for option, help in flags.items():
        if help:
            parser.option(OUTPUT, option, help, bool)
    parser.set_defaults(run=run, parser=parser)


@contextmanager
def on_workers(options: argparse.Namespace, *, needless: str = "") -> Iterator[None]:
    """Let the workers of the command line do runs and fits in the block; `needless` says why they cannot help."""
    if not options.workers and options.cluster is None:
        yield
        return
    if options.workers and options.cluster is not None:
        raise SettingError("--workers and --cluster both say who works; give one of them")
    if needless:
        note(f"{'--workers' if options.workers else '--cluster'} has no effect: {needless}")
        yield
        return
    from mrwork.workers.cluster import cluster_workers
    from mrwork.workers.engine import working_on
    from mrwork.workers.local import local_workers

    there = local_workers(options.workers) if options.workers else cluster_workers(options.cluster)
    with there as executor, working_on(executor):
        yield
