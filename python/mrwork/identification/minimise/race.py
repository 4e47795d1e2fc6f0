"""Global search of starting points: a race of unlike routes, which goes on until two of them agree.

A route draws starts, from which local minimisations (Levenberg-Marquardt) lead to minima. One route alone may return
to a false minimum for ever, because all its starts come from one place. The least minimum is believed only where two
routes that share neither starts nor bounds have met it and the last round has found none below it.

Stiff candidates cost most and are rarely better, so minimisations first stay below a limit of stiffness. What ends at
that limit is looked past: minimisations go on from it without the limit. Others start from the best minimum with some
of its parameters replaced, so that one on a bound is left if a better one is beyond.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import median

import numpy as np

from mrwork.base.arguments import Seed
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.coordinates import Box
from mrwork.identification.fit import SearchTrace
from mrwork.identification.fit_progress import Found, Identifying, OnSearch
from mrwork.identification.minimise.levenberg_marquardt import Hopeless, LocalMinima, find_minima
from mrwork.identification.minimise.stiffness import (
    is_at_stiffness_limit,
    log_stiffness,
    nearest_below_stiffness,
)
from mrwork.identification.minimise.straight import Straight
from mrwork.identification.objective import NormalEquations, Objective, friction_limit, up_to
from mrwork.identification.settings import Race
from mrwork.search.unit_cube import Streams, latin_hypercube

# Misfits of one minimum differ by less than this share of the least, within limits of 0.002 and 0.04 points.
_SAME_MINIMUM, _SAME_LEAST, _SAME_MOST = 0.02, 2e-5, 4e-4
# After so many iterations the best starts that are still apart, in unit coordinates, go on: this share of them, and of
# those that look past the best minimum.
_FIRST_ITERATIONS = 3
_GO_ON, _GO_ON_PAST = 0.4, 0.6
_APART = 1e-3
# Where candidates take few time steps more starts take hardly longer: up to this multiple within so many steps.
_MORE = 4
_CHEAP = 6e5
# Relative decrease of the squared misfit at which a local minimisation of the search ends; the final fit continues.
_TOLERANCE = 1e-5
_MOST_ITERATIONS = 60
_BEHIND = Hopeless(after=8, factor=3.0, found=2, closeness=1e-3)
# Points of a round that go on beyond the limit of stiffness, if their misfit is below this multiple of the least;
# iterations and tolerance. Starts from the best that are stiff at once are up to this far above it, in logarithms.
_MOST_BEYOND = 3
_MOST_STIFF = 3
_STIFFEST_PAST = 3.5
_PROMISING = 2.0
_BEYOND_ITERATIONS = 16
_BEYOND_TOLERANCE = 1e-4
# Stiffer loops are worth their cost if the misfit falls by this with them, or by this share of it.
_MEASURABLE = 4e-4
_MEASURABLE_SHARE = 0.02
# Starts from the best minimum, and the share of its parameters that are replaced.
_CROSSED = 12
_REPLACED = 0.3
_PAST = "the best minimum with other parameters"
# Minima that differ by more than this in a unit coordinate are fitted too, up to this number and excess of the misfit.
_DISTANT = 0.05
_MOST_DISTINCT = 3
_CLOSE = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Route:
    """A route of a race: what it is in words, and the starts that it draws in a round, shape (n_starts, n_params)."""

    name: str
    draw: Callable[[int], Floats]


@array_dataclass()
class Raced:
    """Minima of a race, best first, shape (n_minima, n_params), with misfits (n_minima,), and the trace.

    `another` is the one, if any, that is less on whole tests than the best one of the parts, shape (0 or 1, n_params).
    `objective` has the limit of stiffness within which they were found: none where stiffer candidates are better.
    `doubt` says why a lower minimum is possible, with what was tried; it is empty where two routes agree.
    """

    objective: Objective
    theta: Floats
    misfit: Floats
    another: Floats
    trace: SearchTrace
    doubt: str


def in_round(settings: Race, number: int) -> Race:
    """The settings of a round, counted from 0: samples, starts and generations double with each."""
    times = 2 ** max(number - 1, 0)
    return replace(
        settings,
        samples=times * settings.samples,
        starts=times * settings.starts,
        generations=times * settings.generations,
    )


def race(
    objective: Objective,
    box: Box,
    routes: Sequence[Route],
    settings: Race,
    *,
    searched: Box,
    rng: Seed,
    whole: Objective | None = None,
    on_search: OnSearch = lambda found: None,
) -> Raced:
    """Minima inside `box` by the routes, in rounds until two routes agree or the budget of steps is spent.

    Replaced parameters are drawn from the `searched` ranges. The minima of parts of tests are compared on the `whole`
    of these too, if it is given: a part may take one for another. Without any minimum `theta` is empty.
    """
    course = _Course(
        objective=objective,
        low=up_to(objective, min(friction_limit(objective.tests), objective.stiffest)),
        box=box,
        settings=settings,
        on_search=on_search,
        theta=np.empty((0, len(box.names))),
        began=objective.tally.steps,
    )
    random = np.random.default_rng([rng, len(routes)])
    names = [route.name for route in routes]
    for number in range(settings.most_rounds):
        course.round = number
        before = course.least
        course.descend({route.name: route.draw(number) for route in routes} | course.past(searched, random))
        course.go_beyond(_MOST_BEYOND)
        agreed, spent = course.is_agreed(names, before), course.spent > settings.most_steps
        if agreed or spent or number + 1 == settings.most_rounds:
            course.descend(course.past(searched, random))
            course.go_beyond(_MOST_STIFF)
            agreed = course.is_agreed(names, before)
        if agreed or spent:
            break
    reason = "agreed" if agreed else "max_steps" if spent else "max_rounds"
    course.come_below()
    return course.result(reason, names, whole)


def same_minimum(least: float) -> float:
    """The largest misfit of a point that has met the minimum of this misfit."""
    return least + min(max(_SAME_MINIMUM * least, _SAME_LEAST), _SAME_MOST)


def minima_from(
    objective: Objective,
    box: Box,
    starts: Floats,
    *,
    on_iteration: Callable[[LocalMinima], None] | None = None,
) -> Floats:
    """The `distinct_minima` that local minimisations from starts, (n_starts, n_params), reach in one batch."""
    minima = find_minima(
        objective,
        box,
        starts,
        max_iterations=_MOST_ITERATIONS,
        tolerance=_TOLERANCE,
        hopeless=_BEHIND,
        on_iteration=on_iteration,
    )
    return distinct_minima(box, *best_first(minima.theta, minima.misfit))


def report_minima(call: Identifying, fitted: str, trace: SearchTrace, minima: LocalMinima) -> None:
    """Report local minimisations of what is `fitted`, from starts that a search with this trace has found."""
    best = minima.best
    call.so_far = lambda: (best.theta, trace)
    call.on_steps("screening", best.steps, best.misfit, fitted)


def distinct_minima(box: Box, theta: Floats, misfit: Floats) -> Floats:
    """The best minimum, and up to two distant ones whose misfit is at most 1 % larger, as rows, best first."""
    unit = np.asarray(box.unit_from_theta(theta))
    return theta[_apart(unit[misfit <= (1.0 + _CLOSE) * misfit[0]], _DISTANT, _MOST_DISTINCT)]


def best_first(theta: Floats, misfit: Floats) -> tuple[Floats, Floats]:
    """Minima, (n_minima, n_params), with their misfits, sorted by these."""
    order = np.argsort(misfit, kind="stable")
    return theta[order], misfit[order]


def _apart(unit: Floats, distance: float, most: int) -> list[int]:
    """Indices of at most so many rows, in their order, that differ by more than `distance` in a coordinate."""
    taken: list[int] = []
    for index, point in enumerate(unit):
        if len(taken) < most and np.all(np.abs(unit[taken] - point).max(axis=1) > distance):
            taken.append(index)
    return taken


def with_best_forces(objective: Objective, box: Box, theta: Floats) -> tuple[Floats, Floats]:
    """Points, (n_points, n_params), with their forces at the best fit, and their misfits, which may be infinite.

    The force is linear in most parameters whose unit contains the newton: one step of linear least squares finds them.
    Candidates are thus compared by the shape of their loops. A point that is no better with the step keeps its own.
    """
    theta = np.clip(theta, box.lower, box.upper)
    every = np.ones((len(theta), len(objective.compared)), dtype=np.bool_)
    coordinates = Straight(objective.spec, box)
    equations = NormalEquations.at(objective, box, theta, every, coordinates.of_force)
    shares = np.tile(objective.shares, (len(theta), 1))
    before = np.sqrt(np.einsum("rt,rt->r", shares, equations.squared))
    held = np.tile(~coordinates.of_force, (len(theta), 1))
    equations = equations.by(coordinates.slope(theta, held))
    simulated = np.isfinite(before) & np.isfinite(equations.joint(shares)[1]).all(axis=(1, 2))
    if held.all() or not simulated.any():
        return theta, before
    equations, shares, held = equations[simulated], shares[simulated], held[simulated]
    steps = equations.steps(shares, held)
    down, least = coordinates.far_down(theta[simulated], steps)
    if down.any():
        steps = equations.steps(shares, held | down, least)
    moved = coordinates.after(theta[simulated], held, steps[:, None])[:, 0]
    after = objective(moved)
    better = after < before[simulated]
    rows = np.flatnonzero(simulated)[better]
    theta[rows], before[rows] = moved[better], after[better]
    return theta, before


def draw_samples(
    objective: Objective,
    box: Box,
    sampled: Box,
    settings: Race,
    *,
    rng: Seed,
    number: int,
    laws_of: Callable[[Floats], Floats] = lambda theta: theta,
) -> Floats:
    """Starts of a round from samples of the box `sampled`, whose parameters `laws_of` maps, (n_starts, n_params).

    Half are the best samples, the others any that can be simulated.
    """
    settings, n_params, began = in_round(settings, number), len(sampled.free), objective.tally.steps
    count = settings.samples * n_params
    unit = latin_hypercube(Streams(rng=rng, generation=number), count, n_params)
    drawn = laws_of(np.asarray(sampled.theta_from_unit(unit)))
    theta, misfit = with_best_forces(objective, box, drawn)
    order = np.argsort(misfit, kind="stable")[: np.count_nonzero(np.isfinite(misfit))]
    steps = max(objective.tally.steps - began, 1) / count
    half = int(np.clip(_CHEAP / steps, settings.starts, _MORE * settings.starts)) // 2
    # Samples are in random order. Some with the forces that were drawn lead elsewhere than those with the best ones.
    others = np.sort(order[half:])[:half]
    return np.concatenate([theta[order[:half]], theta[others[::2]], drawn[others[1::2]]])


@dataclass(slots=True, kw_only=True)
class _Course:
    """A race that runs: minima so far with the routes that have met each, and the trace of their misfits.

    `low` is the objective below the limit of stiffness, where minimisations start; `began` the steps before the race.
    `stiff` are starts above the limit by route, with their misfits where known, `left` the unit coordinates of points
    that have gone on beyond it, and `beyond` where each has led, with its misfit and the routes that have met it.
    `leader` is the best point of the trace.
    """

    objective: Objective
    low: Objective
    box: Box
    settings: Race
    on_search: OnSearch
    theta: Floats
    began: int
    misfit: Floats = field(default_factory=lambda: np.empty(0))
    routes: list[str] = field(default_factory=list)
    stiff: list[tuple[str, Floats, Floats]] = field(default_factory=list)
    left: Floats = field(init=False)
    beyond: list[tuple[Floats, float, set[str]]] = field(default_factory=list)
    leader: Floats | None = None
    evaluations: list[int] = field(default_factory=list)
    best: list[float] = field(default_factory=list)
    median: list[float] = field(default_factory=list)
    round: int = 0

    def __post_init__(self) -> None:
        self.left = np.empty((0, len(self.box.free)))

    @property
    def spent(self) -> int:
        """Time steps that the race has simulated."""
        return self.objective.tally.steps - self.began

    @property
    def least(self) -> float:
        """The least misfit, infinite without a minimum."""
        return float(np.min(self.misfit, initial=math.inf))

    @property
    def found_by(self) -> frozenset[str]:
        """Routes that have met the least minimum."""
        same = np.flatnonzero(self.misfit <= same_minimum(self.least))
        return frozenset(self.routes[index] for index in same)

    def is_agreed(self, routes: Sequence[str], before: float) -> bool:
        """Whether two of the routes have met the least minimum, for sure or again after the rounds before."""
        met = self.misfit[np.isin(self.routes, routes)] <= same_minimum(self.least)
        is_sure = self.spent * np.count_nonzero(met) > self.settings.sure_steps * met.size
        again = before <= same_minimum(self.least)
        return len(self.found_by & {*routes}) > 1 and bool(again or is_sure)

    def descend(self, drawn: Mapping[str, Floats]) -> None:
        """Keep the minima to which starts of each route lead below the limit of stiffness, and starts above it."""
        starts, routes = np.empty((0, len(self.box.names))), []
        for route, theta in drawn.items():
            theta = np.asarray(self.box.inside(theta)) if len(theta) else theta
            stiff = log_stiffness(self.low.compared, theta).max(axis=1, initial=-math.inf) > 0.0
            above = theta[stiff][:_MOST_STIFF]
            self.stiff.append((route, above, np.full(len(above), np.nan)))
            starts = np.concatenate([starts, theta[~stiff]])
            routes += [route] * int(np.count_nonzero(~stiff))
        if not routes:
            return
        label = " and ".join(dict.fromkeys(routes))
        first = self._minimise(self.low, starts, label, _FIRST_ITERATIONS)
        taken = [row for route in dict.fromkeys(routes) for row in self._to_go_on(first, routes, route)]
        if taken:
            starts, known = first.theta[taken], first.misfit[taken]
            last = self._minimise(self.low, starts, label, self.settings.most_iterations, known)
            self._keep(last.theta, last.misfit, [routes[row] for row in taken])

    def _to_go_on(self, first: LocalMinima, routes: Sequence[str], route: str) -> list[int]:
        """Rows of a route that go on after the first iterations: the best that are still apart."""
        mine = np.equal(routes, route)
        rows = np.flatnonzero(mine & np.isfinite(first.misfit))
        rows = rows[np.argsort(first.misfit[rows], kind="stable")]
        if not rows.size:
            return []
        share = _GO_ON_PAST if route == _PAST else _GO_ON
        most = max(5, int(share * np.count_nonzero(mine)))
        unit = np.asarray(self.box.unit_from_theta(first.theta[rows]))
        return [int(row) for row in rows[_apart(unit, _APART, most)]]

    def past(self, searched: Box, random: np.random.Generator) -> dict[str, Floats]:
        """Starts from the best minimum, if any, with some of its parameters replaced, or near a limit of the model."""
        if not self.misfit.size:
            return {}
        best = self.theta[int(np.argmin(self.misfit))]
        samples = np.asarray(searched.theta_from_unit(random.random((_CROSSED, len(searched.free)))))
        crossed = np.where(random.random(samples.shape) < _REPLACED, samples, best)
        limits = Straight(self.low.spec, self.box).limits(best, random)
        drawn = np.concatenate([crossed, limits])
        stiffness = log_stiffness(self.low.compared, drawn).max(axis=1)
        stiff = drawn[(stiffness > 0.0) & (stiffness < _STIFFEST_PAST)]
        theta, misfit = best_first(*with_best_forces(self.objective, self.box, stiff))
        best = np.flatnonzero(np.isfinite(misfit))[:_MOST_STIFF]
        self.stiff.append((_PAST, theta[best], misfit[best]))
        theta, misfit = with_best_forces(self.low, self.box, drawn[stiffness <= 0.0])
        return {_PAST: theta[np.isfinite(misfit)]}

    def go_beyond(self, most: int) -> None:
        """Minimise without the limit of stiffness from minima at it, and from stiff starts, so many new ones at most.

        Routes that have met one minimum at the limit have met where it leads.
        """
        at_limit = is_at_stiffness_limit(self.low.compared, self.theta)
        rows = np.flatnonzero(at_limit & (self.misfit <= _PROMISING * self.least))
        rows = rows[np.argsort(self.misfit[rows], kind="stable")]
        starts = np.concatenate([self.theta[rows], *(theta for _, theta, _ in self.stiff)])
        known = np.concatenate([self.misfit[rows], *(misfit for _, _, misfit in self.stiff)])
        routes = [self.routes[row] for row in rows] + [route for route, theta, _ in self.stiff for _ in theta]
        self.stiff = []
        if not routes:
            return
        unit = np.asarray(self.box.unit_from_theta(starts))
        n_before = len(self.left)
        taken = _apart(np.concatenate([self.left, unit]), _DISTANT, n_before + most)[n_before:]
        new = np.array(taken, dtype=np.intp) - n_before
        if new.size:
            ended = find_minima(
                self.objective,
                self.box,
                starts[new],
                known=known[new],
                max_iterations=_BEYOND_ITERATIONS,
                tolerance=_BEYOND_TOLERANCE,
                hopeless=replace(_BEHIND, after=5, factor=1.5, earlier=(self.least, self.least)),
                on_iteration=lambda minima: self._tell(minima, "stiffer loops"),
            )
            self.left = np.concatenate([self.left, unit[new]])
            self.beyond += [
                (theta, misfit, set()) for theta, misfit in zip(ended.theta, ended.misfit, strict=True)
            ]
        for point, route in zip(unit, routes, strict=True):
            for index in np.flatnonzero(np.abs(self.left - point).max(axis=1) <= _DISTANT):
                theta, misfit, met_by = self.beyond[index]
                if route not in met_by and np.isfinite(misfit):
                    met_by.add(route)
                    self._keep(theta[None], np.array([misfit]), [route])

    def come_below(self) -> None:
        """Minimise below the limit of stiffness from the best minimum, where that is above it."""
        if self.misfit.size:
            best = self.theta[[int(np.argmin(self.misfit))]]
            if log_stiffness(self.low.compared, best).max() > 0.0:
                below = nearest_below_stiffness(self.low.compared, self.box, best)
                ended = self._minimise(self.low, below, "", self.settings.most_iterations)
                self._keep(ended.theta, ended.misfit, [""])

    def _minimise(
        self, objective: Objective, starts: Floats, route: str, iterations: int, known: Floats | None = None
    ) -> LocalMinima:
        return find_minima(
            objective,
            self.box,
            starts,
            known=known,
            max_iterations=iterations,
            tolerance=_TOLERANCE,
            hopeless=replace(_BEHIND, earlier=(self.least,) if self.misfit.size else ()),
            on_iteration=lambda minima: self._tell(minima, route),
        )

    def _keep(self, theta: Floats, misfit: Floats, routes: list[str]) -> None:
        fine = np.flatnonzero(np.isfinite(misfit))
        self.theta = np.concatenate([self.theta, theta[fine]])
        self.misfit = np.concatenate([self.misfit, misfit[fine]])
        self.routes += [routes[index] for index in fine]

    def _tell(self, minima: LocalMinima, route: str) -> None:
        """Note the misfits of an iteration, and report what is found so far."""
        best, finite = minima.best, minima.misfit[np.isfinite(minima.misfit)]
        if not finite.size:
            return
        if self.leader is None or best.misfit < self.best[-1]:
            self.leader = best.theta
        leader = self.leader
        self.evaluations.append(self.objective.tally.simulations)
        self.best.append(min([*self.best[-1:], best.misfit]))
        self.median.append(median(finite.tolist()))
        share = min((self.round + 0.5) / self.settings.most_rounds, 1.0)
        self.on_search(Found(best=lambda: leader, trace=self._trace(""), share=share, route=route))

    def _trace(self, reason: str) -> SearchTrace:
        return SearchTrace(
            evaluations=tuple(self.evaluations),
            best=tuple(self.best),
            median=tuple(self.median),
            stop_reason=reason,
            ends=tuple(np.sort(self.misfit).tolist()),
        )

    def result(self, reason: str, routes: Sequence[str], whole: Objective | None) -> Raced:
        """The minima, without those beyond the limit of stiffness where these are hardly better."""
        another = self._least_on(whole)
        met_by = self.found_by if another is None else self._near(another)
        met = [route for route in routes if route in met_by]
        below = log_stiffness(self.low.compared, self.theta).max(axis=1, initial=-math.inf) <= 0.0
        least_below = float(np.min(self.misfit[below], initial=math.inf))
        objective, kept = self.objective, np.ones_like(below)
        if least_below - self.least <= min(_MEASURABLE, _MEASURABLE_SHARE * self.least):
            kept = below
            if another is None or below[another]:
                objective = self.low
        theta, misfit = best_first(self.theta[kept], self.misfit[kept])
        return Raced(
            objective=objective,
            theta=theta,
            misfit=misfit,
            another=self.theta[[] if another is None else [another]],
            trace=self._trace(reason),
            doubt="" if reason == "agreed" and len(met) > 1 else self._doubt(routes, met),
        )

    def _least_on(self, whole: Objective | None) -> int | None:
        """The promising minimum that is visibly less on whole tests than the least one of their parts, if any."""
        if whole is None or not self.misfit.size:
            return None
        promising = np.flatnonzero(self.misfit <= _PROMISING * self.least)
        rows = promising[np.argsort(self.misfit[promising], kind="stable")]
        rows = rows[_apart(np.asarray(self.box.unit_from_theta(self.theta[rows])), _DISTANT, len(rows))]
        resolved = nearest_below_stiffness(whole.compared, self.box, self.theta[rows])
        on_whole = up_to(whole, self.objective.stiffest)(resolved)
        best = int(np.argmin(on_whole))
        return None if on_whole[0] <= same_minimum(float(on_whole[best])) else int(rows[best])

    def _near(self, index: int) -> set[str]:
        """Routes that have met a minimum."""
        unit = np.asarray(self.box.unit_from_theta(self.theta))
        near = np.abs(unit - unit[index]).max(axis=1) <= _DISTANT
        same = np.flatnonzero(near & (self.misfit <= same_minimum(float(self.misfit[index]))))
        return {self.routes[each] for each in same}

    def _doubt(self, routes: Sequence[str], met: Sequence[str]) -> str:
        rounds = f"{self.round + 1} round{'s' if self.round else ''}"
        tried = f"in {rounds} of {' and '.join(routes)}, with {self.spent:.2g} time steps"
        if len(met) > 1:
            return f"the last round found it below that of the rounds before, {tried}"
        return f"only {met[0] if met else 'starts near it'} met the least one, {tried}"
