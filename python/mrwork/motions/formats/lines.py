"""A text file as its lines, and the numbers in them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError
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
