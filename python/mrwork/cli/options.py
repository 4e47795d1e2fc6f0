"""Options that several verbs share, and the tests, bounds and laws that follow from them."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from functools import partial
from math import isfinite
from pathlib import Path
from typing import Any, get_args

from mrwork.base.keys import suggestion
from mrwork.base.units import COMMAND_SCALES, CommandUnit
from mrwork.cli.command_parser import COMPUTATION, MEASUREMENT, OUTPUT, RECORDS, CommandParser
from mrwork.cli.derived import UNCHANGED, add_option_of
from mrwork.cli.numbers import EVERY, INSTANT, SEED, SETTLE, THREADS, add_number, named_path
from mrwork.cli.output import is_quiet, reading_line
from mrwork.cli.own_models import add_trust, is_own, own_model
from mrwork.cli.terminal import note
from mrwork.dampers.laws import LawName
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.identification.fit import Fit
from mrwork.identification.fit_file import OpenedRun, reopen
from mrwork.identification.residual import NuisanceName
from mrwork.identification.settings import FitSettings
from mrwork.records import DamperTest, ListedTest
from mrwork.records.columns import parse_column_option
from mrwork.records.reading import Reading, is_synthetic
from mrwork.records.repairs import (
    AMOUNTS_IN_WORDS,
    REPAIR_KINDS,
    VALUES_IN_WORDS,
    RepairKind,
    as_words,
)
from mrwork.records.rig_table import EveryUse, Use, check_given_once, facts_of, files_not_read, listed_tests

_NONE = "none"
_AUTO = "auto"


def add_repeated(
    group: Any, option: str, metavar: str, help: str, *, dest: str | None = None, type: Any = None
) -> None:
    """Declare an option that may be given several times, as its help says."""
    group.add_argument(option, action="append", default=[], metavar=metavar, help=help, dest=dest, type=type)


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
    add_repeated(
        records,
        "--repair",
        "KIND[=AMOUNT]",
        f"repair the records: {', '.join(REPAIR_KINDS)}; an amount replaces the estimate from the record, as "
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
    measured("observe", metavar="WHAT=VALUE", more=f"{VALUES_IN_WORDS}{f'; {usual}' if usual else ''}")
    measured("nuisances", choices=[_NONE], more=usual)


def add_run(parser: CommandParser) -> None:
    """RUN, the folder of an identification, as `options.run_folder`."""
    parser.add_argument("run_folder", type=named_path, metavar="RUN", help="run folder of mrwork identify")
    parser.add_argument(
        "--changed",
        action="store_true",
        help="also read files of RUN that are not as mrwork has written them",
    )
    add_trust(parser)


def add_threads(parser: CommandParser) -> None:
    """--threads."""
    group = parser.group(COMPUTATION)
    add_number(group, "--threads", THREADS, "number of threads, default 0, all", default=0, metavar="N")


def add_seed(parser: CommandParser, of: str) -> None:
    """--seed, of what `of` names."""
    add_number(parser.group(COMPUTATION), "--seed", SEED, f"seed of {of}, default 0", default=0, metavar="N")


def add_out(parser: CommandParser, what: str) -> None:
    """--out, which `what` describes, and --replace."""
    output = parser.group(OUTPUT)
    output.add_argument("--out", type=named_path, metavar="DIR", help=what)
    output.add_argument(
        "--replace",
        action="store_true",
        help="replace the run in the folder also where it is unfinished or of another verb, where other verbs have "
        "added to it, or where a file has been changed; otherwise it is refused. Files that no verb has written are "
        "kept",
    )


def end_parser(
    parser: CommandParser,
    run: Callable[[argparse.Namespace], int],
    *,
    resume: str = "",
    quiet: str = "no progress line",
) -> None:
    """Declare --resume and --quiet, each where it has a help, and --json; `run` is what the verb does."""
    output = parser.group(OUTPUT)
    for option, help in (("--resume", resume), ("--quiet", quiet)):
        if help:
            output.add_argument(option, action="store_true", help=help)
    output.add_argument(
        "--json", action="store_true", help="print one JSON object on stdout and nothing else"
    )
    parser.set_defaults(run=run)


def reading_of(options: argparse.Namespace, use: Use | EveryUse, fit: Fit | None = None) -> Reading:
    """The test files of the command line, and the settings for reading them; of tables, the rows for a use.

    A velocity that the tests of `fit` keep is kept.
    """
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
        repairs=dict(_repair(option) for option in options.repair),
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
    with reading_line(quiet=is_quiet(options)) as on_read:
        return reopen(options.run_folder, on_read=on_read)


def _entry(option: str, text: str, form: str, *, inside: str = "") -> tuple[str, str]:
    """Name and value of the text of an option, which has `form` and something `inside` its value."""
    name, _, value = text.partition("=")
    if name and value and inside in value:
        return name, value
    raise SettingError(f"{option} is {text!r}; give {form}")


def models_of(options: argparse.Namespace) -> list[str | DamperSpec]:
    """The models, or "all"; a damper of the user as its spec."""
    return [own_model(each) if is_own(each) else each for each in options.model.split(",")]


def laws_are_chosen(options: argparse.Namespace) -> bool:
    """Whether --law auto is given."""
    return _AUTO in options.law


def laws_of(options: argparse.Namespace) -> dict[str, LawName]:
    """Current law by name of parameter, of those that are given."""
    if options.driver_lag and not options.law:
        raise SettingError("--driver-lag is of the command, which no parameter follows; give --law NAME=LAW")
    if options.driver_lag and laws_are_chosen(options):
        raise SettingError(
            "--law auto chooses laws from tests at constant commands, which show no lag; leave --driver-lag out, or "
            "give the laws"
        )
    laws: dict[str, LawName] = {}
    for text in options.law:
        if text == _AUTO:
            continue
        name, law = _entry("--law", text, "NAME=LAW, as in k_w=quadratic, or auto")
        laws[name] = law
    return laws


def command_unit(tests: Sequence[DamperTest], given: CommandUnit | None = None) -> CommandUnit:
    """Unit of the command in the laws: the one that is given, or else the first one that any test has."""
    own = [{unit for _, unit in test.commands} for test in tests]
    known = [unit for unit in COMMAND_SCALES if any(unit in units for units in own)]
    shared = [unit for unit in known if all(unit in units for units in own)]
    unit = given or next(iter([*shared, *known]), None) or "V"
    for test, units in zip(tests, own, strict=True):
        if units and unit not in units:
            other = next((each.label for each, has in zip(tests, own, strict=True) if unit in has), "")
            beside = f"--command-unit is {unit}" if given else f"that of {other} in {unit}"
            raise SettingError(
                f"{test.label}: the command is {test.command_in_words}, {beside}; laws have one unit of the "
                "command, so fit tests in one unit"
            )
    return unit


def nuisances_of(
    options: argparse.Namespace, default: Sequence[NuisanceName] = ()
) -> tuple[NuisanceName, ...]:
    """The nuisance parameters of the command line, each once; `default` where it names none."""
    given = options.nuisances
    if _NONE in given and {*given} != {_NONE}:
        raise SettingError("--nuisance none cannot be combined with others; give one or the other")
    chosen = tuple(name for name in get_args(NuisanceName) if name in given)
    return chosen if given else tuple(default)


def observation_of(options: argparse.Namespace, default: Sequence[str]) -> tuple[str, ...]:
    """The words of --observe, checked; `default` where there is none."""
    return as_words(options.observe or default)


def parsed_number(text: str, option: str) -> float:
    """The finite number that a text gives, a part of `option`."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise SettingError(f"{text!r} in {option!r} is not a number; write it as 1500 or 1.5e3")
    return value


def _repair(option: str) -> tuple[RepairKind, float | None]:
    name, equals, amount = option.partition("=")
    for kind in REPAIR_KINDS:
        if kind == name:
            return kind, parsed_number(amount, option) if equals else None
    raise SettingError(f"--repair is {option!r}{suggestion(name, REPAIR_KINDS, otherwise='give one of')}")
