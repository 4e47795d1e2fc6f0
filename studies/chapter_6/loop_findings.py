"""Everything that the study measures, as nested dictionaries with text for keys."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mrwork.closed_loop import SCORE
from mrwork.control import control_laws
from studies.chapter_6.baselines import baselines
from studies.chapter_6.conditions import CONDITIONS, REFERENCE, cases, scores_under
from studies.chapter_6.identified_damper import identified_damper
from studies.chapter_6.published import QUANTITIES, PeakRow, causes, frequencies, motion_of, rounding, rows
from studies.chapter_6.thesis_findings import (
    CONSTANT,
    OFF,
    arrangements_found,
    constant_current,
    floors_found,
    sheets_found,
    worse_found,
)
from studies.chapter_6.tuning import Found, kept, search
from studies.common.frame import LARGEST_CURRENT, LEVELS, Bench, Figures, bench, figures, level_name

OnProgress = Callable[[str], None]
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


def tune(
    over: Bench, laws: Sequence[str], on_progress: OnProgress, *, near: bool = False
) -> dict[str, Found]:
    """Search the settings of laws, and of the ideal force with and without a limit.

    With `near`, the search starts from the settings that are kept instead of a grid.
    """
    found = {}
    before = kept() if near else {}
    for law in laws:
        on_progress(f"search: {law}")
        if law == "active_limited":
            limit = figures(over, constant_current(LARGEST_CURRENT)).peak_force[0]
            found[law] = search(
                over,
                "active",
                rng=_rng_of(law),
                start=before.get(law, ()),
                admitted=lambda tried, limit=limit: tried.peak_force <= limit,
            )
        else:
            found[law] = search(over, law, rng=_rng_of(law), start=before.get(law, ()))
    return found


def _rng_of(law: str) -> np.random.Generator:
    # A stream for each law: one more law leaves what is drawn for the others as it is.
    return np.random.default_rng([SEED, *law.encode()])


def five_storeys(over: Bench, on_progress: OnProgress, *, quick: bool) -> dict[str, dict[str, Any]]:
    """By label, figures at each level: constant currents, laws, baselines."""
    table: dict[str, dict[str, Any]] = {}
    currents = np.linspace(0.0, LARGEST_CURRENT, 48)
    constant = figures(over, constant_current(*currents))
    best = constant.score.argmin(axis=0)
    for label, places in {OFF: [0, 0], CONSTANT: best, "i_max": [-1, -1]}.items():
        table[label] = {
            level_name(level): _at(constant, int(places[number]), number)
            | {
                "says": f"{currents[int(places[number])]:.3g} A",
                "current": float(currents[int(places[number])]),
            }
            for number, level in enumerate(LEVELS)
        }
    for law, at_level in kept().items():
        if quick and law not in QUICK_LAWS:
            continue
        on_progress(f"table: {law}")
        found = scores_under(over, at_level, (REFERENCE,))[REFERENCE.name]
        table[law] = {
            level_name(level): _at(found[number], 0, number)
            | {"says": f"{at_level[number].largest_current:g} A at most"}
            for number, level in enumerate(LEVELS)
        }
    if not quick:
        on_progress("table: baselines")
        for each in baselines(over):
            table[each.label] = {
                level_name(level): _at(each.figures[number], 0, number) | {"says": each.says[number]}
                for number, level in enumerate(LEVELS)
            }
    return table


def loop_conditions(over: Bench, on_progress: OnProgress) -> dict[str, dict[str, Any]]:
    """By law and condition, the score at each level; and the largest change of one ratio."""
    names = [motion.name for motion in over.motions[: len(over.motions) // len(LEVELS)]]
    table: dict[str, dict[str, Any]] = {}
    for law, at_level in kept().items():
        if law in ACTIVE:
            continue
        on_progress(f"conditions: {law}")
        found = scores_under(over, at_level)
        table[law] = {}
        for condition in CONDITIONS:
            entry: dict[str, Any] = {}
            for number, level in enumerate(LEVELS):
                ratios = found[condition.name][number].ratios[0, number]
                change = np.abs(ratios - found[REFERENCE.name][number].ratios[0, number])
                record, criterion = np.unravel_index(change.argmax(), change.shape)
                entry[level_name(level)] = {
                    "score": float(ratios.mean()),
                    "largest_change": float(change.max()),
                    "of": f"{SCORE[int(criterion)]}, {names[int(record)]}",
                    "energy_error": float(found[condition.name][number].energy_error[0, number]),
                }
            table[law][condition.name] = entry
    return table


def found_by(*, quick: bool, records: Path, on_progress: OnProgress) -> dict[str, Any]:
    """Everything, as nested dictionaries with text for keys."""
    over = bench(records)
    motion = motion_of(records)
    on_progress("Dyke et al. 1996")
    found: dict[str, Any] = {
        "frequencies": {
            each.building: {
                "hertz": list(each.found),
                "stated": {str(mode): value for mode, value in each.stated.items()},
                "deviation": each.deviation,
            }
            for each in frequencies()
        },
        "dyke": {row.label: _peaks(row) for row in rows(motion)},
        "dyke_causes": {row.label: _peaks(row) for row in causes(motion)},
    }
    low, high = rounding(motion, 6 if quick else 100)
    found["dyke_rounding"] = {
        name: {"least": float(least), "most": float(most)}
        for name, least, most in zip(QUANTITIES, low, high, strict=False)
    }
    on_progress("faults")
    found["faults"] = {
        case.fault: {"outcome": case.outcome, "score": case.score}
        for case in cases(records, kept()["clipped_optimal"][-1])
    }
    found["five_storeys"] = five_storeys(over, on_progress, quick=quick)
    if not quick:
        found["conditions"] = loop_conditions(over, on_progress)
        on_progress("a million runs")
        ran = subprocess.run(
            [sys.executable, str(HERE / "million_runs.py")], check=True, capture_output=True, text=True
        )
        found["memory"] = json.loads(ran.stdout)
    found |= _thesis(over, found["five_storeys"][CONSTANT], on_progress, quick=quick)
    return found


def _thesis(over: Bench, best: dict[str, Any], on_progress: OnProgress, *, quick: bool) -> dict[str, Any]:
    """Sheets, every floor with its bands, and one-way dampers; `best` is the row of the best constant current."""
    found: dict[str, Any] = {}
    constants = tuple(best[level_name(level)]["current"] for level in LEVELS)
    on_progress("sheets, and dampers that push one way")
    found["sheets"] = sheets_found(over, constants, quick=quick)
    found["arrangements"] = arrangements_found(over, constants, quick=quick)
    on_progress("posterior of an identified damper")
    damper = identified_damper(
        _QUICK_DRAWS if quick else _DRAWS,
        most_steps=_QUICK_STEPS if quick else _MOST_STEPS,
        threads=over.threads,
    )
    found["identified"] = {"parameters": damper.found, "rms_n": damper.error, "draws": len(damper.theta)}
    on_progress("every floor, with bands")
    found["floors"] = floors_found(over, constants, damper.theta)
    found["worse"] = worse_found(found["floors"])
    if not quick:
        found["chain"] = {"status": damper.status, "steps": damper.n_steps}
    return found


def _at(found: Figures, candidate: int, level: int) -> dict[str, Any]:
    return {
        "score": float(found.score[candidate, level]),
        **{name: float(value) for name, value in zip(SCORE, found.parts[candidate, level], strict=True)},
        "mean_current": float(found.mean_current[candidate, level]),
        "peak_force": float(found.peak_force[candidate, level]),
        "stroke": float(found.stroke[candidate, level]),
        "energy_error": float(found.energy_error[candidate, level]),
    }


def _peaks(row: PeakRow) -> dict[str, Any]:
    names = QUANTITIES[: len(row.ours)]
    return {
        "ours": dict(zip(names, row.ours.tolist(), strict=True)),
        "published": dict(zip(names, row.published.tolist(), strict=True)),
        "deviation": dict(zip(names, row.deviations.tolist(), strict=True)),
        "largest": float(np.abs(row.deviations).max()),
        "energy_error": row.energy_error,
    }
