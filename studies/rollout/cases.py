"""What is changed about the rollout and its loop: wrong models, sensors and delay; and its parts one by one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import mrwork as mr
from mrwork.closed_loop import Hardware
from mrwork.control import ControlLaw, DesignProblem, ReferencePeaks, RolloutSettings, design_law
from studies.former.scores import constant_commands
from studies.rollout.loop import TRAINING, Bench, Plant

LAW = "predictive_rollout"
NOISE = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """The law with other settings, or with some of its trials alone.

    `scaled` are settings that are multiplied; `levels` are the shares of the largest command that are tried, `tails`
    how many of the three commands that follow them.
    """

    settings: Mapping[str, Any] = field(default_factory=dict)
    scaled: Mapping[str, float] = field(default_factory=dict)
    levels: tuple[float, ...] = ()
    tails: int = 3

    def law(self, problem: DesignProblem, peaks: ReferencePeaks) -> ControlLaw:
        """The law; a trial that is left out repeats another, which changes nothing."""
        own = {"base": peaks.command, "drift": peaks.drift, "acceleration": peaks.acceleration}
        own |= {name: factor * own[name] for name, factor in self.scaled.items()}
        own["base"] = min(own["base"], *(device.largest_command for device in problem.devices))
        law = design_law(LAW, problem, RolloutSettings(**{**own, **self.settings}))
        gains = dict(law.gains)
        if self.levels:
            levels = np.resize(self.levels, np.shape(gains["levels"])[-1])
            gains["levels"] = np.array([levels * device.largest_command for device in problem.devices])
        for number in range(self.tails - 1, 2):
            gains["tails"] = np.array(gains["tails"])
            gains["tails"][..., number] = np.asarray(gains["base"])
        return replace(law, gains=gains)


PARTS = {
    "no forecast": Part(settings={"forecast": "zero"}),
    "order 1": Part(settings={"order": 1}),
    "order 8": Part(settings={"order": 8}),
    "horizon 0.12 s": Part(settings={"horizon": 0.12}),
    "horizon 0.18 s": Part(settings={"horizon": 0.18}),
    "horizon 0.34 s": Part(settings={"horizon": 0.34}),
    "decision every 5 ms": Part(settings={"decision": 5e-3}),
    "decision every 20 ms": Part(settings={"decision": 2e-2}),
    "nothing and the largest before the base, 3 trials": Part(levels=(0.0, 1.0), tails=1),
    "the base as the only tail, 6 trials": Part(tails=1),
    "three levels, 10 trials": Part(levels=(0.0, 0.213, 1.0)),
    "base halved": Part(scaled={"base": 0.5}),
    "base doubled, at most the largest": Part(scaled={"base": 2.0}),
    "mean squares alone": Part(settings={"peak_weight": 0.0}),
    "no energy at the horizon": Part(settings={"energy_weight": 0.0}),
    "A / 1.5": Part(scaled={"acceleration": 1.0 / 1.5}),
    "A x 1.5": Part(scaled={"acceleration": 1.5}),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A law in a loop that differs from the nominal one in stiffness, damper force, sensors and delay [s].

    `noise` is the standard deviation of every sensor over the mean peak of what it measures, `preview` the time for
    which the ground acceleration is known ahead [s].
    """

    part: Part = field(default_factory=Part)
    stiffness: float = 1.0
    damper: float = 1.0
    delay: float = 0.0
    observer: bool = False
    known_ground: bool = True
    noise: float = 0.0
    preview: float = 0.0

    def plant(self, peaks: Mapping[str, float]) -> Plant:
        """The loop, with noise in proportion to these peaks."""
        sensors = {f"{name}_noise": self.noise * peak for name, peak in peaks.items() if self.noise}
        feedback = {"feedback": "observer", "known_ground": self.known_ground} if self.observer else {}
        hardware = Hardware(delay=self.delay, ground_preview=self.preview, **feedback, **sensors)
        return Plant(stiffness=self.stiffness, damper=self.damper, hardware=hardware)

    def law(self, bench: Bench) -> ControlLaw:
        """The law for the nominal building and dampers, at the delay of the loop."""
        problem = bench.study.problem
        assert problem is not None
        return self.part.law(replace(problem, delay=self.delay), reference_peaks(bench))


_OBSERVED = {"observer": True, "noise": NOISE}
_ALL = {**_OBSERVED, "stiffness": 0.9, "damper": 0.85, "delay": 5e-3}
LOOPS = {
    "observer, noise, 2 ms": Case(**_OBSERVED, delay=2e-3),
    "observer, noise, 5 ms": Case(**_OBSERVED, delay=5e-3),
    "observer that estimates the ground, noise, 2 ms": Case(**_OBSERVED, delay=2e-3, known_ground=False),
    "all: stiffness - 10 %, force - 15 %, observer, noise, 5 ms": Case(**_ALL),
    "all, force corrected": Case(**_ALL, part=Part(settings={"force_correction": 1.0})),
}
"""Loops in which whole motions are simulated."""
CHANGES = {
    "the law": Case(),
    "stiffness - 10 %": Case(stiffness=0.9),
    "stiffness + 10 %": Case(stiffness=1.1),
    "damper force - 15 %": Case(damper=0.85),
    "delay of 2 ms": Case(delay=2e-3),
    "delay of 5 ms": Case(delay=5e-3),
    **{f"ground known for {ahead} ms": Case(preview=1e-3 * ahead) for ahead in (25, 50, 100, 200)},
    **{name: Case(part=part) for name, part in PARTS.items()},
}
"""Changes of one thing, in true state, of which the strong seconds are simulated."""


def sensor_peaks(bench: Bench) -> dict[str, float]:
    """Mean peaks of what the sensors measure on the training motions, under their best constant command."""
    study = bench.study
    law = constant_commands(reference_peaks(bench).command)
    motions = bench.motions[TRAINING]
    found = mr.simulate_loop(
        study.building, study.devices, law, motions, study.hardware, threads=bench.threads
    )
    return {
        "acceleration": float(found.peak_acceleration.max(axis=1).mean()),
        "deformation": float(found.peak_stroke.mean()),
        "force": float(found.peak_force.mean()),
        "ground_acceleration": float(np.mean([each.peak for each in motions])),
    }


def reference_peaks(bench: Bench) -> ReferencePeaks:
    """The best constant command of the training motions, and the peaks under it."""
    problem = bench.study.problem
    assert problem is not None
    assert problem.reference_peaks is not None
    return problem.reference_peaks()
