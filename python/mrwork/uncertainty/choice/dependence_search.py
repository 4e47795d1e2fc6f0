"""Search of current laws: neighbours of the best, fitted to all tests and without each split, all at once.

Laws are judged by their predictions of what was left out. Which neighbours are fitted follows from the errors that the
tests promise for them when they are linearised about laws that are fitted already.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from mrwork.base.numbers import counted
from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats
from mrwork.dampers.between_commands import least_curved
from mrwork.dampers.coordinates import Box
from mrwork.dampers.dependence import (
    CONSTANT,
    MOST_DEGREE,
    POLYNOMIAL_FORMS,
    SATURATING_FORMS,
    Dependence,
    LawName,
    dependence_through,
)
from mrwork.dampers.parameters import Lag, ParamSpec, Scale
from mrwork.dampers.spec import DamperSpec, with_other_dependences
from mrwork.errors import SettingError
from mrwork.identification.commands import CommandedTests, dependences_at, laws_to_type
from mrwork.identification.equivalent import identifiable_form, in_other_dependences, joint_box, search_box
from mrwork.identification.excerpts import middle_excerpts, stretches_of
from mrwork.identification.fit import NEGLIGIBLE, Fit
from mrwork.identification.settings import FitSettings, Fold, Start
from mrwork.records import DamperTest
from mrwork.records.observation import AS_RECORDED, Effect
from mrwork.store.long_call import LongCall, interruptible
from mrwork.uncertainty.choice.folds import FoldedFit, Folds
from mrwork.uncertainty.choice.objections import dying_dependences
from mrwork.uncertainty.choice.promises import Linearised, Promises
from mrwork.uncertainty.choice.ranking import (
    NOT_PREDICTED,
    Standing,
    choose_from,
    error_of_mean,
    laws_in_words,
)
from mrwork.uncertainty.choice.splits import splits_of

Laws = dict[str, Dependence]


@dataclass(frozen=True, slots=True)
class DependenceSet:
    """A candidate: laws of the parameters that follow the command, and values at which constant ones are held.

    Both are pairs after the name of the parameter, in the order of the names.
    """

    laws: tuple[tuple[str, Dependence], ...] = ()
    held: tuple[tuple[str, float], ...] = ()

    @classmethod
    def of(cls, laws: Laws, held: Mapping[str, float] | None = None) -> DependenceSet:
        """The candidate of these laws, of which constant ones are not listed, and values."""
        following = {name: law for name, law in laws.items() if not law.is_constant}
        return cls(tuple(sorted(following.items())), tuple(sorted((held or {}).items())))

    def with_law(self, name: str, law: Dependence) -> DependenceSet:
        """The candidate with another law of a parameter, which is then not held."""
        held = {each: value for each, value in self.held if each != name}
        return DependenceSet.of({**dict(self.laws), name: law}, held)

    def holding(self, values: Mapping[str, float]) -> DependenceSet:
        """The candidate with these parameters held, without laws of theirs."""
        laws = {name: law for name, law in self.laws if name not in values}
        return DependenceSet.of(laws, {**dict(self.held), **values})

    def releasing(self, names: Collection[str]) -> DependenceSet:
        """The candidate without holding these parameters."""
        return DependenceSet.of(
            dict(self.laws), {name: value for name, value in self.held if name not in names}
        )

    @property
    def size(self) -> int:
        """Number of coefficients beside those of a candidate of which all parameters are constant and free."""
        return sum(law.fitted_degree for _, law in self.laws) - len(self.held)


# Degree of the first laws.
_FIRST_DEGREE = 2
# Sets that are as good as the best and whose neighbours are tried, and the largest number of sets that are fitted.
_FRONTIER = 5
_MOST_TRIED = 30
# Below this number of records stretches of those of a varying command are left out.
_FEW_RECORDS = 3
# Where all first laws die, the multiple of the lower end of the search at which parameters of others start at least.
_ALIVE = 10.0
# Most sets that are tried at the end because they are simpler than the one that would be chosen.
_MOST_SIMPLER = 10
# Times that neighbours of a set are tried while a set that something speaks against predicts better.
_EXPANDED = 4
# Coefficients of a law that saturates: two values and a rate.
_OF_SATURATION = 3
# Single changes, the most promising ones, of which pairs are considered.
_PAIRED = 6
# Forces are the same where their squared NRMSE in every test agree up to this share, or up to what is no error.
_SAME_FORCE = 1e-4
_EXACT = 1e-10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FittedSet:
    """A set of laws with its fits to all tests and without each split, and its row of the ranking."""

    spec: DamperSpec
    box: Box
    laws: DependenceSet
    fit: FoldedFit
    row: Standing

    @property
    def start(self) -> Start:
        """The fit to all tests as the start of another."""
        return dict(zip(self.spec.names, self.fit.theta[0].tolist(), strict=True))


@dataclass(slots=True, kw_only=True, eq=False)
class DependenceSearch:
    """Search of the laws of the parameters `free`, of degree `most` at most, by predictions of tests left out.

    Laws near others are compared by what the `linearised` tests promise for them; both are kept by the identity of the
    laws that they are about. Laws are fitted with those of the `effects` on the recorded force that were found with the
    first laws; without a split they have values of their own.
    """

    plain: DamperSpec
    tests: tuple[DamperTest, ...]
    folds: Folds
    promises: Promises
    settings: FitSettings
    given: Laws
    free: tuple[str, ...]
    most: int
    call: LongCall[Any] = field(default_factory=LongCall)
    report: Callable[[str], None] = lambda task: None
    fitted: list[FittedSet] = field(default_factory=list)
    linearised: dict[int, Linearised] = field(default_factory=dict)
    promised: dict[tuple[int, DependenceSet], float] = field(default_factory=dict)
    models: dict[DependenceSet, tuple[DamperSpec, Box]] = field(default_factory=dict)
    effects: dict[Effect, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the plain model, whose laws are searched."""
        return self.plain.name

    @property
    def excerpt_settings(self) -> FitSettings:
        """Settings for the excerpts, which have the observation models of their whole records, on time."""
        return replace(self.settings, observe=AS_RECORDED)

    @property
    def first_settings(self) -> FitSettings:
        """Those for the first laws, with which effects on the recorded force are fitted that are free, or that pay."""
        return replace(self.settings, observe=self.settings.observing.to_fit)

    @property
    def first_laws(self) -> DependenceSet:
        """Every positive parameter of `_FIRST_DEGREE`: such laws nearly pass through the fits at single commands."""
        return self._laws_of("log")

    @property
    def commands(self) -> Floats:
        """The commands at which laws have values: those of the tests, or the most telling ones where they vary."""
        return self.promises.commands

    def take_lag(self, lag: Lag) -> None:
        """Go on with the lag of the driver that the first laws show."""
        self.promises = replace(self.promises, model=with_other_dependences(self.promises.model, lag=lag))
        self.models.clear()

    def take_effects(self, first: Fit) -> None:
        """Go on with the effects on the recorded force that were found with the first laws."""
        if first.effects:
            self.effects = first.effect_values
            told = not first.varied_effects
            self.folds = self.folds.with_effects(tuple(self.effects), told=told)
            self.promises = replace(self.promises, folds=self.folds)

    def effects_of(self, laws: FittedSet) -> dict[Effect, float]:
        """The effects on the recorded force that were fitted with laws to all tests."""
        return dict(zip(self.effects, laws.fit.effects[0].tolist(), strict=True))

    def observed(self, tests: Sequence[DamperTest], laws: FittedSet) -> tuple[DamperTest, ...]:
        """The tests with these effects."""
        given = {effect.field: value for effect, value in self.effects_of(laws).items()}
        return tuple(replace(test, observation=replace(test.observation, **given)) for test in tests)

    def _laws_of(self, *scales: Scale) -> DependenceSet:
        degree = min(_FIRST_DEGREE, self.most)
        return DependenceSet.of(
            {
                parameter.name: Dependence(
                    degree, form="log_polynomial" if parameter.is_positive else "polynomial"
                )
                for parameter in self.plain.parameters
                if parameter.scale in scales and parameter.name in self.free
            }
        )

    def run(self, first: Fit) -> None:
        """Try laws from the first ones on, whose fit is `first`, until the neighbours of the frontier are tried."""
        theta, effects = np.array([first.theta]), np.array([[*self.effects.values()]])
        simple = DependenceSet.of(
            {
                parameter.name: Dependence(min(_FIRST_DEGREE, self.most))
                for parameter in self.plain.parameters
                if parameter.name in self.free and parameter.scales_with_force
            }
        )
        fit_first = partial(self.folds.first_fit, theta=theta, effects=effects, simple=self.model(simple))
        self._fit_laws([self.first_laws], fit_first)
        if (wider := self._laws_of("log", "linear")) != self.first_laws:
            self._move_to(self.fitted[0], wider)
        if all(fitted.row.remarks for fitted in self.fitted):
            self._revive(self.fitted[-1])
        expanded: list[DependenceSet] = []
        while len(self.fitted) < _MOST_TRIED:
            often = 1 if self._is_best_sound() else _EXPANDED
            left = [fitted for fitted in self.frontier() if expanded.count(fitted.laws) < often]
            if not left:
                break
            current = min(left, key=lambda fitted: expanded.count(fitted.laws))
            expanded.append(current.laws)
            if proposals := self._proposals(current):
                self._move_to(current, *proposals)
        self._simplify()
        # What the best and the chosen set are on the whole tests may change which these are.
        while rough := [fitted for fitted in self.frontier()[:2] if fitted.row.of_excerpts]:
            self._refine(rough[0])
        # Of a law that no test tells from others through the same values, the least curved one without an extremum.
        for number, fitted in enumerate(self.fitted):
            best = least_curved(fitted.spec, fitted.fit.theta[0], self.commands.tolist())
            self.fitted[number] = self.in_other_form(fitted, best)

    def _simplify(self) -> None:
        """Try sets with a coefficient less than the one that would be chosen, while they promise to be as good."""
        for _ in range(_MOST_SIMPLER):
            _, chosen, *_ = self.frontier()
            done = {fitted.laws for fitted in self.fitted}
            simpler = [
                change.laws
                for change in self._changes(chosen.laws)
                if change.laws.size < chosen.laws.size and change.laws not in done
            ]
            here, *errors = self._promised(chosen, [chosen.laws, *simpler]).tolist()
            behind = 100.0 * (min(errors, default=np.inf) - here)
            if behind > max(NEGLIGIBLE, error_of_mean(100.0 * np.array(chosen.row.left_out)) or 0.0):
                return
            self._move_to(chosen, simpler[int(np.argmin(errors))])

    def in_other_form(self, fitted: FittedSet, instead: Laws) -> FittedSet:
        """The candidate with laws through the same values, except where such a law changes the force of a test."""
        own = dict(fitted.laws.laws)
        laws = DependenceSet.of(
            own
            | {
                name: Dependence(law.fitted_degree, form=law.form) if law.form in POLYNOMIAL_FORMS else law
                for name, law in instead.items()
                if name in own and self.is_through_all(law)
            },
            dict(fitted.laws.held),
        )
        spec, box = self.model(laws)
        row = replace(fitted.row, laws=self._texts(laws))
        return replace(fitted, spec=spec, box=box, laws=laws, row=row)

    def is_through_all(self, law: Dependence) -> bool:
        """Whether no test shows which form a law has, since it has a value at each of their commands."""
        return law.fitted_degree == len(self.commands) - 1 and not self.folds.varies

    def _is_best_sound(self) -> bool:
        """Whether no set that something speaks against predicts visibly better than the others."""
        errors_of = [
            [fitted.row.error for fitted in self.fitted if bool(fitted.row.remarks) is dead]
            for dead in (True, False)
        ]
        dead, sound = (min(errors, default=np.inf) for errors in errors_of)
        return bool(100.0 * (sound - dead) <= NEGLIGIBLE)

    def _revive(self, dead: FittedSet) -> None:
        """Fit laws of parameters that scale with the force alone, until none of them dies.

        Where a shape follows the command, too, it may take over what a damping does at the tested velocities.
        """
        names = [parameter.name for parameter in self.plain.parameters if parameter.scales_with_force]
        laws = {name: law for name, law in self.first_laws.laws if name in names}
        searched = search_box(self.plain, Box.of(self.plain), self.tests)
        least = dict(zip(searched.names, _ALIVE * np.array(searched.lower), strict=True))

        def from_alive(spec: DamperSpec, box: Box) -> FoldedFit:
            lower = [least.get(parameter.plain_name, 0.0) for parameter in spec.parameters]
            starts = self.transfer_starts(dead, spec, box)
            starts = np.where(box.log, np.maximum(starts, lower), starts)
            starts = np.asarray(box.inside(np.minimum(starts, box.upper)))
            return self.folds.fit(spec, box, starts, dead.fit.effects)

        while laws:
            self._fit_laws([DependenceSet.of(laws)], from_alive)
            alive = self.fitted[-1]
            dying = {
                limit.parameter for limit in dying_dependences(alive.spec, alive.fit.theta[0], self.tests)
            }
            if not dying & set(laws):
                return
            laws = {name: law for name, law in laws.items() if name not in dying}

    def frontier(self) -> list[FittedSet]:
        """Sets of laws whose neighbours are tried: the best, the one that would be chosen, and further good ones."""
        distinct = self.distinct()
        sound = [fitted for fitted in distinct if not fitted.row.remarks] or distinct
        order = sorted(sound, key=lambda fitted: fitted.row.error)
        rows, _, chosen = choose_from([fitted.row for fitted in order])
        good = [fitted for fitted in order if fitted.row in rows]
        return [order[0], next(fitted for fitted in order if fitted.row is chosen), *good][: _FRONTIER + 2]

    def distinct(self) -> list[FittedSet]:
        """The candidates except those with the same force as a candidate with fewer parameters."""
        sets = list[FittedSet]()
        for fitted in sorted(self.fitted, key=lambda fitted: fitted.row.n_params):
            squared = fitted.fit.squared
            if not any(
                np.allclose(squared, other.fit.squared, rtol=_SAME_FORCE, atol=_EXACT) for other in sets
            ):
                sets.append(fitted)
        return sets

    def _proposals(self, current: FittedSet) -> list[DependenceSet]:
        """Laws near the present ones that are not tried yet, by the errors that a linearised model promises.

        The most promising change of one parameter or two; the same of those with fewer coefficients, and of those with
        no more; and the end of a chain of simpler laws, each the most promising one after the one before, while no more
        is lost than is negligible.
        """
        promised = partial(self._promised, current)
        done, here = {fitted.laws for fitted in self.fitted}, current.laws
        single = self._changes(here)
        if not single:
            return []
        order = [
            single[index] for index in np.argsort(promised([change.laws for change in single]), kind="stable")
        ]
        richer = [change for change in order if change.laws.size > here.size]
        others = [change for change in order if change.laws.size <= here.size]
        # What one parameter gives up another may take.
        both = [
            *((one, other) for number, one in enumerate(order[:_PAIRED]) for other in order[:number]),
            *product(richer[:_PAIRED], others[:_PAIRED]),
        ]
        pairs = [one.after(other) for one, other in both if not one.names & other.names]
        near = list(
            dict.fromkeys(laws for laws in [*(each.laws for each in order), *pairs] if laws not in done)
        )
        proposals = dict[DependenceSet, None]()
        errors = promised(near) if near else np.empty(0)
        size = np.array([laws.size for laws in near])
        for allowed in (np.ones(len(near), dtype=np.bool_), size <= here.size, size < here.size):
            if allowed.any():
                proposals[near[int(np.argmin(np.where(allowed, errors, np.inf)))]] = None
        (now,) = promised([here])
        chain = here
        while simpler := [change.laws for change in self._changes(chain) if change.laws.size < chain.size]:
            errors = promised(simpler)
            if 100.0 * (errors.min() - now) > NEGLIGIBLE:
                break
            chain = simpler[int(np.argmin(errors))]
        if chain not in done:
            proposals[chain] = None
        return [*proposals]

    def _promised(self, current: FittedSet, candidates: Sequence[DependenceSet]) -> Floats:
        """Errors of predictions that laws near the current ones promise; each is found once."""
        keys = [(id(current), laws) for laws in candidates]
        new = list(
            dict.fromkeys(
                laws for key, laws in zip(keys, candidates, strict=True) if key not in self.promised
            )
        )
        if new:
            work = partial(interruptible, partial(self._promise, current, new))
            errors = self.call.array("promise", work, current.fit.theta, new)
            self.promised |= {
                (id(current), laws): error for laws, error in zip(new, errors.tolist(), strict=True)
            }
        return np.array([self.promised[key] for key in keys])

    def _promise(self, current: FittedSet, candidates: Sequence[DependenceSet]) -> Floats:
        if id(current) not in self.linearised:
            self.linearised[id(current)] = self.promises.linearise(current.spec, current.fit)
        about = self.linearised[id(current)]
        models = map(self.model, candidates)
        return np.array(
            [
                self.promises.promise(about, spec, box, self.transfer_starts(current, spec, box))
                for spec, box in models
            ]
        )

    def _changes(self, laws: DependenceSet) -> list[_Change]:
        """Changes of one parameter: another law of it, or a value at which it is held, or holding it no longer."""
        of, held = dict(laws.laws), dict(laws.held)
        changes = list[_Change]()
        for parameter in self.plain.parameters:
            if parameter.name in self.free and parameter.name not in held:
                changes += [
                    _Change(laws.with_law(parameter.name, law), frozenset({parameter.name}))
                    for law in self._other_laws(parameter, of.get(parameter.name, CONSTANT))
                ]
        for values in self._values_to_hold():
            names = frozenset(values)
            if names <= held.keys():
                changes.append(_Change(laws.releasing(names), names))
            elif not names & of.keys():
                changes.append(_Change(laws.holding(values), names))
        return changes

    def _other_laws(self, parameter: ParamSpec, law: Dependence) -> list[Dependence]:
        """Laws of one coefficient less or more, and of as many in other forms where tests tell these apart."""
        count, commands = law.n_coefficients, self.commands
        found = list[Dependence]()
        for number in (count - 1, count, count + 1):
            forms = dependences_of_size(parameter, number, commands) if 1 <= number <= self.most + 1 else []
            through_all = number == len(commands) and not self.folds.varies
            if number == count and through_all:
                continue
            # Forms through all commands are alike to the tests.
            found += forms[:1] if through_all else forms
        return [other for other in found if other != law]

    def _values_to_hold(self) -> list[dict[str, float]]:
        """Values without which a model is simpler: no offset, no spring, an exponent of one."""
        plain = {
            parameter.name: parameter for parameter in self.plain.parameters if parameter.name in self.free
        }
        spring = [self.plain.parameters[index].name for index in self.plain.spring_indices or ()]
        values = list[dict[str, float]]()
        for name, parameter in plain.items():
            if name in spring[:1]:
                # Without a stiffness its free length has no effect.
                if set(spring) <= plain.keys():
                    values.append(dict.fromkeys(spring, 0.0))
            elif parameter.scale == "linear" and parameter.lower < 0.0 < parameter.upper:
                values.append({name: 0.0})
            elif parameter.unit == "1" and parameter.lower == 1.0:
                values.append({name: 1.0})
        return values

    def _texts(self, laws: DependenceSet) -> dict[str, LawName]:
        return {name: str(law) for name, law in (self.given | dict(laws.laws)).items()}

    def _move_to(self, current: FittedSet, *proposals: DependenceSet) -> None:
        """Fit proposed laws from starts that are transferred from the fit of the current laws."""

        def from_current(spec: DamperSpec, box: Box) -> FoldedFit:
            return self.folds.fit(spec, box, self.transfer_starts(current, spec, box), current.fit.effects)

        self._fit_laws(proposals, from_current, current.fit.theta)

    def _fit_laws(
        self, proposals: Sequence[DependenceSet], fit: Callable[[DamperSpec, Box], FoldedFit], *inputs: object
    ) -> None:
        """Fit sets of laws to all tests and without each split, and predict the tests left out by all of them."""
        models, fits = [self.model(laws) for laws in proposals], list[FoldedFit]()
        for laws, (spec, box) in zip(proposals, models, strict=True):
            self.report(f"fitting {laws_in_words(dict(laws.laws))}")
            work = partial(interruptible, partial(fit, spec, box))
            fits.append(self.call.step("laws", FoldedFit, work, box, *inputs))
        self.fitted += self._judged(proposals, fits)

    def _judged(
        self, proposals: Sequence[DependenceSet], fits: Sequence[FoldedFit], *, of_excerpts: bool = True
    ) -> list[FittedSet]:
        """Sets of laws with their fits, and the rows of the ranking by what these predict."""
        models = [self.model(laws) for laws in proposals]
        boxes = [box for _, box in models]
        sets = [(spec, each) for (spec, _), each in zip(models, fits, strict=True)]
        predict = partial(interruptible, partial(self.folds.predict, sets))
        predicted = self.call.array("predictions", predict, boxes, [each.theta for each in fits])
        ends, judged = (
            np.cumsum([len(members) for members in self.folds.splits.members])[:-1],
            list[FittedSet](),
        )
        for laws, (spec, box), each, nrmse in zip(proposals, models, fits, predicted, strict=True):
            row = Standing(
                model=self.name,
                title=self.plain.title,
                laws=self._texts(laws),
                held=dict(laws.held),
                n_params=len(box.free),
                of_excerpts=of_excerpts,
                fit_percent=100.0 * (1.0 - min(float(np.sqrt(np.mean(each.squared))), NOT_PREDICTED)),
            )
            row = row.scored(np.split(nrmse, ends), self.folds.splits, spec, each.theta[0], self.tests)
            judged.append(FittedSet(spec=spec, box=box, laws=laws, fit=each, row=row))
        return judged

    def _refine(self, fitted: FittedSet) -> None:
        """Fit a set on to the whole tests, so that its errors are those of fits to these."""
        self.report(f"refining {laws_in_words(dict(fitted.laws.laws))}")
        work = partial(interruptible, partial(self.folds.refined, fitted.spec, fitted.box, fitted.fit))
        fit = self.call.step("refined", FoldedFit, work, fitted.box, fitted.fit.theta, fitted.fit.effects)
        (refined,) = self._judged([fitted.laws], [fit], of_excerpts=False)
        self.fitted[self.fitted.index(fitted)] = refined

    def model(self, laws: DependenceSet) -> tuple[DamperSpec, Box]:
        """The model with laws by values, as many as polynomials of these degrees have coefficients."""
        if laws not in self.models:
            spec = with_other_dependences(
                self.plain.with_current_laws({}, unit=self.folds.unit, lag=self.promises.model.lag),
                dependences_at(self.given | dict(laws.laws), self.commands),
            )
            form = identifiable_form(spec, self.bounds_of(laws))
            self.models[laws] = spec, joint_box(form, self.tests, self.commands)
        return self.models[laws]

    def bounds_of(self, laws: DependenceSet) -> dict[str, tuple[float, float]]:
        """The bounds of a fit of these laws, with what they hold."""
        return {**self.settings.bounds, **{name: (value, value) for name, value in laws.held}}

    def transfer_starts(self, current: FittedSet, spec: DamperSpec, box: Box) -> Floats:
        """Parameters of each row of the present laws as a start of other laws, on the curves of the present ones."""
        rows = [in_other_dependences(current.spec, theta, spec, self.commands) for theta in current.fit.theta]
        return np.asarray(box.inside(np.array(rows)))


@dataclass(frozen=True, slots=True)
class _Change:
    """A change of the parameters `names`, and the candidate to which it leads."""

    laws: DependenceSet
    names: frozenset[str]

    def after(self, other: _Change) -> DependenceSet:
        """The candidate with both changes, of other parameters."""
        own, changed = self.laws, other.laws
        laws = {name: law for name, law in own.laws if name not in other.names}
        laws |= {name: law for name, law in changed.laws if name in other.names}
        held = {name: value for name, value in own.held if name not in other.names}
        held |= {name: value for name, value in changed.held if name in other.names}
        return DependenceSet.of(laws, held)


def dependences_of_size(parameter: ParamSpec, number: int, commands: Floats) -> list[Dependence]:
    """Laws of a parameter with a number of coefficients, polynomials through values first."""
    if number == 1:
        return [CONSTANT]
    polynomial = Dependence(number - 1)
    laws = [polynomial] if number - 1 <= MOST_DEGREE else []
    if number > 2:
        laws.append(dependence_through(polynomial.at_commands(commands.tolist()).nodes, "monotone"))
    if number == _OF_SATURATION:
        ends = float(commands[0]), float(commands[-1])
        laws += [dependence_through(ends, form) for form in SATURATING_FORMS]
    if parameter.is_positive and number - 1 <= MOST_DEGREE:
        laws.append(Dependence(number - 1, form="log_polynomial"))
    return laws


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
) -> DependenceSearch:
    """Check the settings and prepare the folds: of few records, stretches of each with a varying command."""
    if plain.command_unit is not None:
        raise SettingError(f"{plain.name} has current laws already; give the plain model to choose laws for")
    if settings.starts or settings.engine != "lanes":
        raise SettingError(
            "the choice of laws takes no starts and the engine `lanes`; leave these settings out"
        )
    spec = plain.with_current_laws({}, unit=unit)
    tested = CommandedTests.of(spec, tests)
    spec = with_other_dependences(spec, dependences_at(given, tested.commands))
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
    splits = replace(splits_of(tests, leave_out, between_commands=True), parts=parts)
    folds = Folds.of(spec, short, splits, settings, threads)
    # A split beyond the rest keeps a test at every command, and lowers no degree.
    n_levels = min(
        (
            len(levels)
            for split, levels in zip(splits.splits, folds.remaining, strict=True)
            if split.kind == "inside"
        ),
        default=len(commands),
    )
    most = min(MOST_DEGREE, n_levels - 1)
    if most < 1:
        raise SettingError(
            f"the tests run at {counted(len(commands), 'command')}, {n_levels} without those left out; laws are chosen "
            f"from tests at two or more: add tests, or give the laws, as in mrwork identify FILES {typed}"
        )
    linear, of_test = plain, np.zeros(len(short), dtype=np.intp)
    if varies:
        # Every law that is tried is nearly one through values at these.
        every = Dependence(form="monotone").at_commands(commands.tolist())
        commands, full = np.array(every.nodes), dict.fromkeys(plain.names, every)
        linear = plain.with_current_laws(full, unit=unit, lag="one_rate" if lagged else "none")
    else:
        of_test = np.searchsorted(commands, tested.set_points)
    return DependenceSearch(
        plain=plain,
        tests=short,
        folds=folds,
        promises=Promises(folds=folds, model=linear, commands=commands, levels=of_test),
        settings=settings,
        given=given,
        free=tuple(name for name in plain.names if name not in {**given, **settings.bounds}),
        most=most,
    )
