"""What is printed: files of C, and the signals that go in and out of them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from math import isfinite, isnan
from string import Template
from textwrap import wrap
from typing import Final, Literal

from mrwork import _rust
from mrwork.base.values import Floats
from mrwork.errors import SettingError, escape_text

# Words that C or its header math.h has taken, of those that parameters and folders may be called.
_TAKEN = frozenset({
    "auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum", "exp", "extern",
    "float", "for", "goto", "if", "inline", "int", "log", "long", "main", "pow", "register", "restrict", "return",
    "short", "signed", "sizeof", "sqrt", "static", "struct", "switch", "tanh", "typedef", "union", "unsigned", "void",
    "volatile", "while", "fma",
})  # fmt: skip
_WIDTH = 116
USUAL_SAMPLE_TIME: Final = 1e-3
"""Time between two samples of a rig's controller where none is given [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal:
    """A number that goes into printed code or comes out of it: a name of C, an entry of an array with its place."""

    name: str
    unit: str
    description: str
    value: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CSource:
    """Printed code: `name` begins every name of it, `files` have their texts by name.

    A controller has no states of its own that others could integrate. `notes` are sentences for who runs it.
    """

    name: str
    kind: Literal["damper", "controller"]
    description: str
    files: dict[str, str]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    parameters: tuple[Signal, ...]
    n_states: int
    is_lagged: bool
    sample_time: float
    substeps: int
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Flavour:
    """Numbers and elementary functions of printed code.

    In `double` with functions of our own it has the bits of the lanes; `libm` calls those of `math.h`, and `single` is
    in `float` and calls them, too.
    """

    libm: bool = False
    single: bool = False

    @property
    def real(self) -> str:
        """The type of numbers."""
        return "float" if self.single else "double"

    @property
    def share(self) -> float:
        """Share of the largest force by which the code may differ from the lanes, zero for the same bits."""
        return 1e-4 if self.single else 1e-13 if self.libm else 0.0

    def number(self, value: float) -> str:
        """A number that a compiler reads back to the bit."""
        if not isfinite(value):
            return f"({'-' if value < 0.0 else ''}({self.real}){'NAN' if isnan(value) else 'INFINITY'})"
        return f"{float(value)!r}{'f' if self.single else ''}"

    def fill(self, frame: str, **values: object) -> str:
        """A frame with its names replaced."""
        words = {word: f"{word}f" if self.single else word for word in ("fma", "fabs")}
        numbers = {name: self.number(value) for name, value in _NUMBERS.items()}
        template = Template((files("mrwork.embedded") / "frames" / frame).read_text(encoding="utf-8"))
        return template.substitute(real=self.real, **words, **numbers, **values)

    def preamble(self, *, calls: bool) -> dict[str, str]:
        """What printed formulas need; elementary functions where they call some."""
        return {"runtime": self.fill("runtime.c"), "elementary": self._elementary() if calls else ""}

    def _elementary(self) -> str:
        if not (self.libm or self.single):
            return self.fill("elementary.c", functions=_rust.elementary_functions())
        suffix = "f" if self.single else ""
        names = {"exp": "exp", "ln": "log", "pow": "pow", "tanh": "tanh"}
        return "".join(f"#define mr_{own} {name}{suffix}\n" for own, name in names.items())


Status = Literal[
    "command_limited", "rate_limited", "outside_tested", "state_healed", "sample_missed", "parameters_refused"
]
# Bits of a word of status, in their order; the readings come behind.
_STATUS: Final[dict[Status, str]] = {
    "command_limited": "a command was held to its limit",
    "rate_limited": "a command was held back by the largest rate",
    "outside_tested": "the velocity is beyond that of the tests",
    "state_healed": "a state was not a number, and began anew",
    "sample_missed": "samples were missed before this one",
    "parameters_refused": "parameters were not numbers, and stayed as they were",
}
_FIRST_REPLACED: Final = 256
_NUMBERS = {"zero": 0.0, "half": 0.5, "one": 1.0, "two": 2.0, "nearly": 0.999, "hundredth": 0.01}


def c_name(text: str) -> str:
    """A name of C made of a text: letters, digits and underscores."""
    name = re.sub(r"\W", "_", text, flags=re.ASCII)
    if not name.strip("_"):
        raise SettingError(
            f"{text!r} has no letter or digit that a name of C could have; give a folder another name"
        )
    return f"_{name}" if name[0].isdigit() or name in _TAKEN else name


def c_names(texts: Sequence[str]) -> list[str]:
    """Distinct names of C."""
    names: list[str] = []
    for text in texts:
        name = c_name(text)
        while name in names:
            name += "_"
        names.append(name)
    return names


def head_of(name: str, sentences: Iterable[str]) -> str:
    """The comment that begins printed code, with how to compile it, in lines that are read beside the code."""
    lines = (
        *sentences,
        f"Compile: cc -std=c99 -O2 -ffp-contract=off {name}.c {name}_check.c -lm; on x86 with -mfma, or fma is a slow "
        "call. Rounding to nearest.",
        f"Printed by mrwork {_rust.__version__}, under its MIT licence.",
    )
    parts = (part for line in lines for part in wrap(within_comment(line), _WIDTH) or [""])
    return "\n".join(f" * {part}".rstrip() for part in parts)


def status_bit(status: Status) -> int:
    """Its bit in a word of status."""
    return 1 << [*_STATUS].index(status)


def status_of(macro: str, signals: Sequence[str], *happened: Status) -> str:
    """Entries of the enumeration of a word of status: what may happen, and the readings that may be replaced."""
    bits = {str(status): (status_bit(status), _STATUS[status]) for status in happened}
    bits |= {
        f"{signal}_replaced": (
            _FIRST_REPLACED << place,
            f"a reading of {signal} was replaced or held to its limit",
        )
        for place, signal in enumerate(signals)
    }
    return ",\n".join(
        f"    {macro}_{status.upper()} = {bit} /* {words} */" for status, (bit, words) in bits.items()
    )


def table_rows(columns: Floats) -> str:
    """A table of the check of printed code, shape (n_rows, n_columns), as C has it."""
    return ",\n".join("    {" + ", ".join(map(repr, row)) + "}" for row in columns.tolist())


def within_comment(text: str) -> str:
    """A text, as a name of a user, that neither ends a comment of C nor begins another."""
    return escape_text(" ".join(text.split())).replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?")
