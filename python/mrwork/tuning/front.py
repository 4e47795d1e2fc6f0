"""The Pareto front of a law over several criteria, each point with its settings and certificate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mrwork.search.nondominated import FrontResult, run_front
from mrwork.store import digest_of
from mrwork.study.batches import RunCriteria
from mrwork.tuning.benches import Benches, recorded
from mrwork.tuning.first_candidates import Basis, first_candidates
from mrwork.tuning.law_tuning import Plan, Report
from mrwork.tuning.objective import PENALTY, Objective
from mrwork.tuning.problem import Bench, described
from mrwork.tuning.results import Front, FrontPoint
from mrwork.tuning.space import Candidate

Floats = NDArray[np.float64]


def front_of(plan: Plan, benches: Benches, basis: Basis, *, rng: int, report: Report) -> Front:
    """Search the front of a law on the training motions, and evaluate its points on the test motions."""
    table, space = plan.table, plan.space
    bench = benches.searched(robust=table.robust)
    parts = [replace(plan.objective, weights={name: 1.0}) for name in table.objectives]

    def objectives(units: Floats) -> Floats:
        candidates = [space.candidate(unit) for unit in units]
        found = bench.run(plan.law, candidates)
        return _ratios(found, bench, parts) + PENALTY * parts[0].violation(found)[:, None]

    firsts = [each.candidate for each in first_candidates(space, basis)]
    starts = [unit for each in firsts if (unit := space.unit(each)) is not None]
    found: FrontResult = run_front(
        objectives,
        n_params=len(space.free),
        n_objectives=len(parts),
        population=table.population,
        budget=table.budget,
        rng=rng + table.seed,
        starts=np.array(starts).reshape(-1, len(space.free)),
        journal=benches.journal,
        on_generation=lambda evaluations: report(evaluations, float("nan")),
    )
    candidates = _distinct([space.candidate(unit) for unit in found.units])
    train = _evaluated(benches, bench, plan, parts, candidates)
    testing = benches.tested(robust=table.robust)
    test = None if testing is None else _evaluated(benches, testing, plan, parts, candidates)
    points = [
        FrontPoint(
            settings=dict(described(candidate)),
            train=dict(zip(table.objectives, train[place].tolist(), strict=True)),
            test=None if test is None else dict(zip(table.objectives, test[place].tolist(), strict=True)),
            certificate=bench.certificate(plan.law, candidate),
        )
        for place, candidate in enumerate(candidates)
    ]
    return Front(
        law=plan.law,
        label=plan.label,
        objectives=table.objectives,
        points=tuple(points),
        candidates=found.evaluations,
    )


def _ratios(found: RunCriteria, bench: Bench, parts: list[Objective]) -> Floats:
    """The objectives of candidates over their baseline, shape (n_candidates, n_objectives)."""
    return np.column_stack([part.value(part.run_scores(found, bench.baseline(part))) for part in parts])


def _evaluated(
    benches: Benches, bench: Bench, plan: Plan, parts: list[Objective], candidates: list[Candidate]
) -> Floats:
    inputs = digest_of(plan.label, candidates, [motion.name for motion in bench.motions])
    found = recorded(
        benches.journal,
        "front",
        inputs,
        RunCriteria,
        bench.shape_of(len(candidates)),
        lambda: bench.run(plan.law, candidates),
    )
    return _ratios(found, bench, parts)


def _distinct(candidates: list[Candidate]) -> list[Candidate]:
    kept: list[Candidate] = []
    for each in candidates:
        if each not in kept:
            kept.append(each)
    return kept
