"""Tests of the command line: options for their records and observation models, and how they are read."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mrwork.base.keys import suggestion
from mrwork.base.units import COMMAND_SCALES, CommandUnit
from mrwork.cli.command_parser import MEASUREMENT, RECORDS, CommandParser
from mrwork.cli.derived import UNCHANGED, add_option_of, add_options_of, arguments_of
from mrwork.cli.number_texts import finite_number
from mrwork.cli.output import reading_line, told_remarks
from mrwork.cli.terminal import note
from mrwork.errors import SettingError
from mrwork.identification.settings import FitSettings
from mrwork.records.columns import parse_column_option
from mrwork.records.reading import Reading, is_synthetic
from mrwork.records.repairs import AMOUNTS_IN_WORDS, REPAIR_KINDS, RepairKind

if TYPE_CHECKING:
    from mrwork.base.remark import Verb
    from mrwork.identification.fit import Fit
    from mrwork.identification.fit_file import OpenedRun
    from mrwork.records import DamperTest, ListedTest
    from mrwork.records.rig_table import EveryUse, Use


def add_files(parser: CommandParser, *, required: bool = True) -> None:
    """FILE... and the options for reading the files."""
    parser.group(RECORDS).add_argument(
        "files",
        nargs="+" if required else "*",
        metavar="FILE",
        help="test record: text (.csv, .txt, .dat, .lvm), .mat, .tdms, .xlsx, .xls, or synthetic:NAME; a table of "
        "tests (file, use, columns, command), of which the rows for this verb are used; or a folder, for its tests.csv "
        "or its records",
    )
    parser.option(
        RECORDS,
        "--column",
        "heading of a column that is not recognised, with its unit where the file does not tell it, as in "
        "force=F:kN, or its number from 1; the command as a number, as in command=0.5A; the step or rate of a record "
        "without times, as in time=200Hz; NAME=none leaves a column out, markers=skip lines that mark events",
        metavar="QUANTITY=NAME[:UNIT]",
        default=(),
        repeated=True,
    )
    add_option_of(parser, Reading, RECORDS, "start", "from")
    add_option_of(parser, Reading, RECORDS, "end", "until")
    add_options_of(parser, Reading, RECORDS, "every")
    parser.option(
        RECORDS,
        "--repair",
        f"repair the records: {', '.join(REPAIR_KINDS)}; an amount replaces the estimate from the record, as in "
        f"offset=20: {AMOUNTS_IN_WORDS}",
        _repair,
        metavar="KIND[=AMOUNT]",
        default={},
        repeated=True,
    )
    add_options_of(parser, Reading, RECORDS, "keep_velocity", "settle")


def add_observation(parser: CommandParser, *, usual: str = "") -> None:
    """The option on the measurement, of an identification or of a verb that has another, `usual`, default."""
    add_option_of(
        parser,
        FitSettings,
        MEASUREMENT,
        "observe",
        default=() if usual else UNCHANGED,
        metavar="WHAT=VALUE|free|each",
        more=f"default: {usual}" if usual else "",
    )


def reading_of(options: argparse.Namespace, use: Use | EveryUse, fit: Fit | None = None) -> Reading:
    """The test files of the command line, and the settings for reading them; of tables, the rows for a use.

    A velocity that the tests of `fit` keep is kept.
    """
    from mrwork.records import ListedTest
    from mrwork.records.rig_table import check_given_once, files_not_read, listed_tests

    rows: list[ListedTest] = []
    for file in options.files:
        rows += [ListedTest(file=file)] if is_synthetic(file) else listed_tests([file], use=use)
    check_given_once(rows)
    for sentence in files_not_read(options.files).values():
        note(sentence)
    reading = reading_of_rows(
        rows,
        columns=dict(parse_column_option(option) for option in options.column),
        repairs=options.repair,
        **arguments_of(options, Reading),
    )
    several = [name for name in ("damper", "serial") if "," in reading.facts.get(name, "")]
    if several:
        note(
            f"warning: the table names several dampers ({reading.facts[several[0]]}), which one fit takes for one"
        )
    return replace(reading, keep_velocity=True) if fit is not None and fit.keeps_velocity else reading


def reading_of_rows(rows: Sequence[ListedTest], **settings: Any) -> Reading:
    """The test files of rows of tables, and the settings for reading them."""
    from mrwork.records.rig_table import test_facts

    return Reading(
        files=tuple(row.file for row in rows),
        columns_of={row.file: row.columns for row in rows if row.columns},
        folder=str(Path.cwd()),
        facts=test_facts(rows),
        **settings,
    )


def read_tests(
    options: argparse.Namespace, use: Use, fit: Fit | None = None
) -> tuple[Reading, tuple[DamperTest, ...]]:
    """Reading and tests of the command line, cut and then repaired; reports progress in a line.

    Tests that `fit` is to predict are read with the velocity that its own have.
    """
    reading = reading_of(options, use, fit)
    with reading_line(options) as on_read:
        return reading, reading.tests(on_read=on_read)


def opened_run(options: argparse.Namespace, verb: Verb) -> tuple[OpenedRun, list[dict[str, Any]]]:
    """The run folder of the command line with its tests, and what matters of them to a verb; reports progress."""
    from mrwork.identification.fit_file import reopen

    with reading_line(options) as on_read:
        opened = reopen(options.run_folder, on_read=on_read)
    return opened, told_remarks(verb, opened.tests, options)


def command_unit(tests: Sequence[DamperTest], given: CommandUnit | None = None) -> CommandUnit:
    """Unit of the command in the laws: the one that is given, or else the first one that any test has."""
    by_test = [{unit for _, unit in test.commands} for test in tests]
    candidates = [unit for unit in COMMAND_SCALES if any(unit in units for units in by_test)]
    shared = [unit for unit in candidates if all(unit in units for units in by_test)]
    unit = given or next(iter([*shared, *candidates]), None) or "V"
    for test, units in zip(tests, by_test, strict=True):
        if units and unit not in units:
            other = next(
                (test.label for test, units in zip(tests, by_test, strict=True) if unit in units), ""
            )
            beside = f"--command-unit is {unit}" if given else f"that of {other} in {unit}"
            raise SettingError(
                f"{test.label}: the command is {test.command_in_words}, {beside}; laws have one unit of the "
                "command, so fit tests in one unit"
            )
    return unit


def _repair(text: str) -> tuple[RepairKind, float | None]:
    name, equals, amount = text.partition("=")
    for kind in REPAIR_KINDS:
        if kind == name:
            return kind, finite_number(amount) if equals else None
    raise argparse.ArgumentTypeError(
        f"{name!r} is no repair{suggestion(name, REPAIR_KINDS, otherwise='give one of')}"
    )
