"""One cell of the study: a model, a search and a test, run many times side by side."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork.identification import Objective
from mrwork.records import DamperTest
from mrwork.search import AbortableObjective, Optimiser, run_replicates
from studies.chapter_4.search_settings import ComparisonSettings, Model
from studies.former.arrays import Floats
from studies.former.damper_tests import TestSet

Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cell:
    """Replicates, from 0, of one search of one model on one test.

    The seed is that of the test and the model, so that replicate k starts from the same population in every search.
    """

    tests: str
    test: DamperTest
    model: Model
    search: str
    optimiser: Optimiser[Any]
    seed: int
    replicates: int

    @property
    def name(self) -> str:
        return f"{self.tests}, {self.test.current:g} A, {self.model.label}, {self.search}"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Replicates:
    """Results of the replicates of one cell.

    `best` misfit (an NRMSE) up to each generation and `evaluations` up to then, both (n_replicates, n_generations),
    generation 0 being the initial population; `unit` (n_replicates, n_free) the best find of each. `spared` is the
    share of time steps that early abort saved, `seconds` the wall time.
    """

    best: Floats
    evaluations: Integers
    unit: Floats
    spared: float
    seconds: float

    @property
    def final(self) -> Floats:
        """Misfit after the last generation, shape (n_replicates,)."""
        return self.best[:, -1]

    @property
    def ranked(self) -> Integers:
        """Numbers of the replicates, lowest misfit first."""
        return np.argsort(self.final, kind="stable")


def cells_of(settings: ComparisonSettings, sets: Sequence[TestSet]) -> tuple[Cell, ...]:
    """Every cell of the study, set by set."""
    return tuple(
        Cell(
            tests=tests.name,
            test=test,
            model=model,
            search=search,
            optimiser=optimiser,
            seed=_seed(settings.seed, f"{tests.name}, {test.current:g} A, {model.label}"),
            replicates=settings.replicates,
        )
        for tests in sets
        for model in settings.models
        for test in tests.tests
        for search, optimiser in settings.optimisers().items()
    )


def run_cell(cell: Cell, *, threads: int) -> Replicates:
    """Run all replicates of a cell together: one call of the simulation per generation."""
    box = cell.model.box(cell.test)
    objective = Objective.of(cell.model.spec, (cell.test,), threads=threads)

    def misfits(unit: Floats, threshold: Floats) -> Floats:
        # Without a threshold there is nothing to look out for.
        limits = threshold if np.isfinite(threshold).any() else None
        return objective(np.asarray(box.theta_from_unit(unit)), limits)

    run = run_replicates(
        cell.optimiser,
        AbortableObjective(misfits=misfits),
        rng=cell.seed,
        n_params=len(box.free),
        replicates=range(cell.replicates),
    )
    course, tally = run.state.course, objective.tally
    return Replicates(
        best=course.trace.best,
        evaluations=course.trace.evaluations,
        unit=course.best_unit,
        spared=tally.spared / (tally.spared + tally.steps),
        seconds=run.seconds,
    )


def _seed(seed: int, name: str) -> int:
    return int.from_bytes(hashlib.sha256(f"{seed} {name}".encode()).digest()[:8], "big")
