"""The fit at a minimum: free runs on the tests, quality of the fit, cost in a building."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from mrwork.base.numbers import times
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import list_names
from mrwork.base.values import Floats
from mrwork.dampers.between_commands import hidden_extrema, open_between_commands
from mrwork.dampers.parameters import MOST_SUBSTEPS
from mrwork.dampers.simulation import stiffness_shares
from mrwork.dampers.spec import LAW_BEYOND, LAW_LEAVES_RANGE, DamperSpec, law_limits
from mrwork.errors import SimulationError
from mrwork.identification.covariance import Covariance
from mrwork.identification.fit import ErrorNorms, Fit, FitQuality, FitStatus, SearchTrace, step_in_words
from mrwork.identification.objective import Objective
from mrwork.identification.problem import Problem, are_rotary, provenance_of
from mrwork.identification.residual import ObservedTest
from mrwork.identification.suspicious import force_noise
from mrwork.identification.verdicts import fitted_parameters
from mrwork.records import DamperTest
from mrwork.records.checks import ONE_WAY
from mrwork.records.damper_test import loading_of, range_of_tests
from mrwork.records.likeness import RecordedMotion
from mrwork.records.observation import AS_IT_IS, Effect, Observation
from mrwork.records.read import ROTARY


def free_run(
    spec: DamperSpec,
    theta: Floats,
    test: DamperTest,
    *,
    each: tuple[Effect, ...] = (),
    substep_factor: int = 1,
) -> tuple[Floats, FitQuality]:
    """Free-run simulation of a model on a test: the force as recorded [N], shape (n_time,), and its quality.

    `each`: effects that are estimated from the test itself before the comparison.
    """
    observed = ObservedTest.of(spec, test, each)
    force, estimated, substeps = observed.predict_force(theta, substep_factor=substep_factor)
    return force, fit_quality(test, force, substeps=substeps, estimated=estimated)


@contextmanager
def explain_failures(fit: Fit, test: DamperTest) -> Iterator[None]:
    """Add to a simulation that fails in the block what of the test lies outside the tested ranges of the fit."""
    try:
        yield
    except SimulationError as error:
        reasons = "; ".join(remark.message for remark in fit.outside(test).remarks)
        raise SimulationError(
            f"{error}; outside the tested range: {reasons}" if reasons else str(error)
        ) from error


# Deviation of a force of one way, as a share of its mean, below which it is constant: less than friction has of noise.
_CONSTANT = 0.2


def fit_quality(
    test: DamperTest, force: Floats, *, substeps: int, estimated: Observation = AS_IT_IS
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
    centred = residual - residual.mean()
    power = float(centred @ centred)
    rmse = rms(residual)
    deviates = float(np.std(test.force[counted]))
    nrmse = rmse / deviates
    return FitQuality(
        test=test.name,
        fit_percent=100.0 * (1.0 - nrmse),
        nrmse=nrmse,
        rmse_n=rmse,
        error_norms=ErrorNorms(time=e_t, displacement=e_x, velocity=e_v),
        residual_autocorrelation=float(centred[1:] @ centred[:-1]) / power if power > 0.0 else 0.0,
        n_time=residual.size,
        settle_seconds=test.window.start * test.dt,
        substeps=substeps,
        observation=test.observation,
        estimated=estimated,
        constant=deviates < _CONSTANT * abs(float(test.force[counted].mean()))
        and any(remark.code == ONE_WAY.code for remark in test.remarks),
    )


def fit_at(
    problem: Problem,
    theta: Floats,
    *,
    covariance: Covariance | None,
    trace: SearchTrace,
    steps: int,
    status: FitStatus,
    seconds: float,
) -> Fit:
    """The fit at the parameters `theta` of the problem's form, shape (n_params,), after this number of `steps`.

    Standard errors and verdicts follow from the `covariance` there, where it is known.
    """
    spec, objective = problem.spec, problem.objective
    values = np.asarray(problem.form.to_model(theta))
    tested = range_of_tests(objective.tests, spec.command_unit)
    runs = [
        free_run(spec, values, test, each=objective.settings.observing.of_each) for test in objective.tests
    ]
    quality = tuple(test_quality for _, test_quality in runs)
    # After Ctrl-C nothing is compiled.
    change = (
        None
        if status == "interrupted"
        else _half_step_change(spec, values, objective, [force for force, _ in runs])
    )
    nrmse = rms([test_quality.nrmse for test_quality in quality])
    fit = Fit(
        model=spec.name,
        own=None if spec.own is None else spec.without_laws,
        estimates=(),
        directions=(),
        status=status,
        stop_reason=trace.stop_reason,
        nrmse=nrmse,
        fit_percent=100.0 * (1.0 - nrmse),
        rmse_n=rms([test_quality.rmse_n for test_quality in quality]),
        force_noise_n=force_noise(objective.tests),
        error_norms=ErrorNorms(
            time=rms([test_quality.error_norms.time for test_quality in quality]),
            displacement=rms([test_quality.error_norms.displacement for test_quality in quality]),
            velocity=rms([test_quality.error_norms.velocity for test_quality in quality]),
        ),
        quality=quality,
        trace=trace,
        evaluations=objective.tally.simulations,
        refinement_steps=steps,
        seconds=seconds,
        n_time=sum(test_quality.n_time for test_quality in quality),
        provenance=provenance_of(problem),
        current=spec.current_laws,
        motions=tuple(RecordedMotion.of(test) for test in objective.tests),
        n_effective=None if covariance is None else covariance.n_effective,
        tests=objective.tests,
        forces=tuple(force for force, _ in runs),
        live_settings=problem.settings,
        half_step_percent=change,
        tested=tested,
    )
    estimates, directions = fitted_parameters(problem, theta, covariance, fit.coherent)
    fit = replace(fit, estimates=estimates, directions=directions)
    return replace(fit, remarks=(*problem.foreseen(), *_remarks_on(fit)))


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
            free_run(spec, theta, test, each=objective.settings.observing.of_each, substep_factor=2)[0]
            for test in objective.tests
        ]
        return max(
            100.0 * float(np.sqrt(np.mean((finer_force - force) ** 2)) / np.std(test.force))
            for finer_force, force, test in zip(finer, forces, objective.tests, strict=True)
        )
    return None


# Commands up to this factor above the tested ones are near them; and so is zero, at which every driver starts.
_NEAR = 1.25
_STRUCTURE = RemarkKind(
    "residual_is_structure",
    "the residual, {rmse:.3g} N rms, is {times} the noise of the force: errors of parameters are of a model "
    "that leaves structure, not of the damper, and tests of other motions may move a parameter by more",
)
_COARSE_STEP = RemarkKind("step_coarse", "{change}", warns=True)


def _remarks_on(fit: Fit) -> Iterator[Remark]:
    """Structure in the residual, a coarse step, and laws that fail in or near the tested commands or between them."""
    spec, theta, tested, change = fit.spec, np.array(fit.theta), fit.tested, fit.half_step_percent
    if are_rotary(fit.tests):
        yield ROTARY.remark()
    if fit.times_noise is not None:
        measured = Measured(fit.times_noise, "")
        yield _STRUCTURE.remark(measured=measured, rmse=fit.rmse_n, times=times(fit.times_noise))
    if change is not None and change > _MOST_CHANGE:
        yield _COARSE_STEP.remark(measured=Measured(change, "%"), change=step_in_words(change))
    if tested.command is None:
        return
    lowest, highest = tested.command
    within = {limit.parameter: limit for limit in law_limits(spec, theta, tested.command)}
    for limit in law_limits(spec, theta, (min(0.0, lowest), _NEAR * highest)):
        inside = within.get(limit.parameter)
        yield limit.remark(LAW_BEYOND) if inside is None else inside.remark(LAW_LEAVES_RANGE)
    yield from (extremum.remark for extremum in hidden_extrema(spec, theta, tested.levels))
    if between := open_between_commands(spec, theta, tested):
        yield between


def rms(values: Sequence[float] | Floats) -> float:
    """Root mean square of values of any shape."""
    return float(np.sqrt(np.mean(np.square(values))))


# Sample time of the loop [s] and its integration steps, as studies have by default, and the most doublings in the loop.
_SAMPLE, _FEWEST, _MOST_FACTOR = 1e-3, 2, 256
MANY = 16
"""Steps a sample from which on a study takes so much longer that a fit says so."""
_COST = RemarkKind(
    "costly_in_building",
    f"the fit takes {{cost}}{{causes}}, where a model without states takes {_FEWEST}",
    "compare it with models without states before a study uses it",
)


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
        """Whether the loop can take the steps that the model needs."""
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


def cost_remark(fit: Fit, cost: BuildingCost) -> Remark:
    """The warning that a fit takes many steps in a building, with the parameters on a bound as causes."""
    at_bound = [estimate.name for estimate in fit.estimates if estimate.at_bound]
    causes = f", with {list_names(at_bound)} on a bound" if at_bound else ""
    return _COST.remark(*at_bound, measured=Measured(cost.steps, ""), cost=cost.in_words, causes=causes)
