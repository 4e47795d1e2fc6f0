"""The section on the errors of a fit by the amplitude of the half cycles, and at their reversals."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from mrwork.base import numbers
from mrwork.base.table import Table, TableColumn, page_table
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.tested_range import half_cycle_ends
from mrwork.records.damper_test import DamperTest
from mrwork.report.figures import Comparison
from mrwork.report.section import Group, Section, SectionKind

# Upper ends of the classes in each decade of millimetres; the amplitudes that rigs are set to lie between them.
_ENDS = (1.7, 3.4, 7.0)
# Share of the duration of a half cycle that counts as its reversal, at either end.
_REVERSAL = 0.1
# An error relative to the force is larger by this factor before the text says so.
_LARGER = 2.0


@array_dataclass()
class _HalfCycles:
    """Half cycles of all tests: amplitude [m] and class of each; sums over samples, rows at and between reversals.

    `count`, `squared_error` and `squared_force` [N^2] have the shape (2, n_half_cycles).
    """

    amplitude: Floats
    number: NDArray[np.intp]
    count: Floats
    squared_error: Floats
    squared_force: Floats

    def of_class(self, number: int) -> _HalfCycles:
        """Those of one class."""
        chosen = self.number == number
        return _HalfCycles(
            amplitude=self.amplitude[chosen],
            number=self.number[chosen],
            count=self.count[:, chosen],
            squared_error=self.squared_error[:, chosen],
            squared_force=self.squared_force[:, chosen],
        )

    @property
    def in_words(self) -> str:
        """Least and largest amplitude, as in "13 to 15 mm"."""
        ends = dict.fromkeys(numbers.shortest(1e3 * each, 2) for each in np.quantile(self.amplitude, (0, 1)))
        return f"{' to '.join(ends)} mm"

    @property
    def rmse(self) -> float:
        """Root mean square error [N]."""
        return _root(self.squared_error.sum(), self.count.sum())

    @property
    def relative(self) -> float:
        """Root mean square error over that of the force."""
        return _root(self.squared_error.sum(), self.squared_force.sum())

    @property
    def rmse_at_and_between_reversals(self) -> tuple[float, float]:
        """Root mean square error of the samples at reversals and of the others [N]."""
        at, between = map(_root, self.squared_error.sum(axis=1), self.count.sum(axis=1))
        return at, between

    @property
    def excess_at_reversals(self) -> float:
        """Root mean square error at reversals over that of the other samples."""
        at, between = self.rmse_at_and_between_reversals
        return at / between if between > 0.0 else math.nan


def amplitude_section(comparisons: Sequence[Comparison]) -> Section | None:
    """A table of the errors by classes of amplitude, and what it shows; `None` where no half cycle is compared."""
    every = _half_cycles(comparisons)
    classes = [every.of_class(number) for number in np.unique(every.number)]
    classes = [each for each in classes if each.count.any()]
    if not classes:
        return None
    return Section(
        anchor="amplitudes",
        title="Errors by amplitude",
        summary=f"Errors by amplitude: {_summary(classes)}.",
        groups=(Group(prose=_prose(classes), table=_table(classes, every)),),
    )


def _summary(classes: Sequence[_HalfCycles]) -> str:
    if len(classes) == 1:
        return f"all half cycles are of {classes[0].in_words}"
    shares = [f"{numbers.percent(each.relative)} % in those of {each.in_words}" for each in classes]
    return f"RMSE over the RMS force of the half cycles, {', '.join(shares)}"


def _prose(classes: Sequence[_HalfCycles]) -> tuple[str, ...]:
    largest = classes[-1]
    worst = max(classes[:-1], key=lambda each: each.relative, default=None)
    if worst is None or not worst.relative > _LARGER * largest.relative:
        return ()
    return (
        f"In half cycles of {worst.in_words} the error over the force is "
        f"{numbers.shortest(worst.relative / largest.relative, 2)} times that in those of {largest.in_words}. "
        "Earthquakes demand mostly small half cycles; a model with backlash may predict them better.",
    )


def _table(classes: Sequence[_HalfCycles], every: _HalfCycles) -> Table:
    rows = [*classes, *([every] if len(classes) > 1 else [])]
    decimals = numbers.decimals_of([each.rmse for each in rows], 3)

    def rmse(part: int) -> Callable[[_HalfCycles], str]:
        return lambda each: numbers.significant(each.rmse_at_and_between_reversals[part], 3)

    return page_table(
        "Errors by amplitude of the half cycles",
        (
            TableColumn(heading="amplitude", cell=lambda each: "all" if each is every else each.in_words),
            TableColumn(
                heading="half cycles", cell=lambda each: numbers.format_fixed(each.amplitude.size, 0)
            ),
            TableColumn(heading="samples", cell=lambda each: numbers.format_fixed(each.count.sum(), 0)),
            TableColumn(
                heading="RMSE", unit="N", cell=lambda each: numbers.format_fixed(each.rmse, decimals)
            ),
            TableColumn(
                heading="RMSE / RMS force", unit="%", cell=lambda each: numbers.percent(each.relative)
            ),
            TableColumn(heading="RMSE at reversals", unit="N", cell=rmse(0)),
            TableColumn(heading="RMSE elsewhere", unit="N", cell=rmse(1)),
            TableColumn(
                heading="at reversals / elsewhere",
                cell=lambda each: numbers.format_fixed(each.excess_at_reversals, 2),
            ),
        ),
        rows,
        note="The amplitude is half the displacement from one reversal to the next; the motion before the first "
        "reversal and after the last has none. At reversals: the first and the last tenth of the duration of each "
        "half cycle.",
    )


def _half_cycles(comparisons: Sequence[Comparison]) -> _HalfCycles:
    amplitudes, sums = [], []
    for comparison in comparisons:
        test = comparison.test
        ends = half_cycle_ends(test.displacement)
        amplitudes.append(0.5 * np.abs(np.diff(test.displacement[ends])))
        sums.append(_sums(test, ends, comparison.residual))
    amplitude = np.concatenate(amplitudes)
    count, squared_error, squared_force = np.concatenate(sums, axis=-1)
    return _HalfCycles(
        amplitude=amplitude,
        number=_classes(amplitude),
        count=count,
        squared_error=squared_error,
        squared_force=squared_force,
    )


def _sums(test: DamperTest, ends: NDArray[np.intp], residual: Floats) -> Floats:
    """Samples that count, their squared residuals and forces, shape (3, 2, n_half_cycles)."""
    counts = np.zeros(test.n_time)
    counts[test.counted] = 1.0
    sample = np.arange(ends[0], ends[-1])
    index = np.searchsorted(ends, sample, side="right") - 1
    share = (sample - ends[index]) / np.diff(ends)[index]
    between = (share >= _REVERSAL) & (share < 1.0 - _REVERSAL)
    place = index + between * (ends.size - 1)
    weights = counts[sample] * np.stack(
        [np.ones(sample.size), residual[sample] ** 2, (test.force[sample] - test.force.mean()) ** 2]
    )
    sums = [np.bincount(place, weights=each, minlength=2 * (ends.size - 1)) for each in weights]
    return np.reshape(sums, (3, 2, -1))


def _classes(amplitude: Floats) -> NDArray[np.intp]:
    """Number of the class of each amplitude [m], ascending."""
    decade = np.floor(np.log10(np.maximum(1e3 * amplitude, np.finfo(float).tiny)))
    within = np.searchsorted(_ENDS, 1e3 * amplitude / 10.0**decade)
    # The last class of a decade is the first of the next.
    return np.asarray(decade * len(_ENDS) + within, dtype=np.intp)


def _root(total: float, count: float) -> float:
    return math.sqrt(total / count) if count > 0.0 else math.nan


AMPLITUDES = SectionKind(make=lambda _, comparisons: amplitude_section(comparisons))
"""The errors by amplitude, and at reversals."""
