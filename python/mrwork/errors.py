r"""Every error that mrwork raises on purpose: what was expected, what came, what to do.

A name from a file may hold control characters. As they are, they command the terminal, end a line, turn the direction
of writing or make an SVG invalid; half a character, as in a file name that is not UTF-8, cannot be printed at all. So
sentences quote them as escapes, as in `\x1b`.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from typing import Any, Generic, TypeVar

ResultT = TypeVar("ResultT")
ErrorT = TypeVar("ErrorT", bound=BaseException)

# Characters of a sentence: its place stands at the beginning, what to do at the end.
_LONGEST_SENTENCE = 2000
# Mistakes of a document that are listed, and characters of each.
_MOST_LISTED = 20
_LONGEST_LISTED = 500

_NOT_ASCII = re.compile(r"[^\n -~]")

__all__ = [
    "ArgumentError", "Interrupted", "InvalidSettingError", "JournalError", "LibraryError", "MistakesError",
    "MrworkError", "MrworkWarning", "OutputError", "RecordError", "SettingError", "SimulationError", "UnitError",
    "UnknownChoiceError", "UnknownNameError",
]  # fmt: skip


def __dir__() -> list[str]:
    return __all__


def escape_text(text: str) -> str:
    """A name or a sentence, which is to stay in its line."""
    return escaped_lines(text).replace("\n", r"\n")


def escaped_lines(text: str) -> str:
    """A text whose ends of lines are meant."""
    return _NOT_ASCII.sub(_escape, text)


def _escape(match: re.Match[str]) -> str:
    """An escape for a control, a mark of direction or what else has no shape; blanks have one."""
    character = match.group()
    shown = character.isprintable() or unicodedata.category(character) == "Zs"
    return character if shown else character.encode("unicode_escape").decode()


def _restore(kind: type[ErrorT], args: tuple[Any, ...]) -> ErrorT:
    error = kind.__new__(kind, *args)
    error.args = args
    return error


class Restorable(BaseException):
    """What pickles and copies with its type, text and attributes, whatever its constructor takes.

    Python calls the constructor again, with the text alone.
    """

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore, (type(self), self.args), self.__dict__


class MrworkError(Restorable, Exception):
    """Root of all errors that a caller can act on; its text is one clear sentence, in one line whatever it quotes.

    `document` is the file whose place the text begins with, `below` the text without that file, and `line` the line in
    it, 0 where it is not known; the first two are empty if the text does not begin with a place. `path` are the keys
    that lead to what is refused in a value that declares keys, for whoever knows where that value stands. Of an
    argument that is refused, `key` is the name, and `in_a_file` the text for who has written a file and called no
    function; both are empty otherwise. `of_columns` is whether the columns of one file are to be told, which others do
    not share; `mistakes` are those of a document with several.
    """

    document: str = ""
    below: str = ""
    line: int = 0
    path: tuple[str | int, ...] = ()
    of_columns: bool = False
    key: str = ""
    in_a_file: str = ""
    mistakes: tuple[MrworkError, ...] = ()

    def __str__(self) -> str:
        """The sentence, with escapes for what a reader cannot see in what it quotes, and cut in the middle if long."""
        return _in_one_line(super().__str__())


class MrworkWarning(UserWarning):
    """A result will be computed but is likely to mislead; the text is one clear sentence, as of a `MrworkError`."""

    def __str__(self) -> str:
        return _in_one_line(super().__str__())


def _in_one_line(sentence: str, longest: int = _LONGEST_SENTENCE) -> str:
    text = escape_text(sentence)
    return text if len(text) <= longest else f"{text[: longest // 2]} … {text[3 - longest // 2 :]}"


def reason_of(error: BaseException) -> str:
    """The text of an error of a library or of a user's code, in one line; also of one whose text raises."""
    try:
        return " ".join(str(error).split()) or "without a reason"
    except Exception:
        return f"{type(error).__name__} with a text that cannot be shown"


class RecordError(MrworkError, ValueError):
    """A measured record cannot be read or contradicts itself."""


class UnitError(MrworkError, ValueError):
    """A unit is unknown or measures something else."""


class SettingError(MrworkError, ValueError):
    """An option, bound or argument is outside what it may be."""


class MistakesError(SettingError):
    """Several mistakes of one document; its text has a line for each, of which `mistakes` has the errors."""

    def __init__(self, document: str, mistakes: Sequence[MrworkError]) -> None:
        super().__init__(document, mistakes)
        self.document = document
        self.mistakes = tuple(sorted(mistakes, key=lambda mistake: mistake.line))

    def __str__(self) -> str:
        """The mistakes in the order of the document, the first ones where there are many."""
        listed = [
            mistake.below if mistake.document == self.document and mistake.below else str(mistake)
            for mistake in self.mistakes[:_MOST_LISTED]
        ]
        if more := len(self.mistakes) - len(listed):
            listed.append(f"and {more} more")
        head = f"{self.document} has {len(self.mistakes)} mistakes:"
        return "\n  ".join(_in_one_line(entry, _LONGEST_LISTED) for entry in (head, *listed))


class ArgumentError(MrworkError, TypeError):
    """An argument is of another kind than the function takes."""


class InvalidSettingError(SettingError):
    """One setting of a declared table is out of range or clashes with another; `key` is its name, or leads to it."""

    def __init__(self, key: str | tuple[str | int, ...], sentence: str) -> None:
        super().__init__(sentence)
        self.path = (key,) if isinstance(key, str) else key
        self.key = str(self.path[0]) if self.path else ""


class UnknownNameError(MrworkError, LookupError):
    """A model, parameter or data set of that name is not registered."""


class UnknownChoiceError(SettingError, UnknownNameError):
    """An argument is not among the names to choose from."""


class SimulationError(MrworkError, ArithmeticError):
    """A single simulation diverged, or would need a finer step than is allowed."""


class OutputError(MrworkError, OSError):
    """Results cannot be written; what was there before is untouched."""


class JournalError(MrworkError, ValueError):
    """A journal is damaged, in use, or of another run than the one to be resumed."""


class WorkerError(MrworkError, RuntimeError):
    """A part of the work could not be done by a worker of an executor; what was finished before is kept."""


class LibraryError(MrworkError, RuntimeError):
    """A library that a computation needs does not start on this machine; what was computed before is kept."""


class Interrupted(Restorable, KeyboardInterrupt, Generic[ResultT]):
    """Ctrl-C during a long computation; `result` is its partial result, `None` without one.

    The result is of the type that the docstring of the interrupted function names; a function that calls another one
    and is interrupted in it raises its own. It is a KeyboardInterrupt and not a MrworkError: a program that
    does not use the result behaves as with any Ctrl-C.
    """

    def __init__(self, result: ResultT, task: str = "computation", *, stopped: bool = False) -> None:
        super().__init__(f"{task} interrupted")
        self.result = result
        self._stopped = stopped

    @property
    def stopped(self) -> bool:
        """Whether this interrupt, or the one that caused it, is a callback that ended the run instead of Ctrl-C."""
        cause = self.__cause__
        return self._stopped or (isinstance(cause, Interrupted) and cause.stopped)

    def __reduce__(self) -> tuple[Any, ...]:
        """As of every `Restorable`; its cause, which tells `stopped`, is not pickled."""
        restore, made_of, attributes = super().__reduce__()
        return restore, made_of, attributes | {"_stopped": self.stopped}
