"""Placements of equal dampers over the storeys of a building, with their best constant commands, ranked and judged."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import islice
from typing import Any, Final

import numpy as np

from mrwork.base.numbers import counted
from mrwork.base.places import keyed
from mrwork.errors import InvalidSettingError
from mrwork.store.long_call import LongCall
from mrwork.study.dampers import chosen_damper, equip_building
from mrwork.study.loop_case import LoopCase, unobserved
from mrwork.study.reading import with_dampers
from mrwork.study.schema import DamperTable
from mrwork.study.study import Study, constant_commands
from mrwork.study.trials import scan
from mrwork.tuning.tuned_laws import Placement

Placed = Mapping[str, int]
"""Number of [[damper]] in each storey that has any, by its name."""
_MOST_PLACEMENTS: Final = 60


def placements_of(study: Study) -> tuple[Placed, list[Placed]]:
    """The placement of the [[damper]] of a study, and all that its [places] allow."""
    places, dampers, bare = study.table.places, study.table.damper, study.building
    assert places is not None
    for number, damper in enumerate(dampers):
        if (
            damper.row is not None
            or replace(damper, storey=dampers[0].storey, name=dampers[0].name) != dampers[0]
        ):
            raise InvalidSettingError(
                ("damper", number),
                "[places] compares storeys of equal dampers, and this one differs from the first, or has a row; keep "
                "one, and give an angle instead of a row",
            )
    with keyed("places", "storeys"):
        names = list(
            dict.fromkeys(map(bare.storey_name, places.storeys or bare.storey_names[: len(bare.chain)]))
        )
    number = places.dampers or len(dampers)
    if len(dampers) not in (1, number):
        raise InvalidSettingError(
            ("places", "dampers"),
            f"dampers is {number}, and the study has {len(dampers)} [[damper]]; give one, or one for each place",
        )
    most = min(places.each or number, number)
    placements: list[Placed] = list(islice(_spread(names, number, most), _MOST_PLACEMENTS + 1))
    if not 1 <= len(placements) <= _MOST_PLACEMENTS:
        most_told = f"more than {_MOST_PLACEMENTS} placements"
        many = f"{most_told}; give fewer storeys, a smaller each, or fewer dampers of a larger count"
        raise InvalidSettingError(
            "places",
            f"{counted(number, 'damper')} in {counted(len(names), 'storey')}, at most {most} in each, have "
            f"{many if placements else 'no placement; give a larger each'}",
        )
    tally = Counter(bare.storey_name(damper.storey) for damper in dampers)
    own = {name: tally[name] if len(dampers) > 1 else number for name in bare.storey_names if tally[name]}
    return own, placements


def _spread(names: Sequence[str], number: int, most: int) -> Iterator[dict[str, int]]:
    if number == 0:
        yield {}
    elif number <= most * len(names):
        for count in range(min(most, number), -1, -1):
            for rest in _spread(names[1:], number - count, most):
                yield ({names[0]: count} if count else {}) | rest


def placed_tables(study: Study, placed: Placed) -> list[DamperTable]:
    """Tables of the dampers of a placement, made of the first [[damper]] of a study."""
    first = study.table.damper[0]
    return [
        replace(first, storey=name, name=None, count=first.count * number) for name, number in placed.items()
    ]


def placed_study(study: Study, placed: Placed) -> Study:
    """The study with its dampers in these storeys, without a comparison of placements."""
    return with_dampers(study, placed_tables(study, placed))


def compare_places(
    study: Study, *, call: LongCall[Any], threads: int, on_compared: Callable[[int, int, float], None]
) -> list[Placement]:
    """The placements of a study that has a table of them, by the score of their best constant command, best first.

    `on_compared` is called with the placements that are done, all of them, and the least score.
    """
    own, placements = placements_of(study)
    first, hardware = study.table.damper[0], unobserved(study.hardware)
    one, _ = chosen_damper(first, study.origin.folder, study.origin.identified)
    testing = [motion.ground for motion in study.motions if motion.facts.use == "test"]
    motions = [*study.chosen_on, *(testing if len(testing) < len(study.motions) else [])]
    bare = LoopCase(
        arrangement=study.arrangements[0],
        motions=motions,
        hardware=hardware,
        threads=threads,
        asked=study.asked,
        scored=study.scored,
    )
    of_bare = bare.criteria()

    def best_of(placed: Placed) -> Placement:
        tables = placed_tables(study, placed)
        building, devices = equip_building(study.building, tables, [one] * len(tables))
        there = replace(study.at_zero, building=building, devices=devices, law=None)
        case = replace(bare, arrangement=there)
        commands = scan(replace(case, motions=study.chosen_on))[0].commands
        runs = case.under(constant_commands(commands)).criteria()
        train, test = np.split(runs.scores(of_bare, study.scored)[0, :, 0], [len(study.chosen_on)])
        return Placement(
            storeys=dict(placed),
            command=commands[0],
            train=float(train.mean()),
            test=float(test.mean()) if test.size else None,
            given=placed == own,
            count=first.count,
        )

    ranked: list[Placement] = []
    compared = placements if own in placements else [*placements, own]
    for placed in compared:
        ranked.append(call.step("placement", Placement, partial(best_of, placed), [*placed.items()]))
        on_compared(len(ranked), len(compared), min(placement.train for placement in ranked))
    # The study's own placement comes last where it may not be chosen.
    return sorted(
        ranked,
        key=lambda placement: (
            placement.storeys not in placements,
            math.isnan(placement.train),
            placement.train,
        ),
    )
