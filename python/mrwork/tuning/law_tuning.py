"""Tuning of one law: candidates that are tried first, then a search from the best of them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork.control.law_design import design_law, settings_of
from mrwork.control.law_settings import SETTINGS
from mrwork.control.laws import control_law
from mrwork.errors import Interrupted, InvalidSettingError, SettingError
from mrwork.search.loop import GenerationEvent, Optimiser, SearchResult, run_search
from mrwork.search.peers import CMAEvolution
from mrwork.search.registry import OPTIMISERS, PEERS
from mrwork.search.rules import EliteRule, StopRules
from mrwork.store import digest_of
from mrwork.study.tuning_schema import TuneTable
from mrwork.tuning.benches import Benches, recorded
from mrwork.tuning.first_candidates import Basis, FirstCandidate, first_candidates
from mrwork.tuning.gradient_finish import Finish, gradient_finish
from mrwork.tuning.objective import Objective
from mrwork.tuning.problem import Bench, Scores, described, scored
from mrwork.tuning.results import Judgement, LawResult, TracePoint, unjudged
from mrwork.tuning.space import Candidate, SettingSpace

Floats = NDArray[np.float64]
Report = Callable[[int, float], None]
"""Called with the number of candidates of the law so far, and their least penalised objective."""

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
class TuningProgress:
    """Progress of a tuning: the present law, its candidates, its least objective, laws done and in total, seconds."""

    label: str
    candidates: int
    budget: int
    least: float
    done: int
    total: int
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A law to be tuned."""

    table: TuneTable
    law: str
    objective: Objective
    space: SettingSpace
    label: str


def check_settings(plan: Plan, bench: Bench) -> None:
    """Refuse settings of a table that no candidate can have, as weights of other floors than those of the building.

    Raises
    ------
    InvalidSettingError
        If the law cannot be designed with them; the message has the line.
    """
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


def tuned_law(plan: Plan, benches: Benches, basis: Basis, *, rng: int, report: Report) -> LawResult:
    """Tune a law and judge it.

    Raises
    ------
    Interrupted
        On Ctrl-C during the search, with the `LawResult` so far, which is not judged.
    """
    began = time.perf_counter()
    table = plan.table
    bench = benches.searched(robust=table.robust)
    firsts = first_candidates(plan.space, basis)
    if not plan.space.continuous:
        firsts = [FirstCandidate(candidate=each, origin="all levels") for each in plan.space.every()]
    candidates = tuple(each.candidate for each in firsts)
    scores = recorded(
        benches.journal,
        "first candidates",
        digest_of(plan.label, candidates),
        Scores,
        (len(candidates),),
        lambda: scored(bench, plan.objective, plan.law, candidates),
    )
    best, least = scores.best, float(scores.penalised[scores.best])
    chosen, origin = firsts[best].candidate, firsts[best].origin
    trace = [TracePoint(candidates=len(candidates), least=least)]
    report(len(candidates), least)

    def result(train: Judgement, test: Judgement | None, certificate: str) -> LawResult:
        return LawResult(
            law=plan.law,
            label=plan.label,
            settings=dict(described(chosen)),
            origin=origin,
            train=train,
            test=test,
            candidates=trace[-1].candidates,
            seconds=time.perf_counter() - began,
            certificate=certificate,
            limited=not control_law(plan.law).commands_force and not SETTINGS[plan.law].constant,
            refused=int(np.isinf(scores.objective).sum()),
            objective=plan.objective.in_words(robust=table.robust),
            free=plan.space.free,
            trace=tuple(trace),
        )

    if plan.space.continuous:

        def on_generation(event: GenerationEvent[Any]) -> None:
            trace.append(
                TracePoint(
                    candidates=len(candidates) + event.evaluations,
                    least=min(trace[-1].least, event.best_misfit),
                )
            )
            report(trace[-1].candidates, trace[-1].least)

        try:
            found = _searched(plan, bench, benches, candidates, scores, rng, on_generation)
        except Interrupted as interrupt:
            if interrupt.result.best_misfit < least:
                chosen, origin = plan.space.candidate(interrupt.result.best_unit), "search, interrupted"
            raise Interrupted(result(unjudged(trace[-1].least), None, ""), "tuning") from interrupt
        if found.best_misfit < least:
            chosen, origin = plan.space.candidate(found.best_unit), _ENDS.get(found.stop_reason, "search")
        if table.gradient_steps:
            last = _finished(plan, bench, benches, chosen)
            trace.append(
                TracePoint(candidates=trace[-1].candidates + 1, least=min(trace[-1].least, last.misfit))
            )
            if last.misfit < min(least, found.best_misfit):
                chosen, origin = last.candidate, f"search, then {last.gradients} gradients on the twin"
    train, test = benches.judgements(plan.law, chosen, plan.objective, robust=table.robust)
    return result(train, test, bench.certificate(plan.law, chosen))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Finished:
    candidate: Candidate
    misfit: float
    gradients: int


def _finished(plan: Plan, bench: Bench, benches: Benches, chosen: Candidate) -> _Finished:
    """The candidate that gradients reach from the chosen one, with its misfit in the loop."""
    start = plan.space.unit(chosen)
    if start is None:
        return _Finished(candidate=chosen, misfit=math.inf, gradients=0)
    point = recorded(
        benches.journal,
        "gradients",
        digest_of(plan.label, chosen),
        Finish,
        start.shape,
        lambda: gradient_finish(
            plan.space, benches.training, plan.objective, start, plan.table.gradient_steps
        ),
    )
    candidate = plan.space.candidate(point.unit)
    scores = recorded(
        benches.journal,
        "finish",
        digest_of(plan.label, candidate),
        Scores,
        (1,),
        lambda: scored(bench, plan.objective, plan.law, [candidate]),
    )
    return _Finished(candidate=candidate, misfit=float(scores.penalised[0]), gradients=point.gradients)


def _searched(
    plan: Plan,
    bench: Bench,
    benches: Benches,
    firsts: tuple[Candidate, ...],
    scores: Scores,
    rng: int,
    on_generation: Callable[[GenerationEvent[Any]], None],
) -> SearchResult[Any]:
    """Search the free settings; the best first candidates are among its first generation."""
    table, space = plan.table, plan.space
    known: dict[str, float] = {}

    def misfit(units: Floats) -> Floats:
        asked = [space.candidate(unit) for unit in units]
        keys = [repr(each) for each in asked]
        fresh = {key: each for key, each in zip(keys, asked, strict=True) if key not in known}
        if fresh:
            found = scored(bench, plan.objective, plan.law, list(fresh.values()))
            known.update(zip(fresh, found.penalised.tolist(), strict=True))
        return np.array([known[key] for key in keys])

    order = np.argsort(scores.penalised, kind="stable")
    starts = [unit for index in order if (unit := space.unit(firsts[int(index)])) is not None]
    n_params = len(space.free)
    optimiser = _optimiser(table, n_params, starts[0] if starts else None)
    seed = rng + table.seed
    state = optimiser.start(n_params, seed)
    if starts:
        kept = np.array(starts[: table.population // 3])
        population = state.population.copy()
        population[0, : len(kept)] = kept
        state = replace(state, population=population)
    return run_search(
        optimiser,
        misfit,
        rng=seed,
        n_params=n_params,
        state=state,
        on_generation=on_generation,
        journal=benches.journal,
    )


def _optimiser(table: TuneTable, n_params: int, best: Floats | None) -> Optimiser[Any]:
    """The search of a table, with its population and budget; one without a population begins at the best candidate."""
    chosen: Any = {**OPTIMISERS, **PEERS}[table.search]
    if isinstance(chosen, CMAEvolution) and best is not None:
        # The boundary itself has no room for half of the first candidates.
        inside = np.clip(best, _SPREAD, 1.0 - _SPREAD)
        chosen = replace(chosen, begin=tuple(inside.tolist()), deviation=_SPREAD)
    return replace(  # type: ignore[no-any-return] # every optimiser is a dataclass with these settings
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
