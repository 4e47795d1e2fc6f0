"""`mrwork init`: a sample to begin with: records of a rig, a study, one of a car or of wind; nothing is replaced."""

from __future__ import annotations

import argparse
import os
import shlex
from collections.abc import Callable
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Literal, get_args

from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.number_texts import named_path
from mrwork.cli.options import end_parser
from mrwork.cli.output import print_result
from mrwork.errors import OutputError
from mrwork.records.rig_table import TABLE_NAME
from mrwork.store.output_file import explain_failure, write_file
from mrwork.store.run_folder import refuse_path_in_run

Sample = Literal["rig", "study", "car", "wind"]

_STUDY = "study.toml"
# The rig was simulated: normalised_bouc_wen with its nominal parameters, but k_w = 300 + 500 i - 80 i^2 and
# c = 1500 + 1500 i (i in A, numbers of our own), driven by sines from rest at mid-stroke, sampled at 5 ms. The sensors
# add white noise with standard deviations of 5 um and 4 N. The bump of the car is half a period of a cosine to either
# side, 50 mm over 3 m. The wind rises in 10 s; gusts are sines at 0.02 to 1 Hz with random phases, of amplitudes that
# fall with f^(-5/6) as the spectra of gusts do: common to six floors, and less than half their own.
_SAMPLES = files("mrwork.cli") / "samples"


def add_options(parser: CommandParser) -> None:
    """Declare the sample and the place where it is written."""
    parser.describe(
        "rig: a folder with synthetic tests of a damper and their table, tests.csv, for fit, calibration and "
        "test. study: a study of a building of three storeys, with a comment on every key. car: a folder with a "
        "study of a quarter car on a random road and a bump. wind: a folder with a study of a tower and a history "
        "of wind forces on its floors. Nothing that is there is replaced."
    )
    parser.epilog = examples("mrwork init rig my_rig", "mrwork init study my_study.toml")
    parser.add_argument("sample", choices=get_args(Sample), metavar="SAMPLE", help="rig, study, car or wind")
    parser.add_argument(
        "place",
        type=named_path,
        metavar="PLACE",
        help=f"of a rig, a car or wind a folder, new or empty; of a study a file .toml, or a folder for {_STUDY}",
    )
    end_parser(parser, run, quiet="")


_Written = tuple[str, list[Path], list[str]]
"""What was written, in words and as files, and the commands to go on with."""


def run(options: argparse.Namespace) -> int:
    """Write the sample and print what can be done with it."""
    write: dict[Sample, Callable[[Path], _Written]] = {
        "rig": _write_rig,
        "study": _write_study,
        "car": partial(_write_loads, "car", "a quarter car on two roads"),
        "wind": partial(_write_loads, "wind", "a tower under wind"),
    }
    what, written, commands = write[options.sample](options.place)
    document = {"sample": options.sample, "files": list(map(str, written)), "next": commands}
    lines = [f"Written: {what}", "", "Next:", *(f"  {line}" for line in commands)]
    print_result(options, document, "\n".join(lines))
    return 0


def _write_rig(folder: Path) -> _Written:
    contents = _write_folder("rig", folder)
    rig, run = shlex.quote(str(folder)), shlex.quote(str(Path("out") / (folder.name or "rig")))
    table = folder / TABLE_NAME
    tests = sorted(folder / name for name in contents if name != TABLE_NAME)
    commands = [
        f"mrwork check {rig}",
        f"mrwork identify {rig} --model normalised_bouc_wen --law k_w=quadratic --law c=linear --out {run}",
        f"mrwork calibrate {run} {rig}",
        f"mrwork predict {run} {rig} --level 0.9",
    ]
    return f"{folder}, {len(tests)} synthetic tests and their table {table}", [table, *tests], commands


def _write_study(path: Path) -> _Written:
    file = path if path.suffix == ".toml" else path / _STUDY
    _refuse_what_is_there(file)
    write_file(file, (_SAMPLES / _STUDY).read_bytes())
    name = shlex.quote(str(file))
    commands = [f"mrwork respond {name}", f"mrwork tune {name} --quick"]
    return f"{file}, three storeys with one damper", [file], commands


def _write_loads(sample: str, what: str, folder: Path) -> _Written:
    """Write the study of a sample and the tables of its loads."""
    contents = _write_folder(sample, folder)
    study = shlex.quote(str(folder / f"{sample}.toml"))
    commands = [f"mrwork respond {study}", f"mrwork tune {study} --quick"]
    return f"{folder}, {what}", sorted(folder / name for name in contents), commands


def _write_folder(sample: str, folder: Path) -> list[str]:
    """Write the files of a sample into a new or empty folder; their names."""
    _refuse_what_is_there(folder, within=True)
    contents = {path.name: path.read_bytes() for path in (_SAMPLES / sample).iterdir()}
    for name, content in contents.items():
        write_file(folder / name, content)
    return [*contents]


def _refuse_what_is_there(path: Path, *, within: bool = False) -> None:
    """Refuse a place where there is something; with `within` a folder may be there that has nothing within."""
    with explain_failure(f"write {path}", "choose another place"):
        refuse_path_in_run(path)
        is_folder = within and path.is_dir()
        there = sorted(path.iterdir()) if is_folder else [path] if os.path.lexists(path) else []
    if there:
        what = "a new or empty folder" if within else "another file"
        raise OutputError(f"{there[0]} is there already, and mrwork init replaces nothing; give {what}")
