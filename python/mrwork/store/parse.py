"""Lines of the keys of a TOML text."""

from __future__ import annotations

import tomllib
from typing import Any

from mrwork.base.places import KeyPath


def toml_lines(text: str) -> dict[KeyPath, int]:
    """The line of every key, table and array element of a text that `tomllib` has read.

    Elements of an array have the line in which it begins, unless each has a line between the brackets.
    """
    lines: dict[KeyPath, int] = {}
    # Index of the last table of each array of tables.
    counts: dict[KeyPath, int] = {}
    table: KeyPath = ()
    statement, first = "", 0
    for last, line in enumerate(text.split("\n"), start=1):
        statement, first = f"{statement}{line}\n", first if statement else last
        if line.rstrip().endswith(",") and "#" not in line:
            continue
        try:
            stated = tomllib.loads(statement)
        except tomllib.TOMLDecodeError:
            # The statement goes on in the next line.
            continue
        if statement.lstrip().startswith("["):
            table, inner = (), stated
            while isinstance(inner, dict) and inner:
                ((name, inner),) = inner.items()
                # A table in an array of tables is in the last one.
                table = (*table, counts[table], name) if table in counts else (*table, name)
            if isinstance(inner, list):
                counts[table] = counts.get(table, -1) + 1
                table = (*table, counts[table])
            for length in range(1, len(table) + 1):
                lines.setdefault(table[:length], first)
        else:
            _note(stated, table, first, last, lines)
        statement = ""
    return lines


def _note(value: Any, path: KeyPath, first: int, last: int, lines: dict[KeyPath, int]) -> None:
    """Enter the line of each key in `value`, whose text reaches from line `first` to line `last`, into `lines`."""
    a_line_each = isinstance(value, list) and len(value) == last - first - 1
    items = dict(enumerate(value)) if isinstance(value, list) else value
    for number, (name, inner) in enumerate(items.items() if isinstance(items, dict) else (), start=1):
        begin, end = (first + number, first + number) if a_line_each else (first, last)
        lines.setdefault((*path, name), begin)
        _note(inner, (*path, name), begin, end, lines)
