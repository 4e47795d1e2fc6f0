"""Options that several verbs share, and how they become tests."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from math import isfinite
from pathlib import Path

from mrwork.errors import SettingError
from mrwork.identification.settings import Reading
from mrwork.records import DamperTest, parse_column_option
from mrwork.records.repairs import REPAIR_KINDS, RepairKind


def add_files(parser: argparse.ArgumentParser, *, required: bool = True) -> None:
    """FILE..., and which part of each is used."""
    parser.add_argument(
        "files",
        nargs="+" if required else "*",
        metavar="FILE",
        help="test record: .csv, .tsv, .parquet, .mat, or synthetic:NAME",
    )
    parser.add_argument(
        "--column",
        action="append",
        default=[],
        metavar="QUANTITY=NAME:UNIT",
        help="where a column's name does not say it, as in force=F:kN",
    )
    parser.add_argument(
        "--from", dest="start", type=float, metavar="S", help="use the record from this time [s]"
    )
    parser.add_argument(
        "--until", dest="end", type=float, metavar="S", help="use the record up to this time [s]"
    )
    parser.add_argument("--every", type=int, default=1, metavar="N", help="use every N-th sample")
    parser.add_argument(
        "--repair",
        action="append",
        default=[],
        metavar="KIND[=AMOUNT]",
        help=f"put right, of {', '.join(REPAIR_KINDS)}; an amount [s, N, kg] goes before what the record tells, "
        "as in delay=0.002; repeat for more",
    )
    parser.add_argument(
        "--settle",
        type=float,
        metavar="S",
        help="seconds at the start that are simulated but not compared; "
        "default: until the damper has travelled half its peak-to-peak stroke",
    )


def add_json(parser: argparse.ArgumentParser) -> None:
    """--json."""
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout and nothing else")


def reading_of(options: argparse.Namespace) -> Reading:
    """The tests that the command line names, and how it wants them read."""
    return Reading(
        files=tuple(options.files),
        folder=str(Path.cwd()),
        columns=dict(parse_column_option(option) for option in options.column),
        start=options.start,
        end=options.end,
        every=options.every,
        repairs=dict(_repair(option) for option in options.repair),
        settle=options.settle,
    )


def read_tests(options: argparse.Namespace) -> tuple[DamperTest, ...]:
    """The tests that the command line names, cut, then repaired, as it says."""
    return reading_of(options).tests()


def parse_bounds(ranges: Sequence[str], fixed: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Bounds by parameter, from NAME=LOWER:UPPER and NAME=VALUE."""
    bounds: dict[str, tuple[float, float]] = {}
    for text in ranges:
        name, _, pair = text.partition("=")
        lower, colon, upper = pair.partition(":")
        if not (name and colon):
            raise SettingError(f"--bound is {text!r}; give NAME=LOWER:UPPER, as in rho=100:5000")
        bounds[name] = (_number(lower, text), _number(upper, text))
    for text in fixed:
        name, equals, value = text.partition("=")
        if not (name and equals):
            raise SettingError(f"--fix is {text!r}; give NAME=VALUE, as in n=2")
        bounds[name] = (_number(value, text), _number(value, text))
    return bounds


def _number(text: str, option: str) -> float:
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
            return kind, _number(amount, option) if equals else None
    raise SettingError(f"--repair is {option!r}; give one of {', '.join(REPAIR_KINDS)}")
