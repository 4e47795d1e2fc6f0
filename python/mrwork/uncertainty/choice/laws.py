"""Choice of current laws: which parameters follow the command, and by which law, by the fit to tests left out.

The laws of one model after the other are tried, and the best are fitted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from mrwork.base.arguments import Threads, checked
from mrwork.base.blas import on_one_blas_thread
from mrwork.base.labelled import NamedArrays, WithAxes
from mrwork.base.summary import Summarised, Summary
from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats
from mrwork.dampers.law_sets import NEARLY_AS_WELL, farthest_apart
from mrwork.dampers.laws import LawName, law_of
from mrwork.dampers.simulation import simulate_forces
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.identification.batch import JournalOf
from mrwork.identification.fit import Fit
from mrwork.identification.identify import identify_from, identify_with
from mrwork.identification.problem import Problem, fingerprint_of
from mrwork.identification.progress import Progress
from mrwork.identification.result import fit_at
from mrwork.identification.settings import FitSettings, Fold
from mrwork.records import DamperTest, observed
from mrwork.records.damper_test import as_tests, loading_of
from mrwork.store.journal import Journal
from mrwork.store.long_call import LongCall
from mrwork.uncertainty.choice.choose import (
    ChoiceProgress,
    Steps,
    compared_models,
    refuse_unknown,
    select_known,
)
from mrwork.uncertainty.choice.law_search import FittedLaws, LawSearch, prepare_search
from mrwork.uncertainty.choice.law_table import LawTable, judge_laws, sentence_on
from mrwork.uncertainty.choice.objections import dying_laws

# Most sets of laws beside the chosen one that are fitted to the whole tests, and by how much the forces of any two
# differ at least, per standard deviation of the tests, under motions of the tests that are enlarged by a factor.
_MOST_OTHERS = 4
_LEAST_APART = 0.001
_BEYOND = 1.4


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LawChoice(WithAxes, Summarised):
    """The laws that were tried, the fit of the chosen ones to all tests, and the seconds that all took.

    `others` are fits of up to four sets that predict nearly as well, within 1 point, those that differ most beyond the
    tests, best predictions first.
    """

    table: LawTable
    fit: Fit
    others: tuple[Fit, ...] = ()
    seconds: float

    def _named_arrays(self) -> NamedArrays:
        return self.table._named_arrays()

    def _summary(self) -> Summary:
        return self.table._summary()


@dataclass(slots=True, kw_only=True)
class RunningLawChoice:
    """A choice of laws in progress; `firsts` are the fits with first laws, by model."""

    tests: tuple[DamperTest, ...]
    compared: tuple[LawSearch, ...]
    given: Mapping[str, LawName]
    remarks: tuple[str, ...]
    threads: int
    steps: Steps[LawChoice]
    firsts: dict[str, Fit] = field(default_factory=dict)

    @property
    def fitted_laws(self) -> list[FittedLaws]:
        """The sets of laws that were fitted."""
        return [laws for search in self.compared for laws in search.fitted]

    def evaluate(self, search: LawSearch) -> None:
        """Try the laws of a model."""
        with self._failing_alone(search):
            self.firsts[search.name] = self.steps.run(
                f"{search.name}/first", partial(self._first_fit, search)
            )
            self.steps.run(f"{search.name}/laws", partial(self._try_laws, search))

    def make_choice(self) -> LawChoice:
        """The choice, with the fit of the chosen laws to the whole tests, without models that cannot be fitted."""
        while self.fitted_laws:
            table = self._table(complete=True)
            search, candidate, settings = self._choose_start(table)
            with self._failing_alone(search):
                fit = self.steps.run(
                    f"{search.name}/fit", partial(self._final_fit, search, candidate, settings)
                )
                return self._with_others(LawChoice(table=table, fit=fit, seconds=self.steps.seconds))
            search.fitted.clear()
        reasons = "; ".join(f"{name}: {reason}" for name, reason in self.steps.failed.items())
        raise SettingError(f"none of the models could be fitted ({reasons})")

    def so_far(self) -> LawChoice | None:
        """The choice among the laws that are done, with the fit that led to it; `None` before there are any."""
        if not self.fitted_laws:
            return None
        table = self._table(complete=False)
        search, candidate, settings = self._choose_start(table)
        problem = Problem.of(candidate.spec, self.tests, settings, threads=self.threads)
        fit = fit_at(
            problem,
            problem.inside(candidate.fit.theta[0]),
            covariance=None,
            trace=replace(self.firsts[search.name].trace, stop_reason="interrupted"),
            steps=0,
            status="interrupted",
            seconds=self.steps.seconds,
        )
        return LawChoice(table=table, fit=fit, seconds=fit.seconds)

    def _failing_alone(self, search: LawSearch) -> AbstractContextManager[None]:
        """Records why one of several models cannot be fitted; errors of the only model are raised."""
        return nullcontext() if len(self.compared) == 1 else self.steps.recording_failure(search.name)

    def _first_fit(self, search: LawSearch, journal: Journal | None) -> Fit:
        spec, _ = search.model(search.first_laws)
        return identify_with(
            spec,
            search.tests,
            search.excerpt_settings,
            threads=self.threads,
            on_progress=partial(self._report, search, "first laws"),
            journal=journal,
            warns=False,
            examines=False,
        )

    def _try_laws(self, search: LawSearch, journal: Journal | None) -> None:
        search.report = partial(self._report, search)
        search.call = LongCall(journal=journal)
        if journal is not None:
            spec, _ = search.model(search.first_laws)
            facts = fingerprint_of(Problem.of(spec, search.tests, search.excerpt_settings))
            journal.agree(
                "choice of laws",
                facts
                | {
                    "leave_out": search.splits.fold,
                    "given": {name: str(law) for name, law in search.given.items()},
                },
            )
        search.run(self.firsts[search.name])

    def _with_others(self, choice: LawChoice) -> LawChoice:
        """The choice with the fits of other sets that predict nearly as well, without those that fail."""
        done: list[Fit] = []

        def so_far() -> LawChoice:
            return replace(choice, others=tuple(done), seconds=self.steps.seconds)

        self.steps.so_far = so_far
        others = self._choose_others(choice.table)
        for number, (search, candidate) in enumerate(others, start=1):
            settings = replace(search.settings, starts=(candidate.start,))
            refit = partial(self._final_fit, search, candidate, settings, other=f"{number} of {len(others)}")
            with self.steps.recording_failure(name := f"{search.name}/near_{number}"):
                done.append(self.steps.run(name, refit))
        return so_far()

    def _choose_others(self, table: LawTable) -> list[tuple[LawSearch, FittedLaws]]:
        """Of the sets that predict nearly as well, those whose forces differ most beyond the tests, best first.

        They are compared under the fastest motion at each command, enlarged, and halfway to the next command. One of
        them has the laws of the chosen one through the same values in their other form, which no test tells apart.
        """
        chosen = table.chosen_laws
        near = [
            each
            for each in table.tried
            if each.verdict not in ("chosen", "unusable")
            and each.left_out_percent >= chosen.left_out_percent - NEARLY_AS_WELL
        ]
        searches = {each.name: each for each in self.compared}
        first, *others = ((own := searches[each.model], own.candidate(each)) for each in (chosen, *near))
        sets, rows = list[tuple[LawSearch, FittedLaws]](), list[Floats]()
        for search, candidate in (first, *self._other_form(*first), *others):
            tests = sorted(search.tests, key=lambda test: float(np.abs(test.velocity).max()))
            forces = []
            fastest = {test.command_in(search.unit): test for test in tests}
            between = dict.fromkeys(0.5 * (search.commands[:-1] + search.commands[1:]), tests[-1])
            for command, test in (*fastest.items(), *between.items()):
                beyond = replace(
                    loading_of(test, candidate.spec),
                    displacement=_BEYOND * test.displacement,
                    velocity=_BEYOND * test.velocity,
                    command=command,
                )
                run = simulate_forces(candidate.spec, candidate.fit.theta[:1], beyond.history())
                forces.append(run.force[0] / np.std(test.force))
            row = np.concatenate(forces)
            if np.isfinite(row).all() or not sets:
                sets.append((search, candidate))
                rows.append(np.nan_to_num(row))
        return [sets[row] for row in sorted(farthest_apart(np.array(rows), _MOST_OTHERS, _LEAST_APART))]

    def _other_form(self, search: LawSearch, chosen: FittedLaws) -> list[tuple[LawSearch, FittedLaws]]:
        """The chosen laws in their other form, without those that die in it; empty where there are none."""
        other = search.in_other_form(chosen, [each.name for each in chosen.spec.plain if each.scale == "log"])
        dying = {each.parameter for each in dying_laws(other.spec, chosen.fit.theta[0], self.tests)}
        other = search.in_other_form(other, [*dying])
        return [(search, other)] if other.laws != chosen.laws else []

    def _final_fit(
        self,
        search: LawSearch,
        candidate: FittedLaws,
        settings: FitSettings,
        journal: Journal | None,
        *,
        other: str = "",
    ) -> Fit:
        task = f"all tests, {other} other sets of laws" if other else "all tests"
        return identify_from(
            candidate.spec,
            self.tests,
            settings,
            box=candidate.box,
            trace=self.firsts[search.name].trace,
            threads=self.threads,
            on_progress=partial(self._report, search, task),
            journal=journal,
            examines=not other,
        )

    def _table(self, *, complete: bool) -> LawTable:
        """The laws that were fitted in their order, chosen from by the one-standard-error rule."""
        search = self.compared[0]
        distinct = [replace(laws.tried, model=own.name) for own in self.compared for laws in own.distinct()]
        n_same = len(self.fitted_laws) - len(distinct)
        same = [f"not listed: {n_same} with the same force as laws with fewer parameters"] if n_same else []
        tried = judge_laws(distinct)
        table = LawTable(
            model=next(laws.model for laws in tried if laws.verdict == "chosen"),
            unit=search.unit,
            tried=tried,
            sentence="",
            held_out=search.splits.in_words,
            n_folds=len(search.splits.splits),
            given=dict(self.given),
            complete=complete,
            models=self.steps.models,
            failed=dict(self.steps.failed),
            remarks=(*self.remarks, *search.splits.remarks, *same),
        )
        return replace(table, sentence=sentence_on(table))

    def _choose_start(self, table: LawTable) -> tuple[LawSearch, FittedLaws, FitSettings]:
        """The search of the chosen laws, their candidate, and the settings of the fit that starts there."""
        search = next(own for own in self.compared if own.name == table.model)
        candidate = search.candidate(table.chosen_laws)
        return search, candidate, replace(search.settings, starts=(candidate.start,))

    def _report(self, search: LawSearch, task: str, within: Progress | None = None) -> None:
        scores = [laws.score for laws in self.fitted_laws]
        best = 100.0 * (1.0 - min(scores, default=np.nan))
        self.steps.tell(
            ChoiceProgress(
                model=search.name, task=task, within=within, n_tried=len(scores), left_out_percent=best
            )
        )


@checked
@on_one_blas_thread
def choose_laws(
    model: DamperSpec | str | Sequence[DamperSpec | str],
    tests: DamperTest | Sequence[DamperTest],
    *,
    laws: Mapping[str, LawName] | None = None,
    unit: CommandUnit = "A",
    leave_out: Fold | None = None,
    settings: FitSettings | None = None,
    threads: Threads = 0,
    on_progress: Callable[[ChoiceProgress], None] | None = None,
    journal_of: JournalOf | None = None,
) -> LawChoice:
    """Choose the laws by which parameters of a model follow the command, and the model where several are given.

    The first laws, with every positive parameter quadratic in the command, are identified from all tests by a global
    search. From there on neighbours of the best laws are tried, of the simplest as good, and of others as good: those
    that promise most when the tests are linearised. Laws are given by values at commands, as many as a polynomial of
    the degree has coefficients, with logarithms between them or direct. All are fitted to all tests and to all but
    those of each split, see `choose_model`, and judged by their predictions of the tests left out. Laws that vanish
    within the tested commands are not chosen while others are left. Of all that are as good as the best within one
    standard error, those with the fewest parameters are chosen, first of those that are not costly in a building, and
    fitted to the whole tests. So are up to four others, which predict at most 1 point worse and differ most beyond the
    tests. The laws of several models stand in one table and are judged alike; a model that cannot be fitted is named
    there.

    Parameters
    ----------
    model
        A model without current laws, or its name; several of them, or "all".
    laws
        Laws that are given and not to be chosen.
    leave_out
        Tests that are left out together: those of one motion where there are three motions or more, else each test.
    settings
        Settings of the identifications, see `identify`. A parameter with bounds remains constant, unless it has a
        law in `laws`; starts are refused. Of several models, each takes the laws and bounds
        of the parameters that it has.
    threads
        Threads of the simulation, 0 for all.
    on_progress
        Called before each fit and during the first identification of a model and the last one.
    journal_of
        Opens the journal of each step of the choice, by name; see `Journal`.

    Raises
    ------
    SettingError
        Where the tests run at fewer commands than a law needs, fewer than two tests or motions are given, the
        settings cannot be used, or none of several models could be fitted.
    UnknownNameError
        Where a model is unknown, or a law or bound names a parameter that no model has.
    Interrupted
        On Ctrl-C, carrying the `LawChoice` so far, `None` before any laws are fitted.

    Examples
    --------
    >>> import mrwork as mr
    >>> tests = mr.read_damper_tests(["rig/10mm1Hz0A.csv", "rig/10mm1Hz1A.csv"])  # doctest: +SKIP
    >>> mr.choose_laws("normalised_bouc_wen", tests).table  # doctest: +SKIP
    """
    settings = settings or FitSettings()
    tests = tuple(observed(test, settings.observe) for test in as_tests(tests))
    specs, remarks = compared_models(model)
    given = dict(laws or {})
    several = len(specs) > 1
    if several:
        known = {name for spec in specs for name in spec.names}
        refuse_unknown("law", given, known)
        refuse_unknown("bound", settings.bounds, known)
    compared = []
    for spec in specs:
        # A single model refuses what is given for parameters that it has not.
        own = replace(settings, bounds=select_known(settings.bounds, spec)) if several else settings
        own_laws = {
            name: law_of(law) for name, law in (select_known(given, spec) if several else given).items()
        }
        compared.append(prepare_search(spec, tests, own_laws, unit, leave_out, own, threads))
    running = RunningLawChoice(
        tests=tests,
        compared=tuple(compared),
        given=given,
        remarks=remarks,
        threads=threads,
        steps=Steps(
            models=tuple(search.name for search in compared), journal_of=journal_of, on_progress=on_progress
        ),
    )
    running.steps.so_far = running.so_far
    with running.steps.keeping("choice of laws"):
        for search in compared:
            running.evaluate(search)
        return running.make_choice()
