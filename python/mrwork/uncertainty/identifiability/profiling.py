"""Profile likelihood: how far each parameter can go before no choice of the others makes up for it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.errors import Interrupted, SettingError, UnknownNameError
from mrwork.identification.fit import Fit
from mrwork.identification.objective import ROOT_MEAN_SQUARE
from mrwork.identification.problem import Problem
from mrwork.records import DamperTest
from mrwork.uncertainty.autocorrelation import effective_samples, residuals_by_test
from mrwork.uncertainty.identifiability.curvature import Scaled, curvature, linearise
from mrwork.uncertainty.identifiability.profile import Profiles, profile_of
from mrwork.uncertainty.identifiability.scale import Scale, scaled_ranges
from mrwork.uncertainty.identifiability.walk import Descent, End, Place, descent, places, signed_root, walk

# A fit that gives way by more than this in the likelihood ratio was not at its minimum.
_BETTER = 0.5
# About a better fit, where one is found, all begins again.
_MOST_ROUNDS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfileProgress:
    """Sides that have ended, of how many, points and simulations so far."""

    ended: int
    sides: int
    points: int
    evaluations: int
    seconds: float


def profile_likelihood(
    fit: Fit,
    tests: Sequence[DamperTest],
    *,
    parameters: Sequence[str] = (),
    level: float = 0.95,
    threads: int = 0,
    on_progress: Callable[[ProfileProgress], None] | None = None,
) -> Profiles:
    """Profile the likelihood of a fit in its free parameters, both ways of all of them side by side in lanes.

    With a Gaussian error of unknown size the likelihood ratio is `n ln(S/S_least)`; it is tempered to as many samples
    as the residuals are worth, `n_eff (1 - n_params/n)`. The interval is where it stays below chi-squared with one
    degree of freedom (Venzon, Moolgavkar, Applied Statistics 37, 1988, 87-94).

    A model with a redundant form is profiled in the one in which it is identified: along the valley of a Spencer
    Bouc-Wen gamma and beta cancel to many digits, and nobody can walk there.

    Parameters
    ----------
    tests
        Those of the fit.
    parameters
        Names of those to profile; default all that are free.
    level
        Of the intervals.
    on_progress
        Called after each batch.

    Raises
    ------
    UnknownNameError
        Where the model has no such parameter.
    SettingError
        Where a parameter is fixed, the level is no probability, or the fit was not one of least squares.
    Interrupted
        On Ctrl-C, carrying the `Profiles` so far, whose ends are "interrupted".
    """
    if not 0.0 < level < 1.0:
        raise SettingError(f"`level` is {level:g}; give a probability between 0 and 1, as 0.95")
    power = fit.settings.power
    if power != ROOT_MEAN_SQUARE:
        raise SettingError(
            f"the fit made a mean with power {power:g} small, a likelihood ratio is of least squares; "
            "identify again without a power"
        )
    began = time.perf_counter()
    problem = Problem.of_fit(fit, tuple(tests), threads=threads)
    objective, spec, box = problem.objective, problem.form.spec, problem.form.box
    theta = np.clip(problem.form.forth(np.array(fit.theta)), box.lower, box.upper)
    wanted = _wanted(box, parameters)
    scale = Scale.of(box, scaled_ranges(spec, box, objective.tests, theta), theta)
    scaled = Scaled.of(box, scale, theta)
    derivatives = linearise(objective, box.free)

    def simulated(position: NDArray[np.float64]) -> list[Place]:
        return places(position, curvature(derivatives, scaled, position))

    (start,) = simulated(scaled.position(theta)[None])
    residuals = objective.residuals(scaled.parameters(start.position)[None])[0]
    n_effective = effective_samples(residuals_by_test(residuals, objective.tests))
    dof = n_effective * max(1.0 - len(box.free) / residuals.size, 0.0)
    # Of chi-squared with one degree of freedom, which is a squared normal variable.
    threshold = NormalDist().inv_cdf(0.5 * (1.0 + level)) ** 2

    def result(sides: Sides, status: Literal["finished", "interrupted"]) -> Profiles:
        least = min(each.squared for side in sides.values() for each in side.points)
        gone = signed_root(start.squared, least, dof) ** 2
        made = tuple(
            profile_of(
                spec.parameters[box.free[index]],
                scaled,
                index,
                sides[index, -1].points,
                sides[index, 1].points,
                (sides[index, -1].end, sides[index, 1].end),
                least=least,
                threshold=threshold,
                dof=dof,
            )
            for index in wanted
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
            if gone < _BETTER
            else f"a better fit was found on the way: NRMSE {np.sqrt(least):.6g} after {fit.nrmse:.6g}; "
            "the profiles are about that one, identify again",
            evaluations=objective.tally.simulations,
            seconds=time.perf_counter() - began,
        )

    def tell(sides: Sides) -> None:
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
    sides: Sides = {(index, way): Side(points=[start]) for index in wanted for way in _WAYS}
    try:
        for _ in range(_MOST_ROUNDS):
            origin = _run_alone(descent(scaled, best, dof), best, simulated)
            sides = {key: Side(points=[origin]) for key in sides}
            _run_together(scaled, sides, simulated, tell, limit=float(np.sqrt(threshold)), dof=dof)
            best = min(
                (each for side in sides.values() for each in side.points), key=lambda each: each.squared
            )
            if signed_root(origin.squared, best.squared, dof) ** 2 < _BETTER:
                break
    except KeyboardInterrupt as interrupt:
        raise Interrupted(result(sides, "interrupted"), "profiling") from interrupt
    return result(sides, "finished")


@dataclass(slots=True, kw_only=True)
class Side:
    """One side of a profile as it grows: places from the origin outwards, and how it ended."""

    points: list[Place]
    end: End = "interrupted"


# By place among the free parameters, and way.
Sides = dict[tuple[int, Literal[-1, 1]], Side]
_WAYS: tuple[Literal[-1, 1], ...] = (-1, 1)


def _wanted(box: Box, parameters: Sequence[str]) -> list[int]:
    """Places among the free parameters of those to profile."""
    free = [box.names[index] for index in box.free]
    for name in parameters:
        if name not in box.names:
            raise UnknownNameError(f"no parameter is called {name!r}; this model has {', '.join(box.names)}")
        if name not in free:
            raise SettingError(f"{name} is fixed; only free parameters have a profile: {', '.join(free)}")
    return [number for number, name in enumerate(free) if not parameters or name in parameters]


def _run_alone(
    walked: Descent, place: Place, simulated: Callable[[NDArray[np.float64]], list[Place]]
) -> Place:
    """Run one descent to its end."""
    try:
        wanted = next(walked)
        while True:
            (place,) = simulated(wanted[None])
            wanted = walked.send(place)
    except StopIteration as ended:
        arrived: Place = ended.value
        return arrived


def _run_together(
    scaled: Scaled,
    sides: Sides,
    simulated: Callable[[NDArray[np.float64]], list[Place]],
    tell: Callable[[Sides], None],
    *,
    limit: float,
    dof: float,
) -> None:
    """Walk all sides to their ends; what all want next is one batch."""
    walks = {key: walk(scaled, *key, side.points, limit=limit, dof=dof) for key, side in sides.items()}
    wanted: dict[tuple[int, Literal[-1, 1]], NDArray[np.float64]] = {}

    def advance(key: tuple[int, Literal[-1, 1]], place: Place | None) -> None:
        try:
            wanted[key] = next(walks[key]) if place is None else walks[key].send(place)
        except StopIteration as ended:
            sides[key].end = ended.value
            wanted.pop(key, None)

    for key in walks:
        advance(key, None)
    while wanted:
        found = simulated(np.array(list(wanted.values())))
        for key, place in zip(list(wanted), found, strict=True):
            advance(key, place)
        tell(sides)
