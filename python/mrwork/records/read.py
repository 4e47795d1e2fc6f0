"""Read damper tests from files."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

import numpy as np

from mrwork.errors import RecordError
from mrwork.records.build import build_damper_test
from mrwork.records.columns import choose_columns
from mrwork.records.command import nominal_from_name, with_nominal_command
from mrwork.records.damper_test import DamperTest
from mrwork.records.formats.delimited import open_delimited
from mrwork.records.formats.matlab import open_matlab
from mrwork.records.table import ColumnTable, check_is_file, listed_files, open_parquet

_TEXT: Final = (".csv", ".tsv", ".txt", ".dat", ".asc")
EXTENSIONS: Final = (*_TEXT, ".mat", ".parquet", ".pq")
"""Extensions of the files that can hold a test."""


def read_damper_test(path: str | os.PathLike[str], *, columns: Mapping[str, str] | None = None) -> DamperTest:
    """Read one test from a .csv, .tsv, .parquet or .mat file, check it and convert it to SI.

    Columns are recognised by their names with units (``t_s``, ``displacement_mm``, ``Force (kN)``, ``current_a``, in
    any case). Time, displacement and force are required; velocity, current and voltage are optional. A file name such
    as ``10mm1Hz0x5A`` gives nominal amplitude, frequency and command; a column of the command takes precedence.

    Parameters
    ----------
    path
        The file.
    columns
        Quantity (``time``, ``displacement``, ``velocity``, ``force``, ``current``, ``voltage``) to
        ``"COLUMN:UNIT"``, for columns whose names do not state it.

    Returns
    -------
    DamperTest
        Test with the results of all checks in its `findings`.

    Raises
    ------
    RecordError
        The file cannot be read as a test; the message names file, line and remedy.
    UnitError
        A column has no unit or a unit of another quantity.
    SettingError
        `columns` is malformed.

    Examples
    --------
    >>> test = read_damper_test("rig/10mm1Hz0x5A.csv", columns={"force": "F:kN"})  # doctest: +SKIP
    >>> test.current, test.frequency  # doctest: +SKIP
    (0.5, 1.0)
    """
    file = Path(path)
    source = str(file)
    table = _open_table(file)
    chosen = choose_columns(table.names, columns, units=table.units, source=source)
    numbers = table.read([choice.column for choice in chosen.values()])
    # Overflowing values become infinite, and the checks refuse them with their line.
    with np.errstate(over="ignore", invalid="ignore"):
        si = {quantity: choice.factor * numbers[choice.column] for quantity, choice in chosen.items()}
    nominal = nominal_from_name(file.stem)
    test = build_damper_test(
        name=file.stem,
        time=si["time"],
        displacement=si["displacement"],
        force=si["force"],
        velocity=si.get("velocity"),
        current=si.get("current"),
        voltage=si.get("voltage"),
        amplitude=nominal.amplitude,
        frequency=nominal.frequency,
        path=source,
        sha256=table.sha256,
        locate=table.locate,
    )
    return with_nominal_command(test, nominal)


def read_damper_tests(
    paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    *,
    columns: Mapping[str, str] | None = None,
) -> tuple[DamperTest, ...]:
    """Read several tests: a sequence of paths in its order, or a glob pattern in name order.

    Raises
    ------
    RecordError
        No file matches the pattern, there is no path, or a file cannot be read as a test.
    """
    files = listed_files(paths, none="no record given; name at least one file")
    return tuple(read_damper_test(file, columns=columns) for file in files)


def _open_table(path: Path) -> ColumnTable:
    """Open a CSV, TSV, Parquet or .mat file as named columns.

    Raises
    ------
    RecordError
        The path is missing, a directory, of an unknown extension, unreadable, or its content is refused.
    """
    extension = path.suffix.lower()
    try:
        check_is_file(path)
        if extension in _TEXT:
            return open_delimited(path)
        if extension == ".mat":
            return open_matlab(path)
        if extension in (".parquet", ".pq"):
            return open_parquet(path)
    except OSError as error:
        raise RecordError(f"{path}: cannot be read ({error}); check the file and its permissions") from error
    came = f"the extension is '{extension}'" if extension else "there is no extension"
    raise RecordError(
        f"{path}: {came} where one of {', '.join(EXTENSIONS)} was expected; export the record as one of these"
    )
