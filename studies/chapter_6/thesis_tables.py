"""Tables of the sheets, of every floor in the form of tables 6.1 and 6.2, and of dampers that push one way."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from mrwork.report import Table
from studies.chapter_6.tables import title_of
from studies.chapter_6.thesis_findings import (
    CONSTANT,
    INVERSE,
    LYAPUNOV,
    MEANS,
    OFF,
    PAIR,
    PEAKS,
    PROPORTIONAL,
    QUANTITIES,
    SHOWN,
    Quantity,
)
from studies.former.frame import FRAME, record_title
from studies.former.table import Cell, table_of

_NUMBERS = dict(zip(SHOWN, ("Table 6.1 in form", "Table 6.2 in form"), strict=True))


def thesis_tables(found: dict[str, Any], levels: Sequence[str]) -> dict[str, list[Table]]:
    """By section of the page, every table; those of every floor at these levels only."""
    return {
        "sheets": list(_sheets(found)),
        "worse": [*_worse(found), *_worse_floors(found)],
        "floors": list(_floors_at(found, levels)),
        "bands": list(_bands(found)),
        "arrangements": list(_arrangements(found)),
    }


def _sheets(found: dict[str, Any]) -> Iterator[Table]:
    """Numbers of the sheets at each level."""
    for level, table in found["sheets"].items():
        yield table_of(
            f"Sheets at {level}",
            "record and row",
            (
                (f"{record_title(record)}, {title_of(label)}", by_record[record])
                for record in next(iter(table.values()))
                for label, by_record in table.items()
            ),
            {
                "largest V [J]": "{peak_function:.1f}",
                "over i = 0": "{peak_function_ratio:.3f}",
                "mean V over i = 0": "{mean_function_ratio:.3f}",
                "mean current [A]": "{mean_current:.2f}",
                "peak force [N]": "{peak_force:.0f}",
            },
        )


Floor = tuple[str, int]
"""A record, and the number of a floor."""


def _floors(table: dict[str, Any]) -> dict[str, Floor]:
    """Every floor under every record, by its name in tables."""
    return {
        f"{record_title(record)}, {name}": (record, number)
        for record in table[OFF]
        for number, name in enumerate(FRAME.floor_names)
    }


def _numbers(table: dict[str, Any], label: str, quantity: Quantity, *parts: str) -> Callable[[Floor], str]:
    """Cell with a number of a floor, or with the ends of its band."""

    def cell(floor: Floor) -> str:
        record, number = floor
        return " to ".join(f"{table[label][record][quantity.name][part][number]:.3f}" for part in parts)

    return cell


def _floors_at(found: dict[str, Any], levels: Sequence[str]) -> Iterator[Table]:
    """Values without control, then values and ratios with bands of each law, at these levels."""
    shown = {LYAPUNOV: "6.1", PROPORTIONAL: "6.2", INVERSE: "inverse", CONSTANT: "constant"}
    first = "record and floor"
    for level in levels:
        table = found["floors"][level]
        floors = _floors(table)
        yield table_of(
            f"Without control (i = 0), {level}",
            first,
            floors,
            {
                f"{quantity.title} [{quantity.unit}]": _numbers(table, OFF, quantity, "values")
                for quantity in QUANTITIES
            },
            note="The drift of a floor is that of the storey below it.",
        )
        for law in SHOWN:
            for part, quantities in (("peaks", PEAKS), ("rms", MEANS)):
                columns = [
                    column
                    for quantity in quantities
                    for column in (
                        (f"{quantity.motion} [{quantity.unit}]", _numbers(table, law, quantity, "values")),
                        ("over i = 0", _numbers(table, law, quantity, "ratios")),
                        ("5 to 95 %", _numbers(table, law, quantity, "low", "high")),
                    )
                ]
                yield table_of(f"{_NUMBERS[law]}: {title_of(law)}, {level}, {part}", first, floors, columns)
        for part, quantities in (("Peaks", PEAKS), ("Rms", MEANS)):
            columns = [
                (
                    f"{quantity.motion}, {text}" if label == LYAPUNOV else text,
                    _numbers(table, label, quantity, "ratios"),
                )
                for quantity in quantities
                for label, text in shown.items()
            ]
            yield table_of(f"{part} over i = 0 side by side, {level}", first, floors, columns)


def _worse(found: dict[str, Any]) -> Iterator[Table]:
    """Where control is worse than i = 0 and than the best constant current, a table for each level."""
    for level, table in found["worse"].items():
        yield table_of(
            f"Where control makes a floor worse, {level}: floors of the {_count(table)} of all records",
            "row and quantity",
            (
                (f"{title_of(law)}: {quantity.title}", {"law": law, **quantities[quantity.name]})
                for law, quantities in table.items()
                for quantity in QUANTITIES
            ),
            {
                "worse than i = 0": "{than_off}",
                "with its whole band": "{surely}",
                "than the best constant": lambda row: (
                    "" if row["law"] == CONSTANT else str(row["than_constant"])
                ),
                "largest over i = 0": "{worst:.3f}",
                "at": lambda row: f"{record_title(row['record'])}, {row['floor']}",
            },
        )


def _worse_floors(found: dict[str, Any]) -> Iterator[Table]:
    for level, table in found["floors"].items():
        yield table_of(
            f"The floors that control makes worse than i = 0, {level}",
            "row, quantity, record and floor",
            (
                (
                    f"{title_of(law)}: {quantity.title}, {name}",
                    [
                        _numbers(table, law, quantity, "ratios")(floor),
                        _numbers(table, law, quantity, "low", "high")(floor),
                        _numbers(table, CONSTANT, quantity, "ratios")(floor),
                    ],
                )
                for law in found["worse"][level]
                for quantity in QUANTITIES
                for name, floor in _floors(table).items()
                if table[law][floor[0]][quantity.name]["ratios"][floor[1]] > 1.0
            ),
            {
                heading: lambda cells, place=place: cells[place]
                for place, heading in enumerate(("over i = 0", "5 to 95 %", "best constant over i = 0"))
            },
        )


def _bands(found: dict[str, Any]) -> Iterator[Table]:
    """Parameters of the identified damper, and the widths of the bands that follow from them."""
    yield table_of(
        "The identified damper: its posterior beside the truth",
        "parameter",
        found["identified"]["parameters"],
        {
            "truth": "{truth:.4g}",
            "median": "{median:.4g}",
            "half of the 95 % interval": "{half_width:.2%}",
            "holds the truth": lambda parameter: "yes" if parameter["holds"] else "no",
        },
    )
    for level, table in found["worse"].items():
        columns: list[tuple[str, Cell]] = []
        for law, quantities in table.items():
            columns += [
                (title_of(law), lambda name, of=quantities: f"{of[name]['widest']:.3f}"),
                (f"in, of {_count(table)}", lambda name, of=quantities: str(of[name]["within"])),
            ]
        yield table_of(
            f"Widest band of a ratio, {level}, and how many ratios of the published damper lie in theirs",
            "quantity",
            ((quantity.title, quantity.name) for quantity in QUANTITIES),
            columns,
        )


def _arrangements(found: dict[str, Any]) -> Iterator[Table]:
    """Offsets and peaks of one-way dampers beside the pair: means over the records, and the range of the peaks."""

    def mean(key: str, digits: int) -> Cell:
        # A sum with 0 has no negative zero.
        return lambda row: (
            f"{round(float(np.mean([run[key] for run in row['runs']])), digits) + 0.0:.{digits}f}"
        )

    def ratios(key: str) -> Cell:
        def cell(row: dict[str, Any]) -> str:
            if row["runs"] is row["pair"]:
                return ""
            over = [run[key] / beside[key] for run, beside in zip(row["runs"], row["pair"], strict=True)]
            return f"{min(over):.3f} to {max(over):.3f}"

        return cell

    for level, table in found["arrangements"].items():
        rows = []
        for label, arrangements in table.items():
            runs = {name: list(by_record.values()) for name, by_record in arrangements.items()}
            rows += [
                (f"{title_of(label)}: {name}", {"runs": each, "pair": runs[PAIR]})
                for name, each in runs.items()
            ]
        yield table_of(
            f"One way against the pair, {level}",
            "row and dampers",
            rows,
            {
                "offset of floor 1 before [mm]": mean("before", 4),
                "after it [mm]": mean("after", 4),
                "current at rest before [A]": mean("current_before", 3),
                "after it [A]": mean("current_after", 3),
                "displacement 1 over the pair's": ratios("peak_displacement"),
                "largest drift": ratios("peak_drift"),
                "acceleration 1": ratios("peak_acceleration_1"),
                "largest acceleration": ratios("peak_acceleration"),
            },
            note="Offset: mean of the displacement in the last second of 20 s of rest before and after the record.",
        )


def _count(table: dict[str, Any]) -> int:
    return int(next(iter(next(iter(table.values())).values()))["of"])
