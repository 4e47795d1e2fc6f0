"""`mrwork bench`: speed, side by side with the peers."""

from __future__ import annotations

import argparse
import json
import sys
from typing import Any

from mrwork.cli.options import add_json


def add_parser(verbs: Any) -> None:
    """Declare the verb and what it can measure."""
    parser = verbs.add_parser("bench", help="measure speed beside jax and numba")
    subjects = parser.add_subparsers(title="subjects", metavar="SUBJECT", required=True)
    kernels = subjects.add_parser(
        "kernels", help="Runge-Kutta steps per second of a batch of Bouc-Wen candidates"
    )
    kernels.add_argument(
        "--rounds", type=int, default=7, metavar="N", help="repetitions, of which the median counts"
    )
    kernels.add_argument("--quiet", action="store_true", help="no progress")
    add_json(kernels)
    kernels.set_defaults(run=run_kernels)


def run_kernels(options: argparse.Namespace) -> int:
    """Measure the simulation kernels."""
    from mrwork.bench import bench_kernels, format_table

    def progress(line: str) -> None:
        if not options.quiet:
            print(line, file=sys.stderr)

    benchmark = bench_kernels(rounds=options.rounds, on_progress=progress)
    print(json.dumps(benchmark.as_dict()) if options.json else format_table(benchmark))
    return 0
