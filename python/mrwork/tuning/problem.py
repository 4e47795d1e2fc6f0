"""Benches of a tuning: simulate candidates in batches, and return their criteria and judgements."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass
from mrwork.buildings.groups import largest_command
from mrwork.closed_loop.evaluation import SCORE
from mrwork.closed_loop.simulate import GainChanges
from mrwork.control.laws.control_law import ControlLaw, control_law
from mrwork.control.laws.law_problem import NO_CERTIFICATE, DesignProblem, Magnitudes
from mrwork.control.laws.law_settings import SETTINGS, design_candidates, design_law, settings_of
from mrwork.errors import SettingError
from mrwork.motions import GroundMotion
from mrwork.store.codec import digest_of
from mrwork.store.journal import Journal
from mrwork.study.loop_runs import simulate_criteria
from mrwork.study.named_laws import magnitudes_of_runs
from mrwork.study.realisations import Realisations, nominal
from mrwork.study.runs import (
    Axes,
    Runs,
    candidate_axes,
    recall_or_compute,
    recall_or_simulate,
    study_criteria,
)
from mrwork.study.study import Arrangement, Row, Study
from mrwork.tuning.results import DesignNotes
from mrwork.tuning.space import PENALTY, LawCandidate, TuningObjective


@dataclass(slots=True, kw_only=True)
class Clock:
    """Seconds spent in the simulation and in all, and the candidates that were simulated."""

    began: float = field(default_factory=time.perf_counter)
    simulating: float = 0.0
    candidates: int = 0

    @property
    def seconds_outside(self) -> float:
        """Time that was spent outside the simulation [s]."""
        return max(0.0, time.perf_counter() - self.began - self.simulating)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Bench(Summarised):
    """Motions and realisations under which candidates are simulated, and the criteria of baselines under them.

    `passive` are those at i = 0, `constant` those of the best constant command where an objective takes them.
    """

    study: Study
    problem: DesignProblem
    motions: tuple[GroundMotion, ...]
    realisations: Realisations
    passive: Runs
    journal: Journal | None
    threads: int
    clock: Clock
    constant: Runs | None = None

    def baseline(self, objective: TuningObjective) -> Runs:
        """What the criteria of an objective are divided by."""
        if objective.relative_to == "passive_off":
            return self.passive
        assert self.constant is not None
        return self.constant

    def run(self, law: str, candidates: Sequence[LawCandidate]) -> Runs:
        """Criteria of candidates, none for those that make no law."""
        runs = Runs.empty(self._axes(len(candidates)), study_criteria(self.study.command_unit))
        seconds = 0.0
        for members, together in self._batches(law, candidates):
            problem = (
                self.problem if together else self.problem.limited_to(candidates[members[0]].largest_command)
            )
            known = [settings_of(law, candidates[n].settings) for n in members]
            designed = design_candidates(law, problem, known)
            if designed.law is None:
                continue
            places = [members[index] for index in designed.designed]
            commands = np.array([candidates[n].largest_command for n in places]) if together else None
            shaping = _shaping_of([candidates[n] for n in places])
            batch = self.simulate(problem, designed.law, largest_commands=commands, shaping=shaping)
            # A law without gains has one candidate, whatever the number of its settings.
            runs.outcome[places] = batch.outcome
            for name, array in batch.numbers.items():
                runs.numbers[name][places] = array
            seconds += batch.seconds
        self.clock.simulating += seconds
        self.clock.candidates += len(candidates)
        return replace(runs, seconds=seconds)

    def simulate(
        self,
        problem: DesignProblem,
        law: ControlLaw,
        *,
        largest_commands: Floats | None = None,
        shaping: Floats | None = None,
        changes: GainChanges | None = None,
    ) -> Runs:
        """Criteria of the candidates of a law, see `simulate_loop`."""
        return simulate_criteria(
            replace(self.study.at_zero, devices=problem.all_devices, law=None),
            law,
            self.motions,
            self.study.hardware,
            self.realisations,
            bare=self.study.building,
            largest_commands=largest_commands,
            shaping=shaping,
            threads=self.threads,
            changes=changes,
        )

    def recall_or_run(self, step: str, inputs: str, law: str, candidates: Sequence[LawCandidate]) -> Runs:
        """The criteria of candidates, from the journal if it has them."""
        axes, declared = self._axes(len(candidates)), study_criteria(self.study.command_unit)
        return recall_or_simulate(
            self.journal, step, inputs, axes, declared, lambda: self.run(law, candidates)
        )

    def _axes(self, n_candidates: int) -> Axes:
        return candidate_axes(n_candidates, self.motions, len(self.realisations))

    def recall_or_score(
        self, step: str, inputs: str, objective: TuningObjective, law: str, candidates: Sequence[LawCandidate]
    ) -> Scores:
        """The scores of candidates, from the journal if it has them."""
        return recall_or_compute(
            self.journal,
            step,
            inputs,
            Scores,
            lambda: score_candidates(self, objective, law, candidates),
        )

    def _batches(self, law: str, candidates: Sequence[LawCandidate]) -> list[tuple[list[int], bool]]:
        """Indices of candidates that are simulated together, and whether their largest commands may differ.

        A single candidate is simulated as in a study, to the bit.
        """
        hardware = self.study.hardware
        sound = not any(fault.channel == "command" for fault in hardware.faults)
        slopes = (hardware.command_rate, *(each.command_slope for each in candidates))
        alike = control_law(law).sends_share and sound and all(map(math.isinf, slopes))
        if alike and len(candidates) > 1:
            return [(list(range(len(candidates))), True)]
        levels = dict.fromkeys(each.largest_command for each in candidates)
        return [
            ([n for n, each in enumerate(candidates) if each.largest_command == level], False)
            for level in levels
        ]

    def certificate(self, law: str, candidate: LawCandidate) -> str:
        """Stability certificate of a law with these settings, in words."""
        try:
            return settings_of(law, candidate.settings).certificate(
                self.problem.limited_to(candidate.largest_command)
            )
        except SettingError:
            return NO_CERTIFICATE

    def design_notes(self, law: str, candidate: LawCandidate) -> DesignNotes:
        """Sentences on the designed weights of a law with these settings, and on its gain; none if it has no design."""
        try:
            made = arrange_law(self.study, law, candidate, law).law
        except SettingError:
            return DesignNotes()
        assert isinstance(made, ControlLaw)
        weights = () if made.weights is None else (*made.weights.in_words, made.weights.advice)
        return DesignNotes(weights=weights, loop=(*made.notes, *made.shaping_notes))


def arrange_law(study: Study, law: str, candidate: LawCandidate, label: str) -> Arrangement:
    """The dampers of a study under a law with these settings, as `mrwork respond` simulates it."""
    assert study.problem is not None
    limited = study.problem.limited_to(candidate.largest_command)
    designed = design_law(law, limited, settings_of(law, candidate.settings))
    return replace(
        study.at_zero,
        row=Row(label=label, kind="controller"),
        devices=limited.all_devices,
        law=replace(designed, dead_zone=candidate.dead_zone, command_slope=candidate.command_slope),
    )


def _shaping_of(candidates: Sequence[LawCandidate]) -> Floats | None:
    """Dead zone and slope of each candidate; `None` where no command is shaped."""
    if not any(each.shaping for each in candidates):
        return None
    return np.array([(each.dead_zone, each.command_slope) for each in candidates])


def check_controllable(study: Study) -> None:
    """Refuse a study of which no law can be tuned."""
    if study.problem is None or not study.devices:
        raise SettingError(f"study {study.title!r} has no dampers to be controlled; give it one")
    if not any(device.is_commanded for device in study.devices):
        raise SettingError(
            f"study {study.title!r}: the dampers are passive or hold a command, so no law can be tuned; give a damper "
            "that follows a command"
        )


@array_dataclass(repr=False)
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
    def penalised_scores(self) -> Floats:
        """Objective plus `PENALTY` times the relative violation of the limits, which a search minimises."""
        return np.asarray(self.objective + PENALTY * self.violation)

    @property
    def best(self) -> int:
        """The candidate of the least penalised objective; the first of equal ones."""
        return int(np.argmin(self.penalised_scores))


def score_candidates(
    bench: Bench, objective: TuningObjective, law: str, candidates: Sequence[LawCandidate]
) -> Scores:
    """The scores of candidates on a bench."""
    return scores_of(objective, bench.run(law, candidates), bench)


def scores_of(objective: TuningObjective, runs: Runs, bench: Bench) -> Scores:
    """The scores of candidates whose criteria are known."""
    value = objective.value(objective.run_scores(runs, bench.baseline(objective)))
    violation = objective.violation(runs)
    return Scores(objective=value, violation=np.where(np.isfinite(value), violation, 0.0))


def magnitudes_of(bench: Bench, laws: Sequence[str] = ()) -> Magnitudes:
    """Typical peaks of the response, medians over the motions, from i = 0 and the largest command.

    Those under the best constant command are found where one of the `laws` chooses among commands.
    """
    study = bench.study
    largest = largest_command(study.devices)
    on = bench.run("passive", [LawCandidate(settings={"command": largest}, largest_command=largest)])
    bench.clock.candidates -= 1
    constant = None
    if bench.problem.reference_peaks is not None and any(SETTINGS[law].chooses_levels for law in laws):
        constant = bench.problem.reference_peaks()
    return magnitudes_of_runs(
        study.building, bench.motions, bench.passive, on, command=largest, constant=constant
    )


def describe(candidate: LawCandidate) -> Mapping[str, object]:
    """The settings of a candidate with those of its command, as a study file states them."""
    return {**candidate.settings, "largest_command": candidate.largest_command, **candidate.shaping}


STUDY_SCORE = TuningObjective(weights=dict.fromkeys(SCORE, 1.0))
"""That of a study, whatever a table minimises, so that all laws are compared by one number."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Benches(Summarised):
    """Benches with the training motions: of the nominal study, and with its realisations where a table is robust."""

    nominal: Bench
    varied: Bench | None

    def select(self, *, robust: bool) -> Bench:
        """The bench on which candidates are scored."""
        return self.varied if robust and self.varied is not None else self.nominal

    def with_constant(self, constant: LawCandidate) -> Benches:
        """Benches with the criteria under the best constant command, a baseline of objectives."""

        def with_own(bench: Bench) -> Bench:
            inputs = digest_of(len(bench.realisations), constant)
            return replace(bench, constant=bench.recall_or_run("baseline", inputs, "passive", [constant]))

        return Benches(
            nominal=with_own(self.nominal), varied=None if self.varied is None else with_own(self.varied)
        )


def benches_of(
    study: Study, *, journal: Journal | None, threads: int, clock: Clock, robust: bool = True
) -> Benches:
    """The benches of a study; the dampers at i = 0 are simulated on each."""
    check_controllable(study)
    problem, motions, law = study.problem, study.chosen_on, study.at_zero.law
    assert problem is not None
    assert law is not None

    def bench(realisations: Realisations) -> Bench:
        def passive() -> Runs:
            criteria = simulate_criteria(
                study.at_zero,
                law,
                motions,
                study.hardware,
                realisations,
                bare=study.building,
                threads=threads,
            )
            clock.simulating += criteria.seconds
            return criteria

        inputs = digest_of([motion.name for motion in motions], len(realisations))
        return Bench(
            study=study,
            problem=problem,
            motions=motions,
            realisations=realisations,
            passive=recall_or_simulate(
                journal,
                "passive",
                inputs,
                candidate_axes(1, motions, len(realisations)),
                study_criteria(study.command_unit),
                passive,
            ),
            journal=journal,
            threads=threads,
            clock=clock,
        )

    wide = study.realisations
    return Benches(
        nominal=bench(nominal(study.devices)), varied=bench(wide) if robust and wide is not None else None
    )
