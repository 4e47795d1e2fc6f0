"""Placements of the dampers of a study, each with its best constant command, ranked and judged on unseen motions."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Any, Final

import numpy as np

from mrwork.closed_loop.evaluation import searched
from mrwork.motions import GroundMotion
from mrwork.store.long_call import LongCall
from mrwork.study.constant import ConstantSearch
from mrwork.study.dampers import ChosenDamper, equip_building
from mrwork.study.loop_runs import simulate_criteria
from mrwork.study.placements import Placed, placed_tables, placements_of
from mrwork.study.runs import Runs
from mrwork.study.study import (
    Arrangement,
    Row,
    Study,
    constant_commands,
    digest_of_run,
)
from mrwork.tuning.results import Placement

# Best placements that are judged on the test motions, beside the study's own.
_JUDGED: Final = 5


def compare_places(
    study: Study,
    *,
    call: LongCall[Any, Any],
    threads: int,
    on_compared: Callable[[int, int, float], None],
) -> list[Placement]:
    """The placements of a study that has a table of them, by the score of their best constant command, best first.

    `on_compared` is called with the placements that are done, all of them, and the least score.
    """
    original, placements = placements_of(study.table, study.building)
    first, device = study.table.damper[0], study.devices[0]
    one = ChosenDamper(
        spec=device.spec,
        theta=device.draws[0],
        largest_command=device.largest_command,
        source="",
        tested=device.tested,
    )
    # What a constant command needs: no law reads anything.
    hardware = replace(
        study.hardware, feedback="state", measured_floors=None, known_ground=False, kinematic=False
    )
    testing = tuple(motion.ground for motion in study.motions if motion.use == "test")

    def at(arrangement: Arrangement, command: float, motions: Sequence[GroundMotion]) -> Runs:
        held = replace(arrangement, law=constant_commands([command] * len(arrangement.devices)))
        return simulate_criteria(held, motions, hardware, threads=threads)

    @cache
    def without_dampers(*, test: bool) -> Runs:
        return at(study.arrangements[0], 0.0, testing if test else study.chosen_on)

    def arranged(placed: Placed) -> Arrangement:
        tables = placed_tables(first, placed)
        building, devices = equip_building(study.building, tables, [one] * len(tables))
        row = Row(label="placement", kind="best_passive")
        return Arrangement(row=row, bare=study.building, building=building, devices=devices, law=None)

    def best_of(placed: Placed) -> Placement:
        best, runs = ConstantSearch(
            arrangement=arranged(placed), motions=study.chosen_on, hardware=hardware, threads=threads
        ).scan()
        of_levels = runs.scores(without_dampers(test=False)).mean(axis=(1, 2))
        return Placement(
            storeys=dict(placed),
            command=best.commands[0],
            train=float(of_levels[np.argmin(searched(np.array(best.scores)))]),
            given=placed == original,
            count=first.count,
        )

    def judged(placement: Placement) -> Placement:
        runs = at(arranged(placement.storeys), placement.command, testing)
        return replace(placement, test=float(runs.scores(without_dampers(test=True)).mean()))

    ranked: list[Placement] = []
    compared = placements if original in placements else [*placements, original]
    for placed in compared:
        run = digest_of_run(arranged(placed), *study.chosen_on)
        ranked.append(call.step("placement", Placement, partial(best_of, placed), [*placed.items()], run))
        on_compared(len(ranked), len(compared), min(placement.train for placement in ranked))
    # The study's own placement comes last where it may not be chosen.
    ranked.sort(key=lambda entry: (entry.storeys not in placements, math.isnan(entry.train), entry.train))
    held_out = 0 < len(testing) < len(study.motions)
    for number, placement in enumerate(ranked if held_out else ()):
        if number < _JUDGED or placement.given:
            inputs = ([*placement.storeys.items()], placement.command)
            ranked[number] = call.step("judged placement", Placement, partial(judged, placement), *inputs)
    return ranked
