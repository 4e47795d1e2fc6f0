"""Choice of current laws: which parameters follow the command, and by which law, by the fit to tests left out.

The laws of one model after the other are tried, and the best are fitted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from mrwork.base.arguments import Threads, checked
from mrwork.base.blas import on_one_blas_thread
from mrwork.base.progress import OnProgress, Progress
from mrwork.base.remark import Measured, RemarkKind
from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats
from mrwork.dampers.dependence import CURVE_FORMS, LawName, dependence_of
from mrwork.dampers.law_sets import NEARLY_AS_WELL, farthest_apart
from mrwork.dampers.parameters import DRIVER_RATE
from mrwork.dampers.simulation import Loading, simulate_forces
from mrwork.dampers.spec import DamperSpec
from mrwork.identification.batch import JournalOf, with_journal
from mrwork.identification.fit import Fit, FitStatus, SearchTrace
from mrwork.identification.identify import identify_with
from mrwork.identification.minimise.race import same_minimum
from mrwork.identification.problem import Problem, problem_fingerprint
from mrwork.identification.result import fit_at
from mrwork.identification.settings import FitSettings, Fold, Start
from mrwork.records import DamperTest, observed
from mrwork.records.damper_test import as_tests
from mrwork.store.journal import Journal
from mrwork.store.long_call import LongCall
from mrwork.uncertainty.choice.choose import Choice, Choosing, refuse_unknown, select_known
from mrwork.uncertainty.choice.dependence_search import (
    DependenceSearch,
    DependenceSet,
    FittedSet,
    prepare_search,
)
from mrwork.uncertainty.choice.objections import dying_dependences, fastest_at_commands
from mrwork.uncertainty.choice.ranking import Ranking, Standing
from mrwork.uncertainty.choice.screening import compared_models

# Most sets of laws beside the chosen one that are kept with it, most that differ from it between the tested commands
# alone, and by how much the forces of any two differ at least, per standard deviation of the tests, under motions of
# the tests that are enlarged by a factor.
_MOST_OTHERS, _MOST_FORMS = 4, 2
_LEAST_APART = 0.001
_BEYOND = 1.4
_NO_LAG = RemarkKind("lag_not_shown", "{0} shows no lag of the driver, which is left out of its laws")
_NOT_LISTED = RemarkKind("laws_not_listed", "not listed: {value:.0f} with the force of simpler laws")


@dataclass(slots=True, kw_only=True, eq=False)
class _ChoosingLaws(Choosing):
    """A choice of laws that runs; `firsts` are the fits with first laws, by model."""

    searches: dict[str, DependenceSearch]
    given: Mapping[str, LawName]
    unit: CommandUnit
    firsts: dict[str, Fit] = field(default_factory=dict)

    @property
    def fitted_laws(self) -> list[FittedSet]:
        return [laws for search in self.searches.values() for laws in search.fitted]

    def evaluate(self, search: DependenceSearch) -> None:
        """Fit the first laws of a model, then try their neighbours; one of several models may fail."""
        with self._failing_alone(search):
            first = self._fit_alone(
                search, search.first_laws, "first laws", search.first_settings, search.tests
            )
            self.firsts[search.name] = first
            # Else the laws make up for what moves with the damper, or comes late.
            search.take_effects(first)
            if search.promises.model.lag != first.spec.lag:
                search.take_lag(first.spec.lag)
                if not first.spec.n_rates:
                    self.remarks += (_NO_LAG.remark(search.name),)
            with_journal(self.journal_of, f"{search.name}/laws", partial(self._try_laws, search))

    def choice(self) -> Choice:
        """The choice, with the fit of the chosen laws to the whole tests, without models that cannot be fitted."""
        while True:
            ranking = self._rank(complete=True)
            search, laws = self._fitted(ranking.chosen_standing)
            with self._failing_alone(search):
                fit = with_journal(
                    self.journal_of, f"{search.name}/fit", partial(self._final_fit, search, laws)
                )
                others = [self._fit_to_excerpts(*other) for other in self._choose_others(ranking)]
                fit = replace(fit, others=tuple(others))
                return Choice(ranking=ranking, fits=(fit,), seconds=self.seconds)
            search.fitted.clear()

    def best_so_far(self) -> Choice | None:
        """The choice among the laws that are done, with the fit that led to it; `None` before there are any."""
        if not any(laws.row.has_predicted for laws in self.fitted_laws):
            return None
        ranking = self._rank(complete=False)
        fit = self._fit_to_excerpts(*self._fitted(ranking.chosen_standing), status="interrupted")
        return Choice(ranking=ranking, fits=(fit,), seconds=self.seconds)

    def _failing_alone(self, search: DependenceSearch) -> AbstractContextManager[None]:
        """Records why one of several models cannot be fitted; errors of the only model are raised."""
        return nullcontext() if len(self.searches) == 1 else self.recording_failure(search.name)

    def _fit_alone(
        self,
        search: DependenceSearch,
        laws: DependenceSet,
        what: str,
        settings: FitSettings,
        tests: tuple[DamperTest, ...],
        near: Start | None = None,
    ) -> Fit:
        """The fit of laws to the excerpts by a search of their own, which begins `near` one if that is given."""
        spec, _ = search.model(laws)
        settings = replace(settings, bounds=search.bounds_of(laws))

        def fit(journal: Journal | None) -> Fit:
            return identify_with(
                spec,
                tests,
                settings,
                threads=self.threads,
                on_progress=partial(self._report, search, what),
                journal=journal,
                warns=False,
                examines=False,
                near=near,
            )

        return with_journal(self.journal_of, f"{search.name}/{what.split()[0]}", fit)

    def _confirmed(self, search: DependenceSearch, laws: FittedSet) -> tuple[Start, SearchTrace, str]:
        """The chosen laws as they fit the excerpts best, by which search, and why a lower minimum is possible, or "".

        The laws were reached from neighbours, which may all be in one false minimum; a search of their own is not.
        """
        alone = self.firsts[search.name]
        doubt = alone.status_reason if alone.status == "lower_minimum_possible" else ""
        if laws.laws == search.first_laws:
            return laws.start, alone.trace, doubt
        tests = search.observed(search.tests, laws)
        alone = self._fit_alone(search, laws.laws, "chosen laws", search.excerpt_settings, tests, laws.start)
        doubt = alone.status_reason if alone.status == "lower_minimum_possible" else ""
        near, own = 0.0, np.inf
        if alone.spec.names == laws.spec.names:
            objective = search.folds.excerpts.with_laws(laws.spec)
            rows = np.array([laws.fit.theta[0], alone.theta])
            near, own = objective(np.hstack([rows, laws.fit.effects[[0, 0]]])).tolist()
        if max(near, own) <= same_minimum(min(near, own)):
            return laws.start, alone.trace, ""
        if near < own:
            return (
                laws.start,
                alone.trace,
                "only fits from other laws met the least one, and a search of these laws did not",
            )
        return dict(zip(laws.spec.names, alone.theta, strict=True)), alone.trace, doubt

    def _try_laws(self, search: DependenceSearch, journal: Journal | None) -> None:
        search.report = partial(self._report, search)
        search.call = LongCall(journal=journal)
        if journal is not None:
            spec, _ = search.model(search.first_laws)
            facts = problem_fingerprint(Problem.of(spec, search.tests, search.excerpt_settings))
            texts = {name: str(law) for name, law in search.given.items()}
            journal.agree("choice of laws", facts | {"leave_out": search.folds.splits.fold, "given": texts})
        search.run(self.firsts[search.name])

    def _final_fit(self, search: DependenceSearch, laws: FittedSet, journal: Journal | None) -> Fit:
        start, trace, doubt = self._confirmed(search, laws)
        return identify_with(
            laws.spec,
            self.tests,
            replace(search.settings, starts=(start,), bounds=search.bounds_of(laws.laws)),
            threads=self.threads,
            on_progress=partial(self._report, search, "all tests"),
            journal=journal,
            warns=False,
            searched=(laws.box, trace),
            doubt=doubt,
        )

    def _fit_to_excerpts(
        self, search: DependenceSearch, laws: FittedSet, status: FitStatus = "converged"
    ) -> Fit:
        """Laws as they were fitted to the excerpts, with their quality on the whole tests."""
        bounded = replace(search.settings, bounds=search.bounds_of(laws.laws))
        settings = bounded.with_effects(search.effects_of(laws))
        problem = Problem.of(laws.spec, search.observed(self.tests, laws), settings, threads=self.threads)
        trace = self.firsts[search.name].trace
        return fit_at(
            problem,
            problem.inside(laws.fit.theta[0]),
            covariance=None,
            trace=replace(trace, stop_reason=status) if status == "interrupted" else trace,
            steps=0,
            status=status,
            seconds=self.seconds,
        )

    def _choose_others(self, ranking: Ranking) -> list[tuple[DependenceSearch, FittedSet]]:
        """Of the sets that predict nearly as well, those whose forces differ most beyond the tests, best first.

        They are compared under the fastest motion at each command, enlarged. Then come laws of the chosen one through
        the same values in other forms, which no test tells apart, by the fastest motion halfway to the next command.
        """
        chosen = ranking.chosen_standing
        near = [
            standing
            for standing in ranking.standings
            if standing.verdict in ("as good", "behind")
            and 100.0 * (standing.error - chosen.error) <= NEARLY_AS_WELL
        ]
        first, *others = (self._fitted(neighbour) for neighbour in (chosen, *near))
        search, laws = first
        fastest = fastest_at_commands(laws.spec, search.tests)
        test, loading = max(fastest, key=lambda pair: float(np.abs(pair[0].velocity).max()))
        between = 0.5 * (search.commands[:-1] + search.commands[1:])
        halfway = [(test, replace(loading, command=command)) for command in between.tolist()]
        return [
            *_farthest_apart([first, *others], fastest, _MOST_OTHERS),
            *_farthest_apart([first, *self._other_forms(*first)], halfway, _MOST_FORMS),
        ]

    def _other_forms(
        self, search: DependenceSearch, chosen: FittedSet
    ) -> list[tuple[DependenceSearch, FittedSet]]:
        """The chosen laws all in one form, but for those that die in it; empty where there is no other form."""
        sets = list[tuple[DependenceSearch, FittedSet]]()
        for form in CURVE_FORMS:
            instead = {
                parameter.name: law
                for parameter, own in chosen.spec.law_pairs
                for law in own.other_forms(parameter)
                if law.form == form
            }
            dying = dying_dependences(
                search.in_other_form(chosen, instead).spec, chosen.fit.theta[0], self.tests
            )
            for limit in dying:
                instead.pop(limit.parameter, None)
            other = search.in_other_form(chosen, instead)
            if other.laws != chosen.laws:
                sets.append((search, other))
        return sets

    def _rank(self, *, complete: bool) -> Ranking:
        rows = [laws.row for search in self.searches.values() for laws in search.distinct()]
        n_same = len(self.fitted_laws) - len(rows)
        same = [_NOT_LISTED.remark(measured=Measured(n_same, ""))] if n_same else []
        rows += [self.failing(model) for model in self.models if model.name in self.failed]
        return self.ranked(
            rows, remarks=(*self.remarks, *same), unit=self.unit, given=dict(self.given), complete=complete
        )

    def _fitted(self, standing: Standing) -> tuple[DependenceSearch, FittedSet]:
        search = self.searches[standing.model]
        return search, next(
            laws for laws in search.fitted if (laws.row.laws, laws.row.held) == (standing.laws, standing.held)
        )

    def _report(self, search: DependenceSearch, task: str, within: Progress | None = None) -> None:
        errors = [laws.row.error for laws in self.fitted_laws]
        numbers, tried = dict[str, float](), list[str]()
        if errors:
            numbers = {"n_tried": len(errors), "left_out_percent": 100.0 * (1.0 - min(errors))}
            tried = [f"{len(errors)} tried, best left-out fit {numbers['left_out_percent']:.2f} %"]
        self.tell(search.name, task, *tried, within=within, numbers=numbers)


def _farthest_apart(
    sets: Sequence[tuple[DependenceSearch, FittedSet]],
    motions: Sequence[tuple[DamperTest, Loading]],
    most: int,
) -> list[tuple[DependenceSearch, FittedSet]]:
    """Of the sets but the first those whose forces differ most from it and each other under enlarged motions."""
    rows, finite = list[Floats](), list[tuple[DependenceSearch, FittedSet]]()
    for search, laws in sets:
        forces = []
        for test, loading in motions:
            beyond = replace(
                loading, displacement=_BEYOND * test.displacement, velocity=_BEYOND * test.velocity
            )
            run = simulate_forces(laws.spec, laws.fit.theta[:1], beyond.history())
            forces.append(run.force[0] / np.std(test.force))
        row = np.concatenate(forces)
        if np.isfinite(row).all() or not rows:
            rows.append(np.nan_to_num(row))
            finite.append((search, laws))
    return [finite[index] for index in sorted(farthest_apart(np.array(rows), most, _LEAST_APART))]


@checked
@on_one_blas_thread
def choose_laws(
    model: DamperSpec | str | Sequence[DamperSpec | str],
    tests: DamperTest | Sequence[DamperTest],
    *,
    laws: Mapping[str, LawName] | None = None,
    unit: CommandUnit = "A",
    lagged: bool = False,
    leave_out: Fold | None = None,
    settings: FitSettings | None = None,
    threads: Threads = 0,
    on_progress: OnProgress | None = None,
    journal_of: JournalOf | None = None,
) -> Choice:
    """Choose the laws by which parameters of a model follow the command, and the model where several are given.

    The first laws, with every positive parameter quadratic in the command, are identified from all tests by a global
    search. Then neighbours of the best set of laws, of the simplest equally good set and of other equally good sets are
    fitted, those first whose linearised fit promises the largest improvement. Laws are given by values at commands, as
    many as a polynomial of the degree has coefficients, with logarithms between them or direct. All are fitted to all
    tests and without the tests of each split, see `choose_model`, and judged by their predictions of the tests left
    out. Laws that vanish within the tested commands are not chosen while others are left. Of all that are as good as
    the best within one standard error, those with the fewest parameters are chosen, first of those that are not costly
    in a building, and fitted to the whole tests. Up to four others, which predict at most 1 point worse and differ most
    beyond the tests, are kept as they were fitted to cycles from the middle, and up to two that differ from the chosen
    laws between the tested commands alone. The laws of several models stand in one
    ranking and are judged alike; a model that cannot be fitted is a row of it.

    Parameters
    ----------
    model
        A model without current laws, or its name; several of them, "all", or "screened": those of all that go on from
        `screen_families`.
    laws
        Laws that are given and not to be chosen.
    lagged
        Whether the driver lags behind a command that varies; the rate is fitted with each set of laws. A lag that the
        first laws do not want is left out.
    leave_out
        Tests that are left out together: whole motions where there are three or more, else single tests. Of one or two
        records of a varying command stretches of time are left out.
    settings
        Settings of the identifications, see `identify`. A parameter with bounds remains constant, unless it has a
        law in `laws`; starts are refused. Of several models, each takes the laws and bounds
        of the parameters that it has.
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
        On Ctrl-C, carrying the `Choice` so far, `None` before any laws are fitted.

    Examples
    --------
    >>> import mrwork as mr
    >>> tests = mr.read_damper_tests(["rig/10mm1Hz0A.csv", "rig/10mm1Hz1A.csv"])  # doctest: +SKIP
    >>> mr.choose_laws("normalised_bouc_wen", tests).ranking  # doctest: +SKIP
    """
    settings = settings or FitSettings()
    tests = tuple(observed(test, settings.observing) for test in as_tests(tests))
    specs, remarks, screened = compared_models(
        model, tests, settings, threads=threads, on_progress=on_progress, journal_of=journal_of
    )
    laws = dict(laws or {})
    names = [name for spec in specs for name in spec.names]
    refuse_unknown("law", laws, names)
    refuse_unknown("bound", settings.bounds, [*names, DRIVER_RATE.name] if lagged else names)
    searches = {
        spec.name: prepare_search(
            spec,
            tests,
            {name: dependence_of(law) for name, law in select_known(laws, spec).items()},
            unit,
            leave_out,
            replace(
                settings,
                bounds=select_known(
                    settings.bounds, spec.with_current_laws({}, lag="one_rate" if lagged else "none")
                ),
            ),
            threads,
            lagged=lagged,
        )
        for spec in specs
    }
    splits = searches[specs[0].name].folds.splits
    running = _ChoosingLaws(
        tests=tests,
        models=specs,
        splits=splits,
        remarks=(*remarks, *splits.remarks),
        screened=screened,
        threads=threads,
        journal_of=journal_of,
        on_progress=on_progress,
        searches=searches,
        given=laws,
        unit=unit,
    )
    running.so_far = running.best_so_far
    with running.keeping("choice of laws"):
        for search in searches.values():
            running.evaluate(search)
        return running.choice()
