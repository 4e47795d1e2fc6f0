"""`mrwork bench`: speed, side by side with the peers."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from functools import partial
from typing import Any

from mrwork.cli.options import add_json


def add_parser(verbs: Any) -> None:
    """Declare the verb and what it can measure."""
    parser = verbs.add_parser("bench", help="measure speed beside jax and numba")
    subjects = parser.add_subparsers(title="subjects", metavar="SUBJECT", required=True)
    kernels = subjects.add_parser(
        "kernels", help="Runge-Kutta steps per second of a batch of Bouc-Wen candidates beside jax and numba"
    )
    _add_common(kernels)
    kernels.set_defaults(run=run_kernels)
    models = subjects.add_parser("models", help="every damper model beside its own twin in jax")
    models.add_argument(
        "--model", action="append", default=[], metavar="NAME", help="this one only; may be repeated"
    )
    models.add_argument("--batch", type=int, default=1024, metavar="N", help="candidates side by side")
    models.add_argument("--samples", type=int, default=2000, metavar="N", help="samples of the record")
    models.add_argument(
        "--threads",
        type=int,
        nargs="+",
        default=[1],
        metavar="N",
        help="numbers of threads, one after another",
    )
    _add_common(models)
    models.set_defaults(run=run_models)


def run_kernels(options: argparse.Namespace) -> int:
    """Measure the kernel of the normalised Bouc-Wen model."""
    from mrwork.bench import bench_kernels, format_table

    benchmark = bench_kernels(rounds=options.rounds, on_progress=_progress(options))
    print(json.dumps(benchmark.as_dict()) if options.json else format_table(benchmark))
    return 0


def run_models(options: argparse.Namespace) -> int:
    """Measure the kernels of all models."""
    from mrwork.bench import bench_models, format_models

    benchmark = bench_models(
        models=options.model,
        batch=options.batch,
        threads=options.threads,
        n_time=options.samples,
        rounds=options.rounds,
        on_progress=_progress(options),
    )
    print(json.dumps(benchmark.as_dict()) if options.json else format_models(benchmark))
    return 0


def _add_common(subject: argparse.ArgumentParser) -> None:
    subject.add_argument(
        "--rounds", type=int, default=7, metavar="N", help="repetitions, of which the median counts"
    )
    subject.add_argument("--quiet", action="store_true", help="no progress")
    add_json(subject)


def _progress(options: argparse.Namespace) -> Callable[[str], None] | None:
    return None if options.quiet else partial(print, file=sys.stderr)
