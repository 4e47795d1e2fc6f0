"""COSMOS strong-motion format, version 1.x: text, integer and real header, comments, then a series.

A line before each header and series states how many numbers follow and in which Fortran format. A file holds one or
several channels in succession ("COSMOS Strong Motion Data Format", version 1.20, 2001).
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError
from mrwork.motions.formats.format import Format, Lines, Stated, recorded, shown
from mrwork.motions.ground_motion import GroundMotion
from mrwork.units import factor_to_si
from mrwork.values import holds_arrays

_UNKNOWN = -999.0
# Positions in the real header, from 1: step of a processed series [ms], and of the recorder [s].
_PROCESSED_STEP = 62
_RECORDER_STEP = 34
_FIRST = re.compile(r"\(Format v\s*0*1\.[0-9]+ with\s+([0-9]{1,9}) text lines\)", re.IGNORECASE)
_BLOCK = re.compile(
    r"\s*([0-9]{1,9})\s.*Format\s*=\s*\((?:[0-9]+P,?)?([0-9]{1,9})[IFE]([0-9]{1,9})(?:\.[0-9]+)?",
    re.IGNORECASE,
)
_COMMENTS = re.compile(r"\s*([0-9]{1,9})\s+Comment", re.IGNORECASE)
_UNIT = re.compile(r"units\s*=\s*([^\s,()]+)", re.IGNORECASE)


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class _Series:
    """A channel: its title, first line, unit, step [s], and numbers in the unit of the file."""

    title: str
    head: int
    unit: str
    dt: float
    numbers: NDArray[np.float64]


def _recognises(lines: Lines) -> bool:
    return _FIRST.search(lines.at(0)) is not None


def _read(lines: Lines, stated: Stated) -> GroundMotion:
    channels: list[_Series] = []
    place = 0
    while place < len(lines.texts):
        title = _FIRST.search(lines.at(place))
        if title is None:
            place += 1
        else:
            series, place = _series(lines, place, title)
            channels.append(series)
    if stated.channel is None and len(channels) > 1:
        listed = ", ".join(
            f"{number} {shown(series.title)}" for number, series in enumerate(channels, start=1)
        )
        raise RecordError(
            f"{lines.path}: holds {len(channels)} channels ({listed}); choose one with `channel`"
        )
    number = 1 if stated.channel is None else stated.channel
    if not 1 <= number <= len(channels):
        raise RecordError(f"{lines.path}: has no channel {number}; it holds {len(channels)}, counted from 1")
    chosen = channels[number - 1]
    if "acceleration" not in chosen.title.lower():
        raise RecordError(
            f"{lines.where(chosen.head)}: the series is '{shown(chosen.title)}'; give one of acceleration"
        )
    if chosen.unit.lower().startswith("c") and not chosen.unit.lower().startswith("cm"):
        raise RecordError(
            f"{lines.where(chosen.head)}: the series is in counts of the recorder; give the uncorrected or "
            "corrected acceleration of the same record, which are in physical units"
        )
    factor = factor_to_si(chosen.unit, "acceleration", context=lines.where(chosen.head))
    return recorded(
        lines.path,
        name=lines.path.stem if stated.channel is None else f"{lines.path.stem}_{number}",
        dt=chosen.dt,
        acceleration=factor * chosen.numbers,
        source=f"{' '.join(lines.at(chosen.head + 4).split())}, {shown(chosen.title)}",
    )


def _series(lines: Lines, head: int, title: re.Match[str]) -> tuple[_Series, int]:
    """Series of the channel whose text header begins at `head` with its title, and the index of the line after it."""
    place = head + int(title[1])
    _, place = _block(lines, place, "integer header")
    real, place = _block(lines, place, "real header")
    comments = _COMMENTS.match(lines.at(place))
    if comments is not None:
        place += 1 + int(comments[1])
    unit = _UNIT.search(lines.at(place))
    numbers, end = _block(lines, place, "series")
    if unit is None:
        raise RecordError(f"{lines.where(place)}: expected 'units=', found '{shown(lines.at(place))}'")
    series = _Series(
        title=lines.at(head)[: title.start()].strip(),
        head=head,
        unit=unit[1],
        dt=_step(lines, real),
        numbers=numbers,
    )
    return series, end


def _block(lines: Lines, place: int, what: str) -> tuple[NDArray[np.float64], int]:
    """Numbers announced by the line at `place`, and the index of the line after them.

    Columns may touch, so they are split at the widths of the stated format.
    """
    announced = _BLOCK.match(lines.at(place))
    if announced is None:
        raise RecordError(
            f"{lines.where(place)}: expected the line before the {what}, which states how many numbers follow and in "
            f"which format, found '{shown(lines.at(place))}'; the file is cut off or damaged"
        )
    n_numbers, per_line, width = (int(announced[group]) for group in (1, 2, 3))
    numbers: list[float] = []
    end = place + 1 + -(-n_numbers // max(per_line, 1))
    for index in range(place + 1, min(end, len(lines.texts))):
        text = lines.texts[index]
        words = [
            text[start : start + width] for start in range(0, min(len(text), per_line * width), max(width, 1))
        ]
        for word in words:
            try:
                value = float(word)
            except ValueError:
                value = float("nan")
            if np.isfinite(value):
                numbers.append(value)
            elif word.strip():
                raise RecordError(
                    f"{lines.where(index)} holds '{shown(word)}' where a number of the {what} was expected; the "
                    "file is cut off or damaged"
                )
    if len(numbers) != n_numbers:
        raise RecordError(
            f"{lines.where(place)} announces {n_numbers} numbers of the {what}, {len(numbers)} follow; the file is "
            "cut off or damaged, fetch it again"
        )
    return np.array(numbers), end


def _step(lines: Lines, real: NDArray[np.float64]) -> float:
    steps = []
    if real.size >= _PROCESSED_STEP:
        steps = [1e-3 * real[_PROCESSED_STEP - 1], real[_RECORDER_STEP - 1]]
    for step in steps:
        if step > 0.0:
            return float(step)
    raise RecordError(
        f"{lines.path}: the real header states no step between samples (values {_PROCESSED_STEP} and "
        f"{_RECORDER_STEP}, {_UNKNOWN:g} where unknown); save the series as two columns, time and acceleration"
    )


COSMOS = Format(name="a COSMOS record", recognises=_recognises, read=_read, needs=frozenset({"channel"}))
