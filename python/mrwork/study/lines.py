"""Line of each key of a TOML document, which the standard parser does not return.

The scanner assumes a valid document: the parser reads it first.
"""

from __future__ import annotations

from typing import Any

from mrwork.errors import SettingError
from mrwork.keys import KeyPath
from mrwork.store.parse import toml_table

_BLANK = " \t\r\n"
_BARE_ENDS = frozenset("=.]}, \t\r\n#")
_VALUE_ENDS = frozenset(",]}\r\n#")


def parse(text: str, origin: str) -> tuple[dict[str, Any], dict[KeyPath, int]]:
    """A TOML document, and the line of every key, table and array element in it."""
    try:
        document = toml_table(text)
    except ValueError as reason:
        raise SettingError(f"{origin} is not TOML: {_with_small_first(str(reason))}") from None
    return document, _Scanner(text).lines()


def _with_small_first(text: str) -> str:
    return text[:1].lower() + text[1:]


class _Scanner:
    def __init__(self, text: str) -> None:
        self._text = text
        self._at = 0
        self._line = 1
        self._found: dict[KeyPath, int] = {}
        # Number of tables of each array of tables so far.
        self._counts: dict[KeyPath, int] = {}

    def lines(self) -> dict[KeyPath, int]:
        table: KeyPath = ()
        while self._skip_blank():
            line = self._line
            if self._text.startswith("[[", self._at):
                self._forward(2)
                *outer, last = self._key()
                path = (*self._resolved(tuple(outer)), last)
                self._forward(2)
                number = self._counts.get(path, 0)
                self._counts[path] = number + 1
                self._found.setdefault(path, line)
                table = (*path, number)
            elif self._text[self._at] == "[":
                self._forward(1)
                table = self._resolved(self._key())
                self._forward(1)
            else:
                self._pair(table)
                continue
            self._note(table, line)
        return self._found

    def _resolved(self, key: tuple[str, ...]) -> KeyPath:
        """The key of a header, with the index of the last table of each array of tables in it."""
        path: KeyPath = ()
        for part in key:
            path = (*path, part)
            if path in self._counts:
                path = (*path, self._counts[path] - 1)
        return path

    def _note(self, path: KeyPath, line: int) -> None:
        for length in range(1, len(path) + 1):
            self._found.setdefault(path[:length], line)

    def _pair(self, table: KeyPath) -> None:
        line = self._line
        path = (*table, *self._key())
        self._note(path, line)
        self._forward(1)
        self._skip_spaces()
        self._value(path)

    def _value(self, path: KeyPath) -> None:
        opening = self._text[self._at]
        if opening == "[":
            self._forward(1)
            number = 0
            while self._skip_blank() and self._text[self._at] != "]":
                self._found[*path, number] = self._line
                self._value((*path, number))
                number += 1
                self._skip_comma()
            self._forward(1)
        elif opening == "{":
            self._forward(1)
            while self._skip_blank() and self._text[self._at] != "}":
                self._pair(path)
                self._skip_comma()
            self._forward(1)
        elif opening in "\"'":
            self._string()
        else:
            while self._at < len(self._text) and self._text[self._at] not in _VALUE_ENDS:
                self._forward(1)

    def _key(self) -> tuple[str, ...]:
        """A dotted key, up to the character that ends it."""
        parts: list[str] = []
        while True:
            self._skip_spaces()
            start = self._at
            if self._text[start] in "\"'":
                self._string()
                # The parser resolves escapes.
                parts.append(toml_table(f"k = {self._text[start : self._at]}")["k"])
            else:
                while self._text[self._at] not in _BARE_ENDS:
                    self._forward(1)
                parts.append(self._text[start : self._at])
            self._skip_spaces()
            if self._text[self._at] != ".":
                return tuple(parts)
            self._forward(1)

    def _string(self) -> None:
        quote = self._text[self._at]
        if self._text.startswith(quote * 3, self._at):
            end = self._at + 3
            while not self._text.startswith(quote * 3, end):
                end += 2 if quote == '"' and self._text[end] == "\\" else 1
            end += 3
            # Up to two more quotes belong to the string.
            while self._text.startswith(quote, end):
                end += 1
        else:
            end = self._at + 1
            while self._text[end] != quote:
                end += 2 if quote == '"' and self._text[end] == "\\" else 1
            end += 1
        self._forward(end - self._at)

    def _skip_comma(self) -> None:
        if self._skip_blank() and self._text[self._at] == ",":
            self._forward(1)

    def _skip_blank(self) -> bool:
        """Skip blanks and comments; whether a character follows."""
        while self._at < len(self._text):
            if self._text[self._at] == "#":
                end = self._text.find("\n", self._at)
                self._at = len(self._text) if end < 0 else end
            elif self._text[self._at] in _BLANK:
                self._forward(1)
            else:
                return True
        return False

    def _skip_spaces(self) -> None:
        while self._text[self._at] in " \t":
            self._forward(1)

    def _forward(self, count: int) -> None:
        self._line += self._text.count("\n", self._at, self._at + count)
        self._at += count
