"""Who takes part in `study.py identify`: our searches, and those of other libraries.

Two to four populations of each but CMA were tried on the reference test with six seeds, 0 to 5, and the one kept that
took the fewest simulations per success: 20 and 30 (32 of differential evolution) of ours; 20, 30 and 100 of pymoo; 20
and 30 of pyswarms, this with two ways at the faces; 32 and 120 of SciPy. 60 (64 of SciPy) was tried with three seeds
only, and was slower for all that came near. The benchmark uses other seeds. CMA keeps its own rule, 10.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from mrwork import identify
from mrwork.identification import Multistart, MultistartResult, search_starts
from mrwork.search import (
    CONSTRICTION,
    AbortableObjective,
    Ceiling,
    DifferentialEvolution,
    EfficientGA,
    Optimiser,
    StandardGA,
    StopRules,
    run_search,
)
from studies.speed import search_peers as peers
from studies.speed.attempt import Attempt, Contender, Method, ObjectiveName
from studies.speed.search_job import HELD

# Only the attempt ends a search.
UNSTOPPED = StopRules(max_generations=10**6, spread_tolerance=None, confidence=None, stall_generations=None)

# Any: each optimiser has states of its own kind.
OURS: Mapping[str, Optimiser[Any]] = {
    "efficient_ga": replace(EfficientGA(), population=20, stop=UNSTOPPED),
    "particle_swarm_constriction": replace(CONSTRICTION, population=20, stop=UNSTOPPED),
    "differential_evolution": replace(DifferentialEvolution(), population=32, stop=UNSTOPPED),
    "standard_ga": replace(StandardGA(), population=20, stop=UNSTOPPED),
}

# Module that must be there, method, settings.
PEERS: Mapping[str, tuple[str, Method, str]] = {
    "pymoo_ga": ("pymoo", peers.pymoo_ga, "population 30"),
    "pyswarms": (
        "pyswarms",
        peers.pyswarms,
        "global best, 30 particles, constriction, stopped at the faces, velocity up to 0.2",
    ),
    "scipy_differential_evolution": (
        "scipy",
        peers.scipy_differential_evolution,
        "best1bin, population 32, Latin hypercube, vectorised",
    ),
    "cma": ("cma", peers.cma, "population 10, sigma 0.3, restarts with twice the population"),
    "scipy_least_squares": (
        "scipy",
        peers.multistart_least_squares,
        "trf from random starts, forward differences in one batch",
    ),
}


# What an early abort may leave out: trials and particles no better than what they would replace, and chromosomes
# above a ceiling, which is another rule of the algorithm and so a setting.
ABORTED: Mapping[str, Optimiser[Any]] = {
    "efficient_ga": replace(
        EfficientGA(), population=20, stop=UNSTOPPED, ceiling=Ceiling(absolute=1.0, over_median=1.5)
    ),
    "particle_swarm_constriction": OURS["particle_swarm_constriction"],
    "differential_evolution": OURS["differential_evolution"],
}


def contenders() -> tuple[list[Contender], list[str]]:
    """Everyone on each objective, and the libraries that are not installed.

    Ours run on our kernel only: elsewhere they would ask for the same candidates.
    """
    found = [
        Contender(
            name="identify",
            objective="rust",
            method=_identify,
            settings="the whole call, to its own end: the model's default search, final fit and standard errors",
        ),
        Contender(
            name="multistart",
            objective="rust",
            method=_multistart,
            settings="the search of identify in the same box, to the target: batches of eight local minimisations",
        ),
    ]
    missing: list[str] = []
    own: tuple[tuple[ObjectiveName, Mapping[str, Optimiser[Any]]], ...]
    own = ("rust", OURS), ("rust, early abort", ABORTED)
    for objective, optimisers in own:
        for name, optimiser in optimisers.items():
            method = _searched(optimiser, aborting=optimisers is ABORTED)
            settings = described(optimiser)
            found.append(Contender(name=name, objective=objective, method=method, settings=settings))
    objectives: tuple[ObjectiveName, ...] = ("rust",)
    if importlib.util.find_spec("numba") is None:
        missing.append("numba")
    else:
        objectives = ("numba", "rust")
    for name, (module, method, settings) in PEERS.items():
        if importlib.util.find_spec(module) is None:
            missing.append(module)
            continue
        found += [
            Contender(name=name, objective=objective, method=method, settings=settings)
            for objective in objectives
        ]
    return found, missing


def described(optimiser: Optimiser[Any]) -> str:
    """Settings of one of our searches, in words."""
    ceiling = getattr(optimiser, "ceiling", Ceiling())
    limited = (
        ""
        if ceiling == Ceiling()
        else f", ceiling at {ceiling.absolute:g} and {ceiling.over_median:g} times the median"
    )
    return f"population {optimiser.population}{limited}"


def ending(optimiser: Optimiser[Any], rules: StopRules) -> Any:
    """The same with other rules that end it."""
    return replace(optimiser, stop=rules)  # type: ignore[type-var] # `replace` knows no protocol


def _searched(optimiser: Optimiser[Any], *, aborting: bool) -> Method:
    def method(attempt: Attempt, seed: int) -> None:
        objective = AbortableObjective(misfits=attempt.misfits) if aborting else attempt.misfits
        run_search(optimiser, objective, rng=seed, n_params=attempt.job.n_params)

    return method


def _multistart(attempt: Attempt, seed: int) -> None:
    job = attempt.job
    simulated = job.objective.tally.simulations

    def look(found: MultistartResult, _: float) -> None:
        nonlocal simulated
        now = found.evaluations[-1]
        attempt.account(now - simulated, found.best[-1])
        simulated = now

    search_starts(job.objective, job.box, job.box, Multistart(), rng=seed, on_iteration=look)


def _identify(attempt: Attempt, seed: int) -> None:
    job = attempt.job
    fit = identify(job.spec, job.test, bounds=HELD, observe="none", rng=seed, threads=job.objective.threads)
    attempt.evaluations = fit.evaluations
    attempt.least = fit.nrmse
    attempt.seconds = time.perf_counter() - attempt.began
