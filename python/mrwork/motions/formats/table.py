"""Ground motions in tables of text: columns with names or without, or accelerations alone and a stated step."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError, SettingError, UnitError
from mrwork.motions.formats.columns import acceleration_column, are_named, time_column
from mrwork.motions.formats.format import Format, Stated, recorded
from mrwork.motions.formats.lines import Lines, is_number, read_numbers
from mrwork.motions.formats.uniform import motion_of_columns
from mrwork.motions.ground_motion import GroundMotion
from mrwork.records.formats.delimited import DelimitedTable
from mrwork.records.table import Table
from mrwork.units import factor_to_si, known_units

_NAMELESS = ("t_s", "acceleration")


def motion_of_table(table: Table, stated: Stated, path: Path) -> GroundMotion:
    """Motion of the columns of a table, whatever file they come from.

    Raises
    ------
    RecordError, UnitError, SettingError
        What the column reader and `motion_of_columns` refuse; times are missing, or stated on top of a column.
    """
    acceleration = acceleration_column(table.names, stated, source=str(path))
    time = time_column(table.names, source=str(path))
    wanted = [acceleration] if time is None else [time, acceleration]
    columns = table.read([column.name for column in wanted])
    samples = acceleration.factor * columns[acceleration.name]
    if time is not None and stated.dt is not None:
        raise SettingError(f"{path}: column '{time.name}' holds the times; leave out `dt`")
    times: NDArray[np.float64]
    if time is not None:
        times = time.factor * columns[time.name]
    elif stated.dt is not None:
        times = _step(stated.dt, path) * np.arange(samples.size, dtype=np.float64)
    else:
        raise RecordError(f"{path}: no column is time; name one t_s, or state the step as `dt`")
    return motion_of_columns(
        times,
        samples,
        name=path.stem,
        source=path.name if stated.column is None else f"'{acceleration.name}' of {path.name}",
        where=lambda row: f"{path}: {table.locate(row)}",
    )


def _read(lines: Lines, stated: Stated) -> GroundMotion:
    texts = [re.sub(r"^(\s*)%", r"\1#", text) for text in lines.texts]
    first = next(
        (i for i, text in enumerate(texts) if text.strip() and not text.lstrip().startswith("#")), None
    )
    if first is None:
        raise RecordError(f"{lines.path}: there are only comments; expected columns of time and acceleration")
    if not any(mark in texts[first] for mark in "\t;,"):
        # Blanks part the columns; line numbers stay as they are.
        texts = ["\t".join(text.split()) for text in texts]
    fields = [field for field in re.split(r"[\t;,]", texts[first]) if field.strip()]
    if not all(is_number(field) for field in fields):
        return motion_of_table(_table(lines, texts), stated, lines.path)
    if stated.dt is not None:
        return _series(lines, first, stated)
    above = next((text.strip().lstrip("# \t") for text in reversed(texts[:first]) if text.strip()), "")
    names = tuple(name.strip() for name in re.split(r"[\t;,]", above))
    if len(names) == len(fields) and are_named(names):
        return motion_of_table(_table(lines, texts, names), stated, lines.path)
    if len(fields) != 2:
        raise RecordError(
            f"{lines.where(first)} holds {len(fields)} numbers and no line above names columns; state the step "
            "as `dt` if all are accelerations, or write a header line such as t_s,a_mps2"
        )
    if stated.unit is None:
        raise UnitError(
            f"{lines.path}: does not say the unit of its second column; state it as `unit`, one of "
            f"{known_units('acceleration')}"
        )
    return motion_of_table(_table(lines, texts, _NAMELESS), stated, lines.path)


def _table(lines: Lines, texts: list[str], names: tuple[str, ...] | None = None) -> DelimitedTable:
    return DelimitedTable(source=str(lines.path), sha256="", lines=texts, names=names)


def _series(lines: Lines, first: int, stated: Stated) -> GroundMotion:
    """All numbers in the order of reading, as accelerations."""
    if stated.unit is None or stated.dt is None:
        raise UnitError(
            f"{lines.path}: does not say the unit of its numbers; state it as `unit`, one of "
            f"{known_units('acceleration')}"
        )
    if "," in lines.at(first) or ";" in lines.at(first):
        lines = Lines(path=lines.path, texts=tuple(re.sub(r"[;,]", " ", text) for text in lines.texts))
    numbers = read_numbers(lines, first)
    every_second = np.diff(numbers[::2])
    if len(lines.at(first).split()) == 2 and np.allclose(every_second, stated.dt, rtol=0.1):
        raise SettingError(f"{lines.path}: its first column runs as time does; leave out `dt`")
    factor = factor_to_si(stated.unit, "acceleration", context=f"{lines.path}: `unit`")
    return recorded(
        lines.path, dt=_step(stated.dt, lines.path), acceleration=factor * numbers, source="numbers"
    )


def _step(dt: float, path: Path) -> float:
    if not (np.isfinite(dt) and dt > 0.0):
        raise SettingError(f"{path}: `dt` is {dt} s; give a positive step")
    return dt


TABLE = Format(
    name="a table", recognises=lambda _: True, read=_read, needs=frozenset({"unit", "dt", "column"})
)
