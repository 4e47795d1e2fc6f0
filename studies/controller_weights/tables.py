"""Findings as tables, for a terminal and for a page."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mrwork.report import ResultTable
from studies.controller_weights.loop import CURRENTS


def tables(found: dict[str, Any]) -> Iterator[ResultTable]:
    """The tables of the README."""
    yield ResultTable(
        title="Program and Riccati equations",
        header=(
            "frame",
            "least ratio",
            "t^2 of the program, error",
            "violation",
            "first solve [s]",
            "other budget [s]",
            "of all modes [s]",
        ),
        rows=tuple(
            (
                name,
                f"{row['ratio']:.5f}",
                _small(row["program_error"]),
                _small(row["violation"]),
                f"{row['first_s']:.2f}",
                f"{row['repeated_s']:.2f}",
                f"{row['whole_program_s']:.0f}" if "whole_program_s" in row else "",
            )
            for name, row in found["sizes"].items()
        ),
    )
    yield ResultTable(
        title="Extensions, five storeys",
        header=(
            "design",
            "least ratio",
            "law's gain: ratio",
            "force over budget",
            "program, error",
            "violation",
            "solve [s]",
        ),
        rows=tuple(
            (
                name,
                f"{row['ratio']:.4f}",
                f"{row['law_ratio']:.4f}",
                f"{row['law_force']:.3f}",
                _small(row["program_error"]),
                _small(row["violation"]),
                f"{row['first_s']:.2f}",
            )
            for name, row in found["extensions"].items()
        ),
    )
    yield ResultTable(
        title="Gains as optimal ones",
        header=("gain", "distance to the nearest optimal one"),
        rows=tuple((name, _small(row["distance"])) for name, row in found["inverses"].items()),
    )
    for level, shapes in found.get("true_loop", {}).items():
        yield ResultTable(
            title=f"R scanned in the true loop, {level} g, {CURRENTS[float(level)]:g} A at most",
            header=(
                "weights",
                "R as designed",
                "best R",
                "four records",
                "sixteen others",
                "spread",
                "peak drift",
                "peak acc.",
                "rms drift",
                "rms acc.",
            ),
            rows=tuple(
                (
                    name,
                    _score(row.get("as_designed")),
                    f"{row['best']:.3g}",
                    _score(row["training"]),
                    _score(row.get("test")),
                    _score(row.get("test_spread")),
                    *(_score(value) for value in row.get("test_parts", dict.fromkeys("1234")).values()),
                )
                for name, row in shapes.items()
            ),
        )


def _small(value: float | None) -> str:
    return "" if value is None else f"{value:.0e}"


def _score(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"
