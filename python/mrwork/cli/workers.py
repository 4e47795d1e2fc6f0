"""Options of the verbs whose runs or fits other processes and machines can do."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager

from mrwork.cli.command_parser import COMPUTATION, CommandParser
from mrwork.cli.numbers import THREADS, add_number
from mrwork.cli.terminal import note
from mrwork.errors import SettingError


def add_workers(parser: CommandParser, what: str) -> None:
    """--workers and --cluster, which do `what`."""
    group = parser.group(COMPUTATION)
    add_number(
        group,
        "--workers",
        THREADS,
        f"processes of this machine that do {what}, on one thread each, default 0: this process does all; the results "
        "are the same",
        default=0,
        metavar="N",
    )
    group.add_argument(
        "--cluster",
        metavar="ADDRESS",
        help="the same by the workers of a Dask scheduler: its address, as in tcp://HOST:8786, or its scheduler file; "
        "needs the extra cluster",
    )


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
    # Pools and hashes are slow to load.
    from mrwork.workers.cluster import cluster_workers
    from mrwork.workers.engine import working_on
    from mrwork.workers.local import local_workers

    there = local_workers(options.workers) if options.workers else cluster_workers(options.cluster)
    with there as executor, working_on(executor):
        yield
