"""The next test: which of some candidates narrows a band most, before it is made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError, SimulationError, UnknownNameError
from mrwork.identification.fit import Fit
from mrwork.identification.nuisance import NuisanceName, without_nuisance
from mrwork.identification.problem import Problem
from mrwork.records import DamperTest
from mrwork.simulate import Outcome, simulate_forces
from mrwork.summary import Summarised, Summary, of_unit, rounded
from mrwork.uncertainty.autocorrelation import effective_samples, residuals_by_test
from mrwork.uncertainty.identifiability.curvature import Scaled, curvature, linearise
from mrwork.uncertainty.identifiability.scale import Scale, scaled_ranges
from mrwork.uncertainty.planning.candidates import Candidate, motion_of

# In the parameters' own coordinates.
_STEP = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True)
class Gain:
    """What a candidate is worth: the share of the band's variance it takes away, and the band's deviation after it.

    `drawn` is the share found with draws, `None` where there were too few to tell.
    """

    candidate: Candidate
    gain: float
    deviation: float
    drawn: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Plan(Summarised):
    """Candidates, the best first, for a `band`: "force", "energy" or the name of a parameter.

    `deviation` is that of the band now, in `unit`. `left_out` could not be simulated.
    """

    model: str
    band: str
    unit: str
    deviation: float
    gains: tuple[Gain, ...]
    left_out: tuple[Candidate, ...]

    def _summary(self) -> Summary:
        return Summary(
            title=f"Next tests of {self.model}",
            facts=(("band", f"{self.band}, now known to {of_unit(self.deviation, self.unit, 3)}"),),
            columns=(
                "amplitude [mm]",
                "frequency [Hz]",
                "command",
                "variance taken away",
                f"deviation after it [{self.unit}]",
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """How a candidate's force answers to the parameters.

    `force` [N], (n_counted,), and its derivative per coordinate, (n_counted, n_free), which `told` holds too, less what
    nuisance parameters make up for; the `energy` of a cycle [J] and its derivative, (n_free,).
    """

    candidate: Candidate
    force: NDArray[np.float64]
    derivative: NDArray[np.float64]
    told: NDArray[np.float64]
    energy: float
    energy_derivative: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Knowledge:
    """What is known before the next test, in the coordinates of `scaled`, about `position`, shape (n_free,).

    `precision` is the inverse covariance of the linearised posterior, (n_free, n_free). A test like those of the fit
    adds `weight` times J'J, of a force in units of its deviation, mean over samples.
    """

    spec: DamperSpec
    scaled: Scaled
    position: NDArray[np.float64]
    precision: NDArray[np.float64]
    weight: float
    nuisances: tuple[NuisanceName, ...]
    threads: int


def plan_next_test(
    fit: Fit,
    tests: Sequence[DamperTest],
    candidates: Sequence[Candidate],
    *,
    band: str = "force",
    targets: Sequence[Candidate] = (),
    threads: int = 0,
) -> Plan:
    """Rank candidates by how much of a band's variance each is expected to take away.

    The posterior is taken as normal: a prior as wide as one that is even over the range of each parameter at the
    records' own scales, and the information of the tests for as many samples as their residuals are worth. A candidate
    adds the information of its own derivative, at the relative error and the effective number of samples that the
    tests had on average. A band's variance after it does not depend on what will be measured, so the gain can be told
    beforehand; it holds as far as the model does.

    Parameters
    ----------
    band
        "force": relative variance of the force, mean over the targets. "energy": of the energy of a cycle, likewise. Or
        the name of a parameter.
    targets
        Excitations that the band is wanted for; default all candidates.

    Raises
    ------
    UnknownNameError
        Where the band is no parameter of the model.
    SettingError
        Where it is one that was fixed.
    SimulationError
        Where no candidate could be simulated.
    """
    known = knowledge_of(fit, tests, threads=threads)
    answers = responses(known, candidates)
    wanted = responses(known, targets) if targets else answers
    if not answers or not wanted:
        raise SimulationError(
            f"no {'candidate' if not answers else 'target'} could be simulated with {fit.model}; take slower ones"
        )
    matrix, unit = band_matrix(known, wanted, band)
    now = float(np.trace(matrix @ np.linalg.inv(known.precision)))
    gains = []
    for answer in answers:
        after = float(np.trace(matrix @ np.linalg.inv(known.precision + information(known, answer))))
        gains.append(
            Gain(
                candidate=answer.candidate,
                gain=1.0 - after / now if now > 0.0 else 0.0,
                deviation=float(np.sqrt(after)),
            )
        )
    simulated = {answer.candidate for answer in answers}
    return Plan(
        model=known.spec.name,
        band=band,
        unit=unit,
        deviation=float(np.sqrt(now)),
        gains=tuple(sorted(gains, key=lambda each: -each.gain)),
        left_out=tuple(each for each in candidates if each not in simulated),
    )


def knowledge_of(fit: Fit, tests: Sequence[DamperTest], *, threads: int = 0) -> Knowledge:
    """The linearised posterior of a fit."""
    problem = Problem.of_fit(fit, tuple(tests), threads=threads)
    objective, spec, box = problem.objective, problem.form.spec, problem.form.box
    theta = problem.inside(fit.theta)
    ranges = scaled_ranges(spec, box, objective.tests, theta)
    scale = Scale.of(box, ranges, theta)
    scaled = Scaled.of(box, scale, theta)
    position = scaled.position(theta)
    here = curvature(linearise(objective, box.free), scaled, position[None])
    residuals = objective.residuals(theta[None])[0]
    n_effective = effective_samples(residuals_by_test(residuals, objective.tests))
    dof = n_effective * max(1.0 - len(box.free) / residuals.size, 0.0)
    weight = dof / float(here.squared[0])
    free = np.array(box.free, dtype=int)
    lower, upper = (
        np.where(scaled.log, np.log(np.where(scaled.log, each, 1.0)), each / scaled.size)
        for each in (np.array(ranges.lower)[free], np.array(ranges.upper)[free])
    )
    prior = np.diag(12.0 / (upper - lower) ** 2)
    return Knowledge(
        spec=spec,
        scaled=scaled,
        position=position,
        precision=prior + weight * here.normal[0],
        weight=weight / len(objective.tests),
        nuisances=fit.nuisances,
        threads=threads,
    )


def responses(known: Knowledge, candidates: Sequence[Candidate]) -> list[Response]:
    """How each candidate that can be simulated answers to the parameters; by central differences, in lanes."""
    scaled, position = known.scaled, known.position
    # Where a parameter lies on its bound, to one side.
    ahead = np.minimum(position + _STEP, scaled.upper)
    behind = np.maximum(position - _STEP, scaled.lower)
    steps = np.eye(position.size, dtype=np.bool_)
    points = np.concatenate(
        [position[None], np.where(steps, ahead, position), np.where(steps, behind, position)]
    )
    theta = scaled.parameters(points)
    found = []
    for candidate in candidates:
        loading, counted = motion_of(candidate, known.spec)
        run = simulate_forces(known.spec, theta, loading.history(), threads=known.threads)
        if np.any(run.outcome != Outcome.FINISHED):
            continue
        force = run.force[:, counted]
        told = without_nuisance(force, force[0], known.nuisances)
        cycles = (counted.stop - counted.start) * loading.dt * candidate.frequency
        assert loading.velocity is not None
        energy = force @ loading.velocity[counted] * loading.dt / cycles
        found.append(
            Response(
                candidate=candidate,
                force=force[0],
                derivative=_quotient(force, ahead - behind),
                told=_quotient(told, ahead - behind),
                energy=float(energy[0]),
                energy_derivative=_quotient(energy[:, None], ahead - behind)[0],
            )
        )
    return found


def information(known: Knowledge, answer: Response) -> NDArray[np.float64]:
    """What a candidate adds to the precision, shape (n_free, n_free)."""
    unit = answer.told / (np.std(answer.force) * np.sqrt(answer.force.size))
    return np.asarray(known.weight * unit.T @ unit)


def band_matrix(known: Knowledge, targets: Sequence[Response], band: str) -> tuple[NDArray[np.float64], str]:
    """The matrix M of a band, shape (n_free, n_free), whose variance is trace(M cov), and the unit of its deviation."""
    if band == "force":
        parts = [each.derivative / (np.std(each.force) * np.sqrt(each.force.size)) for each in targets]
        return np.mean([part.T @ part for part in parts], axis=0), "deviations of the force"
    if band == "energy":
        shares = [each.energy_derivative / each.energy for each in targets]
        return np.mean([np.outer(each, each) for each in shares], axis=0), "of the energy of a cycle"
    index = column_of(known, band)
    unit = np.zeros(known.position.size)
    unit[index] = 1.0 if known.scaled.log[index] else known.scaled.size[index]
    parameter = known.spec.parameters[known.scaled.free[index]]
    return np.outer(unit, unit), "of its value" if known.scaled.log[index] else parameter.unit


def column_of(known: Knowledge, band: str) -> int:
    """Place of a parameter among the free ones.

    Raises
    ------
    UnknownNameError, SettingError
        Where there is none, or it is fixed.
    """
    free = [known.spec.names[index] for index in known.scaled.free]
    if band in free:
        return free.index(band)
    if band in known.spec.names:
        raise SettingError(f"{band} is fixed, no test narrows it; take force, energy, {', '.join(free)}")
    raise UnknownNameError(f"there is no band {band!r}; take force, energy, {', '.join(free)}")


def _quotient(rows: NDArray[np.float64], width: NDArray[np.float64]) -> NDArray[np.float64]:
    """Difference quotients, shape (n_time, n_free), of rows: one at the centre, those ahead, those behind."""
    ahead, behind = np.split(rows[1:], 2)
    return np.asarray(((ahead - behind) / width[:, None]).T)
