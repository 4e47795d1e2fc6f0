"""Families of devices tried, chosen and judged: settings by synthetic motions, results by others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import mrwork as mr
from mrwork.closed_loop import SCORE, History, Responses
from studies.chapter_2.device_closed_forms import closed_forms
from studies.chapter_2.device_families import FAMILIES, Family, Variant, column_height
from studies.former.arrays import Floats
from studies.former.command import Work
from studies.former.frame import (
    CHOOSING,
    FRAME,
    HARDWARE,
    JUDGING,
    actuator,
    idle,
    recorded_motions,
    score_criteria,
    score_ratios,
    synthetic_motions,
)

PEAK = 0.1
"""Peak of the ground motions [g]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """Elongation [m] and force [N] of a device over time under the first motion that judges."""

    deformation: Floats
    force: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """A family with its chosen settings: figures for the tables, its loop, and the scores of all settings."""

    figures: dict[str, Any]
    loop: Loop
    tried: list[tuple[dict[str, float], float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Chapter:
    """The families with their loops, and every figure of the study."""

    families: dict[str, Judged]
    found: dict[str, Any]


def chapter_of(work: Work) -> Chapter:
    """Work everything out; the quick form tries few settings under one short motion, and has no measured motions."""
    work.say("closed forms")
    forms = closed_forms()
    bench = _Bench(work)
    families = {}
    for family in FAMILIES:
        work.say(family.name)
        families[family.name] = bench.judged(family)
    length, leg = column_height()
    found = {
        "closed_forms": forms,
        "column": {"length_mm": 1e3 * length, "leg_mm": 1e3 * leg},
        "quick_families" if work.quick else "families": {
            name: judged.figures for name, judged in families.items()
        },
    }
    return Chapter(families=families, found=found)


class _Bench:
    """The frame under the motions that choose, those that judge, and measured ones."""

    def __init__(self, work: Work) -> None:
        self.work = work
        self.choosing = synthetic_motions(CHOOSING, PEAK, quick=work.quick)
        self.judging = {"synthetic": synthetic_motions(JUDGING, PEAK, quick=work.quick)}
        if work.records is not None and not work.quick:
            self.judging["measured"] = recorded_motions(work.records, PEAK)
        bare = Variant(settings={}, building=FRAME)
        self.bare = {
            id(motions): score_criteria(self._run(bare, motions))
            for motions in (self.choosing, *self.judging.values())
        }

    def judged(self, family: Family) -> Judged:
        """The settings with the least score under the motions that choose, judged under the others."""
        best: tuple[float, Variant, int] | None = None
        tried = []
        for variant in family.variants(self.work.quick):
            scores = self._ratios(self._run(variant, self.choosing), variant, self.choosing).mean(axis=(1, 2))
            row = int(scores.argmin())
            tried.append((variant.settings, float(scores[row])))
            if best is None or scores[row] < best[0]:
                best = (float(scores[row]), variant, row)
        assert best is not None, "every family has variants"
        score, variant, row = best
        chosen = _alone(variant, row)
        figures: dict[str, Any] = {
            "score": score,
            "settings": _settings(variant, row),
            "n_tried": len(tried) * max(1, len(variant.control_weights)),
        }
        loops = []
        for name, motions in self.judging.items():
            runs = self._run(chosen, motions, histories=True)
            loops += [_loop_of(history, chosen) for history in _histories(runs)]
            figures[name] = self._figures(runs, chosen, motions)
        return Judged(figures=figures, loop=loops[0], tried=tried)

    def _figures(self, runs: Responses, chosen: Variant, motions: list[mr.GroundMotion]) -> dict[str, float]:
        ratios = self._ratios(runs, chosen, motions)[0]
        histories = _histories(runs)
        loops = [_loop_of(history, chosen) for history in histories]
        # Power that the device takes from the frame [W].
        powers = [
            loop.force * np.gradient(loop.deformation, history.time)
            for loop, history in zip(loops, histories, strict=True)
        ]
        taken = [
            float(np.trapezoid(power, history.time)) / float(history.input_energy[-1])
            for power, history in zip(powers, histories, strict=True)
        ]
        commanded = chosen.device is not None
        return {
            "judged": float(ratios.mean()),
            **{name: float(value) for name, value in zip(SCORE, ratios.mean(axis=0), strict=True)},
            "worst_peak": float(ratios[:, :2].max()),
            "stroke_mm": 1e3 * max(float(np.abs(loop.deformation).max()) for loop in loops),
            "force_n": max(float(np.abs(loop.force).max()) for loop in loops),
            "energy_share": float(np.mean(taken)),
            "power_taken_w": max(float(power.max()) for power in powers),
            "power_given_w": max(0.0, -min(float(power.min()) for power in powers)),
            "rms_command": float(np.sqrt(np.mean(runs.rms_current[:, 0] ** 2))) if commanded else 0.0,
            "energy_error": float(runs.energy_error.max()),
        }

    def _ratios(self, runs: Responses, variant: Variant, motions: list[mr.GroundMotion]) -> Floats:
        """Ratios to the bare frame, shape (candidates, motions, criteria of the score)."""
        return score_ratios(runs, self.bare[id(motions)], variant.building)

    def _run(
        self, variant: Variant, motions: Sequence[mr.GroundMotion], *, histories: bool = False
    ) -> Responses:
        building = variant.building
        return mr.simulate_loop(
            building,
            [variant.device or actuator(building.storeys[0])],
            variant.law or idle(building),
            motions,
            HARDWARE,
            histories=histories,
            threads=self.work.threads,
        )


def _alone(variant: Variant, row: int) -> Variant:
    """The variant with one candidate of its law."""
    if variant.law is None:
        return variant
    gains = {name: np.atleast_2d(value)[row : row + 1] for name, value in variant.law.gains.items()}
    return replace(variant, law=mr.ControlLaw(name=variant.law.name, gains=gains))


def _settings(variant: Variant, row: int) -> dict[str, float]:
    weights = variant.control_weights
    return {**variant.settings, **({"control weight [1/N2]": weights[row]} if weights else {})}


def _histories(runs: Responses) -> tuple[History, ...]:
    assert runs.histories is not None
    return runs.histories


def _loop_of(history: History, variant: Variant) -> Loop:
    """The commanded device, or the passive one."""
    if variant.device is not None:
        return Loop(deformation=history.deformation[:, 0], force=history.force[:, 0])
    return Loop(deformation=history.element_deformation[:, 0], force=history.element_force[:, 0])
