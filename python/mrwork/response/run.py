"""Run a study: every arrangement under every motion, each run once and journalled."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mrwork.closed_loop.criteria import STANDARD_GRAVITY, score, values
from mrwork.closed_loop.simulate import Responses, simulate_loop
from mrwork.journal import Journal
from mrwork.response.control_laws import constant_command
from mrwork.response.conversion import history_of, result_of, results_of
from mrwork.response.premises import digest_of_run, premises_of
from mrwork.response.results import StudyResults
from mrwork.response.run_result import History, RunResult
from mrwork.response.study import Arrangement, Study

LEVELS = 21
"""How many constant commands are tried for the best one, evenly from none to the largest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyProgress:
    """How far a study is: runs done and wanted, which one is next, time since its beginning [s]."""

    done: int
    wanted: int
    label: str
    motion: str
    seconds: float


class StudyInterrupted(KeyboardInterrupt):
    """The study was interrupted; `results` are those of the runs that are done."""

    def __init__(self, results: StudyResults) -> None:
        super().__init__("study interrupted")
        self.results = results


@dataclass(frozen=True, slots=True, kw_only=True)
class BestConstant:
    """The constant command of the least score."""

    command: float
    score: float


def run_study(
    study: Study,
    *,
    journal: Journal,
    kept: Callable[[int, int], bool] = lambda row, motion: True,
    keep: Callable[[int, int, History], None] = lambda row, motion, history: None,
    on_progress: Callable[[StudyProgress], None] = lambda progress: None,
    threads: int = 0,
) -> StudyResults:
    """Run what the journal does not know yet.

    Parameters
    ----------
    kept
        Whether the history of a (row, motion) is kept already; one that is lost is simulated again.
    keep
        Takes the history of a (row, motion).

    Raises
    ------
    StudyInterrupted
        On Ctrl-C, with the runs that are done.
    JournalError
        Where the journal is of another study.
    """
    began = time.perf_counter()
    journal.agree("study", premises_of(study))
    arrangements = list(study.arrangements)
    runs: dict[tuple[int, int], RunResult] = {}
    wanted = len(arrangements) * len(study.motions)

    def results() -> StudyResults:
        return results_of(study, tuple(each.row for each in arrangements), runs)

    try:
        for row, arrangement in enumerate(arrangements):
            if arrangement.law is None:
                arrangements[row] = _with_best_constant(study, arrangement, journal, threads)
            for motion, ground in enumerate(study.motions):
                on_progress(
                    StudyProgress(
                        done=len(runs),
                        wanted=wanted,
                        label=arrangements[row].row.label,
                        motion=ground.name,
                        seconds=time.perf_counter() - began,
                    )
                )
                runs[row, motion] = _run(study, arrangements[row], row, motion, journal, kept, keep, threads)
    except KeyboardInterrupt:
        raise StudyInterrupted(results()) from None
    return results()


def _run(
    study: Study,
    arrangement: Arrangement,
    row: int,
    motion: int,
    journal: Journal,
    kept: Callable[[int, int], bool],
    keep: Callable[[int, int, History], None],
    threads: int,
) -> RunResult:
    simulated: list[Responses] = []

    def simulate() -> RunResult:
        assert arrangement.law is not None
        simulated[:] = simulate_loop(
            arrangement.building,
            arrangement.devices,
            [arrangement.law],
            [study.motions[motion]],
            study.hardware,
            histories=study.histories,
            threads=threads,
        )
        return result_of(simulated[0], 0, arrangement)

    result = journal.once("run", digest_of_run(arrangement, study.motions[motion]), RunResult, simulate)
    if study.histories and (simulated or not kept(row, motion)):
        if not simulated:
            simulate()
        if simulated[0].history is not None:
            keep(row, motion, history_of(simulated[0].history[0], arrangement))
    return result


def _with_best_constant(
    study: Study, arrangement: Arrangement, journal: Journal, threads: int
) -> Arrangement:
    """The arrangement with the constant command that has the least score over all motions."""
    building, devices = arrangement.building, arrangement.devices
    weight = building.total_mass * STANDARD_GRAVITY

    def search() -> BestConstant:
        commands = np.linspace(0.0, max(device.largest_command for device in devices), LEVELS)
        tried = [constant_command(devices, float(command)) for command in commands]
        off, *responses = simulate_loop(
            building,
            devices,
            [constant_command(devices, 0.0), *tried],
            study.motions,
            study.hardware,
            threads=threads,
        )
        passive = [_criteria(off, motion, arrangement, weight) for motion in range(len(study.motions))]
        scores = [
            float(
                score(
                    [_criteria(each, motion, arrangement, weight) for motion in range(len(study.motions))],
                    passive,
                )
            )
            for each in responses
        ]
        # A command under which a run failed has no score.
        best = int(np.nanargmin(scores))
        return BestConstant(command=float(commands[best]), score=scores[best])

    inputs = digest_of_run(arrangement, *study.motions)
    best = journal.once("best_constant", inputs, BestConstant, search)
    unit = study.command_unit
    label = f"{arrangement.row.label}, {best.command:.3g} {unit}"
    return replace(
        arrangement,
        row=replace(arrangement.row, label=label),
        law=constant_command(devices, best.command),
    )


def _criteria(
    responses: Responses, motion: int, arrangement: Arrangement, weight: float
) -> dict[str, NDArray[np.float64]]:
    result = result_of(responses, motion, arrangement)
    found = values(result, weight=weight)
    return found if result.finished else {name: np.array(np.nan) for name in found}
