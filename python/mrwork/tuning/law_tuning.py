"""Tuning of one law: first candidates, a search from the best, last steps by gradients; and its Pareto front.

What gradients reach is a candidate as any other: it is chosen if it is better.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from mrwork.base.numbers import round_to
from mrwork.base.places import keyed
from mrwork.base.values import Floats, array_dataclass
from mrwork.buildings.groups import largest_command
from mrwork.closed_loop.evaluation import searched
from mrwork.control.laws.design_ground import PEAK_FACTOR, ground_of
from mrwork.control.laws.law_problem import NO_CERTIFICATE, DesignProblem, Magnitudes
from mrwork.control.laws.law_settings import SETTINGS, design_law, settings_of
from mrwork.control.linear.lqr import PUBLISHED_REGULATORS, plain_weight
from mrwork.control.weights.weight_solver import design_weights
from mrwork.errors import InvalidSettingError, SettingError
from mrwork.search import SearchResult, run_search
from mrwork.search.registry import ALL_OPTIMISERS, PEERS, run_front
from mrwork.search.rules import EliteRule, StopRules, ended_in_words
from mrwork.study.row_kinds import Kind
from mrwork.study.run_reports import LEVELS
from mrwork.study.schema import OPTIMAL_PASSIVE, PASSIVE_OFF, PASSIVE_ON
from mrwork.study.trials import BestConstant, scan
from mrwork.tuning.law_plan import Bench, LawPlan
from mrwork.tuning.space import (
    BUDGET_SCALE,
    LARGEST,
    FreeSetting,
    LawCandidate,
    Scores,
    SettingSpace,
    TuningObjective,
    is_semi_active,
)
from mrwork.tuning.tuned_laws import Front, FrontPoint, TracePoint, TunedLaw

# A search ends where its least objective has not fallen by the tolerance within this number of generations.
_STALL, _TOLERANCE = 12, 1e-4
# First standard deviation of a search that begins at a point, a share of each range.
_SPREAD = 0.06
_INTERRUPTED = "search, interrupted"
_STEPS = 12
_WEIGHT = "control_weight"
_EQUAL, _CONVEX, _DASHPOTS = "equal drift weights", "convex weights", "weights of dashpots"
_SEMI_ACTIVE = "semi-active weights"
# What is scanned of weights by their origin, and what the candidates of the scan are.
_SCANNED = {
    **dict.fromkeys((_EQUAL, _CONVEX, _DASHPOTS), ("R scanned", "sizes of R")),
    _SEMI_ACTIVE: ("budget scanned", "limits and budgets"),
}
# Share b of the semi-active condition, and factors of the budget that the dampers have.
_SHARE = 0.1
_SCALES = (0.2, 0.4, 0.8, 1.6, 3.2)


Shape = tuple[Mapping[str, Any], str]
"""Weights by name, and where they are from."""


def regulator_shapes(problem: DesignProblem, magnitudes: Magnitudes) -> list[Shape]:
    """Shapes of the weights of a regulator: of dashpots, convex and semi-active ones, and published ones.

    Convex weights reduce rms drifts, or rms drifts and accelerations in proportion to their peaks at i = 0, under the
    stationary ground of the training motions, with the damper's force as budget; a peak counts as three times the rms.
    """
    convex = list[Shape]()
    drift = {"rms_drift": round_to(magnitudes.drift / PEAK_FACTOR)}
    limits = (drift, {**drift, "rms_acceleration": round_to(magnitudes.acceleration / PEAK_FACTOR)})
    # A building with an undamped mode has no such weights, motions that are too short no ground.
    for limit in limits:
        with suppress(SettingError):
            designed = design_weights(
                problem.building,
                problem.devices,
                limits=limit,
                budget=magnitudes.force / PEAK_FACTOR,
                spectrum=ground_of(problem).spectrum,
            )
            weights = {name: _round_all(value) for name, value in designed.settings().items()}
            # A force that costs nothing has a weight of 0, which a regulator does not take.
            settings_of("clipped_optimal", weights)
            convex.append((weights, _CONVEX))
    # Where the weights of limits exist, their semi-active form does, too.
    designed_by = [{"designed": {**limit, "semi_active": _SHARE}} for limit in limits if convex]
    published = [
        ({"accelerations": entry.weights, _WEIGHT: entry.control_weight}, f"published weights {entry.name}")
        for entry in PUBLISHED_REGULATORS
        if len(entry.weights) == len(problem.building.floor_names)
    ]
    return [
        ({"rates": 1.0}, _DASHPOTS),
        *convex,
        *((shape, _SEMI_ACTIVE) for shape in designed_by),
        *published,
    ]


def _round_all(value: Any) -> Any:
    """The digits that a study file states, which do not depend on the last bits of a solver."""
    return tuple(_round_all(entry) for entry in value) if isinstance(value, tuple) else round_to(float(value))


def first_candidates(
    space: SettingSpace, of_regulators: Sequence[Shape], magnitudes: Magnitudes
) -> tuple[LawCandidate, ...]:
    """Candidates of a law that are tried before the search, at the largest command of the dampers.

    Weights are only given to laws of whose weights the table states nothing. The size of R is scanned for each shape of
    weights: a damper saturates, so no design tells it.
    """
    kind = SETTINGS[space.law]
    middle = {
        name: value
        for name, value in space.candidate(space.start).of_law.items()
        if name not in kind.weight_names() and name != _WEIGHT
    }
    at_most = {LARGEST: space.largest_command}
    if not kind.weight_names():
        return (LawCandidate({**middle, **at_most}, "middle of the ranges"),)
    weights = kind.weights_among(space.held)
    others = {name: value for name, value in space.held.items() if name not in weights}
    # The first weights are those that the table holds.
    shapes = [(space.held, _EQUAL if weights == kind.weighed_by_default else "weights of the study")]
    if space.any_weights:
        further = of_regulators if kind.is_regulator else ()
        shapes += [
            ({**others, **shape}, origin) for shape, origin in (({}, "energy of the building"), *further)
        ]
    scanned = next((setting for setting in space.free if setting.name == _WEIGHT), None)
    candidates = list[LawCandidate]()
    for shape, origin in shapes:
        for size in _sizes(scanned, shape, space, magnitudes):
            candidate = LawCandidate({**shape, **middle, **size, **at_most}, origin)
            candidates += [candidate] if candidate not in candidates else []
    return tuple(candidates)


def _sizes(
    scanned: FreeSetting | None, shape: Mapping[str, Any], space: SettingSpace, magnitudes: Magnitudes
) -> list[dict[str, float]]:
    """Sizes of R of a shape of weights, logarithmically over its range; about the shape's own R where it has one.

    Of weights with a semi-active condition the budget is scanned, for it decides the law, and R hardly matters.
    """
    kind = SETTINGS[space.law]
    if is_semi_active(shape):
        size = {} if _WEIGHT in shape else {_WEIGHT: 1.0}
        return [size] if BUDGET_SCALE in shape else [{**size, BUDGET_SCALE: scale} for scale in _SCALES]
    if scanned is None:
        return [{}]
    if _WEIGHT in shape:
        weight = np.asarray(shape[_WEIGHT], dtype=np.float64)
        factors = np.geomspace(1e-5, 10.0, _STEPS + 1)
        return [{_WEIGHT: _round_all(plain_weight(factor * weight))} for factor in factors]
    # The range of R is for the weights that are held; another shape costs more or less.
    factor = kind.cost(shape, magnitudes) / kind.cost(space.held, magnitudes)
    return [{_WEIGHT: round_to(factor * scanned.value(step))} for step in np.linspace(0.0, 1.0, _STEPS + 1)]


def constant_references(bench: Bench) -> tuple[TunedLaw, ...]:
    """References at a constant command: none, the best by the score of a study, and the largest."""
    study, began = bench.study, time.perf_counter()
    found = bench.call.step("constant commands", BestConstant, lambda: scan(bench.case)[0])
    scores, devices = searched(np.array(found.scores)), study.problem.devices
    alike = len({(device.largest_command, device.spec.command_unit) for device in devices}) == 1

    def reference(label: str, kind: Kind, level: int, origin: str, count: int = 1) -> TunedLaw:
        share = float(np.linspace(0.0, 1.0, LEVELS)[level])
        commands = tuple(round_to(share * device.largest_command) for device in devices)
        settings = {"command": commands[0] if alike else commands, LARGEST: largest_command(devices)}
        return TunedLaw(
            law="passive",
            label=label,
            kind=kind,
            settings=settings,
            origin=origin,
            objective=TuningObjective(weights=dict.fromkeys(study.scored, 1.0)),
            least=float(scores[level]),
            candidates=count,
            seconds=time.perf_counter() - began,
            certificate=NO_CERTIFICATE,
        )

    best = f"best of {LEVELS} on the training motions"
    return (
        reference(PASSIVE_OFF, "passive_off", 0, "no command"),
        reference(OPTIMAL_PASSIVE, "best_passive", int(np.argmin(scores)), best, LEVELS),
        reference(PASSIVE_ON, "passive", LEVELS - 1, "largest command"),
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


def best_of(plan: LawPlan, candidates: Sequence[LawCandidate], step: str) -> tuple[TunedLaw, Scores]:
    """The law with the best of some candidates, without its certificate, and the scores of all."""
    scores = plan.scores(candidates, step)
    best = candidates[scores.best]
    return TunedLaw(
        law=plan.law,
        label=plan.label,
        settings=dict(best.settings),
        origin=best.origin,
        objective=plan.objective,
        robust=plan.table.robust,
        least=float(scores.objective[scores.best]),
        violation=float(scores.violation[scores.best]),
        candidates=len(candidates),
    ), scores


def weights_of_regulators(plan: LawPlan) -> Iterator[TunedLaw]:
    """References with weights that no search has touched: of each shape the best R, or the best budget.

    They are of a plan whose objective is over i = 0, without realisations.
    """
    taken = {row.label for row in plan.bench.study.rows if row.kind == "controller"}
    for origin, (scanned, choices) in _SCANNED.items():
        candidates = [candidate for candidate in plan.firsts if candidate.origin == origin]
        if not candidates:
            continue
        label, began = f"{origin[:1].upper()}{origin[1:]}, {scanned}", time.perf_counter()
        found, _ = best_of(plan, candidates, "reference")
        yield replace(
            found,
            label=f"{label}, reference" if label in taken else label,
            origin=f"{origin}, best of {len(candidates)} {choices} on the training motions",
            seconds=time.perf_counter() - began,
            certificate=plan.certificate(found.candidate),
        )


def tune_law(plan: LawPlan, *, rng: int, advance: Callable[[TunedLaw, int], None]) -> TunedLaw:
    """Tune a law; `advance` takes it as it is so far, and the candidates that there may be."""
    began = time.perf_counter()
    table, space, firsts = plan.table, plan.space, plan.firsts
    if not space.continuous:
        firsts = tuple(replace(candidate, origin="all levels") for candidate in space.every())
    count = len(firsts)
    tuned, scores = best_of(plan, firsts, "first candidates")
    misfit, refused = float(scores.penalised_scores[scores.best]), int(np.isinf(scores.objective).sum())
    # What is minimised; limits are told apart at the end.
    tuned = replace(tuned, least=misfit, violation=0.0, free=space.free, refused=refused)

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

    after(count, misfit, tuned.candidate, tuned.origin)
    if space.continuous:
        search = _search(plan, firsts, scores, rng, on_generation)
        if tuned.origin == _INTERRUPTED:
            tuned = replace(tuned, origin=f"search, ended {ended_in_words(search.stop_reason)}")
        start = space.unit(tuned.candidate)
        if table.gradient_steps and start is not None:
            follow = partial(follow_gradients, plan, start, table.gradient_steps)
            end = plan.bench.call.step("gradients", Finish, follow, tuned.settings)
            last = space.candidate(end.unit)
            misfit = float(plan.scores([last], "finish").penalised_scores[0])
            after(tuned.candidates + 1, misfit, last, f"search, then {end.gradients} gradients")
    alone, _ = best_of(plan, [tuned.candidate], "chosen")
    return replace(
        tuned,
        least=alone.least,
        violation=alone.violation,
        seconds=time.perf_counter() - began,
        certificate=plan.certificate(tuned.candidate),
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

    def columns(units: Floats) -> Floats:
        runs = bench.run(plan.law, [space.candidate(unit) for unit in units])
        values = [part.scores(runs, bench.baselines).objective for part in parts]
        return np.column_stack(
            [*values, *([plan.objective.violation(runs)] if plan.objective.limits else [])]
        )

    starts = [unit for candidate in plan.firsts if (unit := space.unit(candidate)) is not None]
    result = run_front(
        columns,
        n_params=len(space.free),
        n_objectives=len(parts),
        n_constraints=int(bool(plan.objective.limits)),
        population=table.population,
        budget=table.budget,
        rng=rng + table.seed,
        starts=np.array(starts).reshape(-1, len(space.free)),
        journal=bench.call.journal,
        on_generation=lambda evaluations: report(evaluations, table.budget),
    )

    def point(unit: Floats, values: Floats) -> FrontPoint:
        candidate = space.candidate(unit)
        train = dict(zip(table.objectives, values.tolist(), strict=True))
        certificate = plan.certificate(candidate)
        return FrontPoint(settings=dict(candidate.settings), train=train, certificate=certificate)

    return Front(
        law=plan.law,
        label=plan.label,
        objectives=table.objectives,
        points=tuple(map(point, result.units, result.objectives)),
        candidates=result.evaluations,
    )
