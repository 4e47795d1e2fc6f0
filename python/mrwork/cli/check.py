"""`mrwork check`: the facts of a record and the findings of its checks, without fitting."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from mrwork.cli.command_parser import OUTPUT, CommandParser, examples
from mrwork.cli.numbers import named_path
from mrwork.cli.options import add_files, end_parser, reading_of
from mrwork.cli.output import named, print_json, reading_line
from mrwork.cli.terminal import note, show
from mrwork.dampers.command import CommandValues, command_range
from mrwork.errors import MrworkError, SettingError, escape_text
from mrwork.records import DamperTest, Finding, guess_tests, write_test_table
from mrwork.records.findings import findings_of_set, gathered_findings
from mrwork.records.reading import is_synthetic
from mrwork.records.rig_table import EVERY_USE, TABLE_NAME, files_not_read, records_in
from mrwork.store.input_file import is_folder


def add_options(parser: CommandParser) -> None:
    """Declare the options."""
    parser.description = (
        "Read test records and report findings: wrong signs, offsets, delays, smoothing, clipping, drift "
        "and others."
    )
    parser.epilog = examples("mrwork check rig", "mrwork check rig/10mm1Hz0A.csv --table guess.csv --json")
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
    end_parser(parser, run, quiet="")


def run(options: argparse.Namespace) -> int:
    """Check every file; a file that cannot be read is reported, and the others are still checked."""
    if options.table is not None:
        return _write_table(options)
    status = 0
    reading = reading_of(options, EVERY_USE)
    rows: list[dict[str, Any]] = []
    tests: list[DamperTest] = []
    for done, path in enumerate(reading.files):
        try:
            with reading_line(quiet=options.json) as on_read:
                on_read(done, len(reading.files))
                test = reading.test_of(path)
        except MrworkError as error:
            status = 2
            rows.append({"file": path, "error": str(error)})
            note(str(error))
            continue
        tests.append(test)
        rows.append(_facts(test))
    together = findings_of_set(tests)
    gathered = gathered_findings(tests)
    if options.json:
        document = {"files": rows, "set": [asdict(finding) for finding in together]}
        print_json(document | {"shared": [asdict(each) for each in gathered.shared]})
        return status
    for test, own in zip(tests, gathered.own, strict=True):
        show(_report(test, own))
    lines = [*_lines(together), *(f"  {each.in_words}" for each in gathered.shared)]
    if lines:
        show("\n".join(["all files together:", *lines]))
    return status


def _write_table(options: argparse.Namespace) -> int:
    """Write a table of tests with a first guess of its entries, and print it with what is in doubt."""
    named = [Path(file) for file in options.files if not is_synthetic(file)]
    files = [inside for path in named for inside in (records_in(path) if is_folder(path) else (path,))]
    if not files:
        raise SettingError("--table lists files; name a folder or the records")
    table = files[0].parent / TABLE_NAME if options.table == Path() else options.table
    for sentence in files_not_read(named).values():
        note(sentence)
    rows = guess_tests(files)
    write_test_table(table, rows)
    doubtful = [row for row in rows if row.doubt]
    if options.json:
        print_json({"table": str(table), "tests": [asdict(row) for row in rows]})
        return 0
    for row in rows:
        entries = ", ".join(f"{key} {entry}" for key, entry in row.columns.items())
        show(f"{escape_text(row.file)}: {entries or 'not used'}")
        if row.doubt:
            show(f"  in doubt: {row.doubt}")
    undecided = any("?" in entry for row in rows for entry in row.columns.values())
    show(f"Written: {table}, {len(rows)} tests, {len(doubtful)} in doubt.")
    show(
        f"Check its entries{', fill in each ?' if undecided else ''}, and set the use of held-out tests to calibration "
        f"or test; then give {table} in place of the files."
    )
    return 0


def _facts(test: DamperTest) -> dict[str, Any]:
    return {
        "file": test.path,
        **named(test, "n_time", "dt"),
        "settle_seconds": test.n_settle * test.dt,
        "amplitude_m": 0.5 * float(np.ptp(test.displacement)),
        "peak_displacement_m": float(np.abs(test.displacement).max()),
        "peak_velocity_mps": float(np.abs(test.velocity).max()),
        "peak_force_n": float(np.abs(test.force).max()),
        "current_a": _plain(test.current),
        "voltage_v": _plain(test.voltage),
        "command": _plain(test.command),
        **named(test, "command_unit", "velocity_source", "synthetic"),
        "findings": [asdict(finding) for finding in test.findings],
    }


def _plain(command: CommandValues | None) -> float | dict[str, float] | None:
    """A command for JSON: the range of one that varies."""
    if not isinstance(command, np.ndarray):
        return command
    low, high = command_range(command)
    return {"lowest": low, "highest": high}


def _report(test: DamperTest, own: Sequence[Finding]) -> str:
    facts = _facts(test)
    command = f", {test.command_in_words}" if test.commands else ""
    head = (
        f"{escape_text(test.label)}: {test.n_time} samples at {1.0 / test.dt:g} Hz, "
        f"amplitude {1e3 * facts['amplitude_m']:.3g} mm, {1e3 * facts['peak_velocity_mps']:.3g} mm/s, "
        f"{facts['peak_force_n']:.4g} N{command}"
    )
    return "\n".join([head, *([] if test.findings else ["  nothing to note"]), *_lines(own)])


def _lines(findings: Iterable[Finding]) -> list[str]:
    return [f"  {finding.severity}: {finding.message}" for finding in findings]
