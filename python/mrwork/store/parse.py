"""TOML texts, and the lines of their keys."""

from __future__ import annotations

import re
import tomllib
from typing import Any, Final

from mrwork.base.places import KeyPath

_DEEPEST: Final = 100
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
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None


# A string, a sign or a word, behind blanks and a remark. Up to two more quotes belong to a string of three.
_TOKEN: Final = re.compile(
    r"""[ \t\r]*+(?:#[^\n]*+)?+("{3}(?:[^\\]|\\.)*?"{3,5}|'{3}.*?'{3,5}|"(?:[^"\\]|\\.)*+"|'[^']*+'"""
    r"""|[\n\[\]{}=,]|[^ \t\r\n#\[\]{}=,"']++|\Z)""",
    re.DOTALL,
)


def toml_lines(text: str) -> dict[KeyPath, int]:
    """The line of every key, table and array element of a text that `toml_table` has read."""
    return _Scanner(text).lines()


class _Scanner:
    """A walk over the tokens of a sound text; `token` is the next one, empty at the end."""

    def __init__(self, text: str) -> None:
        self._matches = _TOKEN.finditer(text)
        self._token, self._line = "", 1
        self._take()
        self._found: dict[KeyPath, int] = {}
        # Index of the last table of each array of tables.
        self._counts: dict[KeyPath, int] = {}

    def _take(self) -> str:
        """The present token, behind which the scanner goes on."""
        taken = self._token
        self._line += taken.count("\n")
        match = next(self._matches, None)
        self._token = match[1] if match else ""
        return taken

    def _begins_entry(self, end: str) -> bool:
        """Skip ends of lines and a comma; whether an entry follows instead of the end."""
        while self._token in ("\n", ","):
            self._take()
        return self._token != end

    def lines(self) -> dict[KeyPath, int]:
        table: KeyPath = ()
        while self._begins_entry(""):
            if self._token != "[":
                self._pair(table)
                continue
            line = self._line
            self._take()
            if several := self._token == "[":
                self._take()
            *outer, last = self._key()
            table = (*self._resolved(outer), last)
            if several:
                self._take()
                self._counts[table] = number = self._counts.get(table, -1) + 1
                table = (*table, number)
            self._note(table, line)
        return self._found

    def _resolved(self, key: list[str]) -> KeyPath:
        """The key of a header, with the index of the last table of each array of tables in it."""
        path: KeyPath = ()
        for part in key:
            path = (*path, part)
            path = (*path, self._counts[path]) if path in self._counts else path
        return path

    def _note(self, path: KeyPath, line: int) -> None:
        for length in range(1, len(path) + 1):
            self._found.setdefault(path[:length], line)

    def _key(self) -> list[str]:
        """The parts of a key; the sign behind it is taken, too."""
        parts: list[str] = []
        while (token := self._take()) not in ("=", "]"):
            # The parser resolves escapes.
            is_text = token[0] in "\"'"
            parts += [tomllib.loads(f"k = {token}")["k"]] if is_text else filter(None, token.split("."))
        return parts

    def _pair(self, table: KeyPath) -> None:
        line = self._line
        path = (*table, *self._key())
        self._note(path, line)
        self._value(path)

    def _value(self, path: KeyPath) -> None:
        opening = self._take()
        if opening == "[":
            number = 0
            while self._begins_entry("]"):
                self._found[*path, number] = self._line
                self._value((*path, number))
                number += 1
            self._take()
        elif opening == "{":
            while self._begins_entry("}"):
                self._pair(path)
            self._take()
        else:
            # A time may have a blank.
            while self._token not in ("\n", ",", "]", "}", ""):
                self._take()
