"""Benches of a tuning: simulate candidates in batches, and return their criteria, scores and certificates."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mrwork.base.numbers import round_to
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats
from mrwork.buildings.groups import largest_command
from mrwork.buildings.matrices import Device
from mrwork.control.laws.control_law import ControlLaw, control_law
from mrwork.control.laws.law_problem import NO_CERTIFICATE, DesignProblem, Magnitudes
from mrwork.control.laws.law_settings import SETTINGS, design_candidates, settings_of
from mrwork.errors import SettingError
from mrwork.store.codec import digest_of
from mrwork.store.long_call import LongCall
from mrwork.study.loop_runs import simulate_criteria
from mrwork.study.named_laws import magnitudes_of_runs
from mrwork.study.realisations import Realisations, nominal
from mrwork.study.runs import Runs, candidate_axes, study_criteria
from mrwork.study.schema import TuneTable
from mrwork.study.study import Study
from mrwork.tuning.space import LARGEST, LawCandidate, Scores, SettingSpace, TuningObjective


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Bench(Summarised):
    """Realisations of a study under which candidates are simulated on its training motions, and baselines under them.

    `baselines` are the criteria at i = 0 and under the best constant command.
    """

    study: Study
    realisations: Realisations
    call: LongCall[Any, Any]
    threads: int
    baselines: Mapping[str, Runs]

    @staticmethod
    def of(study: Study, call: LongCall[Any, Any] | None = None, threads: int = 0) -> Bench:
        """The bench of the nominal study, without baselines."""
        return Bench(
            study=study,
            realisations=nominal(study.devices),
            call=LongCall() if call is None else call,
            threads=threads,
            baselines={},
        )

    def with_baselines(self, constants: Mapping[str, LawCandidate]) -> Bench:
        """The bench with the criteria under constant commands as baselines."""
        runs = self.recalled("baselines", "passive", [*constants.values()])
        return replace(self, baselines={name: runs.of_row(row) for row, name in enumerate(constants)})

    def run(self, law: str, candidates: Sequence[LawCandidate]) -> Runs:
        """Criteria of candidates, none for those that make no law."""
        runs = self._empty(len(candidates))
        for members, together in self._batches(law, candidates):
            problem = self.study.problem
            if not together:
                problem = problem.limited_to(candidates[members[0]].largest_command)
            designed = design_candidates(
                law, problem, [settings_of(law, candidates[n].of_law) for n in members]
            )
            if designed.law is None:
                continue
            places = [members[index] for index in designed.designed]
            commands = np.array([candidates[n].largest_command for n in places]) if together else None
            shapes = np.array([candidates[n].shape for n in places])
            shaped = np.any(shapes != LawCandidate({}).shape)
            batch = self.simulate(
                problem, designed.law, largest_commands=commands, shaping=shapes if shaped else None
            )
            # A law without gains has one candidate, whatever the number of its settings.
            runs.outcome[places] = batch.outcome
            for name, array in batch.numbers.items():
                runs.numbers[name][places] = array
        return runs

    def simulate(
        self,
        problem: DesignProblem,
        law: ControlLaw,
        *,
        largest_commands: Floats | None = None,
        shaping: Floats | None = None,
        changes: Floats | None = None,
    ) -> Runs:
        """Criteria of the candidates of a law, see `simulate_criteria`."""
        return simulate_criteria(
            replace(self.study.at_zero, devices=problem.all_devices, law=law),
            self.study.chosen_on,
            self.study.hardware,
            self.realisations,
            largest_commands=largest_commands,
            shaping=shaping,
            threads=self.threads,
            changes=changes,
        )

    def recalled(self, step: str, law: str, candidates: Sequence[LawCandidate]) -> Runs:
        """The criteria of candidates, from the journal if it has them."""
        inputs = digest_of(law, candidates, len(self.realisations))
        empty = self._empty(len(candidates))
        return empty.recalled(self.call.journal, step, inputs, lambda _: self.run(law, candidates))

    def _empty(self, n_candidates: int) -> Runs:
        axes = candidate_axes(n_candidates, self.study.chosen_on, len(self.realisations))
        return Runs.empty(axes, study_criteria(self.study.command_unit))

    def scores(
        self, objective: TuningObjective, law: str, candidates: Sequence[LawCandidate], step: str = ""
    ) -> Scores:
        """The scores of candidates; of a `step`, from the journal if it has them."""

        def compute() -> Scores:
            return objective.scores(self.run(law, candidates), self.baselines)

        return self.call.step(step, Scores, compute, law, candidates) if step else compute()

    def _batches(self, law: str, candidates: Sequence[LawCandidate]) -> list[tuple[list[int], bool]]:
        """Indices of candidates that are simulated together, and whether their largest commands may differ.

        A single candidate is simulated as in a study, to the bit.
        """
        hardware = self.study.hardware
        sound = not any(fault.channel == "command" for fault in hardware.faults)
        slopes = (hardware.command_rate, *(candidate.shape[1] for candidate in candidates))
        alike = control_law(law).sends_share and sound and all(map(math.isinf, slopes))
        if alike and len(candidates) > 1:
            return [(list(range(len(candidates))), True)]
        levels = dict.fromkeys(candidate.largest_command for candidate in candidates)
        return [
            ([n for n, candidate in enumerate(candidates) if candidate.largest_command == level], False)
            for level in levels
        ]

    def certificate(self, law: str, candidate: LawCandidate) -> str:
        """Stability certificate of a law with these settings, in words."""
        try:
            return settings_of(law, candidate.of_law).certificate(
                self.study.problem.limited_to(candidate.largest_command)
            )
        except SettingError:
            return NO_CERTIFICATE


@dataclass(frozen=True, slots=True, kw_only=True)
class LawPlan:
    """A law to be tuned: its table, the space of its settings, and the bench and objective that score them."""

    table: TuneTable
    label: str
    space: SettingSpace
    objective: TuningObjective
    bench: Bench

    @property
    def law(self) -> str:
        """Name of the law."""
        return self.space.law


def check_controllable(study: Study) -> None:
    """Refuse a study of which no law can be tuned."""
    if not any(device.is_commanded for device in study.devices):
        raise SettingError(
            f"study {study.title!r} has no damper that follows a command, so no law can be tuned; give it one"
        )


def magnitudes_of(bench: Bench, laws: Sequence[str] = ()) -> Magnitudes:
    """Typical peaks of the response, medians over the motions, from i = 0 and the largest command.

    Those under the best constant command are found where one of the `laws` chooses among commands.
    """
    study = bench.study
    off, on = (
        bench.run("passive", [constant_candidate(study.problem.devices, share)]) for share in (0.0, 1.0)
    )
    constant = None
    if study.problem.reference_peaks is not None and any(SETTINGS[law].chooses_levels for law in laws):
        # Of the frame of the default model.
        constant = study.problem.reference_peaks(True)
    return magnitudes_of_runs(
        study.building, study.chosen_on, off, on, devices=study.devices, constant=constant
    )


def constant_candidate(devices: Sequence[Device], share: float) -> LawCandidate:
    """The passive law with a share of the largest command of each device."""
    commands = tuple(round_to(share * device.largest_command) for device in devices)
    alike = len({(device.largest_command, device.spec.command_unit) for device in devices}) == 1
    return LawCandidate({"command": commands[0] if alike else commands, LARGEST: largest_command(devices)})
