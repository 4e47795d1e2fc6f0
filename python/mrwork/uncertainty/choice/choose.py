"""Choice of model: families of models are identified, scored on data left out of their fits, and ranked.

A family is a model with the laws and bounds that apply to its parameters.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
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
from mrwork.dampers.laws import LawName
from mrwork.dampers.spec import SCREENED, DamperSpec
from mrwork.errors import JournalError, MrworkError, MrworkWarning, OutputError, SettingError, WorkerError
from mrwork.identification.batch import FitBatch, FitTask, JournalOf
from mrwork.identification.commands import CommandedTests, with_laws_at
from mrwork.identification.equivalent import identifiable_form, levels_needed
from mrwork.identification.fit import Fit
from mrwork.identification.problem import pooled_commands
from mrwork.identification.settings import FitSettings, Lagged, LawUnit, LeaveOut
from mrwork.records import DamperTest, observed
from mrwork.records.damper_test import as_tests
from mrwork.store.long_call import LongCall
from mrwork.uncertainty.choice.collapse import with_collapses
from mrwork.uncertainty.choice.ranking import Ranking, Standing
from mrwork.uncertainty.choice.screening import compared_models
from mrwork.uncertainty.choice.splits import Splits, splits_of
from mrwork.workers.engine import Workers, on_executor

T = TypeVar("T")
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
            spec = with_laws_at(
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

    Of laws only the chosen ones are fitted to the whole tests; the fit has up to four `others`, sets of laws that
    predict nearly as well, within 1 point, those that differ most beyond the tests, best predictions first.
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
    # Number of parameters of the fits so far; the cost of a fit grows with its parameters.
    done: int = 0

    def batch(self) -> FitBatch:
        """For each family its fit to all tests, then those without each split."""
        tasks = [
            FitTask(
                spec=family,
                tests=part,
                settings=replace(self.settings, bounds=select_known(self.settings.bounds, family)),
                examines=not fold,
                step=f"{family.name}/{f'left_out_{fold}' if fold else 'fit'}",
            )
            for family in self.models
            for fold, part in enumerate([self.tests, *self.splits.rests])
        ]
        return FitBatch(
            tasks=tasks,
            threads=self.threads,
            journal_of=self.journal_of,
            on_progress=self._report_fit,
            on_fit=self._count,
        )

    def evaluate(self, family: DamperSpec, batch: FitBatch) -> None:
        """Identify a family from all tests and without each split; a failure is recorded as its reason."""
        model, n_splits = family.name, self.splits.n_splits
        first = self.models.index(family) * (1 + n_splits)
        nrmse, seconds = [], 0.0
        fit: Fit | None = None
        with self.recording_failure(model):
            fit = batch.fit(first)
        if fit is None:
            self.candidates[model] = self.failing(family)
            return
        for number in range(n_splits):
            errors = np.full(len(self.splits.members[number]), np.inf)
            with self.recording_failure(model):
                rest = batch.fit(first + 1 + number)
                seconds += rest.seconds
                errors = self.splits.predict(number, rest)
            nrmse.append(errors)
        row = replace(
            self.failing(family),
            n_params=len(identifiable_form(fit.spec, fit.settings.bounds).box.free),
            status=fit.status,
            seconds=fit.seconds + seconds,
            fit_percent=fit.fit_percent,
        )
        theta = np.array(fit.theta)
        self.candidates[model] = row.scored(nrmse, self.splits, fit.spec, theta, self.tests)
        self.fits[model] = fit

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

    def _count(self, number: int, fit: Fit) -> None:
        self.done += len(fit.spec.parameters)

    def _report_fit(self, number: int, within: Progress | None) -> None:
        n_splits = self.splits.n_splits
        model_index, fold = divmod(number, 1 + n_splits)
        total = (1 + n_splits) * sum(len(model.parameters) for model in self.models)
        self.tell(
            self.models[model_index].name,
            f"left out {fold} of {n_splits}" if fold else "all tests",
            within=within,
            share=self.done / total,
        )


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

    Each family is identified from all tests, and again without each motion in turn (or test, or command), which is then
    predicted; and without the fastest, the slowest and the largest motions, each with every test at or beyond it. Both
    kinds, inside and beyond the tests that remain, have equal weights. From a single test it is identified on the first
    half of the cycles and predicts the second. A family that fails is a row of the ranking.

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
        Makes the fits, each on one thread: an executor of `concurrent.futures`, Dask, mpi4py or loky, or `Workers`.
        The choice is the same. By default this process makes them.

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
    if settings.starts or settings.free_effects:
        raise SettingError(
            "`starts` and free effects of `observe` are of one model; leave them out where models are compared"
        )
    tests = tuple(observed(test, settings.observe) for test in as_tests(tests))
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
