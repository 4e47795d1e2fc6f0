"""Effects on the recorded force that all tests of a fit have in common, and whether they pay: mass, lag, delay.

To first order, a late force is F(t - tau) = F - tau F', and a mass m that moves between damper and load cell adds m a.
At one frequency these are changes of stiffness and damping, which a fit absorbs in its parameters; at several they
determine tau and m. They pay where fits to the other tests, or to other parts of the time of a record of several
frequencies, predict each better with them, and the model describes enough to tell them. These fits are single
Gauss-Newton steps from the fit to all tests, which predicted synthetic and measured rigs as well as minimisations did
(DECISIONS.md, "A mass and a lag that all tests have in common are judged by tests that are predicted"). Sliders and
dashpots in the place of the model are weighed beside it, and decide where they predict better. A record alone shows a
late force by its corners at reversals, see `delay_remark`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.hints import SMALLEST
from mrwork.base.numbers import of_unit, significant, times
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.values import Floats, array_dataclass
from mrwork.identification.commands import excerpts_at
from mrwork.identification.covariance import Covariance, Slopes, state_of
from mrwork.identification.equivalent import Form
from mrwork.identification.fit import STRUCTURE, FittedParameter
from mrwork.identification.indistinct import SAME_FREQUENCY, are_at_one_frequency, frequency_ranges
from mrwork.identification.minimise.levenberg_marquardt import TOLERANCE, find_minima
from mrwork.identification.minimise.polish import FinalFit
from mrwork.identification.objective import (
    NormalEquations,
    Objective,
    linearise_residuals,
    observe_tests_by,
)
from mrwork.identification.problem import Problem, pooled_commands, with_free
from mrwork.identification.sliders import COARSE, RIDGE, SliderFit, Sliders
from mrwork.identification.suspicious import force_noise
from mrwork.identification.verdicts import NEGLIGIBLE
from mrwork.records import DamperTest
from mrwork.records.motion import smooth_motion, spectrum
from mrwork.records.observation import EFFECTS, Effect

Effects = tuple[Effect, ...]

_MASS, _DELAY, _LAG = (EFFECTS[name] for name in ("mass", "delay", "lag"))
# The tests are fitted again where the squared misfit would fall by more than this share. Effects are advised where the
# misfit of predictions falls below this share of that without them, and each exceeds so many of its standard errors. A
# single effect is preferred up to this ratio of these misfits.
_WORTH_A_FIT = 0.04
_PAYS = 0.95
_SIGNIFICANT = 4.0
# Errors by sliders count what a number of elements decides, and those of a model do not.
_SIGNIFICANT_BY_SLIDERS = 3.0
# Share of a mass by which gains of load cell and displacement, and the acceleration that follows from it, are wrong.
_GAIN = 0.01
_SIMPLER = 0.95
# Misfit of a wrong model, of its predictions and fits, which takes effects for what it lacks, unless these lower that
# of its predictions to this share. Where effects lower the misfit as far, but are not significant, the remark says so.
_WRONG = 0.12
_BEYOND_DOUBT = 0.7
# Eigenvalue of the equations of the others, per largest, below which they do not determine a combination of parameters;
# share of the sensitivity of a part that it may have to such ones.
_UNSEEN, _UNSEEN_SHARE = 1e-9, 1e-4
# Fewest groups of tests that are left out in turn, and parts of the time, and of the range of the force, else.
_PARTS = 3
# Delay that may be unknown, in samples and at most in periods, and mass [kg]; they are told where they change damping
# or stiffness by more than this share, and by more than this number of standard errors.
_SAMPLES = 3.0
_PERIODS = 0.02
_HEAVY = 20.0
_LARGE = 0.1
_FAR = 5.0
# From this share of its value on, the change of a parameter is told in its unit.
_MOST_SHARE = 10.0
# Share by which the misfits of a delay and of a lag may differ where the remark names both.
_ALIKE = 0.02
# Share by which misfits of predictions may differ where the error of a mass counts what both fits say of it.
_ABOUT = 0.05
# Shares of the stroke that a spring in series may take, the points of a grid over them, and the steps from its best.
_TAKEN, _GRID, _GOLDEN = (0.01, 0.4), 10, 14
_IT: Final = {1: "it", 2: "both"}
_UNKNOWN_DELAY: Final = RemarkKind(
    "delay_unknown",
    "a delay of the force of {ms:.2g} ms that is not known would move {0} by about {moved}, {errors} "
    "its standard error, and these tests do not tell it",
    "measure it and give it by --observe delay=SECONDS, or test at several frequencies",
)
_UNKNOWN_MASS: Final = RemarkKind(
    "mass_unknown",
    "a mass of {value:.2g} kg between damper and load cell that is not known would move {0} by about {moved}, "
    "{errors} its standard error, and these tests do not tell it",
    "weigh what moves there and give it by --observe mass=KG, or test at higher frequencies",
)
# A note: most dampers are tested at a frequency at a time, and nothing says that a mass moves.
_MASS_AS_STIFFNESS: Final = RemarkKind(
    "mass_as_stiffness",
    "tests at one frequency do not tell a mass between damper and load cell from the stiffness: one of {value:.2g} kg "
    "would move {0} by about {moved}, {errors} its error, so weigh what moves there and "
    "give it by --observe mass=KG, or add a test at another frequency",
)
# Where a fit is linear, a mass of zero is on no bound.
_ANY_MASS = replace(_MASS, free=(-5e3, 5e3))
_SETS: Final[tuple[Effects, ...]] = ((_LAG,), (_DELAY,), (_MASS,), (_MASS, _LAG), (_MASS, _DELAY))


def fit_effects(fit: FinalFit) -> FinalFit:
    """Fit the free effects of its settings, or those that pay, with all other parameters, from a fit without them.

    Effects that sliders tell are held at what these found. The tests of its problem have them. Errors of the effects
    count what the model cannot describe: leaving out tests moves the effects by that. Errors of the parameters count
    how far these follow.
    """
    problem, effects = fit.problem, fit.problem.settings.observing.free
    known: FitWithEffects | None = None
    if not effects and problem.settings.observing.weighs:
        weighed = _weigh(problem, fit.covariance)
        if weighed and weighed.is_told:
            effects = weighed.best.effects if weighed.best else ()
            known = weighed.best if weighed.by_sliders else None
            fit = replace(fit, remarks=(*fit.remarks, weighed.remark(EFFECTS_FITTED)))
    if not effects:
        return fit
    (fitted,) = _fit_with(
        problem.objective,
        problem.form,
        [effects],
        fit.theta,
        tolerance=TOLERANCE,
        held=known.values if known else None,
    )
    n_own = fit.theta.size
    values = dict(zip(effects, fitted.theta[n_own:].tolist(), strict=True))
    settings = problem.settings.with_effects(values)
    given = {effect.field: value for effect, value in values.items()}
    objective = observe_tests_by(
        problem.objective, [replace(test.observation, **given) for test in problem.objective.tests]
    )
    problem = replace(problem, settings=settings, objective=replace(objective, settings=settings))
    covariance, box = Covariance.of(fitted), fitted.form.box
    by_fit = known or FitWithEffects.of(fitted, effects, _frequency_groups(objective.tests))
    errors = by_fit.errors
    own = replace(
        covariance,
        slopes=Slopes.at(objective, problem.form, fitted.theta[:n_own]),
        matrix=_with_errors(covariance.matrix, errors),
    )
    estimates = [
        FittedParameter(
            name=box.names[index],
            value=value,
            unit=effect.unit,
            standard_error=error if np.isfinite(error) else None,
            lower=box.lower[index],
            upper=box.upper[index],
            state="told by sliders" if known else state_of(fitted.form, index, value),
        )
        for index, (effect, value), error in zip(
            range(n_own, len(box.names)), values.items(), errors.tolist(), strict=True
        )
    ]
    return replace(fit, problem=problem, covariance=own, effects=tuple(estimates))


def _with_errors(matrix: Floats, errors: Floats) -> Floats:
    """Covariance of the parameters, (n_own, n_own), of a `matrix` with that of effects, which have larger `errors`."""
    n_own = len(matrix) - errors.size
    least = np.sqrt(np.diag(matrix)[n_own:])
    varied = np.flatnonzero((least > 0.0) & np.isfinite(errors))
    if not varied.size:
        return matrix[:n_own, :n_own]
    of_effects = matrix[n_own:, n_own:][np.ix_(varied, varied)]
    follow = matrix[:n_own, n_own + varied] @ np.linalg.inv(of_effects)
    ratio = errors[varied] / least[varied]
    return np.asarray(
        matrix[:n_own, :n_own] + follow @ (of_effects * (np.outer(ratio, ratio) - 1.0)) @ follow.T
    )


def _fit_with(
    objective: Objective,
    form: Form,
    sets: Sequence[Effects],
    theta: Floats,
    *,
    tolerance: float = 1e-4,
    held: Floats | None = None,
) -> list[Slopes]:
    """Fit with each of several sets of free effects, from parameters `theta`, (n_params,), and what a test has given.

    The fits are one batch: few candidates take as long to simulate as one. The effects of a single set may be `held`
    at values, (n_effects,).
    """
    if not sets:
        return []
    test = objective.tests[0]
    every = tuple(effect for effect in EFFECTS.values() if any(effect in effects for effects in sets))
    given = [getattr(test.observation, effect.field) for effect in every]
    free = np.array([[effect in effects for effect in every] for effects in sets])
    # At zero, its bound, a lag has no slope.
    least = [test.dt if effect is _LAG else 0.0 for effect in every]
    starts = np.where(free & (np.array(given) == 0.0), least, given)
    if held is not None:
        starts[free] = held
    joint, joint_form = with_free(objective, form, every)
    minima = find_minima(
        joint,
        joint_form.box,
        np.hstack([np.tile(theta, (len(sets), 1)), starts]),
        held=np.hstack(
            [np.zeros((len(sets), len(form.box.free)), dtype=np.bool_), ~free | (held is not None)]
        ),
        max_iterations=50,
        tolerance=tolerance,
    )
    residuals, by_free = linearise_residuals(joint, minima.theta, joint_form.box.free)
    fits = []
    for number, effects in enumerate(sets):
        kept = np.concatenate([np.ones(theta.size, dtype=np.bool_), free[number]])
        varied = kept[list(joint_form.box.free)]
        with_own, form_of_own = with_free(joint, form, effects)
        fits.append(
            Slopes(
                objective=with_own,
                form=form_of_own,
                theta=minima.theta[number, kept],
                residuals=residuals[number],
                by_free=by_free[number, varied],
            )
        )
    return fits


@array_dataclass()
class FitWithEffects:
    """A fit with free effects: their values and errors, (n_effects,), its misfit and that of parts that it predicts.

    Misfits are root mean squares of the NRMSE. The parameters of a model are `theta`, (n_params,); sliders have none.
    """

    effects: Effects
    values: Floats
    errors: Floats
    misfit: float
    predicted: float
    theta: Floats | None = None

    @classmethod
    def of(cls, slopes: Slopes, effects: Effects, groups: NDArray[np.intp]) -> FitWithEffects:
        """Fit of a model; errors are the largest of least squares and of jackknifes over parts of the tests."""
        tests, n_effects = slopes.objective.tests, len(effects)
        steps, predicted = _predict_parts(tests, slopes.residuals, slopes.by_free, groups, held=_held(slopes))
        errors = Covariance.of(slopes).standard_errors[-n_effects:]
        errors = np.where(errors > 0.0, errors, np.inf)
        for without in steps:
            errors = np.maximum(errors, _jackknife(without[:, -n_effects:]))
        values = slopes.theta[-n_effects:]
        return cls(
            effects=effects,
            values=values,
            errors=_with_gain(effects, values, errors),
            misfit=float(np.linalg.norm(slopes.residuals)),
            predicted=predicted,
            theta=slopes.theta[:-n_effects],
        )

    @classmethod
    def by_sliders(cls, fit: SliderFit, effects: Effects, groups: NDArray[np.intp]) -> FitWithEffects:
        """Fit of sliders; squared errors are the sum of those of jackknifes over tests and sizes of the force."""
        steps, predicted = _predict_parts(fit.tests, fit.residuals, fit.by_free, groups, ridge=RIDGE)
        of_tests, of_sizes = (
            _jackknife(without[:, without.shape[1] - len(effects) :]) for without in steps[:2]
        )
        return cls(
            effects=effects,
            values=fit.values,
            errors=_with_gain(effects, fit.values, np.hypot(of_tests, of_sizes)),
            misfit=float(np.linalg.norm(fit.residuals)),
            predicted=predicted,
        )

    @property
    def is_significant(self) -> bool:
        """Whether all effects exceed several standard errors, and the mass is none that cannot be."""
        limit = _SIGNIFICANT if self.theta is not None else _SIGNIFICANT_BY_SLIDERS
        is_mass = self.effects[:1] == (_MASS,)
        return bool(np.all(np.abs(self.values) > limit * self.errors)) and not (
            is_mass and self.values[0] <= 0.0
        )


def _with_gain(effects: Effects, values: Floats, errors: Floats) -> Floats:
    """Errors of effects, (n_effects,), that of a mass with the errors of gains."""
    gains = np.array([_GAIN if effect is _MASS else 0.0 for effect in effects])
    return np.hypot(errors, gains * values)


def _jackknife(steps: Floats) -> Floats:
    """Standard errors, (n_free,), of steps without each part, (n_parts, n_free)."""
    spread = np.sum((steps - steps.mean(axis=0)) ** 2, axis=0)
    return np.asarray(np.sqrt((1.0 - 1.0 / len(steps)) * spread))


def _frequency_groups(tests: Sequence[DamperTest]) -> NDArray[np.intp]:
    """Number of the group at about one frequency that each test is in, lowest first, (n_tests,)."""
    lowest = frequency_ranges(tests)[:, 0]
    order = np.argsort(lowest, kind="stable")
    numbers = np.concatenate([[0], np.cumsum(lowest[order][1:] > SAME_FREQUENCY * lowest[order][:-1])])
    return np.asarray(numbers[np.argsort(order)])


def _predict_parts(
    tests: Sequence[DamperTest],
    residuals: Floats,
    by_free: Floats,
    groups: NDArray[np.intp],
    *,
    held: NDArray[np.bool_] | None = None,
    ridge: float = 0.0,
) -> tuple[list[Floats], float]:
    """Steps of the parameters without parts of the tests, (n_parts, n_free), and misfit of the parts after them.

    Parts are the tests, of one group parts of their time, which are predicted. Others are those by the size of the
    force, and the `groups` of tests at a frequency, (n_tests,), where there are several: what a model lacks is alike in
    all tests, and few of them do not show it. Residuals are (n_residuals,), derivatives (n_free, n_residuals).
    """
    parts, sizes = list[NDArray[np.intp]](), list[NDArray[np.intp]]()
    each = 1 if groups.any() else ceil(_PARTS / groups.size)
    for index, test in enumerate(tests):
        n_time, size = test.n_counted, np.argsort(np.argsort(np.abs(test.force[test.counted])))
        parts.append(index * each + np.arange(n_time) * each // n_time)
        sizes.append(size * _PARTS // n_time)
    normal = NormalEquations.of_parts(
        residuals, by_free, np.concatenate(parts) * _PARTS + np.concatenate(sizes)
    )
    of_part, of_size = np.divmod(np.arange(normal.squared.size), _PARTS)
    divisions = [of_part, of_size]
    if groups.max() >= _PARTS - 1:
        divisions.append(groups[of_part])
    fixed = np.zeros((1, len(by_free)), dtype=np.bool_) if held is None else held
    steps, left_out = list[Floats](), list[NDArray[np.bool_]]()
    for numbers in divisions:
        left_out.append(numbers == np.arange(numbers.max() + 1)[:, None])
        steps.append(normal.steps(np.asarray(1.0 - left_out[-1], dtype=np.float64), fixed, ridge=ridge))
    shown = _shown(normal, left_out[0], fixed)
    if not shown.any():
        return steps, np.inf
    squared = np.where(left_out[0], normal.after(steps[0][:, None]), 0.0).sum(axis=1)
    return steps, float(np.sqrt(squared[shown].sum() / np.mean(shown)))


def _shown(
    normal: NormalEquations, left_out: NDArray[np.bool_], fixed: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Whether what is not in each part, (n_parts, n_pieces), determines what the part shows, (n_parts,).

    A step leaves what the others do not determine where the fit to all tests has it, so that it predicts nothing.
    """
    pieces = np.where(fixed[0][:, None] | fixed[0], 0.0, normal.matrix[0])
    whole = pieces.sum(axis=0)
    size = np.sqrt(np.maximum(np.diag(whole), SMALLEST))
    shown = np.empty(len(left_out), dtype=np.bool_)
    for number, of_part in enumerate(left_out):
        part = pieces[of_part].sum(axis=0) / size / size[:, None]
        values, vectors = np.linalg.eigh(whole / size / size[:, None] - part)
        unseen = vectors[:, values < _UNSEEN * values[-1]]
        alone = np.trace(unseen.T @ part @ unseen)
        shown[number] = alone < _UNSEEN_SHARE * np.trace(part)
    return shown


def _held(slopes: Slopes) -> NDArray[np.bool_]:
    """Free parameters that are on a bound, one row."""
    return ~np.isin(slopes.form.box.free, slopes.interior)[None]


_PAY: Final = "{found}: with {it} {who} to the other tests predict each to {predicted}"
EFFECTS_FITTED: Final = RemarkKind("effects_fitted", f"{_PAY}; fitted with the parameters")
_UNFITTED: Final = RemarkKind("effects_unfitted", _PAY, "fit {it} by {options}{unless}")
_SPRING: Final = RemarkKind(
    "spring_in_series",
    "sliders and dashpots behind a spring in series of {value:.2g} N/m predict the other tests each to {spring:.2f} %, "
    "with {effect} in its place to {best:.2f} %, and with neither to {neither:.2f} %: a mount or a bushing that gives "
    "explains the tests as well",
    "measure the displacement across the damper alone, or push it slowly with the piston held, which tells the "
    "stiffness of the mount",
)
_HIDDEN: Final = RemarkKind(
    "effects_hidden",
    "without a mass that moves between damper and load cell, or a late force, the fit reaches {percent:.0f} %, and "
    "with them {value:.0f} % at most: the model describes too little, or the tests are too few, to tell them, and "
    "stiffness and damping may be theirs",
    "compare models (--model A,B), or add tests at other frequencies",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Spring:
    """A spring in series [N/m], and the misfit with which sliders behind it predict parts of tests."""

    stiffness: float
    predicted: float


@array_dataclass()
class _Weighing:
    """Effects that pay, the `best` of those that were `weighed`, beside a fit `theta` without them, (n_params,).

    Fits of sliders weighed them where these predict tests better than the model. `earlier` is the misfit of
    predictions without effects, `own` that of the fit of the model, `least` that of its best. None is the best with a
    model that describes too little, or of too few tests, or where a `spring` in series predicts better, and `is_told`
    whether they may pay.
    """

    problem: Problem
    theta: Floats
    best: FitWithEffects | None
    weighed: Sequence[FitWithEffects]
    earlier: float
    own: float
    least: float
    is_told: bool
    spring: _Spring | None = None

    @property
    def by_sliders(self) -> bool:
        """Whether sliders, and not the model, weighed the effects."""
        return bool(self.weighed) and self.weighed[0].theta is None

    @property
    def mass_error(self) -> float:
        """Standard error of a mass in the fit that predicts best of those with one [kg]; infinite without any."""
        return next((float(each.errors[0]) for each in self.weighed if _MASS in each.effects), np.inf)

    def remark(self, kind: RemarkKind) -> Remark:
        """What the effects are, how much better the tests are predicted with them, and what they do to a parameter.

        The `kind` says whether they are fitted; it is another one where none is the best.
        """
        best, told, sizes = self.best, list[str](), list[Measured]()
        if self.spring is not None:
            beside = min(self.weighed, key=lambda fit: fit.predicted)
            errors = {"spring": self.spring.predicted, "best": beside.predicted, "neither": self.earlier}
            return _SPRING.remark(
                measured=Measured(self.spring.stiffness, "N/m"),
                effect=" and ".join(f"a {effect.name}" for effect in beside.effects),
                **{name: 100.0 * (1.0 - error) for name, error in errors.items()},
            )
        if best is None:
            most = Measured(100.0 * (1.0 - self.least), "%")
            return _HIDDEN.remark(measured=most, percent=100.0 * (1.0 - self.own))
        for effect, value, error in zip(
            best.effects, best.values.tolist(), best.errors.tolist(), strict=True
        ):
            sizes.append(size := Measured(abs(value), effect.unit, standard_error=error))
            if effect is _MASS:
                told.append(f"a mass of {size.in_words()} kg moves between damper and load cell")
                continue
            samples = abs(value) / min(test.dt for test in self.problem.objective.tests)
            told.append(
                f"the force {'lags' if value > 0.0 else 'leads'} the model by {size.in_words(1e3)} ms "
                f"({samples:.1f} samples), a {effect.name}"
            )
        other = next(
            (each for each in self.weighed if {*each.effects} ^ {*best.effects} == {_DELAY, _LAG}), None
        )
        also = ""
        if other is not None and other.misfit < (1.0 + _ALIKE) * best.misfit:
            seconds = 1e3 * other.values[-1]
            also = f" (or a {other.effects[-1].name} of {seconds:.2g} ms, which describes them about as well)"
        theta, to_model = best.theta, self.problem.form.to_model
        if theta is None:
            excerpts = excerpts_at(self.problem, self.theta)
            (held,) = _fit_with(excerpts, self.problem.form, [best.effects], self.theta, held=best.values)
            theta = held.theta[: self.theta.size]
        before, after = (np.asarray(to_model(point)) for point in (self.theta, theta))
        changed = ""
        if moved := _absorbing(self.problem, best.effects):
            worst = max(
                moved, key=lambda index: abs(after[index] - before[index]) / (abs(before[index]) or 1.0)
            )
            parameter = self.problem.spec.parameters[worst]
            values = (
                f"{significant(after[worst], 3)} instead of {significant(before[worst], 3)} {parameter.unit}"
            )
            changed = f", and {parameter.name} is {values}"
        late, model = (
            ("motion", "with more friction") if best.values[-1] < 0.0 else ("force", "whose force relaxes")
        )
        unless = f" if the channel of the {late} is late, else try a model {model}"
        fits = [f"{100.0 * (1.0 - misfit):.2f} %" for misfit in (best.predicted, self.earlier)]
        return kind.remark(
            *(effect.name for effect in best.effects),
            measured=sizes[0],
            found=f"{' and '.join(told)}, one for all tests{also}",
            it=_IT[len(told)],
            who="fits of sliders and dashpots" if best.theta is None else "fits",
            predicted=f"{' instead of '.join(fits)}{changed}",
            options="--observe weigh"
            if best.theta is None
            else " ".join(f"--observe {effect.name}=free" for effect in best.effects),
            unless="" if _MASS in best.effects else unless,
        )


def unfitted_effects(problem: Problem, covariance: Covariance) -> Iterator[Remark]:
    """Warn of effects on the recorded force that pay, or of damping that an unknown delay would change by far."""
    # What is to be weighed was weighed before, by `fit_effects`.
    slopes, known = covariance.slopes, _known(problem)
    weighed = None if problem.settings.observing.weighs else _weigh(problem, covariance)
    if weighed and weighed.is_told:
        yield weighed.remark(_UNFITTED)
        if not weighed.best or _MASS in weighed.best.effects:
            return
        known |= {_DELAY}
    for effect in (_DELAY, _ANY_MASS):
        if effect.name not in {each.name for each in known} and slopes.interior:
            free = with_free(slopes.objective, slopes.form, (effect,))
            at_zero = Slopes.at(*free, np.array([*slopes.theta, 0.0]))
            error = weighed.mass_error if weighed and effect is _ANY_MASS else np.inf
            yield from _unknown(problem, effect, at_zero, covariance.standard_errors, error)


def _known(problem: Problem) -> set[Effect]:
    """Effects that are given, or estimated for each test; all where a command varies: the coil is late, too."""
    tests = problem.objective.tests
    known = {
        effect
        for effect in EFFECTS.values()
        if any(getattr(test.observation, effect.field) for test in tests)
    }
    varies = any(test.has_varying_command for test in tests)
    if known & {_DELAY, _LAG} or _DELAY in problem.settings.observing.of_each:
        known |= {_DELAY, _LAG}
    return known | {_MASS, _DELAY, _LAG} if varies else known


def _weigh(problem: Problem, covariance: Covariance) -> _Weighing | None:
    """Effects on the recorded force that pay beside a fit without them, or that a wrong model does not tell.

    Excerpts are fitted by sliders, and by the model where that is worth it: where its misfit would fall by far, and not
    stay above that with which sliders predict parts, so that these decide whatever the model would have.
    """
    slopes, known = covariance.slopes, _known(problem)
    tests, form, theta = slopes.objective.tests, slopes.form, slopes.theta
    if known >= {_MASS, _DELAY} or not slopes.interior or are_at_one_frequency(tests):
        return None
    at_zero = Slopes.at(*with_free(slopes.objective, form, (_ANY_MASS, _DELAY)), np.array([*theta, 0.0, 0.0]))
    normal = at_zero.normal()
    step = normal.steps(np.ones((1, len(tests))), _held(at_zero))
    sets = [effects for effects in _SETS if not known & {*effects}]
    after = float(normal.after(step[:, None]).sum())
    is_worth = after < (1.0 - _WORTH_A_FIT) * normal.squared.sum()
    excerpts, groups = excerpts_at(problem, theta), _frequency_groups(tests)
    own = Slopes.at(excerpts, form, theta)
    _, earlier = _predict_parts(excerpts.tests, own.residuals, own.by_free, groups, held=_held(own))
    weighed, earlier_sliders = _weigh_by_sliders(excerpts.tests, sets, groups)
    by_sliders = min(each.predicted for each in weighed)
    by_model = list[FitWithEffects]()
    if not (by_sliders < min(earlier, np.sqrt(after)) and _best_of(weighed, earlier_sliders)):
        modelled = _fit_with(excerpts, form, sets if is_worth else [], theta)
        by_model = [
            FitWithEffects.of(fitted, effects, groups)
            for fitted, effects in zip(modelled, sets, strict=False)
        ]
    if by_sliders < min([earlier, *(each.predicted for each in by_model)]):
        earlier = earlier_sliders
    else:
        weighed = by_model
    weighed.sort(key=_preference)
    best, spring = _best_of(weighed, earlier), None
    if best is not None:
        behind = _behind_spring(excerpts.tests, groups)
        if behind.predicted < (1.0 + _ABOUT) * min(each.predicted for each in weighed):
            best, spring = None, behind
    misfit = float(np.linalg.norm(slopes.residuals))
    least = min([misfit, *(each.misfit for each in by_model)])
    is_noise = least * np.sqrt(np.mean([test.variance for test in slopes.objective.compared])) <= (
        STRUCTURE * force_noise(tests)
    )
    may_pay = bool(_paying(weighed, earlier)) or (
        not is_noise and (least >= _WRONG or least < _BEYOND_DOUBT * misfit)
    )
    return _Weighing(
        problem=problem,
        theta=theta,
        best=best,
        weighed=weighed,
        earlier=earlier,
        own=misfit,
        least=least,
        spring=spring,
        is_told=best is not None
        or spring is not None
        or (may_pay and not any(pooled_commands(tests, (problem.spec,)))),
    )


def _preference(fit: FitWithEffects) -> float:
    return fit.predicted * (_SIMPLER if len(fit.effects) == 1 else 1.0)


def _paying(weighed: Sequence[FitWithEffects], earlier: float) -> list[FitWithEffects]:
    """The fits of which each effect is significant, and pays beside the misfit of predictions without any.

    Predictions that are worse than a constant force show nothing: a part of a ramp is none of the motion of the others.
    """
    most = min(_PAYS * earlier, 1.0)
    return [each for each in weighed if each.is_significant and each.predicted < most]


def _best_of(weighed: Sequence[FitWithEffects], earlier: float) -> FitWithEffects | None:
    """The preferred one of the fits that pay, and are not of a model that describes too little."""
    sound = [
        each for each in _paying(weighed, earlier) if each.predicted < max(_WRONG, _BEYOND_DOUBT * earlier)
    ]
    return min(sound, key=_preference, default=None)


def _weigh_by_sliders(
    tests: Sequence[DamperTest], sets: Sequence[Effects], groups: NDArray[np.intp]
) -> tuple[list[FitWithEffects], float]:
    """Fits of sliders with each set of effects, and the misfit with which they predict parts without any.

    Errors count by how much fewer elements tell other effects, and those of a mass what other fits that predict about
    as well say of it.
    """
    sliders, coarse = Sliders.of(tests), Sliders.of(tests, COARSE)
    fits = [FitWithEffects.by_sliders(sliders.fit(effects), effects, groups) for effects in sets]
    weighed = []
    for fit in fits:
        errors = np.hypot(fit.errors, coarse.fit(fit.effects).values - fit.values)
        if _MASS in fit.effects:
            apart = [
                each.values[0] - fit.values[0]
                for each in fits
                if _MASS in each.effects and abs(each.predicted - fit.predicted) < _ABOUT * fit.predicted
            ]
            errors[0] = np.hypot(errors[0], np.abs(apart).max(initial=0.0))
        weighed.append(replace(fit, errors=errors))
    return weighed, FitWithEffects.by_sliders(sliders.fit(()), (), groups).predicted


def _behind_spring(tests: Sequence[DamperTest], groups: NDArray[np.intp]) -> _Spring:
    """The spring in series behind which sliders predict parts of the tests best."""
    from scipy.optimize import minimize_scalar  # slow to load and rarely needed

    sliders, forces = Sliders.of(tests), [smooth_motion(test.force, test.dt) for test in tests]
    largest = max(float(np.ptp(test.displacement) / np.ptp(test.force)) for test in tests)

    def predicted(log_compliance: float) -> float:
        fit = sliders.behind(float(np.exp(log_compliance)), forces).fit(())
        return FitWithEffects.by_sliders(fit, (), groups).predicted

    grid = np.log(largest * np.geomspace(*_TAKEN, _GRID))
    least = int(np.argmin([predicted(each) for each in grid.tolist()]))
    ends = float(grid[max(least - 1, 0)]), float(grid[min(least + 1, _GRID - 1)])
    found = minimize_scalar(predicted, bounds=ends, method="bounded", options={"maxiter": _GOLDEN})
    return _Spring(stiffness=float(np.exp(-found.x)), predicted=float(found.fun))


def _absorbing(problem: Problem, effects: Effects) -> list[int]:
    """Indices of the parameters of the requested model that took the part of the effects: damping, or stiffness."""
    unit = "N/m" if any(effect.name == "mass" for effect in effects) else "N s/m"
    return [index for index, parameter in enumerate(problem.spec.parameters) if parameter.unit == unit]


def _unknown(
    problem: Problem, effect: Effect, at_zero: Slopes, errors: Floats, known_to: float
) -> Iterator[Remark]:
    """Warn of a stiffness or damping that an unknown effect would change by far more than its standard error.

    What the effect may be is at most `known_to`, the error with which tests tell it.
    """
    tests, size = at_zero.objective.tests, _HEAVY
    if effect is _DELAY:
        highest = max(spectrum(test.displacement, test.dt).dominant for test in tests)
        size = min(_SAMPLES * min(test.dt for test in tests), _PERIODS / highest)
    is_one = are_at_one_frequency(tests)
    of_mass = _MASS_AS_STIFFNESS if is_one else _UNKNOWN_MASS
    kind = _UNKNOWN_DELAY if effect is _DELAY else of_mass
    if not is_one:
        by_model = FitWithEffects.of(at_zero, (effect,), _frequency_groups(tests)).errors[-1]
        size = min(size, by_model if np.isinf(known_to) else known_to)
    normal, held = at_zero.normal(), _held(at_zero)
    held[:, -1] = True
    # The step with which the other parameters follow the effect.
    follow = replace(normal, gradient=normal.matrix[..., -1]).steps(np.ones((1, len(tests))), held)
    theta, form = at_zero.theta[:-1], problem.form
    change = np.zeros(theta.size)
    change[list(form.box.free)] = size * follow[0, :-1]
    value = np.asarray(form.to_model(theta))
    shift = form.to_model.jacobian(theta) @ change
    # Of a stiffness that is zero to rounding every mass is many times the value, and changes no force.
    of_motion = [test.displacement if effect is _MASS else test.velocity for test in tests]
    per_force = max(
        np.std(motion) / np.std(test.force) for motion, test in zip(of_motion, tests, strict=True)
    )
    far = [
        index
        for index in _absorbing(problem, (effect,))
        if abs(shift[index]) * per_force > NEGLIGIBLE
        and abs(shift[index]) > max(_FAR * errors[index], _LARGE * abs(value[index]))
        and errors[index] > 0.0 < abs(value[index])
    ]
    if far:
        worst = max(far, key=lambda index: abs(shift[index]) / errors[index])
        by, parameter = abs(shift[worst]), problem.spec.parameters[worst]
        share = by / abs(value[worst])
        moved = f"{100.0 * share:.0f} %" if share < _MOST_SHARE else of_unit(by, parameter.unit, 3)
        measured = Measured(float(size), effect.unit)
        errors_off = times(by / errors[worst])
        yield kind.remark(parameter.name, measured=measured, ms=1e3 * size, moved=moved, errors=errors_off)
