"""Runs of one row of a study at a time: recalled from the journal, or simulated and recorded."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import get_args

import numpy as np

from mrwork.buildings.groups import commanded, products_of
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.responses import history_signals
from mrwork.closed_loop.user_law import UserLaw
from mrwork.control.laws.control_law import ControlLaw
from mrwork.motions import GroundMotion
from mrwork.store.journal import Journal
from mrwork.study.constant import LEVELS, ROUNDS, BestByGroup, BestConstant, ConstantSearch
from mrwork.study.course import Course, Kind
from mrwork.study.histories import RunHistory, history_of
from mrwork.study.loop_runs import simulate, simulate_criteria
from mrwork.study.runs import (
    HALF_STEP,
    NOMINAL,
    Axes,
    Runs,
    knows_least_strokes,
    numbered,
    own_axes,
    recall_or_compute,
    recall_or_simulate,
    runs_of,
    study_criteria,
    study_quantities,
)
from mrwork.study.study import Arrangement, Study, constant_commands, digest_of_run
from mrwork.workers.engine import present_workers

# Histories that need more memory than this are simulated one at a time [bytes].
_MOST_BYTES = 2.0**28
# Runs that one thread does at once where there are as many, with any law and with a rollout.
_LANES, _LANES_OF_ROLLOUT = 32, 16
# What a step of all trials of a rollout costs, in steps of the loop.
_TRIALS = 4.0
# Steps per second of the model of a rollout, where its law says none.
_MODEL_STEPS = 400.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RowRuns:
    """Runs of the rows of a study, with the journal, the histories and the progress that they share.

    `kept` and `keep` are those of `run_study`.
    """

    study: Study
    journal: Journal | None
    threads: int
    course: Course = field(default_factory=Course)
    kept: Callable[[int, int], bool] = lambda row, motion: True
    keep: Callable[[int, int, RunHistory], None] = lambda row, motion, history: None
    # Best shares of the largest commands that were found, by the arrangement.
    _shares: dict[str, BestConstant] = field(default_factory=dict)

    def axes(self, rows: Sequence[Arrangement], motions: Sequence[int], realisations: Sequence[str]) -> Axes:
        """Axes of the runs of some rows under some motions, with the floors, storeys and devices of all rows."""
        return {
            "row": tuple(each.row.label for each in rows),
            "motion": tuple(self.study.motions[motion].name for motion in motions),
            "realisation": tuple(realisations),
            **own_axes(self.study.arrangements),
        }

    def with_best_constant(self, arrangement: Arrangement, done: int) -> tuple[Arrangement, str]:
        """The arrangement at its best constant commands, and a sentence on the choice."""
        study, devices = self.study, arrangement.devices
        search = ConstantSearch(
            arrangement=arrangement,
            motions=study.chosen_on,
            hardware=study.hardware,
            threads=self.threads,
            on_block=self.course.advance,
        )
        inputs = digest_of_run(arrangement, *study.chosen_on)
        best: BestConstant | BestByGroup
        if inputs not in self._shares:
            self._begin(arrangement, "constant commands", done, LEVELS)
            self._shares[inputs] = recall_or_compute(
                self.journal, "best_constant", inputs, BestConstant, search.best_share
            )
        best = self._shares[inputs]
        if arrangement.by_group:
            self._begin(arrangement, "constant commands of groups", done, n_constant(arrangement))
            start = best
            best = recall_or_compute(
                self.journal, "best_by_group", inputs, BestByGroup, lambda: search.best_by_group(start)
            )
        label = f"{arrangement.row.label}, {best.label(devices)}"
        row, law = replace(arrangement.row, label=label), constant_commands(best.commands)
        return replace(arrangement, row=row, law=law), best.in_words(label, devices)

    def nominal(self, row: int, arrangement: Arrangement, done: int) -> Runs:
        """The nominal runs of a row, of which the histories that the study keeps are stored."""
        self._begin(arrangement, "", done)
        recalling = self.journal is not None and self.journal.recalling
        runs = self._recall_or_simulate("runs", arrangement, lambda: self._in_batches(row, arrangement))
        for motion in self._stored(range(len(self.study.motions)), runs):
            if recalling and not self.kept(row, motion):
                self._simulate(row, arrangement, [motion], detailed=True)
        return runs

    def with_half_step(self, row: int, arrangement: Arrangement, done: int) -> Runs:
        """The runs of a row with half the integration step."""
        self._begin(arrangement, HALF_STEP, done, times=2.0)
        every = range(len(self.study.motions))
        return self._recall_or_simulate(
            "runs with half the step",
            arrangement,
            lambda: self._simulate(row, arrangement, every, step_factor=2),
        )

    def realised(self, arrangement: Arrangement, done: int) -> Runs:
        """Criteria of a row with the realisations of the study."""
        study, realisations, law = self.study, self.study.realisations, arrangement.law
        assert realisations is not None
        assert law is not None
        self._begin(arrangement, "realisations", done, len(realisations))
        return recall_or_simulate(
            self.journal,
            "realisations",
            digest_of_run(arrangement, *study.grounds),
            self.axes([arrangement], range(len(study.motions)), numbered(len(realisations))),
            study_criteria(study.command_unit),
            lambda: simulate_criteria(
                arrangement,
                law,
                study.grounds,
                study.hardware,
                realisations,
                bare=study.building,
                threads=self.threads,
                on_block=self.course.advance,
            ),
        )

    def _recall_or_simulate(self, step: str, arrangement: Arrangement, simulate: Callable[[], Runs]) -> Runs:
        return recall_or_simulate(
            self.journal,
            step,
            digest_of_run(arrangement, *self.study.grounds),
            self.axes([arrangement], range(len(self.study.motions)), [NOMINAL]),
            study_quantities(self.study.command_unit),
            simulate,
        )

    def _in_batches(self, row: int, arrangement: Arrangement) -> Runs:
        every, done = range(len(self.study.motions)), 0
        axes = self.axes([arrangement], every, [NOMINAL])
        runs = Runs.empty(axes, study_quantities(self.study.command_unit))
        for motions, detailed in _batches(self.study, arrangement):
            runs.put(self._simulate(row, arrangement, motions, detailed=detailed, before=done), 0, motions, 0)
            done += len(motions)
        return runs

    def _simulate(
        self,
        row: int,
        arrangement: Arrangement,
        motions: Sequence[int],
        *,
        detailed: bool = False,
        step_factor: int = 1,
        before: int = 0,
    ) -> Runs:
        """Simulate an arrangement under some motions, and store histories where it is `detailed`."""
        assert arrangement.law is not None
        responses = simulate(
            arrangement,
            arrangement.law,
            [self.study.grounds[motion] for motion in motions],
            self.study.hardware,
            motion_numbers=motions,
            histories=detailed,
            step_factor=step_factor,
            threads=self.threads,
            on_block=lambda done, _: self.course.advance(before + done, len(self.study.motions)),
        )
        runs = runs_of(responses, arrangement, arrangement.law, self.axes([arrangement], motions, [NOMINAL]))
        for motion in self._stored(motions, runs):
            if responses.histories is not None:
                self.keep(row, motion, history_of(responses.histories[motions.index(motion)], arrangement))
        return runs

    def _stored(self, motions: Sequence[int], runs: Runs) -> list[int]:
        """Motions of which the study keeps the history of a run; one without an end has numbers that are not finite."""
        finished = runs.finished[0, :, 0]
        return [
            each
            for each, ended in zip(motions, finished, strict=True)
            if ended and each in self.study.histories
        ]

    def _begin(
        self, arrangement: Arrangement, what: str, done: int, n_each: int = 1, times: float = 1.0
    ) -> None:
        label = ", ".join(filter(None, [arrangement.row.label, what]))
        motions = self.study.chosen_on if arrangement.law is None else self.study.grounds
        cost = times * cost_of(arrangement, motions, self.study.hardware, n_each, self.threads)
        self.course.begin(label, kind_of(arrangement), cost, done)


def _batches(study: Study, arrangement: Arrangement) -> list[tuple[list[int], bool]]:
    """Motions that are simulated together, and whether with their histories; these must fit into memory together.

    Small strokes leave the tested range of some dampers: the least stroke of a run is known from its history.
    """
    every = list(range(len(study.motions)))
    detailed = every if knows_least_strokes(arrangement) else [*study.histories]
    needed = _bytes_per_second(study, arrangement) * np.array([ground.duration for ground in study.grounds])
    # Workers send none back: this process simulates the runs with histories.
    if not detailed or (needed.sum() < _MOST_BYTES and present_workers() is None):
        return [(every, bool(detailed))]
    batches: list[list[int]] = [[]]
    for motion in detailed:
        if batches[-1] and needed[[*batches[-1], motion]].sum() >= _MOST_BYTES:
            batches.append([])
        batches[-1].append(motion)
    others = [motion for motion in every if motion not in detailed]
    return [*((batch, True) for batch in batches), *([(others, False)] if others else [])]


def _bytes_per_second(study: Study, arrangement: Arrangement) -> float:
    """Memory of a run's history per second of motion [bytes/s]."""
    building = arrangement.building
    columns = {
        "run": 1,
        "floor": len(building.floors),
        "storey": len(building.storeys),
        "device": max(len(arrangement.devices), 1),
        "element": len(building.elements),
        "state": 2 * building.n_coordinates,
    }
    width = sum(columns[signal.axis] for signal in history_signals())
    return 8.0 * width / study.hardware.sample_time


def kind_of(arrangement: Arrangement) -> Kind:
    """What the runs of an arrangement are simulated by."""
    law = arrangement.law
    if not arrangement.devices:
        return "without dampers"
    if isinstance(law, UserLaw):
        return "Python"
    if arrangement.devices[0].spec.own is not None and not arrangement.has_actuators:
        return "JAX"
    return "core" if law is None or not law.spec.needs_model else "rollout"


def cost_of(
    arrangement: Arrangement,
    motions: Sequence[GroundMotion],
    hardware: Hardware,
    n_each: int,
    threads: int = 0,
) -> float:
    """Integration steps times coordinates of runs, `n_each` under each motion, where lanes and threads are full."""
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


def n_constant(arrangement: Arrangement) -> int:
    """Most constant commands that are tried for a row."""
    if arrangement.law is not None:
        return 0
    return LEVELS * (ROUNDS * len(products_of(commanded(arrangement.devices))) if arrangement.by_group else 1)


def costs_of_study(study: Study, threads: int, *, check_step: bool) -> dict[Kind, float]:
    """Sums of the costs of all runs of a study by kind."""
    costs = dict.fromkeys(get_args(Kind), 0.0)
    n_realisations = 0 if study.realisations is None else len(study.realisations)
    for each in study.arrangements:
        costs[kind_of(each)] += sum(
            times * cost_of(each, motions, study.hardware, n_each, threads)
            for motions, n_each, times in (
                (study.grounds, 1, 3.0 if check_step else 1.0),
                (study.grounds, n_realisations, 1.0),
                (study.chosen_on, n_constant(each), 1.0),
            )
        )
    return costs
