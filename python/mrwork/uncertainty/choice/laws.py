"""Choice of current laws: which parameters follow the command, and by which law, by the fit to tests left out."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

import numpy as np

from mrwork.arguments import Threads, checked
from mrwork.dampers.parameters import CommandUnit, LawName
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.errors import Interrupted
from mrwork.identification.fit import Fit
from mrwork.identification.identify import identify_from, identify_with
from mrwork.identification.problem import Problem, fingerprint_of
from mrwork.identification.progress import Progress
from mrwork.identification.result import fit_at
from mrwork.identification.settings import FitSettings
from mrwork.records import DamperTest, observed
from mrwork.records.damper_test import as_tests
from mrwork.store import Journal
from mrwork.summary import Summarised, Summary
from mrwork.uncertainty.bands.prediction import Fold, held_out_words
from mrwork.uncertainty.choice.choose import JournalOf
from mrwork.uncertainty.choice.law_search import prepared
from mrwork.uncertainty.choice.law_table import LawTable, law_table

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LawChoice(Summarised):
    """The laws that were tried, the fit of the chosen ones to all tests, and the seconds that all took."""

    table: LawTable
    fit: Fit
    seconds: float

    def _summary(self) -> Summary:
        return self.table._summary()


@dataclass(frozen=True, slots=True, kw_only=True)
class LawProgress:
    """Progress of a choice of laws: `n_tried` sets of laws are done, the best left-out fit is `left_out_percent`.

    `task` is what is done now; `within` is the progress of the first or the last identification.
    """

    task: str
    n_tried: int
    left_out_percent: float
    seconds: float
    within: Progress | None = None


@checked
def choose_laws(
    model: DamperSpec | str,
    tests: DamperTest | Sequence[DamperTest],
    *,
    laws: Mapping[str, LawName] | None = None,
    unit: CommandUnit = "A",
    leave_out: Fold | None = None,
    settings: FitSettings | None = None,
    threads: Threads = 0,
    on_progress: Callable[[LawProgress], None] | None = None,
    journal_of: JournalOf | None = None,
) -> LawChoice:
    """Choose which parameters of a model follow the command, and by polynomials of which degree.

    The first laws, with every positive parameter quadratic in the command, are identified from all tests by a global
    search. From there one law at a time is lowered by a degree, the one for which the linearised fit loses least; the
    best laws of that path are raised again where that promises a better fit. Laws are given by values at commands, as
    many as a polynomial of the degree has coefficients. All are fitted to all tests and to all but
    those of each fold, and judged by their predictions of the tests left out. Of all laws that are as
    good as the best within one standard error, those with the fewest parameters are chosen and fitted to the whole
    tests.

    Parameters
    ----------
    model
        A model without current laws, or its name.
    laws
        Laws that are given and not to be chosen.
    leave_out
        Tests that are left out together: those of one motion where there are three motions or more, else each test.
    settings
        Settings of the identifications, see `identify`. A parameter with bounds remains constant, unless it has a
        law in `laws`; starts and a power other than 2 are refused.
    threads
        Threads of the simulation, 0 for all.
    on_progress
        Called before each fit and during the first and the last identification.
    journal_of
        Opens the journal of each step of the choice, by name; see `Journal`.

    Raises
    ------
    SettingError
        Where the tests run at fewer commands than a law needs, fewer than two tests or motions are given, or the
        settings cannot be used.
    Interrupted
        On Ctrl-C, carrying the `LawChoice` so far, `None` before the first laws are fitted.

    Examples
    --------
    >>> import mrwork as mr
    >>> tests = mr.read_damper_tests(["rig/10mm1Hz0A.csv", "rig/10mm1Hz1A.csv"])  # doctest: +SKIP
    >>> mr.choose_laws("normalised_bouc_wen", tests).table  # doctest: +SKIP
    """
    began = time.perf_counter()
    settings = settings or FitSettings()
    tests = tuple(observed(test, settings.observe) for test in as_tests(tests))
    plain = damper(model) if isinstance(model, str) else model
    search = prepared(plain, tests, dict(laws or {}), unit, leave_out, settings, threads)

    def report(task: str, within: Progress | None = None) -> None:
        if on_progress is not None:
            scores = [each.score for each in search.found]
            on_progress(
                LawProgress(
                    task=task,
                    n_tried=len(scores),
                    left_out_percent=100.0 * (1.0 - min(scores, default=np.nan)),
                    seconds=time.perf_counter() - began,
                    within=within,
                )
            )

    def journalled(step: str, work: Callable[[Journal | None], T]) -> T:
        if journal_of is None:
            return work(None)
        journal = journal_of(f"{plain.name}/{step}")
        try:
            return work(journal)
        finally:
            journal.close()

    first_spec, _ = search.model(search.first_laws)
    try:
        first = journalled(
            "first",
            lambda journal: identify_with(
                first_spec,
                search.tests,
                search.settings,
                threads=threads,
                on_progress=partial(report, "first laws"),
                journal=journal,
                warns=False,
            ),
        )
    except Interrupted as interrupt:
        raise Interrupted(None, "choice of laws") from interrupt

    def table(*, complete: bool) -> LawTable:
        return law_table(
            [each.tried for each in search.found],
            model=plain.name,
            unit=unit,
            held_out=held_out_words(tests, search.leave_out),
            n_folds=len(search.folds),
            given=search.given,
            complete=complete,
        )

    def try_laws(journal: Journal | None) -> None:
        search.report = report
        search.journal = journal
        if journal is not None:
            facts = fingerprint_of(Problem.of(first_spec, search.tests, search.settings))
            journal.agree("choice of laws", facts | {"leave_out": search.leave_out, "given": search.given})
        search.run(first)

    try:
        journalled("laws", try_laws)
    except KeyboardInterrupt as interrupt:
        if not search.found:
            raise Interrupted(None, "choice of laws") from interrupt
        incomplete = table(complete=False)
        chosen, start = search.started_from(incomplete.chosen)
        started = replace(settings, starts=(start,))
        problem = Problem.of(chosen.spec, tests, started, threads=threads)
        fit = fit_at(
            problem,
            problem.inside(chosen.fit.theta[0]),
            errors=None,
            trace=replace(first.trace, stop_reason="interrupted"),
            steps=0,
            status="interrupted",
            seconds=time.perf_counter() - began,
        )
        raise Interrupted(
            LawChoice(table=incomplete, fit=fit, seconds=fit.seconds), "choice of laws"
        ) from interrupt
    done = table(complete=True)
    chosen, start = search.started_from(done.chosen)
    started = replace(settings, starts=(start,))
    try:
        fit = journalled(
            "fit",
            lambda journal: identify_from(
                chosen.spec,
                tests,
                started,
                box=chosen.box,
                trace=first.trace,
                threads=threads,
                on_progress=partial(report, "all tests"),
                journal=journal,
            ),
        )
    except Interrupted as interrupt:
        raise Interrupted(
            LawChoice(table=done, fit=interrupt.result, seconds=time.perf_counter() - began), "choice of laws"
        ) from interrupt
    return LawChoice(table=done, fit=fit, seconds=time.perf_counter() - began)
