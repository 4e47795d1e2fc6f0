"""The ground motions of a study in tables, what is judged and designed on them, and their records at several levels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, SupportsIndex

import numpy as np
from numpy.typing import NDArray

from mrwork.base.numbers import counted
from mrwork.base.remark import Remark, RemarkKind
from mrwork.base.summary import list_names
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import SettingError
from mrwork.study.study import MotionFacts, uses_in_words

_LEVELS: Final = RemarkKind(
    "design_levels_several",
    "laws are designed, and the best constant command is chosen, over {count} levels at once ({0} to {1})",
    "give the study the design_level at which this is done, and all levels keep that law",
)
_FEW_MOTIONS: Final = RemarkKind("motions_few", "{motions} little about the next")
# Motions from which on nothing is said of their number.
_ENOUGH: Final = 3


# Intensities of one level agree to so many decimals [m/s^2].
_DECIMALS = 9


@array_dataclass()
class RecordLevels:
    """Records by name with rising `levels` of intensity in a `unit`, which is in one of the `measures`, in words.

    `places` are the indices of the motion of each record at each level, shape (n_records, n_levels), -1 without one.
    """

    records: tuple[str, ...]
    measures: tuple[str, ...]
    unit: str
    levels: Floats
    places: NDArray[np.int64]

    @property
    def measure(self) -> str:
        """The one measure of all intensities, refused where there are several."""
        if len(self.measures) > 1:
            raise SettingError(
                f"the motions have intensities of several measures, {list_names(self.measures)}; scale all to a pga, "
                "or all to an sa of one sa_period and sa_damping"
            )
        return self.measures[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedMotions(Sequence[MotionFacts]):
    """The motions of a study, a sequence of their facts, with what scores stand on and what laws are designed on.

    `chosen_on` are the names of the motions that the best constant command is chosen on, `design_levels` their levels
    where the study names one or its records have several.
    """

    motions: tuple[MotionFacts, ...]
    chosen_on: tuple[str, ...] = ()
    design_levels: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.motions)

    def __getitem__(self, number: SupportsIndex) -> MotionFacts:  # type: ignore[override] # no slices
        return self.motions[number]

    @property
    def names(self) -> tuple[str, ...]:
        """Names in tables, in order."""
        return tuple(motion.name for motion in self.motions)

    @property
    def judged(self) -> tuple[int, ...]:
        """Indices of the motions that scores and changes stand on: the test motions, or all where there are none.

        Of records at several levels they are of the level for which laws are designed, where the study names it.
        """
        levels = {motion: (self.motions[motion].level,) for motion in self._test}
        return tuple(motion for motion in levels if levels[motion] == self.design_levels) or tuple(levels)

    @property
    def _test(self) -> tuple[int, ...]:
        numbers = tuple(number for number, motion in enumerate(self.motions) if motion.use == "test")
        return numbers or tuple(range(len(self.motions)))

    @property
    def by_record(self) -> RecordLevels:
        """The test motions, or all where there are none, by record and intensity; copies are of the first record."""
        of_test = {number: self.motions[number] for number in self._test}
        records = {number: motion.copy_of or motion.record for number, motion in of_test.items()}
        intensities = [motion.intensity for motion in of_test.values()]
        rounded = [round(intensity.value, _DECIMALS) for intensity in intensities]
        levels, columns = np.unique(rounded, return_inverse=True)
        names = tuple(dict.fromkeys(records.values()))
        places = np.full((len(names), levels.size), -1, dtype=np.int64)
        for (number, record), column in zip(records.items(), columns, strict=True):
            places[names.index(record), column] = number
        measures = tuple(dict.fromkeys(intensity.name for intensity in intensities))
        unit = intensities[0].unit if intensities else "m/s^2"
        return RecordLevels(records=names, measures=measures, unit=unit, levels=levels, places=places)

    @property
    def groups(self) -> dict[str, list[int]]:
        """Groups that hold some of the judged motions, but not all; and the training motions beside test motions."""
        judged = self.judged
        members: dict[str, list[int]] = {}
        for motion in judged:
            for name in dict.fromkeys(self.motions[motion].groups):
                members.setdefault(name, []).append(motion)
        groups = {name: motions for name, motions in members.items() if len(motions) < len(judged)}
        every = enumerate(self.motions)
        others = [number for number, facts in every if number not in judged and facts.use == "training"]
        return {**groups, **({"training motions": others} if others else {})}

    @property
    def _n_training(self) -> int:
        """Number of motions that the best constant command is chosen on, if these are not the judged ones."""
        judged = {self.motions[motion].name for motion in self.judged}
        return 0 if judged.issuperset(self.chosen_on) else len(self.chosen_on)

    @property
    def in_words(self) -> str:
        """The motions that scores stand on, as "16 test motions"; "16 motions" where there are no training motions."""
        uses = [self.motions[motion].use for motion in self.judged]
        part = len(uses) < np.count_nonzero(self.by_record.places >= 0)
        at = f" at {self.design_levels[0]}" if part else ""
        has_uses = self._n_training or "training" in uses
        return f"{uses_in_words(uses) if has_uses else counted(len(uses), 'motion')}{at}"

    @property
    def chosen_in_words(self) -> str:
        """What the best constant command is chosen on, a sentence; empty where it is on none."""
        if not self.chosen_on:
            return ""
        number = self._n_training
        on = uses_in_words(["training"] * number) if number else "the motions that it is judged on"
        at = f", at {self.design_levels[0]}" if len(self.design_levels) == 1 else ""
        return f"The best constant command is chosen on {on}{at}."

    @property
    def remarks(self) -> Iterator[Remark]:
        """On laws for several levels at once, and on few motions."""
        count = len(self.judged)
        if len(levels := self.design_levels) > 1:
            yield _LEVELS.remark(levels[0], levels[-1], count=len(levels))
        if 0 < count < _ENOUGH:
            yield _FEW_MOTIONS.remark(motions=f"{counted(count, 'motion')} {'says' if count == 1 else 'say'}")
