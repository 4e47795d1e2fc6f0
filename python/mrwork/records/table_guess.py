"""First guess of a table of tests from the headers, rows of units and names of files, with what is in doubt."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Final

from mrwork.arguments import checked
from mrwork.errors import MrworkError
from mrwork.files.column_names import TestQuantity
from mrwork.files.open_table import open_table
from mrwork.records.columns import (
    COMMAND,
    COMMANDS,
    REQUIRED,
    ColumnChoice,
    StatedCommand,
    guess_columns,
    scalar_command,
    tells_a_test,
    unclear_commands,
)
from mrwork.records.command import nominal_from_name
from mrwork.records.read import read_damper_test
from mrwork.records.rig_table import UNKNOWN, ListedTest

# A number with a unit of current or voltage anywhere in a name: 500mA_run3, sine 0.5 A, dec_3x21V.
_COMMAND_IN_NAME: Final = re.compile(r"(?<![\dA-Za-z.])(\d+(?:[x.,]\d+)?)[\s_]?(m?[AV])(?![A-Za-z\d])")
_IN_COLUMNS: Final[tuple[TestQuantity, ...]] = (*REQUIRED, "velocity")


@checked
def guess_tests(files: Sequence[Path]) -> tuple[ListedTest, ...]:
    """A row of a table of tests for each file, all for the fit; entries that cannot be told are "?".

    A row is in doubt where a quantity cannot be told, where its command is a guess or unknown, or where the test cannot
    be read or contradicts the name of its file. A file that is no table at all is not used.
    """
    return tuple(_guess(file) for file in files)


def _guess(file: Path) -> ListedTest:
    try:
        table = open_table(file, partial(tells_a_test, source=str(file)))
    except MrworkError as error:
        return ListedTest(file=str(file), doubt=_plain(error, file))
    try:
        scalar = scalar_command(table.names, table.units, source=str(file))
    except MrworkError as error:
        return ListedTest(file=str(file), doubt=_plain(error, file))
    names = [name for name in table.names if scalar is None or name != scalar.column]
    chosen, doubts = guess_columns(names, units=table.units, stamps=table.stamps, source=str(file))
    columns: dict[str, str] = {
        quantity: choice.specification if choice is not None else UNKNOWN
        for quantity in _IN_COLUMNS
        for choice in [chosen.get(quantity)]
        if choice is not None or quantity in REQUIRED
    }
    used = {choice.column for choice in chosen.values()}
    unclear = unclear_commands(names, table.units, used)
    about_columns = next((doubts[quantity] for quantity in COMMANDS if quantity in doubts), "")
    if unclear:
        about_columns = (
            f"'{unclear[0]}' may be the command and does not say its unit; give it as {unclear[0]}:A"
        )
    command, about_command = (UNKNOWN, about_columns) if about_columns else _command(file, chosen, scalar)
    if command:
        columns[COMMAND] = command
    remarks = [*(doubt for quantity, doubt in doubts.items() if quantity not in COMMANDS), about_command]
    if UNKNOWN not in columns.values():
        remarks.append(_read(file, columns))
    return ListedTest(file=str(file), use="fit", columns=columns, doubt="; ".join(filter(None, remarks)))


def _command(
    file: Path, chosen: dict[TestQuantity, ColumnChoice], scalar: StatedCommand | None
) -> tuple[str, str]:
    """The command as a table states it, and a doubt about it, either empty where there is none."""
    recorded = [chosen[quantity] for quantity in COMMANDS if quantity in chosen]
    if len(recorded) > 1:
        return "", f"the command may be '{recorded[0].column}' or '{recorded[1].column}'"
    if recorded:
        return recorded[0].specification, ""
    if scalar is not None:
        return f"{scalar.column}:{scalar.unit}", ""
    nominal = nominal_from_name(file.stem)
    for value, unit in ((nominal.current, "A"), (nominal.voltage, "V")):
        if value is not None:
            return f"{value:g} {unit}", ""
    numbers = {
        f"{match[1].replace('x', '.').replace(',', '.')} {match[2]}"
        for match in _COMMAND_IN_NAME.finditer(file.stem)
    }
    if len(numbers) == 1:
        (found,) = numbers
        return found, "the command is guessed from the name of the file"
    return "", "the command is not known; give it as 0.5 A, or as COLUMN:UNIT"


def _read(file: Path, columns: dict[str, str]) -> str:
    """Why the test cannot be read, or what contradicts the name of its file; empty where nothing does."""
    try:
        test = read_damper_test(file, columns=columns)
    except MrworkError as error:
        return _plain(error, file)
    return "; ".join(finding.message for finding in test.findings if finding.code == "name_disagrees")


def _plain(error: MrworkError, file: Path) -> str:
    return str(error).removeprefix(f"{file}: ")
