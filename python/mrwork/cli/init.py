"""`mrwork init`: a sample to begin with, a folder of a rig's records or a study file; nothing is replaced."""

from __future__ import annotations

import argparse
import os
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Literal, get_args

from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.numbers import named_path
from mrwork.cli.options import end_parser
from mrwork.cli.output import print_result
from mrwork.errors import OutputError
from mrwork.store.output_file import explain_failure, write_files
from mrwork.store.output_folder import refuse_place_in_run

Sample = Literal["rig", "study"]

_STUDY = "study.toml"


def add_options(parser: CommandParser) -> None:
    """Declare the options."""
    parser.description = (
        "Write a sample to begin with. rig: a folder with synthetic tests of a damper and their table, tests.csv, for "
        "fit, calibration and test. study: a study of a building of three storeys, with a comment on every key. "
        "Nothing that is there is replaced."
    )
    parser.epilog = examples("mrwork init rig my_rig", "mrwork init study my_study.toml")
    parser.add_argument("sample", choices=get_args(Sample), metavar="SAMPLE", help="rig or study")
    parser.add_argument(
        "place",
        type=named_path,
        metavar="PLACE",
        help=f"of a rig a folder, new or empty; of a study a file .toml, or a folder for {_STUDY}",
    )
    end_parser(parser, run, quiet="")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Written:
    """What was written, and the commands to go on with."""

    what: str
    files: tuple[Path, ...]
    next: tuple[str, ...]


def run(options: argparse.Namespace) -> int:
    """Write the sample and print what can be done with it."""
    write = _write_rig if options.sample == "rig" else _write_study
    written = write(options.place)
    document = {
        "sample": options.sample,
        "files": [str(path) for path in written.files],
        "next": list(written.next),
    }
    lines = [f"Written: {written.what}", "", "Next:", *(f"  {line}" for line in written.next)]
    print_result(options, document, "\n".join(lines))
    return 0


def _write_rig(folder: Path) -> _Written:
    # Simulation is slow to load.
    from mrwork.cli.sample_rig import COLUMNS, TESTS, rig_files
    from mrwork.records.rig_table import TABLE_NAME, ListedTest, write_test_table

    _refuse_what_is_there(folder, within=True)
    contents = rig_files()
    rows = [
        ListedTest(
            file=str(folder / test.file),
            use=test.use,
            columns={**COLUMNS, "command": f"{test.current:g} A"},
        )
        for test in TESTS
    ]
    write_files(folder, contents, then=lambda: write_test_table(folder / TABLE_NAME, rows))
    rig, run = shlex.quote(str(folder)), shlex.quote(str(Path("out") / (folder.name or "rig")))
    return _Written(
        what=f"{folder}, {len(rows)} synthetic tests and their table {folder / TABLE_NAME}",
        files=(folder / TABLE_NAME, *(folder / name for name in contents)),
        next=(
            f"mrwork check {rig}",
            f"mrwork identify {rig} --model normalised_bouc_wen --law k_w=quadratic --law c=linear --out {run}",
            f"mrwork calibrate {run} {rig}",
            f"mrwork predict {run} {rig} --level 0.9",
        ),
    )


def _write_study(place: Path) -> _Written:
    file = place if place.suffix == ".toml" else place / _STUDY
    _refuse_what_is_there(file)
    write_files(file.parent, {file.name: files("mrwork.cli").joinpath("samples", _STUDY).read_bytes()})
    name = shlex.quote(str(file))
    return _Written(
        what=f"{file}, three storeys with one damper",
        files=(file,),
        next=(f"mrwork respond {name}", f"mrwork tune {name} --quick"),
    )


def _refuse_what_is_there(place: Path, *, within: bool = False) -> None:
    """Refuse a place where there is something; with `within` a folder may be there that has nothing within."""
    with explain_failure(f"write {place}", "choose another place"):
        refuse_place_in_run(place)
        there = next(_there(place, within=within), None)
    if there is not None:
        what = "a new or empty folder" if within else "another file"
        raise OutputError(f"{there} is there already, and mrwork init replaces nothing; give {what}")


def _there(place: Path, *, within: bool) -> Iterator[Path]:
    if within and place.is_dir():
        yield from sorted(place.iterdir())
    elif os.path.lexists(place):
        yield place
