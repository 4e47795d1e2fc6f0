"""The driver's lag: whether the tests want the lag that a fit was asked for, and what one that was left out would gain.

A fit with the lag is compared with one without it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.spec import DamperSpec, damper
from mrwork.identification.equivalent import identifiable_form
from mrwork.identification.global_search import StartingPoints
from mrwork.identification.multistart import minima_from
from mrwork.identification.objective import Objective
from mrwork.identification.polish import OnStart, OnStep, Polished, polish
from mrwork.identification.problem import Problem, rate_is_shown
from mrwork.values import holds_arrays

# Rates of the lag [1/s] that are tried where it was left out: from a slow coil and driver to that of a fast one.
_TRIED_RATES = (10.0, 20.0, 40.0, 80.0, 160.0, 320.0)
# A lag is missing if one of these rates brings the misfit below this share of that without it, with no other change.
_SHARE = 0.98


def _with_lag(spec: DamperSpec, *, lagged: bool) -> DamperSpec:
    """The model with its current laws, with the driver's lag or without; `spec` has current laws."""
    assert spec.current is not None
    laws = dict(zip(damper(spec.name).names, spec.current.laws, strict=True))
    return damper(spec.name).with_current_laws(laws, unit=spec.current.unit, lagged=lagged)


@dataclass(frozen=True, slots=True, kw_only=True)
class MissingLag:
    """A rate of the driver's lag [1/s] with which the misfit of a fit without a lag is lower, all else as it is."""

    rate: float
    misfit_without: float
    misfit_with: float

    @property
    def in_words(self) -> str:
        """A sentence that says what to do."""
        return (
            f"a driver's lag of about {self.rate:g} 1/s would lower the misfit from {100.0 * self.misfit_without:.2f} "
            f"to {100.0 * self.misfit_with:.2f} % with no other change: the command that was recorded reaches the coil "
            "later; fit the lag with --driver-lag, in Python lagged=True"
        )


def missing_lag(spec: DamperSpec, objective: Objective, theta: NDArray[np.float64]) -> MissingLag | None:
    """The lag with which the fit `theta` without one describes the tests better; `None` where there is none."""
    current = spec.current
    if current is None or current.lagged or not any(test.has_varying_command for test in objective.tests):
        return None
    lagged = objective.on(_with_lag(spec, lagged=True), objective.tests)
    tried = lagged(np.array([[*theta, rate] for rate in _TRIED_RATES]))
    before = float(objective(theta[None])[0])
    best = int(np.argmin(tried))
    if not tried[best] < _SHARE * before:
        return None
    return MissingLag(rate=_TRIED_RATES[best], misfit_without=before, misfit_with=float(tried[best]))


T = TypeVar("T")

# The fit with the lag is better than by chance where n_effective ln(squared misfit without it / with it), chi-squared
# of one degree of freedom if there is no lag, exceeds this: its quantile of 99 %.
_CHANCE = 6.63
# A coil that comes this close to its command within a sample follows it at once, as far as the samples show.
_WITHIN_A_SAMPLE = 0.01


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """The minimum at which a fit ends, of the problem that it solves, and sentences on the driver's lag."""

    problem: Problem
    polished: Polished
    warnings: tuple[str, ...] = ()

    @property
    def objective_value(self) -> float:
        """What the search has minimised."""
        return float(self.problem.objective(self.polished.theta[None])[0])

    @property
    def misfit(self) -> float:
        """Root mean square of the NRMSE of all tests, whatever the power of the objective."""
        return float(self.problem.objective.plain(self.polished.theta[None])[0])


def polish_with_wanted_lag(
    problem: Problem, points: StartingPoints, *, on_start: OnStart, on_step: OnStep
) -> Ended:
    """Fit to convergence from the starting points, without the driver's lag where that is as good.

    A lag whose rate is to be estimated must describe tests of varying commands better than the same model without it,
    by more than chance. Else, also where the fit with the lag ended in a false minimum, the fit without it is returned
    with a sentence that names both misfits. Both are fitted from the same starting points.
    """
    lagged = Ended(problem=problem, polished=polish(problem, points, on_start=on_start, on_step=on_step))
    if not rate_is_shown(problem.form.spec, problem.form, problem.objective.tests):
        return lagged
    plain = _without_lag(problem)
    if not plain.form.box.free:
        return lagged
    objective = points.objective.on(plain.form.spec, points.objective.tests)
    given = np.array([lagged.polished.theta, *points.theta])[:, :-1]
    starts = replace(
        points,
        objective=objective,
        form=plain.form,
        theta=minima_from(objective, plain.form.box, given, mirrored=plain.form.mirrored),
        minima=True,
    )
    # A start of the model without the lag is none of the fit that may be interrupted.
    polished = polish(plain, starts, on_start=lambda _minimum, _share: None, on_step=on_step)
    without = Ended(problem=plain, polished=polished)
    missing = missing_lag(plain.form.spec, plain.objective, polished.theta)
    if missing is not None and missing.misfit_with < lagged.objective_value:
        # The search with the lag has ended in a false minimum.
        start = replace(points, theta=problem.inside([*polished.theta, missing.rate])[None], minima=True)
        again = polish(problem, start, on_start=on_start, on_step=on_step)
        lagged = Ended(problem=problem, polished=again)
    return _choose_fit(lagged, without)


def _without_lag(problem: Problem) -> Problem:
    """The same problem for the model without the lag, in the same box."""
    spec = _with_lag(problem.spec, lagged=False)
    rate = problem.spec.names[-1]

    def kept(values: Mapping[str, T]) -> dict[str, T]:
        return {name: value for name, value in values.items() if name != rate}

    settings = replace(
        problem.settings,
        bounds=kept(problem.settings.bounds),
        starts=tuple(kept(start) for start in problem.settings.starts),
    )
    box = problem.form.box
    ranges = zip(box.lower, box.upper, strict=True)
    form = identifiable_form(spec, kept(dict(zip(box.names, ranges, strict=True))))
    return replace(
        problem,
        spec=spec,
        settings=settings,
        form=form,
        objective=problem.objective.on(form.spec, problem.objective.tests),
    )


def _choose_fit(lagged: Ended, without: Ended) -> Ended:
    """The fit with the lag where it is better by more than chance, else that without it."""
    with_it, without_it, rate = lagged.misfit, without.misfit, float(lagged.polished.theta[-1])
    tiny = np.finfo(np.float64).tiny
    gain = 2.0 * lagged.polished.n_effective * np.log(max(without_it, tiny) / max(with_it, tiny))
    if not gain > _CHANCE:
        return replace(
            without,
            warnings=(
                f"the driver's lag is left out: with it (eta {rate:.4g} 1/s) the misfit is {100.0 * with_it:.4g} %, "
                f"without it {100.0 * without_it:.4g} %, so these tests show no lag of the coil behind their command; "
                "fix the rate with --fix eta=VALUE where it is known",
            ),
        )
    dt = min(test.dt for test in lagged.problem.objective.tests if test.has_varying_command)
    if np.exp(-rate * dt) > _WITHIN_A_SAMPLE:
        return lagged
    return replace(
        lagged,
        warnings=(
            f"the driver's lag (eta {rate:.4g} 1/s) ends within a sample of {1e3 * dt:.4g} ms: with it a command acts "
            f"from the next sample on (misfit {100.0 * with_it:.4g} %), without it from its own "
            f"({100.0 * without_it:.4g} %); tests of a shorter step tell the rate",
        ),
    )
