"""Optimal experiment design: the expected reduction of a variance by each candidate for the next test.

The gains follow from the linearised posterior.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mrwork.base.arguments import NotNegative, Threads, checked
from mrwork.base.keys import suggestion
from mrwork.base.numbers import of_unit, percent
from mrwork.base.remark import Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import Column, Table
from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.coordinates import Box
from mrwork.dampers.simulation import Outcome, simulate_sensitivities
from mrwork.dampers.spec import DamperSpec
from mrwork.dampers.tested_range import OperatingRange
from mrwork.errors import SettingError, SimulationError, UnknownNameError
from mrwork.identification.covariance import Slopes
from mrwork.identification.fit import Fit, beside_likelihood
from mrwork.identification.problem import Problem
from mrwork.identification.residual import linearised_without_effects
from mrwork.identification.verdicts import parameter_scales
from mrwork.records import DamperTest
from mrwork.records.damper_test import as_tests
from mrwork.records.observation import Effect
from mrwork.uncertainty.bands.prediction import has_regular_cycles
from mrwork.uncertainty.candidate_tests import Candidate, harmonic_motion

# Rows of a plan that a summary has.
_ROWS_SHOWN = 15
_NOT_SIMULATED = RemarkKind("candidates_not_simulated", "not ranked, as they could not be simulated: {0}")
_MOTIONS_REPEAT = RemarkKind(
    "motions_repeat",
    "the motion of every test repeats, and how large the errors are where it does not, as under an earthquake, is not "
    "known",
    "also run a random motion of {low:.2g} to {high:.2g} Hz, up to {stroke:.3g} mm and {velocity:.3g} mm/s{at}, and "
    "give it to `mrwork calibrate`",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Gain:
    """Share by which a candidate reduces the band's variance, and the deviation after it."""

    candidate: Candidate
    gain: float
    deviation: NotNegative


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Plan(Summarised):
    """Candidates in order of gain for a `band`: "force", "energy" or the name of a parameter, of `deviation` before.

    Within the `gap` of the tested commands, which comes first, no gain counts what the form of the laws leaves open.
    """

    model: str
    band: str
    unit: str
    deviation: NotNegative
    gains: tuple[Gain, ...]
    left_out: tuple[Candidate, ...]
    gap: tuple[float, float] | None = None
    command_unit: CommandUnit | None = None
    remarks: tuple[Remark, ...] = ()

    @property
    def sentence(self) -> str:
        """The first candidate, and why it is the first."""
        best, unit = self.gains[0].candidate, self.command_unit
        most = f"this one narrows the band of {self.band} most: {best.in_words(unit)}."
        if self.gap is None or not _is_within(self.gap, best):
            return f"Of {len(self.gains)} tests {most}"
        low, high = self.gap
        count = sum(_is_within(self.gap, gain.candidate) for gain in self.gains)
        return (
            f"No test shows the laws between {low:g} and {high:g} {unit}, and no band has the error of their form: "
            f"test there first. Of {count} tests there {most}"
        )

    def _summary(self) -> Summary:
        columns = (
            Column("candidate", "test", shown=lambda candidate: candidate.in_words(self.command_unit)),
            Column("gain", "variance reduction", "%", shown=percent),
            Column("deviation", "deviation after the test", shown=3),
        )
        more = len(self.gains) - _ROWS_SHOWN
        table = Table.of(columns, self.gains[:_ROWS_SHOWN], note=f"and {more} more" if more > 0 else "")
        return Summary(
            title=f"Next tests of {self.model}",
            facts=(
                ("band", self.band),
                ("deviation now", of_unit(self.deviation, self.unit, 3)),
                (
                    "after the first",
                    f"{of_unit(self.gains[0].deviation, self.unit, 3)}, if the model is valid there",
                ),
            ),
            tables=[table],
            remarks=self.remarks,
            notes=[self.sentence],
        )


def _repeating_motions(tests: Sequence[DamperTest], tested: OperatingRange) -> Iterator[Remark]:
    if not all(has_regular_cycles(test) for test in tests):
        return
    low, high = tested.frequency or (0.0, 0.0)
    commands = () if tested.command is None else dict.fromkeys(tested.command)
    at = " and ".join(f"{command:g} {tested.command_unit}" for command in commands)
    peaks = {"stroke": 1e3 * tested.stroke, "velocity": 1e3 * tested.velocity}
    yield _MOTIONS_REPEAT.remark(measured=None, low=low, high=high, at=f", at {at}" if at else "", **peaks)


def _is_within(gap: tuple[float, float] | None, candidate: Candidate) -> bool:
    return gap is not None and candidate.command is not None and gap[0] < candidate.command < gap[1]


@array_dataclass()
class Response:
    """What a candidate tells, as matrices by unit coordinates of the free parameters, shape (n_free, n_free).

    A test of it adds `information` to the precision. Where the parameters have the covariance C, the variance of its
    force is trace(`force` C), relative to the variance over time, and of the energy of a cycle trace(`energy` C),
    relative to its square.
    """

    candidate: Candidate
    information: Floats
    force: Floats
    energy: Floats


@array_dataclass()
class LinearisedPosterior:
    """Linearised posterior before the next test about `theta`, (n_params,), with the inverse covariance `precision`.

    Precision is by unit coordinates of the free parameters of the `box`, shape (n_free, n_free). A further test adds
    `weight` times J'J / n_counted, with the force in units of its standard deviation.
    """

    spec: DamperSpec
    box: Box
    theta: Floats
    precision: Floats
    weight: float
    each: tuple[Effect, ...]
    threads: int

    @classmethod
    def of(
        cls, fit: Fit, tests: DamperTest | Sequence[DamperTest], *, threads: int = 0
    ) -> LinearisedPosterior:
        """The linearised posterior of a fit."""
        without = Problem.of_fit(fit, as_tests(tests), threads=threads)
        problem = without.freeing(fit.varied_effects)
        if problem.settings.ties:
            tied = ", ".join(problem.settings.ties)
            raise SettingError(
                f"the fit has tied {tied}, and the choice of the next test knows no ties; plan with a fit without them"
            )
        objective, spec, box = problem.objective, problem.form.spec, problem.form.box
        theta = problem.inside(fit.varied_values)
        slopes = Slopes.at(objective, problem.form, theta)
        residuals, derivative = slopes.residuals, slopes.by_free.T * box.unit_slope(theta)
        weight = slopes.dof / float(residuals @ residuals)
        ends = np.array(
            [
                (scale.lower, scale.upper)
                for scale in parameter_scales(spec, box, objective.tests, theta, objective.compared[0].free)
            ]
        ).T
        lower, upper = box.unit_from_theta(np.clip(ends, box.lower, box.upper))
        precision = np.diag(12.0 / (upper - lower) ** 2) + weight * derivative.T @ derivative
        # Of the parameters alone, whatever the free effects are, which the tests tell and candidates are not asked for.
        n_own = len(without.form.box.free)
        by_effects = precision[:n_own, n_own:]
        taken = by_effects @ np.linalg.solve(precision[n_own:, n_own:], by_effects.T)
        return cls(
            spec=spec,
            box=without.form.box,
            theta=theta[: len(without.form.box.names)],
            precision=precision[:n_own, :n_own] - taken,
            weight=weight / len(objective.tests),
            each=fit.settings.observing.of_each,
            threads=threads,
        )

    @property
    def errors(self) -> dict[str, float]:
        """Standard deviations of the free parameters by name, each in its unit."""
        variances = np.diag(np.linalg.inv(self.precision))
        errors = np.sqrt(np.maximum(variances, 0.0)) * self.box.unit_slope(self.theta)
        return dict(zip(self.box.free_names, errors.tolist(), strict=True))


@checked
def plan(
    fit: Fit,
    tests: DamperTest | Sequence[DamperTest],
    candidates: Sequence[Candidate],
    *,
    band: str = "force",
    targets: Sequence[Candidate] = (),
    threads: Threads = 0,
) -> Plan:
    """Rank candidate tests by the expected reduction of the variance of a band.

    The posterior is approximated as normal, with a prior of the variance of a uniform one over the range of each
    parameter at the scales of the records, and the information of the tests for their effective samples. A candidate
    adds the information of its own derivative, at the mean relative error and effective number of samples of the tests.
    In this approximation the variance does not depend on the result of the test, so the gain is known beforehand,
    provided that the model is correct. Candidates in a wide gap between the tested commands come first: how the laws
    run there is not known, and no variance counts it.

    Parameters
    ----------
    tests
        The test or tests of the fit.
    band
        Quantity whose band is to be narrowed: force or energy of a cycle, as a share, mean over the targets, or a
        parameter.
    targets
        Excitations of the band; default all candidates.

    Raises
    ------
    UnknownNameError
        Where the band is no parameter of the model.
    SettingError
        Where the parameter was held fixed.
    SimulationError
        Where no candidate could be simulated.
    """
    posterior = LinearisedPosterior.of(fit, tests, threads=threads)
    possible = responses(posterior, candidates)
    of_targets = responses(posterior, targets) if targets else possible
    if not possible or not of_targets:
        raise SimulationError(
            f"no {'candidate' if not possible else 'target'} could be simulated with {fit.model}; take slower ones"
        )
    matrix, unit = band_matrix(posterior, of_targets, band)
    variance_now = float(np.trace(matrix @ np.linalg.inv(posterior.precision)))
    if not math.isfinite(variance_now):
        raise SettingError(
            f"the variance of the band {band} is not a finite number, so that no test can be ranked; the fit of "
            f"{fit.model} leaves no residual, or a target has no force: identify it from measured tests"
        )
    gains = []
    for response in possible:
        after = float(np.trace(matrix @ np.linalg.inv(posterior.precision + response.information)))
        gains.append(
            Gain(
                candidate=response.candidate,
                gain=1.0 - after / variance_now if variance_now > 0.0 else 0.0,
                deviation=float(np.sqrt(after)),
            )
        )
    simulated = {response.candidate for response in possible}
    left_out = tuple(candidate for candidate in candidates if candidate not in simulated)
    names = "; ".join(candidate.in_words(posterior.spec.command_unit) for candidate in left_out)
    failed = (_NOT_SIMULATED.remark(names),) if left_out else ()
    return Plan(
        model=posterior.spec.name,
        band=band,
        unit=unit,
        deviation=float(np.sqrt(variance_now)),
        gains=tuple(
            sorted(gains, key=lambda gain: (not _is_within(fit.tested.gap, gain.candidate), -gain.gain))
        ),
        gap=fit.tested.gap,
        command_unit=posterior.spec.command_unit,
        left_out=left_out,
        remarks=(
            *failed,
            *_repeating_motions(as_tests(tests), fit.tested),
            *beside_likelihood(fit, posterior.errors),
        ),
    )


def responses(posterior: LinearisedPosterior, candidates: Sequence[Candidate]) -> list[Response]:
    """Responses of the candidates that can be simulated, with exact derivatives."""
    theta, box = posterior.theta[None], posterior.box
    slope = box.unit_slope(posterior.theta)
    responses_by_candidate = []
    for candidate in candidates:
        loading, counted = harmonic_motion(candidate, posterior.spec)
        run = simulate_sensitivities(
            posterior.spec, theta, loading.history(), columns=box.free, threads=posterior.threads
        )
        force, derivative = run.force[:, counted], run.jacobian[..., counted] * slope[:, None]
        # A force that never changes tells nothing, and has no deviation to divide by.
        if run.outcome[0] != Outcome.FINISHED or not np.ptp(force) > 0.0:
            continue
        _, corrected = linearised_without_effects(force, derivative, force[0], posterior.each)
        # Columns, (n_free, n_counted), whose products with themselves are means over time.
        scale = np.std(force) * np.sqrt(force.size)
        of_force, of_test = derivative[0] / scale, corrected[0] / scale
        assert loading.velocity is not None
        velocity = loading.velocity[counted]
        of_energy = derivative[0] @ velocity / (force[0] @ velocity)
        responses_by_candidate.append(
            Response(
                candidate=candidate,
                information=posterior.weight * of_test @ of_test.T,
                force=of_force @ of_force.T,
                energy=np.outer(of_energy, of_energy),
            )
        )
    return responses_by_candidate


def band_matrix(posterior: LinearisedPosterior, targets: Sequence[Response], band: str) -> tuple[Floats, str]:
    """Matrix M of a band with variance trace(M cov), shape (n_free, n_free), and the unit of its deviation."""
    if band == "force":
        return np.mean([target.force for target in targets], axis=0), "deviations of the force"
    if band == "energy":
        return np.mean([target.energy for target in targets], axis=0), "of the energy of a cycle"
    box, free = posterior.box, posterior.box.free_names
    if band not in free and band in posterior.spec.names:
        raise SettingError(f"{band} is fixed, no test narrows it; take force, energy, {', '.join(free)}")
    if band not in free:
        raise UnknownNameError(
            f"there is no band {band!r}{suggestion(band, ['force', 'energy', *free], otherwise='take')}"
        )
    index = posterior.spec.names.index(band)
    # A logarithmic parameter has its deviation relative to its value.
    size = posterior.theta[index] if box.log[index] else 1.0
    unit = np.where(np.equal(box.free, index), box.unit_slope(posterior.theta) / size, 0.0)
    return np.outer(unit, unit), "of its value" if box.log[index] else posterior.spec.parameters[index].unit
