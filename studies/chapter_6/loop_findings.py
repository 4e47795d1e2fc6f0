"""Everything that the study measures, as nested dictionaries with text for keys."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mrwork.closed_loop import SCORE
from mrwork.control import control_laws
from studies.chapter_6.baselines import baselines
from studies.chapter_6.conditions import CONDITIONS, REFERENCE, cases, scores_under
from studies.chapter_6.identified_damper import identified_damper
from studies.chapter_6.published import QUANTITIES, causes, frequencies, motion_of, rounding, rows
from studies.chapter_6.thesis_findings import (
    CONSTANT,
    OFF,
    arrangements_found,
    floors_found,
    sheets_found,
    worse_found,
)
from studies.chapter_6.tuning import Found, kept, search
from studies.former.command import Say, Work
from studies.former.frame import (
    LARGEST_CURRENT,
    LEVELS,
    Bench,
    Figures,
    bench,
    figures,
    level_name,
)
from studies.former.scores import constant_commands

HERE = Path(__file__).parent
SEED = 6
# Functions of measured signals have no settings but learned numbers, which no grid finds. Laws of the measured
# acceleration are not of the thesis, and are compared in `studies/rollout`.
_OTHER_LAWS = (
    *("passive", "signal_network", "signal_polynomial", "active"),
    *("acceleration_driven", "mixed_skyhook", "predictive_rollout"),
)
TUNED_LAWS = tuple(spec.name for spec in control_laws() if spec.name not in _OTHER_LAWS)
ACTIVE = ("active", "active_limited")
"""The ideal force, without and with the limit of what the pair gives at its largest current."""
# Draws of the identified damper, and steps of the chain; the quick chain is far from converged.
_DRAWS, _MOST_STEPS = 60, 20_000
_QUICK_DRAWS, _QUICK_STEPS = 6, 30
QUICK_LAWS = ("clipped_optimal", "lyapunov_direct", "inverse_direct")


def tune(over: Bench, laws: Sequence[str], say: Say, *, near: bool = False) -> dict[str, Found]:
    """Search the settings of laws, and of the ideal force with and without a limit.

    With `near`, the search starts from the settings that are kept instead of a grid.
    """
    found = {}
    before = kept() if near else {}
    for law in laws:
        say(f"search: {law}")
        # A stream for each law: one more law leaves what is drawn for the others as it is.
        rng, start = np.random.default_rng([SEED, *law.encode()]), before.get(law, ())
        if law == "active_limited":
            limit = figures(over, constant_commands(LARGEST_CURRENT)).peak_force[0]
            found[law] = search(
                over,
                "active",
                rng=rng,
                start=start,
                admitted=lambda tried, limit=limit: tried.peak_force <= limit,
            )
        else:
            found[law] = search(over, law, rng=rng, start=start)
    return found


def five_storeys(over: Bench, work: Work) -> dict[str, dict[str, Any]]:
    """By label, figures at each level: constant currents, laws, baselines."""
    table: dict[str, dict[str, Any]] = {}
    currents = np.linspace(0.0, LARGEST_CURRENT, 48)
    constant = figures(over, constant_commands(currents))
    for label, places in {OFF: [0, 0], CONSTANT: constant.score.argmin(axis=0), "i_max": [-1, -1]}.items():
        chosen = [float(currents[place]) for place in places]
        table[label] = _at_levels(
            [constant] * len(LEVELS), [f"{current:.3g} A" for current in chosen], places
        )
        for level, current in zip(LEVELS, chosen, strict=True):
            table[label][level_name(level)]["current"] = current
    for law, at_level in kept().items():
        if not work.quick or law in QUICK_LAWS:
            work.say(f"table: {law}")
            found = scores_under(over, at_level, (REFERENCE,))[REFERENCE.name]
            table[law] = _at_levels(found, [f"{tuned.largest_current:g} A at most" for tuned in at_level])
    if not work.quick:
        work.say("table: baselines")
        for baseline in baselines(over):
            table[baseline.label] = _at_levels(baseline.figures, baseline.says)
    return table


def _at_levels(
    found: Sequence[Figures], says: Sequence[str], candidates: Sequence[int] = (0,) * len(LEVELS)
) -> dict[str, Any]:
    """By level, numbers of a candidate of the figures of that level."""
    numbers = {}
    for place, (level, figures_there, candidate) in enumerate(zip(LEVELS, found, candidates, strict=True)):
        at = (candidate, place)
        numbers[level_name(level)] = {
            "score": float(figures_there.score[at]),
            **{name: float(value) for name, value in zip(SCORE, figures_there.parts[at], strict=True)},
            **{
                name: float(getattr(figures_there, name)[at])
                for name in ("mean_current", "peak_force", "stroke", "energy_error")
            },
            "says": says[place],
        }
    return numbers


def loop_conditions(over: Bench, say: Say) -> dict[str, dict[str, Any]]:
    """By law and condition, the score at each level; and the largest change of one ratio."""
    names = [motion.name for motion in over.motions[: len(over.motions) // len(LEVELS)]]
    table: dict[str, dict[str, Any]] = {}
    for law, at_level in kept().items():
        if law in ACTIVE:
            continue
        say(f"conditions: {law}")
        found = scores_under(over, at_level)
        table[law] = {condition.name: {} for condition in CONDITIONS}
        for condition, entry in table[law].items():
            for number, level in enumerate(LEVELS):
                ratios = found[condition][number].ratios[0, number]
                change = np.abs(ratios - found[REFERENCE.name][number].ratios[0, number])
                record, criterion = np.unravel_index(change.argmax(), change.shape)
                entry[level_name(level)] = {
                    "score": float(ratios.mean()),
                    "largest_change": float(change.max()),
                    "of": f"{SCORE[int(criterion)]}, {names[int(record)]}",
                    "energy_error": float(found[condition][number].energy_error[0, number]),
                }
    return table


def found_by(work: Work) -> dict[str, Any]:
    """Everything, as nested dictionaries with text for keys; the measured records must be there."""
    assert work.records is not None
    over = bench(work.records)
    motion = motion_of(work.records)
    work.say("Dyke et al. 1996")
    found: dict[str, Any] = {
        "frequencies": frequencies(),
        "dyke": dict(rows(motion)),
        "dyke_causes": dict(causes(motion)),
    }
    low, high = rounding(motion, 6 if work.quick else 100)
    found["dyke_rounding"] = {
        name: {"least": float(least), "most": float(most)}
        for name, least, most in zip(QUANTITIES, low, high, strict=False)
    }
    work.say("faults")
    found["faults"] = dict(cases(work.records, kept()["clipped_optimal"][-1]))
    found["five_storeys"] = five_storeys(over, work)
    if not work.quick:
        found["conditions"] = loop_conditions(over, work.say)
        work.say("a million runs")
        ran = subprocess.run(
            [sys.executable, str(HERE / "million_runs.py")], check=True, capture_output=True, text=True
        )
        found["memory"] = json.loads(ran.stdout)
    return found | _thesis(over, found["five_storeys"][CONSTANT], work)


def _thesis(over: Bench, best: dict[str, Any], work: Work) -> dict[str, Any]:
    """Sheets, every floor with its bands, and one-way dampers; `best` is the row of the best constant current."""
    found: dict[str, Any] = {}
    constants = tuple(best[level_name(level)]["current"] for level in LEVELS)
    work.say("sheets, and dampers that push one way")
    found["sheets"] = sheets_found(over, constants, quick=work.quick)
    found["arrangements"] = arrangements_found(over, constants, quick=work.quick)
    work.say("posterior of an identified damper")
    n_draws, most_steps = (_QUICK_DRAWS, _QUICK_STEPS) if work.quick else (_DRAWS, _MOST_STEPS)
    damper = identified_damper(n_draws, most_steps=most_steps, threads=over.threads)
    found["identified"] = {"parameters": damper.found, "rms_n": damper.error, "draws": len(damper.theta)}
    work.say("every floor, with bands")
    found["floors"] = floors_found(over, constants, damper.theta)
    found["worse"] = worse_found(found["floors"])
    if not work.quick:
        found["chain"] = {"status": damper.status, "steps": damper.n_steps}
    return found
