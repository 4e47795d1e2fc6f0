"""`mrwork check`: facts of test records, or of the building of a study, and what checks remark."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

from mrwork.base.numbers import counted
from mrwork.base.summary import Summary
from mrwork.base.table import Table
from mrwork.cli.command_parser import OUTPUT, CommandParser, examples, given_options
from mrwork.cli.number_texts import named_path
from mrwork.cli.options import end_parser
from mrwork.cli.output import print_result, reading_line, show_results
from mrwork.cli.terminal import note
from mrwork.cli.tests import add_files, reading_of
from mrwork.errors import MrworkError, SettingError, escape_text
from mrwork.records import DamperTest, guess_tests, write_test_table
from mrwork.records.columns import parse_column_option
from mrwork.records.damper_test import RECORD_COLUMNS
from mrwork.records.reading import is_synthetic
from mrwork.records.remarks import gathered_remarks, remarks_of_set
from mrwork.records.rig_table import EVERY_USE, TABLE_NAME, files_not_read, records_in
from mrwork.store.input_file import is_folder


def add_options(parser: CommandParser) -> None:
    """Declare the files, and the table of first guesses that `--table` writes."""
    parser.describe(
        "Checks of records remark wrong signs, offsets, delays, smoothing, clipping, drift and others. Of a study "
        "file masses, stiffnesses, periods, participation and effective modal masses of its building are printed."
    )
    parser.epilog = examples(
        "mrwork check rig",
        "mrwork check rig/10mm1Hz0A.csv --table guess.csv --json",
        "mrwork check study.toml --pushover",
    )
    add_files(parser)
    parser.group(OUTPUT).add_argument(
        "--table",
        nargs="?",
        type=named_path,
        const=Path(),
        metavar="TABLE",
        help="write a table of the tests with a first guess of columns, units and commands, and with what is in doubt; "
        "default tests.csv beside the first record",
    )
    pushover = (
        "of a study file, push its building sideways in its first mode and print base shear and drifts over the "
        "displacement of the roof"
    )
    parser.option("building", "--pushover", pushover, bool)
    end_parser(parser, run, quiet="")


def run(options: argparse.Namespace) -> int:
    """Check every file; a file that cannot be read is reported, and the others are still checked."""
    if any(Path(file).suffix.lower() == ".toml" for file in options.files):
        return _check_building(options)
    if options.pushover:
        raise SettingError("--pushover is of the building of a study; give a STUDY.toml, or leave it out")
    if options.table is not None:
        return _write_table(options)
    reading = reading_of(options, EVERY_USE)
    rows: list[dict[str, Any]] = []
    tests: list[DamperTest] = []
    for done, path in enumerate(reading.files):
        try:
            with reading_line(options) as on_read:
                on_read(done, len(reading.files))
                tests.append(reading.test_of(path))
            rows.append(tests[-1].document())
        except MrworkError as error:
            rows.append({"file": path, "error": str(error)})
            note(str(error))
    together, gathered = remarks_of_set(tests), gathered_remarks(tests)
    document = {
        "files": rows,
        "set": [asdict(remark) for remark in together],
        "shared": [asdict(remark) for remark in gathered.shared],
    }
    pairs = zip(tests, gathered.own, strict=True)
    notes = [f"{test.label}: {remark.in_words}" for test, remarks in pairs for remark in remarks]
    notes += [remark.in_words for remark in together]
    notes += [remark.in_words for remark in gathered.shared]
    if tests or options.json:
        facts = Summary(
            title=counted(len(tests), "test"),
            tables=[Table.of(RECORD_COLUMNS, tests)],
            notes=notes or ["nothing to note"],
        )
        show_results(options, facts, document=document)
    return 0 if len(tests) == len(rows) else 2


def _check_building(options: argparse.Namespace) -> int:
    """Print the facts of the building of a study, or what a push shows."""
    others = [option for name, option in given_options(options).items() if name not in ("pushover", "json")]
    if others or len(options.files) > 1:
        what = f"{others[0]} is of test records" if others else "a study is checked alone"
        raise SettingError(f"{what}; give the STUDY.toml with nothing else")
    from mrwork.buildings.yielding import pushover
    from mrwork.study.reading import read_bare_building
    from mrwork.study.results import BuildingFacts

    building = read_bare_building(options.files[0])
    if options.pushover:
        pushed = pushover(building)
        print_result(options, pushed.document(), repr(pushed))
        return 0
    modal = {name: getattr(building, name).tolist() for name in ("effective_masses", "participation")}
    facts = {**asdict(BuildingFacts.of(building)), **modal, "remarks": building.remarks}
    print_result(options, facts, repr(building))
    return 0


def _write_table(options: argparse.Namespace) -> int:
    """Write a table of tests with a first guess of its entries, and print it with what is in doubt."""
    named = [Path(file) for file in options.files if not is_synthetic(file)]
    files = [inside for path in named for inside in (records_in(path) if is_folder(path) else (path,))]
    if not files:
        raise SettingError("--table lists files; name a folder or the records")
    table = files[0].parent / TABLE_NAME if options.table == Path() else options.table
    for sentence in files_not_read(named).values():
        note(sentence)
    of_reading = {
        "--from": options.start is not None, "--until": options.end is not None, "--every": options.every > 1,
        "--repair": bool(options.repair), "--settle": options.settle is not None,
        "--keep-velocity": options.keep_velocity,
    }  # fmt: skip
    if given := [name for name, is_given in of_reading.items() if is_given]:
        raise SettingError(
            f"a table of tests has no place for {given[0]}; give it with the table, where it is read"
        )
    rows = guess_tests(files, columns=dict(parse_column_option(option) for option in options.column))
    write_test_table(table, rows)
    lines = []
    for row in rows:
        entries = ", ".join(f"{key} {entry}" for key, entry in row.columns.items())
        lines.append(f"{escape_text(row.file)}: {entries or 'not used'}")
        lines += [f"  in doubt: {row.doubt}"] if row.doubt else []
    undecided = any(row.is_open for row in rows)
    lines += [
        f"Written: {table}, {len(rows)} tests, {sum(bool(row.doubt) for row in rows)} in doubt.",
        f"Check its entries{', fill in each ?' if undecided else ''}, and set the use of held-out tests to calibration "
        f"or test; then give {table} in place of the files.",
    ]
    document = {"table": str(table), "tests": [asdict(row) for row in rows]}
    print_result(options, document, "\n".join(lines))
    return 0
