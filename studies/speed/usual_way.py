"""The way it is usually done: a swarm that solves the model with `scipy.integrate.solve_ivp`, candidate by candidate.

A whole search so takes minutes to hours. A few of the candidates that pyswarms asked on its way to the target are
timed, spread evenly over its course, and their mean multiplied by the simulations that pyswarms needed.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from studies.speed.attempt import Attempt, AttemptEnded, RustObjective
from studies.speed.search_job import SearchJob
from studies.speed.search_peers import pyswarms

Solver = Literal["RK45", "LSODA"]
SOLVERS: tuple[Solver, ...] = ("RK45", "LSODA")


@dataclass(frozen=True, slots=True, kw_only=True)
class UsualWay:
    """Mean seconds of one candidate by each solver, and how many were timed."""

    seconds_by_solver: dict[str, float]
    candidates: int


def measure_usual_way(job: SearchJob, *, target: float, budget: int, candidates: int) -> UsualWay:
    """Time RK45, the default, and LSODA, the faster, at their own tolerances, on candidates of a swarm."""
    units: list[NDArray[np.float64]] = []
    objective = RustObjective(objective=job.objective)
    attempt = Attempt(job=job, objective=objective, target=target, budget=budget, visited=units)
    with suppress(AttemptEnded):
        pyswarms(attempt, 0)
    visited = job.theta(np.concatenate(units))
    few = visited[np.linspace(0, len(visited) - 1, candidates).astype(int)]
    return UsualWay(
        seconds_by_solver={solver: _seconds(misfit_by(solver, job), few) for solver in SOLVERS},
        candidates=candidates,
    )


def _seconds(misfit: Callable[[NDArray[np.float64]], float], few: NDArray[np.float64]) -> float:
    began = time.perf_counter()
    for theta in few:
        misfit(theta)
    return (time.perf_counter() - began) / len(few)


def misfit_by(solver: Solver, job: SearchJob) -> Callable[[NDArray[np.float64]], float]:
    """The misfit of one candidate, shape (10,), as one would write it first; infinite where the solver fails."""
    from scipy.integrate import solve_ivp

    test = job.test
    time_axis = test.time - test.start_time
    weight = job.objective.compared[0].weight(1)

    def misfit(theta: NDArray[np.float64]) -> float:
        c, k, x0, k_w, rho, sigma, n, mu, share, w_s = theta.tolist()

        def rate(t: float, state: NDArray[np.float64]) -> list[float]:
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
