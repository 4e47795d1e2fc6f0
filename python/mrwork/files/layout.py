"""Layout of a text table: where its rows of numbers, its names and its row of units are.

Programs of test rigs write titles, settings and limits above the names of the columns, often a row of units below
them, and may repeat all of it in the middle of a file. The rows of numbers are found first, because only they look
alike everywhere; the names are the nearest row of texts above them with as many fields.

A LabVIEW measurement file (.lvm; National Instruments, "Specification for the LabVIEW Measurement File") has a header,
then blocks, each with a header and rows of its own. It is brought into the form of a plain table, line by line, so
that errors name the lines of the file.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Final

from mrwork.base.units import quantity_of
from mrwork.errors import RecordError

MISSING: Final = frozenset({"", "na", "n/a", "nan", "null", "none"})
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
# Lines between the names and the numbers: units, rules, blanks.
_MOST_BETWEEN: Final = 5
_MOST_BELOW: Final = 2
RULE: Final = re.compile(r"[\s+|]*[-=_*]{3,}[-=_*+|\s.,;:]*")
# Units of channels that are of no use here, as they stand in rows of units.
_OTHER_UNITS: Final = re.compile(
    r"-|1|%|°?c|deg\.? ?c|k|f|bar|mpa|pa|psi|cycles?|segments?|counts?|none|hz|n/a|mm/mm|w|kw|ohm|ω|deg|rad|°",
    re.IGNORECASE,
)
_BRACKETS: Final = "()[]{}<> \t"


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Layout of a table: how its lines are to be parsed.

    `delimiter` is `None` for blanks, `units` are of a row below the names, `data` are the lines with rows of numbers;
    `header` is the line of the names where that may be repeated. Columns without names have numbers.
    """

    delimiter: str | None
    names: tuple[str, ...]
    units: tuple[str, ...]
    data: tuple[int, ...]
    header: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Header:
    """Lines of the names, of the units, and of other texts between them and the numbers."""

    names: int
    units: int | None = None
    others: tuple[int, ...] = ()


def layout_of(lines: Sequence[str], source: str) -> Layout:
    """Find delimiter, names, units and rows of a text table."""
    filled = [index for index, line in enumerate(lines) if is_data(line)]
    if not filled:
        raise RecordError(f"{source}: the file holds no header and no data; check the export")
    middle = _run(lines, filled[len(filled) // 2 :])
    # The first rows that look like those in the middle are no list of limits.
    is_long = middle is not None and middle.length >= _ENOUGH_ROWS
    rows = _run(lines, filled, like=middle if is_long else None)
    return _of_first_line(lines, filled) if rows is None else _layout_above(lines, filled, rows)


def sampled_layout(lines: Sequence[str], middle: Sequence[str]) -> tuple[Layout, bool] | None:
    """Layout of a long file, guessed from its first lines and a sample of its middle, and whether it has texts.

    `None` where all lines must be looked at. It is the layout of the whole file if all lines below are blank, comments
    or rows of data, of which none is a row of numbers only if the rows have texts.
    """
    filled = [index for index, line in enumerate(lines) if is_data(line)]
    pure = _run(middle, range(len(middle)), kinds=(True,))
    with_texts = pure is None or pure.length < _ENOUGH_ROWS
    kinds = (True, False) if with_texts else (True,)
    like = _run(middle, range(len(middle)), kinds=kinds)
    rows = _run(lines, filled, like=like, kinds=kinds)
    if like is None or rows is None or min(like.length, rows.length) < _ENOUGH_ROWS:
        return None
    layout = _layout_above(lines, filled, rows)
    followed = layout.data == tuple(index for index in filled if index >= layout.data[0])
    # Names such as nan might be repeated below, and be taken for a row.
    named = layout.names == numbered_names(rows.width) or not any(map(reads_as_float, layout.names))
    return (layout, with_texts) if followed and named else None


def _layout_above(lines: Sequence[str], filled: Sequence[int], rows: _Run) -> Layout:
    header = _names_above(lines, filled, rows)
    if header is None:
        return _named_by_comment(lines, filled, rows)
    units = () if header.units is None else _texts(lines[header.units], rows)
    return Layout(
        delimiter=rows.delimiter,
        names=_texts(lines[header.names], rows),
        units=tuple(text.strip(_BRACKETS) for text in units),
        data=tuple(_below(lines, filled, rows, header)),
        header=header.names,
    )


def is_data(line: str) -> bool:
    """Whether a line is neither blank nor a comment."""
    return bool(line) and not line.isspace() and not line.lstrip().startswith("#")


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


def _run(
    lines: Sequence[str],
    filled: Sequence[int],
    *,
    like: _Run | None = None,
    kinds: Sequence[bool] = (True, False),
) -> _Run | None:
    """The first run of rows of numbers that is long enough, or else the longest; `None` where there are none.

    Rows with numbers only are looked for first, then rows that also have texts; with `like`, rows as wide as its.
    """
    delimiters = ("\t", ";", None, ",") if like is None else (like.delimiter,)
    longest: _Run | None = None
    for only_numbers in kinds:
        runs = [_Run(delimiter=delimiter) for delimiter in delimiters]
        for index in filled:
            line = _without_remark(lines[index])
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


def _names_above(lines: Sequence[str], filled: Sequence[int], rows: _Run) -> _Header | None:
    """Names and units above the first row of numbers; `None` where there are no names.

    The names are next above a row of units, else the nearest; units may also stand above them.
    """
    nearest = list(islice(_lines_of_texts(lines, filled, rows), _MOST_BETWEEN))
    fitting = [
        index
        for index in nearest
        for texts in [_texts(lines[index], rows)]
        # A line such as "Start,," marks an event.
        if rows.width <= len(texts) <= rows.raw_width and 2 * sum(map(bool, texts)) >= rows.width
    ]
    are_units = [_are_units(_texts(lines[index], rows)) for index in fitting]
    if not fitting:
        return _Header(names=nearest[0]) if nearest else None
    place = are_units.index(True) if True in are_units else _MOST_BELOW
    if place + 1 < len(fitting) and place < _MOST_BELOW:
        return _Header(names=fitting[place + 1], units=fitting[place], others=tuple(fitting[:place]))
    return _Header(names=fitting[0], units=fitting[1] if place == 1 else None)


def _lines_of_texts(lines: Sequence[str], filled: Sequence[int], rows: _Run) -> Iterator[int]:
    """Lines above the rows that have texts and no number, the nearest first; incomplete rows are none of them."""
    for index in reversed(filled):
        if index < rows.first and not RULE.fullmatch(lines[index]):
            fields = _texts(lines[index], rows)
            if not any(map(is_number, fields)) and not all(each.casefold() in MISSING for each in fields):
                yield index


def _texts(line: str, rows: _Run) -> tuple[str, ...]:
    """Fields of a line of texts above the rows; with blanks as the delimiter, names may contain single ones."""
    # A single quote is the mark of an inch.
    raw = split(_without_remark(line), rows.delimiter, with_quotes=line.count('"') % 2 == 0)
    if rows.delimiter is None and len(raw) != rows.width:
        apart = re.split(r"\s{2,}|\t", line.strip())
        raw = apart if len(apart) == rows.width else raw
    fields = without_empty_end(raw)
    return tuple(field.strip() for field in (fields if len(fields) >= rows.width else raw[: rows.width]))


def _are_units(fields: Sequence[str]) -> bool:
    """Whether most fields are units; names such as t and x are, in part, units of something else."""
    texts = [field.strip() for field in fields if field.strip()]
    bare = [text.strip(_BRACKETS) for text in texts]
    known = [quantity_of(text) is not None for text in bare]
    units = sum(one or bool(_OTHER_UNITS.fullmatch(text)) for one, text in zip(known, bare, strict=True))
    bracketed = sum(text[0] in _BRACKETS for text in texts)
    return any(known) and (2 * units > len(texts) or 2 * bracketed > len(texts))


def _below(lines: Sequence[str], filled: Sequence[int], rows: _Run, header: _Header) -> Iterator[int]:
    """Lines of data below the names, without the units and without header blocks that are repeated."""
    last = max(header.names, header.units or 0, *header.others)
    others = {lines[index].strip() for index in (header.units, *header.others) if index is not None}
    names = lines[header.names].strip()
    below = [index for index in filled if index > header.names]
    skipped: set[int] = set()
    for place, index in enumerate(below):
        if (index <= last and lines[index].strip() in others) or RULE.fullmatch(lines[index]):
            skipped.add(index)
        elif lines[index].strip() == names:
            skipped.add(index)
            after = below[place + 1 : place + 1 + _MOST_BETWEEN]
            skipped.update(each for each in after if lines[each].strip() in others)
            for each in map(below.__getitem__, range(place - 1, -1, -1)):
                fields = without_empty_end(split(_without_remark(lines[each]), rows.delimiter))
                # What is above the block before has been looked at with that.
                if _width_of_row(fields, only_numbers=False) == rows.width or lines[each].strip() == names:
                    break
                skipped.add(each)
    return (index for index in below if index not in skipped)


def _without_remark(line: str) -> str:
    return line.partition("#")[0]


def _of_first_line(lines: Sequence[str], filled: Sequence[int]) -> Layout:
    """Layout of a file in which no row of numbers was found: the first line is the header."""
    header = lines[filled[0]]
    delimiter = delimiter_of(header)
    return Layout(
        delimiter=delimiter,
        names=tuple(name.strip() for name in without_empty_end(split(header, delimiter))),
        units=(),
        data=tuple(filled[1:]),
    )


def _named_by_comment(lines: Sequence[str], filled: Sequence[int], rows: _Run) -> Layout:
    """Layout of a file whose last comment is the header, as `numpy.savetxt` writes it, or that has no names."""
    comment = next(
        (above.strip().lstrip("# ") for above in reversed(lines[: rows.first]) if above.strip()), ""
    )
    named = tuple(name.strip() for name in split(comment, rows.delimiter))
    if len(named) != rows.width or any(is_number(name) for name in named):
        named = numbered_names(rows.width)
    return Layout(
        delimiter=rows.delimiter,
        names=named,
        units=(),
        data=tuple(index for index in filled if index >= rows.first),
    )


def numbered_names(count: int) -> tuple[str, ...]:
    """Names of columns that have none: their numbers from 1."""
    return tuple(str(number + 1) for number in range(count))


_FIRST_WORDS: Final = "LabVIEW Measurement"
_END: Final = "***End_of_Header***"
_SEPARATORS: Final[Mapping[str, str]] = {"tab": "\t", "comma": ",", "semicolon": ";"}


def is_labview(lines: Sequence[str]) -> bool:
    """Whether the first line is that of a LabVIEW measurement file."""
    return bool(lines) and lines[0].startswith(_FIRST_WORDS)


def labview_layout(lines: list[str], source: str) -> tuple[list[str], Layout]:
    """The lines with rows of equal form, and their layout.

    Remarks are cut off, decimal commas become points, and times are written into rows without them.
    """
    place = _end_of_header(lines, 0, source) + 1
    separator = _separator(lines[:place])
    settings = _entries(lines[:place], separator)
    comma = _first(settings, "Decimal_Separator") == ","
    columns = _first(settings, "X_Columns").casefold()
    # Fields of a channel: its own times, and its samples.
    width = 2 if columns == "multi" else 1
    plain = list(lines)
    data: list[int] = []
    layout: Layout | None = None
    while any(line.strip() for line in lines[place:]):
        end = _end_of_header(lines, place, source)
        entries = _entries(lines[place:end], separator)
        names_line = next(
            (index for index in range(end + 1, len(lines)) if lines[index].strip()), len(lines) - 1
        )
        header = [field.strip() for field in lines[names_line].split(separator)]
        if header[-1].casefold() == "comment":
            header.pop()
        channels = header[1::width]
        rows: list[int] = []
        place = names_line + 1
        while place < len(lines) and lines[place].partition(separator)[0].strip() != "Channels":
            if lines[place].strip() and _END not in lines[place]:
                rows.append(place)
            place += 1
        step = _step(entries, comma, source) if columns == "no" else None
        is_time = _first(entries, "X_Dimension").casefold() in ("", "time")
        labels = entries.get("Y_Unit_Label", [])
        start = _number(_first(entries, "X0") or "0", comma, "X0", source)
        names = ("Time" if is_time else header[0], *channels)
        if layout is None:
            units = ("s" if is_time else "", *(labels + [""] * len(channels))[: len(channels)])
            layout = Layout(delimiter="\t", names=names, units=units, data=())
        elif names != layout.names:
            raise RecordError(
                f"{source}: line {names_line + 1} starts a block with other channels than the first; "
                "export one test with the same channels throughout"
            )
        for number, index in enumerate(rows):
            fields = [field.strip() for field in lines[index].split(separator)]
            if width == 2:
                fields = _with_one_time(fields[: 2 * len(channels)], f"{source}: line {index + 1}")
            if step is not None:
                fields = [repr(start + number * step), *fields[1:]]
            fields = fields[: len(names)]
            if comma:
                fields = [field.replace(",", ".") if is_number(field) else field for field in fields]
            plain[index] = "\t".join(fields)
        data += rows
    if layout is None or not data:
        raise RecordError(f"{source}: there is a LabVIEW header but no data line after it; check the export")
    return plain, replace(layout, data=tuple(data))


def _with_one_time(fields: list[str], where: str) -> list[str]:
    """The time that all channels of a row share, and their samples."""
    times = {field for field in fields[::2] if field}
    if len(times) > 1:
        raise RecordError(
            f"{where}: the channels have different times, {' and '.join(sorted(times)[:2])}; "
            "export them with one X column"
        )
    return [next(iter(times), ""), *fields[1::2]]


def _step(entries: Mapping[str, list[str]], comma: bool, source: str) -> float:
    """The step of all channels, of rows without times."""
    steps = {_number(text, comma, "Delta_X", source) for text in entries.get("Delta_X", []) if text}
    starts = {_number(text, comma, "X0", source) for text in entries.get("X0", []) if text}
    if len(steps) != 1 or len(starts) > 1:
        raise RecordError(
            f"{source}: the rows have no times, and the header gives {len(steps)} steps (Delta_X) and {len(starts)} "
            "starts (X0); export the channels with one step and start, or with an X column"
        )
    return steps.pop()


def _separator(lines: Sequence[str]) -> str:
    """Separator that the header states; it stands itself behind the word."""
    for line in lines:
        if line.startswith("Separator") and len(line) > len("Separator"):
            return _SEPARATORS.get(line[len("Separator") + 1 :].strip().casefold(), line[len("Separator")])
    return "\t"


def _entries(lines: Sequence[str], separator: str) -> dict[str, list[str]]:
    rows = ([field.strip() for field in line.split(separator)] for line in lines)
    return {key: values for key, *values in rows if key}


def _end_of_header(lines: Sequence[str], start: int, source: str) -> int:
    for index in range(start, len(lines)):
        if _END in lines[index]:
            return index
    raise RecordError(
        f"{source}: the header of this LabVIEW file has no {_END}; it is cut off, export it again"
    )


def _first(entries: Mapping[str, list[str]], key: str) -> str:
    return next(iter(entries.get(key, [])), "")


def _number(text: str, comma: bool, key: str, source: str) -> float:
    number = text.replace(",", ".") if comma else text
    if not NUMBER.fullmatch(number):
        raise RecordError(
            f"{source}: {key} of the header is '{text}' where a number was expected; export it again"
        )
    return float(number)
