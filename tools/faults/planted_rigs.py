"""Faults of the records of a rig, nine text files as programs of rigs write them, for `tools.faults.planted`."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Final

import numpy as np

from mrwork.base.units import unit_of
from mrwork.errors import MrworkError
from mrwork.records import read_damper_test
from mrwork.records.remarks import remarks_of_set
from tools.faults.planted import Rng, Said

# Names of time, displacement, force and velocity, with the units behind them and the encoding of the file.
_HEADERS: Final = (
    ("t_{}", "displacement_{}", "force_{}", "velocity_{}", "utf-8"),
    ("Time ({})", "Stroke ({})", "Axial Force ({})", "Velocity ({})", "utf-8"),
    ("Zeit [{}]", "Kolbenweg [{}]", "Dämpferkraft [{}]", "Kolbengeschwindigkeit [{}]", "cp1252"),
    ("時間({})", "変位({})", "荷重({})", "速度({})", "cp932"),
    ("时间({})", "活塞位移({})", "阻尼力({})", "速度({})", "gb18030"),
    ("Temps ({})", "Déplacement ({})", "Force ({})", "Vitesse ({})", "utf-16"),
)
_UNITS: Final = (("s", "ms"), ("mm", "m"), ("N", "kN"), ("m/s", "mm/s"))
_MARKS: Final = ("EVENT 3", "Start;;", "1205;Switched from 1 to 2;", "% step 2", "Marker;A;12:00")

Files = dict[str, list[str]]


def rig(rng: Rng, *wrong: tuple[int, str, str]) -> tuple[Files, str]:
    """Lines, by file, of three motions at three commands of a damper of 0.5 to 5 kN, and their encoding.

    `wrong` are a column, the unit of its numbers, and the unit that its name says.
    """
    *names, encoding = _HEADERS[rng.integers(len(_HEADERS))]
    names = names[: rng.integers(3, 5)]
    said = [str(rng.choice(each)) for each in _UNITS[: len(names)]]
    written = list(said)
    for place, *units in wrong:
        written[place], said[place] = units
    head = ";".join(name.format(unit) for name, unit in zip(names, said, strict=True))
    size, friction = 10.0 ** rng.uniform(2.7, 3.7), rng.uniform(0.02, 0.1)
    amplitude, files = rng.uniform(6e-3, 4e-2), Files()
    for frequency, current in product((0.5, 1.0, 2.0), (0, 500, 1000)):
        time = np.arange(0.0, 4.0 / frequency, 1.0 / (200.0 * frequency))
        phase = 2.0 * np.pi * frequency * time
        x, v = amplitude * np.sin(phase), 2.0 * np.pi * frequency * amplitude * np.cos(phase)
        level = size * (friction + 1e-3 * current)
        force = level * np.tanh((v + 0.05 * x * frequency) / (0.05 * amplitude)) + 0.2 * size * v
        force += 2e-3 * np.ptp(force) * rng.standard_normal(time.size)
        x += 2e-4 * amplitude * rng.standard_normal(time.size)
        factors = [unit.factor for unit in map(unit_of, written) if unit]
        rows = np.stack([time, x, force, v][: len(names)], axis=1) / factors
        lines = [head, *(";".join(f"{value:.9g}" for value in row) for row in rows)]
        files[f"{1e3 * amplitude:.0f}mm_{frequency:g}Hz_{current}mA"] = lines
    return files, encoding


def _said(files: Files, encoding: str, folder: Path, word: str = "") -> str:
    """The first refusal or warning of a rig that has a word."""
    tests, said = [], []
    for stem, lines in files.items():
        path = folder / f"{stem}.csv"
        path.write_bytes("\r\n".join([*lines, ""]).encode(encoding))
        try:
            tests.append(read_damper_test(path))
        except MrworkError as error:
            said.append(str(error))
    remarks = [*(each for test in tests for each in test.remarks), *remarks_of_set(tests)]
    said += [each.message for each in remarks if each.severity == "warning"]
    return next((each for each in said if word in each), "")


def honest(rng: Rng, folder: Path) -> str:
    """A rig as it is."""
    return _said(*rig(rng), folder)


def _unit(place: int, written: str, said: str, word: str) -> tuple[Said]:
    return (lambda rng, folder: _said(*rig(rng, (place, written, said)), folder, word),)


def _file(edit: Callable[[list[str], int, Rng], list[str]], word: str) -> tuple[Said]:
    """A fault in one of the files, with lines of fields and a current [mA]."""

    def fault(rng: Rng, folder: Path) -> str:
        files, encoding = rig(rng)
        stem = str(rng.choice(list(files)))
        lines = edit(files[stem], int(stem.rpartition("_")[2][:-2]), rng)
        return _said(files | {stem: lines}, encoding, folder, word)

    return (fault,)


def _swapped(rng: Rng, folder: Path) -> str:
    files, encoding = rig(rng)
    stem = str(rng.choice([each for each in files if each.endswith("_0mA")]))
    return _said(
        files | {stem: files[stem.replace("_0mA", "_1000mA")]}, encoding, folder, "check its current"
    )


def _marked(lines: list[str], _: int, rng: Rng) -> list[str]:
    first, second = sorted(rng.integers(3, 600, 2))
    marks = (str(each) for each in rng.choice(_MARKS, 2))
    return [*lines[:first], next(marks), *lines[first:second], next(marks), *lines[second:]]


def _constant(lines: list[str], _: int, rng: Rng) -> list[str]:
    place, (head, *rows) = int(rng.integers(1, 3)), (line.split(";") for line in lines)
    return [
        ";".join(row) for row in (head, *([*row[:place], rows[3][place], *row[place + 1 :]] for row in rows))
    ]


FAULTS: Final = {
    "milliseconds taken for seconds": _unit(0, "ms", "s", "ms"),
    "metres taken for millimetres": _unit(1, "m", "mm", "displacement"),
    "millimetres taken for metres": _unit(1, "mm", "m", "displacement"),
    "kilonewtons taken for newtons": _unit(2, "kN", "N", "kN"),
    "newtons taken for kilonewtons": _unit(2, "N", "kN", "N taken for kN"),
    "marker lines": _file(_marked, "markers=skip"),
    "another command than the name's": _file(
        lambda lines, mA, _: [f"{lines[0]};current_A", *(f"{row};{0.5 + 1e-3 * mA}" for row in lines[1:])],
        "the file name says",
    ),
    "a file under the name of another": (_swapped,),
    "a constant column": _file(_constant, "constant"),
    "a lost column": _file(
        lambda lines, _, rng: (
            lines[: (k := int(rng.integers(20, 700)))] + [x.rpartition(";")[0] for x in lines[k:]]
        ),
        "field",
    ),
    "no column of times": _file(lambda lines, *_: [line.partition(";")[2] for line in lines], "200 Hz"),
}
