"""The fit at a minimum: free runs on the tests, estimates of the parameters with standard errors, cost in a building.

One rule of effective samples is used everywhere: standard errors, tempering of a posterior, profiles, verdicts, plans,
blocks of a cross-validation and the residual tests of a report. It is n / tau with the integrated autocorrelation time
tau, summed over the initial monotone sequence of Geyer (1992). In theory the sums of adjacent correlations decrease
with the lag; one that increases is chance, and counts as the least before it. Geyer's initial positive sequence counts
such sums in full, and estimated a third too few samples for nearly white residuals.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from mrwork.base.summary import list_names
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.coordinates import Box, bound_at
from mrwork.dampers.simulation import MOST_SUBSTEPS, stiffness_shares
from mrwork.dampers.spec import DamperSpec, hidden_extrema, law_limits
from mrwork.dampers.tested_range import OperatingRange
from mrwork.errors import SimulationError
from mrwork.identification.equivalent import Form
from mrwork.identification.fit import (
    NEGLIGIBLE,
    ErrorNorms,
    Estimate,
    Fit,
    FitQuality,
    FitStatus,
    Remark,
    SearchTrace,
    step_in_words,
)
from mrwork.identification.objective import Objective, linearise_residuals
from mrwork.identification.problem import Problem, provenance_of
from mrwork.identification.residual import NONE, Nuisance, NuisanceName, ObservedTest
from mrwork.records import DamperTest
from mrwork.records.damper_test import loading_of, range_of_tests
from mrwork.records.likeness import RecordedMotion


def free_run(
    spec: DamperSpec,
    theta: Floats,
    test: DamperTest,
    *,
    nuisances: tuple[NuisanceName, ...] = (),
    substep_factor: int = 1,
) -> tuple[Floats, FitQuality]:
    """Free-run simulation of a model on a test: the force as recorded [N], shape (n_time,), and its quality.

    `nuisances`: parameters that are estimated from the test itself before the comparison.
    """
    observed = ObservedTest.of(spec, test, nuisances)
    force, nuisance, substeps = observed.predict_force(theta, substep_factor=substep_factor)
    return force, fit_quality(test, force, substeps=substeps, nuisance=nuisance)


@contextmanager
def explain_failures(fit: Fit, test: DamperTest) -> Iterator[None]:
    """Add to a simulation that fails in the block what of the test lies outside the tested ranges of the fit."""
    try:
        yield
    except SimulationError as error:
        reasons = "; ".join(fit.outside(test).sentences)
        raise SimulationError(
            f"{error}; outside the tested range: {reasons}" if reasons else str(error)
        ) from error


def fit_quality(test: DamperTest, force: Floats, *, substeps: int, nuisance: Nuisance = NONE) -> FitQuality:
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
    rmse = rms(residual)
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


def _lag_one(residual: Floats) -> float:
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


def _estimates_of(
    spec: DamperSpec,
    form: Form,
    theta: Floats,
    errors: Floats | None,
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


def remarks_of(form: Form, theta: Floats) -> tuple[Remark, ...]:
    """Remark on each parameter of the requested model that does not vary; empty for the others.

    Such a parameter depends only on parameters of the form, `theta`, (n_params,), that are fixed or on a bound.
    """
    own = [remark_of(form.box, index, float(value)) for index, value in enumerate(theta)]
    remarks: list[Remark] = []
    for row in form.to_model.jacobian(theta):
        used = {own[index] for index in np.flatnonzero(row)}
        on_bound = sorted(used - {"", "fixed"})
        remarks.append("" if "" in used else on_bound[0] if on_bound else "fixed")
    return tuple(remarks)


def remark_of(box: Box, index: int, value: float) -> Remark:
    """Remark on a parameter that is fixed or on a bound of the box; empty for others."""
    if index not in box.free:
        return "fixed"
    remarks: dict[str, Remark] = {"": "", "lower": "at lower bound", "upper": "at upper bound"}
    return remarks[bound_at(box, index, value)]


def fit_at(
    problem: Problem,
    theta: Floats,
    *,
    errors: Floats | None,
    n_effective: float | None = None,
    trace: SearchTrace,
    steps: int,
    status: FitStatus,
    seconds: float,
) -> Fit:
    """The fit at the parameters `theta` of the problem's form, shape (n_params,), after this number of `steps`.

    `errors`: standard errors, (n_params,), of the requested model, for `n_effective` samples, where they are known.
    """
    spec, objective = problem.spec, problem.objective
    values = np.asarray(problem.form.to_model(theta))
    tested = range_of_tests(objective.tests, None if spec.current is None else spec.current.unit)
    runs = [free_run(spec, values, test, nuisances=objective.settings.nuisances) for test in objective.tests]
    quality = tuple(each for _, each in runs)
    # After Ctrl-C nothing is compiled.
    change = (
        None
        if status == "interrupted"
        else _half_step_change(spec, values, objective, [force for force, _ in runs])
    )
    coarse = () if change is None or change <= _MOST_CHANGE else (step_in_words(change),)
    nrmse = rms([each.nrmse for each in quality])
    return Fit(
        model=spec.name,
        own=None if spec.own is None else spec.without_laws,
        estimates=_estimates_of(spec, problem.form, theta, errors, problem.settings.bounds),
        status=status,
        stop_reason=trace.stop_reason,
        nrmse=nrmse,
        fit_percent=100.0 * (1.0 - nrmse),
        rmse_n=rms([each.rmse_n for each in quality]),
        error_norms=ErrorNorms(
            time=rms([each.error_norms.time for each in quality]),
            displacement=rms([each.error_norms.displacement for each in quality]),
            velocity=rms([each.error_norms.velocity for each in quality]),
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
        tests=objective.tests,
        forces=tuple(force for force, _ in runs),
        live_settings=problem.settings,
        half_step_percent=change,
        warnings=(*problem.warnings, *coarse, *_law_warnings(spec, values, tested)),
        tested=tested,
    )


# Largest change of the force by half the step, in per cent of its deviation, that is not worth a warning.
_MOST_CHANGE = 0.1


def _half_step_change(
    spec: DamperSpec, theta: Floats, objective: Objective, forces: Sequence[Floats]
) -> float | None:
    """Change of the force by half the step, in per cent of its deviation; `None` where the step is the core's rule.

    The sub-steps of a damper of the user follow from its own derivatives, or from a bound that it states.
    """
    if spec.own is None or not spec.n_states:
        return None
    with suppress(SimulationError):
        finer = [
            free_run(spec, theta, each, nuisances=objective.settings.nuisances, substep_factor=2)[0]
            for each in objective.tests
        ]
        return max(
            100.0 * float(np.sqrt(np.mean((half - force) ** 2)) / np.std(test.force))
            for half, force, test in zip(finer, forces, objective.tests, strict=True)
        )
    return None


# Commands up to this factor above the tested ones are near them; and so is zero, at which every driver starts.
_NEAR = 1.25


def _law_warnings(spec: DamperSpec, theta: Floats, tested: OperatingRange) -> tuple[str, ...]:
    """Sentences on laws that vanish or leave their range in or near the tested commands, or have an extremum there."""
    if tested.command is None:
        return ()
    lowest, highest = tested.command
    within = {each.parameter: each for each in law_limits(spec, theta, tested.command)}
    near = law_limits(spec, theta, (min(0.0, lowest), _NEAR * highest))
    span = f"{lowest:g} to {highest:g} {tested.command_unit}"
    limits = (
        f"{within[each.parameter].in_words}; that is within the tested commands, {span}: choose another law"
        if each.parameter in within
        else f"{each.in_words}; the tests are at {span}: do not use the fit there, or test there, or choose another law"
        for each in near
    )
    return (*limits, *(each.in_words for each in hidden_extrema(spec, theta, tested.levels)))


def rms(values: Sequence[float] | Floats) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


# Sample time of the loop [s] and its integration steps, as studies have by default, and the most doublings in the loop.
_SAMPLE, _FEWEST, _MOST_FACTOR = 1e-3, 2, 256
MANY = 16
"""Steps a sample from which on a study takes so much longer that a fit says so."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BuildingCost:
    """Integration steps that a damper wants in a building, a sample of 1 ms, under its tests; may be infinite."""

    steps: float

    @classmethod
    def of(cls, spec: DamperSpec, theta: ArrayLike, tests: Sequence[DamperTest]) -> BuildingCost:
        """The cost by the stiffest test; the loop finds its steps by the same rule from the motion of the building."""
        wanted = [
            MOST_SUBSTEPS
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
    def is_possible(self) -> bool:
        """Whether the loop has as many steps."""
        return isfinite(self.steps)

    @property
    def is_high(self) -> bool:
        """Whether a study takes several times as long as with a model without states."""
        return self.steps >= MANY

    @property
    def in_words(self) -> str:
        """Text such as "about 64 integration steps a sample of 1 ms in a building"."""
        if not self.is_possible:
            return f"more than {_MOST_FACTOR * _FEWEST} integration steps a sample of 1 ms in a building"
        return f"about {self.steps:.0f} integration steps a sample of 1 ms in a building"


def cost_warning(fit: Fit, cost: BuildingCost, cheap: Sequence[Fit]) -> str:
    """A sentence on a fit with a high cost; it names the best of the fits of `cheap` models to the same tests."""
    at_bound = [each.name for each in fit.estimates if each.remark in ("at lower bound", "at upper bound")]
    causes = f", with {list_names(at_bound)} on a bound" if at_bound else ""
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


# A combination of parameters (each scaled to unit sensitivity) that changes the residuals less than this, relative to
# the one that changes them most, is not identifiable. Rounding leaves about 1e-11. The same number bounds the squared
# component of a parameter that takes part in such a combination.
INSENSITIVE = 1e-7


@array_dataclass()
class Slopes:
    """Residuals of an objective at `theta`, (n_residuals,), and derivatives by what varies, (n_free, n_residuals).

    Covariance, identifiability and the noise of the motion follow from them.
    """

    objective: Objective
    form: Form
    theta: Floats
    residuals: Floats
    by_free: Floats

    @classmethod
    def at(cls, objective: Objective, form: Form, theta: Floats) -> Slopes:
        """Simulate the tests once with derivatives; they give the residuals where no parameter is free."""
        (residuals,), (by_free,) = linearise_residuals(objective, theta[None], form.box.free)
        return cls(objective=objective, form=form, theta=theta, residuals=residuals, by_free=by_free)

    @property
    def interior(self) -> list[int]:
        """Parameters of the form that are free and not on a bound."""
        return [i for i in self.form.box.free if remark_of(self.form.box, i, float(self.theta[i])) == ""]

    def by_interior(self) -> Floats:
        """Derivatives by the parameters that are not on a bound, shape (n_interior, n_residuals)."""
        interior, free = self.interior, list(self.form.box.free)
        return self.by_free if interior == free else self.by_free[[free.index(each) for each in interior]]

    def by_model(self) -> Floats:
        """Derivatives by the requested model's parameters, (n_residuals, n_params); zero where the form is fixed."""
        mapped = self.form.from_model.jacobian(np.asarray(self.form.to_model(self.theta)))
        return np.asarray(self.by_free.T @ mapped[list(self.form.box.free)])


def covariance_at(slopes: Slopes) -> tuple[Floats, float]:
    """Covariance of the parameters of the requested model, and the effective number of samples that it assumes.

    Shape (n_params, n_params), with zeros for parameters that do not vary and NaN for those that the residuals do not
    determine: that of independent residuals times `n_residuals/n_effective`. A parameter on its bound counts as known.
    """
    residuals, interior, n_params = slopes.residuals, slopes.interior, len(slopes.theta)
    n_effective = effective_samples(residuals_by_test(residuals, slopes.objective.tests))
    cov = np.zeros((n_params, n_params))
    if interior:
        independent = covariance(slopes.by_interior().T, float(np.linalg.norm(residuals)))
        cov[np.ix_(interior, interior)] = independent * (residuals.size / n_effective)
    return covariance_through(slopes.form.to_model.jacobian(slopes.theta), cov), n_effective


def standard_errors(cov: Floats) -> Floats:
    """Standard errors, shape (n_params,), of a covariance: 0 for what does not vary, NaN for what is undetermined."""
    return np.asarray(np.sqrt(np.diag(cov)))


def covariance(jacobian: Floats, misfit: float) -> Floats:
    """Covariance for independent residuals, shape (n_params, n_params); NaN where columns are not identifiable.

    `cov = s^2 (J'J)^-1` with `s^2 = misfit^2 / (n_residuals - n_params)`, for the Jacobian of residuals whose sum
    of squares is the squared misfit. Parameters that take part in a combination to which the residuals are insensitive
    have NaN in their rows and columns.
    """
    n_residuals, n_params = jacobian.shape
    result = np.full((n_params, n_params), np.nan)
    norm = np.linalg.norm(jacobian, axis=0)
    sensitive = np.flatnonzero(norm > 0.0)
    if sensitive.size == 0 or n_residuals <= n_params or not np.all(np.isfinite(jacobian)):
        return result
    _, singular, right = np.linalg.svd(jacobian[:, sensitive] / norm[sensitive], full_matrices=False)
    determined = singular > INSENSITIVE * singular[0]
    variance = misfit**2 / (n_residuals - n_params)
    root = right[determined].T / singular[determined] / norm[sensitive, None]
    block = variance * root @ root.T
    undetermined = np.sum(right[~determined] ** 2, axis=0) > INSENSITIVE
    block[undetermined, :] = np.nan
    block[:, undetermined] = np.nan
    result[np.ix_(sensitive, sensitive)] = block
    return result


def covariance_through(map_jacobian: Floats, cov: Floats) -> Floats:
    """Covariance of mapped parameters, (n_mapped, n_mapped), by the delta method; NaN goes no further than it must."""
    used = [np.flatnonzero(row) for row in map_jacobian]
    return np.array(
        [
            [
                row[here] @ cov[np.ix_(here, there)] @ other[there]
                for other, there in zip(map_jacobian, used, strict=True)
            ]
            for row, here in zip(map_jacobian, used, strict=True)
        ]
    )


def autocorrelation_time(residual: ArrayLike) -> float:
    """Integrated autocorrelation time of a series, shape (n_time,), in samples; 1 for independent samples.

    `tau = 1 + 2 sum_k rho_k` over the initial monotone sequence: pairs `rho_2m + rho_2m+1`, each no larger than those
    before it, until the first that is not positive (Geyer, Statistical Science 7, 1992, 473-483). The correlation is
    about zero, not about the mean, because the mean residual is model error. Alternating samples count as
    independent, not as more.

    The sum for a residual that repeats with the excitation ends at its first change of sign, so that repeated cycles
    count as independent: the time is a lower limit there.
    """
    series = np.asarray(residual, dtype=np.float64)
    n_time = series.size
    # Zero-padded, so that the correlation is not circular.
    spectrum = np.fft.rfft(series, 2 * n_time)
    covariance = np.fft.irfft(np.abs(spectrum) ** 2, 2 * n_time)[:n_time]
    if covariance[0] == 0.0:
        return 1.0
    rho = covariance / covariance[0]
    pairs = rho[: n_time - n_time % 2].reshape(-1, 2).sum(axis=1)
    negative = np.flatnonzero(pairs <= 0.0)
    positive = pairs[: negative[0]] if negative.size else pairs
    return max(2.0 * float(np.minimum.accumulate(positive).sum()) - 1.0, 1.0)


def effective_samples(residuals: Iterable[ArrayLike]) -> float:
    """Effective number of samples of all tests, from the residuals of each, shape (n_counted,)."""
    return float(sum(np.size(each) / autocorrelation_time(each) for each in residuals))


def residuals_by_test(residuals: Floats, tests: Sequence[DamperTest]) -> tuple[Floats, ...]:
    """Residuals of an objective, shape (..., n_residuals), divided into those of its tests, shape (..., n_counted)."""
    ends = np.cumsum([test.n_counted for test in tests])
    return tuple(np.split(residuals, ends[:-1], axis=-1))
