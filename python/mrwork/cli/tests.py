"""Tests of the command line: options for their records and observation models, and how they are read."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from mrwork.base.keys import suggestion
from mrwork.base.units import COMMAND_SCALES, CommandUnit
from mrwork.cli.command_parser import MEASUREMENT, RECORDS, CommandParser
from mrwork.cli.derived import UNCHANGED, Collect, add_option_of
from mrwork.cli.numbers import EVERY, INSTANT, SETTLE, add_number, finite_number
from mrwork.cli.options import add_repeated
from mrwork.cli.output import is_quiet, reading_line
from mrwork.cli.terminal import note
from mrwork.errors import SettingError
from mrwork.identification.residual import NuisanceName
from mrwork.identification.settings import FitSettings
from mrwork.records.columns import parse_column_option
from mrwork.records.finding import REPAIR_KINDS, RepairKind
from mrwork.records.repairs import AMOUNTS_IN_WORDS, as_words

if TYPE_CHECKING:
    from mrwork.identification.fit import Fit
    from mrwork.identification.fit_file import OpenedRun
    from mrwork.records import DamperTest
    from mrwork.records.reading import Reading
    from mrwork.records.rig_table import EveryUse, Use

_NONE = "none"


def add_files(parser: CommandParser, *, required: bool = True) -> None:
    """FILE... and the options for reading the files."""
    records = parser.group(RECORDS)
    records.add_argument(
        "files",
        nargs="+" if required else "*",
        metavar="FILE",
        help="test record: text (.csv, .txt, .dat, .lvm), .mat, .tdms, .xlsx, or synthetic:NAME; a table of "
        "tests (file, use, columns, command), of which the rows for this verb are used; or a folder, for its tests.csv "
        "or its records",
    )
    add_repeated(
        records,
        "--column",
        "QUANTITY=NAME[:UNIT]",
        "heading of a column that is not recognised, with its unit where the file does not tell it, as in "
        "force=F:kN, or its number from 1; the command as a number, as in command=0.5A; the step or rate of a record "
        "without times, as in time=200Hz; NAME=none leaves a column out, markers=skip lines that mark events; repeat "
        "for more",
    )
    add_number(records, "--from", INSTANT, "use the record from this time on", dest="start", metavar="S")
    add_number(records, "--until", INSTANT, "use the record up to this time", dest="end", metavar="S")
    add_number(records, "--every", EVERY, "use every N-th sample", default=1, metavar="N")
    records.add_argument(
        "--repair",
        action=Collect,
        default={},
        type=_repair,
        metavar="KIND[=AMOUNT]",
        help=f"repair the records: {', '.join(REPAIR_KINDS)}; an amount replaces the estimate from the record, as "
        f"in delay=0.002: {AMOUNTS_IN_WORDS}; repeat for more",
    )
    records.add_argument(
        "--keep-velocity",
        action="store_true",
        help="use a velocity column also where it is a difference of the displacement, half a sample off, or held over "
        "several samples; otherwise the velocity is derived from the displacement, and said",
    )
    add_number(
        records,
        "--settle",
        SETTLE,
        "time at the start that is simulated but not compared; default: until the damper has travelled half its "
        "peak-to-peak stroke",
        metavar="S",
    )


def add_observation(parser: CommandParser, *, as_fitted: bool = False) -> None:
    """--observe and --nuisance of an identification, or of a verb that does by default as the identification did."""
    measured = partial(
        add_option_of, parser, FitSettings, MEASUREMENT, default=() if as_fitted else UNCHANGED
    )
    usual = "default: as in the identification" if as_fitted else ""
    measured("observe", metavar="WHAT=VALUE", more=usual)
    measured("nuisances", choices=[_NONE], more=usual)


def reading_of(options: argparse.Namespace, use: Use | EveryUse, fit: Fit | None = None) -> Reading:
    """The test files of the command line, and the settings for reading them; of tables, the rows for a use.

    A velocity that the tests of `fit` keep is kept.
    """
    # Readers of records are slow to load, and the help does not need them.
    from mrwork.records import ListedTest
    from mrwork.records.reading import Reading, is_synthetic
    from mrwork.records.rig_table import check_given_once, facts_of, files_not_read, listed_tests

    rows: list[ListedTest] = []
    for file in options.files:
        rows += [ListedTest(file=file)] if is_synthetic(file) else listed_tests([file], use=use)
    check_given_once(rows)
    for sentence in files_not_read(options.files).values():
        note(sentence)
    facts = facts_of(rows)
    several = [name for name in ("damper", "serial") if "," in facts.get(name, "")]
    if several:
        note(f"warning: the table names several dampers ({facts[several[0]]}), which one fit takes for one")
    return Reading(
        files=tuple(row.file for row in rows),
        columns_of={row.file: row.columns for row in rows if row.columns},
        folder=str(Path.cwd()),
        columns=dict(parse_column_option(option) for option in options.column),
        start=options.start,
        end=options.end,
        every=options.every,
        repairs=options.repair,
        settle=options.settle,
        facts=facts,
        keep_velocity=options.keep_velocity or (fit is not None and fit.keeps_velocity),
    )


def read_tests(
    options: argparse.Namespace, use: Use, fit: Fit | None = None
) -> tuple[Reading, tuple[DamperTest, ...]]:
    """Reading and tests of the command line, cut and then repaired; reports progress in a line.

    Tests that `fit` is to predict are read with the velocity that its own have.
    """
    reading = reading_of(options, use, fit)
    with reading_line(quiet=is_quiet(options)) as on_read:
        return reading, reading.tests(on_read=on_read)


def opened_run(options: argparse.Namespace) -> OpenedRun:
    """The run folder of the command line with its tests; reports progress in a line."""
    from mrwork.identification.fit_file import reopen

    with reading_line(quiet=is_quiet(options)) as on_read:
        return reopen(options.run_folder, on_read=on_read)


def nuisances_of(
    options: argparse.Namespace, default: Sequence[NuisanceName] = ()
) -> tuple[NuisanceName, ...]:
    """The nuisance parameters of the command line, each once; `default` where it names none."""
    names = options.nuisances
    if _NONE in names and {*names} != {_NONE}:
        raise SettingError("--nuisance none cannot be combined with others; give one or the other")
    chosen = tuple(name for name in get_args(NuisanceName) if name in names)
    return chosen if names else tuple(default)


def observation_of(options: argparse.Namespace, default: Sequence[str]) -> tuple[str, ...]:
    """The words of --observe, checked; `default` where there is none."""
    return as_words(options.observe or default)


def command_unit(tests: Sequence[DamperTest], given: CommandUnit | None = None) -> CommandUnit:
    """Unit of the command in the laws: the one that is given, or else the first one that any test has."""
    by_test = [{unit for _, unit in test.commands} for test in tests]
    candidates = [unit for unit in COMMAND_SCALES if any(unit in units for units in by_test)]
    shared = [unit for unit in candidates if all(unit in units for units in by_test)]
    unit = given or next(iter([*shared, *candidates]), None) or "V"
    for test, units in zip(tests, by_test, strict=True):
        if units and unit not in units:
            other = next((test.label for test, has in zip(tests, by_test, strict=True) if unit in has), "")
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
