"""A comparison of models under way: what each family has shown so far, and the choice that can be made of it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeVar

from mrwork.errors import JournalError, MrworkError, OutputError, SettingError
from mrwork.identification.fit import Fit
from mrwork.identification.progress import Progress
from mrwork.records import DamperTest
from mrwork.store import Journal
from mrwork.summary import Summarised, Summary
from mrwork.uncertainty.autocorrelation import effective_samples
from mrwork.uncertainty.bands.left_out import Fold
from mrwork.uncertainty.choice.families import Family
from mrwork.uncertainty.choice.held_out import held_out_errors, held_out_words
from mrwork.uncertainty.choice.likelihood import Likelihood, free_parameters, residuals_of, variance_of
from mrwork.uncertainty.choice.ranking import Evidence, rank
from mrwork.uncertainty.choice.verdict import Ranking, concluded

T = TypeVar("T")

# A journal for the step of this name; it is closed when the step is done.
JournalOf = Callable[[str], Journal]
# Identifies a family from tests, telling its progress, with a journal.
FitOf = Callable[
    [Family, tuple[DamperTest, ...], Callable[[Progress], None], Journal | None],
    Fit,
]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Choice(Summarised):
    """The ranking, and the fits of the families that could be identified, in its order."""

    ranking: Ranking
    fits: tuple[Fit, ...]

    @property
    def best(self) -> Fit:
        """The fit of the chosen family to all tests."""
        return next(fit for fit in self.fits if fit.model == self.ranking.chosen)

    def _summary(self) -> Summary:
        return self.ranking._summary()


@dataclass(frozen=True, slots=True, kw_only=True)
class ChoiceProgress:
    """Where a comparison stands: at the `number`-th of `n_models` families, doing `task`.

    `seconds` have gone by; `seconds_left` is a guess from what the fits have taken, `None` before the first.
    `within` is the progress of the fit under way.
    """

    model: str
    number: int
    n_models: int
    task: str
    seconds: float
    seconds_left: float | None
    within: Progress | None = None


@dataclass(slots=True, kw_only=True)
class RunningComparison:
    """A comparison under way; `evidence` and `fits` by model, as they come."""

    tests: tuple[DamperTest, ...]
    compared: tuple[Family, ...]
    leave_out: Fold
    n_folds: int
    remarks: tuple[str, ...]
    journal_of: JournalOf | None
    on_progress: Callable[[ChoiceProgress], None] | None
    evidence: dict[str, Evidence] = field(default_factory=dict)
    fits: dict[str, Fit] = field(default_factory=dict)
    n_blocks: int | None = None
    _began: float = field(default_factory=time.perf_counter, init=False)
    # Seconds of the fits so far, and their parameters: the cost of a fit goes with these first of all.
    _spent: float = field(default=0.0, init=False)
    _done: int = field(default=0, init=False)

    @property
    def judged(self) -> bool:
        """Whether any family predicted what it had not seen."""
        return any(each.left_out for each in self.evidence.values())

    def judge(self, number: int, fit_of: FitOf) -> None:
        """Identify a family from all tests and from those left in; what it cannot do is its reason.

        An interrupt leaves it out altogether.
        """
        family = self.compared[number - 1]
        model = family.spec.name
        made: list[Fit] = []

        def identified(tests: tuple[DamperTest, ...]) -> Fit:
            fold = len(made)
            step, task = (
                (f"left_out_{fold}", f"left out {fold} of {self.n_folds}") if fold else ("fit", "all tests")
            )
            self._tell(number, task)
            tell = partial(self._tell, number, task)
            fit = self._journalled(f"{model}/{step}", lambda journal: fit_of(family, tests, tell, journal))
            made.append(fit)
            self._spent += fit.seconds
            self._done += len(family.spec.parameters)
            return fit

        left_out: tuple[float, ...] = ()
        reason = ""
        try:
            identified(self.tests)
            left_out = held_out_errors(self.tests, self.leave_out, identified)
        except (JournalError, OutputError):
            raise
        except MrworkError as error:
            reason = str(error)
        fit = made[0] if made else None
        if fit is not None:
            self.fits[model] = fit
        self.evidence[model] = Evidence(
            model=model,
            title=family.spec.title,
            n_params=len(family.spec.parameters) if fit is None else free_parameters(fit),
            status="failed" if fit is None else fit.status,
            reason=reason,
            seconds=sum(each.seconds for each in made),
            fit_percent=None if fit is None else fit.fit_percent,
            left_out=left_out,
            variance=None if fit is None else variance_of(fit, self.tests),
        )

    def weigh(self, likelihood: Likelihood) -> None:
        """PSIS-LOO of every family that was identified, on the same blocks and with the same tempering."""
        if not self.fits:
            return
        shared = likelihood.shared(list(self.fits.values()), self.tests)
        found: dict[str, Evidence] = {}
        for number, family in enumerate(self.compared, start=1):
            fit = self.fits.get(family.spec.name)
            if fit is None:
                continue
            self._tell(number, "leave-one-out")
            own = self.evidence[fit.model]
            step = f"{fit.model}/leave_one_out"
            try:
                told = self._journalled(step, partial(shared.leave_one_out, fit))
            except SettingError as reason:
                found[fit.model] = replace(own, reason=own.reason or f"no PSIS-LOO: {reason}")
            else:
                found[fit.model] = replace(own, leave_one_out=told)
        # All together, for elpd of some families only would name a best that is none.
        self.evidence.update(found)
        self.n_blocks = shared.n_blocks

    def conclude(self) -> Choice:
        """The choice among the families that are done."""
        best = min(self.fits.values(), key=lambda fit: fit.nrmse)
        n_effective = effective_samples(residuals_of(best, self.tests))
        evidence = list(self.evidence.values())
        standings = rank(evidence, n_effective)
        ranking = concluded(
            standings,
            held_out=held_out_words(self.tests, self.leave_out),
            n_folds=max(len(each.left_out) for each in evidence),
            n_blocks=self.n_blocks,
            n_effective=n_effective,
            remarks=self.remarks,
            missing=[each.spec.name for each in self.compared if each.spec.name not in self.evidence],
        )
        order = [each.model for each in standings if each.model in self.fits]
        return Choice(ranking=ranking, fits=tuple(self.fits[model] for model in order))

    def _journalled(self, step: str, work: Callable[[Journal | None], T]) -> T:
        if self.journal_of is None:
            return work(None)
        journal = self.journal_of(step)
        try:
            return work(journal)
        finally:
            journal.close()

    def _tell(self, number: int, task: str, within: Progress | None = None) -> None:
        if self.on_progress is None:
            return
        total = (1 + self.n_folds) * sum(len(family.spec.parameters) for family in self.compared)
        left = self._spent / self._done * max(total - self._done, 0) if self._done else None
        self.on_progress(
            ChoiceProgress(
                model=self.compared[number - 1].spec.name,
                number=number,
                n_models=len(self.compared),
                task=task,
                seconds=time.perf_counter() - self._began,
                seconds_left=left,
                within=within,
            )
        )
