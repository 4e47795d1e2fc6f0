"""Read ground motions from files; the format is recognised by the content.

A file in no network's format is read as a table: text columns with or without names, accelerations with a stated step,
or a .mat file.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final
from warnings import warn

import numpy as np

from mrwork.base.arguments import checked
from mrwork.base.remark import warnings_of
from mrwork.base.summary import list_names
from mrwork.base.units import factor_of, quantity_of
from mrwork.errors import MrworkWarning, RecordError, SettingError
from mrwork.files.delimited import DelimitedTable, read_text_bytes, split_lines
from mrwork.files.grid import grid
from mrwork.files.layout import DECIMAL_COMMA, Layout, is_data, numbered_names, reads_as_float
from mrwork.files.matlab import describe_left_out, matrices_among, open_matlab, read_variables
from mrwork.files.named_columns import ColumnTable, VectorTable, find_column, unit_in_name
from mrwork.files.open_table import listed_files
from mrwork.files.roles import Stated, series_of
from mrwork.motions.examination import refuse_absurd
from mrwork.motions.ground_motion import GroundMotion
from mrwork.motions.networks import (
    COSMOS,
    ESM,
    GEONET,
    K_NET,
    PEER_AT2,
    SMC,
    VOLUME,
    Format,
    Lines,
    quote_text,
    read_numbers,
    refuse_needless,
)
from mrwork.motions.series import ACCELERATION, motion_of_series
from mrwork.store.input_file import RECORD, bytes_of, is_file, is_folder

# "road_acceleration_mps2", of a road under a vehicle.
_ACCELERATION_OF_ROAD: Final = re.compile(r"road[\s_-]*a", re.IGNORECASE)
# Directions and channels: N-S, EW, U(+), N00E, H1, CANAL-1.
_LABEL: Final = re.compile(
    r"[A-Z]{1,2}[-_.]?[A-Z0-9]{0,4}(\([+-]\))?|[a-z]{1,2}\d?|(?i:canal|ch[a-z]*|comp[a-z]*|col[a-z]*)[-_. ]?\d{1,2}"
)
# Lines of the longest header.
_LONGEST_HEADER: Final = 150
# Lines above the numbers among which names are looked for.
_MOST_ABOVE: Final = 4
# Words of a name between marks such as commas; more are prose.
_MOST_WORDS: Final = 4
# Candidates that a question lists.
_MOST_LISTED: Final = 12
# Rows from which on columns are told from a series in rows, and how much smoother these then are.
_FEWEST_ROWS: Final = 20
_SMOOTHER: Final = 0.5

# What a header states: a step, a rate, and a unit after its key, or after "in units of".
_VALUE: Final = r"(?P<key>[^:=]{0,40}[:=]|\s*\([^)]*\)|)[\s/]*(?P<value>\d*\.?\d+(?:e-?\d+)?)(?![\d.-])\s*"
_STATED_STEP: Final = re.compile(
    r"(?:\bdt\b|\bdelta\b|(?:time|sampl\w*)[\s_-]*(?:step|interval|period)|intervalo de muestreo)"
    + _VALUE
    + r"(?P<unit>ms)?",
    re.IGNORECASE,
)
_RATE: Final = re.compile(rf"sampl\w*[\s_-]*(?:rate|freq\w*){_VALUE}(?:hz|sps|samples|/s|$)", re.IGNORECASE)
_UNIT: Final = re.compile(
    r"(?:units?|unidades[^:=]*|in units of|pga values \()\s*[:=(]?\s*([a-z][\w/^]*)", re.IGNORECASE
)


def facts_of(header: Sequence[str]) -> Stated:
    """Unit and step [s] that the lines above the numbers state; nothing where two lines disagree."""
    units, steps = set[str](), set[float]()
    for text in (text[:300] for text in header):
        units.update(
            unit.casefold() for unit in _UNIT.findall(text) if factor_of(unit, "acceleration") is not None
        )
        if (step := _STATED_STEP.search(text)) is not None:
            in_ms = step["unit"] or re.search(r"\bms(ec)?\b", step["key"])
            steps.add(float(step["value"]) * (1e-3 if in_ms else 1.0))
        elif (rate := _RATE.search(text)) is not None and float(rate["value"]) > 0.0:
            steps.add(1.0 / float(rate["value"]))
    steps.discard(0.0)
    return Stated(unit=units.pop() if len(units) == 1 else None, dt=steps.pop() if len(steps) == 1 else None)


def _motion_of_table(
    table: ColumnTable, stated: Stated, path: Path, header: Sequence[str] = ()
) -> GroundMotion:
    """The acceleration of a table: its column, unit and step as the file, its header or the options state them."""
    series = series_of(table, ACCELERATION, stated, source=str(path), facts=facts_of(header))
    (name,) = series.names
    source = path.name if stated.column is None else f"'{name}' of {path.name}"
    motion = motion_of_series(series, name=path.stem, source=source)
    return replace(motion, is_road=_ACCELERATION_OF_ROAD.match(name) is not None)


def _is_known(name: str) -> bool:
    return (
        unit_in_name("time", name) is not None
        or ACCELERATION.is_called(name)
        or ACCELERATION.unit_in(name) != ""
    )


def _read_table(lines: Lines, stated: Stated) -> GroundMotion:
    texts = [re.sub(r"^(\s*)%", r"\1#", text) for text in lines.texts]
    filled = [index for index, text in enumerate(texts) if is_data(text)]
    if not filled:
        raise RecordError(f"{lines.path}: there are only comments; expected columns of time and acceleration")
    widths = [_width(texts[index]) for index in filled[:_LONGEST_HEADER]]
    numeric = [row for row, width in enumerate(widths) if width]
    if not numeric:
        # Rows that have texts, too.
        return _motion_of_table(
            DelimitedTable(source=str(lines.path), sha256="", lines=texts), stated, lines.path
        )
    # A row of a header is followed by others than its own, unless names are above it.
    settled = next((row for row in numeric if widths[row] in widths[row + 1 : row + 2]), numeric[0])
    for row in (numeric[0], settled):
        first, width, delimiter = filled[row], widths[row], _delimiter(texts[filled[row]])
        names, units = _names_above(texts[:first], delimiter, width)
        if names:
            break
    table = DelimitedTable(
        source=str(lines.path),
        sha256="",
        lines=texts,
        layout=Layout(
            delimiter=None if delimiter == "\t" else delimiter,
            names=names or numbered_names(width),
            units=units,
            data=tuple(index for index in filled if index >= first),
        ),
    )
    if not names and (width == 1 or (stated.column is None and (width != 2 or stated.dt is not None))):
        column = table.numbers(table.names[0]) if width > 1 else None
        if column is None or not grid(column).runs:
            if stated.column is not None:
                raise SettingError(f"{lines.path}: has one column and takes no `column`; leave it out")
            return _motion_of_table(
                _series(lines, first, width, delimiter), stated, lines.path, texts[:first]
            )
    return _motion_of_table(table, stated, lines.path, texts[:first])


def _width(text: str) -> int:
    """Count of numbers in a row; 0 where a field is no number."""
    delimiter = _delimiter(text)
    fields = (
        text.split() if delimiter == "\t" else [field for field in text.split(delimiter) if field.strip()]
    )
    return len(fields) if all(reads_as_float(field) or _has_comma(field) for field in fields) else 0


def _names_above(
    header: Sequence[str], delimiter: str, width: int
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names and units of the columns in the lines above the numbers, or in a comment; empty where there are none.

    Prose with as many words as there are columns is no header: names must be known, or labels of directions.
    """
    units: tuple[str, ...] = ()
    for above, line in enumerate([text for text in reversed(header) if text.strip(" \t#*-=_")][:_MOST_ABOVE]):
        text = line.strip(" \t#*")
        tail = re.sub(r"^[^:;,]*:\s+", "", text)
        marked = delimiter in line and not line.lstrip().startswith("#") and above == bool(units)
        for fields in (text.split(delimiter), re.split(r"\s{2,}|\t", text), re.split(r"[;,\s]+", tail)):
            named = tuple(field.strip() for field in fields)
            is_time = width == 1 and unit_in_name("time", named[0]) is not None
            if len(named) != width or not all(named) or any(map(reads_as_float, named)) or is_time:
                continue
            if not units and all(quantity_of(name.strip("()[]")) is not None for name in named):
                units = tuple(name.strip("()[]") for name in named)
                break
            is_short = marked and all(len(name.split()) <= _MOST_WORDS for name in named)
            if is_short or any(map(_is_known, named)) or all(map(_LABEL.fullmatch, named)):
                return named, units
    return (), ()


def _delimiter(line: str) -> str:
    """Separator of the numbers of a line; a tab stands for blanks. A comma between blanks is a decimal comma."""
    words = line.split()
    if len(words) > 1 and all(reads_as_float(word) or _has_comma(word) for word in words):
        return "\t"
    return next((mark for mark in "\t;," if mark in line), "\t")


def _has_comma(word: str) -> bool:
    return DECIMAL_COMMA.fullmatch(word.strip()) is not None


def _series(lines: Lines, first: int, width: int, delimiter: str) -> VectorTable:
    if delimiter == "," and all(_has_comma(text) for text in lines.texts[first:] if text.strip()):
        raise RecordError(
            f"{lines.where(first)} holds '{quote_text(lines.at(first))}', two numbers or one with a decimal comma; "
            "write decimal points, or one number a line"
        )
    marks = str.maketrans({",": " " if delimiter == "," else ".", ";": " "})
    numbers = read_numbers(replace(lines, texts=[text.translate(marks) for text in lines.texts]), first)
    rows = numbers[: numbers.size // width * width].reshape(-1, width)
    if width > 1 and len(rows) >= _FEWEST_ROWS:
        along, down = (float(np.abs(np.diff(values, axis=0)).mean()) for values in (rows.ravel(), rows))
        if down < _SMOOTHER * along:
            raise RecordError(
                f"{lines.where(first)} begins {width} columns of which each runs on from row to row, so that the rows "
                f'are no single series; choose one of them, as column="1"'
            )
    return VectorTable(source=str(lines.path), sha256="", vectors=dict.fromkeys(numbered_names(1), numbers))


TABLE = Format(
    name="a table", recognises=lambda _: True, read=_read_table, needs=frozenset({"unit", "dt", "column"})
)


def read_matrix_motion(path: Path, stated: Stated) -> GroundMotion:
    """Read a .mat file: vectors by their names, in structs by path, or a matrix of times [s] and accelerations."""
    column = stated.column
    _, variables = read_variables(path, RECORD, column)
    # Rows of times and accelerations.
    pairs = {
        name: matrix if matrix.shape[0] == 2 else matrix.T
        for name, matrix in matrices_among(variables).items()
        if 2 in matrix.shape and matrix.size >= 6
    }
    if column is None:
        pairs = {name: pair for name, pair in pairs.items() if grid(pair[0]).runs}
        vectors = (
            name for name, of in variables.items() if not isinstance(of, str) and 2 < of.size == max(of.shape)
        )
        candidates = [*pairs, *(name for name in vectors if ACCELERATION.is_called(name.rpartition(".")[2]))]
        if len(candidates) > 1:
            listed = list_names([f"'{name}'" for name in candidates], _MOST_LISTED)
            raise RecordError(
                f"{path}: variables {listed} may all be a ground motion; name one with `column`, as "
                f'column="{candidates[0]}"'
            )
        column = next((name for name in candidates if name in pairs or "." in name), None)
    named = column
    if column in pairs:
        rows = dict(zip(("t_s", column), pairs[column], strict=True))
        others = describe_left_out({name: of for name, of in variables.items() if name != column})
        unused = (f"variables {others}",) if others else ()
        table: ColumnTable = VectorTable(source=str(path), sha256="", vectors=rows, unused=unused)
    else:
        table = open_matlab(path, column)
        if column is not None:
            own = column.rpartition(".")[2] if column in variables else column
            column = find_column(own, table.names, str(path))
            named = named if named in variables else column
            if "." in column:
                return read_matrix_motion(path, replace(stated, column=column))
    motion = _motion_of_table(table, replace(stated, column=column), path)
    source = motion.source if named is None else f"'{named}' of {path.name}"
    return replace(motion, source="; not used: ".join([source, *table.unused]))


# Each format recognises its content; a table is the fallback and comes last.
FORMATS: Final[tuple[Format, ...]] = (PEER_AT2, K_NET, COSMOS, ESM, SMC, GEONET, VOLUME, TABLE)

# Files of a folder that are no records.
_DOCUMENTS: Final = frozenset({
    ".md", ".pdf", ".html", ".json", ".toml", ".py", ".zip", "readme", "license", "licence",
})  # fmt: skip
_MATLAB_5: Final = b"MATLAB 5.0"


@checked
def read_motion(
    path: str | os.PathLike[str],
    *,
    unit: str | None = None,
    dt: float | None = None,
    column: str | None = None,
    channel: int | None = None,
) -> GroundMotion:
    """Read a ground motion: a record of a network, a table of text or CSV, or a .mat file.

    Formats of records are PEER (.AT2), K-NET and KiK-net, COSMOS, ESM, CSMIP (volumes 1 and 2), SMC, GeoNet (V1A and
    V2A), BHRC, RENADIC and USC (volume 1); AFAD, UNAM and CWB are tables with a header. The options supply what a file
    does not state: `unit`, `dt` and `column` of tables, `channel` of files with several channels. One that contradicts
    the file, or that has no effect, is refused; a `dt` beside times chooses among several, and has to agree with them.
    What is doubtful of the record is warned of (`GroundMotion.remarks`).

    Parameters
    ----------
    path
        The file.
    unit
        Unit of the acceleration, for tables that do not state it: ``"g"``, ``"m/s2"``, ``"cm/s2"``, ``"gal"``, ...
    dt
        Sampling step [s] of a table without a column of times, or with several.
    column
        Column of the acceleration in a table, by its name or its number from 1 (``"3"``), or variable of a .mat file,
        in structs by path (``"eq.kobe.ag"``, ``"eq(2).ag"``).
    channel
        Channel of a file with several channels, counted from 1.

    Returns
    -------
    GroundMotion
        Motion in m/s^2 on a uniform step; `changes` lists what the reader had to do.

    Raises
    ------
    RecordError
        The file cannot be read as a ground motion; the sentence names file, line and remedy.
    UnitError
        The unit of the acceleration is not known.
    SettingError
        An option does not fit the file.

    Examples
    --------
    >>> motion = read_motion("records/el_centro_1940_ns.csv")  # doctest: +SKIP
    >>> round(motion.peak, 3)  # doctest: +SKIP
    3.417
    """
    motion = motion_of_file(Path(path), Stated(unit=unit, dt=dt, column=column, channel=channel))
    for sentence in warnings_of(motion.remarks):
        warn(sentence, MrworkWarning, stacklevel=3)
    return motion


def motion_of_file(path: Path, stated: Stated) -> GroundMotion:
    """The motion of a file, without a word on its `remarks`."""
    # Overflowing values become infinite, and the readers refuse them.
    with np.errstate(over="ignore", invalid="ignore"):
        if path.suffix.lower() == ".mat" or bytes_of(path, RECORD, len(_MATLAB_5)) == _MATLAB_5:
            refuse_needless(stated, TABLE.needs, source=str(path), kind="a .mat file")
            motion = read_matrix_motion(path, stated)
        else:
            lines = Lines(path=path, texts=split_lines(read_text_bytes(path)))
            form = next(candidate for candidate in FORMATS if candidate.recognises(lines))
            # The reader of AT2 tells what its header lacks, and numbers alone are a table.
            has_header = not _width(next(filter(is_data, lines.texts), ""))
            form = PEER_AT2 if form is TABLE and path.suffix.lower() == ".at2" and has_header else form
            refuse_needless(stated, form.needs, source=str(path), kind=form.name)
            motion = form.read(lines, stated)
    if not motion.is_road:
        refuse_absurd(motion.acceleration, source=str(path))
    return motion if stated.channel is None else replace(motion, name=f"{path.stem}_{stated.channel}")


@checked
def read_motions(
    paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]], *, unit: str | None = None
) -> tuple[GroundMotion, ...]:
    """Read several motions: a sequence of paths in its order, or a folder or glob pattern in name order.

    Raises
    ------
    RecordError
        No file matches the pattern, the folder has no files, there is no path, or a file cannot be read as a ground
        motion.
    UnitError, SettingError
        As from `read_motion`.
    """
    return tuple(read_motion(file, unit=unit) for file in motion_files(paths))


def motion_files(paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]]) -> tuple[Path, ...]:
    """Files of motions: a sequence of paths, the files of a folder but hidden ones and documents, or a pattern's."""
    if isinstance(paths, str | os.PathLike) and is_folder(Path(paths)):
        paths_in_folder = [
            path
            for path in sorted(Path(paths).iterdir())
            if is_file(path)
            and not path.name.startswith(".")
            and path.suffix.lower() not in _DOCUMENTS
            and path.stem.casefold() not in _DOCUMENTS
        ]
        if not paths_in_folder:
            raise RecordError(f"{paths}: the folder has no file of a ground motion; check the path")
        return tuple(paths_in_folder)
    files = listed_files(paths, none="no ground motion given; name at least one file")
    return tuple(Path(file) for file in files if len(files) == 1 or not is_folder(file))
