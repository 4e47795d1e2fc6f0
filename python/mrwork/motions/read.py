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
from typing import Final, NoReturn
from warnings import warn

import numpy as np

from mrwork.base.arguments import checked
from mrwork.base.hints import SMALLEST
from mrwork.base.remark import warnings_of
from mrwork.base.summary import list_names
from mrwork.base.units import FACTORS, factor_of, factor_to_si, quantity_of
from mrwork.base.values import Floats
from mrwork.errors import MrworkWarning, RecordError, SettingError, UnitError
from mrwork.files.delimited import DelimitedTable, read_text_bytes, split_lines
from mrwork.files.layout import DECIMAL_COMMA, Layout, is_data, numbered_names, reads_as_float
from mrwork.files.matlab import describe_left_out, matrices_among, open_matlab, read_variables
from mrwork.files.named_columns import ColumnTable, VectorTable, find_column, unit_in_name, words_and_unit
from mrwork.files.open_table import listed_files
from mrwork.files.rounded_times import rounded_grid
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
    Stated,
    motion_of_columns,
    quote_text,
    read_numbers,
    refuse_needless,
)
from mrwork.store.input_file import RECORD, bytes_of, is_file, is_folder

# "ground_accel_mps2", "Acc (g)", "a_mps2", "xg_ddot".
_ACCELERATION: Final = re.compile(
    r"((ground|road)[\s_-]*)?(a|acc|accel|acceleration|ag|a_g|xg_ddot)", re.IGNORECASE
)
# "road_acceleration_mps2", of a road under a vehicle.
_ACCELERATION_OF_ROAD: Final = re.compile(r"road[\s_-]*a", re.IGNORECASE)
# Directions and channels: N-S, EW, U(+), N00E, H1, CANAL-1.
_LABEL: Final = re.compile(
    r"[A-Z]{1,2}[-_.]?[A-Z0-9]{0,4}(\([+-]\))?|[a-z]{1,2}\d?|(?i:canal|ch[a-z]*|comp[a-z]*|col[a-z]*)[-_. ]?\d{1,2}"
)
_SECONDS: Final = ("", "sec", "secs", "second", "seconds")
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
# Relative difference between the step that the header states and the step of the times; more is a contradiction.
_STEPS_DIFFER: Final = 0.05


def _is_acceleration(name: str) -> bool:
    return _ACCELERATION.fullmatch(_stem_and_unit(name)[0].rstrip(" _-,:")) is not None


def _stem_and_unit(name: str) -> tuple[str, str | None]:
    """A column's name without and with its unit, as of ``Acc (cm/s^2)`` or ``EW [g]``; ``a_g`` is often not in g."""
    words, unit = words_and_unit(name)
    has_unit = factor_of(unit, "acceleration") is not None and name.strip().casefold() != "a_g"
    return (words, unit) if has_unit else (name.strip(), None)


# What a header states: a step, a rate, and a unit after its key, or after "in units of".
_VALUE: Final = r"(?P<key>[^:=]{0,40}[:=]|\s*\([^)]*\)|)[\s/]*(?P<value>\d*\.?\d+(?:e-?\d+)?)(?![\d.-])\s*"
_STEP: Final = re.compile(
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
        if (step := _STEP.search(text)) is not None:
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
    source, names, facts = str(path), table.names, facts_of(header)
    is_nameless = names == numbered_names(len(names))
    times_of = [name for name in names if unit_in_name("time", name) is not None]
    time = next(iter(times_of), None)
    first = table.numbers(names[0]) if time is None and len(names) > 1 else None
    # A column of sample numbers is no time.
    if first is not None and not (np.diff(first) == 1.0).all():
        is_pair = is_nameless and len(names) == 2 and stated.dt is None
        time = names[0] if is_pair or runs_as_time(first) else None
    free = [name for name in names if name != time and name not in times_of]
    if stated.column is not None:
        candidates = [find_column(stated.column, names, source)]
    else:
        candidates = [name for name in free if _is_acceleration(name)] or (free if is_nameless else [])
    name = candidates[0] if len(candidates) == 1 else ""
    if name and times_of:
        # T may be a transverse component.
        times_of = [column for column in times_of if column != name] or times_of
        time = _time_for(name, times_of, table, stated.dt, source)
    if name and name == time:
        raise SettingError(
            f"{source}: column '{name}' holds the times; give `column` another of {_listed(names)}"
        )
    _refuse_other_quantities(table, [name] if name else [] if candidates else free, source)
    likely = name or next(iter(free), "")
    column_unit = _stem_and_unit(likely)[1] or table.units.get(likely, "")
    symbol = column_unit or facts.unit
    unit, dt = stated.unit or symbol, stated.dt or facts.dt
    if not name or unit is None or (time is None and dt is None):
        number = 1 + names.index(free[0]) if free else 1
        _ask(source, "" if name else _listed(names), number, unit is None, time is None and dt is None)
    factor = factor_to_si(unit, "acceleration", context=f"{source}: `unit`")
    if symbol is not None and factor != factor_of(symbol, "acceleration"):
        where = f"column '{name}'" if column_unit else "the header"
        raise SettingError(f"{source}: `unit` is '{stated.unit}' where {where} states {symbol}; leave it out")
    if stated.dt is not None and facts.dt is not None and not np.isclose(stated.dt, facts.dt, rtol=1e-3):
        raise SettingError(
            f"{source}: `dt` is {stated.dt:g} s where the header states {facts.dt:g} s; leave it out"
        )
    columns = table.read([name] if time is None else [time, name])
    if time is not None:
        times = seconds_of(table, time, source)
    elif dt is not None and SMALLEST <= dt < np.inf:
        times = dt * np.arange(columns[name].size, dtype=np.float64)
    else:
        raise SettingError(f"{source}: `dt` is {dt} s; give a positive step")
    step = float(np.median(np.diff(times))) if times.size > 1 else 0.0
    if time is not None and stated.dt is not None and abs(step / stated.dt - 1.0) > _STEPS_DIFFER:
        raise SettingError(
            f"{source}: column '{time}' holds the times, with a step of {step:.6g} s where `dt` is {stated.dt:g} s; "
            "leave out `dt`, or correct the one that is wrong"
        )
    if time is not None and facts.dt is not None and abs(step / facts.dt - 1.0) > _STEPS_DIFFER:
        raise RecordError(
            f"{source}: the header states a step of {facts.dt:.6g} s, and column '{time}' has {step:.6g} s; correct "
            "the one that is wrong"
        )
    motion = motion_of_columns(
        times,
        factor * columns[name],
        name=path.stem,
        source=path.name if stated.column is None else f"'{name}' of {path.name}",
        where=lambda row: f"{path}: {table.locate(row)}",
    )
    is_road = _ACCELERATION_OF_ROAD.match(name) is not None
    return replace(motion, is_road=is_road, dt=motion.dt if time is not None or dt is None else dt)


def _refuse_other_quantities(table: ColumnTable, names: Sequence[str], source: str) -> None:
    """Refuse a table whose column is a displacement or a force, and point to what takes a road or forces."""
    for name in names:
        unit = words_and_unit(name)[1] or table.units.get(name, "")
        if factor_of(unit, "displacement") is not None:
            raise RecordError(
                f"{source}: column '{name}' is a displacement [{unit}], and a ground motion is an acceleration; give "
                f'heights of a road as road = "{Path(source).name}" in [[motion]], or to mr.motions.read_road, and '
                "of an earthquake the acceleration"
            )
        # N may be the north.
        if unit.upper() != "N" and factor_of(unit, "force") is not None:
            raise RecordError(
                f"{source}: column '{name}' is a force [{unit}], and a ground motion is an acceleration; give forces "
                f'on floors as force = "{Path(source).name}" in [[motion]]'
            )


def _time_for(
    name: str, times_of: Sequence[str], table: ColumnTable, dt: float | None, source: str
) -> str | None:
    """The column of the times of a column among those that look like time: as long, and with a step that is stated."""
    if isinstance(table, VectorTable):
        size = table.vectors[name].size
        times_of = [time for time in times_of if table.vectors[time].size == size]
    if len(times_of) > 1 and dt is None:
        raise RecordError(
            f"{source}: columns '{times_of[0]}' and '{times_of[1]}' both look like time; give the step as `dt`, or "
            "rename one"
        )
    if dt is not None and len(times_of) > 1:
        steps = {time: float(np.diff(seconds_of(table, time, source)).mean()) for time in times_of}
        return min(steps, key=lambda time: abs(steps[time] - dt))
    return next(iter(times_of), None)


def seconds_of(table: ColumnTable, time: str, source: str) -> Floats:
    """Times of a column [s]; one without a unit is in seconds."""
    unit = unit_in_name("time", time) or table.units.get(time, "")
    unit = "s" if unit.casefold() in _SECONDS else unit
    return factor_to_si(unit, "time", context=f"{source}: column '{time}'") * table.read([time])[time]


def _listed(names: Sequence[str]) -> str:
    numbered = names == numbered_names(len(names))
    columns = [name if numbered else f"{number} '{name}'" for number, name in enumerate(names, start=1)]
    return list_names(columns, _MOST_LISTED)


def _ask(source: str, columns: str, number: int, unit: bool, step: bool) -> NoReturn:
    """Refuse a table with all open questions at once: which column, which unit, which step."""
    asked = {
        f"which column is the acceleration ({columns})": f'column="{number}"' if columns else "",
        f"the unit of the acceleration (one of {', '.join(FACTORS['acceleration'])})": 'unit="g"'
        if unit
        else "",
        "the step, for no column is time": "dt=0.01" if step else "",
    }
    typed = {words: option for words, option in asked.items() if option}
    error = UnitError if unit and len(typed) == 1 else RecordError
    raise error(
        f"{source}: the file does not state {' and '.join(typed)}; give it as here: {', '.join(typed.values())}"
    )


def runs_as_time(column: Floats) -> bool:
    """Whether a column increases, and nine in ten of its steps are equal but for rounding."""
    steps = np.diff(column)
    if steps.size < 2 or not (steps > 0.0).all():
        return False
    return (
        bool(np.mean(np.abs(steps / np.median(steps) - 1.0) <= 0.1) >= 0.9)
        or rounded_grid(column) is not None
    )


def _is_known(name: str) -> bool:
    return (
        unit_in_name("time", name) is not None
        or _is_acceleration(name)
        or _stem_and_unit(name)[1] is not None
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
        if column is None or not runs_as_time(column):
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
        pairs = {name: pair for name, pair in pairs.items() if runs_as_time(pair[0])}
        vectors = (
            name for name, of in variables.items() if not isinstance(of, str) and 2 < of.size == max(of.shape)
        )
        candidates = [*pairs, *(name for name in vectors if _is_acceleration(name.rpartition(".")[2]))]
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
