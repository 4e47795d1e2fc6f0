"""The fit at a minimum: free runs on the tests, estimates of the parameters, and its cost in a building."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.dampers.coordinates import ON_BOUND, Box
from mrwork.dampers.spec import DamperSpec, law_limits
from mrwork.errors import SimulationError
from mrwork.identification.equivalent import Form
from mrwork.identification.fit import (
    NEGLIGIBLE,
    ErrorNorms,
    Estimate,
    Fit,
    FitQuality,
    FitStatus,
    SearchTrace,
)
from mrwork.identification.nuisance import NONE, Nuisance, NuisanceName
from mrwork.identification.problem import Problem, provenance_of
from mrwork.identification.residual import ObservedTest
from mrwork.records import DamperTest, RecordedMotion
from mrwork.records.damper_test import loading_of
from mrwork.records.operating_range import range_of_tests
from mrwork.simulate import stiffness_shares
from mrwork.summary import listed
from mrwork.tested_range import OperatingRange


def free_run(
    spec: DamperSpec,
    theta: NDArray[np.float64],
    test: DamperTest,
    *,
    nuisances: tuple[NuisanceName, ...] = (),
    substep_factor: int = 1,
) -> tuple[NDArray[np.float64], FitQuality]:
    """Free-run simulation of a model on a test: the force as recorded [N], shape (n_time,), and its quality.

    Parameters
    ----------
    nuisances
        Parameters that are estimated from the test itself before the comparison.
    """
    observed = ObservedTest.of(spec, test, nuisances)
    force, nuisance, substeps = observed.predicted(theta, substep_factor=substep_factor)
    return force, fit_quality(test, force, substeps=substeps, nuisance=nuisance)


@contextmanager
def explained_by(fit: Fit, test: DamperTest) -> Iterator[None]:
    """Add to a simulation that fails in the block what of the test lies outside the tested ranges of the fit."""
    try:
        yield
    except SimulationError as error:
        reasons = "; ".join(fit.outside(test).sentences)
        raise SimulationError(
            f"{error}; outside the tested range: {reasons}" if reasons else str(error)
        ) from error


def fit_quality(
    test: DamperTest, force: NDArray[np.float64], *, substeps: int, nuisance: Nuisance = NONE
) -> FitQuality:
    """Compare a simulated force as recorded, that is after the observation model [N], shape (n_time,), with the test.

    `E_t = e_t/s_F` and likewise `E_x`, `E_v`, with `e_t^2 = int r^2 dt`, `e_x^2 = int r^2 |x'| dt`,
    `e_v^2 = int r^2 |v'| dt` and `s_F^2 = int (F - mean F)^2 dt` (Spencer et al. 1997, eqs. 13-16);
    `fit % = 100 (1 - |r|/|F - mean F|)`, `NRMSE = rms(r)/std(F)`.
    """
    counted = test.counted
    residual = (force - test.force)[counted]
    deviation = test.force[counted] - test.force[counted].mean()
    velocity = test.velocity[counted]
    acceleration = np.gradient(test.velocity, test.dt)[counted]
    s_F = np.trapezoid(deviation**2)
    norms = (np.trapezoid(residual**2 * weight) / s_F for weight in (1.0, abs(velocity), abs(acceleration)))
    e_t, e_x, e_v = (float(np.sqrt(norm)) for norm in norms)
    rmse = float(np.sqrt(np.mean(residual**2)))
    nrmse = rmse / float(np.std(test.force[counted]))
    return FitQuality(
        test=test.name,
        fit_percent=100.0 * (1.0 - nrmse),
        nrmse=nrmse,
        rmse_n=rmse,
        error_norms=ErrorNorms(time=e_t, displacement=e_x, velocity=e_v),
        residual_autocorrelation=_lag_one(residual),
        n_time=residual.size,
        settle_seconds=test.window.start * test.dt,
        substeps=substeps,
        observation=test.observation,
        nuisance=nuisance,
    )


def _lag_one(residual: NDArray[np.float64]) -> float:
    """Autocorrelation of the residual at a lag of one sample."""
    centred = residual - residual.mean()
    power = float(centred @ centred)
    return float(centred[1:] @ centred[:-1]) / power if power > 0.0 else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSpread:
    """Fits of several tests [%]: the median, and the worst with the name of its test."""

    n_tests: int
    median_percent: float
    worst_percent: float
    worst_test: str

    @classmethod
    def of(cls, names: Sequence[str], percents: Sequence[float]) -> FitSpread:
        """Median and worst of the fits of the tests with these names."""
        worst = int(np.argmin(percents))
        return cls(
            n_tests=len(percents),
            median_percent=float(np.median(percents)),
            worst_percent=float(percents[worst]),
            worst_test=names[worst],
        )

    @property
    def in_words(self) -> str:
        """One line."""
        return (
            f"{self.n_tests} tests: fit median {self.median_percent:.2f} %, worst {self.worst_percent:.2f} % "
            f"({self.worst_test})"
        )


Remark = Literal["", "fixed", "at lower bound", "at upper bound", "not identifiable"]


def _estimates_of(
    spec: DamperSpec,
    form: Form,
    theta: NDArray[np.float64],
    errors: NDArray[np.float64] | None,
    bounds: Mapping[str, tuple[float, float]],
) -> tuple[Estimate, ...]:
    """Estimates in the parameters of the requested model; without `errors` they have no standard errors."""
    requested = Box.of(spec).with_bounds(bounds)
    values = np.asarray(form.to_model(theta))
    result = []
    for index, (parameter, remark) in enumerate(zip(spec.parameters, remarks_of(form, theta), strict=True)):
        error = None if errors is None or remark else float(errors[index])
        undetermined = error is not None and not np.isfinite(error)
        result.append(
            Estimate(
                name=parameter.name,
                unit=parameter.unit,
                value=float(values[index]),
                standard_error=None if undetermined else error,
                lower=requested.lower[index],
                upper=requested.upper[index],
                remark="not identifiable" if undetermined else remark,
            )
        )
    return tuple(result)


def remarks_of(form: Form, theta: NDArray[np.float64]) -> tuple[Remark, ...]:
    """Remark on each parameter of the requested model that does not vary; empty for the others.

    Such a parameter depends on parameters of the form that are fixed or on a bound, and on no others.

    Parameters
    ----------
    theta
        Parameters of the form, shape (n_params,).
    """
    own = [remark_of(form.box, index, float(value)) for index, value in enumerate(theta)]
    found: list[Remark] = []
    for row in form.to_model.jacobian(theta):
        used = {own[index] for index in np.flatnonzero(row)}
        on_bound = sorted(used - {"", "fixed"})
        found.append("" if "" in used else on_bound[0] if on_bound else "fixed")
    return tuple(found)


def remark_of(box: Box, index: int, value: float) -> Remark:
    """Remark on a parameter that is fixed or on a bound of the box; empty for others."""
    if index not in box.free:
        return "fixed"
    lower, upper = box.lower[index], box.upper[index]
    if box.log[index]:
        lower, upper, value = np.log(lower), np.log(upper), np.log(value)
    unit = (value - lower) / (upper - lower)
    if unit < ON_BOUND:
        return "at lower bound"
    return "at upper bound" if unit > 1.0 - ON_BOUND else ""


def fit_at(
    problem: Problem,
    theta: NDArray[np.float64],
    *,
    errors: NDArray[np.float64] | None,
    n_effective: float | None = None,
    trace: SearchTrace,
    steps: int,
    status: FitStatus,
    seconds: float,
) -> Fit:
    """The fit at the parameters `theta` of the problem's form, shape (n_params,).

    Parameters
    ----------
    errors
        Standard errors, shape (n_params,), of the requested model, where they are known.
    n_effective
        Effective number of samples that they assume.
    steps
        Number of steps of the final fit.
    """
    spec, objective = problem.spec, problem.objective
    values = np.asarray(problem.form.to_model(theta))
    tested = range_of_tests(objective.tests, None if spec.current is None else spec.current.unit)
    runs = [free_run(spec, values, test, nuisances=objective.settings.nuisances) for test in objective.tests]
    quality = tuple(each for _, each in runs)
    nrmse = _rms([each.nrmse for each in quality])
    return Fit(
        model=spec.name,
        estimates=_estimates_of(spec, problem.form, theta, errors, problem.settings.bounds),
        status=status,
        stop_reason=trace.stop_reason,
        nrmse=nrmse,
        fit_percent=100.0 * (1.0 - nrmse),
        rmse_n=_rms([each.rmse_n for each in quality]),
        error_norms=ErrorNorms(
            time=_rms([each.error_norms.time for each in quality]),
            displacement=_rms([each.error_norms.displacement for each in quality]),
            velocity=_rms([each.error_norms.velocity for each in quality]),
        ),
        quality=quality,
        trace=trace,
        evaluations=objective.tally.simulations,
        refinement_steps=steps,
        seconds=seconds,
        n_time=sum(each.n_time for each in quality),
        provenance=provenance_of(problem),
        current=spec.current,
        nuisances=objective.settings.nuisances,
        motions=tuple(RecordedMotion.of(test) for test in objective.tests),
        n_effective=n_effective,
        forces=tuple(force for force, _ in runs),
        live_settings=problem.settings,
        warnings=(*problem.warnings, *_law_warnings(spec, values, tested)),
        tested=tested,
    )


# Commands up to this factor above the tested ones are near them; and so is zero, at which every driver starts.
_NEAR = 1.25


def _law_warnings(spec: DamperSpec, theta: NDArray[np.float64], tested: OperatingRange) -> tuple[str, ...]:
    """A sentence for each law that leaves its admissible range, or vanishes, within or near the tested commands."""
    if tested.command is None:
        return ()
    lowest, highest = tested.command
    within = {each.parameter: each for each in law_limits(spec, theta, tested.command)}
    near = law_limits(spec, theta, (min(0.0, lowest), _NEAR * highest))
    span = f"{lowest:g} to {highest:g} {tested.command_unit}"
    return tuple(
        f"{within[each.parameter].in_words}; that is within the tested commands, {span}: choose another law"
        if each.parameter in within
        else f"{each.in_words}; the tests are at {span}: do not use the fit there, or test there, or choose another law"
        for each in near
    )


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


# Sample time of the loop [s] and its integration steps, as studies have by default; the most steps of a sample of a
# test, of which the stiffness of a candidate is a share; and the most doublings in the loop.
_SAMPLE, _FEWEST, _MOST_IN_TEST, _MOST_FACTOR = 1e-3, 2, 256, 256
MANY = 16
"""Steps a sample from which on a study takes so much longer that a fit says so."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BuildingCost:
    """Integration steps that a damper wants in a building, a sample of 1 ms, under the motion of its tests.

    It is infinite where no number of steps resolves it. Damper and building are simulated with the same steps.
    """

    steps: float

    @classmethod
    def of(cls, spec: DamperSpec, theta: ArrayLike, tests: Sequence[DamperTest]) -> BuildingCost:
        """The cost by the stiffest test; the loop finds its steps by the same rule from the motion of the building."""
        wanted = [
            _MOST_IN_TEST
            * float(stiffness_shares(spec, np.atleast_2d(theta), loading_of(test, spec).history())[0])
            * (_SAMPLE / test.dt)
            for test in tests
        ]
        if not all(map(isfinite, wanted)):
            return cls(steps=np.inf)
        steps = _FEWEST
        while steps < max(wanted):
            steps *= 2
        return cls(steps=steps if steps <= _MOST_FACTOR * _FEWEST else np.inf)

    @property
    def is_high(self) -> bool:
        """Whether a study takes several times as long as with a model without states."""
        return self.steps >= MANY

    @property
    def in_words(self) -> str:
        """As in "about 64 integration steps a sample of 1 ms in a building"."""
        if not isfinite(self.steps):
            return f"more than {_MOST_FACTOR * _FEWEST} integration steps a sample of 1 ms in a building"
        return f"about {self.steps:.0f} integration steps a sample of 1 ms in a building"


def cost_warning(fit: Fit, cost: BuildingCost, cheap: Sequence[Fit]) -> str:
    """A sentence on a fit with a high cost; it names the best of the fits of `cheap` models to the same tests."""
    at_bound = [each.name for each in fit.estimates if each.remark in ("at lower bound", "at upper bound")]
    causes = f", with {listed(at_bound)} on a bound" if at_bound else ""
    least = f"where a model without states takes {_FEWEST}"
    return f"the fit takes {cost.in_words}{causes}, {least}; {_remedy(fit, cheap)}"


def _remedy(fit: Fit, cheap: Sequence[Fit]) -> str:
    if not cheap:
        return "compare it with models without states before a study uses it"
    most = max(each.fit_percent for each in cheap)
    as_good = [each for each in cheap if each.fit_percent >= most - NEGLIGIBLE]
    best = min(as_good, key=lambda each: len(each.estimates))
    both = f"{best.fit_percent:.2f} % against {fit.fit_percent:.2f} %"
    if best.fit_percent < fit.fit_percent - NEGLIGIBLE:
        return f"of the models without states {best.model} comes nearest ({both})"
    as_well = "better" if best.fit_percent > fit.fit_percent + NEGLIGIBLE else "as well"
    return (
        f"{best.model}, which has no states, fits {as_well} ({both}): use it in studies of the tested range"
    )
