"""Run a study: every row under every motion, with realisations and with half the step; a journal records the runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from mrwork.base.arguments import Threads, checked
from mrwork.closed_loop.evaluation import Scales
from mrwork.closed_loop.responses import history_signals
from mrwork.closed_loop.simulate import simulate_loop
from mrwork.motions import GroundMotion
from mrwork.store.journal import Journal
from mrwork.store.long_call import LongCall
from mrwork.study.constant import BestConstant, ConstantSearch, n_constant
from mrwork.study.course import Course, Kind, StudyProgress, cost_of, kind_of
from mrwork.study.damper_size import judged_by_demand
from mrwork.study.histories import RunHistory, history_of
from mrwork.study.loop_runs import loop_of, scales_of, simulate_criteria
from mrwork.study.named_laws import designed
from mrwork.study.results import StudyResults
from mrwork.study.runs import (
    HALF_STEP,
    NOMINAL,
    Axes,
    Runs,
    knows_least_strokes,
    numbered,
    own_axes,
    recall_or_simulate,
    runs_of,
    study_criteria,
    study_quantities,
)
from mrwork.study.study import Arrangement, Study, constant_commands, digest_of_run, fingerprint_of
from mrwork.workers.engine import Workers, on_executor, present_workers

# Histories that need more memory than this are simulated one at a time [bytes].
_MOST_BYTES = 2.0**28


@checked
@on_executor
def run_study(
    study: Study,
    *,
    journal: Journal | None = None,
    kept: Callable[[int, int], bool] = lambda row, motion: True,
    keep: Callable[[int, int, RunHistory], None] = lambda row, motion, history: None,
    on_progress: Callable[[StudyProgress], None] | None = None,
    check_step: bool = False,
    threads: Threads = 0,
    executor: Executor | Workers | None = None,  # noqa: ARG001, of the decorator
) -> StudyResults:
    """Run a study; runs in the journal are not repeated.

    Parameters
    ----------
    journal
        Records the runs, and recalls them after an interrupt; `None` for no record.
    kept
        Whether the history of a (row, motion) is stored already; a missing one is simulated again.
    keep
        Stores the history of a (row, motion).
    on_progress
        Called with the progress, with the time that is left from the first runs of each kind on.
    check_step
        Repeat every run with half the step at the end.
    executor
        Does the runs in chunks: an executor of `concurrent.futures`, Dask, mpi4py or loky, or `Workers`. The results
        have the same bits. By default this process does them, as always the runs of laws in Python.

    Raises
    ------
    WorkerError
        If the executor or one of its workers is lost; a journal keeps what was finished.
    Interrupted
        On Ctrl-C, with the `StudyResults` of the runs that are done.
    JournalError
        If the journal belongs to another study.

    Examples
    --------
    >>> import mrwork as mr
    >>> results = mr.run_study(mr.read_study("study.toml"))  # doctest: +SKIP
    >>> results.criteria(0, 0)["peak_drift"]  # doctest: +SKIP
    0.0236
    """
    study = designed(study, journal=journal, on_progress=on_progress)
    if journal is not None:
        journal.agree("study", fingerprint_of(study))
    axes = {
        "row": tuple(arrangement.row.label for arrangement in study.arrangements),
        "motion": tuple(motion.name for motion in study.motions),
        "realisation": (NOMINAL, HALF_STEP) if check_step else (NOMINAL,),
        **own_axes(study.arrangements),
    }
    realised = numbered(0 if study.realisations is None else len(study.realisations))
    runs = _StudyRuns(
        study=study,
        call=LongCall(journal=journal, on_progress=on_progress, so_far=lambda: runs.results),
        threads=threads,
        kept=kept,
        keep=keep,
        rows=[*study.arrangements],
        runs=Runs.empty(axes, study_quantities(study.command_unit)),
        realised=Runs.empty({**axes, "realisation": realised}, study_criteria(study.command_unit)),
        choices=[],
    )
    with runs.call.keeping("study"):
        runs.simulate()
    return runs.results


@dataclass(slots=True, kw_only=True)
class _StudyRuns:
    """The runs of a study, filled in row by row; for the arguments see `run_study`.

    `rows` without a law get their best constant commands, on which `choices` are sentences; `shares` are the best
    shares of the largest commands that were found, by the digest of the row.
    """

    study: Study
    call: LongCall[StudyProgress, StudyResults]
    threads: int
    kept: Callable[[int, int], bool]
    keep: Callable[[int, int, RunHistory], None]
    rows: list[Arrangement]
    runs: Runs
    realised: Runs
    choices: list[str]
    course: Course = field(default_factory=Course)
    shares: dict[str, BestConstant] = field(default_factory=dict)

    def simulate(self) -> None:
        """Do all steps of the study, or recall them from the journal."""
        steps, costs = [*self._steps()], dict[Kind, float]()
        for row, _, cost, _ in steps:
            kind = kind_of(self.rows[row])
            costs[kind] = costs.get(kind, 0.0) + cost
        self.course = Course(self.call.on_progress, costs, self.runs.outcome.size)
        for row, what, cost, step in steps:
            label = ", ".join(filter(None, [self.rows[row].row.label, what]))
            self.course.begin(label, kind_of(self.rows[row]), cost, self.runs.n_done)
            step(row)

    def _steps(self) -> Iterator[tuple[int, str, float, Callable[[int], None]]]:
        """The steps of the study: row, what is simulated of it, cost, and what does it."""
        study, n_realisations = self.study, self.realised.shape[2]

        def cost(row: int, n_each: int = 1, motions: Sequence[GroundMotion] = study.grounds) -> float:
            return cost_of(self.rows[row], motions, study.hardware, n_each, self.threads)

        for row, arrangement in enumerate(study.arrangements):
            if arrangement.law is None:
                tried = cost(row, n_constant(arrangement), study.chosen_on)
                yield row, "constant commands", tried, self._choose_constants
            yield row, "", cost(row), self._simulate_nominal
        for row in range(len(self.rows)) if n_realisations else ():
            yield row, "realisations", cost(row, n_realisations), self._simulate_realised
        # After all other runs, so that a study without this check can be resumed with it.
        for row in range(len(self.rows)) if self.runs.shape[2] > 1 else ():
            yield row, HALF_STEP, 2.0 * cost(row), self._simulate_half_step

    @property
    def results(self) -> StudyResults:
        """Results of the runs that are done."""
        study, scales = self.study, Scales.of_rows([*map(scales_of, self.rows)], 2)
        runs = self.runs.with_labels("row", [row.row.label for row in self.rows])
        criteria = runs.criteria(scales, study.command_unit).beside(self.realised)
        results = StudyResults.of(study, [row.row for row in self.rows], runs, criteria, self.choices)
        return judged_by_demand(results, study)

    def _choose_constants(self, row: int) -> None:
        """Give a row its best constant commands."""
        study, arrangement = self.study, self.rows[row]
        search = ConstantSearch(
            arrangement=arrangement,
            motions=study.chosen_on,
            hardware=study.hardware,
            threads=self.threads,
            on_block=self.course.advance,
        )
        inputs = digest_of_run(arrangement, *study.chosen_on)
        if inputs not in self.shares:
            self.shares[inputs] = self.call.step("best_constant", BestConstant, search.best_share, inputs)
        best = self.shares[inputs]
        if arrangement.row.kind == "best_passive_by_group":
            by_group = partial(search.best_by_group, best)
            best = self.call.step("best_by_group", BestConstant, by_group, inputs)
        label = f"{arrangement.row.label}, {best.label(arrangement.devices)}"
        named, law = replace(arrangement.row, label=label), constant_commands(best.commands)
        self.rows[row] = replace(arrangement, row=named, law=law)
        self.choices.append(best.in_words(label, arrangement.devices))

    def _simulate_nominal(self, row: int) -> None:
        """The nominal runs of a row, of which the histories that the study keeps are stored."""
        recalling = self.call.recalling
        self._fill(self.runs, slice(1), "runs", row, lambda: self._in_batches(row))
        for motion in self._stored(range(len(self.study.motions)), self.runs.of_row(row)):
            if recalling and not self.kept(row, motion):
                self._simulate(row, [motion], detailed=True)

    def _simulate_half_step(self, row: int) -> None:
        """The runs of a row with half the integration step."""
        simulate = partial(self._simulate, row, range(len(self.study.motions)), step_factor=2)
        self._fill(self.runs, slice(1, 2), "runs with half the step", row, simulate)

    def _simulate_realised(self, row: int) -> None:
        """Criteria of a row with the realisations of the study."""
        study, arrangement = self.study, self.rows[row]
        assert arrangement.law is not None
        simulate = partial(
            simulate_criteria,
            arrangement,
            arrangement.law,
            study.grounds,
            study.hardware,
            study.realisations,
            threads=self.threads,
            on_block=self.course.advance,
        )
        self._fill(self.realised, slice(None), "realisations", row, simulate)

    def _fill(
        self, into: Runs, realisations: slice, step: str, row: int, simulate: Callable[[], Runs]
    ) -> None:
        """Fill in some realisations of a row, from the journal or simulated, and then recorded."""
        part = into.part(slice(row, row + 1), realisations=realisations)
        inputs = digest_of_run(self.rows[row], *self.study.grounds)
        made = recall_or_simulate(self.call.journal, step, inputs, part.axes, part.declared, simulate)
        into.put(made, row, range(len(self.study.motions)), realisations.start or 0)

    def _axes(self, row: int, motions: Sequence[int]) -> Axes:
        """Axes of the nominal runs of a row under some motions."""
        return self.runs.part(slice(row, row + 1), [*motions], slice(1)).axes

    def _in_batches(self, row: int) -> Runs:
        runs, done = Runs.empty(self._axes(row, range(len(self.study.motions))), self.runs.declared), 0
        for motions, detailed in _batches(self.study, self.rows[row]):
            runs.put(self._simulate(row, motions, detailed=detailed, before=done), 0, motions, 0)
            done += len(motions)
        return runs

    def _simulate(
        self,
        row: int,
        motions: Sequence[int],
        *,
        detailed: bool = False,
        step_factor: int = 1,
        before: int = 0,
    ) -> Runs:
        """Simulate a row under some motions, and store histories where it is `detailed`."""
        study, arrangement = self.study, self.rows[row]
        assert arrangement.law is not None
        building, devices, law, hardware = loop_of(arrangement, arrangement.law, study.hardware)
        responses = simulate_loop(
            building,
            devices,
            law,
            [study.grounds[motion] for motion in motions],
            hardware,
            motion_numbers=motions,
            histories=detailed,
            step_factor=step_factor,
            threads=self.threads,
            on_progress=lambda done, _: self.course.advance(before + done, len(study.motions)),
        )
        runs = runs_of(responses, arrangement, arrangement.law, self._axes(row, motions))
        for motion in self._stored(motions, runs):
            if responses.histories is not None:
                self.keep(row, motion, history_of(responses.histories[motions.index(motion)], arrangement))
        return runs

    def _stored(self, motions: Sequence[int], runs: Runs) -> list[int]:
        """Motions of which the study keeps the history of a run; one without an end has numbers that are not finite."""
        ended = zip(motions, runs.finished[0, :, 0], strict=True)
        return [motion for motion, finished in ended if finished and motion in self.study.histories]


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
    sizes = {
        "floor": len(building.floors),
        "storey": len(building.storeys),
        "element": len(building.elements),
    }
    sizes |= {"run": 1, "device": max(len(arrangement.devices), 1), "state": 2 * building.n_coordinates}
    return 8.0 * sum(sizes[signal.axis] for signal in history_signals()) / study.hardware.sample_time
