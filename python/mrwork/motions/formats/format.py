"""Text formats of strong-motion records: the lines of a file, the numbers in them, and what a reader declares."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError, SettingError
from mrwork.motions.ground_motion import GroundMotion
from mrwork.records.formats.delimited import read_text_bytes

_HEADER_SHOWN = 60


@dataclass(frozen=True, slots=True, kw_only=True)
class Lines:
    """Lines of a file, without their ends; `path` is the file's."""

    path: Path
    texts: tuple[str, ...]

    def at(self, index: int) -> str:
        """Line of an index, counted from 0; nothing behind the last."""
        return self.texts[index] if 0 <= index < len(self.texts) else ""

    def where(self, index: int) -> str:
        """Begin a sentence on a line: file and line, counted from 1 as editors do."""
        return f"{self.path}: line {index + 1}"


def open_lines(path: Path) -> Lines:
    """Read a text file whatever the ends of its lines; accents of old headers may be Latin-1.

    Raises
    ------
    RecordError
        The file is empty, or is no text.
    """
    data = read_text_bytes(path, str(path))
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    # Some archives hold files whose lines end in CR CR LF.
    return Lines(path=path, texts=tuple(re.split(r"\r*\n|\r", text)))


def read_numbers(lines: Lines, first: int, end: int | None = None) -> NDArray[np.float64]:
    """Numbers of the lines from `first` to before `end`, as many to a line as there are, shape (n,).

    Raises
    ------
    RecordError
        Something is not a finite number; the sentence names its line.
    """
    texts = lines.texts[first:end]
    try:
        numbers = np.array(" ".join(texts).split(), dtype=np.float64)
    except ValueError:
        numbers = None
    if numbers is not None and np.isfinite(numbers).all():
        return numbers
    index, word = next(
        (index, word)
        for index, text in enumerate(texts, start=first)
        for word in text.split()
        if not is_number(word) or not np.isfinite(float(word))
    )
    raise RecordError(
        f"{lines.where(index)} holds '{shown(word)}' where a number was expected; the file is damaged or in "
        "another format"
    )


def is_number(word: str) -> bool:
    """Tell whether a word reads as a number, be it not a finite one."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def shown(text: str) -> str:
    """Text as a sentence can quote it."""
    clean = " ".join(text.split())
    return clean if len(clean) <= _HEADER_SHOWN else clean[:_HEADER_SHOWN] + "..."


# The strongest accelerograms reach 4.4 g; what is far beyond was read in the wrong unit.
_LARGEST = 200.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Stated:
    """What the caller states because the file does not.

    `unit` of the acceleration; `dt` [s] where there is no column of times; `column` of the acceleration in a table or
    its variable in a .mat file; `channel`, counted from 1, of a file that holds several.
    """

    unit: str | None = None
    dt: float | None = None
    column: str | None = None
    channel: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """A text format: how it is known by its content, how it is read, and which of `Stated` it needs."""

    name: str
    recognises: Callable[[Lines], bool]
    read: Callable[[Lines, Stated], GroundMotion]
    needs: frozenset[str] = frozenset()


def refuse_needless(stated: Stated, needs: frozenset[str], *, source: str, kind: str) -> None:
    """Refuse a statement about what the file itself says, rather than pass over it.

    Raises
    ------
    SettingError
        Names the first option that the format does not take.
    """
    for field in fields(stated):
        if getattr(stated, field.name) is not None and field.name not in needs:
            raise SettingError(f"{source}: {kind} takes no `{field.name}`; leave it out")


def recorded(
    path: Path,
    *,
    dt: float,
    acceleration: NDArray[np.float64],
    source: str,
    name: str | None = None,
    changes: tuple[str, ...] = (),
) -> GroundMotion:
    """Motion of a file, by default of its name; `source` gets the file's name as well.

    Raises
    ------
    RecordError
        The record has fewer than two samples, or no finite step or sample.
    """
    if acceleration.size < 2:
        raise RecordError(
            f"{path}: the record has too few samples ({acceleration.size}); it needs two or more"
        )
    if not (0.0 < dt < np.inf):
        raise RecordError(f"{path}: the step between samples is {dt:g} s; a record needs a positive one")
    refuse_absurd(acceleration, source=str(path))
    return GroundMotion(
        name=path.stem if name is None else name,
        dt=dt,
        acceleration=acceleration,
        source=f"{source} ({path.name})",
        changes=changes,
    )


def refuse_absurd(acceleration: NDArray[np.float64], *, source: str) -> None:
    """Refuse accelerations [m/s^2] beyond any earthquake's.

    Raises
    ------
    RecordError
        The peak is above 20 g.
    """
    peak = float(np.abs(acceleration).max(initial=0.0))
    if not peak <= _LARGEST:
        raise RecordError(
            f"{source}: a peak of {peak:.4g} m/s2 is beyond any earthquake; check the unit of the acceleration"
        )
