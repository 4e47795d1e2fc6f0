"""The command line of the benchmarks: what they measure, with which options, printed as a table or as JSON.

An option is an argument of the function `bench_` of its subject, and is explained here.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from importlib import import_module
from typing import Any, NoReturn

from mrwork import MrworkError
from studies.speed.workers import silent


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """A module that measures something, and its options: arguments of `bench_` with its name.

    `quick` says what the quick form is, `of_quick` are the arguments that it sets, whatever the options say.
    """

    about: str
    options: Mapping[str, Mapping[str, Any]]
    quick: str
    of_quick: Mapping[str, Any] = field(default_factory=lambda: {"quick": True})


def _number(default: float | None, meaning: str) -> dict[str, Any]:
    kind = float if isinstance(default, float) else int
    return {"type": kind, "default": default, "metavar": "N", "help": meaning}


def _numbers(meaning: str, *default: int) -> dict[str, Any]:
    return {"type": int, "nargs": "+", "default": list(default), "metavar": "N", "help": meaning}


_ONE_AND_TWO = _numbers("numbers of threads, default 1 and 2", 1, 2)
_ONE = _numbers("numbers of threads, one after another, default 1", 1)
_ROUNDS = "repetitions, of which the median counts"

SUBJECTS = {
    "kernels": Subject(
        about="Runge-Kutta steps per second of a batch of Bouc-Wen candidates beside jax and numba",
        options={"threads": _ONE_AND_TWO, "rounds": _number(7, _ROUNDS)},
        quick="one batch of 64, one thread, once",
        of_quick={"batches": (64,), "threads": (1,), "rounds": 1},
    ),
    "models": Subject(
        about="every damper model beside its own twin in jax",
        options={
            "model": {
                "action": "append",
                "default": [],
                "metavar": "NAME",
                "dest": "models",
                "help": "this one only; may be repeated",
            },
            "batch": _number(1024, "candidates side by side"),
            "samples": _number(2000, "samples of the record") | {"dest": "n_time"},
            "threads": _ONE,
            "rounds": _number(7, _ROUNDS),
        },
        quick="batches of 64, 200 samples, once",
        of_quick={"batch": 64, "n_time": 200, "rounds": 1},
    ),
    "identify": Subject(
        about="searches beside those of scipy, cma, pymoo and pyswarms, on numba and on our kernel",
        options={
            "seeds": _number(None, "attempts of each method, default 20, quick 2"),
            "threads": _numbers("numbers of threads, default 1 and all"),
            "budget": _number(
                None, "simulations after which an attempt has failed, default 5000, quick 1000"
            ),
            "all-tests": {
                "action": "store_true",
                "help": "also the default of identify at all five currents",
            },
        },
        quick="a rough look in about a minute",
    ),
    "refine": Subject(
        about="from a start to the minimum: our engines beside SciPy's least squares on numba",
        options={
            "seeds": _number(20, "starts of each job"),
            "threads": _number(0, "threads of ours, 0 for all"),
        },
        quick="one record: some seconds",
    ),
    "posterior": Subject(
        about="effective draws per second beside emcee on jax and numba, and numpyro's NUTS",
        options={
            "steps": _number(2000, "of each ensemble"),
            "walkers": _number(64, "of each ensemble"),
            "nuts-draws": _number(100, "of NUTS, after as many of warm-up; 0 leaves it out"),
            "threads": _ONE,
        },
        quick="the first variant of each peer that comes",
    ),
    "loop": Subject(
        about="closed-loop runs of a building beside numba, jax, solve_ivp and python-control",
        options={
            "candidates": _number(1000, "rows of gains"),
            "motions": _number(4, "ground motions, synthetic"),
            "seconds": _number(30.0, "length of each"),
            "threads": _ONE_AND_TWO,
            "rounds": _number(3, "passes of each contender, of which the median counts"),
        },
        quick="20 candidates, one motion of 5 s, once",
        of_quick={"candidates": 20, "motions": 1, "seconds": 5.0, "rounds": 1},
    ),
    "regulators": Subject(
        about="Riccati gains of many plants beside scipy.linalg.solve_continuous_are",
        options={
            "states": _numbers("states of the plants", 6, 10, 20, 40),
            "threads": _ONE_AND_TWO,
            "rounds": _number(7, _ROUNDS),
        },
        quick="16 equations of each size, one thread, once",
        of_quick={"threads": (1,), "rounds": 1, "batch": 16},
    ),
}


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run a command line and leave the process: status 0 done, 2 bad input, 130 interrupted."""
    options = vars(_parser().parse_args(arguments))
    name, as_json = options.pop("subject"), options.pop("json")
    say = silent if options.pop("quiet") else partial(print, file=sys.stderr)
    if options.pop("quick"):
        options |= SUBJECTS[name].of_quick
    try:
        bench = getattr(import_module(f"studies.speed.{name}"), f"bench_{name}")
        benchmark = bench(**options, say=say)
        print(json.dumps(asdict(benchmark)) if as_json else "\n".join(benchmark.text()))
        status = benchmark.exit_status
    except MrworkError as error:
        print(f"speed: {error}", file=sys.stderr)
        status = 2
    except KeyboardInterrupt:
        print("speed: interrupted", file=sys.stderr)
        status = 130
    sys.exit(status)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="study.py", description="Speed of mrwork beside other libraries, in the same run."
    )
    subjects = parser.add_subparsers(title="subjects", metavar="SUBJECT", dest="subject", required=True)
    for name, subject in SUBJECTS.items():
        own = subjects.add_parser(name, help=subject.about)
        for option, settings in subject.options.items():
            own.add_argument(f"--{option}", **settings)
        own.add_argument("--quick", action="store_true", help=subject.quick)
        own.add_argument("--quiet", action="store_true", help="no progress")
        own.add_argument("--json", action="store_true", help="one JSON object on stdout and nothing else")
    return parser
