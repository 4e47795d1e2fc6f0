"""The best constant command: levels from zero to the largest, of which the one with the lowest score is chosen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrwork.base.numbers import counted, round_to
from mrwork.base.summary import list_names
from mrwork.base.values import Floats
from mrwork.buildings.groups import largest_command
from mrwork.closed_loop.evaluation import searched
from mrwork.closed_loop.hardware import Hardware
from mrwork.control.laws.law_problem import ReferencePeaks
from mrwork.errors import SimulationError
from mrwork.motions import GroundMotion
from mrwork.study.loop_runs import OnBlock, simulate_criteria
from mrwork.study.realisations import nominal
from mrwork.study.runs import Runs
from mrwork.study.schema import PASSIVE_OFF, PASSIVE_ON
from mrwork.study.study import Arrangement, constant_command

LEVELS = 21
"""Number of constant commands, equally spaced from zero to the largest, among which the best is chosen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BestConstant:
    """Constant command with the lowest score, of those from i = 0 to the largest, with all scores and the runs.

    Without any score the command is 0.
    """

    command: float
    score: float
    scores: tuple[float, ...]
    runs: int

    def in_words(self, label: str, largest: float, unit: str) -> str:
        """The choice in a sentence, with the ends of the scan."""
        cost = f"{counted(self.runs, 'run')} in one batch"
        if math.isnan(self.score):
            return f"{label} is at i = 0: none of {len(self.scores)} constant commands has a score ({cost})."
        return (
            f"{label} is the best of {len(self.scores)} constant commands, score {self.score:.3f}: from {PASSIVE_OFF}, "
            f"0 {unit}, {self.scores[0]:.3f}, to {PASSIVE_ON}, {largest:.3g} {unit}, {self.scores[-1]:.3f} ({cost})."
        )


def levels_of(arrangement: Arrangement) -> Floats:
    """The constant commands of an arrangement that are tried."""
    return np.linspace(0.0, largest_command(arrangement.devices), LEVELS)


def scan_levels(
    arrangement: Arrangement,
    motions: Sequence[GroundMotion],
    hardware: Hardware,
    *,
    threads: int = 0,
    on_block: OnBlock | None = None,
) -> tuple[BestConstant, Runs]:
    """The best constant command on these motions, and the criteria under every level.

    A command has no score if one of its runs failed.
    """
    commands = levels_of(arrangement)
    runs = simulate_criteria(
        arrangement,
        constant_command(arrangement.devices, *commands),
        motions,
        hardware,
        nominal(arrangement.devices),
        bare=arrangement.building,
        threads=threads,
        on_block=on_block,
    )
    scores = runs.scores(runs.of_row(0)).mean(axis=(1, 2))
    best = int(np.argmin(searched(scores)))
    return BestConstant(
        command=float(commands[best]),
        score=float(scores[best]),
        scores=tuple(scores.tolist()),
        runs=runs.outcome.size,
    ), runs


def best_constant(
    arrangement: Arrangement,
    motions: Sequence[GroundMotion],
    hardware: Hardware,
    *,
    threads: int = 0,
    on_block: OnBlock | None = None,
) -> BestConstant:
    """The best constant command of an arrangement; without any score refused, but where the study has added the row."""
    best, _ = scan_levels(arrangement, motions, hardware, threads=threads, on_block=on_block)
    if math.isnan(best.score) and not arrangement.added:
        raise _without_score(arrangement, motions)
    return best


def reference_peaks_of(
    arrangement: Arrangement, motions: Sequence[GroundMotion], hardware: Hardware
) -> ReferencePeaks:
    """The best constant command of an arrangement on these motions, and the mean peaks under it, to four digits."""
    best, runs = scan_levels(arrangement, motions, hardware)
    if math.isnan(best.score):
        raise _without_score(arrangement, motions)
    level = best.scores.index(best.score)
    drift, acceleration = (
        round_to(float(runs.numbers[name][level].mean())) for name in ("peak_drift", "peak_acceleration")
    )
    return ReferencePeaks(command=round_to(best.command), drift=drift, acceleration=acceleration)


def _without_score(arrangement: Arrangement, motions: Sequence[GroundMotion]) -> SimulationError:
    return SimulationError(
        f"{arrangement.row.label}: no constant command has a score, because under "
        f"{list_names([ground.name for ground in motions])} the run at i = 0, or at every command, "
        "did not finish or has no response; check the dampers and the step, or leave best_passive out"
    )
