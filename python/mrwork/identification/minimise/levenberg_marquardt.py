"""Levenberg-Marquardt method with exact Jacobians for a batch of starts, simulated in lanes.

Residuals and Jacobian come from one simulation, which takes a quarter longer than a simulation of the residuals alone.
A few candidates take as long to simulate as about fifty, because the time steps of a record are sequential. The batch
therefore simulates the Jacobians of all starts together, and likewise all trial steps, several of different damping
for each start. Each start may weigh the tests in its own way, leave out the tests of a fold, or hold parameters.

Steps follow the limit of stiffness, above which a candidate is not simulated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import Count, unchecked
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.coordinates import Box
from mrwork.identification.minimise.stiffness import is_at_stiffness_limit, within_stiffness
from mrwork.identification.minimise.straight import Straight
from mrwork.identification.objective import NormalEquations, Objective, once

# Convergence: relative decrease of the squared misfit in a step, also at the limit of stiffness.
TOLERANCE = 1e-7
_TOLERANCE_AT_LIMIT = 3e-5
# Floor for insensitive parameters; keeps the normal matrix non-singular.
_LEAST_SENSITIVITY = 1e-150
# Factors on the present damping that are tried together.
_DAMPING_FACTORS = (0.1, 1.0, 10.0)
_FIRST_DAMPING = 0.1
# Above this damping steps are too short to lower the misfit: the minimisation has converged.
_MOST_DAMPING = 1e8
# Iterations over which the pace of a start is taken.
_PACED = 5

_misfit = unchecked(Objective.__call__)

OnStep = Callable[[int, float], None]
"""Called with the steps so far and the misfit."""


@array_dataclass()
class LocalMinimum:
    """Result of a local minimisation: parameters (n_params,), misfit, number of steps, whether it converged."""

    theta: Floats
    misfit: float
    steps: int
    converged: bool


@array_dataclass()
class LocalMinima:
    """Results of a batch: parameters (n_starts, n_params), misfits (n_starts,), which converged, iterations."""

    theta: Floats
    misfit: Floats
    converged: NDArray[np.bool_]
    iterations: int

    @property
    def best(self) -> LocalMinimum:
        """The minimum of the least misfit."""
        best = int(np.argmin(self.misfit))
        return LocalMinimum(
            theta=self.theta[best],
            misfit=float(self.misfit[best]),
            steps=self.iterations,
            converged=bool(self.converged[best]),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Hopeless:
    """Rule by which starts are given up, `after` a number of iterations.

    A start is given up where its misfit is more than `factor` times the least one; and once `found` minimisations have
    converged within the share `closeness` above the least misfit, also where it would not fall to that misfit in the
    iterations that are left at the pace of its last ones. Misfits of `earlier` minima count as well.
    """

    after: int
    factor: float
    found: int
    closeness: float
    earlier: tuple[float, ...] = ()

    def of(self, courses: Sequence[Floats], converged: NDArray[np.bool_], left: int) -> NDArray[np.bool_]:
        """Whether each start is hopeless, from the misfits (n_starts,) of all iterations, with this number left."""
        misfit = courses[-1]
        if len(courses) <= max(self.after, _PACED):
            return np.zeros(misfit.shape, dtype=np.bool_)
        ends = np.array([*self.earlier, *misfit[converged]])
        least = min([*self.earlier, float(misfit.min())])
        hopeless = misfit > self.factor * least
        if np.count_nonzero(ends <= (1.0 + self.closeness) * least) >= self.found:
            # A start that cannot be simulated has no pace; it does not run.
            pace = np.subtract(
                courses[-1 - _PACED], misfit, out=np.zeros_like(misfit), where=np.isfinite(misfit)
            )
            hopeless |= misfit - left * pace / _PACED > least
        return np.asarray(hopeless)


def find_minima(
    objective: Objective,
    box: Box,
    starts: Floats,
    *,
    max_iterations: Count,
    tolerance: float = TOLERANCE,
    shares: Floats | None = None,
    held: NDArray[np.bool_] | None = None,
    damping: float = _FIRST_DAMPING,
    hopeless: Hopeless | None = None,
    known: Floats | None = None,
    on_iteration: Callable[[LocalMinima], None] | None = None,
) -> LocalMinima:
    """Minimise the misfit from each start, shape (n_starts, n_params), inside `box`, in one Levenberg-Marquardt batch.

    Damping is relative to the sensitivity of each parameter, the largest so far (Moré, Lecture Notes in Mathematics
    630, 1978, 105-116). The result of a start does not depend on the other starts, unless `hopeless` ones are given up.

    `tolerance`: a start has converged once a step lowers its squared misfit by less than this share. `shares`: those
    of the tests in the squared misfit of each start, shape (n_starts, n_tests), 0 for one that is left out; by default
    the shares of the objective. `held`: free parameters that each start keeps, shape (n_starts, n_free). `damping`: the
    first one, small near a minimum. `hopeless`: rule by which starts are given up. `known`: misfits of the starts,
    (n_starts,), NaN where they are not known. `on_iteration`: called after each iteration with the present points.
    """
    state = _initial(objective, box, starts, shares, damping, known)
    held = np.zeros(state.still.shape, dtype=np.bool_) if held is None else held
    iterations = 0
    courses, coordinates = [state.misfit], Straight(objective.spec, box)
    while iterations < max_iterations and state.running.any():
        iterations += 1
        state = once(
            objective,
            "iteration",
            _State,
            partial(_iterate_once, objective, coordinates, state, tolerance, shares, held),
            tolerance,
            shares,
            held,
            box,
            state.theta,
            state.misfit,
            state.damping,
            state.running,
        )
        courses.append(state.misfit)
        if hopeless is not None:
            given_up = hopeless.of(courses, state.arrived, max_iterations - iterations)
            if given_up.any():
                state = replace(state, running=state.running & ~given_up)
        if on_iteration is not None:
            on_iteration(_minima(state, iterations))
    return _minima(state, iterations)


@array_dataclass()
class _State:
    """State of the batch, one row for each start, as it is recorded in the journal.

    `normal` (matrix) and `gradient` are of the last linearisation, at which the parameters in `still` were held, or on
    a bound that the misfit falls across; `moved` starts have accepted a step since.
    """

    theta: Floats
    misfit: Floats
    damping: Floats
    sensitivity: Floats
    normal: Floats
    gradient: Floats
    still: NDArray[np.bool_]
    moved: NDArray[np.bool_]
    arrived: NDArray[np.bool_]
    running: NDArray[np.bool_]


def _initial(
    objective: Objective,
    box: Box,
    starts: Floats,
    shares: Floats | None,
    damping: float,
    known: Floats | None,
) -> _State:
    theta = np.clip(starts, box.lower, box.upper)
    misfit = np.full(len(theta), np.nan) if known is None else known.copy()
    unknown = np.isnan(misfit) | np.any(theta != starts, axis=1)
    if unknown.any():
        misfit[unknown] = _misfit(objective, theta[unknown], None if shares is None else shares[unknown])
    n_starts, n_free = len(theta), len(box.free)
    return _State(
        theta=theta,
        misfit=misfit,
        damping=np.full(n_starts, damping),
        sensitivity=np.zeros((n_starts, n_free)),
        normal=np.zeros((n_starts, n_free, n_free)),
        gradient=np.zeros((n_starts, n_free)),
        still=np.zeros((n_starts, n_free), dtype=np.bool_),
        moved=np.ones(n_starts, dtype=np.bool_),
        arrived=np.zeros(n_starts, dtype=np.bool_),
        running=np.isfinite(misfit),
    )


def _iterate_once(
    objective: Objective,
    coordinates: Straight,
    state: _State,
    tolerance: float,
    shares: Floats | None,
    held: NDArray[np.bool_],
) -> _State:
    """Linearise at the points that have moved, then try several dampings for every running start.

    Equations of parameters that stand still have zeros, so that their steps are zero.
    """
    new = _State(**{entry.name: getattr(state, entry.name).copy() for entry in fields(state)})
    theta, misfit, damping, normal, gradient = new.theta, new.misfit, new.damping, new.normal, new.gradient
    sensitivity, still, moved, arrived, running = (
        new.sensitivity,
        new.still,
        new.moved,
        new.arrived,
        new.running,
    )
    own_shares = np.repeat(objective.shares[None], len(theta), axis=0) if shares is None else shares
    fresh = np.flatnonzero(running & moved)
    equations = NormalEquations.at(objective, coordinates.box, theta[fresh], own_shares[fresh] > 0.0)
    by_theta, _ = equations.joint(own_shares[fresh])
    still[fresh] = held[fresh] | coordinates.outward(theta[fresh], by_theta)
    equations = equations.by(coordinates.slope(theta[fresh], still[fresh]))
    gradient[fresh], normal[fresh] = equations.joint(own_shares[fresh], still[fresh])
    running[fresh] = np.isfinite(normal[fresh]).all(axis=(1, 2)) & np.isfinite(gradient[fresh]).all(axis=1)
    if not running.any():
        return replace(state, running=running)
    active = np.flatnonzero(running)
    size = np.sqrt(np.diagonal(normal[active], axis1=1, axis2=2))
    sensitivity[active] = np.maximum(sensitivity[active], size)
    floor = 1e-9 * sensitivity[active].max(axis=1, keepdims=True)
    scale = np.maximum(sensitivity[active], np.maximum(floor, _LEAST_SENSITIVITY)) ** 2
    dampings = damping[active, None] * np.array(_DAMPING_FACTORS)
    # (active, factor, free, free)
    damped = normal[active, None] + dampings[..., None, None] * (
        scale[:, None, :, None] * np.eye(gradient.shape[1])
    )
    step = -np.linalg.solve(damped, gradient[active, None, :, None])[..., 0]
    tried, of_forces = within_stiffness(
        objective.compared, coordinates, theta[active], step, damped, still[active]
    )
    before = misfit[active]
    n_tried = len(_DAMPING_FACTORS)
    tried_shares = None if shares is None else np.repeat(shares[active], n_tried, axis=0)
    after = _misfit(objective, tried.reshape(-1, theta.shape[1]), tried_shares).reshape(-1, n_tried)
    best = np.argmin(after, axis=1)
    rows = np.arange(active.size)
    better = after[rows, best] < before
    moved[active] = better
    accepted = active[better]
    theta[accepted] = tried[rows, best][better]
    misfit[accepted] = after[rows, best][better]
    # A model may fit simulated forces exactly.
    decrease = 1.0 - (misfit[active] / np.maximum(before, 1e-300)) ** 2
    enough = decrease < tolerance
    # Where forces are at their best and longer steps leave the limit of stiffness, shorter ones may go along it.
    better &= ~(enough & of_forces[rows, best])
    # A third of the best damping; ten times the largest that was tried where none lowered the misfit.
    factor = np.where(better, np.array(_DAMPING_FACTORS)[best] / 3.0, 100.0)
    damping[active] = np.maximum(damping[active] * factor, 1e-12)
    # What lies beyond the limit is negligible, and so is the rest of a slow way along it.
    slow = np.flatnonzero(~enough & (decrease < _TOLERANCE_AT_LIMIT))
    if slow.size:
        enough[slow] = is_at_stiffness_limit(objective.compared, theta[active[slow]])
    arrived[active] = np.where(better, enough, damping[active] > _MOST_DAMPING)
    running[active] = ~arrived[active]
    return new


def _minima(state: _State, iterations: int) -> LocalMinima:
    return LocalMinima(theta=state.theta, misfit=state.misfit, converged=state.arrived, iterations=iterations)
