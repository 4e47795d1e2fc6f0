"""How far the forces of several sets of laws are apart where the tests of a damper end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.base.numbers import of_unit
from mrwork.base.values import Floats
from mrwork.dampers.tested_range import OperatingRange

# Other sets of laws predict nearly as well whose left-out fit is at most this behind, in points (DECISIONS.md, "Sets of
# laws within 1 point of the chosen one are kept").
NEARLY_AS_WELL = 1.0
# Share of a tested peak from which on a sample is where the tests end; share of the command beyond which it is.
_AT_END, _BEYOND = 0.95, 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class SetsApart:
    """How far sets of laws that predict nearly as well are apart where the tests end, and between their commands.

    `percent` is the root mean square over these samples of the largest minus the least force of the `n_sets`, per that
    of the force of the chosen set there; `velocity` [m/s] is their peak. A sample is where the tests end if its
    velocity or its displacement from the middle reaches 95 % of the tested peak, or its command is off all tested
    ones by 5 % of the largest.
    """

    n_sets: int
    percent: float
    velocity: float

    @property
    def in_words(self) -> str:
        """How far the sets of laws are apart, and at which velocity: a sentence without its stop."""
        return (
            f"{self.n_sets} sets of laws that predict nearly as well (within {NEARLY_AS_WELL:g} point) differ by "
            f"{self.percent:.2g} % of the force at {of_unit(1e3 * self.velocity, 'mm/s', 3)}"
        )


def sets_apart(
    tested: OperatingRange, displacement: Floats, velocity: Floats, command: ArrayLike | None, forces: Floats
) -> SetsApart | None:
    """How far the `forces` [N], shape (n_sets, n_time), of which the first is the chosen one, are apart.

    `None` for one set, and where no sample of the motion reaches the end of the tests.
    """
    away = np.abs(displacement - 0.5 * (displacement.max() + displacement.min()))
    ends = (np.abs(velocity) >= _AT_END * tested.velocity) | (away >= _AT_END * tested.stroke)
    ends |= is_untested(tested, command)
    scale = float(np.linalg.norm(forces[0, ends]))
    if len(forces) < 2 or scale == 0.0:
        return None
    return SetsApart(
        n_sets=len(forces),
        percent=100.0 * float(np.linalg.norm(np.ptp(forces[:, ends], axis=0))) / scale,
        velocity=float(np.abs(velocity[ends]).max()),
    )


def is_untested(tested: OperatingRange, command: ArrayLike | None) -> NDArray[np.bool_]:
    """Whether commands are off all tested ones, between them or beyond, by 5 % of the largest; false if unknown."""
    if command is None or tested.command is None:
        return np.zeros((), dtype=np.bool_)
    sent = np.asarray(command, dtype=np.float64)[..., None]
    levels = np.array(tested.levels) if tested.levels else np.clip(sent, *tested.command)
    return np.asarray(np.abs(sent - levels).min(axis=-1) > _BEYOND * abs(tested.command[1]))


def farthest_apart(forces: Floats, most: int, least: float) -> list[int]:
    """Rows of `forces`, shape (n_rows, n_values), beside the first: each the farthest from the first and those before.

    At most `most`, and none whose root mean square distance from another is below `least`.
    """
    indices = list[int]()
    distance = np.sqrt(np.mean(np.square(forces - forces[0]), axis=1))
    while len(indices) < most and distance.max() >= least:
        indices.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.sqrt(np.mean(np.square(forces - forces[indices[-1]]), axis=1)))
    return indices
