"""The first version of a table of tests, from headers, rows of units and names of files, with what is in doubt."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from mrwork.base.arguments import checked
from mrwork.errors import MrworkError, SettingError
from mrwork.files.named_columns import TestQuantity
from mrwork.files.open_table import open_table, split_part
from mrwork.records.columns import (
    COMMAND,
    COMMANDS,
    MARKERS,
    REQUIRED,
    ColumnChoice,
    Headings,
    StatedCommand,
    check_specification,
    tells_a_test,
)
from mrwork.records.command_column import DISAGREES, nominal_from_name
from mrwork.records.parts import count_parts, side_of
from mrwork.records.read import marked_lines, read_damper_test
from mrwork.records.rig_table import UNKNOWN, ListedTest


@checked
def guess_tests(files: Sequence[Path], *, columns: Mapping[str, str] | None = None) -> tuple[ListedTest, ...]:
    """A row of a table of tests for each file, all for the fit; entries that cannot be told are "?".

    A row is in doubt where a quantity cannot be told, where its command is a guess or unknown, or where the test cannot
    be read or contradicts the name of its file. A file that is no table at all is not used. `columns`, as for
    `read_damper_test`, go before guesses.
    """
    given = {COMMAND if key in COMMANDS else key: entry for key, entry in (columns or {}).items()}
    for key, entry in given.items():
        check_specification(key, entry)
    if others := [key for key in given if key not in (*REQUIRED, "velocity", COMMAND, MARKERS)]:
        raise SettingError(
            f"a table of tests has no column for {others[0]}; leave {others[0]}={given[others[0]]} out"
        )
    return tuple(row for file in files for row in _guesses(file, given))


def _guesses(file: Path, given: Mapping[str, str]) -> Iterator[ListedTest]:
    """A row for each part of a file."""
    try:
        parts = count_parts(open_table(file, tells_a_test))
    except MrworkError as error:
        yield ListedTest(file=str(file), doubt=_plain(error, file))
        return
    for part in range(1, parts + 1):
        yield _guess(Path(f"{file}#{part}") if parts > 1 else file, given)


def _guess(file: Path, given: Mapping[str, str]) -> ListedTest:
    try:
        name, part = split_part(file)
        table = open_table(Path(name), tells_a_test)
        headings, _ = side_of(table, Headings.of(table, str(file)), part)
        scalar = headings.scalar_command()
    except MrworkError as error:
        return ListedTest(file=str(file), doubt=_plain(error, file))
    if scalar is not None:
        headings = replace(headings, names=[each for each in headings.names if each != scalar.column])
    chosen, doubts = headings.guess()
    columns: dict[str, str] = {
        quantity: chosen[quantity].specification if quantity in chosen else UNKNOWN
        for quantity in (*REQUIRED, "velocity")
        if quantity in chosen or quantity in REQUIRED
    }
    about = [doubts.pop(quantity) for quantity in COMMANDS if quantity in doubts]
    if unclear := headings.unclear_commands({choice.column for choice in chosen.values()}):
        about = [f"'{unclear[0]}' may be the command and does not say its unit; give it as {unclear[0]}:A"]
    command, doubt = (UNKNOWN, about[0]) if about else _stated_command(file, chosen, scalar)
    if COMMAND in given:
        doubt = ""
    elif command:
        columns[COMMAND] = command
    if (marked := marked_lines(table)) and MARKERS not in given:
        columns[MARKERS] = UNKNOWN
    marked = "" if MARKERS in given else marked
    columns |= given
    doubts = {quantity: text for quantity, text in doubts.items() if quantity not in given}
    remarks = [marked, *doubts.values(), doubt]
    if UNKNOWN not in columns.values():
        remarks.append(_read(file, columns))
    return ListedTest(file=str(file), use="fit", columns=columns, doubt="; ".join(filter(None, remarks)))


def _stated_command(
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
    if nominal.command is not None:
        guessed = "" if nominal.is_regular else "the command is guessed from the name of the file"
        return f"{nominal.command.values:g} {nominal.command.unit}", guessed
    return "", "the command is not known; give it as 0.5 A, or as COLUMN:UNIT"


def _read(file: Path, columns: dict[str, str]) -> str:
    """Why the test cannot be read, or what contradicts the name of its file; empty where nothing does."""
    try:
        remarks = read_damper_test(file, columns=columns).remarks
    except MrworkError as error:
        return _plain(error, file)
    return "; ".join(remark.message for remark in remarks if remark.code == DISAGREES.code)


def _plain(error: MrworkError, file: Path) -> str:
    return str(error).removeprefix(f"{file}: ")
