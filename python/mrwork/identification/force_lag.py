"""A late force: a lag or delay of the force channel that all tests of a fit have in common, and whether it pays.

To first order, a late force is F(t - tau) = F - tau F'. At one frequency that is a change of stiffness and damping,
which a fit absorbs in its parameters; at several frequencies the changes differ, so that they determine tau. It pays
where fits to the other frequencies predict the tests of each frequency better with it. These fits are single
Gauss-Newton steps from the fit to all tests, which predicted synthetic and measured rigs as well as minimisations did
(DECISIONS.md, "A common lag of the force channel is judged by frequencies that are predicted"). A record alone shows a
late force by its corners at reversals, see `force_delay`; both are told by `late_force`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.numbers import significant
from mrwork.base.values import Floats
from mrwork.dampers.conversions import Conversion
from mrwork.dampers.coordinates import Box
from mrwork.identification.covariance import Covariance, Slopes, remark_of
from mrwork.identification.equivalent import Form
from mrwork.identification.fit import FittedParameter
from mrwork.identification.minimise.levenberg_marquardt import TOLERANCE, find_minima
from mrwork.identification.minimise.polish import FinalFit
from mrwork.identification.objective import Objective, observe_tests_by
from mrwork.identification.problem import Problem
from mrwork.identification.residual import LateForce
from mrwork.records.cycles import late_force
from mrwork.records.finding import Measured
from mrwork.records.motion import spectrum
from mrwork.records.repairs import NONE

# The tests are fitted again where the squared misfit would fall by more than this share. The lag is advised where the
# misfit of predictions falls below this share of that without it, and it exceeds this number of its standard errors.
_WORTH_A_FIT = 0.04
_PAYS = 0.95
_SIGNIFICANT = 4.0
# Longest lag or delay [s]; iterations of a fit with it, and their end where it is tried.
_LONGEST = 0.5
_ITERATIONS = 50
_TOLERANCE = 1e-4
# Share by which the misfits of a delay and of a lag may differ where the sentence names both.
_ALIKE = 0.02
# Tests whose frequencies, of the largest Fourier component, differ by less than this factor are at one frequency.
_SAME_FREQUENCY = 1.3
# Delay that may be unknown, in samples and at most in periods; it is told where it changes damping by more than this
# share, and by more than this number of standard errors.
_SAMPLES = 3.0
_PERIODS = 0.02
_LARGE = 0.1
_FAR = 5.0
# Field of the observation model.
_FIELD: Final[dict[LateForce, str]] = {"lag": "lag_seconds", "delay": "delay_seconds"}


def fit_late_force(fit: FinalFit, kind: LateForce) -> FinalFit:
    """Fit one lag or delay of the force channel with all other parameters, from a fit without it.

    The tests of its problem have it, and its covariance is that of all.
    """
    problem = fit.problem
    late = _fit_late(problem.objective, problem.form, kind, fit.theta, tolerance=TOLERANCE)
    *theta, seconds = late.theta.tolist()
    objective = observe_tests_by(
        problem.objective,
        [replace(test.observation, **{_FIELD[kind]: seconds}) for test in problem.objective.tests],
    )
    words = [word for word in problem.settings.observe if word.partition("=")[0] not in (NONE, kind)]
    settings = replace(problem.settings, observe=(*words, f"{kind}={seconds!r}"))
    problem = replace(problem, settings=settings, objective=replace(objective, settings=settings))
    covariance, box = Covariance.of(late), late.form.box
    own = replace(
        covariance,
        slopes=Slopes.at(objective, problem.form, np.array(theta)),
        matrix=covariance.matrix[:-1, :-1],
    )
    error = float(covariance.standard_errors[-1])
    estimate = FittedParameter(
        name=box.names[-1],
        value=seconds,
        unit="s",
        standard_error=error if error > 0.0 else None,
        lower=box.lower[-1],
        upper=box.upper[-1],
        remark=remark_of(box, len(theta), seconds),
    )
    return replace(fit, problem=problem, covariance=own, late_force=estimate)


def force_lag_warnings(problem: Problem, excerpts: Objective, covariance: Covariance) -> tuple[str, ...]:
    """Warning of a lag of the force channel that pays, or of damping that an unknown delay would change by far.

    The `excerpts` are fitted again where that is worth it. Nothing is examined where the lag is given or estimated, or
    a command varies: the coil is late too.
    """
    slopes = covariance.slopes
    tests, form, theta = slopes.objective.tests, slopes.form, slopes.theta
    has_lag = any(test.observation.delay_seconds or test.observation.lag_seconds for test in tests)
    if has_lag or "delay" in problem.settings.nuisances or any(test.has_varying_command for test in tests):
        return ()
    if not slopes.interior:
        return ()
    on_time = _with_late(slopes.objective, form, "delay", np.array([*theta, 0.0]))
    frequency = [spectrum(test.displacement, test.dt).dominant for test in tests]
    groups: list[list[int]] = []
    for index in np.argsort(frequency, kind="stable").tolist():
        if not groups or frequency[index] > _SAME_FREQUENCY * frequency[groups[-1][-1]]:
            groups.append([])
        groups[-1].append(index)
    unknown = min(_SAMPLES * min(test.dt for test in tests), _PERIODS / max(frequency))
    if len(groups) > 1:
        normal = on_time.normal
        step = normal.steps(np.ones((1, len(tests))), _held(on_time))
        if normal.after(step[:, None]).sum() < (1.0 - _WORTH_A_FIT) * normal.squared.sum():
            lag, delay = (_fit_late(excerpts, form, kind, theta) for kind in _FIELD)
            best, other = (lag, delay) if _misfit(lag) <= _misfit(delay) else (delay, lag)
            seconds, late = _predict_groups(best, groups)
            _, earlier = _predict_groups(Slopes.at(excerpts, form, theta), groups)
            error = _error(best, seconds)
            if late < _PAYS * earlier and abs(best.theta[-1]) > _SIGNIFICANT * error:
                return (_advice(problem, theta, best, other, error, (earlier, late)),)
        seconds, _ = _predict_groups(on_time, groups)
        unknown = min(unknown, _error(on_time, seconds))
    return _unknown_delay(problem, on_time, covariance.standard_errors, unknown)


def _with_late(objective: Objective, form: Form, kind: LateForce, theta: Floats) -> Slopes:
    """Slopes of a fit with a late force, whose lag or delay is the last parameter of `theta`, (n_params + 1,)."""
    box = Box(
        names=(*form.box.names, f"force_{kind}"),
        lower=(*form.box.lower, 0.0 if kind == "lag" else -_LONGEST),
        upper=(*form.box.upper, _LONGEST),
        log=(*form.box.log, False),
    )
    form = replace(form, box=box, to_model=_beside(form.to_model), from_model=_beside(form.from_model))
    late = replace(objective, compared=tuple(replace(test, late=kind) for test in objective.compared))
    return Slopes.at(late, form, theta)


def _beside(conversion: Conversion) -> Conversion:
    """The conversion of all parameters but the last, which stays."""
    return Conversion(lambda theta: np.concatenate([conversion(theta[..., :-1]), theta[..., -1:]], axis=-1))


def _fit_late(
    objective: Objective, form: Form, kind: LateForce, theta: Floats, *, tolerance: float = _TOLERANCE
) -> Slopes:
    """Fit with a late force, from parameters `theta`, (n_params,), and what the observation model of a test has."""
    test = objective.tests[0]
    # At zero, its bound, a lag has no slope.
    seconds = getattr(test.observation, _FIELD[kind]) or (test.dt if kind == "lag" else 0.0)
    start = _with_late(objective, form, kind, np.array([*theta, seconds]))
    minimum = find_minima(
        start.objective, start.form.box, start.theta[None], max_iterations=_ITERATIONS, tolerance=tolerance
    )
    return Slopes.at(start.objective, start.form, minimum.theta[0])


def _misfit(slopes: Slopes) -> float:
    """Root mean square of the NRMSE."""
    return float(np.linalg.norm(slopes.residuals))


def _predict_groups(slopes: Slopes, groups: Sequence[Sequence[int]]) -> tuple[Floats, float]:
    """Steps of the last parameter without each group of tests, (n_groups,), and misfit of the groups after them."""
    left_out, normal = (
        np.array([np.isin(np.arange(len(slopes.objective.tests)), group) for group in groups]),
        slopes.normal,
    )
    steps = normal.steps(1.0 - left_out, _held(slopes))
    return steps[:, -1], float(np.sqrt(normal.after(steps[:, None])[left_out].sum()))


def _held(slopes: Slopes) -> NDArray[np.bool_]:
    """Free parameters that are on a bound, one row."""
    return ~np.isin(slopes.form.box.free, slopes.interior)[None]


def _error(late: Slopes, seconds: Floats) -> float:
    """Standard error of the lag [s], by the jackknife, (n_groups,), or by least squares if that is larger."""
    jackknife = (1.0 - 1.0 / seconds.size) * float(np.sum((seconds - seconds.mean()) ** 2))
    error = float(Covariance.of(late).standard_errors[-1])
    return max(float(np.sqrt(jackknife)), error) if error > 0.0 else np.inf


def _advice(
    problem: Problem,
    theta: Floats,
    best: Slopes,
    other: Slopes,
    error: float,
    held_out: tuple[float, float],
) -> str:
    """The sentence on a lag with its error [s]; `held_out` are misfits of predictions without and with it."""
    seconds, (kind, alternative) = (
        float(best.theta[-1]),
        (late.objective.compared[0].late for late in (best, other)),
    )
    before, after = (np.asarray(problem.form.to_model(point)) for point in (theta, best.theta[:-1]))
    changed = ""
    if moved := _damping(problem):
        worst = max(moved, key=lambda index: abs(after[index] - before[index]))
        values = f"{significant(after[worst], 3)} instead of {significant(before[worst], 3)} N s/m"
        changed = f", and {problem.spec.names[worst]} would be {values}"
    also = ""
    if _misfit(other) < (1.0 + _ALIKE) * _misfit(best):
        also = f" (or a {alternative} of {1e3 * other.theta[-1]:.2g} ms, which describes them about as well)"
    channel, remedy = "force", "try a model whose force relaxes"
    if seconds < 0.0:
        channel, remedy = (
            "motion",
            "subtract a moving mass by --repair mass, or try a model with more friction",
        )
    return late_force(
        Measured(seconds, "s", standard_error=error),
        min(test.dt for test in problem.objective.tests),
        behind="model",
        evidence=f"a {kind} that all tests have in common{also}: fits to the other frequencies predict the tests "
        f"of each to {100.0 * (1.0 - held_out[1]):.2f} % instead of {100.0 * (1.0 - held_out[0]):.2f} %{changed}",
        cure=f"fit it by --late-force {kind} if the channel of the {channel} is late, else {remedy}",
    ).message


def _damping(problem: Problem) -> list[int]:
    """Indices of the viscous damping in the requested model."""
    return [index for index, parameter in enumerate(problem.spec.parameters) if parameter.unit == "N s/m"]


def _unknown_delay(problem: Problem, on_time: Slopes, errors: Floats, seconds: float) -> tuple[str, ...]:
    """Warning of damping that a delay of so many seconds would change by far more than its standard error."""
    normal, held = on_time.normal, _held(on_time)
    held[:, -1] = True
    # The step with which the other parameters follow the delay.
    follow = replace(normal, gradient=normal.matrix[..., -1]).steps(
        np.ones((1, len(on_time.objective.tests))), held
    )
    theta, form = on_time.theta[:-1], problem.form
    change = np.zeros(theta.size)
    change[list(form.box.free)] = seconds * follow[0, :-1]
    value = np.asarray(form.to_model(theta))
    shift = form.to_model.jacobian(theta) @ change
    far = [
        index
        for index in _damping(problem)
        if abs(shift[index]) > max(_FAR * errors[index], _LARGE * abs(value[index]))
        and errors[index] > 0.0 < abs(value[index])
    ]
    if not far:
        return ()
    worst = max(far, key=lambda index: abs(shift[index]) / errors[index])
    name, share = problem.spec.names[worst], abs(shift[worst] / value[worst])
    return (
        f"a delay of the force of {1e3 * seconds:.2g} ms that is not known would move {name} by about "
        f"{100.0 * share:.0f} %, {abs(shift[worst]) / errors[worst]:.0f} times its standard error, and these tests do "
        "not tell it; measure it and give it by --observe delay=SECONDS, or test at several frequencies",
    )
