"""Candidates that no search has touched: those tried before it, and the references it is compared with."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from mrwork.base.numbers import round_to
from mrwork.buildings.groups import largest_command
from mrwork.closed_loop.evaluation import SCORE, searched
from mrwork.control.laws.design_ground import PEAK_FACTOR, ground_of
from mrwork.control.laws.law_problem import DesignProblem, Magnitudes
from mrwork.control.laws.law_settings import SETTINGS
from mrwork.control.linear.lqr import PUBLISHED_REGULATORS, plain_weight
from mrwork.control.weights.weight_solver import design_weights
from mrwork.errors import SettingError
from mrwork.study.constant import LEVELS, BestConstant, ConstantSearch
from mrwork.study.schema import OPTIMAL_PASSIVE, PASSIVE_OFF, PASSIVE_ON
from mrwork.study.study import Kind
from mrwork.tuning.law_plan import Bench, LawPlan
from mrwork.tuning.results import TunedLaw
from mrwork.tuning.space import (
    BUDGET_SCALE,
    LARGEST,
    FreeSetting,
    LawCandidate,
    SettingSpace,
    TuningObjective,
    is_semi_active,
)

_STEPS = 12
_WEIGHT = "control_weight"
EQUAL, CONVEX, DASHPOTS = "equal drift weights", "convex weights", "weights of dashpots"
"""Origins of weights whose size of R is scanned."""
SEMI_ACTIVE = "semi-active weights"
"""Origin of weights whose budget of force is scanned."""
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
    convex, semi_active = list[Shape](), list[Shape]()
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
            convex.append((weights, CONVEX))
    # Where the weights of limits exist, their semi-active form does, too.
    for limit in limits if convex else ():
        semi_active.append(({"designed": {**limit, "semi_active": _SHARE}}, SEMI_ACTIVE))
    published = [
        ({"accelerations": entry.weights, _WEIGHT: entry.control_weight}, f"published weights {entry.name}")
        for entry in PUBLISHED_REGULATORS
        if entry.n_floors == len(problem.building.floor_names)
    ]
    return [({"rates": 1.0}, DASHPOTS), *convex, *semi_active, *published]


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
    shapes = [(space.held, EQUAL if weights == kind.weighed_by_default else "weights of the study")]
    if space.any_weights:
        further = of_regulators if kind.is_regulator else ()
        shapes += [({**others, **shape}, name) for shape, name in (({}, "energy of the building"), *further)]
    scanned = next((setting for setting in space.free if setting.name == _WEIGHT), None)
    return distinct(
        LawCandidate({**shape, **middle, **R, **at_most}, origin)
        for shape, origin in shapes
        for R in _sizes(scanned, shape, space, magnitudes)
    )


def _sizes(
    scanned: FreeSetting | None, shape: Mapping[str, Any], space: SettingSpace, magnitudes: Magnitudes
) -> list[dict[str, float]]:
    """Sizes of R of a shape of weights, logarithmically over its range; about the shape's own R where it has one.

    Of weights with a semi-active condition the budget is scanned, for it decides the law, and R hardly matters.
    """
    kind = SETTINGS[space.law]
    if is_semi_active(shape):
        R = {} if _WEIGHT in shape else {_WEIGHT: 1.0}
        return [R] if BUDGET_SCALE in shape else [{**R, BUDGET_SCALE: scale} for scale in _SCALES]
    if scanned is None:
        return [{}]
    if _WEIGHT in shape:
        weight = np.asarray(shape[_WEIGHT], dtype=np.float64)
        factors = np.geomspace(1e-5, 10.0, _STEPS + 1)
        return [{_WEIGHT: _round_all(plain_weight(factor * weight))} for factor in factors]
    # The range of R is for the weights that are held; another shape costs more or less.
    factor = kind.cost(shape, magnitudes) / kind.cost(space.held, magnitudes)
    return [{_WEIGHT: round_to(factor * scanned.value(step))} for step in np.linspace(0.0, 1.0, _STEPS + 1)]


def constant_commands(bench: Bench) -> tuple[TunedLaw, ...]:
    """References at a constant command: none, the best by the score of a study, and the largest."""
    study, began = bench.study, time.perf_counter()
    search = ConstantSearch(
        arrangement=replace(study.at_zero, law=None),
        motions=study.chosen_on,
        hardware=study.hardware,
        threads=bench.threads,
    )
    found = bench.call.step("constant commands", BestConstant, lambda: search.scan()[0])
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
            objective=TuningObjective(weights=dict.fromkeys(SCORE, 1.0)),
            least=float(scores[level]),
            candidates=count,
            seconds=time.perf_counter() - began,
            certificate=bench.certificate("passive", LawCandidate(settings)),
        )

    best = f"best of {LEVELS} on the training motions"
    return (
        reference(PASSIVE_OFF, "passive_off", 0, "no command"),
        reference(OPTIMAL_PASSIVE, "best_passive", int(np.argmin(scores)), best, LEVELS),
        reference(PASSIVE_ON, "passive", LEVELS - 1, "largest command"),
    )


def weights_of_regulators(plan: LawPlan) -> Iterator[TunedLaw]:
    """References with weights that no search has touched: of each shape the best R, or the best budget.

    They are of a plan whose objective is over i = 0, without realisations.
    """
    taken = {row.label for row in plan.bench.study.rows if row.kind == "controller"}
    of_R, of_budget = ("R scanned", "sizes of R"), ("budget scanned", "limits and budgets")
    for origin in (EQUAL, CONVEX, DASHPOTS, SEMI_ACTIVE):
        candidates = [candidate for candidate in plan.firsts if candidate.origin == origin]
        if not candidates:
            continue
        scanned, choices = of_budget if origin == SEMI_ACTIVE else of_R
        label, began = f"{origin[:1].upper()}{origin[1:]}, {scanned}", time.perf_counter()
        scores = plan.scores(candidates, "reference")
        best = candidates[scores.best]
        yield TunedLaw(
            law=plan.law,
            label=f"{label}, reference" if label in taken else label,
            settings=dict(best.settings),
            origin=f"{origin}, best of {len(candidates)} {choices} on the training motions",
            objective=plan.objective,
            least=float(scores.objective[scores.best]),
            violation=float(scores.violation[scores.best]),
            candidates=len(candidates),
            seconds=time.perf_counter() - began,
            certificate=plan.bench.certificate(plan.law, best),
        )


def distinct(candidates: Iterable[LawCandidate]) -> tuple[LawCandidate, ...]:
    """Candidates without repetition, in order."""
    unique: list[LawCandidate] = []
    for candidate in candidates:
        if candidate not in unique:
            unique.append(candidate)
    return tuple(unique)
