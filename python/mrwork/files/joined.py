"""Two files or more of one test, as of two loggers or a channel a file, as one table: ``motion.csv+load.csv``."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Final

import numpy as np

from mrwork.base.numbers import significant
from mrwork.base.summary import list_names
from mrwork.base.units import factor_of, quantity_of
from mrwork.base.values import Floats
from mrwork.errors import RecordError
from mrwork.files.grid import grid
from mrwork.files.named_columns import ColumnTable, TestQuantity, VectorTable, unit_in_name
from mrwork.store.input_file import exists

# A part whose times are moved: load.csv@-100s.
_MOVED: Final = re.compile(r"(.+)@([+-]?(?:\d+\.?\d*|\.\d+))\s*s")
# Channels that two loggers may share, and the correlation from which on they show one motion; fewest shared samples.
_SHARED: Final[tuple[TestQuantity, ...]] = ("displacement", "force", "velocity")
_ONE_MOTION: Final = 0.9
_FEWEST: Final = 20
# Gauss-Newton steps of a lag.
_STEPS: Final = 5

# Heading of the times of a joined table.
_TIME: Final = "Time (s)"


@dataclass(frozen=True, slots=True)
class Part:
    """A file of a joined test, and what is added to its times [s], if that is stated."""

    path: Path
    moved: float | None = None


def parts_of(path: str | os.PathLike[str]) -> list[Part]:
    """The files of a path as ``motion.csv+load.csv``, the later ones beside the first; the path alone if that exists.

    ``load.csv@-100s`` moves the times of a part.
    """
    text = os.fspath(path)
    if exists(text) or "+" not in text:
        return [Part(Path(text))]
    found: list[Part] = []
    for name in text.split("+"):
        moved = None if exists(name) else _MOVED.fullmatch(name)
        bare = Path(name if moved is None else moved[1])
        beside = found[0].path.parent / bare if found else bare
        found.append(Part(beside if exists(beside) else bare, None if moved is None else float(moved[2])))
    return found if all(exists(part.path) for part in found) else [Part(Path(text))]


@dataclass(kw_only=True, eq=False, repr=False)
class JoinedTable(VectorTable):
    """Columns of several files at the times of one of them; `joined` says how, `is_sure` whether that is known."""

    joined: str
    is_sure: bool = True
    place: Callable[[int], str] = str

    def locate(self, row: int) -> str:
        """Place of a row in the file whose times the table has."""
        return self.place(row)


class _Logger:
    """The columns of one file: its times [s], if any, which name they have, and its other columns of numbers."""

    def __init__(self, part: Part, table: ColumnTable) -> None:
        self.table, self.path, self.moved = table, part.path, part.moved
        numbers = {name: samples for name in table.names if (samples := table.numbers(name)) is not None}
        self.axis = next((name for name in table.names if self._is_time(name) and name in numbers), "")
        self.columns = {name: samples for name, samples in numbers.items() if name != self.axis}
        self.unused = [f"{part.path.name}: '{name}'" for name in table.names if name not in numbers]
        self.unused += [f"{part.path.name}: {each}" for each in table.unused]
        unit = unit_in_name("time", self.axis) or table.units.get(self.axis, "")
        factor = factor_of(unit, "time") or 1.0
        self.is_dated = self.axis in table.stamps
        self.instant = table.instant(self.axis) if self.is_dated else 0.0
        self.time = factor * numbers[self.axis] + (part.moved or 0.0) if self.axis else np.empty(0)
        if self.axis and grid(self.time).falls.size:
            row = int(grid(self.time).falls[0])
            raise RecordError(
                f"{part.path}: {table.locate(row)}: the time does not rise; sort the rows, or delete this one"
            )

    def _is_time(self, name: str) -> bool:
        return unit_in_name("time", name) is not None or name in self.table.stamps

    def drop(self, quantity: TestQuantity) -> None:
        """Leave out what another file has, too."""
        kept = {name: each for name, each in self.columns.items() if unit_in_name(quantity, name) is None}
        self.columns = kept

    def channel(self, quantity: TestQuantity) -> Floats | None:
        """Samples of the one column that is a quantity by its name and unit, in SI."""
        for name, samples in self.columns.items():
            unit = unit_in_name(quantity, name)
            unit = unit or self.table.units.get(name, "") if unit is not None else ""
            if quantity_of(unit) == quantity:
                return (factor_of(unit, quantity) or 1.0) * samples
        return None


def open_joined(parts: Sequence[Part], open_one: Callable[[Path], ColumnTable]) -> JoinedTable:
    """The columns of all parts at the times of the slowest one, over the time that all have.

    Files are joined by a channel that they share, with the lag at which it correlates best, else by their times; files
    without times row by row.
    """
    loggers = [_Logger(part, open_one(part.path)) for part in parts]
    timed = [logger for logger in loggers if logger.axis]
    base = max(timed, key=lambda logger: float(np.median(np.diff(logger.time))), default=loggers[0])
    # Seconds since the year 1 have five decimals in a double.
    origin = min((logger.instant for logger in timed if logger.is_dated), default=0.0)
    for logger in timed:
        logger.time = logger.time + (logger.instant - origin if logger.is_dated else 0.0)
    how, is_sure = list[str](), True
    for logger in loggers:
        if logger is base:
            continue
        words, sure = _bring_together(base, logger)
        how, is_sure = [*how, words], is_sure and sure
    first, last = (
        (max(each.time[0] for each in timed), min(each.time[-1] for each in timed)) if timed else (0.0, 0.0)
    )
    rows = np.arange(_count(base))
    rows = rows[(base.time >= first) & (base.time <= last)] if base.axis else rows
    if rows.size < 2:
        _refuse_apart(timed)
    vectors: dict[str, Floats] = {_TIME: base.time[rows] - base.time[rows[0]]} if base.axis else {}
    units = dict[str, str]()
    for logger in (base, *(each for each in loggers if each is not base)):
        for name, samples in logger.columns.items():
            heading = name if name not in vectors else f"{name}, {logger.path.name}"
            is_own = logger is base or not logger.axis
            vectors[heading] = samples[rows] if is_own else np.interp(base.time[rows], logger.time, samples)
            units[heading] = logger.table.units.get(name, "")
    names = list_names([logger.path.name for logger in loggers])
    digests = "+".join([each.table.sha256 for each in loggers] + [f"{part.moved}" for part in parts])
    return JoinedTable(
        source=names,
        sha256=hashlib.sha256(digests.encode()).hexdigest(),
        vectors=vectors,
        units={name: unit for name, unit in units.items() if unit},
        unused=tuple(each for logger in loggers for each in logger.unused),
        joined=f"{names} are one test: {'; '.join(how)}; {rows.size} rows of {base.path.name}",
        is_sure=is_sure,
        place=lambda row: f"{base.path.name}, {base.table.locate(int(rows[min(row, rows.size - 1)]))}",
    )


def _count(logger: _Logger) -> int:
    return max((samples.size for samples in logger.columns.values()), default=logger.time.size)


def _bring_together(base: _Logger, logger: _Logger) -> tuple[str, bool]:
    """Move the times of a file onto those of the base; how, and whether that is known."""
    if not logger.axis:
        counts = _count(logger), _count(base)
        if counts[0] != counts[1]:
            raise RecordError(
                f"{logger.path} has {counts[0]} rows and no column of times, and {base.path.name} has {counts[1]}; "
                "give it a column of times, as time_s, or cut both to the same rows"
            )
        return f"{logger.path.name} row by row", True
    if logger.moved is None and base.moved is None:
        for quantity in _SHARED:
            one, other = base.channel(quantity), logger.channel(quantity)
            if one is None or other is None:
                continue
            if (lag := _lag(base.time, one, logger.time, other)) is not None:
                logger.time = logger.time + lag
                logger.drop(quantity)
                moved = f"moved by {significant(lag, 4)} s, as the {quantity} in both has it"
                return f"{logger.path.name} {moved}".replace("\N{MINUS SIGN}", "-"), True
    if logger.moved is not None or base.moved is not None:
        return f"{logger.path.name} by times that are moved as stated", True
    is_sure = base.is_dated and logger.is_dated
    return f"{logger.path.name} by {'times of the day' if is_sure else 'their times'}", is_sure


def _lag(time: Floats, one: Floats, times: Floats, other: Floats) -> float | None:
    """What is to be added to the second times [s] so that two channels correlate best; `None` if they show no one."""
    step = min(float(np.median(np.diff(time))), float(np.median(np.diff(times))))
    first, second = (
        np.interp(np.arange(along[0], along[-1] + 0.5 * step, step), along, samples - samples.mean())
        for along, samples in ((time, one), (times, other))
    )
    size = 1 << int(first.size + second.size - 1).bit_length()
    sums = np.fft.irfft(np.fft.rfft(first, size) * np.conj(np.fft.rfft(second, size)), size)
    shifts = np.r_[0 : first.size, -second.size + 1 : 0]
    sums = sums[shifts]
    best = int(np.argmax(sums))
    shift = int(shifts[best])
    begin, end = max(shift, 0), min(first.size, second.size + shift)
    if end - begin < _FEWEST:
        return None
    pair = first[begin:end], second[begin - shift : end - shift]
    if np.corrcoef(*pair)[0, 1] < _ONE_MOTION:
        return None
    lag = float(time[0] - times[0] + shift * step)
    # Between samples: the shift of the slope that leaves the least residual.
    for _ in range(_STEPS):
        shared = time[(time > times[0] + lag) & (time < times[-1] + lag)]
        moved = np.interp(shared, times + lag, other)
        slope, left = np.gradient(moved, shared), moved - np.interp(shared, time, one)
        left = left - left.mean()
        lag += float(slope @ left) / max(float(slope @ slope), np.finfo(np.float64).tiny)
    return lag


def _refuse_apart(timed: Sequence[_Logger]) -> None:
    """Refuse files whose times do not overlap, with what brings them together."""
    first, other = max(combinations(timed, 2), key=lambda pair: abs(pair[0].time[0] - pair[1].time[0]))
    spans = [
        f"{each.path.name} has times from {each.time[0]:g} to {each.time[-1]:g} s" for each in (first, other)
    ]
    lag = float(first.time[0] - other.time[0])
    raise RecordError(
        f"{first.path}: {' and '.join(spans)}, which do not overlap; if both begin together, move one, as in "
        f"{first.path}+{other.path.name}@{lag:g}s"
    )
