"""The problem of tuning one law: candidates in, scores out, in as few calls of the simulation as possible."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from mrwork.closed_loop.evaluation import criteria
from mrwork.control.design_problem import NO_CERTIFICATE, DesignProblem, Magnitudes
from mrwork.control.law_design import design_candidates, design_law, settings_of
from mrwork.control.laws import control_law
from mrwork.errors import SettingError
from mrwork.motions import GroundMotion
from mrwork.study.batches import RunCriteria, simulated_criteria
from mrwork.study.study import Arrangement, Realisations, Row, Study
from mrwork.summary import Summarised
from mrwork.tuning.objective import PENALTY, Objective
from mrwork.tuning.space import Candidate
from mrwork.values import holds_arrays

Floats = NDArray[np.float64]


@dataclass(slots=True, kw_only=True)
class Clock:
    """Seconds spent in the simulation and in all, and the candidates that were simulated."""

    began: float = field(default_factory=time.perf_counter)
    simulating: float = 0.0
    candidates: int = 0

    @property
    def share_outside(self) -> float:
        """Share of the time that was spent outside the simulation."""
        spent = time.perf_counter() - self.began
        return max(0.0, 1.0 - self.simulating / spent) if spent > 0.0 else 0.0


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Bench(Summarised):
    """Motions and realisations under which candidates are simulated, and the criteria of baselines under them.

    `passive` are those at i = 0, `constant` those of the best constant command where an objective takes them.
    """

    study: Study
    arrangement: Arrangement
    problem: DesignProblem
    motions: tuple[GroundMotion, ...]
    realisations: Realisations
    passive: RunCriteria
    threads: int
    clock: Clock
    constant: RunCriteria | None = None

    def baseline(self, objective: Objective) -> RunCriteria:
        """What the criteria of an objective are divided by."""
        if objective.relative_to == "passive_off":
            return self.passive
        assert self.constant is not None
        return self.constant

    def shape_of(self, n_candidates: int) -> tuple[int, int, int]:
        """Shape of the runs of so many candidates: candidates, motions, realisations."""
        return n_candidates, len(self.motions), len(self.realisations)

    def run(self, law: str, candidates: Sequence[Candidate]) -> RunCriteria:
        """Criteria of candidates, infinite for those that make no law."""
        shape = (len(criteria()), *self.shape_of(len(candidates)))
        numbers, error, seconds = np.full(shape, math.inf), np.full(shape[1:], math.inf), 0.0
        for members, together in self._batches(law, candidates):
            problem = (
                self.problem if together else self.problem.limited_to(candidates[members[0]].largest_command)
            )
            known = [settings_of(law, candidates[n].settings) for n in members]
            designed = design_candidates(law, problem, known)
            if designed.law is None:
                continue
            places = [members[index] for index in designed.designed]
            found = simulated_criteria(
                replace(self.arrangement, devices=tuple(problem.devices), law=None),
                designed.law,
                self.motions,
                self.study.hardware,
                self.realisations,
                bare=self.study.building,
                largest_commands=np.array([candidates[n].largest_command for n in places])
                if together
                else None,
                threads=self.threads,
            )
            # A law without gains has one candidate, whatever the number of its settings.
            numbers[:, places], error[places] = found.numbers, found.energy_error
            seconds += found.seconds
        self.clock.simulating += seconds
        self.clock.candidates += len(candidates)
        return RunCriteria(numbers=numbers, energy_error=error, seconds=seconds)

    def _batches(self, law: str, candidates: Sequence[Candidate]) -> list[tuple[list[int], bool]]:
        """Indices of candidates that are simulated together, and whether their largest commands may differ.

        A single candidate is simulated as in a study, to the bit.
        """
        hardware = self.study.hardware
        sound = not any(fault.channel == "command" for fault in hardware.faults)
        alike = control_law(law).sends_share and sound and math.isinf(hardware.command_rate)
        if alike and len(candidates) > 1:
            return [(list(range(len(candidates))), True)]
        levels = dict.fromkeys(each.largest_command for each in candidates)
        return [
            ([n for n, each in enumerate(candidates) if each.largest_command == level], False)
            for level in levels
        ]

    def arrangement_with(self, law: str, candidate: Candidate, label: str) -> Arrangement:
        """The dampers of the study under a law with these settings, as `mrwork respond` simulates it."""
        problem = self.problem.limited_to(candidate.largest_command)
        return replace(
            self.arrangement,
            row=Row(label=label, kind="controller"),
            devices=tuple(problem.devices),
            law=design_law(law, problem, settings_of(law, candidate.settings)),
        )

    def certificate(self, law: str, candidate: Candidate) -> str:
        """What is proved of a law with these settings."""
        try:
            return settings_of(law, candidate.settings).certificate(
                self.problem.limited_to(candidate.largest_command)
            )
        except SettingError:
            return NO_CERTIFICATE


def check_controllable(study: Study) -> None:
    """Refuse a study of which no law can be tuned."""
    if study.problem is None or not study.devices:
        raise SettingError(f"study {study.title!r} has no dampers to be controlled; give a [[damper]]")
    if not any(device.spec.follows_command for device in study.devices):
        raise SettingError(
            f"study {study.title!r}: no parameter of the dampers depends on the command, so no law can be tuned; "
            "give a damper with laws"
        )


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Scores(Summarised):
    """Objective of candidates, by how much they exceed their limits, and both together, shape (n,) each."""

    objective: Floats
    violation: Floats

    def __post_init__(self) -> None:
        if self.objective.shape != self.violation.shape:
            raise ValueError(
                f"objectives of the shape {self.objective.shape} with violations of the shape {self.violation.shape}"
            )

    @property
    def shape(self) -> tuple[int, ...]:
        """(n,)."""
        return self.objective.shape

    @property
    def penalised(self) -> Floats:
        """What a search minimises: a candidate that exceeds a limit is worse by `PENALTY` times the share."""
        return np.asarray(self.objective + PENALTY * self.violation)

    @property
    def best(self) -> int:
        """The candidate of the least penalised objective; the first of equal ones."""
        return int(np.argmin(self.penalised))


def scored(bench: Bench, objective: Objective, law: str, candidates: Sequence[Candidate]) -> Scores:
    """The scores of candidates on a bench."""
    found = bench.run(law, candidates)
    value = objective.value(objective.run_scores(found, bench.baseline(objective)))
    violation = objective.violation(found)
    return Scores(objective=value, violation=np.where(np.isfinite(value), violation, 0.0))


def magnitudes_of(bench: Bench) -> Magnitudes:
    """Typical peaks of the response, medians over the motions, from i = 0 and the largest command."""
    study = bench.study
    largest = min(device.largest_command for device in study.devices)
    on = bench.run("passive", [Candidate(settings={"command": largest}, largest_command=largest)])
    bench.clock.candidates -= 1
    first = 2.0 * math.pi * float(study.building.frequencies[0])

    def off(name: str) -> float:
        return _middle(bench.passive.of(name)[0, :, 0])

    displacement = off("peak_displacement")
    velocity = first * displacement
    return Magnitudes(
        drift=off("peak_drift"),
        displacement=displacement,
        velocity=velocity,
        acceleration=off("peak_acceleration"),
        energy=study.building.total_mass * velocity**2,
        force=_middle(on.of("peak_force")[0, :, 0]),
        stroke=off("peak_stroke"),
        rate=first * off("peak_stroke"),
        ground=_middle(np.array([motion.peak for motion in bench.motions])),
        command=largest,
    )


def _middle(values: Floats) -> float:
    finite = values[np.isfinite(values) & (values > 0.0)]
    if not finite.size:
        raise SettingError(
            "the dampers at i = 0 or at the largest command have no finite response under the training motions; "
            "check the study with mrwork respond"
        )
    return float(np.median(finite))


def described(candidate: Candidate) -> Mapping[str, object]:
    """The settings of a candidate with its largest command, as a study file states them."""
    return {**candidate.settings, "largest_command": candidate.largest_command}
