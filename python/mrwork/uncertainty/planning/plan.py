"""Plan of the next test: the expected reduction of a variance by each candidate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import NotNegative, Threads, checked
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError, SimulationError, UnknownNameError
from mrwork.identification.autocorrelation import effective_samples, residuals_by_test
from mrwork.identification.fit import Fit
from mrwork.identification.nuisance import NuisanceName, without_nuisance
from mrwork.identification.problem import Problem
from mrwork.records import DamperTest
from mrwork.records.damper_test import as_tests
from mrwork.simulate import Outcome, simulate_forces
from mrwork.store.record import Related
from mrwork.summary import Summarised, Summary, of_unit, rounded
from mrwork.uncertainty.identifiability.curvature import Scale, Scaled, curvature, linearise
from mrwork.uncertainty.planning.candidates import Candidate, check_possible, motion_of
from mrwork.values import holds_arrays

# Finite-difference step in scaled coordinates.
_STEP = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True)
class Gain:
    """Value of a candidate: the share by which it reduces the band's variance, and the band's deviation after it.

    `drawn` is the share estimated from draws, `None` where there were too few.
    """

    candidate: Candidate
    gain: float
    deviation: NotNegative
    drawn: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Plan(Summarised, Related):
    """Candidates in order of gain for a `band`: "force", "energy" or the name of a parameter.

    `deviation` is the standard deviation of the band before a further test, in `unit`. The candidates
    `left_out` could not be simulated.
    """

    model: str
    band: str
    unit: str
    deviation: NotNegative
    gains: tuple[Gain, ...]
    left_out: tuple[Candidate, ...]

    def disagreement(self) -> str:
        """Whether there is a candidate."""
        return "" if self.gains else "it ranks no candidate"

    def _summary(self) -> Summary:
        return Summary(
            title=f"Next tests of {self.model}",
            facts=(("band", f"{self.band}, present deviation {of_unit(self.deviation, self.unit, 3)}"),),
            columns=(
                "amplitude [mm]",
                "frequency [Hz]",
                "command",
                "variance reduction",
                f"deviation afterwards [{self.unit}]",
            ),
            rows=[
                (
                    rounded(1e3 * each.candidate.amplitude, 3),
                    rounded(each.candidate.frequency, 3),
                    rounded(each.candidate.command, 3),
                    f"{100.0 * each.gain:.1f} %",
                    rounded(each.deviation, 3),
                )
                for each in self.gains
            ],
            notes=[f"{len(self.left_out)} candidates could not be simulated" if self.left_out else ""],
        )


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """Sensitivity of a candidate's force to the parameters.

    `force` [N], (n_counted,), and its `derivative` by coordinate, (n_counted, n_free); `corrected` is the derivative
    after nuisance parameters have been fitted; the `energy` of a cycle [J] and its derivative, (n_free,).
    """

    candidate: Candidate
    force: NDArray[np.float64]
    derivative: NDArray[np.float64]
    corrected: NDArray[np.float64]
    energy: float
    energy_derivative: NDArray[np.float64]


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class LinearisedPosterior:
    """Linearised posterior before the next test, in the coordinates of `scaled`, about `position`, shape (n_free,).

    `precision` is the inverse covariance, (n_free, n_free). A further test adds `weight` times J'J / n_counted, with
    the force in units of its standard deviation.
    """

    spec: DamperSpec
    scaled: Scaled
    position: NDArray[np.float64]
    precision: NDArray[np.float64]
    weight: float
    nuisances: tuple[NuisanceName, ...]
    threads: int

    @classmethod
    def of(
        cls, fit: Fit, tests: DamperTest | Sequence[DamperTest], *, threads: int = 0
    ) -> LinearisedPosterior:
        """The linearised posterior of a fit."""
        problem = Problem.of_fit(fit, as_tests(tests), threads=threads)
        objective, spec, box = problem.objective, problem.form.spec, problem.form.box
        theta = problem.inside(fit.theta)
        scale = Scale.of(spec, box, objective.tests, theta)
        scaled = Scaled.of(spec, box, scale, theta)
        position = scaled.position(theta)
        here = curvature(linearise(objective, box.free), scaled, position[None])
        residuals = objective.residuals(theta[None])[0]
        n_effective = effective_samples(residuals_by_test(residuals, objective.tests))
        dof = n_effective * max(1.0 - len(box.free) / residuals.size, 0.0)
        weight = dof / float(here.squared[0])
        lower, upper = (scaled.position(np.array(each)) for each in (scale.ranges.lower, scale.ranges.upper))
        prior = np.diag(12.0 / (upper - lower) ** 2)
        return cls(
            spec=spec,
            scaled=scaled,
            position=position,
            precision=prior + weight * here.normal[0],
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
    provided that the model is correct.

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
        gains=tuple(sorted(gains, key=lambda each: -each.gain)),
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
    found = []
    for candidate in candidates:
        loading, counted = motion_of(candidate, posterior.spec)
        run = simulate_forces(posterior.spec, theta, loading.history(), threads=posterior.threads)
        if np.any(run.outcome != Outcome.FINISHED):
            continue
        force = run.force[:, counted]
        corrected = without_nuisance(force, force[0], posterior.nuisances)
        cycles = (counted.stop - counted.start) * loading.dt * candidate.frequency
        assert loading.velocity is not None
        energy = force @ loading.velocity[counted] * loading.dt / cycles
        found.append(
            Response(
                candidate=candidate,
                force=force[0],
                derivative=_quotient(force, ahead - behind),
                corrected=_quotient(corrected, ahead - behind),
                energy=float(energy[0]),
                energy_derivative=_quotient(energy[:, None], ahead - behind)[0],
            )
        )
    return found


def information(posterior: LinearisedPosterior, response: Response) -> NDArray[np.float64]:
    """Precision that a candidate adds, shape (n_free, n_free)."""
    unit = response.corrected / (np.std(response.force) * np.sqrt(response.force.size))
    return np.asarray(posterior.weight * unit.T @ unit)


def band_matrix(
    posterior: LinearisedPosterior, targets: Sequence[Response], band: str
) -> tuple[NDArray[np.float64], str]:
    """Matrix M of a band with variance trace(M cov), shape (n_free, n_free), and the unit of its deviation."""
    if band == "force":
        parts = [each.derivative / (np.std(each.force) * np.sqrt(each.force.size)) for each in targets]
        return np.mean([part.T @ part for part in parts], axis=0), "deviations of the force"
    if band == "energy":
        shares = [each.energy_derivative / each.energy for each in targets]
        return np.mean([np.outer(each, each) for each in shares], axis=0), "of the energy of a cycle"
    index = column_of(posterior, band)
    unit = np.zeros(posterior.position.size)
    unit[index] = 1.0 if posterior.scaled.log[index] else posterior.scaled.size[index]
    parameter = posterior.spec.parameters[posterior.scaled.free[index]]
    return np.outer(unit, unit), "of its value" if posterior.scaled.log[index] else parameter.unit


def column_of(posterior: LinearisedPosterior, band: str) -> int:
    """Index of a parameter among the free ones.

    Raises
    ------
    UnknownNameError, SettingError
        Where there is no such parameter, or it is fixed.
    """
    free = [posterior.spec.names[index] for index in posterior.scaled.free]
    if band in free:
        return free.index(band)
    if band in posterior.spec.names:
        raise SettingError(f"{band} is fixed, no test narrows it; take force, energy, {', '.join(free)}")
    raise UnknownNameError(f"there is no band {band!r}; take force, energy, {', '.join(free)}")


def _quotient(rows: NDArray[np.float64], width: NDArray[np.float64]) -> NDArray[np.float64]:
    """Difference quotients, shape (n_time, n_free), of rows: the centre, those ahead, those behind."""
    ahead, behind = np.split(rows[1:], 2)
    return np.asarray(((ahead - behind) / width[:, None]).T)
