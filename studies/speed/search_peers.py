"""Searches of other libraries as their users call them, each in its best configuration that we know of.

All may pass a whole generation to the objective, and do. None is left to stop by itself while budget remains: a rule
of convergence ends an attempt at best as a failure. CMA, which restarts by design, and least squares, whose
minimisations are short, start again where they stop.

The usual way is a swarm that solves the model with `scipy.integrate.solve_ivp`, candidate by candidate. A whole search
so takes minutes to hours. A few of the candidates that pyswarms asked on its way to the target are timed, spread evenly
over its course, and their mean multiplied by the simulations that pyswarms needed.
"""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from mrwork.search import library
from studies.former.arrays import Floats
from studies.speed.attempt import Attempt, AttemptEnded
from studies.speed.search_job import SearchJob
from studies.speed.timing import timed

Solver = Literal["RK45", "LSODA"]
SOLVERS: tuple[Solver, ...] = ("RK45", "LSODA")
# More than any budget allows.
_GENERATIONS = 10**6
# Forward differences of the residuals in the unit cube: large against rounding, small against their curvature.
_STEP = 1e-7


def scipy_differential_evolution(attempt: Attempt, seed: int) -> None:
    """`scipy.optimize.differential_evolution`, vectorised, so with deferred updating; no polish."""
    from scipy.optimize import Bounds, differential_evolution

    def misfits(genes: Floats) -> Floats:
        return attempt.misfits(genes.T)

    differential_evolution(
        misfits,  # type: ignore[arg-type] # the stubs know no vectorised objective
        Bounds(np.zeros(attempt.job.n_params), np.ones(attempt.job.n_params)),
        popsize=4,
        tol=0.0,
        atol=-1.0,
        maxiter=_GENERATIONS,
        polish=False,
        vectorized=True,
        updating="deferred",
        rng=np.random.default_rng(seed),
    )


def cma(attempt: Attempt, seed: int) -> None:
    """`cma`, restarted from a random point with twice the population where it stops (Auger & Hansen 2005)."""
    strategy = library("cma").CMAEvolutionStrategy
    rng = np.random.default_rng(seed)
    start, factor = np.full(attempt.job.n_params, 0.5), 1
    while True:
        options = {"bounds": [0.0, 1.0], "popsize_factor": factor, "seed": seed + 1, "verbose": -9}
        evolution = strategy(start, 0.3, options)
        while not evolution.stop():
            candidates = evolution.ask()
            evolution.tell(candidates, attempt.misfits(np.array(candidates)))
        start, factor = rng.random(attempt.job.n_params), 2 * factor


def pymoo_ga(attempt: Attempt, seed: int) -> None:
    """`pymoo`'s GA: simulated binary crossover, polynomial mutation, survival of the fittest."""
    library("pymoo.optimize").minimize(
        _pymoo_problem()(attempt),
        library("pymoo.algorithms.soo.nonconvex.ga").GA(pop_size=30),
        library("pymoo.core.termination").NoTermination(),
        seed=seed,
        verbose=False,
    )


@cache
def _pymoo_problem() -> Any:
    problem: Any = library("pymoo.core.problem").Problem

    class CubeProblem(problem):  # type: ignore[misc] # a base class without types
        def __init__(self, attempt: Attempt) -> None:
            problem.__init__(self, n_var=attempt.job.n_params, n_obj=1, xl=0.0, xu=1.0)
            self._attempt = attempt

        def _evaluate(self, x: Floats, out: dict[str, Floats], *_: object, **__: object) -> None:
            out["F"] = self._attempt.misfits(x)[:, None]

    return CubeProblem


def pyswarms(attempt: Attempt, seed: int) -> None:
    """`pyswarms`: global best, with the constriction of Clerc & Kennedy (2002).

    Particles stop at the faces of the cube: with 30 of them that took fewer simulations than to reflect them.
    """
    n_params = attempt.job.n_params
    np.random.seed(seed)  # noqa: NPY002 # the library draws from the one generator that all of NumPy shares
    with _no_log_file():
        swarm = library("pyswarms.single.global_best").GlobalBestPSO(
            n_particles=30,
            dimensions=n_params,
            options={"c1": 1.49618, "c2": 1.49618, "w": 0.7298},
            bounds=(np.zeros(n_params), np.ones(n_params)),
            velocity_clamp=(-0.2, 0.2),
            bh_strategy="nearest",
        )
        swarm.optimize(attempt.misfits, iters=_GENERATIONS, verbose=False)


@contextmanager
def _no_log_file() -> Iterator[None]:
    """Keep pyswarms from writing `report.log` where the user stands, and from setting up everybody's logging."""
    before = os.environ.get("LOG_CFG")
    with tempfile.TemporaryDirectory() as folder:
        settings = Path(folder) / "logging.yaml"
        settings.write_text('{"version": 1, "disable_existing_loggers": false}', encoding="utf-8")
        os.environ["LOG_CFG"] = str(settings)
        try:
            yield
        finally:
            os.environ.pop("LOG_CFG")
            if before is not None:
                os.environ["LOG_CFG"] = before


def multistart_least_squares(attempt: Attempt, seed: int) -> None:
    """`scipy.optimize.least_squares` from random points, one after another; a Jacobian is one batch."""
    from scipy.optimize import least_squares

    n_params = attempt.job.n_params
    rng = np.random.default_rng(seed)

    latest: dict[bytes, Floats] = {}

    def residuals(unit: Floats) -> Floats:
        found = np.asarray(attempt.residuals(unit[None])[0])
        latest[unit.tobytes()] = found
        return found

    def jacobian(unit: Floats) -> Floats:
        # Inwards, so that no point leaves the cube. The residuals there are known: steps are judged before.
        steps = np.where(unit < 0.5, _STEP, -_STEP)
        found = attempt.residuals(unit + np.diag(steps))
        return np.asarray(((found - latest[unit.tobytes()]) / steps[:, None]).T)

    while True:
        latest.clear()
        least_squares(
            residuals,
            rng.random(n_params),
            jac=jacobian,
            bounds=(0.0, 1.0),
            max_nfev=60,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class UsualWay:
    """Mean seconds of one candidate by each solver, and how many were timed."""

    seconds_by_solver: dict[str, float]
    candidates: int


def measure_usual_way(job: SearchJob, *, target: float, budget: int, candidates: int) -> UsualWay:
    """Time RK45, the default, and LSODA, the faster, at their own tolerances, on candidates of a swarm."""
    units: list[Floats] = []
    attempt = Attempt(job=job, objective=job.objective, target=target, budget=budget, visited=units)
    with suppress(AttemptEnded):
        pyswarms(attempt, 0)
    visited = job.theta(np.concatenate(units))
    few = visited[np.linspace(0, len(visited) - 1, candidates).astype(int)]
    return UsualWay(
        seconds_by_solver={
            solver: timed(partial(list, map(misfit_by(solver, job), few)))[1] / candidates
            for solver in SOLVERS
        },
        candidates=candidates,
    )


def misfit_by(solver: Solver, job: SearchJob) -> Callable[[Floats], float]:
    """The misfit of one candidate, shape (10,), as one would write it first; infinite where the solver fails."""
    from scipy.integrate import solve_ivp

    test = job.test
    time_axis = test.time - test.start_time
    weight = job.objective.compared[0].weight(1)

    def misfit(theta: Floats) -> float:
        c, k, x0, k_w, rho, sigma, n, mu, share, w_s = theta.tolist()

        def rate(t: float, state: Floats) -> list[float]:
            w = state[0]
            g = np.interp(t, time_axis, test.velocity) - mu * math.tanh(w / w_s)
            power = abs(w) ** n
            return [rho * (g - sigma * abs(g) * math.copysign(power, w) + (sigma - 1.0) * g * power)]

        solution = solve_ivp(rate, (0.0, time_axis[-1]), [0.0], method=solver, t_eval=time_axis)
        if not solution.success:
            return math.inf
        w = solution.y[0]
        g = test.velocity - share * mu * np.tanh(w / w_s)
        residual = c * g + k * (test.displacement - x0) + k_w * w - test.force
        # What a solver with loose tolerances makes of a stiff candidate may be beyond all numbers.
        with np.errstate(over="ignore"):
            return float(np.linalg.norm(residual[test.counted]) * weight)

    return misfit
