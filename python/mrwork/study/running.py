"""Run a study: every row under every motion, with realisations and with half the step; a journal records the runs."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial

from mrwork.base.arguments import Threads, checked
from mrwork.base.progress import OnProgress
from mrwork.closed_loop.evaluation import Scales
from mrwork.store.journal import Journal
from mrwork.store.long_call import LongCall
from mrwork.study.damper_size import judged_by_demand
from mrwork.study.histories import RunHistory
from mrwork.study.loop_case import LoopCase, criterion_scales
from mrwork.study.results import StudyResults
from mrwork.study.row_runs import RowRuns
from mrwork.study.run_options import CheckStep
from mrwork.study.run_reports import RunReports, What, steps_of
from mrwork.study.runs import HALF_STEP, NOMINAL, Runs, numbered, own_axes, study_criteria, study_quantities
from mrwork.study.study import Arrangement, Study, digest_of_run, study_fingerprint
from mrwork.study.trials import BestConstant, designed, with_best_commands
from mrwork.workers.engine import Workers, on_executor


@checked
@on_executor
def run_study(
    study: Study,
    *,
    journal: Journal | None = None,
    kept: Callable[[int, int], bool] = lambda row, motion: True,
    keep: Callable[[int, int, RunHistory], None] = lambda row, motion, history: None,
    on_progress: OnProgress | None = None,
    check_step: CheckStep = False,
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
    executor
        Does the runs in chunks: an executor of `concurrent.futures`, Dask, mpi4py or loky, or `Workers`. The results
        have the same bits. By default this process does them, as always the runs of laws of the user.

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
        journal.agree("study", study_fingerprint(study))
    so_far, shares = _SoFar.at_start(study, check_step=check_step), dict[str, BestConstant]()
    rows, runs = so_far.arrangements, so_far.runs
    nominal, halved = runs["runs"], runs["runs with half the step"]
    call = LongCall(journal=journal, on_progress=on_progress, so_far=so_far.results)
    with call.keeping("study"):
        steps = [*steps_of(study, check_step=check_step, threads=threads)]
        course = RunReports(on_progress, steps, nominal.outcome.size + halved.outcome.size)
        for step in steps:
            arrangement, recalling = rows[step.row], call.recalling
            course.begin(arrangement.row.label, step, nominal.n_done + halved.n_done)
            case = LoopCase(
                arrangement=arrangement,
                motions=study.grounds,
                hardware=study.hardware,
                realisations=study.realisations if step.what == "realisations" else None,
                threads=threads,
                on_block=course.advance,
                asked=study.asked,
                scored=study.scored,
            )
            if step.what == "constant commands":
                rows[step.row], choice = with_best_commands(
                    replace(case, motions=study.chosen_on), call, shares
                )
                so_far.choices.append(choice)
                continue
            of_row = RowRuns(case=case, stored=study.histories, keep=partial(keep, step.row))
            inputs, simulate = digest_of_run(arrangement, *study.grounds), partial(of_row.simulate, step.what)
            made = runs[step.what].of_row(step.row).recalled(journal, step.what, inputs, simulate)
            runs[step.what].put(made, step.row)
            if recalling and step.what == "runs":
                of_row.store(made, partial(kept, step.row))
    return so_far.results()


def unrun(study: Study) -> StudyResults:
    """Results of a study of which no run is done; its laws need not be designed."""
    return _SoFar.at_start(study, check_step=False).results()


@dataclass(frozen=True, slots=True, kw_only=True)
class _SoFar:
    """What is done of a study: its runs by kind, and its arrangements with the constant commands that were chosen."""

    study: Study
    arrangements: list[Arrangement]
    choices: list[str]
    runs: dict[What, Runs]

    @classmethod
    def at_start(cls, study: Study, *, check_step: bool) -> _SoFar:
        axes = {
            "row": tuple(row.label for row in study.rows),
            "motion": tuple(ground.name for ground in study.grounds),
        }
        realisations: dict[What, tuple[str, ...]] = {
            "runs": (NOMINAL,),
            "runs with half the step": (HALF_STEP,) if check_step else (),
            "realisations": numbered(len(study.realisations or ())),
        }
        unit, asked = study.command_unit, study.asked
        quantities, criteria = study_quantities(unit, asked), study_criteria(unit, asked)
        runs = {
            what: Runs.empty(
                {**axes, "realisation": labels, **own_axes(study.arrangements)},
                criteria if what == "realisations" else quantities,
            )
            for what, labels in realisations.items()
        }
        return cls(study=study, arrangements=[*study.arrangements], choices=[], runs=runs)

    def results(self) -> StudyResults:
        nominal, halved, realised = self.runs.values()
        rows = [arrangement.row for arrangement in self.arrangements]
        done = nominal.beside(halved).with_labels("row", [row.label for row in rows])
        scales = Scales.of_rows([*map(criterion_scales, self.arrangements)], 2)
        criteria = done.criteria(scales, self.study.command_unit, self.study.asked).beside(realised)
        return judged_by_demand(StudyResults.of(self.study, rows, done, criteria, self.choices), self.study)
