"""What study scripts share: options, measured records, tables beside expected numbers, saved figures, a section."""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from mrwork.dampers import design

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("MRWORK_DATA", ROOT.parent / "shared" / "data"))
"""Measured records, which are not part of the project: damper tests in `dampers`, ground motions in `records`."""

Row = Mapping[str, Any]
"""Numbers or words by the name of their column."""


class Script:
    """A run of a study script: `--quick`, `--json`, `--out`, `--threads`, `--seed` and what it has found so far.

    Parameters
    ----------
    file, about
        `__file__` and `__doc__` of the script. Its expected numbers, study files and data stand in the folder of its
        name beside it.
    quick, seed
        What the quick form leaves out, and the default of `--seed`.
    options
        Further options: keyword arguments of `add_argument` by the name of the option.
    """

    def __init__(
        self, file: str, about: str | None, *, quick: str = "", seed: int = 0, **options: Mapping[str, Any]
    ) -> None:
        self.name = Path(file).stem
        self.folder = Path(file).with_suffix("")
        parser = argparse.ArgumentParser(
            self.name, None, about, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        parser.add_argument("--quick", action="store_true", help=quick or "the same as without")
        parser.add_argument("--json", action="store_true", help="one JSON object on stdout and nothing else")
        parser.add_argument(
            "--out", type=Path, default=ROOT / "out" / "studies" / self.name, help="folder of figures"
        )
        parser.add_argument("--threads", type=int, default=0, help="threads of simulations, 0 for all")
        parser.add_argument("--seed", type=int, default=seed, help=f"default {seed}")
        parser.add_argument("--expect", action="store_true", help="write the numbers found as those expected")
        for name, given in options.items():
            parser.add_argument(f"--{name.replace('_', '-')}", **given)
        self.options = parser.parse_args()
        self.quick: bool = self.options.quick
        self.threads: int = self.options.threads
        self.seed: int = self.options.seed
        self.out: Path = self.options.out
        self.out.mkdir(parents=True, exist_ok=True)
        self.tables: dict[str, dict[str, Row]] = {}
        self._began = time.perf_counter()

    def say(self, what: str) -> None:
        """Tell a person on stderr what is worked out now."""
        print(f"{time.perf_counter() - self._began:6.0f} s  {what}", file=sys.stderr, flush=True)

    def data(self, *parts: str) -> Path:
        """A measured file or folder; the script ends with status 2 where it is absent."""
        path = DATA.joinpath(*parts)
        if not path.exists():
            self.say(f"{path} is absent; point MRWORK_DATA at the measured data")
            sys.exit(2)
        return path

    def kept(self, key: str, compute: Callable[[], Any]) -> Any:
        """A JSON value that is computed once: an interrupted script goes on from what stands in its folder."""
        path = self.out / f"kept{'_quick' * self.quick}_{self.seed}.jsonl"
        lines = path.read_text().splitlines() if path.exists() else []
        known = dict(json.loads(line) for line in lines if line.endswith("]"))
        if key not in known:
            self.say(key)
            known[key] = compute()
            with path.open("a") as file:
                file.write(json.dumps([key, known[key]]) + "\n")
        return known[key]

    def table(
        self, name: str, rows: Mapping[str, Row], *, title: str = "", digits: int | Mapping[str, int] = 4
    ) -> None:
        """Print a table with a row for each name, and keep it for `check`: as `NAME.csv` in the script's folder.

        `digits` are the significant digits that are printed, of all columns or by their names.
        """
        self.tables[name] = dict(rows)
        if self.options.json:
            return
        columns = list(dict.fromkeys(column for row in rows.values() for column in row))
        digits_of = digits if isinstance(digits, Mapping) else dict.fromkeys(columns, digits)
        cells = [["", *columns]]
        cells += [
            [row, *(_text(of.get(c), digits_of.get(c, 4)) for c in columns)] for row, of in rows.items()
        ]
        widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        lines = [
            "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) for line in cells
        ]
        print("\n".join([f"\n{title or name}", *(line.rstrip() for line in lines)]), flush=True)

    def figure(self, figure: Figure, name: str) -> None:
        """Save a figure as `NAME.svg` in the folder of `--out`."""
        figure.savefig(self.out / f"{name}.svg")
        self.say(f"figure {self.out / name}.svg")

    def check(self) -> NoReturn:
        """Compare every table with the expected numbers and end: status 1 where a number is outside its limits."""
        form = "quick" if self.quick else "full"
        if self.options.expect:
            for name, rows in self.tables.items():
                _write_expected(self.folder / f"{name}.csv", rows, form)
        wrong = [
            each for name, rows in self.tables.items() for each in departures(self.folder, name, rows, form)
        ]
        if self.options.json:
            print(json.dumps(_finite(self.tables | {"departures": wrong})))
        else:
            print("\n" + "\n".join(wrong or ["Every number agrees with the expected ones."]))
        sys.exit(1 if wrong else 0)


def draw_section(axes: Axes, damper: design.DamperDesign) -> None:
    """Section through the axis of a damper, to scale in mm: cylinder, fluid, piston with its windings, and rod."""
    rod, core, piston = damper.rod / 2.0, damper.core_radius, damper.piston_radius
    bore, outer = damper.bore / 2.0, damper.outer_diameter / 2.0
    end, half, winding = damper.chamber_length / 2.0, damper.piston_length / 2.0, damper.coil_length
    stage = 2.0 * damper.pole_length + winding
    grooves = [number * stage + damper.pole_length - half for number in range(damper.stages)]
    # Left end, length, inner and outer radius [m]; later boxes cover earlier ones.
    parts = [
        ("steel", "#b9c2c9", [(-end, 2.0 * end, bore, outer)]),
        ("fluid", "#bcd6ea", [(-end, 2.0 * end, rod, bore)]),
        ("", "#b9c2c9", [(-half, 2.0 * half, rod, piston)]),
        ("", "#bcd6ea", [(left, winding, core, piston) for left in grooves]),
        ("winding", "#e3a66a", [(left, winding, core, piston - damper.coil_clearance) for left in grooves]),
        ("rod", "#e3e7ea", [(-end - damper.stroke, 2.0 * (end + damper.stroke), 0.0, rod)]),
    ]
    for name, colour, boxes in parts:
        for number, box in enumerate(boxes):
            left, length, inner, radius = (1e3 * each for each in box)
            for side in (1.0, -1.0):
                label = name if number == 0 and side > 0.0 else ""
                drawn = {"facecolor": colour, "edgecolor": "black", "linewidth": 0.5, "label": label}
                axes.add_patch(Rectangle((left, side * inner), length, side * (radius - inner), **drawn))
    axes.set(aspect="equal", xlabel="Along the axis (mm)", ylabel="Radius (mm)")
    axes.autoscale_view()


def departures(folder: Path, name: str, rows: Mapping[str, Row], form: str) -> list[str]:
    """A sentence for each number of a table outside the limits of its row in `NAME.csv`.

    The columns of the file are `form` (full, quick or both), `row`, `tolerance` (`2 %`, or in the unit of the number;
    empty where words are equal) and those of the table. A cell may be a range `least..most`; an empty one is not
    compared.
    """
    path = folder / f"{name}.csv"
    if not path.exists():
        return []
    with path.open(newline="") as file:
        expected = [line for line in csv.DictReader(file) if line["form"] in (form, "both")]
    return [
        f"{name}, {line['row']}, {column}: {row.get(column)}, expected {line[column]}"
        for line in expected
        for row in [rows.get(line["row"], {})]
        for column in line.keys() - {"form", "row", "tolerance"}
        if line[column] and not _agrees(row.get(column), line[column], line["tolerance"])
    ]


def _agrees(value: Any, expected: str, tolerance: str) -> bool:
    if isinstance(value, str) or value is None:
        return value == expected
    if ".." in expected:
        least, most = expected.split("..")
        return float(least or "-inf") <= value <= float(most or "inf")
    number, unit = tolerance.removesuffix("%"), tolerance.endswith("%")
    allowed = float(number or 0.0) * (abs(float(expected)) / 100.0 if unit else 1.0)
    equal = value == float(expected) or (math.isnan(value) and expected == "nan")
    return equal or abs(value - float(expected)) <= allowed


def _write_expected(path: Path, rows: Mapping[str, Row], form: str) -> None:
    """The rows of this form anew, with the tolerances that they had; rows of the other form as they are."""
    lines = []
    if path.exists():
        with path.open(newline="") as file:
            lines = list(csv.DictReader(file))
    limits = {line["row"]: line["tolerance"] for line in lines if line["form"] == form}
    new = [
        {"form": form, "row": name, "tolerance": limits.get(name, "1 %")}
        | {column: _text(value, 5) for column, value in row.items()}
        for name, row in rows.items()
    ]
    lines = [line for line in lines if line["form"] != form] + new
    path.parent.mkdir(exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(
            file, list(dict.fromkeys(key for line in lines for key in line)), lineterminator="\n"
        )
        writer.writeheader()
        writer.writerows(lines)


def _text(value: Any, digits: int) -> str:
    if value is None:
        return ""
    return value if isinstance(value, str) else f"{value:.{digits}g}"


def _finite(value: Any) -> Any:
    """The same with null for what is not a finite number, as JSON has it."""
    if isinstance(value, Mapping):
        return {name: _finite(inner) for name, inner in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value
