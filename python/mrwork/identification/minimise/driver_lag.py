"""The driver's lag of a fit: one that the tests do not want is left out, and one that is missing is told."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np

from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import with_changed_laws
from mrwork.identification.equivalent import bounds_of, identifiable_form
from mrwork.identification.minimise.levenberg_marquardt import OnStep, find_minima
from mrwork.identification.minimise.polish import FinalFit, StartingPoints, polish
from mrwork.identification.minimise.race import minima_from
from mrwork.identification.objective import Objective
from mrwork.identification.problem import Problem

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


def missing_lag(objective: Objective, theta: Floats, box: Box) -> Iterator[Remark]:
    """Warn of a lag with which the fit `theta` without one describes the tests better.

    Other parameters may have taken its part. They are fitted anew, in their `box`, where none is better without that.
    """
    spec, varies = objective.spec, any(test.has_varying_command for test in objective.tests)
    if not spec.follows_command or spec.lagged or not varies:
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
    lagged = objective.on(with_changed_laws(objective.spec, lagged=True), objective.tests)
    tried = lagged(np.array([[*theta, rate] for rate in _TRIED_RATES]))
    best = int(np.argmin(tried))
    return lagged, _TRIED_RATES[best], float(tried[best])


T = TypeVar("T")
# The fit with the lag is better than by chance where n_effective ln(squared misfit without it / with it), chi-squared
# of one degree of freedom if there is no lag, exceeds this: its quantile of 99 %.
_CHANCE = 6.63
# From here on the parts of the tests that starts are compared on are sufficient to tell.
_CLEAR = 10.0 * _CHANCE
# A coil that comes this close to its command within a sample follows it at once, as far as the samples show.
_WITHIN_A_SAMPLE = 0.01
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


def polish_with_wanted_lag(problem: Problem, points: StartingPoints, *, on_step: OnStep) -> FinalFit:
    """Fit to convergence from the starting points, without the driver's lag where that is as good.

    A lag whose rate is to be estimated must describe tests of varying commands better, by more than chance. Else, also
    where the fit with it ended in a false minimum, the fit without it is returned with a remark on both misfits.
    """
    lagged = polish(problem, points.theta, on_step=on_step)
    if not problem.shows_rate:
        return lagged
    plain = _without_lag(problem)
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


def _without_lag(problem: Problem) -> Problem:
    spec = with_changed_laws(problem.spec, lagged=False)
    rate = problem.spec.names[-1]

    def drop_rate(values: Mapping[str, T]) -> dict[str, T]:
        return {name: value for name, value in values.items() if name != rate}

    settings = replace(
        problem.settings,
        bounds=drop_rate(problem.settings.bounds),
        starts=tuple(drop_rate(start) for start in problem.settings.starts),
    )
    form = identifiable_form(spec, drop_rate(bounds_of(problem.form.box, problem.form.box.names)))
    return replace(
        problem,
        spec=spec,
        settings=settings,
        form=form,
        objective=problem.objective.on(form.spec, problem.objective.tests),
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
