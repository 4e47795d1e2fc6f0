"""Where a table or value stands in a document, and what is wrong there: all mistakes of a document in one refusal.

A reader goes on behind a mistake: what depends on what could not be read is `Unread`, which is no mistake of its own.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import NoReturn, TypeVar, TypeVarTuple

from mrwork.errors import MOST_MISTAKES, InvalidSettingError, MistakesError, MrworkError, SettingError

T = TypeVar("T")
Given = TypeVarTuple("Given")

# What sentences call a table of a file: [[damper]], [controller.settings].
_HEADING = re.compile(r"(?:\ban? )?\[?\[(\w+)([\w.]*)\]\]?")

KeyPath = tuple[str | int, ...]
"""Keys and array indices that lead to a value, as ("damper", 0, "storey")."""


class Unread(Exception):  # noqa: N818 # no error: it ends the reading of what depends on a mistake
    """What was asked for could not be read, because of a mistake that has been kept."""


@dataclass(slots=True)
class _Mistakes:
    """Mistakes of a document by their texts, while it is read."""

    by_text: dict[str, MrworkError] = field(default_factory=dict)
    is_open: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where a table or value stands in a document; begins a message.

    With `lines`, the line of each path, a place reads "study.toml, line 12"; without them it names the keys, as in
    "frame.toml, rayleigh.ratios". `title` is what messages call the document. Where that is a call, `arguments` has the
    names of its arguments by the keys of a file: a place reads "study_of, dampers[0].storey", and sentences name
    `dampers` for [[damper]]. `questions` are sentences on numbers that a document may have, and that are unusual.
    """

    origin: str
    path: KeyPath = ()
    lines: dict[KeyPath, int] = field(default_factory=dict)
    title: str = "the study"
    arguments: Mapping[str, str] = field(default_factory=dict, repr=False)
    mistakes: _Mistakes | None = field(default=None, repr=False, compare=False)
    questions: list[str] = field(default_factory=list, repr=False, compare=False)

    def within(self, *keys: str | int) -> Place:
        """The place of something inside."""
        return replace(self, path=(*self.path, *keys))

    def __str__(self) -> str:
        line = self.line
        where = (f"line {line}" if line else "") if self.lines else self._keys()
        return f"{self.origin}, {where}" if where else self.origin

    @property
    def line(self) -> int:
        """The line, or that of what it is in; 0 where it is not known."""
        known = (self.path[:n] for n in range(len(self.path), 0, -1))
        return next((self.lines[path] for path in known if path in self.lines), 0)

    def _keys(self) -> str:
        first = 0 if self.arguments else 1
        path = (*(self.arguments.get(str(key), key) for key in self.path[:1]), *self.path[1:])
        parts = (f"[{key + first}]" if isinstance(key, int) else f".{key}" for key in path)
        return "".join(parts).removeprefix(".")

    def take_for(self, name: str, meant: str) -> None:
        """Know the lines of what is below a name by another one, too."""
        given, taken = (*self.path, name), (*self.path, meant)
        for path, line in [*self.lines.items()]:
            if path[: len(given)] == given:
                self.lines.setdefault((*taken, *path[len(given) :]), line)

    @property
    def table(self) -> str:
        """What messages call the table: [hardware], [[damper]]."""
        keys = [str(part) for part in self.path if isinstance(part, str)]
        if not keys:
            return self.title
        if self.arguments:
            return self._keys()
        return f"[[{'.'.join(keys)}]]" if isinstance(self.path[-1], int) else f"[{'.'.join(keys)}]"

    def refuse(self, sentence: str) -> NoReturn:
        """Raise a SettingError that begins with this place."""
        raise self.error(SettingError, sentence)

    @contextmanager
    def prefix_errors(self, kind: type[MrworkError] | None = None) -> Iterator[None]:
        """Begin the message of an error in the block with this place; the type is `kind`, or stays."""
        try:
            yield
        except MistakesError as several:
            raise MistakesError(
                self.origin, [self._prefix_error(each, kind) for each in several.mistakes]
            ) from several
        except MrworkError as error:
            prefixed = self._prefix_error(error, kind)
            if prefixed is error:
                raise
            raise prefixed from error

    def _prefix_error(self, error: MrworkError, kind: type[MrworkError] | None) -> MrworkError:
        changed = kind or type(error)
        if error.document != self.origin:
            return self.about(error, changed)
        return error if isinstance(error, changed) else self._as(changed, str(error), error.line)

    def about(self, error: MrworkError, kind: type[MrworkError]) -> MrworkError:
        """The error of a value of this table as one whose message begins with the line of that value."""
        own = isinstance(error, InvalidSettingError) or (*self.path, error.key) in self.lines
        place = self.within(error.key) if own else self
        return place.error(kind, error.in_a_file or str(error))

    def error(self, kind: type[MrworkError], sentence: str) -> MrworkError:
        """An error whose message begins with this place."""
        if self.arguments:
            sentence = _HEADING.sub(self._argument, sentence)
        return self._as(kind, f"{self}: {sentence}", self.line)

    def _argument(self, heading: re.Match[str]) -> str:
        name, below = heading.groups()
        return f"`{self.arguments[name]}{below}`" if name in self.arguments else heading.group()

    def _as(self, kind: type[MrworkError], text: str, line: int) -> MrworkError:
        # A place says more than the key of an InvalidSettingError.
        error = (SettingError if kind is InvalidSettingError else kind)(text)
        error.document, error.line = self.origin, line
        return error

    @contextmanager
    def collecting(self) -> Iterator[Place]:
        """Keep mistakes of `attempt` and `keeping` of the place that is given until the block ends, which raises them.

        One is raised as it is, several as a `MistakesError`. Where the document collects already, the block adds to it.
        """
        if self.mistakes is not None and self.mistakes.is_open:
            yield self
            return
        mistakes = _Mistakes()
        place = replace(self, mistakes=mistakes)
        try:
            with place.keeping():
                yield place
        finally:
            mistakes.is_open = False
        if len(mistakes.by_text) == 1:
            raise next(iter(mistakes.by_text.values()))
        if mistakes.by_text:
            raise MistakesError(self.origin, [*mistakes.by_text.values()])

    @property
    def is_full(self) -> bool:
        """Whether so many mistakes have been kept that the document is read no further."""
        return self.mistakes is not None and len(self.mistakes.by_text) >= MOST_MISTAKES

    @contextmanager
    def keeping(self) -> Iterator[None]:
        """Keep the mistake with which the block ends, if any; what comes after the block is read all the same."""
        if self.mistakes is None or not self.mistakes.is_open:
            yield
            return
        try:
            yield
        except MrworkError as error:
            several = error.mistakes if isinstance(error, MistakesError) else (error,)
            self.mistakes.by_text |= {str(each): each for each in several}
        except Unread:
            pass

    def attempt(self, read: Callable[[*Given], T], *given: *Given) -> Callable[[], T]:
        """Read a part of the document; whoever then calls for a part that has a mistake is `Unread`, too."""
        results: list[T] = []
        if not self.is_full:
            with self.keeping():
                results.append(read(*given))

        def part() -> T:
            if not results:
                raise Unread
            return results[0]

        return part
