"""Findings of a level: the laws, the rollout in wrong loops, its parts, a clairvoyant; and what the law costs."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import mrwork as mr
from mrwork.control import ControlLaw
from mrwork.dampers import flops_per_step
from studies.former.command import Say
from studies.former.pieces import results_of
from studies.former.scores import constant_commands
from studies.robust_control.findings import CLAIRVOYANT, clairvoyant_under, loop_of
from studies.rollout.cases import CHANGES, LOOPS, Case, reference_peaks, sensor_peaks
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
    """Rows of a level, each found once; workers do a row each."""
    peaks = kept.once(f"{level}, sensors", lambda: sensor_peaks(bench))
    constant = kept.once(
        f"{level}, constant", lambda: {group: bench.constant(group) for group in bench.motions}
    )

    def rows(kind: str, names: Iterable[str], row: Callable[[_Level, str], dict[str, Any]]) -> dict[str, Any]:
        steps = {name: f"{level}, {kind}: {name}" for name in names}
        missing = [(name,) for name, step in steps.items() if step not in kept.known]
        made = results_of(_Level.of, row, (_sent(bench), peaks), missing)
        found = {}
        for name, step in steps.items():
            say(step)
            found[name] = kept.once(step, lambda: next(made))
        return found

    def chosen(cases: Mapping[str, Case]) -> list[str]:
        return [name for name in cases if not quick or name in _QUICK]

    found: dict[str, Any] = {
        "constant": constant,
        "laws": rows("law", _laws(bench), _Level.law),
        "loops": rows("loop", chosen(LOOPS), _Level.loop),
        "changes": rows("change", chosen(CHANGES), _Level.change),
    }
    if names := tuple(clairvoyants):
        found[CLAIRVOYANT] = rows("clairvoyant", names, _Level.clairvoyant)
    return found


def _laws(bench: Bench) -> dict[str, Any]:
    """Arrangements with devices, by the labels of their rows."""
    return {each.row.label: each for each in bench.study.arrangements if each.devices}


def _sent(bench: Bench) -> Bench:
    """The bench as workers are sent it: with the reference peaks themselves, and one thread."""
    if mr.present_workers() is None:
        return bench
    study = bench.study
    assert study.problem is not None
    problem = replace(study.problem, reference_peaks=partial(replace, reference_peaks(bench)))
    return replace(bench, study=replace(study, problem=problem, placed=None), threads=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Level:
    """What the rows of a level share: its bench, that of the strong seconds, and the peaks that its sensors measure."""

    bench: Bench
    strong: Bench
    peaks: Mapping[str, float]

    @classmethod
    def of(cls, sent: tuple[Bench, Mapping[str, float]]) -> _Level:
        bench, peaks = sent
        return cls(bench=bench, strong=strongest(bench), peaks=peaks)

    def law(self, name: str) -> dict[str, Any]:
        """A law of the study under all groups of motions."""
        bench, arrangement = self.bench, _laws(self.bench)[name]
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

    def loop(self, name: str) -> dict[str, Any]:
        """The rollout in a wrong loop."""
        return self._case(LOOPS[name], self.bench)

    def change(self, name: str) -> dict[str, Any]:
        """The strong seconds after a change of one thing."""
        return self._case(CHANGES[name], self.strong)

    def _case(self, case: Case, of: Bench) -> dict[str, Any]:
        plant = case.plant(self.peaks)
        return of.judge(of.run(case.law(self.bench), SIXTEEN, plant)[0], SIXTEEN, plant)

    def clairvoyant(self, name: str) -> dict[str, Any]:
        """Scores under a motion: of the best constant command, the rollout and the best command history."""
        study = self.bench.study
        (motion,) = (each for each in study.grounds if each.name == name)
        under = _on(self.bench, motion)
        constants = under.constants(SIXTEEN, Plant())
        ours = under.run(Case().law(self.bench), SIXTEEN, Plant())[0, 0]
        return {
            "best constant": float((constants / constants[0]).mean(axis=(1, 2)).min()),
            "rollout": float((ours / constants[0, 0]).mean()),
            CLAIRVOYANT: clairvoyant_under(loop_of(study), motion, self.bench.threads)[0],
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
