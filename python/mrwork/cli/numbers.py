"""Numbers and paths of the command line: every option that takes a number has a range, which its help states.

A number outside its range is refused before anything is read, in one sentence that states the range.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mrwork.base.arguments import Threads
from mrwork.base.hints import Within, node_of
from mrwork.base.keys import LARGEST_SEED
from mrwork.dampers.conversions import USUAL_OPENSEES_ERROR, OpenSeesError, OpenSeesTimeStep
from mrwork.search.rules import LARGEST_POPULATION
from mrwork.uncertainty.candidate_tests import (
    AMPLITUDE_RANGE,
    COMMAND_RANGE,
    FREQUENCY_RANGE,
    STROKE_RANGE,
    VELOCITY_RANGE,
)

# As many digits of a number as a message repeats.
_SHOWN = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class Range:
    """The numbers `within` a range, in `unit`; integers where `whole`."""

    within: Within
    unit: str = ""
    whole: bool = False

    @classmethod
    def of(cls, hint: Any) -> Range:
        """The range of an annotated number, that of the function which takes it."""
        node = node_of(hint)
        (within,) = node.notes
        return cls(within=within, whole=node.kind is int)

    @property
    def in_words(self) -> str:
        """The range as the help and messages state it."""
        return f"{self.within.in_words} {self.unit}".rstrip()

    def __call__(self, text: str) -> float:
        """The number that a text gives."""
        try:
            value = int(text) if self.whole else float(text)
        except ValueError:
            raise self._refusal(text) from None
        if value != value or self.within.excludes(value):
            raise self._refusal(text)
        return value

    def _refusal(self, text: str) -> argparse.ArgumentTypeError:
        shown = repr(text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…")
        kind = "a whole number" if self.whole else "a number"
        return argparse.ArgumentTypeError(f"{shown} is not {kind} {self.in_words}")


@dataclass(frozen=True, slots=True)
class Listed:
    """Numbers of a range with commas between, as in 0.005,0.01."""

    of: Range

    @property
    def in_words(self) -> str:
        """The range as the help and messages state it."""
        return f"several with commas between, each {self.of.in_words}"

    def __call__(self, text: str) -> tuple[float, ...]:
        """The numbers that a text gives."""
        try:
            numbers = tuple(self.of(part.strip()) for part in text.split(",") if part.strip())
        except argparse.ArgumentTypeError as refusal:
            raise argparse.ArgumentTypeError(f"{refusal}; write {self.in_words}") from None
        if not numbers:
            raise argparse.ArgumentTypeError(f"{text!r} has no number; write {self.in_words}")
        return numbers


@dataclass(frozen=True, slots=True)
class OrWord:
    """A number of a range, or a word in its place."""

    word: str
    of: Range

    @property
    def in_words(self) -> str:
        """The range as the help and messages state it."""
        return f"{self.word}, or {self.of.in_words}"

    def __call__(self, text: str) -> float | str:
        """The number or the word that a text gives."""
        if text == self.word:
            return text
        try:
            return self.of(text)
        except argparse.ArgumentTypeError as refusal:
            raise argparse.ArgumentTypeError(f"{refusal}, nor {self.word}") from None


Numeric = Range | Listed | OrWord


def _of(ends: tuple[float, float], unit: str) -> Range:
    return Range(within=Within(least=ends[0], most=ends[1]), unit=unit)


SEED = Range(within=Within(least=0, most=LARGEST_SEED), whole=True)
THREADS = Range.of(Threads)
# Instants of a record may count from a far epoch, in seconds.
INSTANT = Range(within=Within(least=-1e10, most=1e10), unit="s")
SETTLE = Range(within=Within(least=0.0, most=1e6), unit="s")
EVERY = Range(within=Within(least=1, most=1_000_000), whole=True)
# The largest population of six parameters is 50 MB, and its generation takes minutes.
POPULATION = Range(within=Within(least=2, most=LARGEST_POPULATION), whole=True)
GENERATIONS = Range(within=Within(least=1, most=1_000_000), whole=True)
SHARE = Range(within=Within(least=0.001, most=0.999999))
DISPERSION = Range(within=Within(least=0.0, most=10.0))
TEMPERING = OrWord("effective", Range(within=Within(least=1e-9, most=1.0)))
SUBSTEP_FACTOR = Range(within=Within(least=1, most=256), whole=True)
# What a rig can do, with room.
STROKE = _of(STROKE_RANGE, "m")
VELOCITY = _of(VELOCITY_RANGE, "m/s")
AMPLITUDE = _of(AMPLITUDE_RANGE, "m")
FREQUENCY = _of(FREQUENCY_RANGE, "Hz")
AMPLITUDES = Listed(AMPLITUDE)
FREQUENCIES = Listed(FREQUENCY)
COMMANDS = Listed(_of(COMMAND_RANGE, "A or V"))
SCALE = Range(within=Within(least=1e-12, most=1e12))
OPENSEES_ERROR = Range.of(OpenSeesError)
TIME_STEP = replace(Range.of(OpenSeesTimeStep), unit="s")


def add_number(
    parser: Any,
    option: str,
    numeric: Numeric,
    help: str,
    *,
    metavar: str,
    default: float | tuple[float, ...] | None = None,
    dest: str | None = None,
) -> None:
    """Declare an option that takes a number, or several; its help ends with the range."""
    says = f"{help}; {numeric.in_words}"
    parser.add_argument(option, type=numeric, help=says, metavar=metavar, default=default, dest=dest)


def add_opensees_error(parser: Any) -> None:
    """--error, of the material BoucWen of OpenSees."""
    add_number(
        parser,
        "--error",
        OPENSEES_ERROR,
        "wanted error of BoucWen in OpenSees, a share of the largest value of z, for which the strain step is stated; "
        f"default {USUAL_OPENSEES_ERROR:g}",
        metavar="SHARE",
    )


def named_path(text: str) -> Path:
    """The path that a text names; an empty one, as of a shell variable that is not set, would be this folder."""
    if not text:
        raise argparse.ArgumentTypeError("the name is empty; give a file or folder, . for this folder")
    return Path(text)
