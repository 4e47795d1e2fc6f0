"""Read ground motions from files; the format is recognised by the content.

What is no format of a network is a table: text columns with or without names, accelerations with a stated step, or a
.mat file.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from mrwork.base.arguments import checked
from mrwork.base.hints import SMALLEST
from mrwork.base.units import factor_of, factor_to_si, known_units
from mrwork.base.values import Floats
from mrwork.errors import RecordError, SettingError, UnitError
from mrwork.files.delimited import DelimitedTable, encoding_of, read_text_bytes, regular_table
from mrwork.files.layout import DECIMAL_COMMA, reads_as_float
from mrwork.files.matlab import open_matlab, read_matlab_matrices
from mrwork.files.named_columns import LONGEST_NAME, ColumnTable, VectorTable, listed_files, rounded_grid
from mrwork.motions.ground_motion import GroundMotion
from mrwork.motions.networks import (
    COSMOS,
    ESM,
    K_NET,
    PEER_AT2,
    Format,
    Lines,
    Stated,
    lines_of,
    make_motion,
    quote_text,
    read_numbers,
    refuse_absurd,
    refuse_false_at2,
    refuse_needless,
)
from mrwork.store.input_file import RECORD, is_file, is_folder, start_of

# Steps that differ by less, relative to their median, count as equal.
_JITTER = 1e-3
# A last sample of zero this long after the others [s], and in steps, is padding and not part of the record.
_PADDING = 1.0
_PADDING_STEPS = 20.0


def motion_of_columns(
    time: Floats, acceleration: Floats, *, name: str, source: str, where: Callable[[int], str]
) -> GroundMotion:
    """Build a motion from times [s] and accelerations [m/s^2], shape (n_time,); `where` names a row in messages.

    Steps that are equal up to jitter or rounding are taken as uniform; otherwise the record is resampled linearly.
    """
    changes: list[str] = []
    for values, what in ((time, "time"), (acceleration, "acceleration")):
        if not np.isfinite(values).all():
            row = int(np.flatnonzero(~np.isfinite(values))[0])
            raise RecordError(
                f"{where(row)}: the {what} is no finite number; correct the value or delete the row"
            )
    if time.size < 2:
        raise RecordError(f"{where(0)}: the record has {time.size} rows; give two or more")
    wrong = np.flatnonzero(np.diff(time) <= 0.0)
    if wrong.size:
        row = int(wrong[0]) + 1
        raise RecordError(
            f"{where(row)}: time goes from {time[row - 1]:g} to {time[row]:g} s; sort the rows, and write times with "
            "digits enough to differ"
        )
    if _ends_in_padding(time, acceleration):
        changes.append(
            f"last point dropped: zero at {time[-1]:g} s, {time[-1] - time[-2]:g} s behind the others, is padding"
        )
        time, acceleration = time[:-1], acceleration[:-1]
    dt, acceleration, change = _on_one_step(time, acceleration, where)
    if change:
        changes.append(change)
    return GroundMotion(name=name, dt=dt, acceleration=acceleration, source=source, changes=tuple(changes))


def _ends_in_padding(time: Floats, acceleration: Floats) -> bool:
    if time.size < 4 or acceleration[-1] != 0.0:
        return False
    last = float(time[-1] - time[-2])
    return last > _PADDING and last > _PADDING_STEPS * float(np.diff(time[:-1]).max())


def _on_one_step(
    time: Floats, acceleration: Floats, where: Callable[[int], str]
) -> tuple[float, Floats, str]:
    """Step [s], samples, and a description of the change."""
    steps = np.diff(time)
    mean, median = float(time[-1] - time[0]) / steps.size, float(np.median(steps))
    # In a long record, times written with few digits differ in the last digit.
    regular = np.abs(steps - median) <= _JITTER * median + 2.0 * np.spacing(np.abs(time).max())
    if regular.all():
        return mean, acceleration, ""
    uniform = rounded_grid(time)
    if uniform is not None:
        dt = float(uniform[-1] - uniform[0]) / steps.size
        return dt, acceleration, f"times written to {np.ptp(steps):.3g} s taken as uniform, every {dt:.6g} s"
    if not regular.any():
        raise RecordError(f"{where(0)}: no two times have a common step; check the column of times")
    dt = float(steps[regular].mean())
    # Regular steps are taken as equal, so that their samples are kept and not interpolated.
    knots = np.concatenate(([0.0], np.cumsum(np.where(regular, dt, steps))))
    n_time = int(np.floor(knots[-1] / dt + 1e-6)) + 1
    if n_time > 2 * time.size:
        row = int(np.argmax(steps)) + 1
        raise RecordError(
            f"{where(row)}: a gap of {steps[row - 1]:.4g} s before it, and steps of {dt:.4g} s elsewhere, leave most "
            "of the record empty; cut out one continuous part"
        )
    odd = int(np.count_nonzero(~regular))
    count = "one step differs" if odd == 1 else f"{odd} steps differ"
    worst = steps[~regular][np.argmax(np.abs(steps[~regular] - dt))]
    change = f"resampled every {dt:.6g} s, straight between: {count}, by up to {worst - dt:+.4g} s"
    return dt, np.interp(dt * np.arange(n_time), knots, acceleration), change


# "ground_accel_mps2", "Acc (g)", "a_mps2", "xg_ddot"; "t_s", "Time [ms]", "time".
_ACCELERATION: Final = re.compile(r"(ground[\s_-]*)?(a|acc|accel|acceleration|ag|a_g|xg_ddot)", re.IGNORECASE)
_TIME: Final = re.compile(r"\s*(?:t|time)(?:[\s_,:/(\[]+([a-z]+)[)\]]?)?\s*", re.IGNORECASE)
_SECONDS: Final = ("sec", "secs", "second", "seconds")
# Bytes in which a format is recognised, and lines of the longest header.
_HEAD: Final = 65536
_LONGEST_HEADER: Final = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column and the factor from its unit to SI."""

    name: str
    factor: float


def acceleration_column(names: Sequence[str], stated: Stated, *, source: str) -> Column:
    """Find the column of the acceleration."""
    listed = ", ".join(f"'{name}'" for name in names)
    if stated.column is None:
        candidates = [name for name in names if _is_acceleration(name)]
    else:
        candidates = [name for name in names if name.strip().casefold() == stated.column.strip().casefold()]
    if len(candidates) != 1:
        how_many = f"{len(candidates)} columns are" if candidates else "no column is"
        what = "the acceleration" if stated.column is None else f"'{stated.column}'"
        raise RecordError(
            f"{source}: {how_many} {what} among {listed}; name one with `column`, or call it a_mps2 in the file"
        )
    (name,) = candidates
    unit = _unit_in(name)
    if unit is None and stated.unit is None:
        raise UnitError(
            f"{source}: column '{name}' does not state its unit; give it as `unit`, one of "
            f"{known_units('acceleration')}"
        )
    factor = factor_to_si(stated.unit or unit or "", "acceleration", context=f"{source}: `unit`")
    if unit is not None and factor != factor_of(unit, "acceleration"):
        raise SettingError(
            f"{source}: `unit` is '{stated.unit}' where column '{name}' states {unit}; leave it out"
        )
    return Column(name=name, factor=factor)


def _time_column(names: Sequence[str], *, source: str) -> Column | None:
    """Find the column of time, `None` if there is none; a column without a unit is in seconds."""
    candidates = [(name, match[1] or "s") for name in names for match in [_TIME.fullmatch(name)] if match]
    if len(candidates) > 1:
        raise RecordError(
            f"{source}: columns '{candidates[0][0]}' and '{candidates[1][0]}' both look like time; rename one"
        )
    if not candidates:
        return None
    name, unit = candidates[0]
    unit = "s" if unit.casefold() in _SECONDS else unit
    return Column(name=name, factor=factor_to_si(unit, "time", context=f"{source}: column '{name}'"))


def _are_named(names: Sequence[str]) -> bool:
    return any(_is_acceleration(name) for name in names) and all(
        _is_acceleration(name) or _TIME.fullmatch(name) for name in names
    )


def _is_acceleration(name: str) -> bool:
    unit = _unit_in(name)
    stem = (
        name.strip() if unit is None else name.strip().removesuffix(")").removesuffix("]").removesuffix(unit)
    )
    return _ACCELERATION.fullmatch(stem.rstrip(" _-,:([")) is not None


def _unit_in(name: str) -> str | None:
    """Unit that ends a column's name, as in ``Acc (cm/s^2)`` or ``EW [g]``; ``a_g`` is often not in g."""
    text = name.strip()
    if text.casefold() in ("a_g", "ag") or len(text) > LONGEST_NAME:
        return None
    bracketed = re.search(r"[(\[]([^)\]]*)[)\]]$", text)
    if bracketed:
        return bracketed[1].strip() if factor_of(bracketed[1], "acceleration") is not None else None
    for separator in re.finditer(r"[\s_\-,:]+", text):
        rest = text[separator.end() :]
        if factor_of(rest, "acceleration") is not None:
            return rest
    return None


_NAMELESS = ("t_s", "acceleration")


def _motion_of_table(table: ColumnTable, stated: Stated, path: Path) -> GroundMotion:
    acceleration = acceleration_column(table.names, stated, source=str(path))
    time = _time_column(table.names, source=str(path))
    needed = [acceleration] if time is None else [time, acceleration]
    columns = table.read([column.name for column in needed])
    samples = acceleration.factor * columns[acceleration.name]
    if time is not None and stated.dt is not None:
        raise SettingError(f"{path}: column '{time.name}' holds the times; leave out `dt`")
    times: Floats
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


def read_regular_motion(
    data: bytes, stated: Stated, path: Path, others: Sequence[Format]
) -> GroundMotion | None:
    """Read a table with names above rows that are all alike; `None` of any other file, or one of `others`."""
    head = lines_of(data[:_HEAD], path)
    above = [text for text in head.texts if text.strip() and not text.lstrip().startswith("#")]
    if (
        stated.channel is not None
        or len(head.texts) <= _LONGEST_HEADER
        or not above
        or b"%" in data
        # One end of a line here, but two in a table.
        or b"\r\r\n" in data
        or path.suffix.lower() == ".at2"
        or any(form.recognises(head) for form in others)
    ):
        return None
    fields = [field for field in re.split(r"[\t;,]", above[0]) if field.strip()]
    if len(fields) < 2 or all(map(reads_as_float, fields)):
        return None

    def line_by_line() -> DelimitedTable:
        lines = lines_of(data, path)
        return _table(lines, list(lines.texts))

    table = regular_table(data, encoding_of(data), source=str(path), sha256="", careful=line_by_line)
    return None if table is None else _motion_of_table(table, stated, path)


def _read_table(lines: Lines, stated: Stated) -> GroundMotion:
    texts = [re.sub(r"^(\s*)%", r"\1#", text) for text in lines.texts]
    first = next(
        (i for i, text in enumerate(texts) if text.strip() and not text.lstrip().startswith("#")), None
    )
    if first is None:
        raise RecordError(f"{lines.path}: there are only comments; expected columns of time and acceleration")
    delimiter = _delimiter(texts[first])
    if delimiter.isspace():
        # Also where blanks separate the columns; line numbers do not change.
        texts = ["\t".join(text.split()) for text in texts]
    fields = [field for field in texts[first].split(delimiter) if field.strip()]
    if not all(reads_as_float(field) or _has_comma(field) for field in fields):
        return _motion_of_table(_table(lines, texts), stated, lines.path)
    if stated.dt is not None:
        return _series(lines, first, delimiter, stated)
    above = next((text.strip().lstrip("# \t") for text in reversed(texts[:first]) if text.strip()), "")
    names = tuple(name.strip() for name in above.split(delimiter))
    if len(names) == len(fields) and _are_named(names):
        return _motion_of_table(_table(lines, texts, names), stated, lines.path)
    if len(fields) != 2:
        raise RecordError(
            f"{lines.where(first)} holds {len(fields)} numbers and no line above names columns; state the step "
            "as `dt` if all are accelerations, or write a header line such as t_s,a_mps2"
        )
    if stated.unit is None:
        raise UnitError(
            f"{lines.path}: does not state the unit of its second column; give it as `unit`, one of "
            f"{known_units('acceleration')}"
        )
    return _motion_of_table(_table(lines, texts, _NAMELESS), stated, lines.path)


def _table(lines: Lines, texts: list[str], names: tuple[str, ...] | None = None) -> DelimitedTable:
    return DelimitedTable(source=str(lines.path), sha256="", lines=texts, names=names)


def _delimiter(line: str) -> str:
    """Separator of the numbers of a line; a tab stands for blanks. A comma between blanks is a decimal comma."""
    words = line.split()
    if len(words) > 1 and all(reads_as_float(word) or _has_comma(word) for word in words):
        return "\t"
    return next((mark for mark in "\t;," if mark in line), "\t")


def _has_comma(word: str) -> bool:
    return DECIMAL_COMMA.fullmatch(word.strip()) is not None


def _series(lines: Lines, first: int, delimiter: str, stated: Stated) -> GroundMotion:
    """All numbers in order as accelerations."""
    if stated.unit is None or stated.dt is None:
        raise UnitError(
            f"{lines.path}: does not state the unit of its numbers; give it as `unit`, one of "
            f"{known_units('acceleration')}"
        )
    if delimiter == "," and all(_has_comma(text) for text in lines.texts[first:] if text.strip()):
        raise RecordError(
            f"{lines.where(first)} holds '{quote_text(lines.at(first))}', two numbers or one with a decimal comma; "
            "write decimal points, or one number a line"
        )
    if delimiter != ",":
        lines = replace(lines, texts=tuple(text.replace(",", ".") for text in lines.texts))
    lines = replace(lines, texts=tuple(re.sub(r"[;,]", " ", text) for text in lines.texts))
    numbers = read_numbers(lines, first)
    every_second = np.diff(numbers[::2])
    if len(lines.at(first).split()) == 2 and np.allclose(every_second, stated.dt, rtol=0.1):
        raise SettingError(f"{lines.path}: its first column runs as time does; leave out `dt`")
    factor = factor_to_si(stated.unit, "acceleration", context=f"{lines.path}: `unit`")
    return make_motion(
        lines.path, dt=_step(stated.dt, lines.path), acceleration=factor * numbers, source="numbers"
    )


def _step(dt: float, path: Path) -> float:
    if not (np.isfinite(dt) and dt >= SMALLEST):
        raise SettingError(f"{path}: `dt` is {dt} s; give a positive step")
    return dt


TABLE = Format(
    name="a table", recognises=lambda _: True, read=_read_table, needs=frozenset({"unit", "dt", "column"})
)


def read_matrix_motion(path: Path, stated: Stated) -> GroundMotion:
    """Read a .mat file of version 4 to 7: vectors by their names, or a matrix of times [s] and accelerations."""
    matrices = read_matlab_matrices(path, RECORD)
    pairs = {name: pair for name, matrix in matrices.items() for pair in _pair(matrix)}
    if stated.column is None and len(pairs) > 1:
        listed = ", ".join(f"'{name}'" for name in pairs)
        raise RecordError(f"{path}: variables {listed} may all be a ground motion; name one with `column`")
    name = next(iter(pairs), None) if stated.column is None else stated.column
    if name not in pairs:
        return _motion_of_table(open_matlab(path), stated, path)
    time, acceleration = pairs[name]
    table = VectorTable(source=str(path), sha256="", vectors={"t_s": time, name: acceleration})
    return _motion_of_table(table, replace(stated, column=name), path)


def _pair(matrix: Floats) -> list[Floats]:
    """Rows of times and accelerations, shape (2, n_time), if the matrix has two rows or columns; otherwise none."""
    if matrix.ndim != 2 or 2 not in matrix.shape or matrix.size < 6:
        return []
    return [matrix if matrix.shape[0] == 2 else matrix.T]


# Each format recognises its content; a table is the fallback and comes last.
FORMATS: Final[tuple[Format, ...]] = (PEER_AT2, K_NET, COSMOS, ESM, TABLE)

# Files of a folder that are no records.
_DOCUMENTS: Final = frozenset({".md", ".pdf", ".html", ".json", ".toml", ".py", ".zip"})
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
    """Read a ground motion: PEER AT2, K-NET, COSMOS, ESM, a table of text or CSV, or a .mat file.

    The options supply what a file does not state; an option that repeats what the file states is refused.

    Parameters
    ----------
    path
        The file.
    unit
        Unit of the acceleration, for tables whose column names do not state it: ``"g"``, ``"m/s2"``, ``"cm/s2"``,
        ``"gal"``, ...
    dt
        Sampling step [s] of a table without a column of times.
    column
        Column of the acceleration in a table, or variable of a .mat file, if there are several candidates.
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
    file = Path(path)
    stated = Stated(unit=unit, dt=dt, column=column, channel=channel)
    # Overflowing values become infinite, and the readers refuse them.
    with np.errstate(over="ignore", invalid="ignore"):
        motion = _read(file, stated)
    refuse_absurd(motion.acceleration, source=str(file))
    return motion


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
            path for path in sorted(Path(paths).iterdir()) if is_file(path) and not _is_document(path)
        ]
        if not paths_in_folder:
            raise RecordError(f"{paths}: the folder has no file of a ground motion; check the path")
        return tuple(paths_in_folder)
    files = listed_files(paths, none="no ground motion given; name at least one file")
    return tuple(Path(file) for file in files if len(files) == 1 or not is_folder(file))


def _is_document(path: Path) -> bool:
    return (
        path.name.startswith(".")
        or path.suffix.lower() in _DOCUMENTS
        or path.stem.casefold() in ("readme", "license", "licence")
    )


def _read(path: Path, stated: Stated) -> GroundMotion:
    source = str(path)
    head = start_of(path, RECORD, len(_MATLAB_5))
    if head == _MATLAB_5 or path.suffix.lower() == ".mat":
        refuse_needless(stated, TABLE.needs, source=source, kind="a .mat file")
        return read_matrix_motion(path, stated)
    data = read_text_bytes(path)
    motion = read_regular_motion(data, stated, path, [form for form in FORMATS if form is not TABLE])
    if motion is not None:
        return motion
    lines = lines_of(data, path)
    form = next(candidate for candidate in FORMATS if candidate.recognises(lines))
    if form is TABLE and path.suffix.lower() == ".at2":
        refuse_false_at2(lines)
    refuse_needless(stated, form.needs, source=source, kind=form.name)
    return form.read(lines, stated)
