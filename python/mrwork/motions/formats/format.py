"""Text formats of strong-motion records: the lines of a file, the numbers in them, and what a reader declares."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from mrwork.errors import RecordError, SettingError
from mrwork.files.delimited import decoded
from mrwork.motions.ground_motion import GroundMotion
from mrwork.values import Floats

_HEADER_SHOWN = 60
# Characters of a line of a header: what searches it takes longer than in proportion.
_LONGEST = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Lines:
    """Lines of the file at `path`, without line ends."""

    path: Path
    texts: tuple[str, ...]

    def at(self, index: int) -> str:
        """Line of a header by index from 0, as much as one has; an empty text after the last."""
        return self.texts[index][:_LONGEST] if 0 <= index < len(self.texts) else ""

    def where(self, index: int) -> str:
        """Start of a message about a line: file and line number, counted from 1."""
        return f"{self.path}: line {index + 1}"


def lines_of(data: bytes, path: Path) -> Lines:
    """Lines of the bytes of a text file with any line ends; headers of old files may be Latin-1."""
    # Some archives hold files with line ends CR CR LF; a run of CR is looked at once, from its start.
    return Lines(path=path, texts=tuple(re.split(r"(?<!\r)\r*\n|\r", decoded(data))))


def read_numbers(lines: Lines, first: int, end: int | None = None) -> Floats:
    """Read all numbers of the lines from `first` to before `end`, shape (n,)."""
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
    """Whether a word reads as a number, finite or not."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def shown(text: str) -> str:
    """Text as a message quotes it, shortened if it is long."""
    clean = " ".join(text.split())
    return clean if len(clean) <= _HEADER_SHOWN else clean[:_HEADER_SHOWN] + "..."


# The strongest accelerograms reach 4.4 g; values far beyond indicate a wrong unit.
_LARGEST = 200.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Stated:
    """Options of the caller for what a file does not state.

    `unit` of the acceleration; `dt` [s] if there is no column of times; `column` of the acceleration in a table, or its
    variable in a .mat file; `channel`, counted from 1, of a file with several channels.
    """

    unit: str | None = None
    dt: float | None = None
    column: str | None = None
    channel: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """A text format: how its content is recognised, how it is read, and which fields of `Stated` it takes."""

    name: str
    recognises: Callable[[Lines], bool]
    read: Callable[[Lines, Stated], GroundMotion]
    needs: frozenset[str] = frozenset()


def refuse_needless(stated: Stated, needs: frozenset[str], *, source: str, kind: str) -> None:
    """Refuse an option that the format does not take, rather than ignore it."""
    for field in fields(stated):
        if getattr(stated, field.name) is not None and field.name not in needs:
            raise SettingError(f"{source}: {kind} takes no `{field.name}`; leave it out")


def recorded(
    path: Path,
    *,
    dt: float,
    acceleration: Floats,
    source: str,
    name: str | None = None,
    changes: tuple[str, ...] = (),
) -> GroundMotion:
    """Build the motion of a file, by default with the name of the file, which is also added to `source`."""
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


def refuse_absurd(acceleration: Floats, *, source: str) -> None:
    """Refuse accelerations [m/s^2] beyond those of any earthquake."""
    peak = float(np.abs(acceleration).max(initial=0.0))
    if not peak <= _LARGEST:
        raise RecordError(
            f"{source}: a peak of {peak:.4g} m/s2 is beyond any earthquake; check the unit of the acceleration"
        )
