"""Gradients of the kernel for libraries of JAX: what a call costs, and what samplers and optimisers make of it.

python studies/gradients/study.py [calls] [samplers] [fits] [hang] [loops] [--quick] [--json]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import os
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from tempfile import TemporaryDirectory
from typing import Any

from mrwork.report import Table
from studies.former.command import Command, Findings, Say
from studies.former.processor import processor
from studies.former.workers import cores_for, rows_of
from studies.gradients import calls, fits, hang, loops, samplers

_PEERS = ("blackjax", "diffrax", "numpyro", "optax")


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A part of the study: its job with the settings of the whole and of the quick form, its cores, and its tables.

    `judged` are the figures that expected.toml has.
    """

    job: Callable[..., Iterator[Any]]
    whole: dict[str, Any]
    quick: dict[str, Any]
    tables: Callable[[Sequence[Any]], Iterable[Table]]
    cores: int = 1
    judged: Callable[[Sequence[Any]], dict[str, Any]] = lambda rows: {}

    def rows(self, say: Say, *, quick: bool) -> list[Any]:
        """What its job found in a process of its own, on its cores."""
        return list(rows_of(self.job, _cores(self.cores), self.quick if quick else self.whole, say))


PARTS = {
    "calls": Part(
        job=calls.measure,
        whole={"models": calls.MODELS, "lengths": (2000, 10_000), "batches": (1, 8, 256), "rounds": 9},
        quick={"models": calls.MODELS[:1], "lengths": (100,), "batches": (2,), "rounds": 1},
        tables=calls.tables,
    ),
    "samplers": Part(
        job=samplers.measure,
        whole={
            "model": "normalised_bouc_wen",
            "n_time": 500,
            "libraries": ("numpyro", "blackjax"),
            "in_lanes": True,
            "steps": 300,
            "chains": 4,
            "twin_steps": 200,
            "walker_steps": 20_000,
        },
        quick={
            "model": "bingham",
            "n_time": 120,
            "libraries": ("numpyro",),
            "in_lanes": False,
            "steps": 10,
            "chains": 2,
            "twin_steps": 0,
            "walker_steps": 40,
        },
        tables=samplers.tables,
        judged=lambda rows: {"means_apart": max(row.z for row in rows)},
    ),
    "fits": Part(
        job=fits.measure,
        whole={"n_time": 1000, "adam_steps": 500, "starts": 7, "engines": ()},
        quick={
            "n_time": 120,
            "adam_steps": 5,
            "starts": 1,
            "engines": (
                "optimistix LM on mr.jax",
                "SciPy trf on mr.objective",
                "optax Adam on mr.jax",
            ),
        },
        tables=fits.tables,
    ),
    "hang": Part(
        job=hang.measure,
        whole={"n_time": 200, "calls": 100_000, "callers": 8, "busy": 4, "patience": 60.0},
        quick={"n_time": 60, "calls": 200, "callers": 8, "busy": 1, "patience": 60.0},
        tables=hang.tables,
        cores=2,
        judged=hang.judged,
    ),
    "loops": Part(
        job=loops.measure,
        whole={"cases": loops.CASES, "motions": 12, "duration": 20.0, "rounds": 5},
        quick={"cases": loops.CASES[:1], "motions": 1, "duration": 0.5, "rounds": 1},
        tables=loops.tables,
        cores=2,
        judged=loops.judged,
    ),
}


def _cores(wanted: int) -> list[int]:
    """As many cores, or all that there are."""
    return cores_for([1])[:wanted]


def _cache_rows(n_time: int, say: Say) -> list[hang.CacheRow]:
    with TemporaryDirectory() as folder:
        return [
            row
            for process in ("first", "second")
            for row in rows_of(
                hang.cached, _cores(1), {"n_time": n_time, "folder": folder, "process": process}, say
            )
        ]


def find(options: Namespace, say: Say) -> Findings:
    # A program that another run has left would not be compiled here.
    os.environ["MRWORK_COMPILATION_CACHE"] = "off"
    numbers: dict[str, Any] = {"processor": processor(), "load": os.getloadavg()[0]}
    judged: dict[str, Any] = {}
    text: list[str | Table] = [
        f"Processor: {numbers['processor']}; load {numbers['load']:.1f} when it began."
    ]
    for name in PARTS if "all" in options.parts else options.parts:
        part = PARTS[name]
        say(name)
        rows = part.rows(say, quick=options.quick)
        if name == "hang":
            rows += _cache_rows(part.quick["n_time"], say)
        numbers[name] = [asdict(row) for row in rows]
        judged[name] = part.judged(rows)
        text += part.tables(rows)
    missing = [name for name in _PEERS if find_spec(name) is None]
    lacking = f"not installed: {', '.join(missing)}; pip install 'mrwork[bench,nuts]'" if missing else ""
    return Findings(
        numbers=numbers,
        text=text,
        judged={} if options.quick else judged,
        remark=lacking,
        agreement="" if options.quick else "Every figure agrees with expected.toml.",
    )


if __name__ == "__main__":
    command = Command(__file__, __doc__, quick="the smallest form of each part, whose times mean nothing")
    command.parser.add_argument(
        "parts", nargs="*", choices=["all", *PARTS], default="all", help="all by default"
    )
    sys.exit(command.run(find))
