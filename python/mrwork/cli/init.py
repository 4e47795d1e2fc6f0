"""`mrwork init`: a sample to begin with: records of a rig, a study, one of a car or of wind; nothing is replaced."""

from __future__ import annotations

import argparse
import math
import os
import random
import shlex
from collections.abc import Iterator, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Literal, get_args

from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.numbers import named_path
from mrwork.cli.options import end_parser
from mrwork.cli.output import print_result
from mrwork.errors import OutputError
from mrwork.records.rig_table import TABLE_NAME
from mrwork.store.output_file import explain_failure, write_file
from mrwork.store.run_folder import refuse_path_in_run

Sample = Literal["rig", "study", "car", "wind"]

_STUDY, _FLOORS = "study.toml", 6
# The rig was simulated: normalised_bouc_wen with its nominal parameters, but k_w = 300 + 500 i - 80 i^2 and
# c = 1500 + 1500 i (i in A, numbers of our own), driven by sines from rest at mid-stroke, sampled at 5 ms. The sensors
# add white noise with standard deviations of 5 um and 4 N.
_SAMPLES = files("mrwork.cli") / "samples"


def add_options(parser: CommandParser) -> None:
    """Declare the sample and the place where it is written."""
    parser.description = (
        "Write a sample to begin with. rig: a folder with synthetic tests of a damper and their table, tests.csv, for "
        "fit, calibration and test. study: a study of a building of three storeys, with a comment on every key. "
        "car: a folder with a study of a quarter car on a random road and a bump. wind: a folder with a study of a "
        "tower and a history of wind forces on its floors. Nothing that is there is replaced."
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
    write = {"rig": _write_rig, "study": _write_study, "car": _write_car, "wind": _write_wind}[options.sample]
    what, written, commands = write(options.place)
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


def _write_car(folder: Path) -> _Written:
    return _write_loads("car", "a quarter car on two roads", folder, {"bump.csv": _bump()})


def _write_wind(folder: Path) -> _Written:
    winds = {f"{name}.csv": _wind(seed) for seed, name in enumerate(("wind-1", "wind-2", "training"))}
    return _write_loads("wind", "a tower under wind", folder, winds)


def _write_loads(sample: str, what: str, folder: Path, tables: Mapping[str, Iterator[str]]) -> _Written:
    """Write the study of a sample and the tables of its loads."""
    contents = [*_write_folder(sample, folder), *tables]
    for name, lines in tables.items():
        write_file(folder / name, "\n".join([*lines, ""]).encode())
    study = shlex.quote(str(folder / f"{sample}.toml"))
    commands = [f"mrwork respond {study}", f"mrwork tune {study} --quick"]
    return f"{folder}, {what}", sorted(folder / name for name in contents), commands


def _bump() -> Iterator[str]:
    """A road of 30 m with a bump of 50 mm over 3 m, half a period of a cosine to either side."""
    yield "distance_m,height_mm"
    for place in range(601):
        height = 25.0 * (1.0 - math.cos(2.0 * math.pi * (place - 100) / 60)) if 100 < place < 160 else 0.0
        yield f"{0.05 * place:.2f},{height:.4g}"


def _wind(seed: int) -> Iterator[str]:
    """A minute of forces that rise in 10 s: a mean and gusts, which six floors share, and less than half their own.

    Sines at 0.02 to 1 Hz of amplitudes that fall with f^(-5/6), as the spectra of gusts do, have random phases.
    """
    yield ",".join(["time_s", *(f"floor {floor} (kN)" for floor in range(1, _FLOORS)), "roof (kN)"])
    drawn = random.Random(seed)
    frequencies = [0.02 * number for number in range(1, 51)]
    amplitudes = [frequency ** (-5.0 / 6.0) for frequency in frequencies]
    size = 0.2 / math.sqrt(sum(each**2 for each in amplitudes) / 2.0)
    phases = [[drawn.uniform(0.0, 2.0 * math.pi) for _ in frequencies] for _ in range(1 + _FLOORS)]
    for row in range(301):
        time = 0.2 * row
        common, *own = [
            sum(
                size * each * math.sin(2.0 * math.pi * frequency * time + phase)
                for each, frequency, phase in zip(amplitudes, frequencies, of_one, strict=True)
            )
            for of_one in phases
        ]
        faded = min(time / 10.0, 1.0)
        forces = [
            60.0 * ((floor + 1) / _FLOORS) ** 0.4 * faded * (1.0 + 0.9 * common + 0.4 * gust)
            for floor, gust in enumerate(own)
        ]
        yield ",".join([f"{time:.1f}", *(f"{force:.4g}" for force in forces)])


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
