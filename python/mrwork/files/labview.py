"""LabVIEW measurement files (.lvm; National Instruments, "Specification for the LabVIEW Measurement File").

Such a file has a header, then blocks, each with a header and rows of its own. It is brought into the form of a plain
table, line by line, so that errors name the lines of the file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

from mrwork.errors import RecordError
from mrwork.files.layout import NUMBER, Layout

_FIRST_WORDS: Final = "LabVIEW Measurement"
_END: Final = "***End_of_Header***"
_SEPARATORS: Final[Mapping[str, str]] = {"tab": "\t", "comma": ",", "semicolon": ";"}


def is_labview(lines: Sequence[str]) -> bool:
    """Whether the lines begin a LabVIEW measurement file."""
    return bool(lines) and lines[0].startswith(_FIRST_WORDS)


def labview_layout(lines: list[str], source: str) -> tuple[list[str], Layout]:
    """The lines with rows of equal form, and their layout.

    Remarks are cut off, decimal commas become points, and times are written into rows without them.
    """
    cursor = _end_of_header(lines, 0, source) + 1
    separator = _separator(lines[:cursor])
    settings = _entries(lines[:cursor], separator)
    comma = _first(settings, "Decimal_Separator") == ","
    columns = _first(settings, "X_Columns").casefold()
    # Fields of a channel: its own times, and its samples.
    width = 2 if columns == "multi" else 1
    plain = list(lines)
    data: list[int] = []
    layout: Layout | None = None
    while any(line.strip() for line in lines[cursor:]):
        end = _end_of_header(lines, cursor, source)
        entries = _entries(lines[cursor:end], separator)
        names_line = next(
            (index for index in range(end + 1, len(lines)) if lines[index].strip()), len(lines) - 1
        )
        header = [field.strip() for field in lines[names_line].split(separator)]
        if header[-1].casefold() == "comment":
            header.pop()
        channels = header[1::width]
        rows: list[int] = []
        cursor = names_line + 1
        while cursor < len(lines) and lines[cursor].partition(separator)[0].strip() != "Channels":
            if lines[cursor].strip() and _END not in lines[cursor]:
                rows.append(cursor)
            cursor += 1
        step = _step(entries, comma, source) if columns == "no" else None
        is_time = _first(entries, "X_Dimension").casefold() in ("", "time")
        start = _number(_first(entries, "X0") or "0", comma, "X0", source)
        names = ("Time" if is_time else header[0], *channels)
        if layout is None:
            labels = entries.get("Y_Unit_Label", []) + [""] * len(channels)
            units = ("s" if is_time else "", *labels[: len(channels)])
            layout = Layout(delimiter="\t", names=names, units=units, data=())
        elif names != layout.names:
            raise RecordError(
                f"{source}: line {names_line + 1} starts a block with other channels than the first; "
                "export one test with the same channels throughout"
            )
        for number, index in enumerate(rows):
            line = lines[index].replace(",", ".") if comma else lines[index]
            fields = [field.strip() for field in line.split(separator)]
            if width == 2:
                # The time that all channels of a row share, and their samples.
                times = {field for field in fields[: 2 * len(channels) : 2] if field}
                if len(times) > 1:
                    raise RecordError(
                        f"{source}: line {index + 1}: the channels have different times, "
                        f"{' and '.join(sorted(times)[:2])}; export them with one X column"
                    )
                fields = [next(iter(times), ""), *fields[1 : 2 * len(channels) : 2]]
            if step is not None:
                fields = [repr(start + number * step), *fields[1:]]
            plain[index] = "\t".join(fields[: len(names)])
        data += rows
    if layout is None or not data:
        raise RecordError(f"{source}: there is a LabVIEW header but no data line after it; check the export")
    return plain, replace(layout, data=data)


def _step(entries: Mapping[str, list[str]], comma: bool, source: str) -> float:
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
