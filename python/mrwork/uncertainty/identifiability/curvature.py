"""Scaled coordinates of the free parameters, the squared misfit with its curvature in them, and walks along a profile.

On one side of a profile one parameter is stepped away from the fit, and the others are refitted after each step. A walk
is a generator: it yields the position to be simulated and receives the result, so that the walks of all parameters
share one batch.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec
from mrwork.identification.objective import Objective, linearise_residuals
from mrwork.identification.verdicts import Scale

# Largest number of residual entries in one batch.
_LARGEST_BATCH = 2**24

# Residuals (n_residuals,) and their derivative (n_residuals, n_free) with respect to the free parameters, at each row
# of theta (n_batch, n_params).
Linearise = Callable[[Floats], Iterable[tuple[Floats, Floats]]]


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

    def move_position(self, position: Floats, step: Floats, held: int) -> Floats:
        """Position after a step, clipped to the box; the step of a spring is one in k and k x0, unless x0 is held."""
        there = position + step
        if self.spring is not None and held != self.spring[1]:
            stiffness, free = self.spring
            if there[stiffness] != 0.0:
                offset = position[stiffness] * there[free] + position[free] * step[stiffness]
                there[free] = offset / there[stiffness]
        return np.asarray(np.clip(there, self.lower, self.upper))

    def slope(self, position: Floats) -> Floats:
        """Derivative of each free parameter with respect to its coordinate, shape (..., n_free)."""
        return np.asarray(np.where(self.log, self.values(position), self.size))


@array_dataclass()
class Point:
    """A position, shape (n_free,), with the squared misfit S, half its gradient and J'J there."""

    position: Floats
    squared: float
    gradient: Floats
    normal: Floats


def points_at(linearise: Linearise, scaled: Scaled, position: Floats) -> list[Point]:
    """A point for each row of `position`, shape (n_rows, n_free); S is infinite where a simulation failed."""
    points = []
    for row, (residuals, jacobian), slope in zip(
        position, linearise(scaled.parameters(position)), scaled.slope(position), strict=True
    ):
        derivative = jacobian * slope
        squared = float(residuals @ residuals)
        points.append(
            Point(
                position=row,
                # All residuals of a failed simulation are 1.
                squared=squared if squared < residuals.size else np.inf,
                gradient=derivative.T @ residuals,
                normal=derivative.T @ derivative,
            )
        )
    return points


def linearise(objective: Objective, columns: Sequence[int]) -> Linearise:
    """Residuals and exact derivatives with respect to columns of theta, in batches of limited size."""
    rows = max(1, _LARGEST_BATCH // ((len(columns) + 1) * objective.n_time))

    def in_chunks(theta: Floats) -> Iterator[tuple[Floats, Floats]]:
        for first in range(0, len(theta), rows):
            residuals, jacobian = linearise_residuals(objective, theta[first : first + rows], columns)
            for residual, slope in zip(residuals, jacobian, strict=True):
                yield residual, slope.T

    return in_chunks


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
# Expected gain in the likelihood ratio below which a local minimisation has converged.
_GAIN = 0.01
# Ridge: a step of this length in a coordinate costs one unit of likelihood ratio, which limits the steps of insensitive
# parameters.
_LEAP = 0.5
_MOST_TRIALS = 20
_LEAST_DAMPING = 1e-3
_MOST_POINTS = 40
_MOST_BETWEEN = 6
# Smallest step as a share of the first; the walk ends where even this cannot be simulated.
_LEAST_SHARE = 1e-3


Walk = Generator[Floats, Point, End]
Minimisation = Generator[Floats, Point, Point]


def signed_root(squared: float, least: float, dof: float) -> float:
    """Root of the likelihood ratio `dof ln(S/S_least)`; 0 at and below the least misfit."""
    return float(np.sqrt(dof * max(np.log(squared / least), 0.0)))


def walk(
    scaled: Scaled, index: int, way: Literal[-1, 1], points: list[Point], *, limit: float, dof: float
) -> Walk:
    """Step the free parameter `index` up or down from the first of `points`, to which each new point is appended.

    Ends beyond `limit`, in the root of the likelihood ratio, with points close to it on either side; or on the bound.
    """
    (origin,) = points
    bound = float(scaled.upper[index] if way > 0 else scaled.lower[index])
    step = first = _first_step(origin, index, dof)
    while len(points) < _MOST_POINTS:
        last = points[-1]
        here = float(last.position[index])
        if here == bound:
            return "bound"
        target = here + way * step
        if way * (bound - target) <= 0.0:
            target = bound
        point = yield from _minimise_held(scaled, index, last, target, dof)
        if not np.isfinite(point.squared):
            step = _SHORTEST * abs(target - here)
            if step < _LEAST_SHARE * first:
                return "not simulated"
            continue
        points.append(point)
        before, after = (signed_root(point.squared, origin.squared, dof) for point in points[-2:])
        if after > limit:
            yield from _bracket_limit(scaled, index, points, limit, dof)
            return "closed"
        aimed = min(_RISE, limit + _BEYOND - after)
        rise = after - before
        factor = aimed / rise if rise > 0.0 else _LONGEST
        step = abs(target - here) * float(np.clip(factor, _SHORTEST, _LONGEST))
    return "too many points"


def _bracket_limit(scaled: Scaled, index: int, points: list[Point], limit: float, dof: float) -> Minimisation:
    for _ in range(_MOST_BETWEEN):
        low, high = points[-2:]
        roots = [signed_root(point.squared, points[0].squared, dof) for point in (low, high)]
        if roots[1] - roots[0] < _BRACKET:
            break
        ends = (float(low.position[index]), float(high.position[index]))
        # Away from the ends, so that the interval shrinks.
        share = float(np.clip((limit - roots[0]) / (roots[1] - roots[0]), 0.2, 0.8))
        point = yield from _minimise_held(scaled, index, low, ends[0] + share * (ends[1] - ends[0]), dof)
        if not np.isfinite(point.squared):
            break
        beyond = signed_root(point.squared, points[0].squared, dof) > limit
        points[-1:] = [point] if beyond else [point, high]
    return points[-1]


def _minimise_held(scaled: Scaled, index: int, start: Point, target: float, dof: float) -> Minimisation:
    """Minimise with the parameter held at `target`, from the prediction of the quadratic model at `start`."""
    step, _ = _step(scaled, start, index, dof, shift=target - float(start.position[index]))
    position = scaled.move_position(start.position, step, index)
    position[index] = target
    point = yield position
    if np.isfinite(point.squared):
        point = yield from _minimise(scaled, index, point, dof)
    return point


def _minimise(scaled: Scaled, index: int, point: Point, dof: float) -> Minimisation:
    """Levenberg-Marquardt in all free parameters but the one at `index`, until the expected gain is small."""
    damping = 0.0
    for _ in range(_MOST_TRIALS):
        step, fall = _step(scaled, point, index, dof, damping=damping)
        if dof * fall < _GAIN * point.squared:
            break
        trial = yield scaled.move_position(point.position, step, index)
        if trial.squared < point.squared:
            point = trial
            damping = damping / 10.0 if damping > _LEAST_DAMPING else 0.0
        else:
            damping = max(10.0 * damping, _LEAST_DAMPING)
    return point


def _step(
    scaled: Scaled, point: Point, index: int, dof: float, *, shift: float = 0.0, damping: float = 0.0
) -> tuple[Floats, float]:
    """Minimiser of the quadratic model with `index` shifted, and the expected decrease of S; bounds are kept."""
    step = np.zeros_like(point.position)
    settled = np.diag(point.normal) <= 0.0
    step[index], settled[index] = shift, True
    ridge = point.squared / dof / _LEAP**2
    while not settled.all():
        moving = np.flatnonzero(~settled)
        size = np.sqrt(np.diag(point.normal)[moving])
        unit = point.normal[np.ix_(moving, moving)] / np.outer(size, size)
        unit += np.diag(damping + ridge / size**2)
        gradient = point.gradient + point.normal @ np.where(settled, step, 0.0)
        step[moving] = np.linalg.solve(unit, -gradient[moving] / size) / size
        there = point.position + step
        leaving = ~settled & ((there < scaled.lower) | (there > scaled.upper))
        if not leaving.any():
            break
        step[leaving] = (np.clip(there, scaled.lower, scaled.upper) - point.position)[leaving]
        settled |= leaving
    return step, -float(2.0 * point.gradient @ step + step @ point.normal @ step)


def _first_step(origin: Point, index: int, dof: float) -> float:
    """Half a standard error, limited for insensitive parameters."""
    size = np.sqrt(np.diag(origin.normal))
    if size[index] == 0.0:
        return _FIRST
    size[size == 0.0] = 1.0
    inverse = np.linalg.pinv(origin.normal / np.outer(size, size), rcond=1e-12)
    error = np.sqrt(origin.squared / dof * max(float(inverse[index, index]), 1e-300)) / size[index]
    return float(min(0.5 * error, _FIRST))


@dataclass(slots=True, kw_only=True)
class Side:
    """One side of a profile: points from the origin outwards, and how the walk ended."""

    points: list[Point]
    end: End = "interrupted"


# By index among the free parameters, and direction.
Sides = dict[tuple[int, Literal[-1, 1]], Side]
DIRECTIONS: tuple[Literal[-1, 1], ...] = (-1, 1)


def run_together(
    scaled: Scaled,
    sides: Sides,
    simulated: Callable[[Floats], list[Point]],
    on_batch: Callable[[Sides], None],
    *,
    limit: float,
    dof: float,
) -> None:
    """Run all walks to their ends; their next positions make one batch."""
    walks = {key: walk(scaled, *key, side.points, limit=limit, dof=dof) for key, side in sides.items()}
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
        points = simulated(np.array(list(pending.values())))
        for key, point in zip(list(pending), points, strict=True):
            advance(key, point)
        on_batch(sides)
