"""Tests under earthquakes without and with control: laws with settings from the identified rig, and their figures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import mrwork as mr
from mrwork.control import DesignProblem, RegulatorSettings, design_law
from studies.chapter_7.earthquakes import LEAD
from studies.chapter_7.virtual_rig import LARGEST_CURRENT, NO_DAMPER, Rig, Signals, signals_of
from studies.former.command import Work
from studies.former.scores import constant_commands

NO_DAMPER_NAME, OFF, HALF, BEST, CLIPPED, LYAPUNOV = (
    "no damper",
    "i = 0",
    "0.25 A",
    "best constant",
    "clipped-optimal",
    "Lyapunov",
)
QUANTITIES = ("peak displacement", "rms displacement", "peak acceleration", "rms acceleration")
"""Of the frame: relative displacement [mm] and absolute acceleration [m/s^2]; the score is the mean of their ratios."""
FORCES = ("peak force", "rms force")
"""Of the damper [N]."""
NOISE_RATIOS = (50.0, 5e2, 5e3, 5e4, 5e5)
"""Tried ratios S_ag/S_v of the observer; the literature has the first."""
WEIGHTS = tuple(np.geomspace(1e-11, 1e-5, 7).tolist())
"""Tried weights of the force in the regulator [1/N^2]; its drift has the weight of the frame's energy."""
CURRENTS = tuple(np.linspace(0.0, LARGEST_CURRENT, 11).tolist())
"""Tried constant currents [A]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A way to run the damper: its law, and the noise ratio of its observer."""

    law: mr.ControlLaw
    noise_ratio: float = NOISE_RATIOS[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """The cases, and what was tried for them: scores on the choosing motions by setting."""

    cases: dict[str, Case]
    chosen: dict[str, Any]


def chosen_on(rig: Rig, motions: list[mr.GroundMotion], work: Work) -> Choice:
    """Choose current, weight and observer on a rig, the identified one, under motions that judge nothing."""
    off = Case(law=constant_commands(0.0))

    def figures_under(case: Case) -> list[dict[str, float]]:
        return [figures(run) for run in case_signals(rig, case, motions, rig.frame, threads=work.threads)]

    passive = figures_under(off)
    problem = DesignProblem(
        building=rig.frame,
        devices=[rig.damper],
        sample_time=rig.hardware.sample_time,
        delay=rig.hardware.delay,
    )
    lyapunov = design_law("lyapunov", problem, {})
    weights = WEIGHTS[::2] if work.quick else WEIGHTS
    ratios = NOISE_RATIOS[::3] if work.quick else NOISE_RATIOS
    candidates: dict[str, dict[str, Case]] = {
        BEST: {f"{current:g} A": Case(law=constant_commands(current)) for current in CURRENTS},
        CLIPPED: {
            f"R {weight:.0e}, ratio {ratio:g}": Case(
                law=design_law("clipped_optimal", problem, RegulatorSettings(control_weight=weight)),
                noise_ratio=ratio,
            )
            for weight in weights
            for ratio in ratios
        },
        LYAPUNOV: {f"ratio {ratio:g}": Case(law=lyapunov, noise_ratio=ratio) for ratio in ratios},
    }
    cases = {NO_DAMPER_NAME: Case(law=NO_DAMPER), OFF: off, HALF: Case(law=constant_commands(0.25))}
    chosen = {}
    for name, by_setting in candidates.items():
        tried = {setting: mean_score(figures_under(case), passive) for setting, case in by_setting.items()}
        best = min(tried, key=lambda setting: tried[setting])
        cases[name] = by_setting[best]
        chosen[name] = {"setting": best, "score": tried[best], "tried": tried}
    return Choice(cases=cases, chosen=chosen)


def case_signals(
    rig: Rig,
    case: Case,
    motions: list[mr.GroundMotion],
    observer_frame: mr.Building,
    *,
    threads: int,
) -> list[Signals]:
    """Signals of a case under each motion."""
    hardware = replace(rig.hardware, noise_ratio=case.noise_ratio)
    return signals_of(
        replace(rig, hardware=hardware), case.law, motions, observer_frame=observer_frame, threads=threads
    )


def figures(signals: Signals) -> dict[str, float]:
    """Peaks and rms from the end of the lead on, by quantity; mean current, and that before the motion [A]."""
    part = signals.part(round(LEAD / signals.step), signals.time.size)
    found = {}
    for name, values, factor in (
        ("displacement", part.displacement, 1e3),
        ("acceleration", part.acceleration, 1.0),
        ("force", part.force, 1.0),
    ):
        found[f"peak {name}"] = factor * float(np.abs(values).max())
        found[f"rms {name}"] = factor * float(np.sqrt(np.mean(values**2)))
    found["mean current"] = float(part.current.mean())
    # Once the current is settled.
    still = signals.part(round(0.5 * LEAD / signals.step), round(LEAD / signals.step))
    found["current at rest"] = float(still.current.mean())
    return found


def mean_score(runs: list[dict[str, float]], passive: list[dict[str, float]]) -> float:
    """Mean of the four ratios to i = 0, over the motions."""
    scores = [
        float(np.mean([run[name] / off[name] for name in QUANTITIES]))
        for run, off in zip(runs, passive, strict=True)
    ]
    return float(np.mean(scores))


Tests = dict[str, dict[str, Signals]]
"""Signals by case and record."""


def controlled_tests(
    rig: Rig,
    choice: Choice,
    motions: list[mr.GroundMotion],
    observer_frame: mr.Building,
    *,
    threads: int,
    seen: Callable[[Signals], Signals] = lambda signals: signals,
) -> Tests:
    """Every case under every motion, as the sensors `seen` have it."""
    return {
        name: {
            motion.name: seen(signals)
            for motion, signals in zip(
                motions, case_signals(rig, case, motions, observer_frame, threads=threads), strict=True
            )
        }
        for name, case in choice.cases.items()
    }


def figures_of(measured: Tests) -> dict[str, Any]:
    """Figures of each case and record, ratios to i = 0, scores, and who is best in what."""
    each = {name: {record: figures(run) for record, run in runs.items()} for name, runs in measured.items()}
    ratios = {
        name: {
            quantity: float(
                np.mean([run[quantity] / each[OFF][record][quantity] for record, run in runs.items()])
            )
            for quantity in QUANTITIES
        }
        for name, runs in each.items()
    }
    wins = {
        law: sum(
            each[law][record][quantity] < each[BEST][record][quantity]
            for record in each[law]
            for quantity in QUANTITIES
        )
        for law in (CLIPPED, LYAPUNOV)
    }
    return {
        "each": each,
        "ratios": ratios,
        "score": {name: float(np.mean(list(parts.values()))) for name, parts in ratios.items()},
        "better_than_best_constant": wins,
        "comparisons": len(QUANTITIES) * len(each[OFF]),
    }


def constant_sweep(
    rig: Rig, motions: list[mr.GroundMotion], currents: list[float], *, threads: int
) -> dict[str, list[float]]:
    """Scores of constant currents on a rig, also beyond the driver of the tests: the mean over the motions."""
    wide = replace(rig, damper=replace(rig.damper, largest_command=max(currents)))
    by_current = [
        [
            figures(run)
            for run in case_signals(
                wide, Case(law=constant_commands(current)), motions, rig.frame, threads=threads
            )
        ]
        for current in currents
    ]
    return {
        "currents": currents,
        "scores": [mean_score(runs, by_current[0]) for runs in by_current],
    }
