"""`mrwork check`: the facts of a record and the findings of its checks, without fitting."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from mrwork.cli.options import add_files, add_json, reading_of
from mrwork.errors import MrworkError
from mrwork.records import DamperTest, Finding, mislabelled
from mrwork.records.command_signal import Command, command_range
from mrwork.records.findings import gathered_findings


def add_parser(verbs: Any) -> None:
    """Declare the verb."""
    parser = verbs.add_parser(
        "check",
        description="Read test records and report findings: wrong signs, offsets, delays, smoothing, clipping, drift "
        "and others.",
    )
    add_files(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Check every file; a file that cannot be read is reported, and the others are still checked."""
    status = 0
    rows: list[dict[str, Any]] = []
    tests: list[DamperTest] = []
    for path in options.files:
        try:
            (test,) = replace(reading_of(options), files=(path,)).tests()
        except MrworkError as error:
            status = 2
            rows.append({"file": path, "error": str(error)})
            print(f"mrwork: {error}", file=sys.stderr)
            continue
        tests.append(test)
        rows.append(_facts(test))
    together = mislabelled(tests)
    gathered = gathered_findings(tests)
    if options.json:
        document = {"files": rows, "set": [asdict(finding) for finding in together]}
        print(json.dumps(document | {"shared": [asdict(each) for each in gathered.shared]}))
        return status
    for test, own in zip(tests, gathered.own, strict=True):
        print(_report(test, own))
    lines = [*_lines(together), *(f"  {each.in_words}" for each in gathered.shared)]
    if lines:
        print("\n".join(["all files together:", *lines]))
    return status


def _facts(test: DamperTest) -> dict[str, Any]:
    return {
        "file": test.path,
        "n_time": test.n_time,
        "dt": test.dt,
        "settle_seconds": test.n_settle * test.dt,
        "peak_displacement_m": float(np.abs(test.displacement).max()),
        "peak_velocity_mps": float(np.abs(test.velocity).max()),
        "peak_force_n": float(np.abs(test.force).max()),
        "current_a": _plain(test.current),
        "voltage_v": _plain(test.voltage),
        "velocity_source": test.velocity_source,
        "synthetic": test.synthetic,
        "findings": [asdict(finding) for finding in test.findings],
    }


def _plain(command: Command | None) -> float | dict[str, float] | None:
    """A command for JSON: the range of one that varies."""
    if not isinstance(command, np.ndarray):
        return command
    low, high = command_range(command)
    return {"lowest": low, "highest": high}


def _report(test: DamperTest, own: Sequence[Finding]) -> str:
    facts = _facts(test)
    command = f", {test.command_in_words}" if test.commands else ""
    head = (
        f"{test.label}: {test.n_time} samples at {1.0 / test.dt:g} Hz, "
        f"{1e3 * facts['peak_displacement_m']:.3g} mm, {1e3 * facts['peak_velocity_mps']:.3g} mm/s, "
        f"{facts['peak_force_n']:.4g} N{command}"
    )
    return "\n".join([head, *([] if test.findings else ["  nothing to note"]), *_lines(own)])


def _lines(findings: Iterable[Finding]) -> list[str]:
    return [f"  {finding.severity}: {finding.message}" for finding in findings]
