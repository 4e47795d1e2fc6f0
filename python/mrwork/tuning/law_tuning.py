"""Tuning of one law: first candidates, a search from the best, last steps by gradients; and its Pareto front.

What gradients reach is a candidate as any other: it is chosen if it is better.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from mrwork.base.numbers import duration_in_words
from mrwork.base.places import keyed
from mrwork.base.progress import ProgressReport
from mrwork.base.values import Floats, array_dataclass
from mrwork.control.laws.law_settings import design_law, settings_of
from mrwork.errors import InvalidSettingError, SettingError
from mrwork.search import SearchResult, run_search
from mrwork.search.registry import ALL_OPTIMISERS, PEERS, run_front
from mrwork.search.rules import EliteRule, StopRules
from mrwork.tuning.first_candidates import distinct
from mrwork.tuning.law_plan import LawPlan
from mrwork.tuning.results import Front, FrontPoint, TracePoint, TunedLaw
from mrwork.tuning.space import LawCandidate, Scores

# A search ends where its least objective has not fallen by the tolerance within this number of generations.
_STALL, _TOLERANCE = 12, 1e-4
# First standard deviation of a search that begins at a point, a share of each range.
_SPREAD = 0.06
_INTERRUPTED = "search, interrupted"
_ENDS = {
    "max_evaluations": "search, until its candidates were used up",
    "max_generations": "search, until its candidates were used up",
    "stall": "search, until it no longer improved",
    "spread": "search, until its candidates were alike",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class TuningProgress(ProgressReport):
    """Progress of a tuning: the present search, its candidates and most of them, its least objective, searches done.

    A search is of the placements, of a law, or of its front. `seconds` are of this process.
    """

    label: str
    candidates: int
    budget: int
    least: float
    done: int
    total: int
    seconds: float

    @property
    def share(self) -> float:
        """The part of all candidates that is done, also before a tuning was resumed."""
        return (self.done + min(self.candidates / self.budget, 1.0)) / self.total

    @property
    def in_words(self) -> str:
        """Progress in one line: the present search, its candidates, its least objective, searches done."""
        return (
            f"{self.label}: {self.candidates} of {self.budget} candidates, least objective {self.least:.4f}, "
            f"{self.done} of {self.total} searches done, {duration_in_words(self.seconds)}"
        )


@array_dataclass()
class Finish:
    """The point of the unit cube that the gradients have reached, shape (n_free,), and how many there were."""

    unit: Floats
    gradients: int


def follow_gradients(plan: LawPlan, start: Floats, steps: int) -> Finish:
    """Follow the gradient from a point of the unit cube by L-BFGS-B; the largest command stays."""
    from scipy.optimize import minimize

    minimum = minimize(
        plan.slopes,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=[(0.0, 1.0)] * len(start),
        options={"maxiter": steps, "maxfun": 2 * steps},
    )
    return Finish(unit=np.asarray(minimum.x), gradients=int(minimum.nfev))


def check_settings(plan: LawPlan) -> None:
    """Refuse settings that make every candidate invalid, such as weights of floors that the building does not have."""
    candidate = plan.space.candidate(plan.space.start)
    try:
        with keyed("settings"):
            design_law(plan.law, plan.bench.study.problem, settings_of(plan.law, candidate.of_law))
    except InvalidSettingError:
        raise
    except SettingError:
        # The middle of the ranges may have no gain where other places of them do.
        return
    if plan.table.gradient_steps:
        plan.check_slopes()


def tune_law(plan: LawPlan, *, rng: int, advance: Callable[[TunedLaw, int], None]) -> TunedLaw:
    """Tune a law; `advance` takes it as it is so far, and the candidates that there may be."""
    began = time.perf_counter()
    table, space, bench = plan.table, plan.space, plan.bench
    firsts = plan.firsts
    if not space.continuous:
        firsts = tuple(replace(entry, origin="all levels") for entry in space.every())
    count = len(firsts)
    tuned = TunedLaw(
        law=plan.law,
        label=plan.label,
        settings=dict(firsts[0].settings),
        origin=firsts[0].origin,
        objective=plan.objective,
        robust=table.robust,
        least=math.inf,
        candidates=count,
        free=space.free,
    )

    def after(candidates: int, misfit: float, best: LawCandidate, origin: str) -> None:
        """Go on to so many candidates, with the best of the new ones if it is better."""
        nonlocal tuned
        if misfit < tuned.least:
            tuned = replace(tuned, settings=dict(best.settings), origin=origin, least=misfit)
        point = TracePoint(candidates=candidates, least=tuned.least)
        tuned = replace(tuned, candidates=candidates, trace=(*tuned.trace, point))
        advance(tuned, count + (table.budget if space.continuous else 0))

    def on_generation(so_far: SearchResult) -> None:
        candidate = space.candidate(so_far.best_unit)
        after(count + so_far.evaluations, so_far.best_misfit, candidate, _INTERRUPTED)

    scores = plan.scores(firsts, "first candidates")
    best, refused = firsts[scores.best], int(np.isinf(scores.objective).sum())
    after(count, float(scores.penalised_scores[scores.best]), best, best.origin)
    if space.continuous:
        search = _search(plan, firsts, scores, rng, on_generation)
        if tuned.origin == _INTERRUPTED:
            tuned = replace(tuned, origin=_ENDS.get(search.stop_reason, "search"))
        start = space.unit(tuned.candidate)
        if table.gradient_steps and start is not None:
            follow = partial(follow_gradients, plan, start, table.gradient_steps)
            end = bench.call.step("gradients", Finish, follow, tuned.settings)
            last = space.candidate(end.unit)
            scores = plan.scores([last], "finish")
            origin = f"search, then {end.gradients} gradients"
            after(tuned.candidates + 1, float(scores.penalised_scores[0]), last, origin)
    scores = plan.scores([tuned.candidate], "chosen")
    return replace(
        tuned,
        least=float(scores.objective[0]),
        violation=float(scores.violation[0]),
        refused=refused,
        seconds=time.perf_counter() - began,
        certificate=bench.certificate(plan.law, tuned.candidate),
    )


def _search(
    plan: LawPlan,
    firsts: Sequence[LawCandidate],
    scores: Scores,
    rng: int,
    on_generation: Callable[[SearchResult], None],
) -> SearchResult:
    """Search the free settings, with the best first candidates in the first generation, or from the best of them."""
    table, space = plan.table, plan.space
    order = np.argsort(scores.penalised_scores, kind="stable")
    starts = [unit for index in order if (unit := space.unit(firsts[int(index)])) is not None]
    n_params, seed, chosen = len(space.free), rng + table.seed, ALL_OPTIMISERS[table.search]
    if starts and table.search in PEERS:
        chosen = PEERS[table.search].near(starts[0], _SPREAD)
    optimiser = replace(
        chosen,
        population=table.population,
        stop=StopRules(
            max_generations=max(1, table.budget),
            max_evaluations=table.budget,
            confidence=None,
            stall_generations=max(_STALL, n_params),
            stall_tolerance=_TOLERANCE,
            min_generations=_STALL,
        ),
        elite=EliteRule(count=1),
    )
    state = optimiser.start(n_params, seed)
    if starts:
        first_units = np.array(starts[: table.population // 3])
        population = state.population.copy()
        population[: len(first_units)] = first_units
        state = replace(state, population=population)
    return run_search(
        optimiser,
        plan.values,
        rng=seed,
        n_params=n_params,
        state=state,
        on_generation=on_generation,
        journal=plan.bench.call.journal,
    )


def front_of(plan: LawPlan, *, rng: int, report: Callable[[int, int], None]) -> Front:
    """Search the front of a law on the training motions; `report` takes the candidates so far, and most of them."""
    table, space, bench = plan.table, plan.space, plan.bench
    parts = [replace(plan.objective, weights={name: 1.0}) for name in table.objectives]

    def scores(candidates: Sequence[LawCandidate]) -> list[Scores]:
        runs = bench.run(plan.law, candidates)
        return [part.scores(runs, bench.baselines) for part in parts]

    def objectives(units: Floats) -> Floats:
        of_units = scores([space.candidate(unit) for unit in units])
        return np.column_stack([score.penalised_scores for score in of_units])

    def alone(candidates: Sequence[LawCandidate]) -> Floats:
        return np.column_stack([score.objective for score in scores(candidates)])

    starts = [unit for candidate in plan.firsts if (unit := space.unit(candidate)) is not None]
    result = run_front(
        objectives,
        n_params=len(space.free),
        n_objectives=len(parts),
        population=table.population,
        budget=table.budget,
        rng=rng + table.seed,
        starts=np.array(starts).reshape(-1, len(space.free)),
        journal=bench.call.journal,
        on_generation=lambda evaluations: report(evaluations, table.budget),
    )
    candidates = distinct([space.candidate(unit) for unit in result.units])
    train = bench.call.array("front", partial(alone, candidates), plan.law, candidates).tolist()
    points = (
        FrontPoint(
            settings=dict(candidate.settings),
            train=dict(zip(table.objectives, values, strict=True)),
            certificate=bench.certificate(plan.law, candidate),
        )
        for candidate, values in zip(candidates, train, strict=True)
    )
    return Front(
        law=plan.law,
        label=plan.label,
        objectives=table.objectives,
        points=tuple(points),
        candidates=result.evaluations,
    )
