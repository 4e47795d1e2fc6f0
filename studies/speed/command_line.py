"""The command line of the benchmarks: what they measure, with which options, printed as a table or as JSON."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import NoReturn

from mrwork import MrworkError


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run a command line and leave the process: status 0 done, 2 bad input, 130 interrupted."""
    options = _parser().parse_args(arguments)
    try:
        status = int(options.run(options))
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
    subjects = parser.add_subparsers(title="subjects", metavar="SUBJECT", required=True)
    kernels = subjects.add_parser(
        "kernels", help="Runge-Kutta steps per second of a batch of Bouc-Wen candidates beside jax and numba"
    )
    kernels.add_argument(
        "--threads",
        type=int,
        nargs="+",
        default=[1, 2],
        metavar="N",
        help="numbers of threads, default 1 and 2",
    )
    kernels.add_argument("--quick", action="store_true", help="one batch of 64, one thread, once")
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
    models.add_argument("--quick", action="store_true", help="batches of 64, 200 samples, once")
    _add_common(models)
    models.set_defaults(run=run_models)
    searches = subjects.add_parser(
        "identify", help="searches beside those of scipy, cma, pymoo and pyswarms, on numba and on our kernel"
    )
    searches.add_argument(
        "--seeds", type=int, default=None, metavar="N", help="attempts of each method, default 20, quick 2"
    )
    searches.add_argument(
        "--threads",
        type=int,
        nargs="+",
        default=[],
        metavar="N",
        help="numbers of threads, default 1 and all",
    )
    searches.add_argument(
        "--budget",
        type=int,
        default=None,
        metavar="N",
        help="simulations after which an attempt has failed, default 5000, quick 1000",
    )
    searches.add_argument("--quick", action="store_true", help="a rough look in about a minute")
    searches.add_argument(
        "--all-tests", action="store_true", help="also the default of identify at all five currents"
    )
    searches.add_argument("--quiet", action="store_true", help="no progress")
    _add_json(searches)
    searches.set_defaults(run=run_identify)
    posterior = subjects.add_parser(
        "posterior", help="effective draws per second beside emcee on jax and numba, and numpyro's NUTS"
    )
    posterior.add_argument("--steps", type=int, default=2000, metavar="N", help="of each ensemble")
    posterior.add_argument("--walkers", type=int, default=64, metavar="N", help="of each ensemble")
    posterior.add_argument(
        "--nuts-draws",
        type=int,
        default=100,
        metavar="N",
        help="of NUTS, after as many of warm-up; 0 leaves it out",
    )
    posterior.add_argument(
        "--threads", type=int, nargs="+", default=[1], metavar="N", help="numbers of threads, default 1"
    )
    posterior.add_argument("--quick", action="store_true", help="the first variant of each peer that comes")
    posterior.add_argument("--quiet", action="store_true", help="no progress")
    _add_json(posterior)
    posterior.set_defaults(run=run_posterior)
    refinements = subjects.add_parser(
        "refine", help="from a start to the minimum: our engines beside SciPy's least squares on numba"
    )
    refinements.add_argument("--seeds", type=int, default=20, metavar="N", help="starts of each job")
    refinements.add_argument("--threads", type=int, default=0, metavar="N", help="threads of ours, 0 for all")
    refinements.add_argument("--quick", action="store_true", help="one record, no twin: some seconds")
    refinements.add_argument("--quiet", action="store_true", help="no progress")
    _add_json(refinements)
    refinements.set_defaults(run=run_refine)
    loop = subjects.add_parser(
        "loop", help="closed-loop runs of a building beside numba, jax, solve_ivp and python-control"
    )
    loop.add_argument("--candidates", type=int, default=1000, metavar="N", help="rows of gains")
    loop.add_argument("--motions", type=int, default=4, metavar="N", help="ground motions, synthetic")
    loop.add_argument("--seconds", type=float, default=30.0, metavar="S", help="length of each")
    loop.add_argument(
        "--threads",
        type=int,
        nargs="+",
        default=[1, 2],
        metavar="N",
        help="numbers of threads, default 1 and 2",
    )
    loop.add_argument(
        "--rounds",
        type=int,
        default=3,
        metavar="N",
        help="passes of each contender, of which the median counts",
    )
    loop.add_argument("--quiet", action="store_true", help="no progress")
    loop.add_argument("--quick", action="store_true", help="20 candidates, one motion of 5 s, once")
    _add_json(loop)
    loop.set_defaults(run=run_loop)
    regulators = subjects.add_parser(
        "regulators", help="Riccati gains of many plants beside scipy.linalg.solve_continuous_are"
    )
    regulators.add_argument(
        "--states", type=int, nargs="+", default=[6, 10, 20, 40], metavar="N", help="states of the plants"
    )
    regulators.add_argument(
        "--threads",
        type=int,
        nargs="+",
        default=[1, 2],
        metavar="N",
        help="numbers of threads, default 1 and 2",
    )
    regulators.add_argument(
        "--quick", action="store_true", help="16 equations of each size, one thread, once"
    )
    _add_common(regulators)
    regulators.set_defaults(run=run_regulators)
    return parser


def run_kernels(options: argparse.Namespace) -> int:
    """Measure the kernel of the normalised Bouc-Wen model."""
    from studies.speed.kernels import bench_kernels, format_table

    benchmark = bench_kernels(
        batches=(64,) if options.quick else (64, 1024),
        threads=(1,) if options.quick else tuple(options.threads),
        rounds=1 if options.quick else options.rounds,
        on_progress=_progress(options),
    )
    print(json.dumps(benchmark.as_dict()) if options.json else format_table(benchmark))
    return 0


def run_models(options: argparse.Namespace) -> int:
    """Measure the kernels of all models."""
    from studies.speed.models import bench_models, format_models

    benchmark = bench_models(
        models=options.model,
        batch=64 if options.quick else options.batch,
        threads=options.threads,
        n_time=200 if options.quick else options.samples,
        rounds=1 if options.quick else options.rounds,
        on_progress=_progress(options),
    )
    print(json.dumps(benchmark.as_dict()) if options.json else format_models(benchmark))
    return 0


def run_identify(options: argparse.Namespace) -> int:
    """Measure how soon searches come near the best known fit; after Ctrl-C, say what was measured until then."""
    from studies.speed.identify import bench_identify, format_identify

    benchmark = bench_identify(
        seeds=(2 if options.quick else 20) if options.seeds is None else options.seeds,
        threads=tuple(options.threads),
        budget=(1000 if options.quick else 5000) if options.budget is None else options.budget,
        quick=options.quick,
        all_tests=options.all_tests,
        on_progress=_progress(options),
    )
    print(json.dumps(benchmark.as_dict()) if options.json else format_identify(benchmark))
    return 130 if benchmark.interrupted else 0


def run_posterior(options: argparse.Namespace) -> int:
    """Measure how fast a posterior is sampled; after Ctrl-C, say what was measured until then."""
    from studies.speed.posterior import bench_posterior, format_posterior

    benchmark = bench_posterior(
        steps=options.steps,
        walkers=options.walkers,
        threads=tuple(options.threads),
        nuts_draws=options.nuts_draws,
        quick=options.quick,
        on_progress=_progress(options),
    )
    print(json.dumps(benchmark.as_dict()) if options.json else format_posterior(benchmark))
    return 130 if benchmark.interrupted else 0


def run_refine(options: argparse.Namespace) -> int:
    """Measure how long a refinement takes."""
    from studies.speed.refine import bench_refine, format_refine

    benchmark = bench_refine(
        seeds=options.seeds, threads=options.threads, quick=options.quick, on_progress=_progress(options)
    )
    print(json.dumps(benchmark.as_dict()) if options.json else format_refine(benchmark))
    return 0


def run_loop(options: argparse.Namespace) -> int:
    """Measure how long thousands of closed-loop runs take."""
    from studies.speed.loop import bench_loop, format_loop

    benchmark = bench_loop(
        candidates=20 if options.quick else options.candidates,
        motions=1 if options.quick else options.motions,
        seconds=5.0 if options.quick else options.seconds,
        threads=options.threads,
        rounds=1 if options.quick else options.rounds,
        on_progress=_progress(options),
    )
    print(json.dumps(benchmark.as_dict()) if options.json else format_loop(benchmark))
    return 0


def run_regulators(options: argparse.Namespace) -> int:
    """Measure how many regulators are designed in a second."""
    from studies.speed.regulators import bench_regulators, format_regulators

    benchmark = bench_regulators(
        states=options.states,
        threads=(1,) if options.quick else options.threads,
        rounds=1 if options.quick else options.rounds,
        batch=16 if options.quick else None,
        on_progress=_progress(options),
    )
    print(json.dumps(benchmark.as_dict()) if options.json else format_regulators(benchmark))
    return 0


def _add_common(subject: argparse.ArgumentParser) -> None:
    subject.add_argument(
        "--rounds", type=int, default=7, metavar="N", help="repetitions, of which the median counts"
    )
    subject.add_argument("--quiet", action="store_true", help="no progress")
    _add_json(subject)


def _add_json(subject: argparse.ArgumentParser) -> None:
    subject.add_argument("--json", action="store_true", help="one JSON object on stdout and nothing else")


def _progress(options: argparse.Namespace) -> Callable[[str], None] | None:
    return None if options.quiet else partial(print, file=sys.stderr)
