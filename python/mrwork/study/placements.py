"""Placements of equal dampers over the storeys of a building, which `mrwork tune` compares."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any, Final

from mrwork.base.numbers import counted
from mrwork.base.places import keyed
from mrwork.buildings import Building
from mrwork.errors import InvalidSettingError
from mrwork.study.schema import DamperTable, StudyTable

MOST_PLACEMENTS: Final = 60

Placed = Mapping[str, int]
"""Number of equal dampers in each storey that has any, by its name, lowest first."""


def placements_of(table: StudyTable, bare: Building) -> tuple[Placed, list[Placed]]:
    """The placement that the [[damper]] of a study give, and all that its [places] allow."""
    places, dampers = table.places, table.damper
    assert places is not None
    for number, damper in enumerate(dampers):
        if replace(damper, storey=dampers[0].storey, name=dampers[0].name) != dampers[0]:
            raise InvalidSettingError(
                ("damper", number),
                "[places] compares places of equal dampers, and this one differs from the first; keep one",
            )
        if damper.row is not None:
            raise InvalidSettingError(
                ("damper", number, "row"),
                "row is of one place, and [places] compares several; give an angle",
            )
    tally = Counter(bare.storey_name(damper.storey) for damper in dampers)
    with keyed("places", "storeys"):
        names = list(dict.fromkeys(bare.storey_name(storey) for storey in places.storeys or ()))
    names = names or list(bare.drift_names)
    number = places.dampers or len(dampers)
    if len(dampers) not in (1, number):
        raise InvalidSettingError(
            ("places", "dampers"),
            f"dampers is {number}, and the study has {len(dampers)} [[damper]]; give one, or one for each place",
        )
    most = min(places.each or number, number)
    placements: list[Placed] = list(islice(_spread(names, number, most), MOST_PLACEMENTS + 1))
    if not 1 <= len(placements) <= MOST_PLACEMENTS:
        have, remedy = "no placement", "a larger each"
        if placements:
            have = f"more than {MOST_PLACEMENTS} placements"
            remedy = "fewer storeys, a smaller each, or fewer dampers of a larger count"
        raise InvalidSettingError(
            "places",
            f"{counted(number, 'damper')} in {counted(len(names), 'storey')}, at most {most} in each, have {have}; "
            f"give {remedy}",
        )
    placed = {name: tally[name] if len(dampers) > 1 else number for name in bare.storey_names if tally[name]}
    return placed, placements


def _spread(names: Sequence[str], number: int, most: int) -> Iterator[dict[str, int]]:
    if number == 0:
        yield {}
    elif number <= most * len(names):
        for count in range(min(most, number), -1, -1):
            for rest in _spread(names[1:], number - count, most):
                yield ({names[0]: count} if count else {}) | rest


def placed_tables(first: DamperTable, placed: Placed) -> list[DamperTable]:
    """Tables of the dampers of a placement, made of the table of one."""
    return [
        replace(first, storey=name, name=None, count=first.count * number) for name, number in placed.items()
    ]


def placed_document(document: Mapping[str, Any], placed: Placed) -> dict[str, Any]:
    """The document of a study with its dampers in a placement, which it no longer looks for."""
    first = {key: value for key, value in document["damper"][0].items() if key != "name"}
    dampers = [
        first | {"storey": name, "count": first.get("count", 1) * number} for name, number in placed.items()
    ]
    return {key: value for key, value in document.items() if key != "places"} | {"damper": dampers}
