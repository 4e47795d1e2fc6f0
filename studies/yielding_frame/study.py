"""A frame that yields in OpenSees and in the package: histories, knees, and the time of an incremental analysis.

python studies/yielding_frame/study.py [--quick] [--timing] [--out DIRECTORY] [--json]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from argparse import Namespace
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from mrwork.report import Table
from studies.former.command import Command, Findings, Say
from studies.former.table import Cell, table_of
from studies.yielding_frame import comparison, frame, timing
from studies.yielding_frame.frame import Case
from studies.yielding_frame.opensees import openseespy

ABSENT = (
    "openseespy is not installed, or lacks a library (libblas and others lie in its folder `openseespylinux/lib`, for "
    "LD_LIBRARY_PATH); install the extra `opensees`"
)


def cases(*, quick: bool) -> dict[str, list[Case]]:
    """The cases that are compared, by what a row of the table says."""
    motions = frame.motions()[: 1 if quick else None]
    found: dict[str, list[Case]] = {}
    for level in frame.LEVELS[1:2] if quick else frame.LEVELS:
        for p_delta in (False, True):
            found[f"{level:g} g{', P-delta' * p_delta}"] = [
                Case(motion=frame.at_level(motion, level), p_delta=p_delta) for motion in motions
            ]
    half = [Case(motion=frame.at_level(motion, 0.5)) for motion in motions]
    found["0.5 g, elastic"] = [replace(each, elastic=True) for each in half]
    if not quick:
        for sharpness in (1.0, 3.0, 50.0):
            found[f"0.5 g, sharpness {sharpness:g}"] = [replace(each, sharpness=sharpness) for each in half]
    found["0.5 g, P-delta, damper"] = [replace(each, damper=True, p_delta=True) for each in half]
    return found


def worst(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The largest of each number over the motions, of the orders the median."""
    return {
        name: [float(np.median(each)) for each in zip(*(row[name] for row in rows), strict=True)]
        if name == "orders"
        else np.max([row[name] for row in rows], axis=0).tolist()
        for name in rows[0]
    }


def bilinear(ops: Any, say: Say, *, quick: bool) -> dict[str, Any]:
    """Deviations of rounded knees from bilinear storeys, with and without stiffness after yielding."""
    motions = frame.motions()[: 1 if quick else None]
    found: dict[str, Any] = {}
    for material, ratio in (("Steel01", frame.RATIO), ("ElasticPP", 0.0)):
        say(material)
        rows = [
            comparison.knees(ops, Case(motion=frame.at_level(motion, level), ratio=ratio))
            for motion in motions
            for level in (frame.LEVELS[1:2] if quick else frame.LEVELS)
        ]
        found[material] = {
            "own": max(row["own"] for row in rows),
            "ductility": [row["ductility"] for row in rows],
            "knees": {
                knee: {
                    "mean": float(np.mean([row["largest"][knee] for row in rows])),
                    "largest": float(np.max([np.abs(row["largest"][knee]) for row in rows])),
                    "storeys": float(np.max([row["storeys"][knee] for row in rows])),
                }
                for knee in rows[0]["largest"]
            },
        }
    return found


def timed(say: Say, picture: Path) -> dict[str, Any]:
    """Timings beside each other, and of a study with three laws."""
    rows = timing.timings(say)
    studies = []
    for number in range(timing.ROUNDS):
        found, memory = timing.alone(partial(timing.study_alone, timing.RECORDS, timing.LEVELS, picture))
        studies.append(found | {"memory": memory})
        say(f"study {number + 1}: {found['seconds']:.0f} s")
    medians = {
        name: float(np.median([each[name] for each in studies]))
        for name in ("seconds", "processor", "reading", "memory")
    }
    whole = studies[0] | medians
    return {"rows": rows, "study": whole}


def percent(value: float) -> str:
    """A share in percent, to two digits."""
    return f"{100.0 * value:.2g}"


def tables(found: dict[str, Any]) -> Iterator[Table | str]:
    """The tables of the README."""
    columns: dict[str, Cell] = {"ductility": "{ductility:.1f}"}
    columns |= {
        f"{1e3 * step:g} ms %": partial(lambda place, row: percent(row["errors"][place]), place)
        for place, step in enumerate(comparison.STEPS)
    }
    columns["orders"] = lambda row: ", ".join(f"{each:.2f}" for each in row["orders"])
    columns["limit %"] = lambda row: percent(row["limit"])
    for name in ("drift", "shear", "acceleration", "peaks", "half_step"):
        heading = {"half_step": "our half step"}.get(name, f"ours, {name}")
        columns[f"{heading} %"] = partial(lambda name, row: percent(row[name]), name)
    yield table_of("Errors over the largest value", "case", found["compared"], columns)
    yield table_of(
        "Peak drifts of rounded knees beside bilinear storeys",
        "sharpness",
        (
            (f"{knee}, {material}", row)
            for material, each in found["bilinear"].items()
            for knee, row in each["knees"].items()
        ),
        {
            "largest drift, mean %": lambda row: f"{100.0 * row['mean']:+.2f}",
            "of the worst motion %": lambda row: f"{100.0 * row['largest']:.2f}",
            "of the worst storey %": lambda row: f"{100.0 * row['storeys']:.2f}",
        },
    )
    for material, each in found["bilinear"].items():
        drifts = sorted(each["ductility"])
        yield (
            f"{material}: ductilities {drifts[0]:.1f} to {drifts[-1]:.1f}; peaks of 0.25 and 0.125 ms differ by up to "
            f"{percent(each['own'])} %."
        )
    if "timing" in found:
        seconds: dict[str, Cell] = {
            "runs": "{runs}",
            "s": "{seconds:.0f}",
            "of processors": lambda row: ", ".join(f"{each:.1f}" for each in row["rounds"]),
            "ms a second of motion": "{rate:.2f}",
            "ratio": "{ratio:.1f}",
            "MB": "{memory:.0f}",
            "error, median %": lambda row: percent(row["median_error"]),
            "largest %": lambda row: percent(row["largest_error"]),
            "not converged": "{failed}",
        }
        yield table_of(
            f"{timing.RECORDS} records x {len(timing.LEVELS)} levels with a damper",
            "program, step",
            ((row["name"], row) for row in found["timing"]["rows"]),
            seconds,
        )
        whole = found["timing"]["study"]
        medians = ", ".join(
            f"{label} {value / frame.GRAVITY:.3f} g" for label, value in whole["medians"].items()
        )
        yield (
            f"A study of {whole['runs']} runs on all threads: {whole['seconds']:.0f} s, {whole['processor']:.0f} s of "
            f"processors, of which {whole['reading']:.0f} s reading; {whole['memory']:.0f} MB. Medians at 2 % of "
            f"drift: {medians}."
        )


def find(options: Namespace, say: Say) -> Findings | int:
    ops = openseespy()
    if ops is None:
        print(ABSENT, file=sys.stderr)
        return 2
    found: dict[str, Any] = {"compared": {}}
    for name, rows in cases(quick=options.quick).items():
        say(name)
        found["compared"][name] = worst([comparison.compared(ops, case) for case in rows])
    found["bilinear"] = bilinear(ops, say, quick=options.quick)
    if options.timing:
        found["timing"] = timed(say, options.out / "ida.svg")
    return Findings(numbers=found, text=tables(found))


if __name__ == "__main__":
    command = Command(__file__, __doc__, quick="one motion at 0.5 g", out=True)
    command.parser.add_argument(
        "--timing", action="store_true", help="the analyses of 300 runs, too: half an hour"
    )
    sys.exit(command.run(find))
