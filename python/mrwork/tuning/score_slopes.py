"""Derivatives of the score of a law in its settings.

Those of the loop in the gains are exact, by dual numbers; those of the gains in the settings are differences of
designs. The score is composed of the results of runs by the code that composes it anywhere else, from results that are
moved along their derivatives.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from mrwork.base.values import Floats
from mrwork.closed_loop.evaluation import criterion
from mrwork.closed_loop.simulate import GainChanges
from mrwork.control.laws.control_law import ControlLaw, control_law, control_laws
from mrwork.control.laws.law_problem import DesignProblem
from mrwork.control.laws.law_settings import design_candidates, settings_of
from mrwork.errors import SettingError
from mrwork.study.schema import TuneTable
from mrwork.study.study import Study
from mrwork.tuning.problem import Bench, scores_of
from mrwork.tuning.space import LARGEST, SHAPING_SPANS, FreeSetting, SettingSpace, TuningObjective

# Step of the differences of designs: a change of a value by half a per cent, or of a place in its range.
_STEP = 5e-3
_NODES = np.arange(-2.0, 3.0)
# How far results are moved, in the unit of a range: far above rounding, far below what turns the order of two peaks.
_REACH = 1e-5


def without_gradient(study: Study, table: TuneTable) -> str:
    """Why the scores of a table have no gradients; empty if they have."""
    jumping = next((law for law in table.laws if control_law(law).switches), "")
    shaped = next((name for name in SHAPING_SPANS if name in (table.free or {})), "")
    counted = next((name for name in table.constraints or {} if criterion(name).counted), "")
    smooth = ", ".join(each.name for each in control_laws() if not each.switches)
    for excluded, sentence in (
        (jumping, f"{jumping} switches, so its score jumps and has no gradient; those of {smooth} have one"),
        (shaped, f"gradients are those of commands without a free {shaped}; hold it"),
        (counted, f"{counted} is a count, which has no gradient; limit command_travel instead"),
        (
            any(resolution for _, resolution in study.hardware.sensors),
            "sensors of a resolution round what they read, which has no gradient; leave the resolution out",
        ),
        (
            any(device.spec.own is not None for device in study.devices),
            "gradients are those of the dampers of the core, and these are your own; tune without gradients",
        ),
    ):
        if excluded:
            return sentence
    return ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScoreSlopes:
    """The score of a law on a bench with its derivatives in the free settings; the largest command stays."""

    space: SettingSpace
    bench: Bench
    objective: TuningObjective

    def at(self, unit: Floats) -> tuple[float, Floats]:
        """Penalised objective at a point of the unit cube, shape (n_free,), and its derivatives there.

        Where the settings make no law, or a run has no end, it is infinite, with derivatives of zero.
        """
        slopes = np.zeros(len(unit))
        try:
            problem, law, changes = self.design(unit)
        except SettingError:
            return math.inf, slopes
        runs = self.bench.run_moved(problem, law, GainChanges(rows=changes, reach=_REACH))
        values = scores_of(self.objective, runs, self.bench).penalised_scores
        if not math.isfinite(values[0]):
            return math.inf, slopes
        slopes[self._moved] = (values[1::2] - values[2::2]) / (2.0 * _REACH)
        return float(values[0]), slopes

    @property
    def _moved(self) -> list[int]:
        """Places of the settings with derivatives."""
        return [place for place, each in enumerate(self.space.free) if each.name != LARGEST]

    def design(self, unit: Floats) -> tuple[DesignProblem, ControlLaw, Floats]:
        """The law at a point, and the change of its gains with each setting but the largest command, (n, n_gains).

        Raises
        ------
        SettingError
            If settings there, or near by, make no law, or act on more than the gains.
        """
        moved = self._moved
        candidate, name = self.space.candidate(unit, exact=True), self.space.law
        problem = self.bench.problem.limited_to(candidate.largest_command)
        points, weights = [unit], []
        for place in moved:
            places, own = _differences(self.space.free[place], float(unit[place]))
            weights.append(own)
            for node in places:
                point = unit.copy()
                point[place] = node
                points.append(point)
        settings = [settings_of(name, self.space.candidate(point, exact=True).settings) for point in points]
        designed = design_candidates(name, problem, settings)
        for index, refusal in designed.refusals.items():
            label = self.space.free[moved[(index - 1) // len(_NODES)]].label
            raise SettingError(
                f"{name} has no gradient here{f', in {label}' if index else ''}: {refusal}; hold that setting"
            )
        assert designed.law is not None
        rows = designed.law.gain_rows(len(problem.devices), 2 * problem.building.n_coordinates)
        nodes = np.broadcast_to(rows, (len(points), rows.shape[1]))[1:].reshape(len(moved), len(_NODES), -1)
        first = {gain: np.asarray(value)[:1] for gain, value in designed.law.gains.items()}
        changes = np.einsum("kn,kng->kg", np.array(weights).reshape(len(moved), len(_NODES)), nodes)
        return problem, replace(designed.law, gains=first), changes


def _differences(setting: FreeSetting, place: float) -> tuple[Floats, Floats]:
    """Five places in the range of a setting around one, and the weights of the derivative there."""
    step = _STEP / max(1.0, math.log(setting.upper / setting.lower)) if setting.scale == "log" else _STEP
    places = min(max(place, 2.0 * step), 1.0 - 2.0 * step) + step * _NODES
    powers = np.vander((places - place) / step, increasing=True)
    return places, np.linalg.solve(powers.T, np.eye(len(_NODES))[1]) / step
