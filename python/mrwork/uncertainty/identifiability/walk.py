"""One side of a profile: a parameter is moved away from the fit step by step, the others descend after each step.

A walk is a generator: it yields the position it wants simulated and is sent what is there, so that many walks, each
with another parameter held, share one batch.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.uncertainty.identifiability.curvature import Curvature, Scaled

End = Literal["closed", "bound", "not simulated", "too many points", "interrupted"]

# Steps in the root of the likelihood ratio, which is a straight line where the misfit is a parabola.
_RISE = 0.6
# The next step over the last.
_SHORTEST, _LONGEST = 0.25, 2.5
# Longest first step, for a parameter that the data do not tell, in its own coordinate.
_FIRST = 0.3
# The threshold is crossed between two points; where they are farther apart, there is one more between.
_BRACKET = 0.8
# Aimed at beyond the threshold, so that the last point is not just short of it.
_BEYOND = 0.05
# Expected gain in the likelihood ratio below which a descent has arrived.
_GAIN = 0.01
# A step of this length in a coordinate counts as much as one unit of likelihood ratio: what the data hardly see does
# not leap across its range because a straight line says so.
_LEAP = 0.5
_MOST_TRIALS = 20
_LEAST_DAMPING = 1e-3
_MOST_POINTS = 40
_MOST_BETWEEN = 6
# Of the first step: where even so little cannot be simulated, the walk ends.
_LEAST_SHARE = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """A position, shape (n_free,), with the squared misfit S, half its gradient and J'J there."""

    position: NDArray[np.float64]
    squared: float
    gradient: NDArray[np.float64]
    normal: NDArray[np.float64]


def places(position: NDArray[np.float64], found: Curvature) -> list[Place]:
    """The rows of a batch, one by one."""
    return [
        Place(position=each, squared=float(squared), gradient=gradient, normal=normal)
        for each, squared, gradient, normal in zip(
            position, found.squared, found.gradient, found.normal, strict=True
        )
    ]


Walk = Generator[NDArray[np.float64], Place, End]
Descent = Generator[NDArray[np.float64], Place, Place]


def signed_root(squared: float, least: float, dof: float) -> float:
    """Root of the likelihood ratio `dof ln(S/S_least)`; 0 at the least misfit and below it."""
    return float(np.sqrt(dof * max(np.log(squared / least), 0.0)))


def walk(
    scaled: Scaled, index: int, way: Literal[-1, 1], points: list[Place], *, limit: float, dof: float
) -> Walk:
    """Walk the free parameter `index` up or down from the only one of `points`, to which each new one is added.

    Ends beyond `limit`, the root of the likelihood ratio, with a point closely on either side of it; or on the bound.

    Parameters
    ----------
    dof
        Effective samples less parameters: the likelihood ratio is `dof ln(S/S_least)`.
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
        place = yield from _descended(scaled, index, last, target, dof)
        if not np.isfinite(place.squared):
            step = _SHORTEST * abs(target - here)
            if step < _LEAST_SHARE * first:
                return "not simulated"
            continue
        points.append(place)
        before, after = (signed_root(each.squared, origin.squared, dof) for each in points[-2:])
        if after > limit:
            yield from _bracketed(scaled, index, points, limit, dof)
            return "closed"
        wanted = min(_RISE, limit + _BEYOND - after)
        rise = after - before
        factor = wanted / rise if rise > 0.0 else _LONGEST
        step = abs(target - here) * float(np.clip(factor, _SHORTEST, _LONGEST))
    return "too many points"


def descent(scaled: Scaled, start: Place, dof: float) -> Descent:
    """Descend in all free parameters from a place that was simulated."""
    return _settled(scaled, None, start, dof)


def _bracketed(scaled: Scaled, index: int, points: list[Place], limit: float, dof: float) -> Descent:
    """Put points between the last two until the `limit` is closely between."""
    for _ in range(_MOST_BETWEEN):
        low, high = points[-2:]
        roots = [signed_root(each.squared, points[0].squared, dof) for each in (low, high)]
        if roots[1] - roots[0] < _BRACKET:
            break
        ends = (float(low.position[index]), float(high.position[index]))
        # Not so near an end that the next interval is hardly shorter.
        share = float(np.clip((limit - roots[0]) / (roots[1] - roots[0]), 0.2, 0.8))
        place = yield from _descended(scaled, index, low, ends[0] + share * (ends[1] - ends[0]), dof)
        if not np.isfinite(place.squared):
            break
        beyond = signed_root(place.squared, points[0].squared, dof) > limit
        points[-1:] = [place] if beyond else [place, high]
    return points[-1]


def _descended(scaled: Scaled, index: int, start: Place, target: float, dof: float) -> Descent:
    """Descend with the parameter held at `target`, from where the curvature at `start` expects the others."""
    step, _ = _step(scaled, start, index, dof, shift=target - float(start.position[index]))
    position = scaled.moved(start.position, step, index)
    position[index] = target
    place = yield position
    if np.isfinite(place.squared):
        place = yield from _settled(scaled, index, place, dof)
    return place


def _settled(scaled: Scaled, index: int | None, place: Place, dof: float) -> Descent:
    """Levenberg-Marquardt, damping relative to the curvature of each parameter, until little more is to be gained."""
    damping = 0.0
    for _ in range(_MOST_TRIALS):
        step, fall = _step(scaled, place, index, dof, damping=damping)
        if dof * fall < _GAIN * place.squared:
            break
        trial = yield scaled.moved(place.position, step, index)
        if trial.squared < place.squared:
            place = trial
            damping = damping / 10.0 if damping > _LEAST_DAMPING else 0.0
        else:
            damping = max(10.0 * damping, _LEAST_DAMPING)
    return place


def _step(
    scaled: Scaled,
    place: Place,
    index: int | None,
    dof: float,
    *,
    shift: float = 0.0,
    damping: float = 0.0,
) -> tuple[NDArray[np.float64], float]:
    """The step to where the others are best once `index` is shifted, and by how much S should fall.

    A parameter that would leave its range goes to the bound, and those that are left are sought again.
    """
    step = np.zeros_like(place.position)
    settled = np.diag(place.normal) <= 0.0
    if index is not None:
        step[index], settled[index] = shift, True
    ridge = place.squared / dof / _LEAP**2
    while not settled.all():
        moving = np.flatnonzero(~settled)
        size = np.sqrt(np.diag(place.normal)[moving])
        unit = place.normal[np.ix_(moving, moving)] / np.outer(size, size)
        unit += np.diag(damping + ridge / size**2)
        gradient = place.gradient + place.normal @ np.where(settled, step, 0.0)
        step[moving] = np.linalg.solve(unit, -gradient[moving] / size) / size
        there = place.position + step
        leaving = ~settled & ((there < scaled.lower) | (there > scaled.upper))
        if not leaving.any():
            break
        step[leaving] = (np.clip(there, scaled.lower, scaled.upper) - place.position)[leaving]
        settled |= leaving
    return step, -float(2.0 * place.gradient @ step + step @ place.normal @ step)


def _first_step(origin: Place, index: int, dof: float) -> float:
    """Half a standard error, or what is small for a parameter that the data do not tell."""
    size = np.sqrt(np.diag(origin.normal))
    if size[index] == 0.0:
        return _FIRST
    size[size == 0.0] = 1.0
    inverse = np.linalg.pinv(origin.normal / np.outer(size, size), rcond=1e-12)
    error = np.sqrt(origin.squared / dof * max(float(inverse[index, index]), 1e-300)) / size[index]
    return float(min(0.5 * error, _FIRST))
