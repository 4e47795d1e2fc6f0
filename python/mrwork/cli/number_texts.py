"""Numbers and paths of the command line: every option that takes a number has a range, which its help states.

A number outside its range is refused before anything is read, in one sentence that states the range.
"""

from __future__ import annotations

import argparse
from contextlib import suppress
from dataclasses import dataclass, replace
from math import inf, isfinite
from pathlib import Path

from mrwork.base.arguments import Threads
from mrwork.base.hints import Hint, InUnit, Within, instead_of, node_of

# As many digits of a number as a message repeats.
_DIGITS_SHOWN = 40
# Integers from which on a limit is the machine's.
_NO_LIMIT = 2**53


@dataclass(frozen=True, slots=True, kw_only=True)
class Range:
    """The numbers `within` a range, in `unit`, integers where `whole`; or a `word` in the place of one."""

    within: Within
    unit: str = ""
    whole: bool = False
    word: str = ""

    @classmethod
    def of(cls, node: Hint) -> Range:
        """The range that a number is annotated with."""
        within = next((note for note in node.notes if isinstance(note, Within)), Within())
        unit = next((note.unit for note in node.notes if isinstance(note, InUnit)), "")
        return cls(within=within, unit=unit, whole=node.kind is int)

    @property
    def in_words(self) -> str:
        """The range as the help and messages state it; the largest integers are no limit."""
        within = replace(self.within, most=inf) if self.within.most >= _NO_LIMIT else self.within
        numbers = f"{within.in_words} {self.unit}".strip()
        return f"{self.word}, or {numbers}" if self.word else numbers

    @property
    def metavar(self) -> str:
        """What stands for the number in the help."""
        return self.unit.upper() if self.unit.isalpha() else "N" if self.whole else "NUMBER"

    def __call__(self, text: str) -> float | str:
        """The number that a text gives, or its `word`; refused outside of the range."""
        if text and text == self.word:
            return text
        with suppress(ValueError):
            value = int(text) if self.whole else float(text)
            if not instead_of(value, (self.within,)):
                return value
        shown = repr(text if len(text) <= _DIGITS_SHOWN else f"{text[:_DIGITS_SHOWN]}…")
        kind, within = "a whole number" if self.whole else "a number", replace(self, word="").in_words
        nor = f", nor {self.word}" if self.word else ""
        raise argparse.ArgumentTypeError(f"{shown} is not {kind} {within}".rstrip() + nor)


@dataclass(frozen=True, slots=True)
class Listed:
    """Numbers of a range with commas between, as in 0.005,0.01."""

    of: Range

    @property
    def in_words(self) -> str:
        """The range as the help and messages state it."""
        return f"several with commas between, each {self.of.in_words}"

    def __call__(self, text: str) -> tuple[float | str, ...]:
        """The numbers of a text with commas between; refused where there is none."""
        try:
            numbers = tuple(self.of(part.strip()) for part in text.split(",") if part.strip())
        except argparse.ArgumentTypeError as refusal:
            raise argparse.ArgumentTypeError(f"{refusal}; write {self.in_words}") from None
        if not numbers:
            raise argparse.ArgumentTypeError(f"{text!r} has no number; write {self.in_words}")
        return numbers


THREADS = Range.of(node_of(Threads))


def finite_number(text: str) -> float:
    """The number that a text gives; NaN and infinity are refused."""
    try:
        value = float(text)
    except ValueError:
        value = inf
    if not isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number; write it as 1500 or 1.5e3")
    return value


def named_path(text: str) -> Path:
    """The path that a text names; an empty one, as of a shell variable that is not set, would be this folder."""
    if not text:
        raise argparse.ArgumentTypeError("the name is empty; give a file or folder, . for this folder")
    return Path(text)
