"""Effects on the recorded force that all tests of a fit have in common, and whether they pay: mass, lag, delay.

To first order, a late force is F(t - tau) = F - tau F', and a mass m that moves between damper and load cell adds m a.
At one frequency these are changes of stiffness and damping, which a fit absorbs in its parameters; at several they
determine tau and m. They pay where fits to the other tests, or to other parts of the time of a record of several
frequencies, predict each better with them, and the model describes enough to tell them. These fits are single
Gauss-Newton steps from the fit to all tests, which predicted synthetic and measured rigs as well as minimisations did
(DECISIONS.md, "A mass and a lag that all tests have in common are judged by tests that are predicted"). A record alone
shows a late force by its corners at reversals, see `delay_remark`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import ceil
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.numbers import significant
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.values import Floats, array_dataclass
from mrwork.identification.commands import excerpts_at
from mrwork.identification.covariance import Covariance, Slopes, state_of
from mrwork.identification.equivalent import Form
from mrwork.identification.fit import STRUCTURE, FittedParameter
from mrwork.identification.indistinct import SAME_FREQUENCY, are_at_one_frequency, frequency_ranges
from mrwork.identification.minimise.levenberg_marquardt import TOLERANCE, find_minima
from mrwork.identification.minimise.polish import FinalFit
from mrwork.identification.objective import Objective, linearise_residuals, observe_tests_by
from mrwork.identification.problem import Problem, pooled_commands, with_free
from mrwork.identification.suspicious import force_noise
from mrwork.records import DamperTest
from mrwork.records.motion import spectrum
from mrwork.records.observation import EFFECTS, WEIGH, Effect

Effects = tuple[Effect, ...]

_MASS, _DELAY, _LAG = (EFFECTS[name] for name in ("mass", "delay", "lag"))
# The tests are fitted again where the squared misfit would fall by more than this share. Effects are advised where the
# misfit of predictions falls below this share of that without them, and each exceeds so many of its standard errors. A
# single effect is preferred up to this ratio of these misfits.
_WORTH_A_FIT = 0.04
_PAYS = 0.95
_SIGNIFICANT = 4.0
_SIMPLER = 0.95
# Misfit of a wrong model, of its predictions and fits, which takes effects for what it lacks, unless these lower that
# of its predictions to this share. Where effects lower the misfit as far, but are not significant, the remark says so.
_WRONG = 0.12
_BEYOND_DOUBT = 0.7
# Fewest groups of tests that are left out in turn, and parts of the time, and of the range of the force, else.
_PARTS = 3
# Delay that may be unknown, in samples and at most in periods, and mass [kg]; they are told where they change damping
# or stiffness by more than this share, and by more than this number of standard errors.
_SAMPLES = 3.0
_PERIODS = 0.02
_HEAVY = 20.0
_LARGE = 0.1
_FAR = 5.0
# Share by which the misfits of a delay and of a lag may differ where the remark names both.
_ALIKE = 0.02
_IT: Final = {1: "it", 2: "both"}
_UNKNOWN_DELAY: Final = RemarkKind(
    "delay_unknown",
    "a delay of the force of {ms:.2g} ms that is not known would move {0} by about {percent:.0f} %, {errors:.0f} times "
    "its standard error, and these tests do not tell it",
    "measure it and give it by --observe delay=SECONDS, or test at several frequencies",
)
_UNKNOWN_MASS: Final = RemarkKind(
    "mass_unknown",
    "a mass of {value:.2g} kg between damper and load cell that is not known would move {0} by about {percent:.0f} %, "
    "{errors:.0f} times its standard error, and these tests do not tell it",
    "weigh what moves there and give it by --observe mass=KG, or test at higher frequencies",
)
# Where a fit is linear, a mass of zero is on no bound.
_ANY_MASS = replace(_MASS, free=(-5e3, 5e3))
_SETS: Final[tuple[Effects, ...]] = ((_LAG,), (_DELAY,), (_MASS,), (_MASS, _LAG), (_MASS, _DELAY))


def fit_effects(fit: FinalFit) -> FinalFit:
    """Fit the free effects of its settings, or those that pay, with all other parameters, from a fit without them.

    The tests of its problem have them. Errors of the effects count what the model cannot describe: leaving out tests
    moves the effects by that. Errors of the parameters count how far these follow.
    """
    problem, effects = fit.problem, fit.problem.settings.free_effects
    if not effects and WEIGH in problem.settings.observe and (found := _weigh(problem, fit.covariance)):
        effects = found.best.effects if found.best else ()
        fit = replace(fit, remarks=(*fit.remarks, found.remark(_FITTED)))
    if not effects:
        return fit
    (fitted,) = _fit_with(problem.objective, problem.form, [effects], fit.theta, tolerance=TOLERANCE)
    n_own = fit.theta.size
    values = dict(zip(effects, fitted.theta[n_own:].tolist(), strict=True))
    settings = problem.settings.with_effects(values)
    given = {effect.field: value for effect, value in values.items()}
    objective = observe_tests_by(
        problem.objective, [replace(test.observation, **given) for test in problem.objective.tests]
    )
    problem = replace(problem, settings=settings, objective=replace(objective, settings=settings))
    covariance, box = Covariance.of(fitted), fitted.form.box
    errors = FitWithEffects.of(fitted, effects, _frequency_groups(objective.tests)).errors
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
            state=state_of(box, index, value),
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
    objective: Objective, form: Form, sets: Sequence[Effects], theta: Floats, *, tolerance: float = 1e-4
) -> list[Slopes]:
    """Fit with each of several sets of free effects, from parameters `theta`, (n_params,), and what a test has given.

    The fits are one batch: few candidates take as long to simulate as one.
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
    joint, joint_form = with_free(objective, form, every)
    minima = find_minima(
        joint,
        joint_form.box,
        np.hstack([np.tile(theta, (len(sets), 1)), starts]),
        held=np.hstack([np.zeros((len(sets), len(form.box.free)), dtype=np.bool_), ~free]),
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
    """A fit with free effects: their values and errors, (n_effects,), and the misfit with which it predicts groups."""

    effects: Effects
    slopes: Slopes
    errors: Floats
    predicted: float

    @classmethod
    def of(cls, slopes: Slopes, effects: Effects, groups: NDArray[np.intp]) -> FitWithEffects:
        """Errors are the largest of least squares and of jackknifes over parts of the tests."""
        steps, predicted = _predict_parts(slopes, groups)
        errors = Covariance.of(slopes).standard_errors[-len(effects) :]
        errors = np.where(errors > 0.0, errors, np.inf)
        for without in steps:
            last = without[:, -len(effects) :]
            spread = np.sum((last - last.mean(axis=0)) ** 2, axis=0)
            errors = np.maximum(errors, np.sqrt((1.0 - 1.0 / len(last)) * spread))
        return cls(effects=effects, slopes=slopes, errors=errors, predicted=predicted)

    @property
    def is_significant(self) -> bool:
        """Whether all effects exceed several standard errors."""
        return bool(np.all(np.abs(self.values) > _SIGNIFICANT * self.errors))

    @property
    def values(self) -> Floats:
        """Values of the effects, (n_effects,)."""
        return self.slopes.theta[-len(self.effects) :]

    @property
    def misfit(self) -> float:
        """Root mean square of the NRMSE."""
        return float(np.linalg.norm(self.slopes.residuals))


def _frequency_groups(tests: Sequence[DamperTest]) -> NDArray[np.intp]:
    """Number of the group at about one frequency that each test is in, lowest first, (n_tests,)."""
    lowest = frequency_ranges(tests)[:, 0]
    order = np.argsort(lowest, kind="stable")
    numbers = np.concatenate([[0], np.cumsum(lowest[order][1:] > SAME_FREQUENCY * lowest[order][:-1])])
    return np.asarray(numbers[np.argsort(order)])


def _predict_parts(slopes: Slopes, groups: NDArray[np.intp]) -> tuple[list[Floats], float]:
    """Steps of the parameters without parts of the tests, (n_parts, n_free), and misfit of the parts after them.

    Parts are the tests, of one group parts of their time, which are predicted. Others are those by the size of the
    force, and the `groups` of tests at a frequency, (n_tests,), where there are several: what a model lacks is alike in
    all tests, and few of them do not show it.
    """
    parts, sizes = list[NDArray[np.intp]](), list[NDArray[np.intp]]()
    each = 1 if groups.any() else ceil(_PARTS / groups.size)
    for index, test in enumerate(slopes.objective.tests):
        n_time, size = test.n_counted, np.argsort(np.argsort(np.abs(test.force[test.counted])))
        parts.append(index * each + np.arange(n_time) * each // n_time)
        sizes.append(size * _PARTS // n_time)
    normal = slopes.normal(np.concatenate(parts) * _PARTS + np.concatenate(sizes))
    of_part, of_size = np.divmod(np.arange(normal.squared.size), _PARTS)
    divisions = [of_part, of_size]
    if groups.max() >= _PARTS - 1:
        divisions.append(groups[of_part])
    steps, left_out = list[Floats](), list[NDArray[np.bool_]]()
    for numbers in divisions:
        left_out.append(numbers == np.arange(numbers.max() + 1)[:, None])
        steps.append(normal.steps(np.asarray(1.0 - left_out[-1], dtype=np.float64), _held(slopes)))
    predicted = float(np.sqrt(normal.after(steps[0][:, None])[left_out[0]].sum()))
    return steps, predicted


def _held(slopes: Slopes) -> NDArray[np.bool_]:
    """Free parameters that are on a bound, one row."""
    return ~np.isin(slopes.form.box.free, slopes.interior)[None]


_PAY: Final = "{found}: with {it} fits to the other tests predict each to {predicted}"
_FITTED: Final = RemarkKind("effects_fitted", f"{_PAY}; fitted with the parameters")
_UNFITTED: Final = RemarkKind("effects_unfitted", _PAY, "fit {it} by {options}{unless}")
_HIDDEN: Final = RemarkKind(
    "effects_hidden",
    "without a mass that moves between damper and load cell, or a late force, the fit reaches {percent:.0f} %, and "
    "with them {value:.0f} % at most: the model describes too little, or the tests are too few, to tell them, and "
    "stiffness and damping may be theirs",
    "compare models (--model A,B), or add tests at other frequencies",
)


@array_dataclass()
class _Found:
    """Effects that pay, the `best` of those that were `weighed`, beside a fit `theta` without them, (n_params,).

    `earlier` is the misfit of predictions without them, `own` that of the fit, `least` that of the best fit. None is
    the best with a model that describes too little, or of too few tests.
    """

    problem: Problem
    theta: Floats
    best: FitWithEffects | None
    weighed: Sequence[FitWithEffects]
    earlier: float
    own: float
    least: float

    def remark(self, kind: RemarkKind) -> Remark:
        """What the effects are, how much better the tests are predicted with them, and what they do to a parameter.

        The `kind` says whether they are fitted; it is another one where none is the best.
        """
        best, told, sizes = self.best, list[str](), list[Measured]()
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
        to_model, n_own = self.problem.form.to_model, self.theta.size
        before, after = (np.asarray(to_model(point)) for point in (self.theta, best.slopes.theta[:n_own]))
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
            predicted=f"{' instead of '.join(fits)}{changed}",
            options=" ".join(f"--observe {effect.name}=free" for effect in best.effects),
            unless="" if _MASS in best.effects else unless,
        )


def unfitted_effects(problem: Problem, covariance: Covariance) -> Iterator[Remark]:
    """Warn of effects on the recorded force that pay, or of damping that an unknown delay would change by far."""
    # What is to be weighed was weighed before, by `fit_effects`.
    slopes = covariance.slopes
    if WEIGH not in problem.settings.observe and (found := _weigh(problem, covariance)):
        yield found.remark(_UNFITTED)
        return
    for effect in (_DELAY, _ANY_MASS):
        if effect.name not in {each.name for each in _known(problem)} and slopes.interior:
            free = with_free(slopes.objective, slopes.form, (effect,))
            at_zero = Slopes.at(*free, np.array([*slopes.theta, 0.0]))
            yield from _unknown(problem, effect, at_zero, covariance.standard_errors)


def _known(problem: Problem) -> set[Effect]:
    """Effects that are given, or estimated for each test; all where a command varies: the coil is late, too."""
    tests = problem.objective.tests
    known = {
        effect
        for effect in EFFECTS.values()
        if any(getattr(test.observation, effect.field) for test in tests)
    }
    varies = any(test.has_varying_command for test in tests)
    if known & {_DELAY, _LAG} or _DELAY in problem.settings.effects_of_each:
        known |= {_DELAY, _LAG}
    return known | {_MASS, _DELAY, _LAG} if varies else known


def _weigh(problem: Problem, covariance: Covariance) -> _Found | None:
    """Effects on the recorded force that pay beside a fit without them, or that a wrong model does not tell.

    Excerpts are fitted where that is worth it.
    """
    slopes, known = covariance.slopes, _known(problem)
    tests, form, theta = slopes.objective.tests, slopes.form, slopes.theta
    if known >= {_MASS, _DELAY} or not slopes.interior or are_at_one_frequency(tests):
        return None
    at_zero = Slopes.at(*with_free(slopes.objective, form, (_ANY_MASS, _DELAY)), np.array([*theta, 0.0, 0.0]))
    normal = at_zero.normal()
    step = normal.steps(np.ones((1, len(tests))), _held(at_zero))
    sets = [effects for effects in _SETS if not known & {*effects}]
    if normal.after(step[:, None]).sum() >= (1.0 - _WORTH_A_FIT) * normal.squared.sum():
        sets = []
    excerpts, groups = excerpts_at(problem, theta), _frequency_groups(tests)
    weighed = [
        FitWithEffects.of(fitted, effects, groups)
        for fitted, effects in zip(_fit_with(excerpts, form, sets, theta), sets, strict=True)
    ]
    weighed.sort(key=lambda each: each.predicted * (_SIMPLER if len(each.effects) == 1 else 1.0))
    _, earlier = _predict_parts(Slopes.at(excerpts, form, theta), groups)
    paying = [each for each in weighed if each.is_significant and each.predicted < _PAYS * earlier]
    best = next((each for each in paying if each.predicted < max(_WRONG, _BEYOND_DOUBT * earlier)), None)
    own = float(np.linalg.norm(slopes.residuals))
    least = min([own, *(each.misfit for each in weighed)])
    is_noise = least * np.sqrt(np.mean([test.variance for test in slopes.objective.compared])) <= (
        STRUCTURE * force_noise(tests)
    )
    told = bool(paying) or (not is_noise and (least >= _WRONG or least < _BEYOND_DOUBT * own))
    if best is None and (not told or any(pooled_commands(tests, (problem.spec,)))):
        return None
    return _Found(
        problem=problem, theta=theta, best=best, weighed=weighed, earlier=earlier, own=own, least=least
    )


def _absorbing(problem: Problem, effects: Effects) -> list[int]:
    """Indices of the parameters of the requested model that took the part of the effects: damping, or stiffness."""
    unit = "N/m" if any(effect.name == "mass" for effect in effects) else "N s/m"
    return [index for index, parameter in enumerate(problem.spec.parameters) if parameter.unit == unit]


def _unknown(problem: Problem, effect: Effect, at_zero: Slopes, errors: Floats) -> Iterator[Remark]:
    """Warn of a stiffness or damping that an unknown effect would change by far more than its standard error."""
    tests, size = at_zero.objective.tests, _HEAVY
    if effect is _DELAY:
        highest = max(spectrum(test.displacement, test.dt).dominant for test in tests)
        size = min(_SAMPLES * min(test.dt for test in tests), _PERIODS / highest)
    if not are_at_one_frequency(tests):
        size = min(size, FitWithEffects.of(at_zero, (effect,), _frequency_groups(tests)).errors[-1])
    elif effect is not _DELAY:
        return
    normal, held = at_zero.normal(), _held(at_zero)
    held[:, -1] = True
    # The step with which the other parameters follow the effect.
    follow = replace(normal, gradient=normal.matrix[..., -1]).steps(np.ones((1, len(tests))), held)
    theta, form = at_zero.theta[:-1], problem.form
    change = np.zeros(theta.size)
    change[list(form.box.free)] = size * follow[0, :-1]
    value = np.asarray(form.to_model(theta))
    shift = form.to_model.jacobian(theta) @ change
    far = [
        index
        for index in _absorbing(problem, (effect,))
        if abs(shift[index]) > max(_FAR * errors[index], _LARGE * abs(value[index]))
        and errors[index] > 0.0 < abs(value[index])
    ]
    if far:
        worst = max(far, key=lambda index: abs(shift[index]) / errors[index])
        percent, times = 100.0 * abs(shift[worst] / value[worst]), abs(shift[worst]) / errors[worst]
        measured, name = Measured(float(size), effect.unit), problem.spec.names[worst]
        kind = _UNKNOWN_DELAY if effect is _DELAY else _UNKNOWN_MASS
        yield kind.remark(name, measured=measured, ms=1e3 * size, percent=percent, errors=times)
