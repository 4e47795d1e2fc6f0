"""Splits of tests for a choice: what lies inside the tests that remain, beyond them, and between their commands.

A motion that is left out mostly lies between others; a building goes beyond the tested ones. So the fastest, the
slowest and the largest motions are left out as well, each with every test at or beyond it. The error of a choice is the
mean of both kinds with equal weights: what share of its time a damper spends beyond its tests is not known, and of all
weights equal ones have the least error in the worst case. What a law is between commands is told by tests at a command
that is left out between others: they decide among candidates that are as good otherwise, as far as the rest determines
these.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.base.remark import Remark, RemarkKind
from mrwork.base.summary import list_names
from mrwork.base.values import Floats
from mrwork.identification.settings import Fold
from mrwork.records import DamperTest
from mrwork.records.damper_test import command_groups
from mrwork.uncertainty.bands.prediction import (
    IN_WORDS,
    LATER_CYCLES,
    ONE_TEST,
    alike_tests,
    cycles_of_halves,
    fold_groups,
    folds_of,
    rests_of,
)

Kind = Literal["inside", "beyond", "between"]
"""Where the tests lie that a split leaves out: inside those that remain, beyond them, or between their commands."""

# Weight of what lies beyond the tests that remain, in the mean error.
_OUTSIDE = 0.5
# A split takes one in so many motions at most.
_ONE_IN = 3
# A test is at the end where its velocity or stroke is within this share of the least one there: rigs repeat motions so.
_AT = 0.1
# Floor of the NRMSE, for synthetic tests without noise.
_EXACT = 1e-9
# Number of motions from which on motions are left out by default, and those beyond the rest.
_MOTIONS = 3
_KEPT = RemarkKind("extreme_not_left_out", "the {0} motion is not left out with all at or beyond it: {1}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Split:
    """Indices of the tests that are left out together.

    `beyond` says of what they are the end, empty if of nothing; `between` whether they are all tests at a command that
    lies between others.
    """

    members: tuple[int, ...]
    beyond: tuple[str, ...] = ()
    between: bool = False

    @property
    def kind(self) -> Kind:
        """Where what is predicted lies."""
        return "between" if self.between else "beyond" if self.beyond else "inside"


@dataclass(frozen=True, slots=True, kw_only=True)
class Splits:
    """Splits of the tests of one choice, each selection once, the unit of each test, and why splits were dropped.

    The unit is the motion, because splits repeat motions and tests of one motion err alike; the fold, where there are
    fewer than three motions. `parts` are what the tests are, in words. A single test, which has no `fold`, is the first
    half of its cycles, which predicts each later one.
    """

    tests: tuple[DamperTest, ...]
    splits: tuple[Split, ...]
    units: tuple[int, ...]
    fold: Fold | None
    remarks: tuple[Remark, ...] = ()
    parts: str = "tests"

    @property
    def members(self) -> list[list[int]]:
        """Indices of the tests that each split leaves out."""
        return [list(split.members) for split in self.splits]

    @property
    def left_out(self) -> NDArray[np.bool_]:
        """Whether each split leaves out each test, shape (n_splits, n_tests)."""
        return np.array([np.isin(range(len(self.tests)), split.members) for split in self.splits])

    @property
    def n_splits(self) -> int:
        """Number of fits to less than all tests."""
        return len(self.splits)

    @property
    def in_words(self) -> str:
        """What is predicted, after the number of tests."""
        if self.fold is None:
            return LATER_CYCLES
        ends = list_names([end for split in self.splits for end in split.beyond])
        beyond = f", and the {ends} motions without every test at or beyond them" if ends else ""
        return f"{len(self.units)} {self.parts}, {IN_WORDS[self.fold]}{beyond}"

    @property
    def rests(self) -> list[tuple[DamperTest, ...]]:
        """The tests that remain without each split."""
        return rests_of(self.tests, self.members)

    def errors(self, nrmse: Sequence[Floats]) -> Floats:
        """Errors of each unit, shape (n_units,), whose mean is the error of the choice, from the errors of each split.

        Of the tests of a unit in a split the NRMSE has its geometric mean, in which relative changes weigh the same.
        What lies between commands does not count, nor what is left open.
        """
        if self.fold is None:
            return np.concatenate(nrmse)
        inside, outside = self._of("inside", nrmse), self._of("beyond", nrmse)
        weights = (1.0 - _OUTSIDE, _OUTSIDE) if inside and outside else (1.0, 1.0)
        n_units = len(set(self.units))
        total = np.zeros(n_units)
        for kind, weight in zip((inside, outside), weights, strict=True):
            for unit, error in kind.items():
                total[unit] += weight * n_units / len(kind) * error
        return total

    def means(self, nrmse: Sequence[Floats]) -> tuple[float | None, float | None]:
        """Mean errors inside and outside of the tests that remain, `None` where there is no such split."""
        if self.fold is None:
            return None, None
        inside, outside = (
            float(np.mean([*of_kind.values()])) if of_kind else None
            for of_kind in (self._of("inside", nrmse), self._of("beyond", nrmse))
        )
        return inside, outside

    def between(self, nrmse: Sequence[Floats]) -> Floats:
        """Errors of each unit between commands, (n_units,); empty where no such split is predicted whole."""
        pairs = zip(self.splits, nrmse, strict=True)
        if not all(np.isfinite(errors).all() for split, errors in pairs if split.kind == "between"):
            return np.empty(0)
        return np.array([*self._of("between", nrmse).values()])

    def _of(self, kind: Kind, nrmse: Sequence[Floats]) -> dict[int, float]:
        """Error of each unit in the splits of a kind, of what is predicted there."""
        of_kind: dict[int, list[float]] = {}
        for split, errors in zip(self.splits, nrmse, strict=True):
            units = np.array([self.units[index] for index in split.members])
            for unit in sorted(set(units.tolist())) if split.kind == kind else ():
                own = errors[(units == unit) & ~np.isnan(errors)]
                if own.size:
                    mean = np.log(np.maximum(own, _EXACT)).mean()
                    of_kind.setdefault(unit, []).append(float(np.exp(mean)))
        return {unit: float(np.mean(means)) for unit, means in of_kind.items()}


def splits_of(
    tests: Sequence[DamperTest], fold: Fold | None = None, *, between_commands: bool = False
) -> Splits:
    """Splits of the tests by `fold`, or the default one, and those beyond the rest, which keep every command.

    With those `between_commands` each constant command that lies between others is left out as well.
    """
    if len(tests) == 1:
        first, *later = cycles_of_halves(tests[0])
        members = tuple(range(1, 1 + len(later)))
        return Splits(
            tests=(first, *later),
            splits=(Split(members=members),),
            units=(0, *members),
            fold=None,
            remarks=(ONE_TEST.remark(),),
        )
    fold = fold or default_fold(tests)
    folds = folds_of(tests, fold)
    motions = fold_groups(tests, "motion")
    by_motion = len(motions) >= _MOTIONS
    remarks = [*alike_tests(tests)]
    levels = command_groups(tests)
    ends: dict[tuple[int, ...], tuple[str, ...]] = {}
    for end, size in _ENDS.items() if by_motion else ():
        sizes = np.array([size(test) for test in tests])
        most = max(float(np.median(sizes[group])) for group in motions)
        extreme = next(group for group in motions if float(np.median(sizes[group])) == most)
        least = sizes[extreme].min()
        members = tuple(np.flatnonzero(sizes >= least - _AT * abs(least)).tolist())
        touched = sum(any(index in members for index in group) for group in motions)
        remaining = {level for index, level in enumerate(levels) if index not in members}
        if touched * _ONE_IN > len(motions):
            reason = f"that would take {touched} of {len(motions)} motions"
        elif len(remaining) < len(set(levels)):
            reason = "that would take every test at a command"
        else:
            ends[members] = (*ends.get(members, ()), end)
            continue
        remarks.append(_KEPT.remark(end, reason))
    inside = [members for each in folds if (members := tuple(sorted(each))) not in ends]
    between = _between_commands(tests, levels) if between_commands and fold != "command" else []
    return Splits(
        tests=tuple(tests),
        splits=(
            *(Split(members=members) for members in inside),
            *(Split(members=members, beyond=beyond) for members, beyond in ends.items()),
            *(Split(members=members, between=True) for members in between),
        ),
        units=_units(motions if by_motion else folds, len(tests)),
        fold=fold,
        remarks=tuple(remarks),
    )


def _between_commands(tests: Sequence[DamperTest], levels: Sequence[int]) -> list[tuple[int, ...]]:
    """The tests at each constant command but the lowest and the highest, where no command varies."""
    if any(test.has_varying_command or not test.commands for test in tests):
        return []
    members = [tuple(np.flatnonzero(np.equal(levels, level)).tolist()) for level in sorted(set(levels))]
    members.sort(key=lambda group: float(np.mean(tests[group[0]].commands[0].values)))
    return members[1:-1]


def default_fold(tests: Sequence[DamperTest]) -> Fold:
    """What is left out together: a motion where there are three or more, else a test."""
    return "motion" if len(fold_groups(tests, "motion")) >= _MOTIONS else "test"


def can_leave_out(tests: Sequence[DamperTest]) -> bool:
    """Whether the tests run at two commands without any that are left out together."""
    folds = fold_groups(tests, default_fold(tests))
    rests = rests_of(tests, folds)
    return len(folds) > 1 and all(len({test.command_in_words for test in rest}) > 1 for rest in rests)


def _units(groups: Sequence[Sequence[int]], n_tests: int) -> tuple[int, ...]:
    unit_of = {index: unit for unit, members in enumerate(groups) for index in members}
    return tuple(unit_of[index] for index in range(n_tests))


def _peak_velocity(test: DamperTest) -> float:
    return float(np.abs(test.velocity[test.counted]).max())


_ENDS: dict[str, Callable[[DamperTest], float]] = {
    "fastest": _peak_velocity,
    "slowest": lambda test: -_peak_velocity(test),
    "largest": lambda test: float(np.ptp(test.displacement[test.counted])),
}
