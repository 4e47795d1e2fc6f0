"""Course of a study: its steps, where it stands, and how long it will take, by costs and the rate of what is done."""

from __future__ import annotations

import math
import os
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mrwork.base.progress import OnProgress, Progress, time_left
from mrwork.buildings.groups import commanded, products_of
from mrwork.closed_loop.hardware import Hardware
from mrwork.control.laws.control_law import ControlLaw
from mrwork.motions import GroundMotion
from mrwork.study.study import Arrangement, Study
from mrwork.workers.engine import by_whom

Kind = Literal["without dampers", "core", "rollout", "Python"]
"""What a row is simulated by: runs of one kind have one rate."""

What = Literal["constant commands", "runs", "realisations", "runs with half the step"]
"""What is simulated of a row at once: the runs themselves, constant commands before them, what is asked for beside."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """What is simulated of a row, by its index; `cost` is in integration steps times coordinates."""

    row: int = 0
    what: What = "runs"
    kind: Kind = "core"
    cost: float = 0.0


_NO_COST = Step()


class RunReports:
    """Reports of runs in progress, of these steps; recalled runs do not count for a rate."""

    def __init__(
        self, on_progress: OnProgress | None = None, steps: Sequence[Step] = (), total: int = 0
    ) -> None:
        self._on_progress, self._total = on_progress, total
        self._left = sum((Counter({step.kind: step.cost}) for step in steps), Counter[Kind]())
        self._seconds, self._simulated = Counter[Kind](), Counter[Kind]()
        # Of the present step: the share that has been simulated, its label, and runs before it.
        self._step, self._share, self._label, self._done = _NO_COST, 0.0, "", 0
        self._began = self._step_began = time.perf_counter()

    def begin(self, label: str, step: Step = _NO_COST, done: int = 0) -> None:
        """Report that a step begins, before which so many runs were done; the step before ends."""
        self._left, self._seconds, self._simulated = self._standing(1.0)
        self._step, self._share, self._done = step, 0.0, done
        self._label = label if step.what == "runs" else f"{label}, {step.what}"
        self._step_began = time.perf_counter()
        self.advance(0, 1)

    def advance(self, done: int, total: int) -> None:
        """Report how many of the present runs have been simulated."""
        self._share = done / total
        if self._on_progress is None or done == total:
            return
        within = f" {done:,} of {total:,}" if done else ""
        runs = [f"{self._done} of {self._total} runs"] if self._total else []
        costs, rated, simulated = self._standing(self._share)
        if simulated["core"] > 0.0 and not simulated["rollout"]:
            simulated["rollout"], rated["rollout"] = simulated["core"], rated["core"]
        left = time_left(costs, simulated, rated) if self._total else None
        seconds = time.perf_counter() - self._began
        self._on_progress(
            Progress(
                stage="study",
                said=(*runs, f"{self._label}{within}{by_whom()}"),
                share=None if left is None else seconds / max(seconds + left, 1e-9),
                numbers={"runs": self._done},
                seconds=seconds,
                left=left,
            )
        )

    def _standing(self, gone: float) -> tuple[Counter[Kind], ...]:
        """By kind: cost that is left where this share of the step is gone, seconds and what they simulated."""
        passed = time.perf_counter() - self._step_began if self._share else 0.0
        parts = (gone * self._step.cost, passed, self._share * self._step.cost)
        left, seconds, simulated = (Counter({self._step.kind: part}) for part in parts)
        return self._left - left, self._seconds + seconds, self._simulated + simulated


LEVELS = 21
"""Number of constant commands, equally spaced from zero to the largest, among which the best is chosen."""
ROUNDS = 2
"""Most rounds of the search for a constant command of each group."""
# Runs that one thread does at once where there are as many, with any law and with a rollout.
_LANES, _LANES_OF_ROLLOUT = 32, 16
# What a step of all trials of a rollout costs, in steps of the loop.
_TRIALS = 4.0
# Steps per second of the model of a rollout, where its law says none.
_MODEL_STEPS = 400.0


def steps_of(study: Study, *, check_step: bool, threads: int = 0) -> Iterator[Step]:
    """Steps of a study with their costs: each row, then realisations, then runs with half the step."""
    rows, n_realisations = range(len(study.arrangements)), len(study.realisations or ())

    def step(row: int, what: What, n_each: int = 1, motions: Sequence[GroundMotion] = study.grounds) -> Step:
        arrangement = study.arrangements[row]
        cost = _cost(arrangement, motions, study.hardware, n_each, threads)
        cost *= 2.0 if what == "runs with half the step" else 1.0
        return Step(row=row, what=what, kind=_kind_of(arrangement), cost=cost)

    for row, arrangement in enumerate(study.arrangements):
        if arrangement.law is None:
            yield step(row, "constant commands", n_constant(arrangement), study.chosen_on)
        yield step(row, "runs")
    yield from (step(row, "realisations", n_realisations) for row in rows if n_realisations)
    # After all other runs, so that a study without this check can be resumed with it.
    yield from (step(row, "runs with half the step") for row in rows if check_step)


def n_constant(arrangement: Arrangement) -> int:
    """Most constant commands that are tried for a row without a law."""
    by_group = arrangement.row.kind == "best_passive_by_group"
    return LEVELS * (ROUNDS * len(products_of(commanded(arrangement.devices))) if by_group else 1)


def _kind_of(arrangement: Arrangement) -> Kind:
    law = arrangement.law
    if not arrangement.devices:
        return "without dampers"
    if law is not None and not isinstance(law, ControlLaw):
        return "Python"
    return "core" if law is None or not law.spec.needs_model else "rollout"


def _cost(
    arrangement: Arrangement, motions: Sequence[GroundMotion], hardware: Hardware, n_each: int, threads: int
) -> float:
    """Cost of runs, `n_each` under each motion, where lanes and threads are full."""
    law, lanes = arrangement.law, _LANES
    steps = hardware.steps / hardware.sample_time
    if isinstance(law, ControlLaw) and law.spec.needs_model:
        lanes = _LANES_OF_ROLLOUT
        decision, step, *_ = np.ravel(law.tables["timing"]).tolist()
        steps += (
            _TRIALS * float(np.max(law.gains["horizon"])) * (1.0 / step if step else _MODEL_STEPS) / decision
        )
    rounds = math.ceil(n_each * len(motions) / lanes / (threads or os.cpu_count() or 1))
    seconds = sum(motion.duration for motion in motions) / max(len(motions), 1)
    return steps * seconds * rounds * arrangement.building.n_coordinates
