"""TOML texts that may be damaged: too deep, with numbers that nothing can hold; and the lines of their keys."""

from __future__ import annotations

import re
import tomllib
from typing import Any, Final

from mrwork.base.places import KeyPath

_DEEPEST: Final = 100
_MOST_DIGITS: Final = 100
# A key of many parts takes the parser of TOML time and memory in the square of their number.
_LONG_KEY: Final = re.compile(
    rf"""(?:^|[\[{{,])[ \t]*(?:(?:[\w-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*')[ \t]*\.[ \t]*){{{_DEEPEST}}}""",
    re.MULTILINE | re.ASCII,
)
_TOO_DEEP: Final = f"tables and arrays are nested more than {_DEEPEST} deep"


def toml_table(text: str) -> dict[str, Any]:
    """The tables of a TOML text."""
    if _LONG_KEY.search(text):
        raise ValueError(f"a key has more than {_DEEPEST} parts")
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    except ValueError:
        # Python's limit of 4300 digits, without its advice to programmers.
        raise ValueError(f"a whole number has more than {_MOST_DIGITS} digits") from None
    _check_depth(table)
    return table


def _check_depth(value: Any) -> None:
    level = [value]
    for _ in range(_DEEPEST):
        inner: list[Any] = []
        for each in level:
            entries = each.values() if isinstance(each, dict) else each
            for entry in entries if isinstance(each, dict | list) else ():
                if isinstance(entry, dict | list):
                    inner.append(entry)
                elif isinstance(entry, int) and entry.bit_length() > 4 * _MOST_DIGITS:
                    raise ValueError(f"a whole number has more than {_MOST_DIGITS} digits")
        if not inner:
            return
        level = inner
    raise ValueError(_TOO_DEEP)


def toml_lines(text: str) -> dict[KeyPath, int]:
    """The line of every key, table and array element of a text that `toml_table` has read."""
    return _Scanner(text).lines()


_SPACES: Final = re.compile(r"[ \t]*+")
_BLANKS: Final = re.compile(r"(?:[ \t\r\n]++|#[^\n]*+)*+")
_BARE_KEY: Final = re.compile(r"[^=.\]}, \t\r\n#]*+")
_BARE_VALUE: Final = re.compile(r"[^,\]}\r\n#]*+")
# Up to two more quotes belong to a string of three.
_STRING: Final = re.compile(
    r"""\"{3}(?:[^\\]|\\.)*?"{3,5}|'{3}.*?'{3,5}|"(?:[^"\\]|\\.)*+"|'[^']*+'""", re.DOTALL
)


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
        while self._skip_blanks():
            line = self._line
            if self._text.startswith("[[", self._at):
                self._at += 2
                *outer, last = self._key()
                path = (*self._resolve(tuple(outer)), last)
                self._at += 2
                number = self._counts.get(path, 0)
                self._counts[path] = number + 1
                self._found.setdefault(path, line)
                table = (*path, number)
            elif self._text[self._at] == "[":
                self._at += 1
                table = self._resolve(self._key())
                self._at += 1
            else:
                self._pair(table)
                continue
            self._note(table, line)
        return self._found

    def _resolve(self, key: tuple[str, ...]) -> KeyPath:
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
        self._at += 1
        self._take(_SPACES)
        self._value(path)

    def _value(self, path: KeyPath) -> None:
        opening = self._text[self._at]
        if opening == "[":
            self._at += 1
            number = 0
            while self._skip_blanks() and self._text[self._at] != "]":
                self._found[*path, number] = self._line
                self._value((*path, number))
                number += 1
                self._skip_comma()
            self._at += 1
        elif opening == "{":
            self._at += 1
            while self._skip_blanks() and self._text[self._at] != "}":
                self._pair(path)
                self._skip_comma()
            self._at += 1
        else:
            self._take(_STRING if opening in "\"'" else _BARE_VALUE)

    def _key(self) -> tuple[str, ...]:
        """A dotted key, up to the character that ends it."""
        parts: list[str] = []
        while True:
            self._take(_SPACES)
            if self._text[self._at] in "\"'":
                # The parser resolves escapes.
                parts.append(toml_table(f"k = {self._take(_STRING)}")["k"])
            else:
                parts.append(self._take(_BARE_KEY))
            self._take(_SPACES)
            if self._text[self._at] != ".":
                return tuple(parts)
            self._at += 1

    def _skip_comma(self) -> None:
        if self._skip_blanks() and self._text[self._at] == ",":
            self._at += 1

    def _skip_blanks(self) -> bool:
        """Skip blanks and comments; whether a character follows."""
        self._take(_BLANKS)
        return self._at < len(self._text)

    def _take(self, pattern: re.Pattern[str]) -> str:
        """The text that matches from here on, behind which the scanner goes on."""
        match = pattern.match(self._text, self._at)
        text = match[0] if match else ""
        self._line += text.count("\n")
        self._at += len(text)
        return text
