"""Screening of families: each with constant parameters, on excerpts of a few tests at a few commands.

It takes a second or two a family, and tells which of them predict a rig before laws of any are chosen.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain, groupby
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import Threads, checked
from mrwork.base.progress import OnProgress, Progress
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.values import array_dataclass
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import ALL, DEFAULT_MODELS, SCREENED, DamperSpec, damper, damper_models
from mrwork.errors import SettingError
from mrwork.identification.batch import JournalOf, with_journal
from mrwork.identification.equivalent import identifiable_form
from mrwork.identification.excerpts import middle_excerpt
from mrwork.identification.minimise.level_search import unlike_tests
from mrwork.identification.objective import Objective
from mrwork.identification.settings import FitSettings
from mrwork.records import DamperTest, observed
from mrwork.records.damper_test import as_tests, set_points
from mrwork.store.journal import Journal
from mrwork.store.long_call import LongCall, interruptible
from mrwork.uncertainty.bands.prediction import fold_groups, halves
from mrwork.uncertainty.choice.folds import Folds
from mrwork.uncertainty.choice.ranking import Standing, rank
from mrwork.uncertainty.choice.splits import Split, Splits, splits_of

# Most families that go on, the points that they may be behind the best, and the share by which the error of one is less
# than that of a simpler one that does.
_MOST_KEPT = 4
_CLOSE = 0.5
_LESS = 0.05
# Points by which the held-out fit of a family is visibly better.
_VISIBLE = 2.0
_BETTER_FAMILY = RemarkKind(
    "family_predicts_better",
    "{0} predicts the later half of this test better than {1}, to {value:.1f} instead of {percent:.1f} %",
    "to fit it add --model {2}",
)
_SAME_MODEL = RemarkKind("model_not_listed", "{0} is not listed: it is {1} in other parameters")
# Most tests of a command, and cycles of an excerpt.
_PER_COMMAND, _CYCLES = 6, 2
# Starts of each fit, of which the best one goes on.


@array_dataclass()
class Screening:
    """Excerpts of tests, which of them are at each command, (n_levels, n_tests), and their splits, each test a unit."""

    excerpts: tuple[DamperTest, ...]
    at_level: NDArray[np.bool_]
    splits: Splits
    settings: FitSettings
    threads: int

    @classmethod
    def of(cls, tests: Sequence[DamperTest], settings: FitSettings, threads: int) -> Screening | None:
        """Tests at the lowest, a middle and the highest of constant commands; `None` where the command always varies.

        Where each command has one test alone, its later half is predicted by the earlier one.
        """
        constant = [test for test in tests if not test.has_varying_command]
        constant.sort(key=lambda test: [float(np.mean(command)) for command, _ in test.commands])
        levels = [[*members] for _, members in groupby(constant, set_points)]
        if not levels:
            return None
        several = [members for members in levels if len(fold_groups(members, "test")) > 1]
        if not several:
            parts = [(members[0], halves(members[0])[1].n_settle) for members in levels]
            levels = [[test.part(0, middle), test.part(middle, test.n_time)] for test, middle in parts]
        kept = several or levels
        numbers = sorted({0, len(kept) // 2, len(kept) - 1})
        taken = [unlike_tests(kept[number], _PER_COMMAND) for number in numbers]
        chosen = (*chain.from_iterable(taken),)
        if several:
            splits = replace(splits_of(chosen), units=(*range(len(chosen)),))
        else:
            later = Split(members=(*range(1, len(chosen), 2),))
            splits = Splits(tests=chosen, splits=(later,), units=(*range(len(chosen)),), fold=None)
        level = np.repeat(np.arange(len(taken)), [len(members) for members in taken])
        return cls(
            excerpts=tuple(middle_excerpt(test, _CYCLES) for test in chosen),
            at_level=level == np.arange(len(taken))[:, None],
            splits=splits,
            settings=settings,
            threads=threads,
        )

    def standing(self, spec: DamperSpec) -> Standing:
        """A family by its predictions of the tests left out, with its cost in a building at the highest command."""
        objective = Objective.of(spec, self.excerpts, self.settings, threads=self.threads)
        left_out = self.splits.left_out
        # At each command a fit to its tests, and one without each split, which predicts what is left out there.
        fitted, predicted = self.at_level[:, None] & ~left_out, self.at_level[:, None] & left_out
        pairs = fitted.any(axis=2) & predicted.any(axis=2)
        rows = np.concatenate([self.at_level, fitted[pairs]])
        folds = Folds(
            whole=objective,
            excerpts=objective,
            shares=rows / rows.sum(axis=1, keepdims=True),
            commands=np.zeros(1),
            remaining=(),
            splits=self.splits,
            unit="A",
        )
        theta, _ = folds.from_samples(spec, Box.of(spec), np.arange(len(rows)), go_on=1)
        tests = [self.excerpts[index] for index in np.flatnonzero(self.at_level[-1])]
        squared = np.full(fitted.shape, np.inf)
        squared[pairs] = objective.squared_nrmse(theta[len(self.at_level) :], predicted[pairs])
        if not np.isfinite(squared).any():
            return Standing.of(spec, reason="it could not be simulated")
        nrmse = np.sqrt(squared.min(axis=0))
        errors = [nrmse[number, members] for number, members in enumerate(self.splits.members)]
        row = Standing.of(spec).scored(errors, self.splits, spec, theta[len(self.at_level) - 1], tests)
        return replace(row, status="converged", remarks=())


@checked
def screen_families(
    tests: DamperTest | Sequence[DamperTest],
    *,
    settings: FitSettings | None = None,
    threads: Threads = 0,
    on_progress: OnProgress | None = None,
    journal_of: JournalOf | None = None,
) -> tuple[Standing, ...]:
    """Screen every family of models, with constant parameters, on excerpts of a few tests; best first.

    The families whose verdict is "goes on", four at most, are those that `choose_laws` or `choose_model` should
    compare: of those as good as the best, or within half a point of it, the simplest, and others whose error is less by
    5 %. It takes a second or two a family.

    Parameters
    ----------
    settings
        Settings of the identifications, see `identify`.
    on_progress
        Called before each family.
    journal_of
        Opens the journal of the step, by name; see `Journal`.

    Returns
    -------
    tuple
        A row for each family; none where the command varies in every test, or no family predicts any.

    Raises
    ------
    Interrupted
        On Ctrl-C.

    Examples
    --------
    >>> import mrwork as mr
    >>> tests = mr.read_damper_tests(["rig/10mm1Hz0A.csv", "rig/10mm1Hz1A.csv"])  # doctest: +SKIP
    >>> mr.screen_families(tests)[0].title  # doctest: +SKIP
    >>> mr.choose_laws("screened", tests)  # doctest: +SKIP
    """
    settings = settings or FitSettings()
    tests = tuple(observed(test, settings.observing) for test in as_tests(tests))
    screening = Screening.of(tests, settings, threads)
    if screening is None:
        return ()
    specs, _ = named_models(ALL)
    inputs = [(test.name, test.sha256, test.n_time) for test in tests], settings

    def screen(journal: Journal | None) -> list[Standing]:
        call = LongCall[None](journal=journal, on_progress=on_progress)
        rows = list[Standing]()
        with call.keeping("screening of families"):
            for spec in specs:
                task, share = f"screening {spec.name}", len(rows) / len(specs)
                call.report(Progress(stage="screening", said=(task,), share=share))
                work = partial(interruptible, partial(screening.standing, spec))
                rows.append(call.step(task, Standing, work, *inputs))
        return rows

    screened = with_journal(journal_of, "screening", screen)
    if not any(row.has_predicted for row in screened):
        return ()
    ranked = rank(screened)
    good = [
        row
        for row in ranked
        if row.is_chosen
        or row.verdict == "as good"
        or (row.has_predicted and 100.0 * (row.error - ranked[0].error) < _CLOSE)
    ]
    kept = list[Standing]()
    for row in sorted(good, key=attrgetter("is_costly", "n_params", "error")):
        if all(row.error < (1.0 - _LESS) * other.error for other in kept):
            kept.append(row)
    names = [row.model for row in kept[-_MOST_KEPT:]]
    return tuple(replace(row, verdict="goes on") if row.model in names else row for row in ranked)


def named_models(
    models: DamperSpec | str | Sequence[DamperSpec | str],
) -> tuple[tuple[DamperSpec, ...], tuple[Remark, ...]]:
    """The named models and remarks; "all" leaves out those that are identified in the parameters of another one."""
    if models in (ALL, [ALL]):
        others = {spec.name: identifiable_form(spec, {}).spec.name for spec in damper_models()}
        return (
            tuple(spec for spec in damper_models() if others[spec.name] == spec.name),
            tuple(_SAME_MODEL.remark(name, form) for name, form in others.items() if name != form),
        )
    named = [models] if isinstance(models, str | DamperSpec) else models
    specs = tuple(damper(name) if isinstance(name, str) else name for name in named)
    names = [spec.name for spec in specs]
    if not names or len(set(names)) < len(names):
        raise SettingError(f"the models to compare are {', '.join(names) or 'none'}; name each once")
    return specs, ()


def compared_models(
    models: DamperSpec | str | Sequence[DamperSpec | str],
    tests: tuple[DamperTest, ...],
    settings: FitSettings,
    *,
    threads: int,
    on_progress: OnProgress | None,
    journal_of: JournalOf | None,
) -> tuple[tuple[DamperSpec, ...], tuple[Remark, ...], tuple[Standing, ...]]:
    """The models of a choice, remarks on them, and the screening that they come from where they are "screened".

    Where nothing can be screened, as every command varies, they are three that differ in kind.
    """
    if models not in (SCREENED, [SCREENED]):
        return *named_models(models), ()
    rows = screen_families(
        tests, settings=settings, threads=threads, on_progress=on_progress, journal_of=journal_of
    )
    kept = [row.model for row in rows if row.verdict == "goes on"]
    return *named_models(kept or DEFAULT_MODELS), rows


def better_family(rows: Sequence[Standing], model: str) -> Iterator[Remark]:
    """Warn that a screened family predicts a test visibly better than a model."""
    for own in rows:
        if own.model == model and own.has_predicted and 100.0 * (own.error - rows[0].error) > _VISIBLE:
            left_out = Measured(100.0 * (1.0 - rows[0].error), "%")
            words = rows[0].title, own.title, rows[0].model
            yield _BETTER_FAMILY.remark(*words, measured=left_out, percent=100.0 * (1.0 - own.error))
