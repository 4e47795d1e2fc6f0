"""Starting points of a plain model: by a race of routes on excerpts of the tests, or by an optimiser."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box
from mrwork.errors import SimulationError
from mrwork.identification.commands import excerpts_of
from mrwork.identification.equivalent import search_box, widened
from mrwork.identification.fit import SearchTrace
from mrwork.identification.fit_progress import EXCERPTS, Found, Identifying, OnSearch, part_of
from mrwork.identification.minimise.polish import StartingPoints, no_simulation
from mrwork.identification.minimise.race import (
    Route,
    draw_samples,
    in_round,
    minima_from,
    race,
    report_minima,
)
from mrwork.identification.objective import Objective, friction_limit, up_to
from mrwork.identification.problem import Problem
from mrwork.identification.settings import Race

if TYPE_CHECKING:
    from mrwork.search import Optimiser, SearchResult
    from mrwork.search.course import State

# Largest number of starting points of an optimiser.
_STARTS = 16
# Multiple of the limit of stiffness up to which a population of a later round is simulated; minimisations go beyond it.
_STIFFER = 3.0
SAMPLES = "local minimisations from samples"
POPULATION = "a population of differential evolution"
"""What the routes of a plain model are, in words."""


def points_from_race(problem: Problem, search: Race, *, call: Identifying) -> StartingPoints:
    """The best minima of a race on excerpts of the tests, and whether its routes agree."""
    form, rng = problem.form, problem.settings.rng
    # The loops of a few cycles are sufficient to find the minima; the final fit compares all samples.
    objective = problem.objective.on(form.spec, excerpts_of(problem))
    on_search = part_of(call.on_search, 0.0, 1.0, fitted=EXCERPTS)
    raced = race(
        objective,
        form.box,
        plain_routes(objective, form.box, search, rng=rng, on_search=on_search),
        search,
        searched=search_box(form.spec, form.box, objective.tests),
        rng=rng,
        whole=problem.objective,
        on_search=on_search,
    )
    return StartingPoints.of_race(raced, form)


def plain_routes(
    objective: Objective,
    box: Box,
    settings: Race,
    *,
    rng: int,
    on_search: OnSearch,
    near: Floats | None = None,
) -> tuple[Route, Route]:
    """The routes of a plain model: from samples of wide ranges, and by a population that half starts in narrower ones.

    The first also starts at points that are given, `near`, (n_near, n_params).
    """
    low = up_to(objective, min(friction_limit(objective.tests), objective.stiffest))
    searched = search_box(objective.spec, box, objective.tests)
    wide = widened(searched, box)

    def draw_local(number: int) -> Floats:
        for each in (low, objective):
            samples = draw_samples(each, box, wide, settings, rng=rng, number=number)
            # Fixed parameters may make every candidate stiff.
            if len(samples):
                break
        return samples if number or near is None else np.concatenate([near, samples])

    population = Population(
        objective=objective, box=box, searched=searched, settings=settings, rng=rng, on_search=on_search
    )
    return Route(name=SAMPLES, draw=draw_local), Route(name=POPULATION, draw=population.elite)


@dataclass(frozen=True, slots=True, kw_only=True)
class Population:
    """Differential evolution as a route: half of its first members are in `searched`, the others in wider ranges.

    These are ten times as wide within `box`, and so is what evolves. `laws_of` maps parameters of the box to those of
    the objective. Stiff candidates cost most, so that few are simulated, unless all are stiff.
    """

    objective: Objective
    box: Box
    searched: Box
    settings: Race
    rng: int
    on_search: OnSearch
    laws_of: Callable[[Floats], Floats] = lambda theta: theta

    def elite(self, number: int) -> Floats:
        """Its best points that are far apart in a round, (n_elite, n_params)."""
        from mrwork.search.evolution import DifferentialEvolution
        from mrwork.search.rules import StopRules

        stop = StopRules(max_generations=in_round(self.settings, number).generations)
        search = DifferentialEvolution(population=self.settings.population, stop=stop)
        wide, objective = widened(self.searched, self.box), self.objective
        first = search.start(len(wide.free), self.rng + number)
        unit = first.population.copy()
        within = np.asarray(wide.unit_from_theta(np.asarray(self.searched.theta_from_unit(unit[::2]))))
        unit[::2] = np.clip(within, 0.0, 1.0)
        limit = (_STIFFER if number else 1.0) * friction_limit(objective.tests)
        for limited in (up_to(objective, min(limit, objective.stiffest)), objective):
            with suppress(SimulationError):
                return optimise(
                    search,
                    limited,
                    wide,
                    rng=self.rng + number,
                    on_search=self.on_search,
                    laws_of=self.laws_of,
                    state=replace(first, population=unit),
                )[0]
        return np.empty((0, len(objective.spec.names)))


def points_from_optimiser(problem: Problem, search: Optimiser, *, call: Identifying) -> StartingPoints:
    """Minima from the elite of an optimiser, for a model without current laws."""
    objective, form = problem.objective, problem.form
    box = search_box(form.spec, form.box, objective.tests)

    elite, trace = optimise(search, objective, box, rng=problem.settings.rng, on_search=call.on_search)
    theta = minima_from(
        objective, form.box, elite[:_STARTS], on_iteration=partial(report_minima, call, "", trace)
    )
    return StartingPoints(objective=objective, form=form, theta=theta, trace=trace, doubt=alone_doubt(search))


def alone_doubt(search: Optimiser) -> str:
    """Why a lower minimum is possible than that of one optimiser."""
    return f"{search.name} was the only search; the default search confirms a minimum by another route"


def optimise(
    search: Optimiser,
    objective: Objective,
    box: Box,
    *,
    rng: int,
    on_search: OnSearch,
    laws_of: Callable[[Floats], Floats] = lambda theta: theta,
    state: State | None = None,
) -> tuple[Floats, SearchTrace]:
    """The elite of a search in a box, whose parameters `laws_of` maps, (n_elite, n_params), and its trace.

    The elite are its best points that are far apart, best first.
    """
    from mrwork.search import run_search

    def theta_of(unit: Floats) -> Floats:
        return laws_of(np.asarray(box.theta_from_unit(unit)))

    def trace_of(search: SearchResult) -> SearchTrace:
        return SearchTrace(
            evaluations=tuple(int(count) for count in search.trace.evaluations),
            best=tuple(float(value) for value in search.trace.best),
            median=tuple(float(value) for value in search.trace.median),
            stop_reason=search.stop_reason,
        )

    def on_generation(so_far: SearchResult) -> None:
        if not math.isfinite(so_far.best_misfit):
            return
        on_search(
            Found(
                best=lambda: theta_of(so_far.best_unit[None])[0],
                trace=trace_of(so_far),
                share=so_far.generations / search.stop.max_generations,
            )
        )

    result = run_search(
        search,
        lambda unit: objective(theta_of(unit)),
        rng=rng,
        n_params=len(box.free),
        state=state,
        on_generation=on_generation,
        journal=objective.journal,
    )
    if not len(result.elite):
        raise no_simulation(objective.spec, result.evaluations)
    return theta_of(result.elite), trace_of(result)
