"""Derivatives of the score of a law in its settings.

Derivatives of the loop in the gains are exact, by dual numbers; derivatives of the gains in the settings are
differences of designs. The score is composed by the code that composes it anywhere else, from results of runs that are
moved along their derivatives.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mrwork.base.values import Floats
from mrwork.closed_loop.evaluation import criterion
from mrwork.control.laws.control_law import ControlLaw, control_law, control_laws
from mrwork.control.laws.law_problem import DesignProblem
from mrwork.control.laws.law_settings import design_candidates, settings_of
from mrwork.errors import SettingError
from mrwork.study.loop_runs import REACH
from mrwork.study.schema import TuneTable
from mrwork.study.study import Study
from mrwork.tuning.problem import LawPlan
from mrwork.tuning.space import LARGEST, SHAPING_SPANS, FreeSetting

# Step of the differences of designs, of a value or of a place in its range: far above rounding, and short, because
# designs have kinks where another limit binds.
_STEP = 2e-4
_NODES = np.arange(-2.0, 3.0)


def without_gradient(study: Study, table: TuneTable) -> str:
    """Why the scores of a table have no gradients; empty if they have."""
    jumping = next((law for law in table.laws if control_law(law).switches), "")
    shaped = next((name for name in SHAPING_SPANS if name in (table.free or {})), "")
    counted = next((name for name in table.constraints or {} if criterion(name).counted), "")
    smooth = ", ".join(law.name for law in control_laws() if not law.switches)
    for excluded, sentence in (
        (jumping, f"{jumping} switches, so its score jumps and has no gradient; {smooth} have one"),
        (shaped, f"a command with a free {shaped} has no gradient; leave it out of free"),
        (counted, f"{counted} is a count, which has no gradient; limit command_travel instead"),
        (
            any(resolution for _, resolution in study.hardware.sensors),
            "sensors of a resolution round what they read, which has no gradient; leave the resolution out",
        ),
        (
            any(device.spec.own is not None for device in study.devices),
            "dampers of the core have gradients, and these are your own; tune without gradients",
        ),
    ):
        if excluded:
            return sentence
    return ""


def values_at(plan: LawPlan, units: Floats) -> Floats:
    """Penalised objectives at points of the unit cube, shape (n, n_free); infinite where a point makes no law."""
    candidates = [plan.space.candidate(unit, exact=True) for unit in units]
    return plan.bench.scores(plan.objective, plan.law, candidates).penalised_scores


def slopes_at(plan: LawPlan, unit: Floats) -> tuple[float, Floats]:
    """Penalised objective at a point, shape (n_free,), and its derivatives there.

    Where the settings make no law, or a run has no end, it is infinite, with derivatives of zero. A derivative is
    not a number where settings next to it make no law.
    """
    slopes = np.zeros(len(unit))
    try:
        problem, law, rows, _ = _move(plan, unit)
    except SettingError:
        return math.inf, slopes
    bench = plan.bench
    runs = bench.simulate(problem, law, changes=rows)
    values = plan.objective.scores(runs, bench.baselines).penalised_scores
    if not math.isfinite(values[0]):
        return math.inf, slopes
    with np.errstate(invalid="ignore"):
        slopes[_places(plan)] = (values[1::2] - values[2::2]) / (2.0 * REACH)
    return float(values[0]), slopes


def check_slopes(plan: LawPlan) -> None:
    """Refuse settings that act on more than gains, or make no law, at the point where a search begins."""
    *_, refusals = _move(plan, plan.space.start)
    for label, refusal in refusals.items():
        raise SettingError(f"{plan.law} has no gradient in {label}: {refusal}; hold that setting")


def _places(plan: LawPlan) -> list[int]:
    """Places of the settings with derivatives: all but the largest command."""
    return [index for index, setting in enumerate(plan.space.free) if setting.name != LARGEST]


def _move(plan: LawPlan, unit: Floats) -> tuple[DesignProblem, ControlLaw, Floats, dict[str, str]]:
    """A law, the change of its gains with each setting, (n, n_gains), and why settings next to one make no law."""
    space, name = plan.space, plan.law
    largest = space.candidate(unit, exact=True).largest_command
    problem = plan.bench.study.problem.limited_to(largest)
    points, weights = [unit], []
    for index in _places(plan):
        nodes, node_weights = _differences(space.free[index], float(unit[index]))
        weights.append(node_weights)
        points += [np.where(np.arange(len(unit)) == index, node, unit) for node in nodes]
    settings = [settings_of(name, space.candidate(point, exact=True).of_law) for point in points]
    designed = design_candidates(name, problem, settings)
    if 0 in designed.refusals:
        raise SettingError(f"{name} has no score here: {designed.refusals[0]}; choose other settings")
    assert designed.law is not None
    rows = designed.law.gain_rows(len(problem.devices), 2 * problem.building.n_coordinates)
    # A law without gains has one row.
    gains = np.full((len(points), rows.shape[1]), np.nan)
    gains[list(designed.designed)] = rows
    around = gains[1:].reshape(len(weights), len(_NODES), -1)
    labels = [space.free[index].label for index in _places(plan)]
    law = replace(
        designed.law, gains={gain: np.asarray(values)[:1] for gain, values in designed.law.gains.items()}
    )
    changes = np.einsum("kn,kng->kg", np.array(weights).reshape(len(weights), len(_NODES)), around)
    refusals = {labels[(number - 1) // len(_NODES)]: refusal for number, refusal in designed.refusals.items()}
    return problem, law, changes, refusals


def _differences(setting: FreeSetting, share: float) -> tuple[Floats, Floats]:
    """Five shares of the range of a setting around one, and the weights of the derivative there."""
    step = _STEP / max(1.0, math.log(setting.upper / setting.lower)) if setting.scale == "log" else _STEP
    shares = min(max(share, 2.0 * step), 1.0 - 2.0 * step) + step * _NODES
    powers = np.vander((shares - share) / step, increasing=True)
    return shares, np.linalg.solve(powers.T, np.eye(len(_NODES))[1]) / step
