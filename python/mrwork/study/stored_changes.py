"""Changes of the rows of a study in its results file, and their scores under groups of motions."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from mrwork.arguments import Count
from mrwork.store.record import OrNan
from mrwork.study.comparison import Comparison, rounds_to_increase
from mrwork.study.over_motions import motion_groups
from mrwork.study.results import StudyCriteria
from mrwork.study.study import Kind


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredChange:
    """Change of a quantity relative to a reference, -0.2 for 20 % less: mean over motions, the largest, its motion."""

    mean: OrNan
    largest: OrNan
    motion: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredChanges:
    """A row in the results file: its rank, its score, and the changes of every quantity by name.

    The references are the building without dampers and the passive damper with the lowest score. `worse` are the
    quantities that increase on average.
    """

    controller: str
    kind: Kind
    rank: str
    place: Count
    score: OrNan
    against_uncontrolled: dict[str, StoredChange]
    worse_than_uncontrolled: tuple[str, ...]
    against_best_passive: dict[str, StoredChange]
    worse_than_best_passive: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredGroup:
    """A group of motions in the results file, and the score of each row under them."""

    name: str
    motions: tuple[str, ...]
    scores: dict[str, OrNan]


def stored_groups(results: StudyCriteria) -> tuple[StoredGroup, ...]:
    """The groups of the motions of a study, with the score of each row by its label."""
    return tuple(
        StoredGroup(
            name=group.name,
            motions=tuple(results.motions[motion].name for motion in group.motions),
            scores={
                row.label: results.score_under(number, group.motions)
                for number, row in enumerate(results.rows)
            },
        )
        for group in motion_groups(results)
    )


def stored_changes(comparison: Comparison) -> Iterator[StoredChanges]:
    """Changes of every row, the rows of each rank together, the lowest score first."""
    results = comparison.results

    def against(row: int, reference: int | None) -> dict[str, StoredChange]:
        if reference is None or reference == row:
            return {}
        return {
            name: StoredChange(
                mean=each.mean,
                largest=each.largest,
                motion=None if math.isnan(each.largest) else results.motions[each.motion].name,
            )
            for name, each in comparison.changes(row, reference).items()
        }

    for rank, rows in comparison.ranks:
        for place, row in enumerate(rows, start=1):
            bare, passive = against(row, comparison.uncontrolled), against(row, comparison.passive)
            yield StoredChanges(
                controller=results.rows[row].label,
                kind=results.rows[row].kind,
                rank=rank.name,
                place=place,
                score=results.score(row),
                against_uncontrolled=bare,
                worse_than_uncontrolled=_increased(bare),
                against_best_passive=passive,
                worse_than_best_passive=_increased(passive),
            )


def _increased(changes: Mapping[str, StoredChange]) -> tuple[str, ...]:
    return tuple(name for name, change in changes.items() if rounds_to_increase(change.mean))
