"""What half the step changes: the largest change of each arrangement."""

from __future__ import annotations

from dataclasses import dataclass

from mrwork.closed_loop.evaluation import criterion
from mrwork.study.results import StudyResults

ON_OFF = (
    "On/off laws at a coarse step move most: what jumps with the command, as accelerations do, is met at the steps "
    "alone."
)
"""What to know of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepChange:
    """The criterion of a row that half the step changes most: by how much of its value, under which motion.

    `lost` are the motions under which one of the two runs did not finish, so that they cannot be compared; where that
    is all, there is no criterion.
    """

    row: int
    change: float = 0.0
    criterion: str = ""
    motion: int = 0
    lost: tuple[int, ...] = ()

    def in_words(self, results: StudyResults) -> str:
        """Which criterion under which motion, and what is not compared."""
        found = ""
        if self.criterion:
            found = f"{criterion(self.criterion).title}, {results.motions[self.motion].name}"
        lost = ", ".join(results.motions[motion].name for motion in self.lost)
        return "; ".join(part for part in (found, f"not compared: {lost}" if lost else "") if part)


def step_changes(results: StudyResults) -> tuple[StepChange, ...]:
    """The largest change of each row that has been run with half the step."""
    halved = results.halved or {}
    return tuple(
        _largest(results, row) for row in range(len(results.rows)) if any(key[0] == row for key in halved)
    )


def _largest(results: StudyResults, row: int) -> StepChange:
    largest: tuple[float, str, int] | None = None
    lost = []
    for motion in range(len(results.motions)):
        if (row, motion) not in (results.halved or {}):
            continue
        changes = results.step_changes(row, motion)
        if changes is None:
            lost.append(motion)
            continue
        name = max(changes, key=lambda each: changes[each])
        if largest is None or changes[name] > largest[0]:
            largest = (changes[name], name, motion)
    if largest is None:
        return StepChange(row=row, lost=tuple(lost))
    change, name, motion = largest
    return StepChange(row=row, change=change, criterion=name, motion=motion, lost=tuple(lost))
