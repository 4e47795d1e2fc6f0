"""A study over its motions: which they are, how scores spread, groups of motions, and how often a law is better.

A mean hides how a law does under single motions. Scores stand on the test motions of a study; training motions are
shown beside them where they were simulated, too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from mrwork.study.results import StudyCriteria
from mrwork.study.study import uses_in_words

MOST_IN_DETAIL = 8
"""Most motions of which pages and terminals show every table; of more they show the spread."""

BOTH = ("peak_drift", "peak_acceleration")
"""Criteria that a law must lower together to be better than a constant command."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionGroup:
    """Motions that have something in common: its name, and their indices."""

    name: str
    motions: tuple[int, ...]


def judged_in_words(results: StudyCriteria) -> str:
    """The motions that scores stand on, as "16 test motions"; "16 motions" where the study has no training motions."""
    uses = [results.motions[motion].use for motion in results.judged]
    if _n_training(results) or "training" in uses:
        return uses_in_words(uses)
    return f"{len(uses)} motion{'' if len(uses) == 1 else 's'}"


def chosen_in_words(results: StudyCriteria) -> str:
    """What the best constant command is chosen on, a sentence; empty without such a row."""
    if results.row_of("best_passive") is None or not results.chosen_on:
        return ""
    number = _n_training(results)
    on = uses_in_words(["training"] * number) if number else "the motions that it is judged on"
    return f"The best constant command is chosen on {on}."


def _n_training(results: StudyCriteria) -> int:
    """Number of motions that the best constant command is chosen on, if these are not the judged ones."""
    judged = {results.motions[motion].name for motion in results.judged}
    return 0 if judged.issuperset(results.chosen_on) else len(results.chosen_on)


def motion_groups(results: StudyCriteria) -> tuple[MotionGroup, ...]:
    """Groups that hold some of the judged motions, but not all; and the training motions beside test motions."""
    judged = results.judged
    names = dict.fromkeys(name for motion in judged for name in results.motions[motion].groups)
    found = [
        MotionGroup(
            name=name, motions=tuple(motion for motion in judged if name in results.motions[motion].groups)
        )
        for name in names
    ]
    others = tuple(number for number in range(len(results.motions)) if number not in judged)
    training = [MotionGroup(name="training motions", motions=others)] if others else []
    return (*(group for group in found if len(group.motions) < len(judged)), *training)


def times_better(results: StudyCriteria, row: int, reference: int, names: Sequence[str] = BOTH) -> int | None:
    """Under how many judged motions all these criteria of a row are lower than those of a reference row.

    `None` if a run did not finish.
    """
    ratios = [results.ratios_to(row, motion, reference) for motion in results.judged]
    if any(math.isnan(each[name]) for each in ratios for name in names):
        return None
    return sum(all(each[name] < 1.0 for name in names) for each in ratios)
