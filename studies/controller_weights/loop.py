"""R scanned in the true loop: shapes of weights under four records, and the best of each under sixteen others."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mrwork.closed_loop import SCORE
from mrwork.control import (
    ControlLaw,
    DesignedWeights,
    SemiActiveCondition,
    design_weights,
    drifts,
    plant_of,
    regulator_of_outputs,
    stiffness_cases,
)
from mrwork.motions import GroundMotion
from studies.controller_weights.designs import limits_of
from studies.former.arrays import Floats
from studies.former.frame import FRAME, HARDWARE, RECORDS, pair, recorded_motions, scaled_records
from studies.former.scores import constant_commands, criteria

CURRENTS = {0.1: 1.2, 0.3: 1.88}
"""Largest current at each level [A], those of the tuned clipped-optimal law."""
BUDGETS = {0.1: 1500.0, 0.3: 1000.0}
"""Rms desired force for the default spectrum, of peaks about 0.3 g [N]: 500 N at 0.1 g and 1000 N at 0.3 g."""
SCALES = (10.0, 3.16, 1.0, 0.316, 0.1, 0.0316, 0.01, 1e-3, 1e-4)
"""Sizes of R over that of the design."""
EQUAL = (1e-10, 3.16e-11, 1e-11, 3.16e-12, 1e-12, 3.16e-13, 1e-13, 1e-14, 1e-15)
"""Sizes of R [1/N2] with a weight of 1/m2 on every drift."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Motions:
    """Motions of a level, and the criteria of i = 0 under each."""

    motions: list[GroundMotion]
    level: float
    threads: int

    def scores(self, law: ControlLaw) -> tuple[Floats, Floats]:
        """Score of each candidate and motion, and its four ratios, shapes (n, n_motions), (n, n_motions, 4)."""
        ratios = self._criteria(law) / self._criteria(constant_commands([0.0]))
        return ratios.mean(axis=-1), ratios

    def _criteria(self, law: ControlLaw) -> Floats:
        device = pair(CURRENTS[self.level])
        return criteria(FRAME, [device], law, self.motions, HARDWARE, threads=self.threads)


def shapes(level: float, *, quick: bool) -> dict[str, DesignedWeights]:
    """Designed weights by name."""
    limits = limits_of(FRAME)
    device, budget = FRAME.storeys[:1], BUDGETS[level]
    drift = {"rms_drift": limits["rms_drift"]}
    found = {"drift and acceleration": design_weights(FRAME, device, limits=limits, budget=budget)}
    if quick:
        return found
    conditions = {
        f"semi-active b = {share:g}": SemiActiveCondition(share=share) for share in (0.2, 0.1, 0.05)
    }
    return (
        found
        | {
            "drift": design_weights(FRAME, device, limits=drift, budget=budget),
            "both, stiffness +-25 %": design_weights(
                FRAME, device, limits=limits, budget=budget, cases=stiffness_cases(FRAME)
            ),
            "drift, semi-active b = 0.1": design_weights(
                FRAME, device, limits=drift, budget=budget, semi_active=SemiActiveCondition(share=0.1)
            ),
        }
        | {
            f"both, {name}": design_weights(
                FRAME, device, limits=limits, budget=budget, semi_active=condition
            )
            for name, condition in conditions.items()
        }
    )


def scanned(level: float, records: Path, *, quick: bool, threads: int) -> dict[str, dict[str, Any]]:
    """Each shape with R scanned under the four records, and the best, and R as designed, under the sixteen others."""
    plant = plant_of(FRAME, FRAME.storeys[:1])
    names = [title for title, _ in (RECORDS[1:2] if quick else RECORDS)]
    training = Motions(motions=recorded_motions(records, level, names=names), level=level, threads=threads)
    others = sorted((records / "real").glob("*.AT2"))
    test = (
        None
        if quick or not others
        else Motions(motions=scaled_records(others, level), level=level, threads=threads)
    )
    scales, equal = ((1.0, 0.1), EQUAL[::4]) if quick else (SCALES, EQUAL)
    gains = {
        "equal drift weights": (
            equal,
            [regulator_of_outputs(plant, drifts(plant), 1.0, R).gain for R in equal],
        )
    }
    for name, designed in shapes(level, quick=quick).items():
        gains[name] = (scales, [designed.gain_with(scale) for scale in scales])
    law = ControlLaw(
        name="clipped_optimal", gains={"gain": np.concatenate([np.array(each) for _, each in gains.values()])}
    )
    scores, _ = training.scores(law)
    found: dict[str, dict[str, Any]] = {"best constant current": _constant(training, test)}
    start = 0
    for name, (sizes, each) in gains.items():
        own = scores[start : start + len(sizes)].mean(axis=1)
        start += len(sizes)
        best = int(own.argmin())
        found[name] = {
            "scan": dict(zip((f"{size:.3g}" for size in sizes), own.tolist(), strict=True)),
            "as_designed": None if name == "equal drift weights" else float(own[sizes.index(1.0)]),
            "best": float(sizes[best]),
            "training": float(own[best]),
        }
        if test is not None:
            found[name] |= _on_test(
                test, ControlLaw(name="clipped_optimal", gains={"gain": np.array(each[best])[None]})
            )
    return found


def _constant(training: Motions, test: Motions | None) -> dict[str, Any]:
    commands = np.linspace(0.0, CURRENTS[training.level], 21)
    own = training.scores(constant_commands(commands))[0].mean(axis=1)
    best = int(own.argmin())
    found: dict[str, Any] = {"best": float(commands[best]), "training": float(own[best])}
    if test is not None:
        found |= _on_test(test, constant_commands(commands[best]))
    return found


def _on_test(test: Motions, law: ControlLaw) -> dict[str, Any]:
    """Score over the test motions with its standard deviation, and the mean of each ratio."""
    scores, ratios = test.scores(law)
    return {
        "test": float(scores[0].mean()),
        "test_spread": float(scores[0].std(ddof=1)),
        "test_parts": dict(zip(SCORE, ratios[0].mean(axis=0).tolist(), strict=True)),
    }
