"""Tables of the sheets, of every floor in the form of tables 6.1 and 6.2, and of dampers that push one way."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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
from studies.common.frame import FRAME, record_title
from studies.common.table import table_of

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
        yield Table(
            title=f"Sheets at {level}",
            columns=(
                "record and row",
                "largest V [J]",
                "over i = 0",
                "mean V over i = 0",
                "mean current [A]",
                "peak force [N]",
            ),
            rows=tuple(
                (
                    f"{record_title(record)}, {title_of(label)}",
                    f"{each['peak_function']:.1f}",
                    f"{each['peak_function_ratio']:.3f}",
                    f"{each['mean_function_ratio']:.3f}",
                    f"{each['mean_current']:.2f}",
                    f"{each['peak_force']:.0f}",
                )
                for record in next(iter(table.values()))
                for label, by_record in table.items()
                for each in [by_record[record]]
            ),
        )


def _floors_at(found: dict[str, Any], levels: Sequence[str]) -> Iterator[Table]:
    """Values without control, then values and ratios with bands of each law, at these levels."""
    for level in levels:
        table = found["floors"][level]
        yield _without(table[OFF], level)
        for law in SHOWN:
            for quantities in (PEAKS, MEANS):
                yield _of_law(table[law], law, level, quantities)
        for quantities in (PEAKS, MEANS):
            yield _side_by_side(table, level, quantities)


def _worse(found: dict[str, Any]) -> Iterator[Table]:
    """Where control is worse than i = 0 and than the best constant current, a table for each level."""
    for level, table in found["worse"].items():
        yield Table(
            title=f"Where control makes a floor worse, {level}: floors of the {_count(table)} of all records",
            columns=(
                "row and quantity",
                "worse than i = 0",
                "with its whole band",
                "than the best constant",
                "largest over i = 0",
                "at",
            ),
            rows=tuple(
                (
                    f"{title_of(law)}: {quantity.title}",
                    str(each["than_off"]),
                    str(each["surely"]),
                    "" if law == CONSTANT else str(each["than_constant"]),
                    f"{each['worst']:.3f}",
                    _place(each),
                )
                for law, quantities in table.items()
                for quantity in QUANTITIES
                for each in [quantities[quantity.name]]
            ),
        )


def _worse_floors(found: dict[str, Any]) -> Iterator[Table]:
    for level, table in found["floors"].items():
        yield Table(
            title=f"The floors that control makes worse than i = 0, {level}",
            columns=(
                "row, quantity, record and floor",
                "over i = 0",
                "5 to 95 %",
                "best constant over i = 0",
            ),
            rows=tuple(
                (
                    f"{title_of(law)}: {quantity.title}, {name}",
                    f"{each['ratios'][floor]:.3f}",
                    f"{each['low'][floor]:.3f} to {each['high'][floor]:.3f}",
                    f"{table[CONSTANT][record][quantity.name]['ratios'][floor]:.3f}",
                )
                for law in found["worse"][level]
                for quantity in QUANTITIES
                for name, record, floor in _floors(table[law])
                for each in [table[law][record][quantity.name]]
                if each["ratios"][floor] > 1.0
            ),
        )


def _bands(found: dict[str, Any]) -> Iterator[Table]:
    """Parameters of the identified damper, and the widths of the bands that follow from them."""
    identified = found["identified"]
    yield table_of(
        "The identified damper: its posterior beside the truth",
        "parameter",
        identified["parameters"],
        {
            "truth": "{truth:.4g}",
            "median": "{median:.4g}",
            "half of the 95 % interval": "{half_width:.2%}",
            "holds the truth": lambda each: "yes" if each["holds"] else "no",
        },
    )
    for level, table in found["worse"].items():
        laws = tuple(table)
        yield Table(
            title=f"Widest band of a ratio, {level}, and how many ratios of the published damper lie in theirs",
            columns=(
                "quantity",
                *(text for law in laws for text in (title_of(law), f"in, of {_count(table)}")),
            ),
            rows=tuple(
                (
                    quantity.title,
                    *(
                        text
                        for law in laws
                        for each in [table[law][quantity.name]]
                        for text in (f"{each['widest']:.3f}", str(each["within"]))
                    ),
                )
                for quantity in QUANTITIES
            ),
        )


def _arrangements(found: dict[str, Any]) -> Iterator[Table]:
    """Offsets and peaks of one-way dampers beside the pair: means over the records, and the range of the peaks."""
    for level, table in found["arrangements"].items():
        rows = []
        for label, arrangements in table.items():
            pair = arrangements[PAIR]
            for name, by_record in arrangements.items():
                records = list(by_record)

                def mean(key: str, of: dict[str, Any] = by_record, over: Sequence[str] = records) -> float:
                    return float(np.mean([of[record][key] for record in over]))

                def ratios(
                    key: str,
                    of: dict[str, Any] = by_record,
                    base: dict[str, Any] = pair,
                    over: Sequence[str] = records,
                ) -> str:
                    each = [of[record][key] / base[record][key] for record in over]
                    return f"{min(each):.3f} to {max(each):.3f}"

                rows.append(
                    (
                        f"{title_of(label)}: {name}",
                        _signed(mean("before")),
                        _signed(mean("after")),
                        f"{mean('current_before'):.3f}",
                        f"{mean('current_after'):.3f}",
                        *(
                            "" if name == PAIR else ratios(key)
                            for key in (
                                "peak_displacement",
                                "peak_drift",
                                "peak_acceleration_1",
                                "peak_acceleration",
                            )
                        ),
                    )
                )
        yield Table(
            title=f"One way against the pair, {level}",
            columns=(
                "row and dampers",
                "offset of floor 1 before [mm]",
                "after it [mm]",
                "current at rest before [A]",
                "after it [A]",
                "displacement 1 over the pair's",
                "largest drift",
                "acceleration 1",
                "largest acceleration",
            ),
            rows=tuple(rows),
            note="Offset: mean of the displacement in the last second of 20 s of rest before and after the record.",
        )


def _without(table: dict[str, Any], level: str) -> Table:
    return Table(
        title=f"Without control (i = 0), {level}",
        columns=("record and floor", *(f"{each.title} [{each.unit}]" for each in QUANTITIES)),
        rows=tuple(
            (name, *(f"{table[record][each.name]['values'][floor]:.3f}" for each in QUANTITIES))
            for name, record, floor in _floors(table)
        ),
        note="The drift of a floor is that of the storey below it.",
    )


def _of_law(table: dict[str, Any], law: str, level: str, quantities: Sequence[Quantity]) -> Table:
    part = "peaks" if quantities is PEAKS else "rms"
    return Table(
        title=f"{_NUMBERS[law]}: {title_of(law)}, {level}, {part}",
        columns=(
            "record and floor",
            *(
                text
                for each in quantities
                for text in (f"{each.motion} [{each.unit}]", "over i = 0", "5 to 95 %")
            ),
        ),
        rows=tuple(
            (
                name,
                *(
                    text
                    for quantity in quantities
                    for each in [table[record][quantity.name]]
                    for text in (
                        f"{each['values'][floor]:.3f}",
                        f"{each['ratios'][floor]:.3f}",
                        f"{each['low'][floor]:.3f} to {each['high'][floor]:.3f}",
                    )
                ),
            )
            for name, record, floor in _floors(table)
        ),
    )


def _side_by_side(table: dict[str, Any], level: str, quantities: Sequence[Quantity]) -> Table:
    shown = {LYAPUNOV: "6.1", PROPORTIONAL: "6.2", INVERSE: "inverse", CONSTANT: "constant"}
    part = "Peaks" if quantities is PEAKS else "Rms"
    return Table(
        title=f"{part} over i = 0 side by side, {level}",
        columns=(
            "record and floor",
            *(
                f"{each.motion}, {text}" if label == LYAPUNOV else text
                for each in quantities
                for label, text in shown.items()
            ),
        ),
        rows=tuple(
            (
                name,
                *(
                    f"{table[label][record][each.name]['ratios'][floor]:.3f}"
                    for each in quantities
                    for label in shown
                ),
            )
            for name, record, floor in _floors(table[OFF])
        ),
    )


def _floors(table: dict[str, Any]) -> Iterator[tuple[str, str, int]]:
    for record in table:
        for floor, name in enumerate(FRAME.floor_names):
            yield f"{record_title(record)}, {name}", record, floor


def _signed(offset: float) -> str:
    # A sum with 0 has no negative zero.
    return f"{round(offset, 4) + 0.0:.4f}"


def _place(each: dict[str, Any]) -> str:
    return f"{record_title(each['record'])}, {each['floor']}"


def _count(table: dict[str, Any]) -> int:
    return int(next(iter(next(iter(table.values())).values()))["of"])
