"""The loop of a level: laws simulated under its motions and judged against i = 0 and the best constant command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import mrwork as mr
from mrwork.closed_loop import SCORE, Hardware
from mrwork.control import ControlLaw
from mrwork.motions import trimmed
from studies.former.arrays import Floats
from studies.former.scores import PEAKS, constant_commands, criteria
from studies.robust_control.tables import is_record

TRAINING, FOUR, SIXTEEN, UNSEEN = "training", "four", "sixteen", "unseen"
# Of the names of synthetic test motions, in the study file.
_OF_UNSEEN = "Unseen"
# A law that is nearly the constant command may be better by nothing that matters.
CLEARLY = 0.01
CONSTANTS = np.linspace(0.0, 1.88, 41)
"""Constant commands of which the best is chosen [A]."""
# Seconds of a motion in the quick form.
_SHORT = 6.0
# Seconds before and after the peak of a motion, where parts of the law are tried.
_STRONG = (4.0, 8.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plant:
    """The loop as it is: factors of the stiffness and of the damper force, and the hardware.

    Laws believe in the nominal building and damper.
    """

    stiffness: float = 1.0
    damper: float = 1.0
    hardware: Hardware = field(default_factory=Hardware)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bench:
    """A study with its motions in groups, and the runs of constant commands that laws are compared with."""

    study: mr.Study
    motions: dict[str, tuple[mr.GroundMotion, ...]]
    threads: int
    constants_by_plant: dict[tuple[float, float, str], Floats] = field(default_factory=dict)

    def under(self, motions: dict[str, tuple[mr.GroundMotion, ...]]) -> Bench:
        """The bench with other motions."""
        return replace(self, motions=motions, constants_by_plant={})

    def run(self, law: ControlLaw, group: str, plant: Plant, devices: Sequence[mr.Device] = ()) -> Floats:
        """The four criteria of the score under the motions of a group, shape (n_candidates, n_motions, 4)."""
        of = self.study.building
        return criteria(
            replace(of, stiffness=plant.stiffness * of.stiffness),
            [replace(each, count=plant.damper * each.count) for each in devices or self.study.devices],
            law,
            self.motions[group],
            plant.hardware,
            nominal=of if plant.hardware.feedback == "observer" else None,
            threads=self.threads,
        )

    def constants(self, group: str, plant: Plant) -> Floats:
        """Criteria of all constant commands, of which the first is i = 0, with true sensors."""
        key = plant.stiffness, plant.damper, group
        if key not in self.constants_by_plant:
            law = constant_commands(CONSTANTS)
            ideal = replace(plant, hardware=self.study.hardware)
            self.constants_by_plant[key] = self.run(law, group, ideal)
        return self.constants_by_plant[key]

    def best_constant(self, group: str) -> int:
        """Place of the constant command of the lowest score on a group, in the nominal loop."""
        found = self.constants(group, Plant())
        return int(np.argmin((found / found[0]).mean(axis=(1, 2))))

    def constant(self, group: str) -> dict[str, Any]:
        """The best constant command of a group, and its score."""
        best = self.best_constant(group)
        found = self.constants(group, Plant())
        return {"command": float(CONSTANTS[best]), **judged(found[best], found[0], found[best])}

    def judge(self, figures: Floats, group: str, plant: Plant) -> dict[str, Any]:
        """Figures of one candidate: the best constant command is that of the group in the nominal loop."""
        constants = self.constants(group, plant)
        return judged(figures, constants[0], constants[self.best_constant(group)])


def judged(figures: Floats, off: Floats, constant: Floats) -> dict[str, Any]:
    """Score over i = 0 and peaks over those of the constant command, of arrays of shape (n_motions, 4)."""
    ratios = figures / off
    chosen = [SCORE.index(name) for name in PEAKS]
    peaks = (figures / constant)[:, chosen]
    larger = peaks.max(axis=1)
    return {
        "score": float(ratios.mean()),
        "ratios": dict(zip(SCORE, ratios.mean(axis=0).tolist(), strict=True)),
        "larger": float(larger.mean()),
        "clearly": int((larger < 1.0 - CLEARLY).sum()),
        "both": int((larger < 1.0).sum()),
        "motions": len(larger),
    }


def bench_of(study: mr.Study, threads: int) -> Bench:
    """The bench of a study file."""
    test = [each.ground for each in study.motions if each.use == "test"]
    groups = {
        TRAINING: [each.ground for each in study.motions if each.use == "training"],
        FOUR: [each for each in test if is_record(each.name)],
        SIXTEEN: [each for each in test if not is_record(each.name) and not _is_unseen(each)],
        UNSEEN: [each for each in test if _is_unseen(each)],
    }
    return Bench(
        study=study,
        motions={name: tuple(group) for name, group in groups.items() if group},
        threads=threads,
    )


def _is_unseen(motion: mr.GroundMotion) -> bool:
    """Whether a motion is one of the synthetic ones that were made when the law had its settings."""
    return motion.name.startswith(_OF_UNSEEN)


def shortened(bench: Bench) -> Bench:
    """The first seconds of two motions of each group."""
    return bench.under(
        {
            name: tuple(trimmed(each, end=_SHORT) for each in group[:2])
            for name, group in bench.motions.items()
        }
    )


def strongest(bench: Bench) -> Bench:
    """The sixteen with some seconds before and after their peaks."""
    before, after = _STRONG

    def window(motion: mr.GroundMotion) -> mr.GroundMotion:
        peak = motion.dt * int(np.argmax(np.abs(motion.acceleration)))
        return trimmed(motion, start=peak - before, end=peak + after)

    return bench.under({SIXTEEN: tuple(map(window, bench.motions[SIXTEEN]))})
