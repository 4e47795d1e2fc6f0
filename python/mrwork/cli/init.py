"""`mrwork init`: a sample to begin with, a folder of a rig's records or a study file; nothing is replaced."""

from __future__ import annotations

import argparse
import os
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from mrwork.base.table import csv_text
from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.numbers import named_path
from mrwork.cli.options import end_parser
from mrwork.cli.output import print_result
from mrwork.dampers.parameters import LawName
from mrwork.dampers.simulation import Loading, simulate_force
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.errors import OutputError
from mrwork.records.rig_table import TABLE_NAME, ListedTest, Use, write_test_table
from mrwork.store.output_file import explain_failure, write_files
from mrwork.store.run_folder import refuse_place_in_run

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


_Written = tuple[str, list[Path], list[str]]
"""What was written, in words and as files, and the commands to go on with."""


def run(options: argparse.Namespace) -> int:
    """Write the sample and print what can be done with it."""
    write = _write_rig if options.sample == "rig" else _write_study
    what, written, commands = write(options.place)
    document = {"sample": options.sample, "files": list(map(str, written)), "next": commands}
    lines = [f"Written: {what}", "", "Next:", *(f"  {line}" for line in commands)]
    print_result(options, document, "\n".join(lines))
    return 0


def _write_rig(folder: Path) -> _Written:
    _refuse_what_is_there(folder, within=True)
    # The same bytes in every call.
    rng = np.random.default_rng(_SEED)
    contents = {test.file: test.text(rng).encode() for test in _TESTS}
    rows = [
        ListedTest(
            file=str(folder / test.file), use=test.use, columns={**_COLUMNS, "command": f"{test.current:g} A"}
        )
        for test in _TESTS
    ]
    write_files(folder, contents, then=lambda: write_test_table(folder / TABLE_NAME, rows))
    rig, run = shlex.quote(str(folder)), shlex.quote(str(Path("out") / (folder.name or "rig")))
    what = f"{folder}, {len(rows)} synthetic tests and their table {folder / TABLE_NAME}"
    commands = [
        f"mrwork check {rig}",
        f"mrwork identify {rig} --model normalised_bouc_wen --law k_w=quadratic --law c=linear --out {run}",
        f"mrwork calibrate {run} {rig}",
        f"mrwork predict {run} {rig} --level 0.9",
    ]
    return what, [folder / TABLE_NAME, *(folder / name for name in contents)], commands


def _write_study(place: Path) -> _Written:
    file = place if place.suffix == ".toml" else place / _STUDY
    _refuse_what_is_there(file)
    write_files(file.parent, {file.name: files("mrwork.cli").joinpath("samples", _STUDY).read_bytes()})
    name = shlex.quote(str(file))
    commands = [f"mrwork respond {name}", f"mrwork tune {name} --quick"]
    return f"{file}, three storeys with one damper", [file], commands


def _refuse_what_is_there(place: Path, *, within: bool = False) -> None:
    """Refuse a place where there is something; with `within` a folder may be there that has nothing within."""
    with explain_failure(f"write {place}", "choose another place"):
        refuse_place_in_run(place)
        is_folder = within and place.is_dir()
        there = sorted(place.iterdir()) if is_folder else [place] if os.path.lexists(place) else []
    if there:
        what = "a new or empty folder" if within else "another file"
        raise OutputError(f"{there[0]} is there already, and mrwork init replaces nothing; give {what}")


# Sampling of a slow rig, and the white noise of its sensors: standard deviations.
_DT = 0.005
_SECONDS = 3.0
_DISPLACEMENT_NOISE_M = 5e-6
_FORCE_NOISE_N = 4.0
_SEED = 2006
# Polynomials in the current [A] for a damper of about 1 kN, numbers of our own; all else as published.
_LAWS = {"k_w": (300.0, 500.0, -80.0), "c": (1500.0, 1500.0)}

# Columns of the files, as the table of tests names them.
_COLUMNS = {"time": "Running Time:s", "displacement": "Axial Displacement:mm", "force": "Axial Force:kN"}


@dataclass(frozen=True, slots=True, kw_only=True)
class _RigTest:
    """A sinusoidal test at a constant current, and what it is for: amplitude [mm], frequency [Hz], current [A]."""

    amplitude: float
    frequency: float
    current: float
    use: Use

    @property
    def file(self) -> str:
        """Name of its file."""
        label = f"{self.amplitude:g}mm{self.frequency:g}Hz{self.current:g}A".replace(".", "x")
        return f"{label}.csv"

    def text(self, rng: np.random.Generator) -> str:
        """The file of the test: the damper is simulated from rest at mid-stroke, and noise is added."""
        spec, theta = _damper()
        time = _DT * np.arange(round(_SECONDS / _DT) + 1)
        omega = 2.0 * np.pi * self.frequency
        displacement = 1e-3 * self.amplitude * np.sin(omega * time)
        velocity = 1e-3 * self.amplitude * omega * np.cos(omega * time)
        loading = Loading(
            dt=_DT, displacement=displacement, velocity=velocity, command=self.current, command_unit="A"
        )
        force = simulate_force(spec, theta, loading)
        displacement = displacement + _DISPLACEMENT_NOISE_M * rng.standard_normal(time.size)
        force = force + _FORCE_NOISE_N * rng.standard_normal(time.size)
        rows = zip(time, 1e3 * displacement, 1e-3 * force, strict=True)
        names, units = zip(*(column.split(":") for column in _COLUMNS.values()), strict=True)
        numbers = ([f"{t:.3f}", f"{x:.4f}", f"{f:.5f}"] for t, x, f in rows)
        return csv_text([names, [f"({unit})" for unit in units], *numbers])


def _damper() -> tuple[DamperSpec, list[float]]:
    """The damper of the rig: a model with its nominal parameters, of which some follow the current."""
    plain = damper("normalised_bouc_wen")
    nominal = dict(zip(plain.names, plain.nominal.tolist(), strict=True))
    laws: dict[str, LawName] = {"k_w": "quadratic", "c": "linear"}
    theta = [number for name in plain.names for number in _LAWS.get(name, (nominal[name],))]
    return plain.with_current_laws(laws, unit="A"), theta


def _at(amplitude: float, frequency: float, currents: Sequence[float], use: Use) -> tuple[_RigTest, ...]:
    return tuple(
        _RigTest(amplitude=amplitude, frequency=frequency, current=current, use=use) for current in currents
    )


# Two motions at three currents for the fit, others for calibration and test.
_TESTS = (
    *_at(10.0, 1.0, (0.0, 0.6, 1.2), "fit"),
    *_at(6.0, 2.0, (0.0, 0.6, 1.2), "fit"),
    *_at(8.0, 1.5, (0.3, 0.6, 0.9, 1.2), "calibration"),
    *_at(9.0, 1.2, (0.3, 0.9), "test"),
)
