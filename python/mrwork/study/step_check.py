"""Check of the step of a study: the largest change of a criterion of each row with half the step."""

from __future__ import annotations

from dataclasses import dataclass

from mrwork.closed_loop.evaluation import criterion
from mrwork.study.results import StudyCriteria

ON_OFF = (
    "On/off laws at a coarse step move most: quantities that jump with the command, such as accelerations, are "
    "evaluated at the steps only."
)
"""Note on the check of the step."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepChange:
    """The largest relative change of a criterion of a row with half the step, and its motion.

    `unfinished` are the motions under which one of the two runs did not finish; `criterion` is empty if these are all.
    """

    row: int
    change: float = 0.0
    criterion: str = ""
    motion: int = 0
    unfinished: tuple[int, ...] = ()

    def in_words(self, results: StudyCriteria) -> str:
        """The criterion and the motion, and the motions that are not compared."""
        found = ""
        if self.criterion:
            found = f"{criterion(self.criterion).title}, {results.motions[self.motion].name}"
        others = ", ".join(results.motions[motion].name for motion in self.unfinished)
        return "; ".join(part for part in (found, f"not compared: {others}" if others else "") if part)


def largest_step_changes(results: StudyCriteria) -> tuple[StepChange, ...]:
    """The largest change of each row that was repeated with half the step."""
    checked = results.checked or frozenset()
    rows = sorted({row for row, _ in checked})
    return tuple(
        _largest(results, row, sorted(motion for each, motion in checked if each == row)) for row in rows
    )


def _largest(results: StudyCriteria, row: int, motions: list[int]) -> StepChange:
    largest: tuple[float, str, int] | None = None
    unfinished = []
    for motion in motions:
        changes = results.step_changes(row, motion)
        if changes is None:
            unfinished.append(motion)
            continue
        name = max(changes, key=lambda each: changes[each])
        if largest is None or changes[name] > largest[0]:
            largest = (changes[name], name, motion)
    if largest is None:
        return StepChange(row=row, unfinished=tuple(unfinished))
    change, name, motion = largest
    return StepChange(row=row, change=change, criterion=name, motion=motion, unfinished=tuple(unfinished))
