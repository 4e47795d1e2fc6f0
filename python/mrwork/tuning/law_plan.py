"""A law that is tuned: the bench that simulates its candidates in batches, their scores, and derivatives of these.

Derivatives of the loop in the gains are exact, by dual numbers; derivatives of the gains in the settings are
differences of designs. The score is composed by the code that composes it anywhere else, from results of runs that are
moved along their derivatives.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mrwork.base.summary import Summarised
from mrwork.base.values import Floats
from mrwork.closed_loop.evaluation import criterion
from mrwork.control.laws.control_law import ControlLaw, control_law, control_laws
from mrwork.control.laws.law_problem import NO_CERTIFICATE, DesignProblem
from mrwork.control.laws.law_settings import design_candidates, settings_of
from mrwork.errors import SettingError
from mrwork.store.codec import digest_of
from mrwork.store.long_call import LongCall
from mrwork.study.loop_case import REACH, LoopCase
from mrwork.study.runs import Runs, asks_for_weighted, candidate_axes, study_criteria
from mrwork.study.schema import TuneTable
from mrwork.study.study import Study
from mrwork.tuning.space import (
    LARGEST,
    SHAPING_SPANS,
    FreeSetting,
    LawCandidate,
    Scores,
    SettingSpace,
    TuningObjective,
)

# Step of the differences of designs, of a value or of a place in its range: far above rounding, and short, because
# designs have kinks where another limit binds.
_DESIGN_STEP = 2e-4
_NODES = np.arange(-2.0, 3.0)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Bench(Summarised):
    """A study, and the case under which candidates are simulated: its dampers under its training motions.

    `baselines` are the criteria under constant commands with the realisations of the case, by the kind of their row.
    """

    study: Study
    case: LoopCase
    call: LongCall[Any] = field(default_factory=LongCall)
    baselines: Mapping[str, Runs] = field(default_factory=dict)

    @property
    def n_realisations(self) -> int:
        """Number of realisations, 1 of the nominal study."""
        return 1 if self.case.realisations is None else len(self.case.realisations)

    def with_baselines(self, constants: Mapping[str, LawCandidate]) -> Bench:
        """The bench with the criteria under constant commands as baselines, from the journal if it has them."""
        candidates = [*constants.values()]
        inputs = digest_of(candidates, self.n_realisations)
        runs = self._empty(len(candidates)).recalled(
            self.call.journal, "baselines", inputs, lambda _: self.run("passive", candidates)
        )
        return replace(self, baselines={name: runs.of_row(row) for row, name in enumerate(constants)})

    def run(self, law: str, candidates: Sequence[LawCandidate]) -> Runs:
        """Criteria of candidates, none for those that make no law.

        Candidates whose largest commands differ are simulated together where the law sends a share of it. A single
        candidate is simulated as in a study, to the bit.
        """
        runs = self._empty(len(candidates))
        unlimited = all(math.isinf(candidate.shape[1]) for candidate in candidates)
        alike = control_law(law).sends_share and unlimited and not self.case.hardware.changes_command
        # The command of a history is that of the damper.
        together = alike and len(candidates) > 1 and not asks_for_weighted(self.case.asked)
        levels = [candidate.largest_command for candidate in candidates]
        for level in [math.inf] if together else dict.fromkeys(levels):
            members = [n for n, largest in enumerate(levels) if together or largest == level]
            problem = self.study.problem if together else self.study.problem.limited_to(level)
            designed = design_candidates(
                law, problem, [settings_of(law, candidates[n].of_law) for n in members]
            )
            if designed.law is None:
                continue
            places = [members[index] for index in designed.designed]
            shapes = np.array([candidates[n].shape for n in places])
            shaped = np.any(shapes != LawCandidate({}).shape)
            batch = self.case.under(designed.law, problem.all_devices).criteria(
                largest_commands=np.array(levels)[places] if together else None,
                shaping=shapes if shaped else None,
            )
            # A law without gains has one candidate, whatever the number of its settings.
            runs.outcome[places] = batch.outcome
            for name, array in batch.numbers.items():
                runs.numbers[name][places] = array
        return runs

    def _empty(self, n_candidates: int) -> Runs:
        axes = candidate_axes(n_candidates, self.case.motions, self.n_realisations)
        return Runs.empty(axes, study_criteria(self.study.command_unit, self.study.asked))


@dataclass(frozen=True, slots=True, kw_only=True)
class LawPlan:
    """A law to be tuned: its table, the space of its settings, and the bench and objective that score them.

    `firsts` are the candidates that are tried before a search.
    """

    table: TuneTable
    space: SettingSpace
    objective: TuningObjective
    bench: Bench
    firsts: tuple[LawCandidate, ...]

    @property
    def law(self) -> str:
        """Name of the law in the registry, such as `clipped_optimal`."""
        return self.space.law

    @property
    def label(self) -> str:
        """Label of the law among results."""
        return f"{control_law(self.law).title}, {self.table.label or 'tuned'}"

    def certificate(self, candidate: LawCandidate) -> str:
        """Stability certificate of the law with these settings, in words."""
        limited = self.bench.study.problem.limited_to(candidate.largest_command)
        try:
            return settings_of(self.law, candidate.of_law).certificate(limited)
        except SettingError:
            return NO_CERTIFICATE

    @property
    def moved(self) -> list[int]:
        """Indices of the free settings in which the score has derivatives: all but the largest command."""
        return [index for index, setting in enumerate(self.space.free) if setting.name != LARGEST]

    def scores(self, candidates: Sequence[LawCandidate], step: str = "") -> Scores:
        """The scores of candidates; of a `step`, from the journal if it has them."""

        def compute() -> Scores:
            return self.objective.scores(self.bench.run(self.law, candidates), self.bench.baselines)

        return self.bench.call.step(step, Scores, compute, self.law, candidates) if step else compute()

    def values(self, units: Floats, *, exact: bool = False) -> Floats:
        """Penalised objectives at points of the unit cube, (n, n_free); infinite where a point makes no law."""
        return self.scores([self.space.candidate(unit, exact=exact) for unit in units]).penalised_scores

    def slopes(self, unit: Floats) -> tuple[float, Floats]:
        """Penalised objective at a point of the unit cube, shape (n_free,), and its derivatives there.

        Where the settings make no law, or a run has no end, it is infinite, with derivatives of zero. A derivative is
        not a number where settings next to it make no law.
        """
        slopes = np.zeros(len(unit))
        try:
            problem, law, rows, _ = self._move(unit)
        except SettingError:
            return math.inf, slopes
        runs = self.bench.case.under(law, problem.all_devices).criteria(changes=rows)
        values = self.objective.scores(runs, self.bench.baselines).penalised_scores
        if not math.isfinite(values[0]):
            return math.inf, slopes
        with np.errstate(invalid="ignore"):
            slopes[self.moved] = (values[1::2] - values[2::2]) / (2.0 * REACH)
        return float(values[0]), slopes

    def check_slopes(self) -> None:
        """Refuse settings that act on more than gains, or make no law, at the point where a search begins."""
        *_, refusals = self._move(self.space.start)
        for label, refusal in refusals.items():
            raise SettingError(f"{self.law} has no gradient in {label}: {refusal}; hold that setting")

    def _move(self, unit: Floats) -> tuple[DesignProblem, ControlLaw, Floats, dict[str, str]]:
        """A law, the change of its gains with each setting, (n, n_gains), and why settings next to one make no law."""
        space, name, moved = self.space, self.law, self.moved
        weights = np.empty((len(moved), len(_NODES)))
        points = np.tile(unit, (1 + weights.size, 1))
        # A view, with the points around a setting in a row.
        around = points[1:].reshape(*weights.shape, -1)
        for row, index in enumerate(moved):
            nodes, weights[row] = _differences(space.free[index], float(unit[index]))
            around[row, :, index] = nodes
        candidates = [space.candidate(point, exact=True) for point in points]
        problem = self.bench.study.problem.limited_to(candidates[0].largest_command)
        settings = [settings_of(name, candidate.of_law) for candidate in candidates]
        designed = design_candidates(name, problem, settings)
        if 0 in designed.refusals:
            raise SettingError(f"{name} has no score here: {designed.refusals[0]}; choose other settings")
        assert designed.law is not None
        rows = designed.law.gain_rows(len(problem.devices), 2 * problem.building.n_coordinates)
        # A law without gains has one row.
        gains = np.full((len(points), rows.shape[1]), np.nan)
        gains[list(designed.designed)] = rows
        first = {gain: np.asarray(values)[:1] for gain, values in designed.law.gains.items()}
        changes = np.einsum("kn,kng->kg", weights, gains[1:].reshape(*weights.shape, -1))
        refusals = {
            space.free[moved[(number - 1) // len(_NODES)]].label: refusal
            for number, refusal in designed.refusals.items()
        }
        return problem, replace(designed.law, gains=first), changes, refusals


def _differences(setting: FreeSetting, share: float) -> tuple[Floats, Floats]:
    """Five shares of the range of a setting around one, and the weights of the derivative there."""
    step = (
        _DESIGN_STEP / max(1.0, math.log(setting.upper / setting.lower))
        if setting.scale == "log"
        else _DESIGN_STEP
    )
    shares = min(max(share, 2.0 * step), 1.0 - 2.0 * step) + step * _NODES
    powers = np.vander((shares - share) / step, increasing=True)
    return shares, np.linalg.solve(powers.T, np.eye(len(_NODES))[1]) / step


def without_gradient(study: Study, table: TuneTable) -> str:
    """Why the scores of a table have no gradients; empty if they have."""
    jumping = next((law for law in table.laws if control_law(law).switches), "")
    shaped = next((name for name in SHAPING_SPANS if name in (table.free or {})), "")
    counted = next((name for name in table.constraints or {} if criterion(name).counted), "")
    weighted = asks_for_weighted(table.judged_by)
    smooth = ", ".join(law.name for law in control_laws() if not law.switches)
    for excluded, sentence in (
        (jumping, f"{jumping} switches, so its score jumps and has no gradient; {smooth} have one"),
        (shaped, f"a command with a free {shaped} has no gradient; leave it out of free"),
        (counted, f"{counted} is a count, which has no gradient; limit command_travel instead"),
        (
            weighted,
            "weighted accelerations are from histories, which have no gradient; name rms_acceleration instead",
        ),
        (
            any(resolution for _, resolution in study.hardware.sensors),
            "sensors of a resolution round what they read, which has no gradient; leave the resolution out",
        ),
    ):
        if excluded:
            return sentence
    return ""


def check_controllable(study: Study) -> None:
    """Refuse a study of which no law can be tuned."""
    if not any(device.is_commanded and not device.is_actuator for device in study.devices):
        raise SettingError(
            f"study {study.title!r} has no damper that follows a command, so no law can be tuned; give it one"
        )
