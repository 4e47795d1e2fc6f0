"""Cells of the rows of a text table: the fields of a line, the numbers in them, and refusals that name the line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

from mrwork.errors import RecordError
from mrwork.records.formats.layout import DECIMAL_COMMA, MISSING, NUMBER, split


@dataclass(frozen=True, slots=True, kw_only=True)
class Cells:
    """Cells of the table of a file: the file for messages, the names of the columns, and the delimiter."""

    source: str
    names: tuple[str, ...]
    delimiter: str | None

    def of_line(self, line: str) -> list[str]:
        """Fields of a row without its remark; empty ones at its end that have no name are left out."""
        fields = [field.strip() for field in split(line.partition("#")[0], self.delimiter)]
        while len(fields) > len(self.names) and not fields[-1]:
            fields.pop()
        return fields

    def refuse_width(self, line: int, n_fields: int) -> NoReturn:
        """Refuse a line, counted from 1, for its number of fields."""
        hint = (
            "these may be decimal commas between commas: export with decimal points, or with semicolons between "
            "the columns"
            if self.delimiter == "," and n_fields > len(self.names)
            else "complete or delete the line"
        )
        raise RecordError(
            f"{self.source}: line {line} has {_count(n_fields, 'field')} where the header "
            f"names {_count(len(self.names), 'column')}; {hint}"
        )

    def refuse_text(self, line: int, column: int, text: str) -> NoReturn:
        """Refuse a cell that is no number, in a line counted from 1 and a column counted from 0."""
        where = f"{self.source}: line {line}, column '{self.names[column]}'"
        shown = text if len(text) <= 40 else text[:40] + "..."
        raise RecordError(f"{where} holds '{shown}' where a number was expected; correct or delete the line")

    def refuse_time(self, line: int, column: int, text: str) -> NoReturn:
        """Refuse a cell that is no time of the day in a column of these."""
        where = f"{self.source}: line {line}, column '{self.names[column]}'"
        shown = text if len(text) <= 40 else text[:40] + "..."
        raise RecordError(
            f"{where} holds '{shown}' where a time such as 2024-05-01 12:00:00.010 was expected; correct or delete the "
            "line"
        )


def number_in(text: str, *, with_commas: bool) -> float | None:
    """Number of a cell, NaN where it is missing; `None` if it is neither."""
    if NUMBER.fullmatch(text):
        return float(text)
    if text.casefold() in MISSING:
        return float("nan")
    if with_commas and DECIMAL_COMMA.fullmatch(text):
        return float(text.replace(",", "."))
    return None


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
