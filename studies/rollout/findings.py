"""Findings of a level: the laws, the rollout in wrong loops, its parts, a clairvoyant; and what the law costs."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import mrwork as mr
from mrwork.control import ControlLaw
from mrwork.dampers import flops_per_step
from studies.common.command import Say
from studies.common.scores import constant_commands
from studies.robust_control.findings import CLAIRVOYANT, clairvoyant_under
from studies.rollout.cases import CHANGES, LOOPS, Case, sensor_peaks
from studies.rollout.loop import SIXTEEN, TRAINING, Bench, Plant, strongest

_QUICK = ("observer, noise, 2 ms", "no forecast")
# The law tries 16 commands in steps of 2.5 ms of the classical Runge-Kutta method.
_TRIALS, _STEP, _STAGES = 16, 2.5e-3, 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Kept:
    """Results in a file, of a run that was ended and is continued."""

    file: Path | None
    known: dict[str, Any]

    def once(self, name: str, find: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """What is known by this name, or else found, and then known."""
        if name not in self.known:
            self.known[name] = find()
            if self.file is not None:
                self.file.write_text(json.dumps(self.known), encoding="utf-8")
        return self.known[name]


def kept_in(file: Path, *, resume: bool) -> Kept:
    """The results of a file, or none."""
    file.parent.mkdir(parents=True, exist_ok=True)
    return Kept(
        file=file, known=json.loads(file.read_text(encoding="utf-8")) if resume and file.is_file() else {}
    )


def level_found(
    level: str, bench: Bench, kept: Kept, *, quick: bool, clairvoyants: Iterable[str], say: Say
) -> dict[str, Any]:
    """Rows of a level, each found once."""

    def rows(kind: str, names: Iterable[str], find: Callable[[str], dict[str, Any]]) -> dict[str, Any]:
        found = {}
        for name in names:
            say(f"{level}, {kind}: {name}")
            found[name] = kept.once(f"{level}, {kind}: {name}", lambda name=name: find(name))
        return found

    laws = {each.row.label: each for each in bench.study.arrangements if each.devices}

    def law_row(name: str) -> dict[str, Any]:
        arrangement = laws[name]
        if arrangement.law is None:
            best = bench.best_constant(TRAINING)
            of = {group: bench.constants(group, Plant())[best] for group in bench.motions}
        else:
            assert isinstance(arrangement.law, ControlLaw)
            of = {
                group: bench.run(arrangement.law, group, Plant(), arrangement.devices)[0]
                for group in bench.motions
            }
        return {group: bench.judge(criteria, group, Plant()) for group, criteria in of.items()}

    def chosen(cases: Mapping[str, Case]) -> list[str]:
        return [name for name in cases if not quick or name in _QUICK]

    strong = strongest(bench)
    peaks = kept.once(f"{level}, sensors", lambda: sensor_peaks(bench))

    def row(case: Case, of: Bench) -> dict[str, Any]:
        plant = case.plant(peaks)
        return of.judge(of.run(case.law(bench), SIXTEEN, plant)[0], SIXTEEN, plant)

    found: dict[str, Any] = {
        "constant": kept.once(
            f"{level}, constant", lambda: {group: bench.constant(group) for group in bench.motions}
        ),
        "laws": rows("law", laws, law_row),
        "loops": rows("loop", chosen(LOOPS), lambda name: row(LOOPS[name], bench)),
        "changes": rows("change", chosen(CHANGES), lambda name: row(CHANGES[name], strong)),
    }
    if names := tuple(clairvoyants):
        found[CLAIRVOYANT] = rows("clairvoyant", names, lambda name: _clairvoyant(bench, name))
    return found


def _clairvoyant(bench: Bench, name: str) -> dict[str, Any]:
    """Scores under a motion: of the best constant command, the rollout and the best command history."""
    study = bench.study
    (motion,) = (each for each in study.grounds if each.name == name)
    under = _on(bench, motion)
    constants = under.constants(SIXTEEN, Plant())
    ours = under.run(Case().law(bench), SIXTEEN, Plant())[0, 0]
    return {
        "best constant": float((constants / constants[0]).mean(axis=(1, 2)).min()),
        "rollout": float((ours / constants[0, 0]).mean()),
        CLAIRVOYANT: clairvoyant_under(study, motion, bench.threads)[0],
    }


def cost_found(bench: Bench) -> dict[str, float]:
    """Decisions a second on one thread, of many loops in lanes and of one alone, and operations of a decision."""
    law, one = Case().law(bench), replace(bench, threads=1)
    hold = float(law.tables["timing"][0])
    motions = bench.motions[SIXTEEN]
    shortest = min(motions, key=lambda each: each.duration)
    together = _seconds(lambda: one.run(law, SIXTEEN, Plant()))
    alone = _seconds(lambda: _on(one, shortest).run(law, SIXTEEN, Plant()))
    without = _seconds(lambda: one.run(constant_commands([0.0]), SIXTEEN, Plant()))
    duration = sum(each.duration for each in motions)
    steps = duration * bench.study.hardware.steps / bench.study.hardware.sample_time
    return {
        "decisions_per_second": duration / hold / together,
        "microseconds": 1e6 * together * hold / duration,
        "milliseconds_alone": 1e3 * alone * hold / shortest.duration,
        "hold_ms": 1e3 * hold,
        "operations": _operations(bench, law),
        "lane_steps_per_second": steps / together,
        "lane_steps_per_second_without": steps / without,
        "candidate_s": together,
    }


def _on(bench: Bench, motion: mr.GroundMotion) -> Bench:
    """The bench with this motion alone in the place of the sixteen."""
    return bench.under({SIXTEEN: (motion,)})


def _seconds(run: Callable[[], object]) -> float:
    # Of the processor: others may use it, too.
    began = time.process_time()
    run()
    return time.process_time() - began


def _operations(bench: Bench, law: ControlLaw) -> float:
    """Multiplications and additions of a decision: entries of the matrices, and what a step of the damper counts."""
    building, (device,) = bench.study.building, bench.study.devices
    n = building.n_coordinates
    entries = np.count_nonzero(building.stiffness) + np.count_nonzero(building.damping)
    force = flops_per_step(device.spec.name, mr.damper(device.spec.name).nominal)
    # Of a stage: rows of the matrices and the mass, the force, two sums of the states; of a step: squares and peaks.
    stage = 2 * entries + 2 * n + force + 8 * n
    step = 8 * n
    steps = round(float(law.gains["horizon"][0]) / _STEP)
    return float(_TRIALS * steps * (_STAGES * stage + step))
