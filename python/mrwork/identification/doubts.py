"""What speaks against a fit that has converged.

A moving average that was found in a record is applied also where the fit would be better without it: without it the
parameters describe the smoothed loop and not the damper, and the fit to the same record says little about which is
right (DECISIONS.md, "A detected average is never dropped because a fit is better without it"). A parameter may follow
the command as a polynomial or over decades; through few values one of the curves describes the tests far better. Noise
of the motion makes errors of the parameters that residuals of the force do not show.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from math import erf, sqrt

import numpy as np

from mrwork.base.numbers import times
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.values import Floats, freeze_samples
from mrwork.dampers.coordinates import Box
from mrwork.dampers.dependence import POLYNOMIAL_FORMS
from mrwork.dampers.spec import with_other_dependences
from mrwork.identification.commands import excerpts_at
from mrwork.identification.covariance import Covariance, autocorrelation_time
from mrwork.identification.effects import unfitted_effects
from mrwork.identification.fit import FAR_BETTER
from mrwork.identification.fit_progress import on_every_test
from mrwork.identification.minimise.driver_lag import missing_lag
from mrwork.identification.minimise.levenberg_marquardt import find_minima
from mrwork.identification.minimise.polish import FinalFit
from mrwork.identification.objective import Objective, observe_tests_by, up_to
from mrwork.identification.suspicious import no_better_than_linear, unlike_temperatures
from mrwork.records import DamperTest
from mrwork.records.motion import Differentiator


def doubts_on_fit(ended: FinalFit, nrmse: float, *, is_suspected: bool) -> Iterator[Remark]:
    """Warn by the tests of a fit; some checks fit the model again, which takes a while.

    They do not depend on the search that led to the fit, but for the suspicion that the minimum is false.
    """
    problem, objective, form, theta = ended.problem, ended.problem.objective, ended.problem.form, ended.theta
    # Another fit to the whole tests would cost as much as the final one.
    excerpts = excerpts_at(problem, theta)
    follows = problem.spec.command_unit is not None
    yield from no_better_than_linear(nrmse, objective.tests, follows_command=follows)
    if follows:
        # The search of laws, which a plain model does not need, is slow to load.
        from mrwork.identification.minimise.level_search import better_alone

        yield from better_alone(problem, excerpts, theta, suspected=is_suspected)
    yield from unlike_temperatures(objective.tests)
    yield from missing_lag(objective, theta, form.box)
    yield from needless_averages(objective, form.box, theta)
    yield from other_law_shapes(excerpts, form.box, theta)
    yield from unfitted_effects(problem, ended.covariance)
    yield from motion_noise(ended.covariance, problem.spec.names)


# The fit without the average is better if its misfit is below this share of that with it, and the mean difference of
# the squared residuals is above this number of its standard errors.
_BETTER = 0.98
_SIGNIFICANT = 2.0
_MOST_ITERATIONS = 30
# Samples of a window below which the straight lines between them smooth the model's force too.
_FEW_SAMPLES = 6.0
_NEEDLESS = RemarkKind(
    "average_needless",
    "{0}: without the moving average over {ms:.4g} ms, which was found in the record, the fit would be {plain:.2f} % "
    "instead of {averaged:.2f} %, but its parameters would describe the smoothed loop and not the damper",
    "try another model, or --observe none if the record was not smoothed",
)
_SHORT_AVERAGE = RemarkKind(
    "average_of_few_samples",
    "{0}: without the moving average over {ms:.4g} ms the fit would be {plain:.2f} % instead of {averaged:.2f} %; the "
    "window has only {samples:.2g} samples at the step that is used, too few to average the model's force exactly",
    "use every sample of the record, or --observe none",
)


def needless_averages(objective: Objective, box: Box, theta: Floats) -> Iterator[Remark]:
    """Warn of each test whose fit improves significantly without its detected moving average.

    A single test is fitted again from the fit `theta`, shape (n_params,); several are compared there.
    """
    with_average = [
        index
        for index, test in enumerate(objective.tests)
        if (smoothing := test.smoothing) is not None
        and "force" in smoothing.channels
        and test.observation.average_seconds == smoothing.window_seconds
    ]
    if not with_average:
        return
    observations = [test.observation for test in objective.tests]
    for index in with_average:
        observations[index] = replace(observations[index], average_seconds=0.0)
    without = observe_tests_by(objective, observations)
    refitted = theta
    if len(objective.tests) == 1:
        refit = find_minima(without, box, theta[None], max_iterations=_MOST_ITERATIONS)
        if without.stiffest < np.inf and refit.misfit[0] < _BETTER * float(objective(theta[None])[0]):
            # Its loop may be one that the limit of stiffness cuts off.
            refit = find_minima(up_to(without, np.inf), box, refit.theta, max_iterations=_MOST_ITERATIONS)
        refitted = refit.theta[0]
    for index in with_average:
        test = objective.tests[index]
        (averaged,), _ = objective.compared[index].residuals(theta[None])
        (plain,), _ = without.compared[index].residuals(refitted[None])
        samples = np.arange(test.n_time)
        plain = plain[np.isin(samples[without.tests[index].counted], samples[test.counted])]
        if np.linalg.norm(plain) >= _BETTER * np.linalg.norm(averaged):
            continue
        gain = averaged**2 - plain**2
        n_effective = gain.size / autocorrelation_time(gain - gain.mean())
        if gain.mean() > _SIGNIFICANT * gain.std() / np.sqrt(n_effective):
            n_window = (window := test.observation.average_seconds) / test.dt
            kind = _SHORT_AVERAGE if n_window < _FEW_SAMPLES else _NEEDLESS
            fits = {"plain": _fit_percent(test, plain), "averaged": _fit_percent(test, averaged)}
            seconds = Measured(window, "s")
            yield kind.remark(test.label, measured=seconds, ms=1e3 * window, samples=n_window, **fits)


def _fit_percent(test: DamperTest, residual: Floats) -> float:
    return 100.0 * (1.0 - float(np.sqrt(np.mean(residual**2)) / np.std(test.force[test.counted])))


_OTHER_LAWS = RemarkKind(
    "other_laws_better",
    "other laws describe the tests better: {value:.2f} % against {percent:.2f} %",
    "give {0}",
)


def other_law_shapes(objective: Objective, box: Box, theta: Floats) -> Iterator[Remark]:
    """Warn where polynomials through logarithms in place of values, or the reverse, fit far better from `theta`."""
    spec = objective.spec
    through = {
        parameter.name: other_law
        for parameter, law in spec.law_pairs
        for other_law in law.other_forms(parameter)
        if law.form in POLYNOMIAL_FORMS and other_law.form in POLYNOMIAL_FORMS
    }
    if not through:
        return
    by_values = with_other_dependences(spec, through)
    # Their coefficients have the same names and ranges, because they are the values at the same commands.
    other = objective.on(by_values, objective.tests)
    minimum = find_minima(other, box, theta[None], max_iterations=_MOST_ITERATIONS)
    reference, misfits = float(objective(theta[None])[0]), float(other(minimum.theta)[0])
    if misfits < FAR_BETTER * reference:
        named = ", ".join(f"{name}={law}" for name, law in through.items())
        fit = Measured(100.0 * (1.0 - misfits), "%")
        yield _OTHER_LAWS.remark(named, measured=fit, percent=100.0 * (1.0 - reference))


# Number of motions with more noise that are simulated at most, and in a round.
_DRAWS = 24
_ROUND = 4
# Expected share of the 95 % intervals that hold the parameters, below which the noise of the motion dominates: 90 %,
# and one for the error of the draws.
_HELD = 0.91
_QUANTILE = 1.96
# Standard errors of the mean square of the draws so far by which it may be too small, when no more are drawn.
_SURELY = 2.0
# Share of a parameter below which its error is of arithmetic.
_ARITHMETIC = 1e-6
_MOTION_NOISE = RemarkKind(
    "motion_noise",
    "noise of the motion dominates: it moves {0} by about {times} the error that the residuals of the force "
    "give it, so that 95 % intervals hold about {coverage:.0f} % of the parameters",
    "{remedy}measure the motion with less noise",
)


def motion_noise(covariance: Covariance, names: Sequence[str]) -> Iterator[Remark]:
    """Warn where noise of the motion lowers the expected coverage of 95 % intervals to about 90 % or less.

    The model integrates the noise of the recorded motion: its force is wrong at reversals, by errors that the few
    samples there hardly show. That noise, estimated from the records, is added once more, and the change of the force
    is projected,

        change of theta = (J'J)^-1 J' (change of the force);

    its mean square over draws has the bias and the scatter. `names` are of the requested model.
    """
    slopes, standard_errors = covariance.slopes, covariance.standard_errors
    objective, form, theta, interior = slopes.objective, slopes.form, slopes.theta, slopes.interior
    # Errors of arithmetic, as of a record without noise, are no intervals.
    finite = np.isfinite(standard_errors) & (standard_errors > _ARITHMETIC * np.abs(form.to_model(theta)))
    if not finite.any() or not interior:
        return
    inverse = np.linalg.pinv(slopes.by_interior().T)
    noises = [_noise_of_motion(test) for test in objective.tests]

    def find_shift(first: int, index: int, threads: int) -> Floats | None:
        """Change of the parameters in a draw; `None` where the model cannot be simulated under it."""
        parts = []
        for number, noise in enumerate(noises):
            observed = objective.compared[number].of_test(noise([first + index, number]))
            (part,), (failed,) = observed.residuals(theta[None], threads=threads)
            if failed:
                return None
            parts.append(part * observed.normalisation)
        change = np.zeros(theta.size)
        change[interior] = inverse @ (np.concatenate(parts) - slopes.residuals)
        return form.to_model.jacobian(theta) @ change

    changes, shares = list[Floats](), np.zeros(1)
    for first in range(0, _DRAWS, _ROUND):
        draws = on_every_test(_ROUND, objective.threads, partial(find_shift, first))
        changes += [change for change in draws if change is not None]
        if not changes:
            continue
        shares = np.sqrt(np.mean(np.square(changes), axis=0))[finite] / standard_errors[finite]
        # A mean square of n draws has a relative standard error of sqrt(2/n), a root of it half of that.
        if _estimate_coverage(shares * (1.0 + _SURELY / sqrt(2.0 * len(changes)))) >= _HELD:
            return
    if not changes or (coverage := _estimate_coverage(shares)) >= _HELD:
        return
    worst = int(np.argmax(shares))
    measured = any(test.velocity_source == "measured" for test in slopes.objective.tests)
    yield _MOTION_NOISE.remark(
        str(np.array(names)[finite][worst]),
        measured=Measured(float(shares[worst]), ""),
        times=times(float(shares[worst])),
        coverage=100.0 * coverage,
        remedy="derive the velocity from the displacement by --repair velocity, or " if measured else "",
    )


def _estimate_coverage(shares: Floats) -> float:
    """Expected coverage of 95 % intervals if noise shifts the parameters by `shares` of their standard errors."""
    return float(np.mean([erf(_QUANTILE / sqrt(2.0 * (1.0 + share**2))) for share in shares]))


def _noise_of_motion(test: DamperTest) -> Callable[[list[int]], DamperTest]:
    """Function of a seed that adds noise to the motion of the test, as large as the noise that its smoother removes.

    The noise of a velocity that was derived follows from its derivation.
    """
    smoother = Differentiator.of(test.displacement, test.dt)
    is_measured = test.velocity_source == "measured"
    of_displacement = smoother.noise(test.displacement - smoother.smooth(test.displacement))
    of_velocity = smoother.noise(test.velocity - smoother.smooth(test.velocity)) if is_measured else 0.0

    def add_noise(seed: list[int]) -> DamperTest:
        rng = np.random.default_rng(seed)
        displacement = of_displacement * rng.standard_normal(test.n_time)
        velocity = smoother.derivative(displacement)
        if is_measured:
            velocity = of_velocity * rng.standard_normal(test.n_time)
        return replace(
            test,
            displacement=freeze_samples(test.displacement + displacement),
            velocity=freeze_samples(test.velocity + velocity),
        )

    return add_noise
