"""Walks along a profile, in unit coordinates of the free parameters.

On one side of a profile one parameter is stepped away from the fit, and the others are fitted anew after each step. A
walk is a generator: it yields a start and receives the minimum with the parameter held, so that the minimisations of
all walks share one batch.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.coordinates import Box
from mrwork.identification.interval import End
from mrwork.identification.minimise.levenberg_marquardt import find_minima
from mrwork.identification.objective import Objective


@array_dataclass()
class Point:
    """A position in unit coordinates, shape (n_free,), with the squared misfit S there."""

    position: Floats
    squared: float


# Step in the root of the likelihood ratio, which is linear in the parameter where the misfit is quadratic.
_RISE = 0.6
# Limits on the ratio of successive steps.
_SHORTEST, _LONGEST = 0.25, 2.5
# Largest distance in the root of the likelihood ratio of the two points that bracket the threshold.
_BRACKET = 0.8
# Overshoot of the threshold, so that the last point is not just below it.
_BEYOND = 0.05
# Gain in the likelihood ratio of an iteration below which a minimisation has converged, most iterations, and their
# first damping: a start is near its minimum.
_GAIN = 0.003
_MOST_ITERATIONS = 20
_DAMPING = 1e-2
_MOST_POINTS = 40
_MOST_BETWEEN = 6
# Smallest step as a share of the first; the walk ends where even this cannot be simulated.
_LEAST_SHARE = 1e-3


Walk = Generator[Floats, Point, End]


def signed_root(squared: float, least: float, dof: float) -> float:
    """Root of the likelihood ratio `dof ln(S/S_least)`; 0 at and below the least misfit."""
    return float(np.sqrt(dof * max(np.log(squared / least), 0.0)))


@dataclass(slots=True, kw_only=True)
class Side:
    """One side of a profile: points from the origin outwards, and how the walk ended."""

    points: list[Point]
    end: End = "interrupted"


Way = Literal[-1, 1]
DIRECTIONS: tuple[Way, ...] = (-1, 1)
# By index among the free parameters, and direction.
Sides = dict[tuple[int, Way], Side]


@array_dataclass()
class WalkRules:
    """What all walks of a profile share; positions and steps are in unit coordinates, shape (n_free,).

    `first` are first steps. A walk ends where the root of the likelihood ratio exceeds `limit`. `spring` has the
    indices of the accumulator's stiffness k and free length x0, if both are free and may have either sign: k x0 offsets
    the force, so k can change its sign only if x0 does too, through infinity.
    """

    box: Box
    first: Floats
    limit: float
    dof: float
    spring: tuple[int, ...] = ()

    def on_line(self, before: Floats, here: Floats, index: int, target: float) -> Floats:
        """Where the line through two positions has the coordinate `index` at `target`, clipped to the box.

        Of a spring k and k x0 are on the line, unless x0 is the coordinate.
        """
        step = here[index] - before[index]
        share = (target - here[index]) / step if step else 0.0
        there = here + share * (here - before)
        there[index] = target
        if self.spring and self.box.free[index] != self.spring[1]:
            theta = self.box.theta_from_unit(np.clip([before, here, there], 0.0, 1.0))
            stiffness, free = theta[:, list(self.spring)].T
            if stiffness[2] != 0.0:
                product = stiffness * free
                theta[2, self.spring[1]] = (product[1] + share * (product[1] - product[0])) / stiffness[2]
                there = self.box.unit_from_theta(theta[2])
                there[index] = target
        return np.asarray(np.clip(there, 0.0, 1.0))

    def walk(self, index: int, way: Way, points: list[Point]) -> Walk:
        """Step the free parameter `index` up or down from the first of `points`, to which each new point is appended.

        The walk ends beyond the limit with points close to it on either side; or on the bound.
        """
        (origin,) = points
        bound = 1.0 if way > 0 else 0.0
        step = first = float(self.first[index])
        while len(points) < _MOST_POINTS:
            before, last = points[-2:] if len(points) > 1 else (origin, origin)
            here = float(last.position[index])
            if here == bound:
                return "bound"
            target = here + way * step
            if way * (bound - target) <= 0.0:
                target = bound
            point = yield self.on_line(before.position, last.position, index, target)
            if not np.isfinite(point.squared):
                step = _SHORTEST * abs(target - here)
                if step < _LEAST_SHARE * first:
                    return "not simulated"
                continue
            points.append(point)
            reached, after = (signed_root(point.squared, origin.squared, self.dof) for point in points[-2:])
            if after > self.limit:
                yield from self._bracket_limit(index, points)
                return "closed"
            aimed = min(_RISE, self.limit + _BEYOND - after)
            rise = after - reached
            factor = aimed / rise if rise > 0.0 else _LONGEST
            step = abs(target - here) * float(np.clip(factor, _SHORTEST, _LONGEST))
        return "too many points"

    def _bracket_limit(self, index: int, points: list[Point]) -> Generator[Floats, Point, None]:
        for _ in range(_MOST_BETWEEN):
            low, high = points[-2:]
            roots = [signed_root(point.squared, points[0].squared, self.dof) for point in (low, high)]
            if roots[1] - roots[0] < _BRACKET:
                break
            ends = (float(low.position[index]), float(high.position[index]))
            # Away from the ends, so that the interval shrinks.
            share = float(np.clip((self.limit - roots[0]) / (roots[1] - roots[0]), 0.2, 0.8))
            target = ends[0] + share * (ends[1] - ends[0])
            point = yield self.on_line(high.position, low.position, index, target)
            if not np.isfinite(point.squared):
                break
            beyond = signed_root(point.squared, points[0].squared, self.dof) > self.limit
            points[-1:] = [point] if beyond else [point, high]

    def _minimise(self, objective: Objective, starts: Mapping[tuple[int, Way], Floats]) -> list[Point]:
        """The minima from the starts of walks, each with the parameter of its walk held."""
        held = np.array([index == np.arange(len(self.first)) for index, _ in starts])
        positions = np.array([*starts.values()])
        minima = find_minima(
            objective,
            self.box,
            self.box.theta_from_unit(positions),
            max_iterations=_MOST_ITERATIONS,
            tolerance=_GAIN / max(self.dof, 1.0),
            held=held,
            damping=_DAMPING,
        )
        # A held parameter is exactly where the walk has put it, also on a bound.
        positions = np.where(held, positions, self.box.unit_from_theta(minima.theta))
        return [
            Point(position=position, squared=misfit**2)
            for position, misfit in zip(positions, minima.misfit.tolist(), strict=True)
        ]

    def run(self, objective: Objective, sides: Sides, on_batch: Callable[[Sides], None]) -> None:
        """Run all walks to their ends; minimisations from their next positions are one batch."""
        walks = {key: self.walk(*key, side.points) for key, side in sides.items()}
        minima: dict[tuple[int, Way], Point | None] = dict.fromkeys(walks)
        while minima:
            pending = dict[tuple[int, Way], Floats]()
            for key, point in minima.items():
                try:
                    # The first value that a generator is sent is none.
                    pending[key] = walks[key].send(point)  # type: ignore[arg-type] # as above
                except StopIteration as ended:
                    sides[key].end = ended.value
            on_batch(sides)
            minima = dict(zip(pending, self._minimise(objective, pending), strict=True)) if pending else {}
