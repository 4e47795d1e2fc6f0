"""Layout of a text table: where its rows of numbers, its names and its row of units are.

Programs of test rigs write titles, settings and limits above the names of the columns, often a row of units below
them, and may repeat all of it in the middle of a file. The rows of numbers are found first, because only they look
alike everywhere; the names are the nearest row of texts above them with as many fields.
"""

from __future__ import annotations

import csv
import re
from array import array
from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Final

from mrwork.base.units import quantity_of
from mrwork.errors import RecordError

MISSING: Final = frozenset({"", "na", "n/a", "nan", "-nan", "null", "none"})
# Only one way to read each digit: a row of thousands of digits is refused in linear time.
# Letters are named in both cases: to ignore case would take in others, such as a dotless i.
NUMBER: Final = re.compile(
    r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?|[+-]?[iI][nN][fF]([iI][nN][iI][tT][yY])?"
)
DECIMAL_COMMA: Final = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
# A comma before three digits is a decimal comma or separates thousands; these can only be decimal commas.
SURELY_DECIMAL: Final = re.compile(
    r"[+-]?(0*,\d+|\d+,(\d{1,2}|\d{4,}))([eE][+-]?\d+)?|[+-]?\d*,\d+[eE][+-]?\d+"
)

# A test has ten samples at least; a list of limits or results above it is usually shorter.
_ENOUGH_ROWS: Final = 10
# Lines among which rows are looked for where none are alike: enough for the longest header.
_ENOUGH_LINES: Final = 10_000
# Lines between the names and the numbers: units, rules, blanks.
_MOST_BETWEEN: Final = 5
_MOST_BELOW: Final = 2
_OF_RULES: Final = "+|-=_*"
_RULE: Final = re.compile(r"[\s+|]*[-=_*]{3,}[-=_*+|\s.,;:]*")
# Units of channels that are of no use here, as they stand in rows of units.
_OTHER_UNITS: Final = re.compile(
    r"-|1|%|°?c|deg\.? ?c|k|f|bar|mpa|pa|psi|cycles?|segments?|counts?|none|hz|n/a|mm/mm|w|kw|ohm|ω|deg|rad|°",
    re.IGNORECASE,
)
_BRACKETS: Final = "()[]{}<> \t"


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Layout of a table: how its lines are to be parsed.

    `delimiter` is `None` for blanks, `units` are of a row below the names, `data` are the indices of the lines with
    rows of numbers. Columns without names have numbers.
    """

    delimiter: str | None
    names: tuple[str, ...]
    units: tuple[str, ...]
    data: Sequence[int]


def layout_of(lines: Sequence[str], source: str) -> Layout:
    """Find delimiter, names, units and rows of a text table."""
    # Indices of lines that are neither blank nor a comment; a list of them would take five times the memory.
    filled = array("q", (index for index, line in enumerate(lines) if is_data(line)))
    if not filled:
        raise RecordError(f"{source}: the file holds no header and no data; check the export")
    half = len(filled) // 2
    middle = _run(lines, filled[half : half + _ENOUGH_LINES])
    if middle is not None and middle.length >= _ENOUGH_ROWS:
        # The first rows that look like those in the middle are no list of limits.
        rows = _run(lines, filled, like=middle)
    else:
        rows = _run(lines, filled[:_ENOUGH_LINES])
    if rows is None:
        return _without_rows(lines, filled)
    nearest = list(islice(_lines_of_texts(lines, filled, rows), _MOST_BETWEEN))
    if not nearest:
        return _named_by_comment(lines, filled, rows)
    names_line, unit_lines, other_lines = _header(nearest, lines, rows)
    return Layout(
        delimiter=rows.delimiter,
        names=_texts(lines[names_line], rows),
        units=tuple(text.strip(_BRACKETS) for index in unit_lines for text in _texts(lines[index], rows)),
        data=_below(lines, filled, rows, names_line, (*unit_lines, *other_lines)),
    )


def _without_rows(lines: Sequence[str], filled: Sequence[int]) -> Layout:
    """Layout of a file without rows of two numbers: one column, below its heading if it has one, or a header alone."""
    first = next(
        (n for n, index in enumerate(filled) if is_number(without_remark(lines[index]))), len(filled)
    )
    if first < len(filled) and all(is_number(without_remark(lines[index])) for index in filled[first:]):
        names = (lines[filled[first - 1]].strip(),) if first else numbered_names(1)
        return Layout(delimiter="\t", names=names, units=(), data=filled[first:])
    # Without a row of numbers the first line with as many fields as most, or more, is the header, perhaps above units.
    delimiter = delimiter_of(lines[filled[-1]])
    rows = [without_empty_end(split(lines[index], delimiter)) for index in filled[:_ENOUGH_LINES]]
    widths = [sum(map(bool, map(str.strip, row))) for row in rows]
    usual = Counter(widths).most_common(1)[0][0]
    begin = next(n for n, width in enumerate(widths) if width >= usual)
    below = rows[begin + 1] if begin + 2 < len(rows) else []
    units = tuple(text.strip(_BRACKETS) for text in below)
    has_units = any(map(quantity_of, units)) and not any(map(is_number, units))
    return Layout(
        delimiter=delimiter,
        names=tuple(map(str.strip, rows[begin])),
        units=units if has_units else (),
        data=filled[begin + 1 + has_units :],
    )


def is_data(line: str) -> bool:
    """Whether a line is neither blank nor a comment."""
    return line.lstrip()[:1] not in ("", "#")


def delimiter_of(line: str) -> str:
    """Delimiter of a single line: a tab if it has one, else a semicolon, else a comma."""
    return next((character for character in "\t;" if character in line), ",")


def split(line: str, delimiter: str | None, *, with_quotes: bool = True) -> list[str]:
    """Fields of a line; quotation marks belong to a field where it is not `with_quotes`."""
    if delimiter is None or not with_quotes:
        return line.split(delimiter)
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [""])
    except csv.Error:
        # A field beyond the size limit of the csv module: returned as one field, which matches no number and no name.
        return [line]


def without_empty_end(fields: list[str]) -> list[str]:
    """Fields up to the last that is not empty."""
    count = len(fields)
    while count and not fields[count - 1].strip():
        count -= 1
    return fields[:count]


def is_number(text: str) -> bool:
    """Whether a field is a number, with a decimal point or comma."""
    text = text.strip()
    return bool(NUMBER.fullmatch(text) or DECIMAL_COMMA.fullmatch(text))


def reads_as_float(text: str) -> bool:
    """Whether Python reads a text as a number, finite or not."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _run(lines: Sequence[str], filled: Sequence[int], *, like: _Run | None = None) -> _Run | None:
    """The first run of rows that is long enough, or the longest, of numbers or else with texts; as wide as `like`."""
    delimiters = ("\t", ";", None, ",") if like is None else (like.delimiter,)
    longest: _Run | None = None
    for only_numbers in (True, False):
        runs = [_Run(delimiter=delimiter) for delimiter in delimiters]
        for index in filled:
            line = without_remark(lines[index])
            for number, run in enumerate(runs):
                runs[number] = run = run.extend_with(index, line, only_numbers=only_numbers)
                fits = like is None or run.width == like.width
                if run.length and fits and (longest is None or run.length > longest.length):
                    longest = run
            if longest is not None and longest.length >= _ENOUGH_ROWS:
                return longest
    return longest


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    """Successive rows of numbers: first line, how many, how wide, and in `raw_width` with empty fields at the end."""

    delimiter: str | None
    first: int = 0
    length: int = 0
    width: int = 0
    raw_width: int = 0

    def extend_with(self, index: int, line: str, *, only_numbers: bool) -> _Run:
        """The run with the next line: longer, begun anew or broken off."""
        if self.delimiter is not None and self.delimiter not in line:
            return self if not self.length else _Run(delimiter=self.delimiter)
        raw = split(line, self.delimiter)
        width = _width_of_row(without_empty_end(raw), only_numbers=only_numbers)
        if width and width == self.width:
            return replace(self, length=self.length + 1)
        return _Run(
            delimiter=self.delimiter, first=index, length=1 if width else 0, width=width, raw_width=len(raw)
        )


def _width_of_row(fields: Sequence[str], *, only_numbers: bool) -> int:
    """Number of fields of a row of at least two numbers; 0 where it is none."""
    numbers = sum(is_number(field) for field in fields)
    if numbers < 2:
        return 0
    others = sum(field.strip().casefold() not in MISSING for field in fields) - numbers
    return len(fields) if others == 0 or (not only_numbers and numbers >= others) else 0


def _header(
    nearest: Sequence[int], lines: Sequence[str], rows: _Run
) -> tuple[int, Sequence[int], Sequence[int]]:
    """Line of the names, next above a row of units or else the nearest, line of units, and lines of texts below it."""
    fitting = [
        index
        for index in nearest
        for texts in [_texts(lines[index], rows)]
        # A line such as "Start,," marks an event.
        if rows.width <= len(texts) <= rows.raw_width and 2 * sum(map(bool, texts)) >= rows.width
    ] or nearest[:1]
    of_units = next(
        (number for number, index in enumerate(fitting) if _are_units(_texts(lines[index], rows))),
        _MOST_BELOW,
    )
    if of_units + 1 < len(fitting) and of_units < _MOST_BELOW:
        return fitting[of_units + 1], [fitting[of_units]], fitting[:of_units]
    return fitting[0], fitting[1:2] if of_units == 1 else [], []


def _lines_of_texts(lines: Sequence[str], filled: Sequence[int], rows: _Run) -> Iterator[int]:
    """Lines above the rows that have texts and no number, the nearest first."""
    for index in reversed(filled[: bisect_left(filled, rows.first)]):
        if not _RULE.fullmatch(lines[index]):
            fields = _texts(lines[index], rows)
            if not any(map(is_number, fields)) and not all(field.casefold() in MISSING for field in fields):
                yield index


def _texts(line: str, rows: _Run) -> tuple[str, ...]:
    """Fields of a line of texts above the rows; with blanks as the delimiter, names may contain single ones."""
    # A single quote is the mark of an inch.
    raw = split(without_remark(line), rows.delimiter, with_quotes=line.count('"') % 2 == 0)
    if rows.delimiter is None and len(raw) != rows.width:
        apart = re.split(r"\s{2,}|\t", line.strip())
        raw = apart if len(apart) == rows.width else raw
    fields = without_empty_end(raw)
    return tuple(field.strip() for field in (fields if len(fields) >= rows.width else raw[: rows.width]))


def _are_units(fields: Sequence[str]) -> bool:
    """Whether most fields are units; names such as t and x are, in part, units of something else."""
    texts = [field.strip() for field in fields if field.strip()]
    bare = [text.strip(_BRACKETS) for text in texts]
    matches = [quantity_of(text) is not None for text in bare]
    units = sum(
        is_quantity or bool(_OTHER_UNITS.fullmatch(text))
        for is_quantity, text in zip(matches, bare, strict=True)
    )
    bracketed = sum(text[0] in _BRACKETS for text in texts)
    return any(matches) and (2 * units > len(texts) or 2 * bracketed > len(texts))


def _below(
    lines: Sequence[str], filled: Sequence[int], rows: _Run, header: int, more: Sequence[int]
) -> Sequence[int]:
    """Lines of data below the names, without `more` of the header and without header blocks that are repeated."""
    last = max(header, *more, 0)
    others = {lines[index].strip() for index in more}
    heading = lines[header].strip()
    texts = {heading, *others}
    below = filled[bisect_right(filled, header) :]
    skipped: set[int] = set()
    for number, index in enumerate(below):
        line = lines[index].strip()
        if line[0] in _OF_RULES and _RULE.fullmatch(line):
            skipped.add(index)
        elif line not in texts:
            continue
        elif line != heading:
            skipped.update({index} if index <= last else ())
        else:
            skipped.add(index)
            after = below[number + 1 : number + 1 + _MOST_BETWEEN]
            skipped.update(row for row in after if lines[row].strip() in others)
            for row in map(below.__getitem__, range(number - 1, -1, -1)):
                fields = without_empty_end(split(without_remark(lines[row]), rows.delimiter))
                # What is above the block before has been looked at with that.
                if _width_of_row(fields, only_numbers=False) == rows.width or lines[row].strip() == heading:
                    break
                skipped.add(row)
    return array("q", (index for index in below if index not in skipped)) if skipped else below


def without_remark(line: str) -> str:
    """A line up to its comment."""
    return line.partition("#")[0]


def _named_by_comment(lines: Sequence[str], filled: Sequence[int], rows: _Run) -> Layout:
    """Layout of a file whose last comment is the header, as `numpy.savetxt` writes it, or that has no names."""
    comment = next((line.strip().lstrip("# ") for line in reversed(lines[: rows.first]) if line.strip()), "")
    named = tuple(map(str.strip, split(comment, rows.delimiter)))
    if len(named) != rows.width or any(map(is_number, named)):
        named = numbered_names(rows.width)
    data = filled[bisect_left(filled, rows.first) :]
    return Layout(delimiter=rows.delimiter, names=named, units=(), data=data)


def numbered_names(count: int) -> tuple[str, ...]:
    """Names of columns that have none: their numbers from 1."""
    return tuple(str(number + 1) for number in range(count))


def distinct_names(names: Sequence[str]) -> tuple[str, ...]:
    """The names, those that several columns have with the number of the column in front; empty ones are numbers."""
    return tuple(
        name if names.count(name) == 1 else f"{number} {name}".strip()
        for number, name in enumerate(names, start=1)
    )
