"""Table of the tests of a rig: file, use, columns with units, and command of each, and lists of files and folders."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal, get_args

from mrwork.base.arguments import checked
from mrwork.base.keys import check_known, closest
from mrwork.base.summary import Summarised, list_names
from mrwork.base.table import csv_text
from mrwork.errors import MrworkError, RecordError, SettingError
from mrwork.files.delimited import read_text_bytes, split_lines
from mrwork.files.joined import parts_of
from mrwork.files.layout import delimiter_of, is_data, split, without_empty_end
from mrwork.files.open_table import EXTENSIONS, TEXT_EXTENSIONS, listed_files, split_part
from mrwork.records.columns import COMMAND, MARKERS, REQUIRED, check_specification
from mrwork.store.input_file import RECORD, bytes_of, is_file, is_folder
from mrwork.store.output_file import write_file
from mrwork.store.run_folder import check_output, real_path

Use = Literal["fit", "calibration", "test"]
"""What a test is used for: identification, calibration of bands, or the final comparison."""

EveryUse = Literal["every"]
EVERY_USE: Final = "every"
"""Asks for the tests with any use, held-out tests included; only a check of the records may."""

TABLE_NAME: Final = "tests.csv"
"""Name of the table of tests in a folder."""

UNUSED: Final = "unused"
UNKNOWN: Final = "?"
"""Entry of a table that must be filled in."""

# Files that a sentence names; more are counted.
_MOST_NAMED: Final = 8
_DOUBT: Final = "doubt"
_SPECIFIED: Final = (*REQUIRED, "velocity", COMMAND)
FACTS: Final = ("damper", "serial", "date", "operator", "temperature")
"""Columns that say which specimen was tested, when, by whom and how warm it was; a temperature has its unit."""
_HEADER: Final = ("file", "use", *_SPECIFIED, MARKERS, *FACTS, _DOUBT)


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class ListedTest(Summarised):
    """A row of a table of tests: a file, its use, its `columns` as in `read_damper_test`, facts, and what is in doubt.

    A row that is not used has the use `None`.
    """

    file: str
    use: Use | None = None
    columns: Mapping[str, str] = field(default_factory=dict)
    facts: Mapping[str, str] = field(default_factory=dict)
    doubt: str = ""

    @property
    def is_open(self) -> bool:
        """Whether one of its entries is to be filled in."""
        return any(UNKNOWN in entry for entry in self.columns.values())


def test_facts(rows: Iterable[ListedTest]) -> dict[str, str]:
    """Facts on the tests of a run by their names: several values in a row, of dates and temperatures the range."""
    facts: dict[str, str] = {}
    every = list(rows)
    for name in FACTS:
        values = list(dict.fromkeys(row.facts[name] for row in every if name in row.facts))
        if values:
            facts[name] = list_names(values)
        if name in ("date", "temperature") and len(values) > 1:
            values.sort(key=(lambda value: float(value.split()[0])) if name == "temperature" else None)
            facts[name] = f"{values[0]} to {values[-1]}"
    return facts


def listed_tests(
    paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]], *, use: Use | EveryUse
) -> tuple[ListedTest, ...]:
    """Rows for the files, folders, glob patterns and tables of tests that are given; of tables those with this use.

    A folder stands for its table `tests.csv`, or without one for all files in it that can hold a test.
    """
    rows: list[ListedTest] = []
    for file in listed_files(paths, none="no record given; name at least one file, folder or table of tests"):
        path = Path(file)
        if is_folder(path):
            rows += _rows_of_folder(path, use)
        elif is_test_table(path):
            rows += _select_use(read_test_table(path), path, use)
        else:
            rows.append(ListedTest(file=file))
    check_given_once(rows)
    return tuple(rows)


def check_given_once(rows: Sequence[ListedTest]) -> None:
    """Refuse a file that is given twice, as by a pattern that takes in a table of tests and its records."""
    groups: dict[object, list[ListedTest]] = {}
    for row in rows:
        groups.setdefault(real_path(row.file), []).append(row)
    for same in groups.values():
        if len(same) > 1:
            remedy = "give each file once"
            if any(row.use is not None for row in same):
                remedy = "give its table of tests, or the folder, alone, or the records without the table"
            raise RecordError(f"{same[0].file} is given {len(same)} times; {remedy}")


def records_in(folder: Path) -> tuple[Path, ...]:
    """Files of a folder that can hold a test, in name order, without its table."""
    try:
        inside = sorted(folder.iterdir())
    except OSError as reason:
        raise RecordError(f"{folder}: cannot be read ({reason.strerror})") from reason
    files = tuple(path for path in inside if _is_record(path))
    if not files:
        raise RecordError(
            f"{folder}: has no record; expected files with one of the extensions {', '.join(EXTENSIONS)}"
        )
    return files


def _is_record(path: Path) -> bool:
    named = path.suffix.lower() in EXTENSIONS and not path.name.startswith(".")
    return named and is_file(path) and not is_test_table(path)


def files_not_read(paths: Iterable[str | os.PathLike[str]]) -> dict[Path, str]:
    """Sentence on the unread files of each folder among the paths; folders that are read completely are omitted.

    Of a folder with a table of tests these are the records that the table does not name, else all that is no record.
    """
    sentences: dict[Path, str] = {}
    for folder in filter(is_folder, map(Path, paths)):
        inside = [path for path in sorted(folder.iterdir()) if not path.name.startswith(".")]
        table = folder / TABLE_NAME
        if is_test_table(table):
            listed = (split_part(row.file)[0] for row in read_test_table(table))
            of_table = {real_path(part.path) for name in listed for part in parts_of(name)}
            left = [path for path in inside if _is_record(path) and real_path(path) not in of_table]
            why = f"not in {TABLE_NAME}"
        else:
            left = [path for path in inside if not _is_record(path)]
            why = "not read"
        if left:
            names = [f"{path.name}/" if is_folder(path) else path.name for path in left]
            sentences[folder] = f"of the folder {folder}, {why}: {list_names(names, _MOST_NAMED)}"
    return sentences


def is_test_table(path: Path) -> bool:
    """Whether a file is a table of tests: its first line names a column `file` and one of its others."""
    if path.suffix.lower() not in TEXT_EXTENSIONS or not is_file(path):
        return False
    try:
        start = split_lines(bytes_of(path, RECORD, 4096))
    except RecordError:
        return False
    line = next(filter(is_data, start), "")
    names = {name.strip().casefold() for name in split(line, delimiter_of(line))}
    return _HEADER[0] in names and len(names & set(_HEADER)) > 1


@checked
def read_test_table(path: str | os.PathLike[str]) -> tuple[ListedTest, ...]:
    """Read a table of tests, with columns separated by commas, semicolons or tabs.

    The column `file` is required; paths are relative to the folder of the table, and ``sweeps.csv#2`` is the second
    sweep or burst of a file, or the second of tests side by side. `use` is fit, calibration, test or
    unused; empty is unused. `time`, `displacement`, `force` and `velocity` name the columns of the record as
    ``COLUMN:UNIT``, `command` a number with its unit (``0.5 A``) or ``COLUMN:UNIT``; where they are empty or absent,
    the record and its name tell. `markers` is "skip" where lines among the rows mark events. `damper`, `serial`,
    `date`, `operator` and `temperature` (``23 C``) are facts for the page. `doubt` is not read.

    Raises
    ------
    RecordError
        The file is no such table, or an entry is invalid or still "?"; the message names the line.
    """
    path = Path(path)
    lines = enumerate(split_lines(read_text_bytes(path)), start=1)
    filled = [(number, line) for number, line in lines if is_data(line)]
    if not filled:
        raise RecordError(
            f"{path}: the table is empty; its first line names the columns {', '.join(_HEADER)}"
        )
    delimiter = delimiter_of(filled[0][1])
    header = [name.strip().casefold() for name in without_empty_end(split(filled[0][1], delimiter))]
    unknown = [name for name in header if name not in _HEADER]
    if unknown or "file" not in header or len(set(header)) < len(header):
        near = closest(unknown[0], _HEADER) if unknown else ""
        meant = f", did you mean {near}" if near else ""
        raise RecordError(
            f"{path}, line {filled[0][0]}: a table of tests has the columns {', '.join(_HEADER)}, each at most once; "
            f"{f'there is none called {unknown[0]!r}{meant}' if unknown else f'these are {list_names(header, 8)}'}"
        )
    rows: dict[str, ListedTest] = {}
    for number, line in filled[1:]:
        fields = [entry.strip() for entry in split(line, delimiter)]
        if len(fields) < len(header) or any(fields[len(header) :]):
            raise RecordError(
                f"{path}, line {number}: has {len(fields)} entries where the header names {len(header)} columns; "
                "complete the line, and put entries with delimiters into quotes"
            )
        entries = {name: entry for name, entry in zip(header, fields, strict=False) if entry}
        if not entries:
            continue
        try:
            row = _row(entries, path.parent)
        except MrworkError as error:
            raise RecordError(f"{path}, line {number}: {error}") from error
        if row.file in rows:
            raise RecordError(f"{path}, line {number}: '{entries['file']}' is in the table twice; delete one")
        rows[row.file] = row
    if not rows:
        raise RecordError(f"{path}: the table has no tests; add a line for each file")
    return tuple(rows.values())


@checked
def write_test_table(path: str | os.PathLike[str], rows: Sequence[ListedTest]) -> None:
    """Write a table of tests, with paths relative to its folder where they lie within.

    Raises
    ------
    OutputError
        The file exists already, or cannot be written.
    RecordError
        A file is in two rows.
    """
    path = Path(path)
    check_output(path, replace=False, otherwise="delete it")
    check_given_once(rows)
    fact_names = [name for name in FACTS if any(name in row.facts for row in rows)]
    specified = [*_SPECIFIED, *([MARKERS] if any(MARKERS in row.columns for row in rows) else [])]
    lines: list[Sequence[str]] = [("file", "use", *specified, *fact_names, _DOUBT)]
    for row in rows:
        file, folder = Path(row.file).resolve(), path.parent.resolve()
        name = file.relative_to(folder) if file.is_relative_to(folder) else file
        entries = (row.columns.get(key, "") for key in specified)
        facts = (row.facts.get(key, "") for key in fact_names)
        lines.append((name.as_posix(), row.use or UNUSED, *entries, *facts, row.doubt))
    write_file(path, csv_text(lines).encode())


def _row(entries: Mapping[str, str], folder: Path) -> ListedTest:
    if "file" not in entries:
        raise RecordError("names no file")
    name = entries.get("use", UNUSED).casefold()
    use = next((known_use for known_use in get_args(Use) if known_use == name), None)
    uses = (*get_args(Use), UNUSED)
    check_known(name, uses, f"the use is '{name}'", otherwise="give one of", kind=SettingError)
    columns = {key: entries[key] for key in (*_SPECIFIED, MARKERS) if key in entries}
    if use is not None:
        for key, specification in columns.items():
            if UNKNOWN in (specification, specification.rpartition(":")[2].strip()):
                raise RecordError(
                    f"the {key} of '{entries['file']}' is '{specification}'; fill it in, or set the use to {UNUSED}"
                )
            check_specification(key, specification)
    facts = {key: entries[key] for key in FACTS if key in entries}
    if "temperature" in facts:
        facts["temperature"] = _temperature(facts["temperature"])
    return ListedTest(
        file=str(folder / entries["file"]),
        use=use,
        columns=columns,
        facts=facts,
        doubt=entries.get(_DOUBT, ""),
    )


def _temperature(text: str) -> str:
    """A temperature with its unit, such as "23 °C"."""
    match = re.fullmatch(r"(-?\d+(?:\.\d+)?)\s*(?:°|deg)?\s*([CFK])", text.strip())
    if match is None:
        raise SettingError(f"the temperature is '{text}'; give a number with its unit, as 23 C")
    return f"{match[1]} {'' if match[2] == 'K' else '°'}{match[2]}"


def _rows_of_folder(folder: Path, use: Use | EveryUse) -> tuple[ListedTest, ...]:
    table = folder / TABLE_NAME
    if is_test_table(table):
        return _select_use(read_test_table(table), table, use)
    records = records_in(folder)
    other = next(filter(is_test_table, sorted(folder.iterdir())), None)
    if other is not None and use != EVERY_USE:
        # All records of the folder would be used, those that the table holds out included.
        raise RecordError(
            f"{folder}: has a table of tests, {other.name}, that does not stand for the folder; give that table, or "
            f"call it {TABLE_NAME}"
        )
    return tuple(ListedTest(file=str(path)) for path in records)


def _select_use(rows: Sequence[ListedTest], table: Path, use: Use | EveryUse) -> tuple[ListedTest, ...]:
    used = tuple(row for row in rows if row.use is not None and use in (EVERY_USE, row.use))
    if not used:
        counts = [
            f"{sum(row.use == known_use for row in rows)} for {known_use}" for known_use in get_args(Use)
        ]
        wanted = "a use" if use == EVERY_USE else f"the use {use!r}"
        raise RecordError(
            f"{table}: no row has {wanted} ({', '.join(counts)} of {len(rows)}); set the use of some rows, or name the "
            "files"
        )
    return used
