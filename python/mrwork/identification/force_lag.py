"""A lag or delay of the force channel that all tests of a fit have in common: how long it is, and whether it pays.

To first order, a late force is F(t - tau) = F - tau F'. At one frequency that is a change of stiffness and damping,
which a fit absorbs in its parameters; at several frequencies the changes differ, so that they determine tau. It pays
where fits to the other frequencies predict the tests of each frequency better with it. These fits are single
Gauss-Newton steps from the fit to all tests, which predicted synthetic and measured rigs as well as minimisations did
(DECISIONS.md, "A common lag of the force channel is judged by frequencies that are predicted").
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from mrwork.base.hints import SMALLEST
from mrwork.base.numbers import estimate_in_words, significant
from mrwork.base.values import Floats, array_dataclass
from mrwork.identification.covariance import Slopes, covariance, effective_samples, residuals_by_test
from mrwork.identification.minimise.levenberg_marquardt import find_minima
from mrwork.identification.objective import Objective, observe_tests_by
from mrwork.identification.problem import Problem
from mrwork.identification.residual import scale_columns, without_nuisance
from mrwork.records.motion import spectrum
from mrwork.records.repairs import DETECT, NONE

Kind = Literal["lag", "delay"]
# The tests are fitted again where the squared misfit would fall by more than this share. The lag is advised where the
# misfit of predictions falls below this share of that without it, and it exceeds this number of its standard errors.
_WORTH_A_FIT = 0.04
_PAYS = 0.95
_SIGNIFICANT = 4.0
# Most alternations between the lag and the other parameters, the step of the lag, in samples, at which they end, and
# iterations of the other parameters in each.
_ROUNDS = 12
_CONVERGED = 0.03
_ITERATIONS = 8
_TOLERANCE = 1e-4
# Share by which the misfits of a delay and of a lag may differ where the sentence names both.
_ALIKE = 0.02
# Least eigenvalue of the normal equations, per largest, that counts.
_INSENSITIVE = 1e-12
# Step of the difference quotient, in samples.
_STEP = 0.1
# Tests whose frequencies, of the largest Fourier component, differ by less than this factor are at one frequency.
_SAME_FREQUENCY = 1.3
# Delay that may be unknown, in samples and at most in periods; it is told where it changes damping by more than this
# share, and by more than this number of standard errors.
_SAMPLES = 3.0
_PERIODS = 0.02
_LARGE = 0.1
_FAR = 5.0


def force_lag_warnings(
    problem: Problem, excerpts: Objective, slopes: Slopes, errors: Floats
) -> tuple[str, ...]:
    """Warning of a lag of the force channel that pays, or of damping that an unknown delay would change by far.

    The `excerpts` are fitted again where that is worth it; `errors` are standard errors of the requested model,
    (n_params,). Nothing is examined where the lag is given or estimated, or a command varies: the coil is late too.
    """
    tests = slopes.objective.tests
    has_lag = any(test.observation.delay_seconds or test.observation.lag_seconds for test in tests)
    if has_lag or "delay" in problem.settings.nuisances or any(test.has_varying_command for test in tests):
        return ()
    if not slopes.interior:
        return ()
    on_time = _LateFit.at(slopes, "delay", 0.0)
    frequency = [spectrum(test.displacement, test.dt).dominant for test in tests]
    groups: list[list[int]] = []
    for index in np.argsort(frequency, kind="stable").tolist():
        if not groups or frequency[index] > _SAME_FREQUENCY * frequency[groups[-1][-1]]:
            groups.append([])
        groups[-1].append(index)
    unknown = min(_SAMPLES * min(test.dt for test in tests), _PERIODS / max(frequency))
    if len(groups) > 1:
        if on_time.gain > _WORTH_A_FIT:
            before = Slopes.at(excerpts, slopes.form, slopes.theta)
            lag, delay = _fit_late(before, "lag"), _fit_late(before, "delay")
            best, other = (lag, delay) if lag.misfit <= delay.misfit else (delay, lag)
            seconds, late = _predict_groups(best.slopes, best.columns, groups)
            _, earlier = _predict_groups(before, before.by_interior(), groups)
            error = best.error(seconds)
            if late < _PAYS * earlier and abs(best.seconds) > _SIGNIFICANT * error:
                return (_advice(problem, slopes.theta, best, other, error, (earlier, late)),)
        seconds, _ = _predict_groups(slopes, on_time.columns, groups)
        unknown = min(unknown, on_time.error(seconds))
    return _unknown_delay(problem, on_time, errors, unknown)


@array_dataclass()
class _LateFit:
    """Fit with a lag or delay: slopes, and derivatives by parameters and seconds, (n_interior + 1, n_residuals)."""

    slopes: Slopes
    kind: Kind
    seconds: float
    columns: Floats

    @classmethod
    def at(cls, slopes: Slopes, kind: Kind, seconds: float) -> _LateFit:
        """Simulate the tests once more, with a little more of it."""
        objective = slopes.objective
        step = _STEP * min(test.dt for test in objective.tests)
        later = _make_late(objective, kind, seconds + step)
        parts = []
        for test, moved in zip(objective.compared, later.compared, strict=True):
            force, _ = moved.forces(slopes.theta[None], threads=objective.threads)
            # At the samples that are compared without the step, because a delay lowers their number.
            (part,) = without_nuisance(force[:, test.counted], test.measured, test.nuisances)
            parts.append(part * test.weight(len(later.compared)))
        derivative = (np.concatenate(parts) - slopes.residuals) / step
        return cls(
            slopes=slopes, kind=kind, seconds=seconds, columns=np.vstack([slopes.by_interior(), derivative])
        )

    @property
    def misfit(self) -> float:
        """Root mean square of the NRMSE."""
        return float(np.linalg.norm(self.slopes.residuals))

    @property
    def gain(self) -> float:
        """Share of the squared misfit that a Gauss-Newton step of the parameters and the seconds would save."""
        residuals = self.slopes.residuals
        left = residuals + _step(self.columns, residuals) @ self.columns
        return 1.0 - float(left @ left) / max(float(residuals @ residuals), SMALLEST)

    def error(self, seconds: Floats) -> float:
        """Standard error of the lag [s], by the jackknife, (n_groups,), or by least squares if that is larger."""
        jackknife = (1.0 - 1.0 / seconds.size) * float(np.sum((seconds - seconds.mean()) ** 2))
        residuals = self.slopes.residuals
        n_effective = effective_samples(residuals_by_test(residuals, self.slopes.objective.tests))
        variance = covariance(self.columns.T, self.misfit)[-1, -1] * residuals.size / n_effective
        return float(np.sqrt(max(jackknife, variance))) if np.isfinite(variance) else np.inf


def _make_late(objective: Objective, kind: Kind, seconds: float) -> Objective:
    name = f"{kind}_seconds"
    observations = [replace(test.observation, **{name: seconds}) for test in objective.tests]
    return observe_tests_by(objective, observations)


def _fit_late(on_time: Slopes, kind: Kind) -> _LateFit:
    """Fit with a lag or delay, by turns in the seconds and in the parameters."""
    objective, form = on_time.objective, on_time.form
    fit = _LateFit.at(on_time, kind, 0.0)
    step = min(test.dt for test in objective.tests)
    for _ in range(_ROUNDS):
        seconds = fit.seconds + float(_step(fit.columns, fit.slopes.residuals)[-1])
        seconds = max(seconds, 0.0) if kind == "lag" else seconds
        if abs(seconds - fit.seconds) < _CONVERGED * step:
            break
        late = _make_late(objective, kind, seconds)
        minimum = find_minima(
            late, form.box, fit.slopes.theta[None], max_iterations=_ITERATIONS, tolerance=_TOLERANCE
        )
        fit = _LateFit.at(Slopes.at(late, form, minimum.theta[0]), kind, seconds)
    return fit


def _predict_groups(slopes: Slopes, columns: Floats, groups: Sequence[Sequence[int]]) -> tuple[Floats, float]:
    """Steps of the last column without each group of tests, (n_groups,), and misfit of the groups after these steps."""
    unit, length = scale_columns(columns)
    matrix, gradient = unit @ unit.T, unit @ slopes.residuals
    of_tests = [residuals_by_test(array, slopes.objective.tests) for array in (unit, slopes.residuals)]
    steps, squares = [], 0.0
    for group in groups:
        part, residuals = (np.concatenate([of_test[test] for test in group], axis=-1) for of_test in of_tests)
        step = _solve(matrix - part @ part.T, gradient - part @ residuals)
        steps.append(step[-1])
        squares += float(np.sum((residuals + step @ part) ** 2))
    return np.array(steps) / length[-1], float(np.sqrt(squares))


def _step(columns: Floats, residuals: Floats) -> Floats:
    """Gauss-Newton step, (n_columns,)."""
    unit, length = scale_columns(columns)
    return np.asarray(_solve(unit @ unit.T, unit @ residuals) / length)


def _solve(matrix: Floats, gradient: Floats) -> Floats:
    return np.asarray(-np.linalg.pinv(matrix, rcond=_INSENSITIVE, hermitian=True) @ gradient)


def _advice(
    problem: Problem,
    theta: Floats,
    best: _LateFit,
    other: _LateFit,
    error: float,
    held_out: tuple[float, float],
) -> str:
    """The sentence on a lag with its error [s]; `held_out` are misfits of predictions without and with it."""
    averaged = any(test.observation.average_seconds for test in problem.objective.tests)
    words = [word for word in problem.settings.observe if word != NONE and (word != DETECT or averaged)]
    options = " ".join(f"--observe {word}" for word in (*words, f"{best.kind}={best.seconds:.3g}"))
    before, after = (np.asarray(problem.form.to_model(point)) for point in (theta, best.slopes.theta))
    changed = ""
    if moved := _damping(problem):
        worst = max(moved, key=lambda index: abs(after[index] - before[index]))
        values = f"{significant(after[worst], 3)} instead of {significant(before[worst], 3)} N s/m"
        changed = f", and {problem.spec.names[worst]} would be {values}"
    also = ""
    if other.misfit < (1.0 + _ALIKE) * best.misfit:
        also = f" (or a {other.kind} of {1e3 * other.seconds:.2g} ms, which describes them about as well)"
    sense, channel, remedy = ("late", "force", "try a model whose force relaxes")
    if best.seconds < 0.0:
        sense, channel = "early", "motion"
        remedy = "subtract a moving mass by --repair mass, or try a model with more friction"
    return (
        f"the force is {sense} against the model: with a {best.kind} of "
        f"{estimate_in_words(1e3 * best.seconds, 1e3 * error)} ms that all tests have in common{also}, fits "
        f"to the other frequencies predict the tests of each to {100.0 * (1.0 - held_out[1]):.2f} % instead of "
        f"{100.0 * (1.0 - held_out[0]):.2f} %{changed}; take it by {options} if the channel of the {channel} is "
        f"late, else {remedy}"
    )


def _damping(problem: Problem) -> list[int]:
    """Indices of the viscous damping in the requested model."""
    return [index for index, parameter in enumerate(problem.spec.parameters) if parameter.unit == "N s/m"]


def _unknown_delay(problem: Problem, on_time: _LateFit, errors: Floats, seconds: float) -> tuple[str, ...]:
    """Warning of damping that a delay of so many seconds would change by far more than its standard error."""
    slopes = on_time.slopes
    change = np.zeros(slopes.theta.size)
    change[slopes.interior] = seconds * _step(on_time.columns[:-1], on_time.columns[-1])
    value = np.asarray(slopes.form.to_model(slopes.theta))
    shift = slopes.form.to_model.jacobian(slopes.theta) @ change
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
