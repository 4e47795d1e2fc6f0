"""Where a table or value stands in a document, and what is wrong there: all mistakes of a document in one refusal."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, NoReturn, TypeVar

from mrwork.base.remark import Remark
from mrwork.errors import InvalidSettingError, MistakesError, MrworkError, SettingError

# What sentences call a table of a file: [[damper]], [controller.settings].
_HEADING = re.compile(r"(?:\ban? )?\[?\[(\w+)([\w.]*)\]\]?")

GivenT = TypeVar("GivenT")
ReadT = TypeVar("ReadT")

KeyPath = tuple[str | int, ...]
"""Keys and array indices that lead to a value, as ("damper", 0, "storey")."""


@contextmanager
def all_mistakes() -> Iterator[Callable[[], AbstractContextManager[None]]]:
    """Raise the mistakes of several parts of a document together, at the end of the block.

    Each part is read in a block of the function that is given; a part with a mistake does not keep others from being
    read. A single mistake is raised as it is, several as a `MistakesError`.
    """
    by_text: dict[tuple[object, str], MrworkError] = {}

    @contextmanager
    def part() -> Iterator[None]:
        try:
            yield
        except MrworkError as error:
            by_text.update({(item.path, str(item)): item for item in error.mistakes or (error,)})

    with part():
        yield part
    mistakes = [*by_text.values()]
    if len(mistakes) == 1:
        raise mistakes[0]
    if mistakes:
        raise MistakesError(mistakes[0].document or "the document", mistakes)


def read_each(read: Callable[[GivenT], ReadT], parts: Iterable[GivenT]) -> list[ReadT]:
    """Read parts of a document each by itself; their mistakes are raised together."""
    results = []
    with all_mistakes() as part:
        for item in parts:
            with part():
                results.append(read(item))
    return results


@contextmanager
def keyed(*keys: str | int) -> Iterator[None]:
    """Say of what the block refuses that these keys lead to it, for whoever knows where the value stands."""
    try:
        yield
    except MrworkError as error:
        for mistake in error.mistakes or (error,):
            mistake.path = (*keys, *mistake.path)
        raise


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where a table or value stands in a document; begins a message.

    With `lines`, by path, a place reads "study.toml, line 12"; without them "frame.toml, rayleigh.ratios". `title`
    names the document. For a call, `arguments` are its arguments by the keys of a file: a place reads "study_of,
    dampers[0].storey", and sentences name `dampers` for [[damper]]. `remarks` are on unusual numbers. `on_table`
    looks up what a table names as soon as it is read. Without an origin errors have the path alone, see `keyed`.
    """

    origin: str = ""
    path: KeyPath = ()
    lines: dict[KeyPath, int] = field(default_factory=dict)
    title: str = "the study"
    arguments: Mapping[str, str] = field(default_factory=dict, repr=False)
    remarks: list[Remark] = field(default_factory=list, repr=False, compare=False)
    on_table: Callable[[Place, Any], None] | None = field(default=None, repr=False, compare=False)

    def within(self, *keys: str | int) -> Place:
        """The place to which further keys lead from here."""
        return replace(self, path=(*self.path, *keys))

    def __str__(self) -> str:
        return f"{self.origin}, {self._where}" if self._where else self.origin

    @property
    def _where(self) -> str:
        """The place in its document; empty for the whole of it."""
        if not self.lines:
            return self._keys()
        return f"line {self.line}" if self.line else ""

    def look_up(self, table: Any) -> None:
        """Look up what a table at this place names; a refusal begins with the place."""
        if self.on_table is not None:
            with self.prefix_errors(SettingError):
                self.on_table(replace(self, on_table=None), table)

    @property
    def line(self) -> int:
        """Line of the value, or of the innermost table or array around it that has a line; 0 where no line is known."""
        paths = (self.path[:n] for n in range(len(self.path), 0, -1))
        return next((self.lines[path] for path in paths if path in self.lines), 0)

    def _keys(self) -> str:
        first = 0 if self.arguments else 1
        path = (*(self.arguments.get(str(key), key) for key in self.path[:1]), *self.path[1:])
        parts = (f"[{key + first}]" if isinstance(key, int) else f".{key}" for key in path)
        return "".join(parts).removeprefix(".")

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
        except MrworkError as error:
            told = [self._about(mistake, kind or type(mistake)) for mistake in error.mistakes or (error,)]
            raise (MistakesError(self.origin, told) if error.mistakes else told[0]) from error

    def _about(self, error: MrworkError, kind: type[MrworkError]) -> MrworkError:
        """The error of a value of this table as one whose message begins with the line of that value."""
        if error.document == self.origin:
            return self._as(kind, str(error), error.below, error.line)
        place = self.within(*error.path)
        if error.key and (*place.path, error.key) in self.lines:
            place = place.within(error.key)
        return place.error(kind, error.in_a_file or str(error))

    def error(self, kind: type[MrworkError], sentence: str) -> MrworkError:
        """An error whose message begins with this place."""
        if not self.origin:
            return InvalidSettingError(self.path, sentence)
        if self.arguments:
            named = self.arguments
            sentence = _HEADING.sub(
                lambda match: f"`{named[match[1]]}{match[2]}`" if match[1] in named else match[0], sentence
            )
        below = f"{self._where}: {sentence}" if self._where else sentence
        return self._as(kind, f"{self}: {sentence}", below, self.line)

    def _as(self, kind: type[MrworkError], text: str, below: str, line: int) -> MrworkError:
        # A place says more than the key of an InvalidSettingError.
        error = (SettingError if kind is InvalidSettingError else kind)(text)
        error.document, error.below, error.line = self.origin, below, line
        return error
