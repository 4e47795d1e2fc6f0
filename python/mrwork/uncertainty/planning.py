"""Optimal experiment design: the expected reduction of a variance by each candidate for the next test.

The gains follow from the linearised posterior; nested Monte Carlo with draws of the posterior checks them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import NotNegative, Threads, checked
from mrwork.base.keys import suggestion
from mrwork.base.numbers import NOTHING, of_unit, percent, significant
from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import TableColumn, text_table
from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.simulation import Outcome, simulate_forces
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError, SimulationError, UnknownNameError
from mrwork.identification.covariance import effective_samples, residuals_by_test
from mrwork.identification.fit import Fit
from mrwork.identification.problem import Problem
from mrwork.identification.residual import NuisanceName, without_nuisance
from mrwork.identification.verdicts import Scale
from mrwork.records import DamperTest
from mrwork.records.damper_test import as_tests
from mrwork.uncertainty.candidate_tests import Candidate, check_possible, harmonic_motion
from mrwork.uncertainty.identifiability.curvature import Scaled, linearise, points_at

# Rows of a plan that a summary has.
_SHOWN = 15
# Finite-difference step in scaled coordinates.
_STEP = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True)
class Gain:
    """Share by which a candidate reduces the band's variance, the deviation after it, and the share by draws."""

    candidate: Candidate
    gain: float
    deviation: NotNegative
    drawn: float | None = None


def gain_columns(unit: CommandUnit | None) -> tuple[TableColumn, ...]:
    """Columns of a table of gains, with commands in `unit`."""
    return (
        TableColumn(heading="test", cell=lambda each: each.candidate.in_words(unit)),
        TableColumn(heading="variance reduction", unit="%", cell=lambda each: percent(each.gain)),
        TableColumn(
            heading="by draws",
            unit="%",
            cell=lambda each: NOTHING if each.drawn is None else percent(each.drawn, 0),
        ),
        TableColumn(heading="deviation after the test", cell=lambda each: significant(each.deviation, 3)),
    )


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Plan(Summarised):
    """Candidates in order of gain for a `band`: "force", "energy" or the name of a parameter, of `deviation` before.

    First are those within the `gap` of the tested commands: there no gain counts what the form of the laws leaves open.
    """

    model: str
    band: str
    unit: str
    deviation: NotNegative
    gains: tuple[Gain, ...]
    left_out: tuple[Candidate, ...]
    gap: tuple[float, float] | None = None
    command_unit: CommandUnit | None = None

    @property
    def sentence(self) -> str:
        """The first candidate, and why it is that."""
        best, unit = self.gains[0].candidate, self.command_unit
        most = f"this one narrows the band of {self.band} most: {best.in_words(unit)}."
        if self.gap is None or not _is_within(self.gap, best):
            return f"Of {len(self.gains)} tests {most}"
        low, high = self.gap
        count = sum(_is_within(self.gap, each.candidate) for each in self.gains)
        return (
            f"No test shows the laws between {low:g} and {high:g} {unit}, and no band has the error of their form: "
            f"test there first. Of {count} tests there {most}"
        )

    def _summary(self) -> Summary:
        table = text_table(gain_columns(self.command_unit), self.gains[:_SHOWN])
        more = len(self.gains) - _SHOWN
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
            tables=[replace(table, note=f"and {more} more" if more > 0 else "")],
            notes=[
                self.sentence,
                f"{len(self.left_out)} candidates could not be simulated" if self.left_out else "",
            ],
        )


def _is_within(gap: tuple[float, float] | None, candidate: Candidate) -> bool:
    return gap is not None and candidate.command is not None and gap[0] < candidate.command < gap[1]


@array_dataclass()
class Response:
    """Force of a candidate [N], (n_counted,), and energy of a cycle [J], with derivatives by coordinate, (..., n_free).

    `corrected` is the derivative after nuisance parameters have been fitted.
    """

    candidate: Candidate
    force: Floats
    derivative: Floats
    corrected: Floats
    energy: float
    energy_derivative: Floats


@array_dataclass()
class LinearisedPosterior:
    """Linearised posterior before the next test about `position`, (n_free,), with the inverse covariance `precision`.

    A further test adds `weight` times J'J / n_counted, with the force in units of its standard deviation.
    """

    spec: DamperSpec
    scaled: Scaled
    position: Floats
    precision: Floats
    weight: float
    nuisances: tuple[NuisanceName, ...]
    threads: int

    @classmethod
    def of(
        cls, fit: Fit, tests: DamperTest | Sequence[DamperTest], *, threads: int = 0
    ) -> LinearisedPosterior:
        """The linearised posterior of a fit."""
        problem = Problem.of_fit(fit, as_tests(tests), threads=threads)
        if problem.settings.ties:
            tied = ", ".join(problem.settings.ties)
            raise SettingError(
                f"the fit has tied {tied}, and the choice of the next test knows no ties; plan with a fit without them"
            )
        objective, spec, box = problem.objective, problem.form.spec, problem.form.box
        theta = problem.inside(fit.theta)
        scale = Scale.of(spec, box, objective.tests, theta)
        scaled = Scaled.of(spec, box, scale, theta)
        position = scaled.position(theta)
        (here,) = points_at(linearise(objective, box.free), scaled, position[None])
        residuals = objective.residuals(theta[None])[0]
        n_effective = effective_samples(residuals_by_test(residuals, objective.tests))
        dof = n_effective * max(1.0 - len(box.free) / residuals.size, 0.0)
        weight = dof / here.squared
        lower, upper = (scaled.position(np.array(each)) for each in (scale.ranges.lower, scale.ranges.upper))
        prior = np.diag(12.0 / (upper - lower) ** 2)
        return cls(
            spec=spec,
            scaled=scaled,
            position=position,
            precision=prior + weight * here.normal,
            weight=weight / len(objective.tests),
            nuisances=fit.nuisances,
            threads=threads,
        )


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
        "force": relative variance of the force, mean over the targets. "energy": likewise of the energy of a cycle. Or
        the name of a parameter.
    targets
        Excitations of the band; default all candidates.

    Raises
    ------
    UnknownNameError
        Where the band is no parameter of the model.
    SettingError
        Where the parameter was held fixed, or no rig could run a candidate or target.
    SimulationError
        Where no candidate could be simulated.
    """
    check_possible((*candidates, *targets))
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
        after = float(
            np.trace(matrix @ np.linalg.inv(posterior.precision + information(posterior, response)))
        )
        gains.append(
            Gain(
                candidate=response.candidate,
                gain=1.0 - after / variance_now if variance_now > 0.0 else 0.0,
                deviation=float(np.sqrt(after)),
            )
        )
    simulated = {response.candidate for response in possible}
    return Plan(
        model=posterior.spec.name,
        band=band,
        unit=unit,
        deviation=float(np.sqrt(variance_now)),
        gains=tuple(
            sorted(gains, key=lambda each: (not _is_within(fit.tested.gap, each.candidate), -each.gain))
        ),
        gap=fit.tested.gap,
        command_unit=posterior.spec.command_unit,
        left_out=tuple(each for each in candidates if each not in simulated),
    )


def responses(posterior: LinearisedPosterior, candidates: Sequence[Candidate]) -> list[Response]:
    """Responses of the candidates that can be simulated, by central differences in one batch each."""
    scaled, position = posterior.scaled, posterior.position
    # One-sided for a parameter on its bound.
    ahead = np.minimum(position + _STEP, scaled.upper)
    behind = np.maximum(position - _STEP, scaled.lower)
    steps = np.eye(position.size, dtype=np.bool_)
    points = np.concatenate(
        [position[None], np.where(steps, ahead, position), np.where(steps, behind, position)]
    )
    theta = scaled.parameters(points)
    responses_by_candidate = []
    for candidate in candidates:
        loading, counted = harmonic_motion(candidate, posterior.spec)
        run = simulate_forces(posterior.spec, theta, loading.history(), threads=posterior.threads)
        # A force that never changes tells nothing, and has no deviation to divide by.
        if np.any(run.outcome != Outcome.FINISHED) or not np.ptp(run.force[0, counted]) > 0.0:
            continue
        force = run.force[:, counted]
        corrected = without_nuisance(force, force[0], posterior.nuisances)
        cycles = (counted.stop - counted.start) * loading.dt * candidate.frequency
        assert loading.velocity is not None
        energy = force @ loading.velocity[counted] * loading.dt / cycles
        responses_by_candidate.append(
            Response(
                candidate=candidate,
                force=force[0],
                derivative=_quotient(force, ahead - behind),
                corrected=_quotient(corrected, ahead - behind),
                energy=float(energy[0]),
                energy_derivative=_quotient(energy[:, None], ahead - behind)[0],
            )
        )
    return responses_by_candidate


def information(posterior: LinearisedPosterior, response: Response) -> Floats:
    """Precision that a candidate adds, shape (n_free, n_free)."""
    unit = response.corrected / (np.std(response.force) * np.sqrt(response.force.size))
    return np.asarray(posterior.weight * unit.T @ unit)


def band_matrix(posterior: LinearisedPosterior, targets: Sequence[Response], band: str) -> tuple[Floats, str]:
    """Matrix M of a band with variance trace(M cov), shape (n_free, n_free), and the unit of its deviation."""
    if band == "force":
        parts = [each.derivative / (np.std(each.force) * np.sqrt(each.force.size)) for each in targets]
        return np.mean([part.T @ part for part in parts], axis=0), "deviations of the force"
    if band == "energy":
        shares = [each.energy_derivative / each.energy for each in targets]
        return np.mean([np.outer(each, each) for each in shares], axis=0), "of the energy of a cycle"
    index = _column_of(posterior, band)
    unit = np.zeros(posterior.position.size)
    unit[index] = 1.0 if posterior.scaled.log[index] else posterior.scaled.size[index]
    parameter = posterior.spec.parameters[posterior.scaled.free[index]]
    return np.outer(unit, unit), "of its value" if posterior.scaled.log[index] else parameter.unit


def _column_of(posterior: LinearisedPosterior, band: str) -> int:
    free = [posterior.spec.names[index] for index in posterior.scaled.free]
    if band in free:
        return free.index(band)
    if band in posterior.spec.names:
        raise SettingError(f"{band} is fixed, no test narrows it; take force, energy, {', '.join(free)}")
    raise UnknownNameError(
        f"there is no band {band!r}{suggestion(band, ['force', 'energy', *free], otherwise='take')}"
    )


def _quotient(rows: Floats, width: Floats) -> Floats:
    """Difference quotients, shape (n_time, n_free), of rows: the centre, those ahead, those behind."""
    ahead, behind = np.split(rows[1:], 2)
    return np.asarray(((ahead - behind) / width[:, None]).T)


# Smallest effective number of draws after a test for an estimate of the variance; number of draws taken as the truth.
_LEAST = 8.0
_TRUTHS = 60


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class CheckedPlan(Summarised):
    """A plan with gains from draws, their rank correlation (Spearman), and the least effective number of draws.

    `draws` says of which distribution they are.
    """

    plan: Plan
    agreement: float | None
    least_effective: NotNegative
    draws: str = "the posterior"

    @property
    def check_in_words(self) -> str:
        """Whether the draws give the order of the plan."""
        if self.agreement is None:
            return (
                f"Draws of {self.draws} could not check this order: almost none of them fits the simulated tests, as "
                "the posterior is far from normal or the next test is very informative; use the order, not the numbers."
            )
        return (
            f"Draws of {self.draws} rank the tests with a rank correlation of {self.agreement:.2f} to this order; "
            f"the effective sample size stays at least {self.least_effective:.0f} after a test."
        )

    def _summary(self) -> Summary:
        plan = self.plan._summary()
        return replace(plan, notes=(*plan.notes, self.check_in_words))


def normal_draws(posterior: LinearisedPosterior, n_draws: int, rng: np.random.Generator) -> Floats:
    """Draws of the linearised posterior as parameters, shape (n_draws, n_params), clipped to the box."""
    root = np.linalg.cholesky(np.linalg.inv(posterior.precision))
    position = posterior.position + rng.standard_normal((n_draws, posterior.position.size)) @ root.T
    return posterior.scaled.parameters(np.clip(position, posterior.scaled.lower, posterior.scaled.upper))


def checked_with_draws(
    plan: Plan,
    posterior: LinearisedPosterior,
    draws: Floats,
    *,
    targets: Sequence[Candidate] = (),
    rng: np.random.Generator,
) -> CheckedPlan:
    """Estimate each gain of a plan from draws (n_draws, n_params); rows that cannot be simulated are left out.

    Some draws are taken as the truth in turn: the test is simulated with noise, the other draws are weighted by its
    likelihood, and the variance of the band among them is computed. The mean over the truths is the expected remaining
    variance (nested Monte Carlo, Ryan, Journal of Computational and Graphical Statistics 12, 2003, 585-603).
    """
    if len(draws) < 2 * _LEAST:
        raise SettingError(f"{len(draws)} draws are too few to weigh against each other; give some hundreds")
    forces = _forces(posterior, draws, [each.candidate for each in plan.gains])
    of_targets = _forces(posterior, draws, targets) if targets else forces
    usable = np.all([np.isfinite(each.corrected).all(axis=1) for each in [*forces, *of_targets]], axis=0)
    forces, of_targets = ([each.of_draws(usable) for each in group] for group in (forces, of_targets))
    gram = _band_gram(posterior, draws[usable], of_targets, plan.band)
    n_draws = len(gram)
    variance_now = float(_variances(gram, np.full((1, n_draws), 1.0 / n_draws))[0])
    truths = rng.choice(n_draws, size=min(_TRUTHS, n_draws), replace=False)
    gains, least = [], float(n_draws)
    for gain, response in zip(plan.gains, forces, strict=True):
        weights = _weights(posterior, response.corrected, truths, rng)
        counted = float(np.median(1.0 / np.sum(weights**2, axis=1)))
        least = min(least, counted)
        reliable = counted >= _LEAST and variance_now > 0.0
        drawn = 1.0 - float(np.mean(_variances(gram, weights))) / variance_now if reliable else None
        gains.append(replace(gain, drawn=drawn))
    from scipy.stats import spearmanr

    pairs = [(each.gain, each.drawn) for each in gains if each.drawn is not None]
    agreement = float(spearmanr(*np.array(pairs).T).statistic) if len(pairs) > 2 else None
    return CheckedPlan(plan=replace(plan, gains=tuple(gains)), agreement=agreement, least_effective=least)


@array_dataclass()
class _Forces:
    """Forces of the draws minus their mean, (n_draws, n_counted), per its deviation and root n; energies of a cycle."""

    force: Floats
    corrected: Floats
    energy: Floats

    def of_draws(self, usable: NDArray[np.bool_]) -> _Forces:
        return _Forces(force=self.force[usable], corrected=self.corrected[usable], energy=self.energy[usable])


def _forces(posterior: LinearisedPosterior, draws: Floats, candidates: Sequence[Candidate]) -> list[_Forces]:
    forces = []
    for candidate in candidates:
        loading, counted = harmonic_motion(candidate, posterior.spec)
        run = simulate_forces(posterior.spec, draws, loading.history(), threads=posterior.threads)
        force = np.where((run.outcome == Outcome.FINISHED)[:, None], run.force[:, counted], np.nan)
        middle = np.nanmean(force, axis=0)
        size = np.std(middle) * np.sqrt(middle.size)
        assert loading.velocity is not None
        energy = force @ loading.velocity[counted]
        forces.append(
            _Forces(
                force=(force - middle) / size,
                corrected=without_nuisance(force, middle, posterior.nuisances) / size,
                energy=energy / float(np.nanmean(energy)),
            )
        )
    return forces


def _band_gram(
    posterior: LinearisedPosterior, draws: Floats, of_targets: Sequence[_Forces], band: str
) -> Floats:
    """Inner products of the draws in the quantity of the band, shape (n_draws, n_draws)."""
    if band == "force":
        return np.asarray(np.mean([each.force @ each.force.T for each in of_targets], axis=0))
    if band == "energy":
        return np.asarray(np.mean([np.outer(each.energy, each.energy) for each in of_targets], axis=0))
    index = _column_of(posterior, band)
    value = posterior.scaled.position(draws)[:, index]
    return np.outer(value - value.mean(), value - value.mean())


def _weights(
    posterior: LinearisedPosterior, corrected: Floats, truths: NDArray[np.int64], rng: np.random.Generator
) -> Floats:
    """Posterior weight of each draw after the test of each truth, shape (n_truths, n_draws), rows of sum 1."""
    measured = corrected[truths] + rng.standard_normal((truths.size, corrected.shape[1])) / np.sqrt(
        posterior.weight
    )
    exponent = (
        -0.5 * posterior.weight * (np.einsum("jt,jt->j", corrected, corrected) - 2.0 * measured @ corrected.T)
    )
    # The truth itself is excluded, for it would always have the largest weight.
    exponent[np.arange(truths.size), truths] = -np.inf
    weights = np.exp(exponent - exponent.max(axis=1, keepdims=True))
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def _variances(gram: Floats, weights: Floats) -> Floats:
    return np.asarray(weights @ np.diag(gram) - np.einsum("kj,kj->k", weights @ gram, weights))
