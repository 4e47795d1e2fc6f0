"""Lists of files, and files of any format as named columns; Excel workbooks and .tdms files are opened here."""

from __future__ import annotations

import glob
import hashlib
import importlib.util
import io
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final
from warnings import warn

import numpy as np

from mrwork.errors import MrworkWarning, RecordError
from mrwork.files.delimited import DelimitedTable, open_delimited
from mrwork.files.joined import open_joined, parts_of
from mrwork.files.matlab import open_matlab
from mrwork.files.named_columns import ColumnTable, VectorTable, unit_in_name, unused_parts
from mrwork.store.input_file import RECORD, bytes_of, check_file, exists
from mrwork.store.members import readable, sheets_of


def open_workbook(path: Path, is_record: Callable[[ColumnTable], bool]) -> ColumnTable:
    """Open an .xlsx or .xls workbook: its first sheet that `is_record`, else the longest one.

    A sheet is read as a text table is, so that header blocks, rows of units and times of the day are found. Formulas
    have the values that were saved with them.
    """
    sheets, tables = _sheets(path)
    records = [name for name, table in tables.items() if is_record(table)]
    chosen = next(iter(records), max(tables, key=lambda name: len(sheets[name])))
    table = tables[chosen]
    table.further = tuple(name for name in records if name != chosen)
    unused = [f"'{name}'" for name in sheets if name != chosen and name not in table.further]
    if unused:
        table.unused = (f"sheet{'s' if len(unused) > 1 else ''} {', '.join(unused)}",)
    return table


def _sheets(path: Path) -> tuple[dict[str, list[str]], dict[str, ColumnTable]]:
    """The lines of each sheet of a workbook that has any, and the tables of those that are one."""
    if importlib.util.find_spec("python_calamine") is None:
        raise RecordError(
            f"{path}: reading {path.suffix.lower()} needs python-calamine; run: pip install 'mrwork[xlsx]'"
        )
    data = bytes_of(path, RECORD)
    digest = hashlib.sha256(data).hexdigest()
    sheets = {name: lines for name, lines in sheets_of(data, path).items() if any(lines)}
    tables: dict[str, ColumnTable] = {}
    for name, lines in sheets.items():
        with suppress(RecordError):
            tables[name] = DelimitedTable(source=f"{path}, sheet '{name}'", sha256=digest, lines=lines)
    if not tables:
        listed = ", ".join(f"'{name}'" for name in sheets) or "it has none with cells"
        raise RecordError(f"{path}: no sheet has a table of numbers ({listed}); put one test into a sheet")
    return sheets, tables


def open_sheets(path: Path) -> list[ColumnTable]:
    """Every table of a workbook, or the one of another file."""
    if path.suffix.lower() not in WORKBOOKS:
        return [open_table(path, lambda _: True)]
    check_file(path, RECORD)
    return [*_sheets(path)[1].values()]


_UNIT_PROPERTIES: Final = ("unit_string", "NI_UnitDescription", "Unit", "unit")


def open_tdms(path: Path) -> ColumnTable:
    """Open a .tdms file; the columns are its numeric channels, with the units that they state.

    Channels of several groups are called GROUP/CHANNEL where names are in several. Where no channel is a time, one is
    made from the increment that all channels share.
    """
    try:
        from nptdms import TdmsFile
        from nptdms.log import log_manager
    except ImportError as error:
        raise RecordError(
            f"{path}: reading TDMS needs npTDMS; run: pip install 'mrwork[tdms]', or export the channels as text"
        ) from error
    data = bytes_of(path, RECORD)
    reports = io.StringIO()
    usual = log_manager.console_handler.setStream(reports)
    try:
        with readable(path, ".tdms file", "save it again"), TdmsFile.open(io.BytesIO(data)) as file:
            channels = [channel for group in file.groups() for channel in group.channels()]
            # No sample takes less than a byte, whatever a damaged header claims.
            if sum(len(channel) for channel in channels) > len(data):
                raise ValueError("it claims more samples than it has bytes")
            occurs = Counter(channel.name for channel in channels)
            by_name = {
                channel.name if occurs[channel.name] == 1 else f"{channel.group_name}/{channel.name}": channel
                for channel in channels
            }
            read = {name: np.asarray(channel[:]) for name, channel in by_name.items()}
            units = {name: _unit(channel) for name, channel in by_name.items()}
            steps = {_waveform(channel) for channel in channels if len(channel)}
    finally:
        log_manager.console_handler.setStream(usual)
    if report := reports.getvalue().partition("\n")[0]:
        warn(
            f"{path}: {report}; check that no samples are missing, or save it again",
            MrworkWarning,
            stacklevel=3,
        )
    for name, vector in read.items():
        if vector.dtype.kind == "M" and vector.size:
            # Time stamps as seconds since the first.
            read[name], units[name] = (vector - vector[0]) / np.timedelta64(1, "s"), "s"
    vectors = {name: vector for name, vector in read.items() if vector.dtype.kind in "iuf" and vector.size}
    if not vectors:
        raise RecordError(f"{path}: has no channel of numbers; expected one for each quantity")
    waveform = steps.pop() if len(steps) == 1 else None
    if waveform is not None and not any(unit_in_name("time", name) is not None for name in vectors):
        start, step, count = waveform
        vectors, units["Time"] = {"Time": start + step * np.arange(count), **vectors}, "s"
    return VectorTable(
        source=str(path),
        sha256=hashlib.sha256(data).hexdigest(),
        vectors=vectors,
        units={name: unit for name, unit in units.items() if unit},
        unused=unused_parts("channel", [f"'{name}'" for name in read if name not in vectors], "no numbers"),
    )


def _unit(channel: Any) -> str:
    units = (str(channel.properties.get(name, "")).strip() for name in _UNIT_PROPERTIES)
    return next(filter(None, units), "")


def _waveform(channel: Any) -> tuple[float, float, int] | None:
    """Start and step [s] and number of samples of a channel that is sampled evenly."""
    step = channel.properties.get("wf_increment")
    if not isinstance(step, int | float) or not step > 0.0:
        return None
    return float(channel.properties.get("wf_start_offset", 0.0)), float(step), len(channel)


WORKBOOKS: Final = (".xlsx", ".xls")
TEXT_EXTENSIONS: Final = (".csv", ".tsv", ".txt", ".dat", ".asc", ".lvm")
EXTENSIONS: Final = (*TEXT_EXTENSIONS, ".mat", ".tdms", *WORKBOOKS)
"""Extensions of the files that can hold a test."""
_OPENERS: Final[Mapping[str, Callable[[Path], ColumnTable]]] = {
    **dict.fromkeys(TEXT_EXTENSIONS, open_delimited), ".mat": open_matlab, ".tdms": open_tdms,
}  # fmt: skip


def open_table(path: Path, is_record: Callable[[ColumnTable], bool]) -> ColumnTable:
    """Open a .mat, .tdms, Excel or text file as columns, or several joined; of sheets, the first that `is_record`."""
    if len(parts := parts_of(path)) > 1:
        return open_joined(parts, lambda part: open_table(part, is_record))
    extension = path.suffix.lower()
    check_file(path, RECORD)
    if extension in WORKBOOKS:
        return open_workbook(path, is_record)
    if extension in _OPENERS:
        return _OPENERS[extension](path)
    came = f"the extension is '{extension}'" if extension else "there is no extension"
    raise RecordError(
        f"{path}: {came} where one of {', '.join(EXTENSIONS)} was expected; export the record as one of these"
    )


# A part of a file: sweeps.csv#2.
_PART: Final = re.compile(r"(.+)#(\d{1,6})", re.DOTALL)


def split_part(path: str | os.PathLike[str]) -> tuple[str, int]:
    """A file and the number of a part of it, as in ``sweeps.csv#2``; 0 where the whole is meant."""
    text = os.fspath(path)
    match = None if exists(text) else _PART.fullmatch(text)
    return (text, 0) if match is None else (match[1], int(match[2]))


def is_there(path: str | os.PathLike[str]) -> bool:
    """Whether the file of a path, of a part of it, or each of joined ones exists."""
    name, _ = split_part(path)
    return exists(name) or len(parts_of(name)) > 1


def listed_files(paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]], *, none: str) -> list[str]:
    """Return the files of a sequence of paths in its order, or of a glob pattern in name order."""
    if isinstance(paths, str | os.PathLike):
        pattern = os.fspath(paths)
        # An existing file whose name contains brackets is not a pattern.
        paths_of_pattern = glob.glob(pattern, recursive=True)  # noqa: PTH207 - `Path.glob` takes no absolute patterns
        files = [pattern] if is_there(pattern) else sorted(paths_of_pattern)
        if not files:
            raise RecordError(f"no file matches '{pattern}'; check the path and the pattern")
        return files
    files = [os.fspath(path) for path in paths]
    # An empty name would be the current folder.
    if not files or "" in files:
        raise RecordError(none)
    return files
