"""Tuning of one law: first candidates, a search from the best, last steps by gradients; and its Pareto front.

What gradients reach is a candidate as any other: it is chosen if it is better.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mrwork.base.numbers import duration_in_words
from mrwork.base.progress import ProgressReport
from mrwork.base.values import Floats, array_dataclass
from mrwork.control.laws.control_law import control_law
from mrwork.control.laws.law_settings import SETTINGS, design_law, settings_of
from mrwork.errors import Interrupted, InvalidSettingError, SettingError
from mrwork.search import Optimiser, SearchResult, run_search
from mrwork.search.registry import ALL_OPTIMISERS, PEERS, FrontResult, run_front
from mrwork.search.rules import EliteRule, StopRules
from mrwork.store.codec import digest_of
from mrwork.study.arrangements import refuse_within
from mrwork.study.runs import Runs, recall_or_compute
from mrwork.study.schema import TuneTable
from mrwork.study.study import Study
from mrwork.tuning.first_candidates import Basis, FirstCandidate, distinct, first_candidates
from mrwork.tuning.problem import Bench, Benches, Scores, describe, score_candidates
from mrwork.tuning.results import (
    DesignNotes,
    Front,
    FrontPoint,
    TracePoint,
    TunedLaw,
)
from mrwork.tuning.score_slopes import ScoreSlopes, without_gradient
from mrwork.tuning.space import PENALTY, LawCandidate, SettingSpace, TuningObjective


def check_finish(table: TuneTable, study: Study) -> None:
    """Refuse gradient steps of a law without gradients."""
    if table.gradient_steps and (lacking := without_gradient(study, table)):
        refuse_within(table, f"{lacking}, or leave gradient_steps out", "gradient_steps")


@array_dataclass()
class Finish:
    """The point of the unit cube that the gradients have reached, shape (n_free,), and how many there were."""

    unit: Floats
    gradients: int


def follow_gradients(
    space: SettingSpace, bench: Bench, objective: TuningObjective, start: Floats, steps: int
) -> Finish:
    """Follow the gradient from a point of the unit cube by L-BFGS-B; the largest command stays."""
    from scipy.optimize import minimize

    minimum = minimize(
        ScoreSlopes(space=space, bench=bench, objective=objective).at,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=[(0.0, 1.0)] * len(start),
        options={"maxiter": steps, "maxfun": 2 * steps},
    )
    return Finish(unit=np.asarray(minimum.x), gradients=int(minimum.nfev))


Report = Callable[[int, int, float], None]
"""Called with the candidates of the law so far, the most that there may be, and their least penalised objective."""

# A search ends where its least objective has not fallen by the tolerance within this number of generations.
_STALL, _TOLERANCE = 12, 1e-4
# First standard deviation of a search that begins at a point, a share of each range.
_SPREAD = 0.06
_ENDS = {
    "max_evaluations": "search, until its candidates were used up",
    "max_generations": "search, until its candidates were used up",
    "stall": "search, until it no longer improved",
    "spread": "search, until its candidates were alike",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class TuningProgress(ProgressReport):
    """Progress of a tuning: the present law, its candidates and most of them, its least objective, laws done.

    `share` is that of all candidates that are done, also before a tuning was resumed; `seconds` are of this process.
    """

    label: str
    candidates: int
    budget: int
    least: float
    done: int
    total: int
    seconds: float
    share: float = field()

    @property
    def in_words(self) -> str:
        """Progress in one line: the present law, its candidates, its least objective, laws done."""
        return (
            f"{self.label}: {self.candidates} of {self.budget} candidates, least objective {self.least:.4f}, "
            f"{self.done} of {self.total} laws done, {duration_in_words(self.seconds)}"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class LawPlan:
    """A law to be tuned."""

    table: TuneTable
    law: str
    objective: TuningObjective
    space: SettingSpace
    label: str


def check_settings(plan: LawPlan, bench: Bench) -> None:
    """Refuse settings that make every candidate invalid, such as weights of floors that the building does not have."""
    candidate = plan.space.candidate(plan.space.start)
    try:
        design_law(plan.law, bench.problem, settings_of(plan.law, candidate.settings))
    except InvalidSettingError as error:
        if plan.table.place is None:
            raise
        raise plan.table.place.within("settings").about(error, SettingError) from error
    except SettingError:
        # The middle of the ranges may have no gain where other places of them do.
        return
    if plan.table.gradient_steps:
        ScoreSlopes(space=plan.space, bench=bench, objective=plan.objective).check()


def tune_law(plan: LawPlan, benches: Benches, basis: Basis, *, rng: int, report: Report) -> TunedLaw:
    """Tune a law."""
    began = time.perf_counter()
    table = plan.table
    bench = benches.select(robust=table.robust)
    firsts = first_candidates(plan.space, basis)
    if not plan.space.continuous:
        firsts = [FirstCandidate(candidate=each, origin="all levels") for each in plan.space.every()]
    candidates = tuple(each.candidate for each in firsts)
    inputs = digest_of(plan.label, candidates)
    scores = bench.recall_or_score("first candidates", inputs, plan.objective, plan.law, candidates)
    best, least = scores.best, float(scores.penalised_scores[scores.best])
    chosen, origin = firsts[best].candidate, firsts[best].origin
    trace = [TracePoint(candidates=len(candidates), least=least)]
    most = len(candidates) + (table.budget if plan.space.continuous else 0)
    report(len(candidates), most, least)

    def result(value: float, violation: float = 0.0, *, designed: bool = True) -> TunedLaw:
        return TunedLaw(
            law=plan.law,
            label=plan.label,
            settings=dict(describe(chosen)),
            origin=origin,
            objective=plan.objective,
            robust=table.robust,
            least=value,
            violation=violation,
            candidates=trace[-1].candidates,
            seconds=time.perf_counter() - began,
            certificate=bench.certificate(plan.law, chosen) if designed else "",
            limited=not control_law(plan.law).commands_force and not SETTINGS[plan.law].constant,
            refused=int(np.isinf(scores.objective).sum()),
            free=plan.space.free,
            trace=tuple(trace),
            design=bench.design_notes(plan.law, chosen) if designed else DesignNotes(),
        )

    def interrupted() -> Interrupted[Any]:
        return Interrupted(result(trace[-1].least, designed=False), "tuning")

    if plan.space.continuous:

        def on_generation(so_far: SearchResult) -> None:
            done, best_so_far = len(candidates) + so_far.evaluations, min(trace[-1].least, so_far.best_misfit)
            trace.append(TracePoint(candidates=done, least=best_so_far))
            report(done, most, best_so_far)

        try:
            search = _search(plan, bench, candidates, scores, rng, on_generation)
        except Interrupted as interrupt:
            if interrupt.result.best_misfit < least:
                chosen, origin = plan.space.candidate(interrupt.result.best_unit), "search, interrupted"
            raise interrupted() from interrupt
        if search.best_misfit < least:
            chosen, origin = plan.space.candidate(search.best_unit), _ENDS.get(search.stop_reason, "search")
        if table.gradient_steps:
            try:
                last, misfit, gradients = _finish(plan, bench, chosen)
            except KeyboardInterrupt as interrupt:
                raise interrupted() from interrupt
            trace.append(TracePoint(candidates=trace[-1].candidates + 1, least=min(trace[-1].least, misfit)))
            if misfit < min(least, search.best_misfit):
                chosen, origin = last, f"search, then {gradients} gradients"
    inputs = digest_of(plan.label, chosen)
    found = bench.recall_or_score("chosen", inputs, plan.objective, plan.law, [chosen])
    return result(float(found.objective[0]), float(found.violation[0]))


def _finish(plan: LawPlan, bench: Bench, chosen: LawCandidate) -> tuple[LawCandidate, float, int]:
    """The candidate that gradients reach from the chosen one, its misfit in the loop, and how many there were."""
    start = plan.space.unit(chosen)
    if start is None:
        return chosen, math.inf, 0
    point = recall_or_compute(
        bench.journal,
        "gradients",
        digest_of(plan.label, chosen),
        Finish,
        lambda: follow_gradients(plan.space, bench, plan.objective, start, plan.table.gradient_steps),
    )
    candidate = plan.space.candidate(point.unit)
    inputs = digest_of(plan.label, candidate)
    scores = bench.recall_or_score("finish", inputs, plan.objective, plan.law, [candidate])
    return candidate, float(scores.penalised_scores[0]), point.gradients


def _search(
    plan: LawPlan,
    bench: Bench,
    firsts: tuple[LawCandidate, ...],
    scores: Scores,
    rng: int,
    on_generation: Callable[[SearchResult], None],
) -> SearchResult:
    """Search the free settings; the best first candidates are among its first generation."""
    table, space = plan.table, plan.space
    known: dict[str, float] = {}

    def misfit(units: Floats) -> Floats:
        asked = [space.candidate(unit) for unit in units]
        keys = [repr(each) for each in asked]
        fresh = {key: each for key, each in zip(keys, asked, strict=True) if key not in known}
        if fresh:
            fresh_scores = score_candidates(bench, plan.objective, plan.law, list(fresh.values()))
            known.update(zip(fresh, fresh_scores.penalised_scores.tolist(), strict=True))
        return np.array([known[key] for key in keys])

    order = np.argsort(scores.penalised_scores, kind="stable")
    starts = [unit for index in order if (unit := space.unit(firsts[int(index)])) is not None]
    n_params = len(space.free)
    optimiser = _optimiser(table, n_params, starts[0] if starts else None)
    seed = rng + table.seed
    state = optimiser.start(n_params, seed)
    if starts:
        kept = np.array(starts[: table.population // 3])
        population = state.population.copy()
        population[: len(kept)] = kept
        state = replace(state, population=population)
    return run_search(
        optimiser,
        misfit,
        rng=seed,
        n_params=n_params,
        state=state,
        on_generation=on_generation,
        journal=bench.journal,
    )


def _optimiser(table: TuneTable, n_params: int, best: Floats | None) -> Optimiser:
    """The search of a table, with its population and budget; one without a population begins at the best candidate."""
    chosen = ALL_OPTIMISERS[table.search]
    if best is not None and table.search in PEERS:
        chosen = PEERS[table.search].near(best, _SPREAD)
    return replace(
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


def front_of(plan: LawPlan, benches: Benches, basis: Basis, *, rng: int, report: Report) -> Front:
    """Search the front of a law on the training motions."""
    table, space = plan.table, plan.space
    bench = benches.select(robust=table.robust)
    parts = [replace(plan.objective, weights={name: 1.0}) for name in table.objectives]

    def objectives(units: Floats) -> Floats:
        candidates = [space.candidate(unit) for unit in units]
        criteria = bench.run(plan.law, candidates)
        return _ratios(criteria, bench, parts) + PENALTY * parts[0].violation(criteria)[:, None]

    firsts = [each.candidate for each in first_candidates(space, basis)]
    starts = [unit for each in firsts if (unit := space.unit(each)) is not None]
    result: FrontResult = run_front(
        objectives,
        n_params=len(space.free),
        n_objectives=len(parts),
        population=table.population,
        budget=table.budget,
        rng=rng + table.seed,
        starts=np.array(starts).reshape(-1, len(space.free)),
        journal=bench.journal,
        on_generation=lambda evaluations: report(evaluations, table.budget, float("nan")),
    )
    candidates = list(distinct([space.candidate(unit) for unit in result.units]))
    train = _evaluate(bench, plan, parts, candidates)
    points = [
        FrontPoint(
            settings=dict(describe(candidate)),
            train=dict(zip(table.objectives, train[place].tolist(), strict=True)),
            certificate=bench.certificate(plan.law, candidate),
        )
        for place, candidate in enumerate(candidates)
    ]
    return Front(
        law=plan.law,
        label=plan.label,
        objectives=table.objectives,
        points=tuple(points),
        candidates=result.evaluations,
    )


def _ratios(criteria: Runs, bench: Bench, parts: list[TuningObjective]) -> Floats:
    """The objectives of candidates over their baseline, shape (n_candidates, n_objectives)."""
    return np.column_stack([part.value(part.run_scores(criteria, bench.baseline(part))) for part in parts])


def _evaluate(
    bench: Bench, plan: LawPlan, parts: list[TuningObjective], candidates: list[LawCandidate]
) -> Floats:
    inputs = digest_of(plan.label, candidates, [motion.name for motion in bench.motions])
    return _ratios(bench.recall_or_run("front", inputs, plan.law, candidates), bench, parts)
