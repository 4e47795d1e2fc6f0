"""Read damper tests from files."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.arguments import checked
from mrwork.errors import RecordError
from mrwork.files.column_names import TestQuantity
from mrwork.files.named_columns import ColumnTable
from mrwork.files.open_table import open_table
from mrwork.records.build import build_damper_test
from mrwork.records.columns import (
    COMMAND,
    COMMANDS,
    StatedCommand,
    choose_columns,
    scalar_command,
    tells_a_test,
    unclear_commands,
)
from mrwork.records.command import nominal_from_name, with_nominal_command
from mrwork.records.damper_test import DamperTest, Finding
from mrwork.records.rig_table import EVERY_USE, EveryUse, Use, files_not_read, listed_tests
from mrwork.summary import listed

# Columns that a note names; more are counted.
_MOST_NAMED: Final = 8


@checked
def read_damper_test(path: str | os.PathLike[str], *, columns: Mapping[str, str] | None = None) -> DamperTest:
    """Read one test from a text, .mat, .tdms, .xlsx or Parquet file, check it and convert it to SI.

    Columns are recognised by their names with units (``t_s``, ``displacement_mm``, ``Force (kN)``, ``current_a``, in
    any case); a column of times of the day is the time from its first. Time, displacement and force are required;
    velocity, current and voltage are optional, and so is a command in another unit (``valve_mm``, ``opening_%``,
    ``setpoint_psi``), which is not converted. A file name such as ``10mm1Hz0x5A`` gives nominal amplitude, frequency
    and command; a column of the command takes precedence.

    Parameters
    ----------
    path
        The file.
    columns
        Quantity (``time``, ``displacement``, ``velocity``, ``force``, ``current``, ``voltage``) to
        ``"COLUMN:UNIT"``, or ``"COLUMN"`` where the file tells the unit, for columns whose names do not state it; the
        name may leave out a unit at its end. ``command`` is a column of current or voltage, or a number with its unit,
        as ``"0.5 A"``, which goes before the columns of the file.

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
    table = open_table(file, partial(tells_a_test, source=str(file)))
    given = dict(columns or {})
    stated = StatedCommand.of(given.pop(COMMAND)) if COMMAND in given else None
    scalar: StatedCommand | None = None
    if stated is not None:
        stated = stated.in_file(table.names, table.units, source)
        if stated.unit is not None:
            scalar = stated
        elif stated.quantity is not None and stated.column:
            given[stated.quantity] = stated.column
    elif not given.keys() & set(COMMANDS):
        scalar = scalar_command(table.names, table.units, source=source)

    def numbers_of(name: str) -> NDArray[np.float64] | None:
        try:
            return table.read([name])[name]
        except RecordError:
            return None

    # A scalar command is none of the other quantities, whatever the unit in its name.
    names = tuple(name for name in table.names if scalar is None or name != scalar.column)
    chosen = choose_columns(
        names, given, units=table.units, stamps=table.stamps, source=source, read=numbers_of
    )
    if stated is not None and (stated.value is not None or stated.unit is not None):
        chosen = {quantity: choice for quantity, choice in chosen.items() if quantity not in COMMANDS}
    if chosen.keys() & set(COMMANDS):
        scalar = None
    of_scalar = () if scalar is None or scalar.value is not None else (scalar.column,)
    numbers = table.read([*(choice.column for choice in chosen.values()), *of_scalar])
    # Overflowing values become infinite, and the checks refuse them with their line.
    with np.errstate(over="ignore", invalid="ignore"):
        si: dict[TestQuantity, ArrayLike] = {
            quantity: choice.factor * numbers[choice.column] for quantity, choice in chosen.items()
        }
    if stated is not None and stated.quantity is not None and stated.value is not None:
        si[stated.quantity] = stated.value
    nominal = nominal_from_name(file.stem)
    test = build_damper_test(
        name=file.stem,
        time=si["time"],
        displacement=si["displacement"],
        force=si["force"],
        velocity=si.get("velocity"),
        current=si.get("current"),
        voltage=si.get("voltage"),
        command=None if scalar is None else numbers[scalar.column] if of_scalar else scalar.value,
        command_unit=None if scalar is None else scalar.unit,
        amplitude=nominal.amplitude,
        frequency=nominal.frequency,
        path=source,
        sha256=table.sha256,
        locate=table.locate,
    )
    used = {*(choice.column for choice in chosen.values()), *of_scalar}
    test = with_nominal_command(test, nominal, unclear_commands(table.names, table.units, used))
    unused = unused_finding(table, used)
    return replace(test, findings=(*test.findings, *unused))


def unused_finding(table: ColumnTable, used: Collection[str]) -> tuple[Finding, ...]:
    """Note the columns and other parts of a file that no quantity of the test is read from."""
    columns = [f"'{name}'" for name in table.names if name and name not in used]
    named = f"column{'s' if len(columns) > 1 else ''} {listed(columns, _MOST_NAMED)}"
    parts = [*([named] if columns else []), *table.unused]
    unused = (Finding.note("not_used", f"not used: {'; '.join(parts)}"),) if parts else ()
    further = listed([f"'{name}'" for name in table.further], _MOST_NAMED)
    message = f"{len(table.further)} more sheets have a record: {further}"
    action = "save each as a file of its own to read it"
    return (
        unused if not table.further else (*unused, Finding.warning("further_records", message, action=action))
    )


@checked
def read_damper_tests(
    paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    *,
    columns: Mapping[str, str] | None = None,
    use: Use | EveryUse = EVERY_USE,
) -> tuple[DamperTest, ...]:
    """Read several tests: files, folders and tables of tests in their order, or a glob pattern in name order.

    Parameters
    ----------
    paths
        A folder stands for its table ``tests.csv``, or without one for all records in it; see `read_test_table`.
    columns
        As for `read_damper_test`, for all files; entries of a table go before them.
    use
        Of tables, read the tests for this use only: ``fit``, ``calibration`` or ``test``. The default, ``every``, reads
        all that have a use, held-out tests included: identify from those for ``fit``.

    Raises
    ------
    RecordError
        No file matches the pattern, there is no path, or a file cannot be read as a test.

    Examples
    --------
    >>> tests = read_damper_tests("rig/", use="fit")  # doctest: +SKIP
    """
    given = [paths] if isinstance(paths, str | os.PathLike) else list(paths)
    rows = listed_tests(given[0] if isinstance(paths, str | os.PathLike) else given, use=use)
    beside = {
        folder: Finding.note("files_not_read", sentence) for folder, sentence in files_not_read(given).items()
    }
    tests = [read_damper_test(row.file, columns={**(columns or {}), **row.columns}) for row in rows]
    return tuple(
        replace(test, findings=(*test.findings, beside[folder]))
        if (folder := Path(test.path).parent) in beside
        else test
        for test in tests
    )
