"""LabVIEW measurement files (.lvm): a header of the file, then blocks, each with a header of its own and rows.

National Instruments, "Specification for the LabVIEW Measurement File (.lvm)". The file is brought into the form of a
plain table, line by line, so that errors name the lines of the file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from mrwork.errors import RecordError
from mrwork.files.layout import NUMBER, Layout, is_number

_FIRST_WORDS: Final = "LabVIEW Measurement"
_END: Final = "***End_of_Header***"
_SEPARATORS: Final[Mapping[str, str]] = {"tab": "\t", "comma": ",", "semicolon": ";"}


def is_labview(lines: Sequence[str]) -> bool:
    """Whether the first line is that of a LabVIEW measurement file."""
    return bool(lines) and lines[0].startswith(_FIRST_WORDS)


def labview_layout(lines: list[str], source: str) -> tuple[list[str], Layout]:
    """The lines with rows of equal form, and their layout.

    Remarks behind the rows are cut off, decimal commas become points, and times are written into rows without them. The
    first column is called Time where it is one.
    """
    settings = dict(_entries(lines, 0, _separator(lines)))
    separator = _separator(lines)
    end = _end_of_header(lines, 0, source)
    plain = list(lines)
    data: list[int] = []
    first: _Block | None = None
    for block in _blocks(lines, end + 1, separator, settings, source):
        if first is not None and block.names != first.names:
            raise RecordError(
                f"{source}: line {block.names_line + 1} starts a block with other channels than the first; "
                "export one test with the same channels throughout"
            )
        first = first or block
        for number, index in enumerate(block.rows):
            plain[index] = block.plain_row(lines[index], index, number)
            data.append(index)
    if first is None or not data:
        raise RecordError(f"{source}: there is a LabVIEW header but no data line after it; check the export")
    return plain, Layout(delimiter="\t", names=first.names, units=first.units, data=tuple(data))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Block:
    """A block: its channels, where its rows are, and how they are to be read.

    `step` is `None` where the rows have times; `width` is the number of fields of a channel, 2 where each has its own.
    """

    source: str
    separator: str
    comma: bool
    names: tuple[str, ...]
    units: tuple[str, ...]
    names_line: int
    rows: tuple[int, ...]
    start: float
    step: float | None
    width: int

    def plain_row(self, line: str, index: int, number: int) -> str:
        """A row with the time and one field for each channel."""
        fields = [field.strip() for field in line.split(self.separator)]
        n_channels = len(self.names) - 1
        if self.width == 2:
            fields = fields[: 2 * n_channels]
            times = {field for field in fields[::2] if field}
            if len(times) > 1:
                raise RecordError(
                    f"{self.source}: line {index + 1}: the channels have different times, "
                    f"{' and '.join(sorted(times)[:2])}; export them with one X column"
                )
            fields = [next(iter(times), ""), *fields[1::2]]
        if self.step is not None:
            fields = [repr(self.start + number * self.step), *fields[1:]]
        fields = fields[: n_channels + 1]
        if self.comma:
            fields = [field.replace(",", ".") if is_number(field) else field for field in fields]
        return "\t".join(fields)


def _blocks(
    lines: Sequence[str], start: int, separator: str, settings: Mapping[str, list[str]], source: str
) -> Iterator[_Block]:
    comma = _first(settings, "Decimal_Separator") == ","
    columns = _first(settings, "X_Columns").casefold()
    place = start
    while any(line.strip() for line in lines[place:]):
        entries = dict(_entries(lines, place, separator))
        end = _end_of_header(lines, place, source)
        names_line = next(
            (index for index in range(end + 1, len(lines)) if lines[index].strip()), len(lines) - 1
        )
        fields = [field.strip() for field in lines[names_line].split(separator)]
        if fields[-1].casefold() == "comment":
            fields.pop()
        width = 2 if columns == "multi" else 1
        channels = tuple(fields[1::width])
        rows: list[int] = []
        place = names_line + 1
        while place < len(lines) and lines[place].partition(separator)[0].strip() != "Channels":
            if lines[place].strip() and _END not in lines[place]:
                rows.append(place)
            place += 1
        step = _step(entries, comma, source) if columns == "no" else None
        is_time = _first(entries, "X_Dimension").casefold() in ("", "time")
        labels = entries.get("Y_Unit_Label", [])
        yield _Block(
            source=source,
            separator=separator,
            comma=comma,
            names=("Time" if is_time else fields[0], *channels),
            units=("s" if is_time else "", *(labels + [""] * len(channels))[: len(channels)]),
            names_line=names_line,
            rows=tuple(rows),
            start=_number(_first(entries, "X0") or "0", comma, "X0", source),
            step=step,
            width=width,
        )


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
        if _END in line:
            break
    return "\t"


def _entries(lines: Sequence[str], start: int, separator: str) -> Iterator[tuple[str, list[str]]]:
    """Key and values of each line of a header."""
    for line in lines[start:]:
        if _END in line:
            return
        key, *values = (field.strip() for field in line.split(separator))
        if key:
            yield key, values


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
