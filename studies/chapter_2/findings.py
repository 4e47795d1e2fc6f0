"""Families of devices tried, chosen and judged: settings by synthetic motions, results by others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import mrwork as mr
from mrwork.buildings import Building
from mrwork.closed_loop import SCORE, STANDARD_GRAVITY, History, Responses
from mrwork.motions import read_motion, scaled_to_peak, trimmed
from studies.chapter_2.device_closed_forms import closed_forms
from studies.chapter_2.device_families import FAMILIES, Family, Variant, column_height
from studies.common.frame import FRAME, HARDWARE, LONGEST, RECORDS
from studies.common.records import ground_motions

Floats = NDArray[np.float64]

PEAK = 0.1
"""Peak of the ground motions [g]."""
CHOOSING, JUDGING = (1940, 1995), (1968, 1994)
"""Seeds of the motions that choose the settings, and of those that judge them."""
_DURATION = 20.0


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
    n_weights: int


def judged_families(*, quick: bool, threads: int, say: Callable[[str], None]) -> dict[str, Judged]:
    """Try and judge every family."""
    bench = _Bench(quick=quick, threads=threads)
    found = {}
    for family in FAMILIES:
        say(family.name)
        found[family.name] = bench.judged(family)
    return found


def measured_motions() -> list[mr.GroundMotion]:
    """The records of the benchmarks, where they are at hand."""
    folder = ground_motions()
    if not folder.is_dir():
        return []
    return [
        scaled_to_peak(trimmed(read_motion(folder / file), end=LONGEST), PEAK * STANDARD_GRAVITY)
        for _, file in RECORDS
    ]


class _Bench:
    """The frame under the motions that choose, those that judge, and measured ones."""

    def __init__(self, *, quick: bool, threads: int) -> None:
        self.quick, self.threads = quick, threads
        duration = 8.0 if quick else _DURATION
        self.choosing, synthetic = (
            [_motion(seed, duration) for seed in seeds[: 1 if quick else None]]
            for seeds in (CHOOSING, JUDGING)
        )
        measured = [] if quick else measured_motions()
        self.judging = {"synthetic": synthetic, **({"measured": measured} if measured else {})}
        bare = Variant(settings={}, building=FRAME)
        self.bare = {
            id(motions): _criteria(self._run(bare, motions), FRAME)
            for motions in (self.choosing, *self.judging.values())
        }

    def judged(self, family: Family) -> Judged:
        """The settings with the least score under the motions that choose, judged under the others."""
        best: tuple[float, Variant, int] | None = None
        tried = []
        for variant in family.variants(self.quick):
            scores = self._ratios(self._run(variant, self.choosing), variant, self.choosing).mean(axis=(1, 2))
            row = int(scores.argmin())
            tried.append((variant.settings, float(scores[row])))
            if best is None or scores[row] < best[0]:
                best = (float(scores[row]), variant, row)
        assert best is not None, "every family has variants"
        score, variant, row = best
        chosen = _alone(variant, row)
        figures: dict[str, Any] = {"score": score, "settings": _settings(variant, row)}
        loop: Loop | None = None
        for name, motions in self.judging.items():
            runs = self._run(chosen, motions, histories=True)
            figures[name] = self._figures(runs, chosen, motions)
            loop = loop or _loop_of(_histories(runs)[0], chosen)
        assert loop is not None
        return Judged(figures=figures, loop=loop, tried=tried, n_weights=len(variant.control_weights))

    def _figures(self, runs: Responses, chosen: Variant, motions: list[mr.GroundMotion]) -> dict[str, float]:
        ratios = self._ratios(runs, chosen, motions)[0]
        histories = _histories(runs)
        loops = [_loop_of(history, chosen) for history in histories]
        powers = [_power(loop, history) for loop, history in zip(loops, histories, strict=True)]
        taken = [
            float(np.trapezoid(power, history.time)) / float(history.input_energy[-1])
            for power, history in zip(powers, histories, strict=True)
        ]
        return {
            "judged": float(ratios.mean()),
            **{name: float(value) for name, value in zip(SCORE, ratios.mean(axis=0), strict=True)},
            "worst_peak": float(ratios[:, :2].max()),
            "stroke_mm": 1e3 * max(float(np.abs(loop.deformation).max()) for loop in loops),
            "force_n": max(float(np.abs(loop.force).max()) for loop in loops),
            "energy_share": float(np.mean(taken)),
            "power_taken_w": max(float(power.max()) for power in powers),
            "power_given_w": max(0.0, -min(float(power.min()) for power in powers)),
            "rms_command": float(np.sqrt(np.mean(runs.rms_current[:, 0] ** 2))) if chosen.devices else 0.0,
            "energy_error": float(runs.energy_error.max()),
        }

    def _ratios(self, runs: Responses, variant: Variant, motions: list[mr.GroundMotion]) -> Floats:
        """Ratios to the bare frame, shape (candidates, motions, criteria of the score)."""
        found = _criteria(runs, variant.building).reshape(-1, len(motions), len(SCORE))
        return np.asarray(np.where(np.isfinite(found), found / self.bare[id(motions)], np.inf))

    def _run(
        self, variant: Variant, motions: Sequence[mr.GroundMotion], *, histories: bool = False
    ) -> Responses:
        building = variant.building
        devices, law = variant.devices, variant.law
        if law is None:
            spec = mr.damper("dahl")
            row = building.storeys[0]
            devices = (mr.Device(name="none", spec=spec, theta=spec.nominal, row=row, largest_command=1.0),)
            still = np.zeros((1, 2 * building.n_coordinates))
            law = mr.ControlLaw(name="active", gains={"gain": still})
        return mr.simulate_loop(
            building, devices, law, motions, HARDWARE, histories=histories, threads=self.threads
        )


def _criteria(runs: Responses, building: Building) -> Floats:
    """Peak drift, peak acceleration and their rms on the floors and storeys of the frame, shape (runs, 4)."""
    floors = [building.floor_names.index(name) for name in FRAME.floor_names]
    storeys = [building.storey_names.index(name) for name in FRAME.storey_names]
    return np.stack(
        [getattr(runs, name)[:, storeys if name.endswith("drift") else floors].max(axis=1) for name in SCORE],
        axis=1,
    )


def _alone(variant: Variant, row: int) -> Variant:
    """The variant with one candidate of its law."""
    if variant.law is None:
        return variant
    gains = {name: np.atleast_2d(value)[row : row + 1] for name, value in variant.law.gains.items()}
    return Variant(
        settings=variant.settings,
        building=variant.building,
        devices=variant.devices,
        law=mr.ControlLaw(name=variant.law.name, gains=gains),
    )


def _settings(variant: Variant, row: int) -> dict[str, float]:
    weights = variant.control_weights
    return {**variant.settings, **({"control weight [1/N2]": weights[row]} if weights else {})}


def _histories(runs: Responses) -> tuple[History, ...]:
    assert runs.histories is not None
    return runs.histories


def _loop_of(history: History, variant: Variant) -> Loop:
    """The commanded device, or the passive one."""
    if variant.devices:
        return Loop(deformation=history.deformation[:, 0], force=history.force[:, 0])
    return Loop(deformation=history.element_deformation[:, 0], force=history.element_force[:, 0])


def _power(loop: Loop, history: History) -> Floats:
    """Power that a device takes from the frame [W]."""
    return np.asarray(loop.force * np.gradient(loop.deformation, history.time))


def _motion(seed: int, duration: float) -> mr.GroundMotion:
    """A draw of the Clough-Penzien spectrum of firm soil."""
    drawn = mr.synthetic_motion(rng=seed, duration=duration, name=f"seed {seed}")
    return scaled_to_peak(drawn, PEAK * STANDARD_GRAVITY)


@dataclass(frozen=True, slots=True, kw_only=True)
class Chapter:
    """The families with their loops, and every figure of the study."""

    families: dict[str, Judged]
    found: dict[str, Any]


def chapter_of(*, quick: bool, threads: int, say: Callable[[str], None]) -> Chapter:
    """Work everything out; the quick form tries few settings under one short motion."""
    say("closed forms")
    forms = {
        name: {"loop": each.loop, "formula": each.formula, "deviation": each.deviation, "says": each.says}
        for name, each in closed_forms().items()
    }
    families = judged_families(quick=quick, threads=threads, say=say)
    figures = {
        name: {**each.figures, "n_tried": len(each.tried) * max(1, each.n_weights)}
        for name, each in families.items()
    }
    length, leg = column_height()
    found = {
        "closed_forms": forms,
        "column": {"length_mm": 1e3 * length, "leg_mm": 1e3 * leg},
        "quick_families" if quick else "families": figures,
    }
    return Chapter(families=families, found=found)
