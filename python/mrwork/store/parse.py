"""Lines of the keys of a TOML text."""

from __future__ import annotations

import re
import tomllib
from collections import deque
from typing import Final

from mrwork.base.places import KeyPath

# A string, a sign or a word, behind blanks and a remark. Up to two more quotes belong to a string of three.
_TOKEN: Final = re.compile(
    r"""[ \t\r]*+(?:#[^\n]*+)?+("{3}(?:[^\\]|\\.)*?"{3,5}|'{3}.*?'{3,5}|"(?:[^"\\]|\\.)*+"|'[^']*+'"""
    r"""|[\n\[\]{}=,]|[^ \t\r\n#\[\]{}=,"']++|\Z)""",
    re.DOTALL,
)


def toml_lines(text: str) -> dict[KeyPath, int]:
    """The line of every key, table and array element of a text that `tomllib` has read."""
    found: dict[KeyPath, int] = {}
    # Index of the last table of each array of tables.
    counts: dict[KeyPath, int] = {}
    # The tokens that are left, each with its line; the last one is empty.
    tokens = deque[tuple[str, int]]()
    line = 1
    for match in _TOKEN.finditer(text):
        tokens.append((match[1], line))
        line += match[1].count("\n")

    def begins_entry(end: str) -> bool:
        while tokens[0][0] in ("\n", ","):
            tokens.popleft()
        return tokens[0][0] != end

    def take_key() -> tuple[str, ...]:
        """The parts of a key; the sign behind it is taken, too."""
        parts: list[str] = []
        while (token := tokens.popleft()[0]) not in ("=", "]"):
            # The parser resolves escapes.
            is_text = token[0] in "\"'"
            parts += [tomllib.loads(f"k = {token}")["k"]] if is_text else filter(None, token.split("."))
        return tuple(parts)

    def note(path: KeyPath, line: int) -> None:
        for length in range(1, len(path) + 1):
            found.setdefault(path[:length], line)

    def take_pair(table: KeyPath) -> None:
        line = tokens[0][1]
        path = (*table, *take_key())
        note(path, line)
        take_value(path)

    def take_value(path: KeyPath) -> None:
        opening, _ = tokens.popleft()
        if opening == "[":
            number = 0
            while begins_entry("]"):
                found[*path, number] = tokens[0][1]
                take_value((*path, number))
                number += 1
            tokens.popleft()
        elif opening == "{":
            while begins_entry("}"):
                take_pair(path)
            tokens.popleft()
        # A time may have a blank.
        while tokens[0][0] not in ("\n", ",", "]", "}", ""):
            tokens.popleft()

    table: KeyPath = ()
    while begins_entry(""):
        if tokens[0][0] != "[":
            take_pair(table)
            continue
        _, line = tokens.popleft()
        if several := tokens[0][0] == "[":
            tokens.popleft()
        table = ()
        for part in take_key():
            # A table in an array of tables is in the last one.
            table = (*table, counts[table], part) if table in counts else (*table, part)
        if several:
            tokens.popleft()
            counts[table] = number = counts.get(table, -1) + 1
            table = (*table, number)
        note(table, line)
    return found
