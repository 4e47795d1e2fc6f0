"""Profile likelihood: the range of each parameter in which the other parameters can compensate for its change."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import Level, Threads, checked
from mrwork.dampers.coordinates import Box
from mrwork.errors import Interrupted, SettingError, UnknownNameError
from mrwork.identification.autocorrelation import effective_samples, residuals_by_test
from mrwork.identification.fit import Fit
from mrwork.identification.linearisation import linearised
from mrwork.identification.problem import Problem
from mrwork.identification.settings import ROOT_MEAN_SQUARE
from mrwork.records import DamperTest
from mrwork.records.damper_test import as_tests
from mrwork.uncertainty.identifiability.curvature import Scale, Scaled, curvature, linearise
from mrwork.uncertainty.identifiability.profile import Profiles, profile_of
from mrwork.uncertainty.identifiability.walk import (
    DIRECTIONS,
    Point,
    Side,
    Sides,
    minimise,
    points_of,
    run_alone,
    run_together,
    signed_root,
)

# A decrease of the likelihood ratio by more than this means that the fit was not at its minimum.
_BETTER = 0.5
# Largest number of restarts about a better minimum.
_MOST_ROUNDS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfileProgress:
    """Progress of a profile likelihood: sides that have ended of all, points, simulations."""

    ended: int
    sides: int
    points: int
    evaluations: int
    seconds: float


@checked
def profile(
    fit: Fit,
    tests: DamperTest | Sequence[DamperTest],
    *,
    parameters: Sequence[str] = (),
    level: Level = 0.95,
    threads: Threads = 0,
    on_progress: Callable[[ProfileProgress], None] | None = None,
) -> Profiles:
    """Profile likelihood of the free parameters of a fit, both sides of all parameters simulated in one batch.

    With Gaussian errors of unknown variance the likelihood ratio is `n ln(S/S_least)`; here n is replaced by
    `n_eff (1 - n_params/n)` with the effective number of samples. The interval is where the ratio is below the quantile
    of chi-squared with one degree of freedom (Venzon, Moolgavkar, Applied Statistics 37, 1988, 87-94).

    A model with redundant parameters is profiled in the form in which it is identified: along the valley of a Spencer
    Bouc-Wen, gamma and beta cancel to many digits, which no local minimisation can follow.

    Parameters
    ----------
    tests
        The test or tests of the fit.
    parameters
        Names of the parameters to profile; default all free parameters.
    level
        Probability of the intervals.
    on_progress
        Called after each batch.

    Raises
    ------
    UnknownNameError
        Where the model has no such parameter.
    SettingError
        Where a parameter is fixed or named twice, or the fit was not a least-squares fit.
    Interrupted
        On Ctrl-C, carrying the `Profiles` so far, whose ends are "interrupted".
    """
    power = fit.settings.power
    if power != ROOT_MEAN_SQUARE:
        raise SettingError(
            f"the fit made a mean with power {power:g} small, a likelihood ratio is of least squares; "
            "identify again without a power"
        )
    began = time.perf_counter()
    problem = Problem.of_fit(fit, as_tests(tests), threads=threads)
    objective, spec, box = problem.objective, problem.form.spec, problem.form.box
    theta = np.clip(problem.form.from_model(np.array(fit.theta)), box.lower, box.upper)
    profiled = _profiled_indices(box, parameters)
    scale = Scale.of(spec, box, objective.tests, theta)
    scaled = Scaled.of(spec, box, scale, theta)
    derivatives = linearise(objective, box.free)

    def simulated(position: NDArray[np.float64]) -> list[Point]:
        return points_of(position, curvature(derivatives, scaled, position))

    (start,) = simulated(scaled.position(theta)[None])
    (residuals,), (slopes,) = linearised(objective, scaled.parameters(start.position)[None], box.free)
    n_effective = effective_samples(residuals_by_test(residuals, objective.tests))
    dof = n_effective * max(1.0 - len(box.free) / residuals.size, 0.0)
    # Quantile of chi-squared with one degree of freedom, the square of a normal variable.
    threshold = NormalDist().inv_cdf(0.5 * (1.0 + level)) ** 2

    def result(sides: Sides, status: Literal["finished", "interrupted"]) -> Profiles:
        least = min(each.squared for side in sides.values() for each in side.points)
        improvement = signed_root(start.squared, least, dof) ** 2
        made = tuple(
            profile_of(
                spec.parameters[box.free[index]],
                scaled,
                index,
                scale.of_parameter(spec, box.free[index], slopes[index]),
                sides[index, -1],
                sides[index, 1],
                least=least,
                threshold=threshold,
                dof=dof,
            )
            for index in profiled
        )
        return Profiles(
            model=spec.name,
            level=level,
            threshold=threshold,
            misfit=float(np.sqrt(least)),
            n_time=residuals.size,
            n_effective=n_effective,
            profiles=made,
            status=status,
            remark=""
            if improvement < _BETTER
            else f"a better fit was found on the way: NRMSE {np.sqrt(least):.6g} after {fit.nrmse:.6g}; "
            "the profiles are about that one, identify again",
            evaluations=objective.tally.simulations,
            seconds=time.perf_counter() - began,
        )

    def report(sides: Sides) -> None:
        if on_progress is not None:
            on_progress(
                ProfileProgress(
                    ended=sum(side.end != "interrupted" for side in sides.values()),
                    sides=len(sides),
                    points=sum(len(side.points) - 1 for side in sides.values()),
                    evaluations=objective.tally.simulations,
                    seconds=time.perf_counter() - began,
                )
            )

    best = start
    sides: Sides = {(index, way): Side(points=[start]) for index in profiled for way in DIRECTIONS}
    try:
        for _ in range(_MOST_ROUNDS):
            origin = run_alone(minimise(scaled, best, dof), best, simulated)
            sides = {key: Side(points=[origin]) for key in sides}
            run_together(scaled, sides, simulated, report, limit=float(np.sqrt(threshold)), dof=dof)
            best = min(
                (each for side in sides.values() for each in side.points), key=lambda each: each.squared
            )
            if signed_root(origin.squared, best.squared, dof) ** 2 < _BETTER:
                break
    except KeyboardInterrupt as interrupt:
        raise Interrupted(result(sides, "interrupted"), "profiling") from interrupt
    return result(sides, "finished")


def _profiled_indices(box: Box, parameters: Sequence[str]) -> list[int]:
    """Indices among the free parameters of those to profile."""
    free = [box.names[index] for index in box.free]
    if len(set(parameters)) < len(parameters):
        raise SettingError(f"`parameters` are {', '.join(parameters)}; name each once")
    for name in parameters:
        if name not in box.names:
            raise UnknownNameError(f"no parameter is called {name!r}; this model has {', '.join(box.names)}")
        if name not in free:
            raise SettingError(f"{name} is fixed; only free parameters have a profile: {', '.join(free)}")
    return [number for number, name in enumerate(free) if not parameters or name in parameters]
