"""The best constant commands: levels from zero to the largest of all dampers together, and then of each group alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from mrwork.base.numbers import counted, round_to
from mrwork.base.summary import list_names
from mrwork.base.values import Floats
from mrwork.buildings.groups import commanded, products_of
from mrwork.buildings.matrices import Device
from mrwork.closed_loop.evaluation import searched
from mrwork.closed_loop.hardware import Hardware
from mrwork.control.laws.law_problem import ReferencePeaks
from mrwork.errors import SimulationError
from mrwork.motions import GroundMotion
from mrwork.store.long_call import LongCall
from mrwork.study.loop_runs import OnBlock, simulate_criteria
from mrwork.study.runs import Runs
from mrwork.study.schema import PASSIVE_OFF, PASSIVE_ON
from mrwork.study.study import Arrangement, constant_commands, digest_of_run

LEVELS = 21
"""Number of constant commands, equally spaced from zero to the largest, among which the best is chosen."""
ROUNDS = 2
"""Most rounds of the search for a constant command of each group."""
# Devices of a group that a sentence names.
_NAMED = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class BestConstant:
    """The constant commands of the lowest score: one share of the largest ones, or one command for each group.

    `commands` are sent to the devices that follow one [A or V], and are 0 without any score. `scores` are of all shares
    that were tried, from i = 0 to the largest. A search by group took `rounds`, the last one perhaps in part, from the
    score `of_share`, and tried so many commands.
    """

    commands: tuple[float, ...]
    score: float
    runs: int
    scores: tuple[float, ...] = ()
    of_share: float = math.nan
    rounds: int = 0
    tried: int = 0

    def in_words(self, label: str, devices: Sequence[Device]) -> str:
        """The choice in a sentence, with the ends of the scan, or the devices of each group."""
        driven, runs = commanded(devices), counted(self.runs, "run")
        if math.isnan(self.score):
            return f"{label} is at i = 0: no constant command has a score ({runs})."
        if not self.rounds:
            largest = np.array([device.largest_command for device in driven])
            off, on = (_share_in_words(driven, share * largest) for share in (0.0, 1.0))
            return (
                f"{label} is the best of {len(self.scores)} constant commands, score {self.score:.3f}: from "
                f"{PASSIVE_OFF}, {off}, {self.scores[0]:.3f}, to {PASSIVE_ON}, {on}, {self.scores[-1]:.3f} ({runs} in "
                "one batch)."
            )
        held = (
            f"{_command(driven[group[0]], self.commands[group[0]])} in "
            f"{list_names([driven[member].name for member in group], _NAMED)}"
            for group in products_of(driven)
        )
        return (
            f"{label}: {'; '.join(held)}; score {self.score:.3f}, beside {self.of_share:.3f} of one share of the "
            f"largest commands ({counted(self.tried, 'constant command')} in {counted(self.rounds, 'round')} of "
            f"coordinate search, {runs})."
        )

    def label(self, devices: Sequence[Device]) -> str:
        """The commands in words, after a search by group a command for each group."""
        driven = commanded(devices)
        if not self.rounds:
            return _share_in_words(driven, self.commands)
        return list_names(
            [_command(driven[first], self.commands[first]) for first, *_ in products_of(driven)]
        )


def _share_in_words(driven: Sequence[Device], commands: Sequence[float] | Floats) -> str:
    """One share of the largest commands in words: the command where that is the same of all dampers."""
    if len({(device.largest_command, device.spec.command_unit) for device in driven}) == 1:
        return _command(driven[0], commands[0])
    return f"{100.0 * commands[0] / driven[0].largest_command:.0f} %"


def _command(device: Device, command: float) -> str:
    return f"{command:.3g} {device.spec.command_unit or 'A'}"


def n_constant(arrangement: Arrangement) -> int:
    """Most constant commands that are tried for a row without a law."""
    by_group = arrangement.row.kind == "best_passive_by_group"
    return LEVELS * (ROUNDS * len(products_of(commanded(arrangement.devices))) if by_group else 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantSearch:
    """The arrangement, motions and hardware on which constant commands are tried; one has no score if a run failed."""

    arrangement: Arrangement
    motions: Sequence[GroundMotion]
    hardware: Hardware
    threads: int = 0
    on_block: OnBlock | None = None

    @property
    def _levels(self) -> Floats:
        """The constant commands that are tried, a row of one share of all largest ones for each level."""
        largest = [device.largest_command for device in commanded(self.arrangement.devices)]
        return np.linspace(0.0, largest, LEVELS)

    def _runs(self, commands: Floats) -> Runs:
        return simulate_criteria(
            replace(self.arrangement, law=constant_commands(commands)),
            self.motions,
            self.hardware,
            threads=self.threads,
            on_block=self.on_block,
        )

    def scan(self) -> tuple[BestConstant, Runs]:
        """The best share of the largest commands, and the criteria under it."""
        commands = self._levels
        runs = self._runs(commands)
        scores = runs.scores(runs.of_row(0)).mean(axis=(1, 2))
        best = int(np.argmin(searched(scores)))
        return BestConstant(
            commands=tuple(commands[best].tolist()),
            score=float(scores[best]),
            scores=tuple(scores.tolist()),
            runs=runs.outcome.size,
        ), runs.of_row(best)

    def chosen(self, call: LongCall[Any, Any], shares: dict[str, BestConstant]) -> tuple[Arrangement, str]:
        """The arrangement under its best constant commands, and a sentence on the choice.

        `shares` are the best shares of the largest commands that were found, by the digest of the runs.
        """
        arrangement = self.arrangement
        inputs = digest_of_run(arrangement, *self.motions)
        if inputs not in shares:
            shares[inputs] = call.step("best_constant", BestConstant, lambda: self.scan()[0], inputs)
        best = shares[inputs]
        # The row that the study has added may be without a score.
        if math.isnan(best.score) and not arrangement.added:
            raise self._without_score()
        if arrangement.row.kind == "best_passive_by_group":
            best = call.step("best_by_group", BestConstant, partial(self._best_by_group, best), inputs)
        label = f"{arrangement.row.label}, {best.label(arrangement.devices)}"
        row, law = replace(arrangement.row, label=label), constant_commands(best.commands)
        return replace(arrangement, row=row, law=law), best.in_words(label, arrangement.devices)

    def _best_by_group(self, start: BestConstant) -> BestConstant:
        """The best constant command of each group, from one share on: the levels of a group, then of the next.

        Scores are over i = 0. A search ends where the levels of every group were tried since the last change.
        """
        if math.isnan(start.score):
            return replace(start, runs=0)
        levels = self._levels
        groups = products_of(commanded(self.arrangement.devices))
        off = self._runs(levels[:1])
        commands, score = np.array(start.commands), start.score
        steps, changed = 0, 0
        while steps < ROUNDS * len(groups) and steps - changed < len(groups):
            group = groups[steps % len(groups)]
            tried = np.tile(commands, (LEVELS, 1))
            tried[:, group] = levels[:, group]
            scores = searched(self._runs(tried).scores(off).mean(axis=(1, 2)))
            best = int(np.argmin(scores))
            if scores[best] < score:
                commands, score, changed = tried[best], float(scores[best]), steps
            steps += 1
        return BestConstant(
            commands=tuple(commands.tolist()),
            score=score,
            of_share=start.score,
            tried=steps * LEVELS,
            rounds=math.ceil(steps / len(groups)),
            runs=(1 + steps * LEVELS) * len(self.motions),
        )

    def reference_peaks(self) -> ReferencePeaks:
        """The best share of the largest commands, and the mean peaks under it, to four digits."""
        best, runs = self.scan()
        if math.isnan(best.score):
            raise self._without_score()
        drift, acceleration = (
            round_to(float(runs.numbers[name].mean())) for name in ("peak_drift", "peak_acceleration")
        )
        return ReferencePeaks(
            commands=tuple(map(round_to, best.commands)), drift=drift, acceleration=acceleration
        )

    def _without_score(self) -> SimulationError:
        return SimulationError(
            f"{self.arrangement.row.label}: no constant command has a score, because under "
            f"{list_names([ground.name for ground in self.motions])} the run at i = 0, or at every command, "
            "did not finish or has no response; check the dampers and the step, or leave best_passive out"
        )
