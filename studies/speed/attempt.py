"""One attempt of one method on the search job: it counts simulations and ends at the target, or at the budget."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np

from studies.former.arrays import Floats
from studies.speed.search_job import SearchJob

# Libraries compute with misfits, so a failure is given as a number worse than any misfit.
_FAILURE = 1e10
# 0.2 points of fit.
NEAR = 0.002


class BatchObjective(Protocol):
    """Simulates candidates of the model: our `Objective`, or another."""

    def __call__(self, theta: Floats, thresholds: Floats | None = None, /) -> Floats:
        """NRMSE of each row of `theta` (m, 10), shape (m,), infinite where a simulation failed.

        One that reaches its threshold, shape (m,), may end there.
        """

    def residuals(self, theta: Floats, /) -> Floats:
        """Residuals of each row, shape (m, n_counted), whose squares add up to the squared misfit."""


class AttemptEnded(Exception):  # noqa: N818 # the end that every attempt is meant to meet, not an error
    """The target is reached or the budget is spent: ends a method wherever it is."""


@dataclass(slots=True, kw_only=True, eq=False)
class Attempt:
    """The objective as a method sees it, on the unit cube, and what the method has spent.

    A batch counts whole, also where one of its first candidates reaches the target. `least` is the best misfit so far,
    `visited` collects the points, if it is a list.
    """

    job: SearchJob
    objective: BatchObjective
    target: float
    budget: int
    evaluations: int = 0
    seconds: float = 0.0
    least: float = math.inf
    began: float = field(default_factory=time.perf_counter)
    visited: list[Floats] | None = None

    @property
    def success(self) -> bool:
        """Whether the target was reached."""
        return self.least <= self.target

    def misfits(self, unit: Floats, thresholds: Floats | None = None) -> Floats:
        """Misfits of points of the cube, shape (m, n_params) to (m,), finite; ends the attempt where it must."""
        misfit = self.objective(self._theta(unit), thresholds)
        self.account(len(unit), float(np.min(misfit)))
        return np.where(np.isfinite(misfit), misfit, _FAILURE)

    def residuals(self, unit: Floats) -> Floats:
        """Residuals of points of the cube, shape (m, n_params) to (m, n_counted); ends the attempt where it must."""
        residuals = self.objective.residuals(self._theta(unit))
        misfit = np.sqrt(np.einsum("bt,bt->b", residuals, residuals))
        self.account(len(unit), float(np.min(misfit)))
        return residuals

    def _theta(self, unit: Floats) -> Floats:
        if self.visited is not None:
            self.visited.append(unit.copy())
        return self.job.theta(unit)

    def account(self, simulated: int, least: float) -> None:
        """Count simulations and keep their least misfit; end the attempt at the target or at the budget."""
        self.evaluations += simulated
        self.seconds = time.perf_counter() - self.began
        self.least = min(self.least, least)
        if self.success or self.evaluations >= self.budget:
            raise AttemptEnded


Method = Callable[[Attempt, int], None]
ObjectiveName = Literal["rust", "rust, early abort", "rust, seeds at once", "numba"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Contender:
    """A method on an objective: it is called with an attempt and a seed, and runs until the attempt ends it."""

    name: str
    objective: ObjectiveName
    method: Method
    settings: str


@dataclass(frozen=True, slots=True, kw_only=True)
class AttemptResult:
    """Result of one attempt; `gap_points` is the difference in fit from the best known one [points]."""

    method: str
    objective: str
    evaluations: int
    seconds: float
    success: bool
    gap_points: float


def attempted(
    contender: Contender,
    job: SearchJob,
    objective: BatchObjective,
    *,
    best_known: float,
    budget: int,
    seed: int,
) -> AttemptResult:
    """Run a method once until it is within 0.2 points of the best known misfit; a method that ends before fails."""
    target = best_known + NEAR
    attempt = Attempt(job=job, objective=objective, target=target, budget=budget)
    with suppress(AttemptEnded):
        contender.method(attempt, seed)
    return AttemptResult(
        method=contender.name,
        objective=contender.objective,
        evaluations=attempt.evaluations,
        seconds=attempt.seconds,
        success=attempt.success,
        gap_points=100.0 * (attempt.least - best_known),
    )
