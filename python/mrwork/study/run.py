"""Run a study: every row under every motion, with realisations and with half the step; a journal records the runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor

from mrwork.base.arguments import Threads, checked
from mrwork.closed_loop.evaluation import Scales
from mrwork.errors import Interrupted
from mrwork.store.journal import Journal
from mrwork.study.course import Course, StudyProgress
from mrwork.study.damper_size import judged_by_demand
from mrwork.study.histories import RunHistory
from mrwork.study.loop_runs import scales_of
from mrwork.study.named_laws import designed
from mrwork.study.results import StudyResults
from mrwork.study.row_runs import RowRuns, costs_of_study
from mrwork.study.runs import HALF_STEP, NOMINAL, Runs, numbered, study_criteria, study_quantities
from mrwork.study.study import Arrangement, Study, fingerprint_of
from mrwork.workers.engine import Workers, on_executor


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
        Records the runs, and recalls those of a study that was interrupted; `None` for no record.
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
        have the same bits. By default this process does them, as always those of laws in Python.

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
    rows, motions = list(study.arrangements), range(len(study.motions))
    steps = (NOMINAL, HALF_STEP) if check_step else (NOMINAL,)
    n_realisations = 0 if study.realisations is None else len(study.realisations)
    costs = costs_of_study(study, threads, check_step=check_step)
    course = Course(on_progress, costs, len(rows) * len(motions) * len(steps))
    of_row = RowRuns(study=study, journal=journal, threads=threads, course=course, kept=kept, keep=keep)
    runs = Runs.empty(of_row.axes(rows, motions, steps), study_quantities(study.command_unit))
    realised = Runs.empty(
        of_row.axes(rows, motions, numbered(n_realisations)), study_criteria(study.command_unit)
    )
    choices: list[str] = []
    try:
        for row, arrangement in enumerate(rows):
            if arrangement.law is None:
                rows[row], choice = of_row.with_best_constant(arrangement, runs.n_done)
                choices.append(choice)
            runs.put(of_row.nominal(row, rows[row], runs.n_done), row, motions, 0)
        if study.realisations is not None:
            for row, arrangement in enumerate(rows):
                realised.put(of_row.realised(arrangement, runs.n_done), row, motions, 0)
        # After all other runs, so that a study without this check can be resumed with it.
        if check_step:
            for row, arrangement in enumerate(rows):
                runs.put(of_row.with_half_step(row, arrangement, runs.n_done), row, motions, 1)
    except KeyboardInterrupt:
        raise Interrupted(_results(study, rows, runs, realised, choices), "study") from None
    return _results(study, rows, runs, realised, choices)


def _results(
    study: Study, rows: Sequence[Arrangement], runs: Runs, realised: Runs, choices: Sequence[str]
) -> StudyResults:
    """Results of the runs that are done."""
    scales = Scales.of_rows([scales_of(each, study.building) for each in rows], 2)
    runs = runs.with_labels("row", [each.row.label for each in rows])
    criteria = runs.criteria(scales, study.command_unit).beside(realised)
    results = StudyResults.of(study, [each.row for each in rows], runs, criteria, choices)
    return judged_by_demand(results, study.devices, study.building, study.device_storeys)
