"""Findings as tables, for a terminal and for a page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from mrwork.report import Table
from studies.former.scores import TITLES
from studies.former.table import Cell, table_of
from studies.robust_control.findings import CLAIRVOYANT
from studies.rollout.loop import CLEARLY, FOUR, SIXTEEN, TRAINING, UNSEEN

_LARGER = "mean of the larger ratio"
_NOTE = (
    "Larger ratio: the larger one of peak drift and peak acceleration to those of the constant command that is best on "
    "the same motions."
)

_COST = {
    "decisions a second, loops in lanes": "{decisions_per_second:,.0f}",
    "time of a decision, loops in lanes [us]": "{microseconds:.0f}",
    "time of a decision, one loop alone [ms]": "{milliseconds_alone:.1f}",
    "time from one decision to the next [ms]": "{hold_ms:.0f}",
    "operations of a decision, estimated": "{operations:,.0f}",
    "lane-steps a second with the law": "{lane_steps_per_second:,.0f}",
    "lane-steps a second at i = 0": "{lane_steps_per_second_without:,.0f}",
    "a candidate under the sixteen motions [s]": "{candidate_s:.0f}",
}


def tables(found: Mapping[str, Any]) -> Iterator[Table]:
    """The tables of the README."""
    for level, figures in found["levels"].items():
        yield table_of(f"Laws at {level}", "law", figures["laws"], _law_columns(figures), note=_NOTE)
        yield table_of(
            f"Wrong models, sensors and delay at {level}, sixteen", "loop", figures["loops"], _columns()
        )
        yield table_of(
            f"One change at {level}, true state, strong seconds of the sixteen",
            "change",
            figures["changes"],
            _columns(),
        )
        if CLAIRVOYANT in figures:
            yield table_of(
                f"How much is left at {level}",
                "motion",
                figures[CLAIRVOYANT],
                {name: f"{{{name}:.3f}}" for name in ("best constant", "rollout", CLAIRVOYANT)},
                note="Scores. The clairvoyant knows the motion; a local optimum of several starts, not certified.",
            )
    yield table_of(
        "Cost of the law on this machine, one thread",
        "quantity",
        ((name, form.format_map(found["cost"])) for name, form in _COST.items()),
        {"value": str},
    )


def _columns() -> dict[str, Cell]:
    return {
        "score": "{score:.3f}",
        _LARGER: "{larger:.3f}",
        f"both by {CLEARLY:.0%}": lambda row: f"{row['clearly']} of {row['motions']}",
        "both": lambda row: f"{row['both']} of {row['motions']}",
    }


def _law_columns(figures: Mapping[str, Any]) -> dict[str, Cell]:
    groups = figures["constant"]

    def of(group: str, text: Cell) -> Cell:
        return lambda row: text.format_map(row[group]) if isinstance(text, str) else text(row[group])

    columns = {
        group: of(group, "{score:.3f}") for group in (TRAINING, FOUR, UNSEEN, SIXTEEN) if group in groups
    }
    for name, title in TITLES.items():
        columns[title] = of(SIXTEEN, lambda row, name=name: f"{row['ratios'][name]:.3f}")
    columns |= {title: of(SIXTEEN, cell) for title, cell in list(_columns().items())[1:]}
    for group in (FOUR, UNSEEN):
        if group in groups:
            columns |= {
                f"{group}: larger ratio": of(group, "{larger:.3f}"),
                f"{group}: both by {CLEARLY:.0%}": of(group, "{clearly} of {motions}"),
            }
    return columns
