"""References of a tuning: i = 0, the best constant and the largest command, and weights with R scanned."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrwork.store import digest_of
from mrwork.study.run import LEVELS
from mrwork.study.schema import TuneTable
from mrwork.tuning.benches import Benches, recorded
from mrwork.tuning.first_candidates import CONVEX, DASHPOTS, EQUAL, Basis, first_candidates
from mrwork.tuning.objective import Objective
from mrwork.tuning.problem import Scores, described, scored
from mrwork.tuning.results import LawResult
from mrwork.tuning.space import Candidate, space_of

BEST_CONSTANT = "Best constant command"
"""Label of the best constant command among the references."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reference:
    label: str
    law: str
    candidates: tuple[Candidate, ...]
    origin: str


def references_of(benches: Benches, objective: Objective, basis: Basis) -> Iterator[LawResult]:
    """The references, each the best of its candidates on the training motions, in the nominal study.

    They are compared to i = 0 also where the laws are to the best constant command, which is one of them.
    """
    objective = replace(objective, relative_to="passive_off")
    for each in _declared(basis):
        began = time.perf_counter()
        best = each.candidates[0]
        if len(each.candidates) > 1:
            scores = recorded(
                benches.journal,
                "reference",
                digest_of(each.law, each.candidates),
                Scores,
                (len(each.candidates),),
                lambda each=each: scored(benches.training, objective, each.law, each.candidates),  # type: ignore[misc]
            )
            best = each.candidates[scores.best]
        train, test = benches.judgements(each.law, best, objective, robust=False)
        yield LawResult(
            law=each.law,
            label=each.label,
            settings=dict(described(best)),
            origin=each.origin,
            train=train,
            test=test,
            candidates=len(each.candidates),
            seconds=time.perf_counter() - began,
            certificate=benches.training.certificate(each.law, best),
        )


def best_constant(references: Sequence[LawResult]) -> Candidate:
    """The best constant command among references."""
    return next(each.chosen for each in references if each.label == BEST_CONSTANT)


def _declared(basis: Basis) -> Iterator[_Reference]:
    largest = basis.magnitudes.command

    def constant(share: float) -> Candidate:
        return Candidate(settings={"command": float(f"{share * largest:.4g}")}, largest_command=largest)

    yield _Reference(label="i = 0", law="passive", candidates=(constant(0.0),), origin="no command")
    yield _Reference(
        label=BEST_CONSTANT,
        law="passive",
        candidates=tuple(constant(share) for share in np.linspace(0.0, 1.0, LEVELS)),
        origin=f"best of {LEVELS} on the training motions",
    )
    yield _Reference(
        label="Largest command", law="passive", candidates=(constant(1.0),), origin="largest command"
    )
    space = space_of(TuneTable(laws=("clipped_optimal",)), "clipped_optimal", basis.magnitudes)
    shapes: dict[str, list[Candidate]] = {}
    for first in first_candidates(space, basis):
        shapes.setdefault(first.origin, []).append(first.candidate)
    for origin in (EQUAL, CONVEX, DASHPOTS):
        if origin in shapes:
            yield _Reference(
                label=f"{origin[:1].upper()}{origin[1:]}, R scanned",
                law="clipped_optimal",
                candidates=_distinct(shapes[origin]),
                origin=f"{origin}, best of {len(shapes[origin])} sizes of R on the training motions",
            )


def _distinct(candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
    kept: list[Candidate] = []
    for each in candidates:
        if each not in kept:
            kept.append(each)
    return tuple(kept)
