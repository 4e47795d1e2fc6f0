"""What studies share: a table for terminal and page, and figures compared with those that a file expects."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from mrwork.arguments import checked
from mrwork.errors import RecordError
from mrwork.store.input_file import TOML, text_of, toml_table
from mrwork.summary import Summarised, Summary


@checked
def departures(found: Mapping[str, Any], file: Path) -> list[str]:
    """One sentence for each value outside its limits; values that were not measured are not compared.

    The file has tables like those of `found`; a value is expected to be equal, or in a range `{ least, most }`, or at a
    `{ value, tolerance }`.

    Raises
    ------
    RecordError
        The file is no such tables.
    """
    text = text_of(file, TOML)
    try:
        expected = toml_table(text)
    except ValueError as reason:
        raise RecordError(f"{file}: is not TOML ({reason}); correct it there") from None
    try:
        return list(_compared("", found, expected))
    except (KeyError, TypeError, AttributeError) as reason:
        raise RecordError(
            f"{file}: an entry is neither a value, a range nor a table ({reason}); correct it there"
        ) from None


def _compared(path: str, found: Mapping[str, Any], expected: Mapping[str, Any]) -> Iterator[str]:
    for name, below in expected.items():
        if name not in found:
            continue
        inner = f"{path}, {name}" if path else name
        value = found[name]
        if not isinstance(below, dict):
            if value != below:
                yield f"{inner} is {value!r}, expected {below!r}"
        elif not {"least", "most", "value"} & below.keys():
            yield from _compared(inner, value, below)
        elif "value" in below:
            if not abs(value - below["value"]) <= below["tolerance"]:
                yield f"{inner} is {value:.5g}, expected {below['value']:g} +- {below['tolerance']:g}"
        elif not below.get("least", -math.inf) <= value <= below.get("most", math.inf):
            yield f"{inner} is {value:.5g}, expected {below}"


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class ResultTable(Summarised):
    """Text in rows; the first column names the row."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""

    def markdown(self) -> str:
        """The table for a README."""
        lines = [
            f"**{self.title}**",
            "",
            _line(self.header),
            _line(("---", *["---:"] * (len(self.header) - 1))),
        ]
        return "\n".join([*lines, *map(_line, self.rows), "", *([self.note, ""] if self.note else [])])

    def html(self) -> str:
        """The table for a page, in a region that scrolls."""
        head = "".join(
            f'<th scope="col"{_number(place)}>{escape(text)}</th>' for place, text in enumerate(self.header)
        )
        body = "".join(
            f'<tr><th scope="row">{escape(row[0])}</th>'
            + "".join(f'<td class="number">{escape(text)}</td>' for text in row[1:])
            + "</tr>"
            for row in self.rows
        )
        note = f'<p class="note">{escape(self.note)}</p>' if self.note else ""
        return (
            f'<h3>{escape(self.title)}</h3><div class="scroll" tabindex="0" role="region" '
            f'aria-label="{escape(self.title)}"><table><thead><tr>{head}</tr></thead>'
            f"<tbody>{body}</tbody></table></div>{note}"
        )

    def _summary(self) -> Summary:
        return Summary(
            title=self.title, columns=self.header, rows=self.rows, notes=(self.note,) if self.note else ()
        )


def _line(cells: tuple[str, ...]) -> str:
    return "| " + " | ".join(cells) + " |"


def _number(place: int) -> str:
    return ' class="number"' if place else ""
