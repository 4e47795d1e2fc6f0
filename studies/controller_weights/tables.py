"""Findings as tables, for a terminal and for a page."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mrwork.report import Table
from studies.controller_weights.loop import CURRENTS
from studies.former.scores import TITLES
from studies.former.table import Cell, table_of


def tables(found: dict[str, Any]) -> Iterator[Table]:
    """The tables of the README."""
    yield table_of(
        "Program and Riccati equations",
        "frame",
        found["sizes"],
        {
            "least ratio": "{ratio:.5f}",
            "t^2 of the program, error": lambda row: _small(row["program_error"]),
            "violation": lambda row: _small(row["violation"]),
            "first solve [s]": "{first_s:.2f}",
            "other budget [s]": "{repeated_s:.2f}",
            "of all modes [s]": lambda row: (
                f"{row['whole_program_s']:.0f}" if "whole_program_s" in row else ""
            ),
        },
    )
    yield table_of(
        "Extensions, five storeys",
        "design",
        found["extensions"],
        {
            "least ratio": "{ratio:.4f}",
            "law's gain: ratio": "{law_ratio:.4f}",
            "force over budget": "{law_force:.3f}",
            "program, error": lambda row: _small(row["program_error"]),
            "violation": lambda row: _small(row["violation"]),
            "solve [s]": "{first_s:.2f}",
        },
    )
    yield table_of(
        "Gains as optimal ones",
        "gain",
        found["inverses"],
        {
            "distance to the nearest optimal one": lambda row: _small(row["distance"]),
        },
    )
    for level, shapes in found.get("true_loop", {}).items():
        columns: dict[str, Cell] = {
            "R as designed": lambda row: _score(row.get("as_designed")),
            "best R": "{best:.3g}",
            "four records": "{training:.3f}",
            "sixteen others": lambda row: _score(row.get("test")),
            "spread": lambda row: _score(row.get("test_spread")),
        }
        for name, title in TITLES.items():
            columns[title] = lambda row, name=name: _score(row.get("test_parts", {}).get(name))
        title = f"R scanned in the true loop, {level} g, {CURRENTS[float(level)]:g} A at most"
        yield table_of(title, "weights", shapes, columns)


def _small(value: float | None) -> str:
    return "" if value is None else f"{value:.0e}"


def _score(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"
