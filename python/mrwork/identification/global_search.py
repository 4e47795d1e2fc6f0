"""Global search: starting points of the final least-squares fits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import Interrupted, SimulationError
from mrwork.identification.equivalent import Form
from mrwork.identification.fit import SearchTrace
from mrwork.identification.multistart import (
    Found,
    Multistart,
    distinct_minima,
    search_starts,
)
from mrwork.identification.objective import Objective
from mrwork.identification.problem import Problem
from mrwork.identification.search_ranges import search_box
from mrwork.identification.settings import Start
from mrwork.records.window import excerpt
from mrwork.search import Optimiser, SearchResult, run_search
from mrwork.search.loop import GenerationEvent

# Of a plain model, and of a model whose starts are drawn through fits at each command.
_STARTS = 16
_JOINT_STARTS = 8
# Coefficients may reach so many times the range that is searched.
_MARGIN = 10.0

# Called with the generation or iteration (0 outside a search), best and median misfit, and the share of the allowance
# that is used up.
OnSearch = Callable[[int, float, float, float], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Exploration:
    """Starts, shape (n_starts, n_params), best first, what they are screened against, and how they were found.

    `form` has the box to descend in. Starts that are minima already (`descended`) need no screening.
    """

    objective: Objective
    form: Form
    starts: NDArray[np.float64]
    trace: SearchTrace
    descended: bool = False

    def with_starts(self, spec: DamperSpec, given: Sequence[Start]) -> Exploration:
        """The same with `given` starts after its own, which are parameters of the model asked for, `spec`.

        A parameter that a start does not name has the value of the best start that was found; one that lies outside
        the bounds is pulled inside.
        """
        box = self.form.box
        found = np.asarray(self.form.back(self.starts[0]))
        whole = [
            np.array([start.get(name, own) for name, own in zip(spec.names, found, strict=True)])
            for start in given
        ]
        inside = [box.inside(np.clip(self.form.forth(theta), box.lower, box.upper)) for theta in whole]
        return replace(self, starts=np.array([*self.starts, *inside]))


def explore(problem: Problem, *, on_search: OnSearch) -> Exploration:
    """Search the parameters of a plain model, or with laws those of the plain model at each command.

    Raises
    ------
    SimulationError
        Where no candidate could be simulated.
    Interrupted
        On Ctrl-C, carrying an exploration whose one start is the best so far.
    """
    objective, form, search, rng = problem.objective, problem.form, problem.search, problem.settings.rng
    if isinstance(search, Multistart):
        return _descend_plain(objective, form, search, rng=rng, on_search=on_search)
    if form.spec.current is None:
        return _explore_plain(objective, form, search, rng=rng, on_search=on_search)
    return _explore_levels(objective, form, search, rng=rng, on_search=on_search)


def _descend_plain(
    objective: Objective, form: Form, search: Multistart, *, rng: int, on_search: OnSearch
) -> Exploration:
    box = search_box(form.spec, form.box, objective.tests)

    def on_iteration(found: Found, share: float) -> None:
        # The first entry is that of the samples.
        on_search(len(found.best) - 1, found.best[-1], found.median[-1], share)

    try:
        found = search_starts(
            objective, form.box, box, search, rng=rng, mirrored=form.mirrored, on_iteration=on_iteration
        )
    except Interrupted as interrupt:
        found = interrupt.result
        if not len(found.theta):
            raise KeyboardInterrupt from interrupt
        raise _interrupted(objective, form, found.theta[0], _course(found)) from interrupt
    if not len(found.theta):
        raise _nothing_found(form.spec, found.evaluations[-1])
    return Exploration(
        objective=objective,
        form=form,
        starts=distinct_minima(form.box, found.theta, found.misfit),
        trace=_course(found),
        descended=True,
    )


def _course(found: Found) -> SearchTrace:
    return SearchTrace(
        evaluations=found.evaluations,
        best=found.best,
        median=found.median,
        stop_reason=found.stop_reason,
        ends=tuple(found.misfit.tolist()),
    )


def _explore_plain(
    objective: Objective, form: Form, search: Optimiser[Any], *, rng: int, on_search: OnSearch
) -> Exploration:
    box = search_box(form.spec, form.box, objective.tests)

    def on_generation(event: GenerationEvent[Any]) -> None:
        share = event.generation / search.stop.max_generations
        on_search(event.generation, event.best_misfit, event.median_misfit, share)

    try:
        found = run_search(
            search,
            lambda unit: objective(np.asarray(box.theta_from_unit(unit))),
            rng=rng,
            n_params=len(box.free),
            on_generation=on_generation,
            journal=objective.journal,
        )
    except Interrupted as interrupt:
        result = interrupt.result
        if not np.isfinite(result.best_misfit):
            raise KeyboardInterrupt from interrupt
        theta = np.asarray(box.theta_from_unit(result.best_unit))
        raise _interrupted(objective, form, theta, _trace([result])) from interrupt
    _check_found(form.spec, found)
    starts = np.asarray(box.theta_from_unit(found.elite[:_STARTS]))
    return Exploration(objective=objective, form=form, starts=starts, trace=_trace([found]))


def _explore_levels(
    objective: Objective, form: Form, search: Optimiser[Any], *, rng: int, on_search: OnSearch
) -> Exploration:
    # SciPy's optimisers are slow to load and needed from here on only.
    from mrwork.dampers.spec import damper
    from mrwork.identification.starts import (
        LevelFit,
        follow_level,
        joint_starts,
        law_box,
        levels_of,
        search_level,
    )

    excerpts = tuple(excerpt(test) for test in objective.tests)
    plain = damper(form.spec.name)
    box = Box.of(plain).with_bounds(
        {
            name: (form.box.lower[index], form.box.upper[index])
            for index, name in enumerate(form.box.names)
            if name in plain.names
        }
    )
    levels = levels_of(form.spec, excerpts)
    commands = sorted(levels)
    fits: list[LevelFit] = []
    searches: list[SearchResult[Any]] = []

    def at(command: float) -> Objective:
        return objective.on(plain, levels[command])

    def on_generation(event: GenerationEvent[Any]) -> None:
        share = event.generation / search.stop.max_generations
        on_search(event.generation, event.best_misfit, event.median_misfit, share / len(levels))

    # The middle one is searched; from there each command starts at what its neighbour found.
    middle = len(commands) // 2
    try:
        first = search_level(
            at(commands[middle]), box, commands[middle], search=search, rng=rng, on_generation=on_generation
        )
        fits.append(first)
        if first.search is not None:
            searches.append(first.search)
            _check_found(form.spec, first.search)
        for outward in (commands[middle + 1 :], commands[:middle][::-1]):
            neighbour, there = first, at(first.command)
            for command in outward:
                here = at(command)
                neighbour, there = follow_level(here, box, command, neighbour, there), here
                fits.append(neighbour)
                best = float(here(neighbour.finds[:1])[0])
                on_search(0, best, np.nan, len(fits) / len(levels))
    except KeyboardInterrupt as interrupt:
        if isinstance(interrupt, Interrupted) and np.isfinite(interrupt.result.best_misfit):
            searched = search_box(plain, box, levels[commands[middle]])
            find = np.asarray(searched.theta_from_unit(interrupt.result.best_unit))
            fits.append(LevelFit(command=commands[middle], finds=find[None], search=None))
            searches.append(interrupt.result)
        if not fits:
            raise KeyboardInterrupt from interrupt
        theta = joint_starts(form.spec, fits, 1, rng=rng)[0]
        raise _interrupted(objective, form, theta, _trace(searches)) from interrupt
    fits.sort(key=lambda fit: fit.command)
    joint = objective.on(form.spec, excerpts)
    starts = joint_starts(form.spec, fits, _JOINT_STARTS, rng=rng)
    searched = search_box(plain, box, excerpts)
    joint_form = replace(
        form, box=_reached(form, law_box(form.spec, searched, np.array(commands), margin=_MARGIN))
    )
    return Exploration(
        objective=joint,
        form=joint_form,
        starts=np.array([joint_form.box.inside(start) for start in starts]),
        trace=_trace(searches),
    )


def _interrupted(
    objective: Objective, form: Form, best: NDArray[np.float64], trace: SearchTrace
) -> Interrupted:
    so_far = Exploration(objective=objective, form=form, starts=best[None], trace=trace)
    return Interrupted(so_far, "exploration")


def _reached(form: Form, reach: Box) -> Box:
    """The box of a form, with coefficients that the user left alone no wider than `reach`.

    Over a range of 1e9 either way the logit, in which descents run, tells one useful value from another poorly.
    """
    whole = Box.of(form.spec)
    narrowed = {}
    for index, name in enumerate(whole.names):
        own = (form.box.lower[index], form.box.upper[index])
        if own == (whole.lower[index], whole.upper[index]):
            narrowed[name] = (reach.lower[index], reach.upper[index])
    return form.box.with_bounds(narrowed)


def _trace(searches: list[SearchResult[Any]]) -> SearchTrace:
    """Traces one after the other; `evaluations` goes on counting."""
    evaluations: list[int] = []
    for search in searches:
        before = evaluations[-1] if evaluations else 0
        evaluations += [before + int(count) for count in search.trace.evaluations]
    return SearchTrace(
        evaluations=tuple(evaluations),
        best=tuple(float(value) for search in searches for value in search.trace.best),
        median=tuple(float(value) for search in searches for value in search.trace.median),
        stop_reason=", ".join(dict.fromkeys(search.stop_reason for search in searches)),
    )


def _check_found(spec: DamperSpec, found: SearchResult[Any]) -> None:
    if len(found.elite) == 0:
        raise _nothing_found(spec, found.evaluations)


def _nothing_found(spec: DamperSpec, evaluations: int) -> SimulationError:
    return SimulationError(
        f"none of {evaluations} candidates of {spec.name} could be simulated on these tests; "
        "check the units of the record, or narrow the bounds"
    )
