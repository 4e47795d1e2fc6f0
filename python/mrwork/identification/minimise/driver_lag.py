"""The driver's lag of a fit: none, one rate or two, as the tests show; a lag that is missing is told."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import TypeVar

import numpy as np

from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box
from mrwork.dampers.parameters import DRIVER_RATES, RATE_NAMES, Lag
from mrwork.dampers.spec import DamperSpec, with_other_dependences
from mrwork.identification.commands import CommandedTests
from mrwork.identification.equivalent import bounds_of, identifiable_form
from mrwork.identification.minimise.levenberg_marquardt import OnStep, find_minima
from mrwork.identification.minimise.polish import FinalFit, StartingPoints, polish
from mrwork.identification.minimise.race import minima_from
from mrwork.identification.objective import Objective
from mrwork.identification.problem import Problem
from mrwork.identification.settings import FitSettings
from mrwork.records import DamperTest

# Rates of the lag [1/s] that are tried where it was left out: from a slow coil and driver to a fast one.
_TRIED_RATES = (10.0, 20.0, 40.0, 80.0, 160.0, 320.0)
# A lag is missing if one of these rates brings the misfit below this share of that without it, with no other change;
# or if a fit from the best of them does, in these iterations at most.
_SHARE = 0.98
_SHARE_FITTED = 0.95
_ITERATIONS = 20
_TOLERANCE = 1e-3
_MISSING = RemarkKind(
    "lag_missing",
    "a driver's lag of about {value:.3g} 1/s would lower the misfit from {before:.2f} to {after:.2f} % with {0}: the "
    "command that was recorded reaches the coil later",
    "fit the lag with --driver-lag, in Python lagged=True",
)


LAG_UNFITTED = RemarkKind(
    "lag_unfitted",
    "the command of {0} varies, and the fit has no lag of the driver: with one of about {value:.3g} 1/s, and no other "
    "change, its misfit would be {after:.2f} % for {before:.2f} %",
    "fit a record whose command varies, with --driver-lag (in Python lagged=True); mrwork characterise fits the lag "
    "where the use of such a record is fit",
)


def unfitted_lag(
    spec: DamperSpec, theta: Floats, tests: Sequence[DamperTest], settings: FitSettings
) -> Iterator[Remark]:
    """Warn of predicted tests that a lag would describe better, by the worst of them, where the fit has none."""
    if not spec.follows_command or spec.n_rates:
        return
    found = []
    for test in tests:
        if test.has_varying_command:
            objective = Objective.of(spec, (test,), settings)
            before, (_, rate, after) = float(objective(theta[None])[0]), _best_rate(objective, theta)
            if after < _SHARE * before:
                found.append((before, after, rate, test.label))
    if found:
        before, after, rate, label = max(found)
        yield LAG_UNFITTED.remark(
            label, measured=Measured(rate, "1/s"), before=100.0 * before, after=100.0 * after
        )


def missing_lag(objective: Objective, theta: Floats, box: Box) -> Iterator[Remark]:
    """Warn of a lag with which the fit `theta` without one describes the tests better.

    Other parameters may have taken its part. They are fitted anew, in their `box`, where none is better without that.
    """
    spec, varies = objective.spec, any(test.has_varying_command for test in objective.tests)
    if not spec.follows_command or spec.n_rates or not varies:
        return
    before, others = float(objective(theta[None])[0]), "no other change"
    lagged, rate, misfit = _best_rate(objective, theta)
    if not misfit < _SHARE * before:
        if not np.isfinite(misfit):
            return
        within = Box.of(lagged.spec).with_bounds(bounds_of(box, box.names))
        start = np.array([[*theta, rate]])
        fitted = find_minima(lagged, within, start, max_iterations=_ITERATIONS, tolerance=_TOLERANCE).best
        rate, misfit, others = float(fitted.theta[-1]), fitted.misfit, "the other parameters fitted anew"
        if not misfit < _SHARE_FITTED * before:
            return
    yield _MISSING.remark(others, measured=Measured(rate, "1/s"), before=100.0 * before, after=100.0 * misfit)


def _best_rate(objective: Objective, theta: Floats) -> tuple[Objective, float, float]:
    """The objective with a lag, and the tried rate with which a fit `theta` without one has the least misfit."""
    lagged = objective.on(with_other_dependences(objective.spec, lag="one_rate"), objective.tests)
    tried = lagged(np.array([[*theta, rate] for rate in _TRIED_RATES]))
    best = int(np.argmin(tried))
    return lagged, _TRIED_RATES[best], float(tried[best])


T = TypeVar("T")
# A fit with one more rate is better than by chance where n_effective ln(squared misfit without it / with it),
# chi-squared of one degree of freedom if there is no such rate, exceeds this: its quantile of 99 %.
_CHANCE = 6.63
# From here on the parts of the tests that starts are compared on are sufficient to tell.
_CLEAR = 10.0 * _CHANCE
# A coil that comes this close to its command within a sample follows it at once, as far as the samples show.
_WITHIN_A_SAMPLE = 0.01
# Pairs of tried rates that a fit with two rates starts from, the best ones beside equal rates.
_PAIRS = 2
_LEFT_OUT = RemarkKind(
    "lag_left_out",
    "the driver's lag is left out: with it (eta {value:.4g} 1/s) the misfit is {lagged:.4g} %, without it "
    "{without:.4g} %, so these tests show no lag of the coil behind their command",
    "fix the rate with --fix eta=VALUE where it is known",
)
_WITHIN = RemarkKind(
    "lag_within_a_sample",
    "the driver's lag (eta {value:.4g} 1/s) ends within a sample of {ms:.4g} ms: with it a command acts from the next "
    "sample on (misfit {lagged:.4g} %), without it from its own ({without:.4g} %)",
    "test with a shorter step, which tells the rate",
)
_TWO_LEVELS = RemarkKind(
    "two_rates_at_two_levels",
    "the current rises with {rise:.3g} 1/s and falls with {fall:.3g} 1/s (misfit {two:.4g} %, {one:.4g} % with one "
    "rate of {value:.3g} 1/s), or parameters that saturate follow a current of one rate: the command has two levels, "
    "{low:.3g} and {high:.3g} {0}, which do not tell these apart",
    "add a test with a third command between them, about {middle:.3g} {0}",
)


def polish_with_wanted_lag(problem: Problem, points: StartingPoints, *, on_step: OnStep) -> FinalFit:
    """Fit to convergence from the starting points, with the lag of the driver that the tests show.

    Rates that are to be estimated must describe tests of varying commands better, by more than chance: one rate than
    none, and two than one. Where no rate does, also where the fit with it ended in a false minimum, the fit without the
    lag is returned with a remark on both misfits. Bounds of one rate keep a second one away.
    """
    spec = problem.spec
    free = {problem.form.box.names[column] for column in problem.form.box.free}
    if not problem.shows_rate or not free.issuperset(rate.name for rate in DRIVER_RATES[spec.lag]):
        return polish(problem, points.theta, on_step=on_step)
    one_problem = problem if spec.lag == "one_rate" else _with_lag(problem, "one_rate")
    one_points = points if spec.lag == "one_rate" else _points_of(points, one_problem)
    one = _polish_with_one_rate(one_problem, one_points, on_step=on_step)
    if not one.problem.spec.n_rates or _is_within_a_sample(one):
        return one
    if DRIVER_RATES["one_rate"][0].name in problem.settings.bounds:
        return one
    two_problem = problem if spec.lag == "two_rates" else _with_lag(problem, "two_rates")
    starts = _starts_of_two(_points_of(points, two_problem), one)
    two = polish(two_problem, starts, on_step=on_step)
    if not _gain(two, two.misfit, one.misfit) > _CHANCE:
        return one
    return replace(two, remarks=tuple(_told_at_two_levels(two, one)))


def _polish_with_one_rate(problem: Problem, points: StartingPoints, *, on_step: OnStep) -> FinalFit:
    """The fit with one rate, or that without a lag where it is as good."""
    lagged = polish(problem, points.theta, on_step=on_step)
    plain = _with_lag(problem, "none")
    if not plain.form.box.free:
        return lagged
    objective = points.objective.on(plain.form.spec, points.objective.tests)
    candidates = np.array([lagged.theta, *points.theta])[:, :-1]
    starts = minima_from(objective, plain.form.box, candidates)
    if _is_clear(lagged, points.objective, objective, starts[0]):
        return lagged
    without = polish(plain, starts, on_step=on_step)
    _, rate, misfit = _best_rate(plain.objective, without.theta)
    if misfit < lagged.misfit:
        # The search with the lag has ended in a false minimum.
        lagged = polish(problem, problem.inside([*without.theta, rate])[None], on_step=on_step)
    return _choose_fit(lagged, without)


def _with_lag(problem: Problem, lag: Lag) -> Problem:
    """The problem with another lag, without what the user has said of the rates of its own."""
    spec = with_other_dependences(problem.spec, lag=lag)

    def drop_rates(values: Mapping[str, T]) -> dict[str, T]:
        return {name: value for name, value in values.items() if name not in RATE_NAMES}

    settings = replace(
        problem.settings,
        bounds=drop_rates(problem.settings.bounds),
        starts=tuple(drop_rates(start) for start in problem.settings.starts),
    )
    form = identifiable_form(spec, drop_rates(bounds_of(problem.form.box, problem.form.box.names)))
    return replace(
        problem,
        spec=spec,
        settings=settings,
        form=form,
        objective=problem.objective.on(form.spec, problem.objective.tests),
    )


def _points_of(points: StartingPoints, problem: Problem) -> StartingPoints:
    """The starting points of a problem that has another lag: one rate is the geometric mean of two, two are equal."""
    earlier, lag = points.form.spec.n_rates, problem.form.spec.n_rates
    others, rates = np.split(points.theta, [points.theta.shape[1] - earlier], axis=1)
    mean = np.exp(np.log(rates).mean(axis=1, keepdims=True))
    theta = np.concatenate([others, rates if earlier == lag else np.repeat(mean, lag, axis=1)], axis=1)
    objective = points.objective.on(problem.form.spec, points.objective.tests)
    return replace(points, objective=objective, form=problem.form, theta=theta)


def _starts_of_two(points: StartingPoints, one: FinalFit) -> Floats:
    """Starts of a fit with two rates: minima of the compared parts, from the fit with `one` and from their points."""
    others = one.theta[:-1]
    pairs = np.array([[*others, *pair] for pair in product(_TRIED_RATES, repeat=2) if len({*pair}) == 2])
    best = pairs[np.argsort(points.objective(pairs))[:_PAIRS]]
    equal = [*others, one.theta[-1], one.theta[-1]]
    return minima_from(points.objective, points.form.box, np.array([equal, *best, *points.theta]))


def _told_at_two_levels(two: FinalFit, one: FinalFit) -> Iterator[Remark]:
    """What a command of two levels does not tell: two rates, or one rate and parameters that saturate."""
    spec = two.problem.spec
    levels = CommandedTests.of(spec, two.problem.objective.tests).commands
    if len(levels) > 2:
        return
    low, high = float(levels.min()), float(levels.max())
    rise, fall = two.theta[-2:].tolist()
    yield _TWO_LEVELS.remark(
        spec.command_unit or "",
        measured=Measured(float(one.theta[-1]), "1/s"),
        rise=rise,
        fall=fall,
        two=100.0 * two.misfit,
        one=100.0 * one.misfit,
        low=low,
        high=high,
        middle=0.5 * (low + high),
    )


def _is_clear(lagged: FinalFit, objective: Objective, plain: Objective, without: Floats) -> bool:
    """Whether the parts of the tests that starts are compared on leave no doubt that the lag is wanted.

    `plain` compares the fit `without` it, (n_params,), there.
    """
    with_it = float(objective(lagged.theta[None])[0])
    without_it = float(plain(without[None])[0])
    return (
        _gain(lagged, with_it, without_it) > _CLEAR
        and _best_rate(plain, without)[2] >= with_it
        and not _is_within_a_sample(lagged)
    )


def _gain(lagged: FinalFit, with_it: float, without_it: float) -> float:
    """n_effective ln(squared misfit without the lag / with it)."""
    tiny = np.finfo(np.float64).tiny
    return float(2.0 * lagged.covariance.n_effective * np.log(max(without_it, tiny) / max(with_it, tiny)))


def _shortest_step(lagged: FinalFit) -> float:
    return min(test.dt for test in lagged.problem.objective.tests if test.has_varying_command)


def _is_within_a_sample(lagged: FinalFit) -> bool:
    return bool(np.exp(-lagged.theta[-1] * _shortest_step(lagged)) <= _WITHIN_A_SAMPLE)


def _choose_fit(lagged: FinalFit, without: FinalFit) -> FinalFit:
    """The fit with the lag where it is better by more than chance, else that without it."""
    with_it, without_it, rate = lagged.misfit, without.misfit, Measured(float(lagged.theta[-1]), "1/s")
    misfits = {"lagged": 100.0 * with_it, "without": 100.0 * without_it}
    if not _gain(lagged, with_it, without_it) > _CHANCE:
        return replace(without, remarks=(_LEFT_OUT.remark(measured=rate, **misfits),))
    if not _is_within_a_sample(lagged):
        return lagged
    ms = 1e3 * _shortest_step(lagged)
    return replace(lagged, remarks=(_WITHIN.remark(measured=rate, ms=ms, **misfits),))
