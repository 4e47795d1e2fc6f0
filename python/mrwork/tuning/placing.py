"""Placements of the dampers of a study, each with its best constant command, ranked and judged on unseen motions."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Final

import numpy as np

from mrwork.base.numbers import duration_in_words
from mrwork.base.progress import ProgressReport
from mrwork.base.values import Floats
from mrwork.buildings.groups import largest_command
from mrwork.closed_loop.evaluation import searched
from mrwork.motions import GroundMotion
from mrwork.store.codec import digest_of
from mrwork.store.journal import Journal
from mrwork.study.constant import LEVELS
from mrwork.study.dampers import ChosenDamper, equip_building
from mrwork.study.loop_runs import simulate_criteria
from mrwork.study.placements import Placed, placed_tables, placements_of
from mrwork.study.runs import Runs, recall_or_compute
from mrwork.study.study import (
    Arrangement,
    Row,
    Study,
    constant_command,
    digest_of_run,
    make_arrangement,
    nominal,
)
from mrwork.tuning.problem import STUDY_SCORE
from mrwork.tuning.results import Placement

# Best placements that are judged on the test motions, beside that of the study.
_JUDGED: Final = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacingProgress(ProgressReport):
    """Progress of the comparison of placements: those done and in all, the last one, the least score, seconds."""

    done: int
    total: int
    last: str
    least: float
    seconds: float

    @property
    def in_words(self) -> str:
        """Progress in one line."""
        return (
            f"placement {self.done} of {self.total}: {self.last}; least score {self.least:.4f}, "
            f"{duration_in_words(self.seconds)}"
        )

    @property
    def share(self) -> float | None:
        """Share that is done."""
        return self.done / self.total


def compare_places(
    study: Study, *, journal: Journal | None, threads: int, on_progress: Callable[[PlacingProgress], None]
) -> list[Placement]:
    """The placements of a study that has a table of them, by the score of their best constant command, best first."""
    assert study.table is not None
    bare, began = study.building, time.perf_counter()
    given, placements = placements_of(study.table, bare)
    first, device = study.table.damper[0], study.devices[0]
    # What a constant command needs: no law reads anything.
    hardware = replace(study.hardware, feedback="state", measured_floors=None, known_ground=False)
    testing = tuple(each.ground for each in study.motions if each.use == "test")
    testing = () if len(testing) == len(study.motions) else testing

    def run(arrangement: Arrangement, commands: Floats, motions: Sequence[GroundMotion]) -> Runs:
        devices = arrangement.devices
        law = constant_command(devices, *commands.tolist())
        one = nominal(devices)
        return simulate_criteria(arrangement, law, motions, hardware, one, bare=bare, threads=threads)

    @cache
    def without_dampers(*, test: bool) -> Runs:
        return run(study.arrangements[0], np.zeros(1), testing if test else study.chosen_on)

    def scores(arrangement: Arrangement, commands: Floats, *, test: bool) -> Floats:
        runs = run(arrangement, commands, testing if test else study.chosen_on)
        return np.asarray(STUDY_SCORE.run_scores(runs, without_dampers(test=test)).mean(axis=(1, 2)))

    def arranged(placed: Placed) -> Arrangement:
        tables = placed_tables(first, placed)
        one = ChosenDamper(
            spec=device.spec,
            theta=device.draws[0],
            largest_command=device.largest_command,
            source="",
            tested=device.tested,
        )
        building, devices = equip_building(bare, tables, [one] * len(tables))
        return make_arrangement(bare, Row(label="placement", kind="best_passive"), building, devices, None)

    def best_of(placed: Placed) -> Placement:
        arrangement = arranged(placed)
        commands = np.linspace(0.0, largest_command(arrangement.devices), LEVELS)
        of_commands = scores(arrangement, commands, test=False)
        best = int(np.argmin(searched(of_commands)))
        return Placement(
            storeys=dict(placed),
            command=float(commands[best]),
            train=float(of_commands[best]),
            given=placed == given,
            count=first.count,
        )

    def judged(one: Placement) -> Placement:
        command = np.array([one.command])
        return replace(one, test=float(scores(arranged(one.storeys), command, test=True)[0]))

    ranked: list[Placement] = []
    for placed in placements if given in placements else [*placements, given]:
        inputs = digest_of(list(placed.items()), digest_of_run(arranged(placed), *study.chosen_on))
        ranked.append(recall_or_compute(journal, "placement", inputs, Placement, partial(best_of, placed)))
        least = min(each.train for each in ranked)
        on_progress(
            PlacingProgress(
                done=len(ranked),
                total=len(placements) + (given not in placements),
                last=ranked[-1].in_words,
                least=least,
                seconds=time.perf_counter() - began,
            )
        )
    # That of the study comes last where it is not one that may be chosen.
    ranked.sort(key=lambda each: (each.storeys not in placements, math.isnan(each.train), each.train))
    for number, each in enumerate(ranked if testing else ()):
        if number < _JUDGED or each.given:
            inputs = digest_of(list(each.storeys.items()), each.command)
            ranked[number] = recall_or_compute(
                journal, "judged placement", inputs, Placement, partial(judged, each)
            )
    return ranked
