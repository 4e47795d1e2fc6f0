"""Choice of model: families of models are identified, scored on data left out of their fits, and ranked.

A family is a model with the laws and bounds that apply to its parameters.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeVar
from warnings import warn

import numpy as np

from mrwork.base.arguments import Threads, checked
from mrwork.base.blas import on_one_blas_thread
from mrwork.base.keys import check_known
from mrwork.base.labelled import NamedArrays, WithAxes
from mrwork.base.progress import OnProgress, Progress
from mrwork.base.remark import Remark, RemarkKind, warnings_of
from mrwork.base.summary import Summarised, Summary
from mrwork.base.units import CommandUnit
from mrwork.dampers.dependence import LawName
from mrwork.dampers.spec import SCREENED, DamperSpec
from mrwork.errors import JournalError, MrworkError, MrworkWarning, OutputError, SettingError, WorkerError
from mrwork.identification.batch import FitBatch, FitTask, JournalOf, with_journal
from mrwork.identification.commands import CommandedTests, excerpts_of, with_dependences_at
from mrwork.identification.equivalent import joint_box, levels_needed
from mrwork.identification.fit import Fit
from mrwork.identification.problem import Problem, pooled_commands
from mrwork.identification.settings import FitSettings, Lagged, LawUnit, LeaveOut
from mrwork.records import DamperTest, observed
from mrwork.records.damper_test import as_tests
from mrwork.store.journal import Journal
from mrwork.store.long_call import LongCall, interruptible
from mrwork.uncertainty.choice.collapse import with_collapses
from mrwork.uncertainty.choice.folds import FoldedFit, Folds
from mrwork.uncertainty.choice.ranking import Ranking, Standing
from mrwork.uncertainty.choice.screening import compared_models
from mrwork.uncertainty.choice.splits import Splits, splits_of
from mrwork.workers.engine import Workers, on_executor

T = TypeVar("T")
# Share of the time of a family that its fit to all tests takes, about.
_OF_FITS = 0.7
_NO_LAW = RemarkKind("laws_of_no_parameter", "none of the parameters that follow the command is one of {0}")


def families(
    specs: Sequence[DamperSpec],
    tests: tuple[DamperTest, ...],
    *,
    laws: Mapping[str, LawName],
    unit: CommandUnit,
    lagged: bool = False,
    bounds: Mapping[str, tuple[float, float]],
) -> tuple[tuple[DamperSpec, ...], tuple[Remark, ...]]:
    """The families of models with their laws, and a remark where none follows the command."""
    lawful = []
    for spec in specs:
        names = {parameter.name for parameter in spec.plain}
        if own := {name: law for name, law in laws.items() if name in names}:
            spec = with_dependences_at(
                spec.with_current_laws({}, unit=unit, lag="one_rate" if lagged else "none"), own, tests
            )
        lawful.append(spec)
    refuse_unknown("law", laws, [parameter.name for spec in specs for parameter in spec.plain])
    refuse_unknown("bound", bounds, [name for spec in lawful for name in spec.names])
    plain = [spec.name for spec in lawful if spec.command_unit is None]
    return tuple(lawful), (_NO_LAW.remark(", ".join(plain)),) if laws and plain else ()


def select_known(values: Mapping[str, T], spec: DamperSpec) -> dict[str, T]:
    """Values by parameter name, of the parameters that a model has."""
    return {name: value for name, value in values.items() if name in spec.names}


def refuse_unknown(what: str, names: Iterable[str], known: Iterable[str]) -> None:
    """Refuse a law or bound, in words `what`, of a parameter that is not `known`."""
    for name in names:
        sentence = f"a {what} was given for {name!r}, which none of the models has as a parameter"
        check_known(name, dict.fromkeys(known), sentence, otherwise="they have")


def _refuse_few_commands(
    compared: Sequence[DamperSpec], tests: tuple[DamperTest, ...], splits: Splits
) -> None:
    rests = splits.rests if len(tests) > 1 else []
    for spec in filter(lambda spec: spec.command_unit is not None, compared):
        tested, needed = CommandedTests.of(spec, tests), levels_needed(spec)
        tested.refuse_few()
        remaining = min((len(CommandedTests.of(spec, rest).commands) for rest in rests), default=needed)
        if remaining < needed:
            raise SettingError(
                f"the current laws of {spec.name} need tests at {needed} commands, and where some are left out only "
                f"{remaining} of {len(tested.commands)} remain; give laws of a lower degree, leave out another unit of "
                "tests, or add tests at other commands"
            )


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Choice(WithAxes, Summarised):
    """The ranking of candidates, and the fits to all tests of those that could be identified, in the same order.

    Of laws only the chosen ones are fitted to the whole tests; the fit has up to six `others`, sets of laws that
    predict nearly as well, within 1 point: four that differ most beyond the tests, best predictions first, and two that
    differ most between the tested commands.
    """

    ranking: Ranking
    fits: tuple[Fit, ...]
    seconds: float = 0.0

    @property
    def best(self) -> Fit:
        """The fit of the chosen candidate, or of the provisional one, to all tests."""
        return next(fit for fit in self.fits if fit.model == self.ranking.chosen)

    def _named_arrays(self) -> NamedArrays:
        return self.ranking._named_arrays()

    def _summary(self) -> Summary:
        return self.ranking._summary()


@dataclass(slots=True, kw_only=True, eq=False)
class Choosing(LongCall[Choice]):
    """A choice that runs: its tests, models, as they were `screened`, and splits, journals, and why models failed."""

    tests: tuple[DamperTest, ...]
    models: tuple[DamperSpec, ...]
    splits: Splits
    remarks: tuple[Remark, ...]
    screened: tuple[Standing, ...]
    threads: int
    journal_of: JournalOf | None
    failed: dict[str, str] = field(default_factory=dict)

    @contextmanager
    def recording_failure(self, model: str) -> Iterator[None]:
        """Record why a model fails in the block; errors of files are raised."""
        try:
            yield
        except (JournalError, OutputError, WorkerError):
            raise
        except MrworkError as error:
            self.failed[model] = str(error)

    def tell(
        self,
        model: str,
        *said: str,
        within: Progress | None = None,
        share: float | None = None,
        numbers: Mapping[str, float] | None = None,
    ) -> None:
        """Report what is said of a model, which is named where there are several, and of the fit `within`, if any."""
        names = [each.name for each in self.models]
        of_several = [f"{model}, model {1 + names.index(model)} of {len(names)}"] if len(names) > 1 else []
        of_fit = () if within is None else within.said[:2]
        said = (*of_several, *said, *of_fit)
        self.report(Progress(stage="choice", said=said, share=share, numbers=numbers or {}))

    def failing(self, model: DamperSpec) -> Standing:
        """The standing of a model that could not be fitted, with the reason."""
        return Standing.of(model, reason=self.failed.get(model.name, ""))

    def ranked(self, candidates: Sequence[Standing], **facts: object) -> Ranking:
        """The ranking of candidates; models that have none are missing."""
        done = {candidate.model for candidate in candidates}
        missing = tuple(model.name for model in self.models if model.name not in done)
        return Ranking.of(
            candidates,
            held_out=self.splits.in_words,
            tests=tuple(test.name for test in self.splits.tests),
            splits=self.splits.splits,
            n_folds=max(len(candidate.left_out) for candidate in candidates),
            missing=missing,
            screened=self.screened,
            **facts,
        )


@dataclass(slots=True, kw_only=True, eq=False)
class _ChoosingModel(Choosing):
    """A choice of model that runs, with what is known of each family by its name."""

    settings: FitSettings
    candidates: dict[str, Standing] = field(default_factory=dict)
    fits: dict[str, Fit] = field(default_factory=dict)
    # Number of families so far.
    done: int = 0

    def batch(self) -> FitBatch:
        """The fit of each family to all tests."""
        tasks = [
            FitTask(
                spec=family,
                tests=self.tests,
                settings=self.settings_of(family),
                step=f"{family.name}/fit",
            )
            for family in self.models
        ]
        return FitBatch(
            tasks=tasks,
            threads=self.threads,
            journal_of=self.journal_of,
            on_progress=self._report_fit,
        )

    def settings_of(self, family: DamperSpec) -> FitSettings:
        """The settings with the bounds of parameters that a family has."""
        return replace(self.settings, bounds=select_known(self.settings.bounds, family))

    def evaluate(self, family: DamperSpec, batch: FitBatch) -> None:
        """Identify a family from all tests, and fit it without each split; a failure is recorded as its reason."""
        model, number = family.name, self.models.index(family)
        fit: Fit | None = None
        row = self.failing(family)
        with self.recording_failure(model):
            fit = batch.fit(number)
            self._report_fit(number, None, "left out")
            row = with_journal(self.journal_of, f"{model}/left_out", partial(self._judged, family, fit))
        self.candidates[model] = row if fit and row.left_out else self.failing(family)
        if fit is not None:
            self.fits[model] = fit
        self.done += 1

    def _judged(self, family: DamperSpec, fit: Fit, journal: Journal | None) -> Standing:
        """The row of a family by fits to all tests and without each split, which are one batch."""
        call, settings = LongCall[None](journal=journal), self.settings_of(family)
        problem = Problem.of(fit.spec, self.splits.tests, settings, threads=self.threads)
        form, effects, excerpts = problem.form, fit.effect_values, excerpts_of(problem)
        folds = Folds.of(form.spec, excerpts, self.splits, problem.settings, self.threads)
        folds = folds.with_effects(tuple(effects), told=bool(effects) and not fit.varied_effects)
        theta = np.asarray(form.from_model(np.array(fit.theta)))[None]
        box = joint_box(form, excerpts, folds.commands) if form.spec.follows_command else form.box

        def fold() -> FoldedFit:
            first = folds.first_fit(form.spec, box, theta, np.array([[*effects.values()]]))
            return folds.refined(form.spec, box, first)

        folded = call.step("left out", FoldedFit, partial(interruptible, fold), box, theta, settings)
        nrmse = folds.predict([(form.spec, folded)])[0]
        row = replace(
            Standing.of(family),
            n_params=len(form.box.free),
            status=fit.status,
            seconds=fit.seconds + call.seconds,
            fit_percent=fit.fit_percent,
        )
        ends = np.cumsum([len(members) for members in self.splits.members])[:-1]
        return row.scored(np.split(nrmse, ends), self.splits, fit.spec, np.array(fit.theta), self.tests)

    def choice(self) -> Choice:
        rows = with_collapses([*self.candidates.values()], self.fits, self.tests)
        ranking = self.ranked(rows, remarks=self.remarks)
        order = [standing.model for standing in ranking.standings if standing.model in self.fits]
        fits = tuple(self.fits[model] for model in order)
        return Choice(ranking=ranking, fits=fits, seconds=self.seconds)

    def best_so_far(self) -> Choice | None:
        """The choice so far; `None` before any family has predicted."""
        return (
            self.choice() if any(candidate.has_predicted for candidate in self.candidates.values()) else None
        )

    def _report_fit(self, number: int, within: Progress | None, task: str = "all tests") -> None:
        share = (self.done + (task != "all tests") * _OF_FITS) / len(self.models)
        self.tell(self.models[number].name, task, within=within, share=share)


@checked
@on_executor
@on_one_blas_thread
def choose_model(
    tests: DamperTest | Sequence[DamperTest],
    models: str | Sequence[DamperSpec | str] = SCREENED,
    *,
    leave_out: LeaveOut = None,
    laws: Mapping[str, LawName] | None = None,
    unit: LawUnit = "A",
    lagged: Lagged = False,
    settings: FitSettings | None = None,
    threads: Threads = 0,
    on_progress: OnProgress | None = None,
    journal_of: JournalOf | None = None,
    executor: Executor | Workers | None = None,  # noqa: ARG001, of the decorator
) -> Choice:
    """Identify families of models from the same tests, and rank them by their error on data left out of the fit.

    Each family is identified from all tests, and fitted without each motion in turn (or test, or command), from samples
    of its own in one batch, which is then predicted; and without the fastest, the slowest and the largest motions, each
    with every test at or beyond it. Both kinds, inside and beyond the tests that remain, have equal weights. From a
    single test it is fitted to the first half of the cycles and predicts the second. A family that fails is a row of
    the ranking.

    Parameters
    ----------
    models
        Names of models, models with their laws, "all", or "screened": those of all that go on from `screen_families`.
    laws
        Laws of the parameters that follow the command, for the families that have such parameters.
    settings
        Settings of each identification, see `identify`; its bounds apply to the families that have such parameters.
    on_progress
        Called during the fits.
    journal_of
        Opens the journal of each step of the comparison, by name; see `Journal`.
    executor
        Makes the fits to all tests, each on one thread: an executor of `concurrent.futures`, Dask, mpi4py or loky, or
        `Workers`. The choice is the same. By default this process makes them.

    Raises
    ------
    SettingError
        Where nothing can be left out, the tests are at too few commands for the laws without a fold, every family
        failed, or the settings give starts.
    UnknownNameError
        Where a model is unknown, or a law or bound names a parameter that no family has.
    WorkerError
        If the executor or one of its workers is lost; journals keep what was finished.
    Interrupted
        On Ctrl-C, carrying the `Choice` so far, `None` before the end of the first family.

    Warns
    -----
    MrworkWarning
        Where the tests are at several commands, and a family has no law; where a family failed; and where a
        family that failed fits all tests far better than the others, so that none is chosen.

    Examples
    --------
    >>> import mrwork as mr
    >>> tests = mr.read_damper_tests(["rig/10mm1Hz0x5A.csv", "rig/5mm3Hz0x5A.csv"])  # doctest: +SKIP
    >>> choice = mr.choose_model(tests, ["dahl", "normalised_bouc_wen"])  # doctest: +SKIP
    >>> print(choice.ranking.sentence)  # doctest: +SKIP
    """
    settings = settings or FitSettings()
    if settings.starts or settings.observing.free:
        raise SettingError(
            "`starts` and free effects of `observe` are of one model; leave them out where models are compared"
        )
    tests = tuple(observed(test, settings.observing) for test in as_tests(tests))
    specs, remarks, screened = compared_models(
        models, tests, settings, threads=threads, on_progress=on_progress, journal_of=journal_of
    )
    compared, lawless = families(
        specs, tests, laws=laws or {}, unit=unit, lagged=lagged, bounds=settings.bounds
    )
    splits = splits_of(tests, leave_out)
    _refuse_few_commands(compared, tests, splits)
    pooled = tuple(pooled_commands(tests, compared))
    for message in warnings_of(pooled):
        warn(message, MrworkWarning, stacklevel=5)
    running = _ChoosingModel(
        tests=tests,
        models=compared,
        splits=splits,
        remarks=(*remarks, *lawless, *pooled, *splits.remarks),
        screened=screened,
        threads=threads,
        journal_of=journal_of,
        on_progress=on_progress,
        settings=settings,
    )
    running.so_far = running.best_so_far
    batch = running.batch()
    with running.keeping("choice of model"):
        for family in compared:
            running.evaluate(family, batch)
    choice = running.choice()
    for message in warnings_of(remark for remark in choice.ranking.remarks if remark not in running.remarks):
        warn(message, MrworkWarning, stacklevel=5)
    return choice
