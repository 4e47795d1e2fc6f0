"""Walks along a profile, in scaled coordinates of the free parameters.

On one side of a profile one parameter is stepped away from the fit, and the others are fitted anew after each step. A
walk is a generator: it yields a start and receives the minimum with the parameter held, so that the minimisations of
all walks share one batch.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec
from mrwork.identification.minimise.levenberg_marquardt import find_minima
from mrwork.identification.objective import Objective
from mrwork.identification.verdicts import Scale


@array_dataclass()
class Scaled:
    """Scaled coordinates of the free parameters of a box: logarithms, or multiples of their size; shape (n_free,).

    `spring` has the indices of the accumulator's stiffness k and free length x0, if both are free: k x0 offsets the
    force, so k can change its sign only if x0 does too, through infinity.
    """

    theta: Floats
    free: tuple[int, ...]
    log: NDArray[np.bool_]
    size: Floats
    lower: Floats
    upper: Floats
    spring: tuple[int, int] | None = None

    @classmethod
    def of(cls, spec: DamperSpec, box: Box, scales: Sequence[Scale], theta: Floats) -> Scaled:
        """Coordinates of the free parameters of `box`, about `theta`, shape (n_params,)."""
        free = np.array(box.free, dtype=int)
        log = np.array(box.log)[free]
        size = np.where(log, 1.0, [scales[index].size for index in free])
        bounds = (np.array(bound)[free] for bound in (box.lower, box.upper))
        lower, upper = (np.where(log, np.log(np.where(log, bound, 1.0)), bound / size) for bound in bounds)
        spring = None
        if spec.spring_indices is not None and set(spec.spring_indices) <= set(box.free):
            spring = (box.free.index(spec.spring_indices[0]), box.free.index(spec.spring_indices[1]))
        return cls(theta=theta, free=box.free, log=log, size=size, lower=lower, upper=upper, spring=spring)

    def position(self, theta: Floats) -> Floats:
        """Coordinates, shape (..., n_free), of parameters, shape (..., n_params), clipped to the box."""
        value = theta[..., np.array(self.free, dtype=int)]
        coordinates = np.where(self.log, np.log(np.where(self.log, value, 1.0)), value / self.size)
        return np.asarray(np.clip(coordinates, self.lower, self.upper))

    def values(self, position: Floats) -> Floats:
        """Values of the free parameters, shape (..., n_free)."""
        return np.asarray(np.where(self.log, np.exp(np.where(self.log, position, 0.0)), position * self.size))

    def parameters(self, position: Floats) -> Floats:
        """All parameters, shape (..., n_params)."""
        theta = np.broadcast_to(self.theta, (*position.shape[:-1], self.theta.size)).copy()
        theta[..., np.array(self.free, dtype=int)] = self.values(position)
        return theta

    def slope(self, position: Floats) -> Floats:
        """Derivative of each free parameter with respect to its coordinate, shape (..., n_free)."""
        return np.asarray(np.where(self.log, self.values(position), self.size))

    def on_line(self, before: Floats, here: Floats, index: int, target: float) -> Floats:
        """Where the line through two positions has the coordinate `index` at `target`, clipped to the box.

        Of a spring k and k x0 are on the line, unless x0 is the coordinate.
        """
        step = here[index] - before[index]
        share = (target - here[index]) / step if step else 0.0
        there = here + share * (here - before)
        there[index] = target
        if self.spring is not None and index != self.spring[1]:
            stiffness, free = self.spring
            if there[stiffness] != 0.0:
                product = here[stiffness] * here[free]
                product += share * (product - before[stiffness] * before[free])
                there[free] = product / there[stiffness]
        return np.asarray(np.clip(there, self.lower, self.upper))


@array_dataclass()
class Point:
    """A position, shape (n_free,), with the squared misfit S there."""

    position: Floats
    squared: float


End = Literal["closed", "bound", "not simulated", "too many points", "interrupted"]

# Step in the root of the likelihood ratio, which is linear in the parameter where the misfit is quadratic.
_RISE = 0.6
# Limits on the ratio of successive steps.
_SHORTEST, _LONGEST = 0.25, 2.5
# Longest first step in the scaled coordinate, for insensitive parameters.
_FIRST = 0.3
# Largest distance in the root of the likelihood ratio of the two points that bracket the threshold.
_BRACKET = 0.8
# Overshoot of the threshold, so that the last point is not just below it.
_BEYOND = 0.05
# Gain in the likelihood ratio of an iteration below which a minimisation has converged, most iterations, and their
# first damping: a start is near its minimum.
_GAIN = 0.003
_MOST_ITERATIONS = 20
_DAMPING = 1e-3
_MOST_POINTS = 40
_MOST_BETWEEN = 6
# Smallest step as a share of the first; the walk ends where even this cannot be simulated.
_LEAST_SHARE = 1e-3


Walk = Generator[Floats, Point, End]


def signed_root(squared: float, least: float, dof: float) -> float:
    """Root of the likelihood ratio `dof ln(S/S_least)`; 0 at and below the least misfit."""
    return float(np.sqrt(dof * max(np.log(squared / least), 0.0)))


def walk(
    scaled: Scaled,
    index: int,
    way: Literal[-1, 1],
    points: list[Point],
    *,
    error: float,
    limit: float,
    dof: float,
) -> Walk:
    """Step the free parameter `index` up or down from the first of `points`, to which each new point is appended.

    The first step is half its standard `error`. The walk ends beyond `limit`, in the root of the likelihood ratio, with
    points close to it on either side; or on the bound.
    """
    (origin,) = points
    bound = float(scaled.upper[index] if way > 0 else scaled.lower[index])
    # The error of a parameter that is not determined is not a number.
    step = first = float(np.fmin(0.5 * error, _FIRST))
    while len(points) < _MOST_POINTS:
        before, last = points[-2:] if len(points) > 1 else (origin, origin)
        here = float(last.position[index])
        if here == bound:
            return "bound"
        target = here + way * step
        if way * (bound - target) <= 0.0:
            target = bound
        point = yield scaled.on_line(before.position, last.position, index, target)
        if not np.isfinite(point.squared):
            step = _SHORTEST * abs(target - here)
            if step < _LEAST_SHARE * first:
                return "not simulated"
            continue
        points.append(point)
        reached, after = (signed_root(point.squared, origin.squared, dof) for point in points[-2:])
        if after > limit:
            yield from _bracket_limit(scaled, index, points, limit, dof)
            return "closed"
        aimed = min(_RISE, limit + _BEYOND - after)
        rise = after - reached
        factor = aimed / rise if rise > 0.0 else _LONGEST
        step = abs(target - here) * float(np.clip(factor, _SHORTEST, _LONGEST))
    return "too many points"


def _bracket_limit(
    scaled: Scaled, index: int, points: list[Point], limit: float, dof: float
) -> Generator[Floats, Point, None]:
    for _ in range(_MOST_BETWEEN):
        low, high = points[-2:]
        roots = [signed_root(point.squared, points[0].squared, dof) for point in (low, high)]
        if roots[1] - roots[0] < _BRACKET:
            break
        ends = (float(low.position[index]), float(high.position[index]))
        # Away from the ends, so that the interval shrinks.
        share = float(np.clip((limit - roots[0]) / (roots[1] - roots[0]), 0.2, 0.8))
        target = ends[0] + share * (ends[1] - ends[0])
        point = yield scaled.on_line(high.position, low.position, index, target)
        if not np.isfinite(point.squared):
            break
        beyond = signed_root(point.squared, points[0].squared, dof) > limit
        points[-1:] = [point] if beyond else [point, high]


@dataclass(slots=True, kw_only=True)
class Side:
    """One side of a profile: points from the origin outwards, and how the walk ended."""

    points: list[Point]
    end: End = "interrupted"


# By index among the free parameters, and direction.
Sides = dict[tuple[int, Literal[-1, 1]], Side]
DIRECTIONS: tuple[Literal[-1, 1], ...] = (-1, 1)


def run_together(
    objective: Objective,
    box: Box,
    scaled: Scaled,
    sides: Sides,
    on_batch: Callable[[Sides], None],
    *,
    errors: Floats,
    limit: float,
    dof: float,
) -> None:
    """Run all walks to their ends; minimisations from their next positions are one batch.

    `errors` are standard errors in scaled coordinates, (n_free,); NaN for parameters that are not determined.
    """
    walks = {
        key: walk(scaled, *key, side.points, error=float(errors[key[0]]), limit=limit, dof=dof)
        for key, side in sides.items()
    }
    pending: dict[tuple[int, Literal[-1, 1]], Floats] = {}

    def advance(key: tuple[int, Literal[-1, 1]], point: Point | None) -> None:
        try:
            pending[key] = next(walks[key]) if point is None else walks[key].send(point)
        except StopIteration as ended:
            sides[key].end = ended.value
            pending.pop(key, None)

    for key in walks:
        advance(key, None)
    while pending:
        held = np.array([[index == number for number in range(len(errors))] for index, _ in pending])
        starts = np.array([*pending.values()])
        minima = find_minima(
            objective,
            box,
            scaled.parameters(starts),
            max_iterations=_MOST_ITERATIONS,
            tolerance=_GAIN / max(dof, 1.0),
            held=held,
            damping=_DAMPING,
        )
        # A held parameter is exactly where the walk has put it, also on a bound.
        positions = np.where(held, starts, scaled.position(minima.theta))
        for key, position, misfit in zip([*pending], positions, minima.misfit.tolist(), strict=True):
            advance(key, Point(position=position, squared=misfit**2))
        on_batch(sides)
