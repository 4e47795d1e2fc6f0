"""Search of current laws: neighbours of the best, fitted to all tests and without each split, all at once.

Laws are judged by their predictions of what was left out. Which neighbours are fitted follows from the errors that the
tests promise for them when they are linearised about laws that are fitted already.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from mrwork.base.numbers import counted
from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box
from mrwork.dampers.laws import CONSTANT, MOST_DEGREE, POLYNOMIAL_FORMS, CommandLaw, CurveForm, LawName
from mrwork.dampers.parameters import Lag, ParamSpec, Scale
from mrwork.dampers.spec import DamperSpec, hidden_extrema, with_changed_laws
from mrwork.errors import SettingError
from mrwork.identification.commands import CommandedTests, laws_at, laws_to_type
from mrwork.identification.equivalent import identifiable_form, joint_box, search_box, with_other_laws
from mrwork.identification.excerpts import middle_excerpts, stretches_of
from mrwork.identification.fit import NEGLIGIBLE, Fit
from mrwork.identification.objective import Objective, observe_tests_by
from mrwork.identification.settings import FitSettings, Fold, Start
from mrwork.records import DamperTest
from mrwork.records.observation import FREE, NONE, WEIGH, Effect
from mrwork.store.long_call import LongCall, interruptible
from mrwork.uncertainty.bands.prediction import rests_of
from mrwork.uncertainty.choice.law_folds import FoldedFit, LawFolds, Linearised
from mrwork.uncertainty.choice.objections import dying_laws
from mrwork.uncertainty.choice.ranking import NOT_PREDICTED, Standing, choose_from, laws_in_words
from mrwork.uncertainty.choice.splits import splits_of

Laws = dict[str, CommandLaw]
_Key: TypeAlias = tuple[tuple[str, CommandLaw], ...]

# Degree of the first laws.
_FIRST_DEGREE = 2
# Sets that are as good as the best and whose neighbours are tried, and the largest number of sets that are fitted.
_FRONTIER = 5
_MOST_TRIED = 30
# Below this number of records stretches of those of a varying command are left out.
_FEW_RECORDS = 3
# Where all first laws die, the multiple of the lower end of the search at which parameters of others start at least.
_ALIVE = 10.0
# Times that neighbours of a set are tried while a set that something speaks against predicts better.
_EXPANDED = 4
# Single changes, the most promising ones, of which pairs are considered.
_PAIRED = 6
# Forces are the same where their squared NRMSE in every test agree up to this share, or up to what is no error.
_SAME = 1e-4
_EXACT = 1e-10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FittedLaws:
    """A set of laws with its fits to all tests and without each split, and its row of the ranking."""

    spec: DamperSpec
    box: Box
    laws: Laws
    fit: FoldedFit
    row: Standing

    @property
    def start(self) -> Start:
        """The fit to all tests as the start of another."""
        return dict(zip(self.spec.names, self.fit.theta[0].tolist(), strict=True))


def _first_form(parameter: ParamSpec) -> CurveForm:
    return "log_polynomial" if parameter.is_positive else "polynomial"


def _key_of(laws: Laws) -> _Key:
    return tuple(sorted(laws.items()))


@dataclass(slots=True, kw_only=True)
class LawSearch:
    """Search of the laws of the parameters `free`, of degree `most` at most, by predictions of tests left out.

    Laws near others are compared by what the `linearised` tests promise for them; both are kept by the identity of the
    laws that they are about. The tests have the `effects` on the recorded force that were fitted with the first laws.
    """

    plain: DamperSpec
    tests: tuple[DamperTest, ...]
    folds: LawFolds
    settings: FitSettings
    given: Laws
    free: tuple[str, ...]
    most: int
    call: LongCall[Any] = field(default_factory=LongCall)
    report: Callable[[str], None] = lambda task: None
    fitted: list[FittedLaws] = field(default_factory=list)
    linearised: dict[int, Linearised] = field(default_factory=dict)
    promised: dict[tuple[int, _Key], float] = field(default_factory=dict)
    models: dict[_Key, tuple[DamperSpec, Box]] = field(default_factory=dict)
    effects: dict[Effect, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the plain model, whose laws are searched."""
        return self.plain.name

    @property
    def excerpt_settings(self) -> FitSettings:
        """Settings for the excerpts, which have the observation models of their whole records, on time."""
        return replace(self.settings, observe=(NONE,))

    @property
    def first_settings(self) -> FitSettings:
        """Those for the first laws, with which effects on the recorded force are fitted that are free, or that pay."""
        words = [word for word in self.settings.observe if word == WEIGH or word.endswith(f"={FREE}")]
        return replace(self.settings, observe=words or (NONE,))

    @property
    def first_laws(self) -> Laws:
        """Every positive parameter of `_FIRST_DEGREE`: such laws nearly pass through the fits at single commands."""
        return self._laws_of("log")

    def take_lag(self, lag: Lag) -> None:
        """Go on with the lag of the driver that the first laws show."""
        excerpts = self.folds.excerpts.with_laws(with_changed_laws(self.folds.model, lag=lag))
        self.folds = replace(self.folds, excerpts=excerpts)
        self.models.clear()

    def take_effects(self, first: Fit) -> None:
        """Go on with the effects on the recorded force that were fitted with the first laws."""
        if first.effects:
            self.effects = first.effect_values
            whole, excerpts = (
                observe_tests_by(each, [test.observation for test in self.observed(each.tests)])
                for each in (self.folds.whole, self.folds.excerpts)
            )
            self.folds, self.tests = replace(self.folds, whole=whole, excerpts=excerpts), excerpts.tests

    def observed(self, tests: Sequence[DamperTest]) -> tuple[DamperTest, ...]:
        """The tests with these effects."""
        given = {effect.field: value for effect, value in self.effects.items()}
        return tuple(replace(test, observation=replace(test.observation, **given)) for test in tests)

    def _laws_of(self, *scales: Scale) -> Laws:
        laws = {
            parameter.name: CommandLaw(min(_FIRST_DEGREE, self.most), form=_first_form(parameter))
            for parameter in self.plain.parameters
            if parameter.scale in scales and parameter.name in self.free
        }
        return dict(sorted(laws.items()))

    def run(self, first: Fit) -> None:
        """Try laws from the first ones on, whose fit is `first`, until the neighbours of the frontier are tried."""
        starts = np.repeat(np.array(first.theta)[None], 1 + len(self.folds.splits.splits), axis=0)
        self._fit_laws([self.first_laws], [starts])
        if (wider := self._laws_of("log", "linear")) != self.first_laws:
            self._move_to(self.fitted[0], wider)
        if all(fitted.row.remarks for fitted in self.fitted):
            self._revive(self.fitted[-1])
        expanded: list[Laws] = []
        while len(self.fitted) < _MOST_TRIED:
            often = 1 if self._is_best_sound() else _EXPANDED
            left = [fitted for fitted in self.frontier() if expanded.count(fitted.laws) < often]
            if not left:
                _, chosen, *_ = self.frontier()
                reverse = self._reversed(chosen.laws)
                if reverse in [fitted.laws for fitted in self.fitted]:
                    break
                self._move_to(chosen, reverse)
                continue
            current = min(left, key=lambda fitted: expanded.count(fitted.laws))
            expanded.append(current.laws)
            if proposals := self._proposals(current):
                self._move_to(current, *proposals)
        # Of a law that has an extremum between the commands, the form that has none.
        for number, fitted in enumerate(self.fitted):
            extrema = hidden_extrema(fitted.spec, fitted.fit.theta[0], self.folds.commands.tolist())
            instead = {extremum.parameter: extremum.instead for extremum in extrema if extremum.instead}
            self.fitted[number] = self.in_other_form(fitted, instead)

    def in_other_form(self, fitted: FittedLaws, instead: Laws) -> FittedLaws:
        """The candidate with laws through the same values, except where such a law changes the force of a test."""
        laws = fitted.laws | {
            name: CommandLaw(law.fitted_degree, form=law.form) if law.form in POLYNOMIAL_FORMS else law
            for name, law in instead.items()
            if name in fitted.laws and self.is_through_all(law)
        }
        spec, box = self.model(laws)
        row = replace(fitted.row, laws=self._texts(laws))
        return replace(fitted, spec=spec, box=box, laws=laws, row=row)

    def is_through_all(self, law: CommandLaw) -> bool:
        """Whether no test shows which form a law has, since it has a value at each of their commands."""
        return law.fitted_degree == len(self.folds.commands) - 1 and not self.folds.varies

    def _is_best_sound(self) -> bool:
        """Whether no set that something speaks against predicts visibly better than the others."""
        errors_of = [
            [fitted.row.error for fitted in self.fitted if bool(fitted.row.remarks) is dead]
            for dead in (True, False)
        ]
        dead, sound = (min(errors, default=np.inf) for errors in errors_of)
        return bool(100.0 * (sound - dead) <= NEGLIGIBLE)

    def _revive(self, dead: FittedLaws) -> None:
        """Fit laws of parameters that scale with the force alone, until none of them dies.

        Where a shape follows the command, too, it may take over what a damping does at the tested velocities.
        """
        names = [parameter.name for parameter in self.plain.parameters if parameter.scales_with_force]
        laws = {name: law for name, law in self.first_laws.items() if name in names}
        searched = search_box(self.plain, Box.of(self.plain), self.tests)
        least = dict(zip(searched.names, _ALIVE * np.array(searched.lower), strict=True))
        while laws:
            spec, box = self.model(laws)
            lower = [least.get(parameter.plain_name, 0.0) for parameter in spec.parameters]
            starts = self.transfer_starts(dead, spec, box)
            starts = np.where(box.log, np.maximum(starts, lower), starts)
            self._fit_laws([laws], [np.asarray(box.inside(np.minimum(starts, box.upper)))])
            alive = self.fitted[-1]
            dying = {limit.parameter for limit in dying_laws(alive.spec, alive.fit.theta[0], self.tests)}
            if not dying & set(laws):
                return
            laws = {name: law for name, law in laws.items() if name not in dying}

    def frontier(self) -> list[FittedLaws]:
        """Sets of laws whose neighbours are tried: the best, the one that would be chosen, and further good ones."""
        sound = [fitted for fitted in self.fitted if not fitted.row.remarks] or self.fitted
        order = sorted(sound, key=lambda fitted: fitted.row.error)
        rows, _, chosen = choose_from([fitted.row for fitted in order])
        good = [fitted for fitted in order if fitted.row in rows]
        return [order[0], next(fitted for fitted in order if fitted.row is chosen), *good][: _FRONTIER + 2]

    def distinct(self) -> list[FittedLaws]:
        """The candidates except those with the same force as a candidate with fewer parameters."""
        sets = list[FittedLaws]()
        for fitted in sorted(self.fitted, key=lambda fitted: fitted.row.n_params):
            squared = fitted.fit.squared
            if not any(np.allclose(squared, other.fit.squared, rtol=_SAME, atol=_EXACT) for other in sets):
                sets.append(fitted)
        return sets

    def _proposals(self, current: FittedLaws) -> list[Laws]:
        """Laws near the present ones that are not tried yet, by the errors that a linearised model promises.

        The most promising change of one law or two; the same of those with fewer parameters; and the end of a chain of
        simpler laws, each the most promising one after the one before, while no more is lost than is negligible.
        """
        promised = partial(self._promised, current)
        done = [fitted.laws for fitted in self.fitted]
        single = self._changes(current.laws)
        if not single:
            return []
        order = [single[index] for index in np.argsort(promised([laws for _, laws in single]), kind="stable")]
        pairs = [
            {each: law for each, law in (laws | {name: other.get(name)}).items() if law}
            for index, (_, laws) in enumerate(order[:_PAIRED])
            for name, other in order[:index]
            if laws.get(name) == current.laws.get(name)
        ]
        near = [laws for laws in [*(laws for _, laws in order), *pairs] if laws not in done]
        proposals = list[Laws]()
        errors = promised(near) if near else np.empty(0)
        count = np.array([self._count(laws) for laws in near])
        for allowed in (np.ones(len(near), dtype=np.bool_), count < self._count(current.laws)):
            if allowed.any():
                best = near[int(np.argmin(np.where(allowed, errors, np.inf)))]
                if best not in proposals:
                    proposals.append(best)
        (here,) = promised([current.laws])
        chain = current.laws
        while simpler := [laws for _, laws in self._changes(chain) if self._count(laws) < self._count(chain)]:
            errors = promised(simpler)
            if 100.0 * (errors.min() - here) > NEGLIGIBLE:
                break
            chain = simpler[int(np.argmin(errors))]
        if chain not in done and chain not in proposals:
            proposals.append(chain)
        return proposals

    def _promised(self, current: FittedLaws, candidates: Sequence[Laws]) -> Floats:
        """Errors of predictions that laws near the current ones promise; each is found once."""
        keys = [(id(current), _key_of(laws)) for laws in candidates]
        new = [laws for key, laws in zip(keys, candidates, strict=True) if key not in self.promised]
        if new:
            work = partial(interruptible, partial(self._promise, current, new))
            errors = self.call.array("promise", work, current.fit.theta, new)
            self.promised |= {
                (id(current), _key_of(laws)): error for laws, error in zip(new, errors.tolist(), strict=True)
            }
        return np.array([self.promised[key] for key in keys])

    def _promise(self, current: FittedLaws, candidates: Sequence[Laws]) -> Floats:
        if id(current) not in self.linearised:
            self.linearised[id(current)] = self.folds.linearise(current.spec, current.fit.theta)
        about = self.linearised[id(current)]
        models = map(self.model, candidates)
        return np.array(
            [
                self.folds.promise(about, spec, box, self.transfer_starts(current, spec, box))
                for spec, box in models
            ]
        )

    def _changes(self, laws: Laws) -> list[tuple[str, Laws]]:
        """Laws of which one has another degree by one or another form, with the parameter that it is of."""
        changed = []
        for parameter in self.plain.parameters:
            if parameter.name not in self.free:
                continue
            law = laws.get(parameter.name, CONSTANT)
            degree, form = law.fitted_degree, law.form if law.degree else _first_form(parameter)
            wanted = [(degree - 1, form), (degree + 1, form)]
            if (
                parameter.is_positive
                and degree > 0
                and (self.folds.varies or degree < len(self.folds.commands) - 1)
            ):
                wanted += [(degree, other) for other in POLYNOMIAL_FORMS if other != form]
            changed += [
                (parameter.name, self._with_law(laws, parameter.name, CommandLaw(other_degree, form=other)))
                for other_degree, other in wanted
                if 0 <= other_degree <= self.most
            ]
        return changed

    def _reversed(self, laws: Laws) -> Laws:
        """The laws with each polynomial through logarithms in place of values, or the reverse, if tests show it."""
        positive = {parameter.name for parameter in self.plain.parameters if parameter.is_positive}
        reverse = dict(zip(POLYNOMIAL_FORMS, reversed(POLYNOMIAL_FORMS), strict=True))
        instead = {
            name: CommandLaw(law.fitted_degree, form=reverse[law.form])
            for name, law in laws.items()
            if law.form in reverse and name in positive
        }
        return laws | {name: law for name, law in instead.items() if not self.is_through_all(law)}

    def _with_law(self, laws: Laws, name: str, law: CommandLaw) -> Laws:
        """The laws with another one; constant ones are not listed."""
        return {key: entry for key, entry in sorted((laws | {name: law}).items()) if not entry.is_constant}

    def _count(self, laws: Laws) -> int:
        """Number of law coefficients beyond the constant ones, which all sets of laws have."""
        return sum(law.fitted_degree for law in laws.values())

    def _texts(self, laws: Laws) -> dict[str, LawName]:
        return {name: str(law) for name, law in (self.given | laws).items()}

    def _move_to(self, current: FittedLaws, *proposals: Laws) -> None:
        """Fit proposed laws from starts that are transferred from the fit of the current laws."""
        starts = []
        for laws in proposals:
            spec, box = self.model(laws)
            starts.append(self.transfer_starts(current, spec, box))
        self._fit_laws(proposals, starts)

    def _fit_laws(self, proposals: Sequence[Laws], starts: Sequence[Floats]) -> None:
        """Fit sets of laws to all tests and without each split, and predict the tests left out by all of them."""
        models, fits = [self.model(laws) for laws in proposals], list[FoldedFit]()
        for laws, (spec, box), start in zip(proposals, models, starts, strict=True):
            self.report(f"fitting {laws_in_words(laws)}")
            work = partial(interruptible, partial(self.folds.fit, spec, box, start))
            fits.append(self.call.step("laws", FoldedFit, work, box, start))
        theta, boxes = [fit.theta for fit in fits], [box for _, box in models]
        sets = [(spec, fit.theta) for (spec, _), fit in zip(models, fits, strict=True)]
        predict = partial(interruptible, partial(self.folds.predict, sets))
        predicted = self.call.array("predictions", predict, boxes, theta)
        ends = np.cumsum([len(members) for members in self.folds.splits.members])[:-1]
        for laws, (spec, box), fit, nrmse in zip(proposals, models, fits, predicted, strict=True):
            row = Standing(
                model=self.name,
                title=self.plain.title,
                laws=self._texts(laws),
                n_params=len(box.free),
                fit_percent=100.0 * (1.0 - min(float(np.sqrt(np.mean(fit.squared))), NOT_PREDICTED)),
            )
            row = row.scored(np.split(nrmse, ends), self.folds.splits, spec, fit.theta[0], self.tests)
            self.fitted.append(FittedLaws(spec=spec, box=box, laws=laws, fit=fit, row=row))

    def model(self, laws: Laws) -> tuple[DamperSpec, Box]:
        """The model with laws by values, as many as polynomials of these degrees have coefficients."""
        if (key := _key_of(laws)) not in self.models:
            spec = with_changed_laws(
                self.plain.with_current_laws({}, unit=self.folds.unit, lag=self.folds.model.lag),
                laws_at(self.given | laws, self.folds.commands),
            )
            form = identifiable_form(spec, self.settings.bounds)
            self.models[key] = spec, joint_box(form, self.tests, self.folds.commands)
        return self.models[key]

    def transfer_starts(self, current: FittedLaws, spec: DamperSpec, box: Box) -> Floats:
        """Parameters of each row of the present laws as a start of other laws, on the curves of the present ones."""
        rows = [
            with_other_laws(current.spec, theta, spec, self.folds.commands) for theta in current.fit.theta
        ]
        return np.asarray(box.inside(np.array(rows)))


def prepare_search(
    plain: DamperSpec,
    tests: tuple[DamperTest, ...],
    given: Laws,
    unit: CommandUnit,
    leave_out: Fold | None,
    settings: FitSettings,
    threads: int,
    *,
    lagged: bool = False,
) -> LawSearch:
    """Check the settings and prepare the folds: of few records, stretches of each with a varying command."""
    if plain.command_unit is not None:
        raise SettingError(f"{plain.name} has current laws already; give the plain model to choose laws for")
    if settings.starts or settings.engine != "lanes":
        raise SettingError(
            "the choice of laws takes no starts and the engine `lanes`; leave these settings out"
        )
    spec = plain.with_current_laws({}, unit=unit)
    tested = CommandedTests.of(spec, tests)
    spec = with_changed_laws(spec, laws_at(given, tested.commands))
    typed = laws_to_type(plain, given, tested.commands)
    varies = tested.vary
    if lagged and not varies:
        raise SettingError(
            "the command is constant in every test, which shows no lag of the driver; leave --driver-lag out (in "
            "Python lagged=True)"
        )
    parts = "tests"
    if varies and len(tests) < _FEW_RECORDS:
        parts, leave_out = "stretches of the records", leave_out or "test"
        tests = tuple(part for test in tests for part in stretches_of(test))
    if len(tests) < 2:
        raise SettingError(
            "laws are chosen by tests left out of their fits, and one test was given; give more, or a record of a "
            "command that shows its levels three times"
        )
    short = middle_excerpts(tests)
    tested = CommandedTests.of(spec, short)
    tested.refuse_few()
    commands = tested.commands
    splits = replace(splits_of(tests, leave_out), parts=parts)
    # A split beyond the rest keeps a test at every command, and lowers no degree.
    rests = zip(splits.splits, rests_of(short, splits.members), strict=True)
    n_levels = min(
        (len(CommandedTests.of(spec, rest).commands) for split, rest in rests if not split.beyond),
        default=len(commands),
    )
    most = min(MOST_DEGREE, n_levels - 1)
    if most < 1:
        raise SettingError(
            f"the tests run at {counted(len(commands), 'command')}, {n_levels} without those left out; laws are chosen "
            f"from tests at two or more: add tests, or give the laws, as in mrwork identify FILES {typed}"
        )
    linear, levels = plain, np.zeros(len(short), dtype=np.intp)
    if varies:
        # Every law that is tried is one through values at these, in its logarithms or nearly.
        degree = min(MOST_DEGREE, len(commands) - 1)
        commands = np.array(CommandLaw(degree).at_commands(commands.tolist()).nodes)
        full = {each.name: CommandLaw(degree, form=_first_form(each)) for each in plain.parameters}
        linear = plain.with_current_laws(
            laws_at(full, commands), unit=unit, lag="one_rate" if lagged else "none"
        )
    else:
        levels = np.searchsorted(commands, tested.set_points)
    excerpts = Objective.of(spec, short, settings, threads=threads)
    shares = np.tile(excerpts.shares, (1 + splits.n_splits, 1))
    for row, members in enumerate(splits.members, start=1):
        shares[row, members] = 0.0
    folds = LawFolds(
        whole=Objective.of(spec, tests, settings, threads=threads).with_laws(plain),
        excerpts=excerpts.with_laws(linear),
        shares=shares / shares.sum(axis=1, keepdims=True),
        commands=commands,
        levels=levels,
        splits=splits,
        unit=unit,
    )
    return LawSearch(
        plain=plain,
        tests=short,
        folds=folds,
        settings=settings,
        given=given,
        free=tuple(name for name in plain.names if name not in {**given, **settings.bounds}),
        most=most,
    )
