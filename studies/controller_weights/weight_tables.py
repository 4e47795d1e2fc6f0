"""Findings as tables, for a terminal and for a page."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from html import escape
from typing import Any

from weight_loop import CURRENTS


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Text in rows; the first column names the row."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def markdown(self) -> str:
        rule = ("---", *["---:"] * (len(self.header) - 1))
        lines = ("| " + " | ".join(cells) + " |" for cells in (self.header, rule, *self.rows))
        return "\n".join([f"**{self.title}**", "", *lines, ""])

    def html(self) -> str:
        head = "".join(
            f'<th scope="col"{" class=number" if place else ""}>{escape(text)}</th>'
            for place, text in enumerate(self.header)
        )
        body = "".join(
            f'<tr><th scope="row">{escape(row[0])}</th>'
            + "".join(f'<td class="number">{escape(text)}</td>' for text in row[1:])
            + "</tr>"
            for row in self.rows
        )
        return (
            f'<h3>{escape(self.title)}</h3><div class="scroll" tabindex="0" role="region" '
            f'aria-label="{escape(self.title)}"><table><thead><tr>{head}</tr></thead>'
            f"<tbody>{body}</tbody></table></div>"
        )


def tables(found: dict[str, Any]) -> Iterator[Table]:
    """The tables of the README."""
    yield Table(
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
    yield Table(
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
    yield Table(
        title="Gains as optimal ones",
        header=("gain", "distance to the nearest optimal one"),
        rows=tuple((name, _small(row["distance"])) for name, row in found["inverses"].items()),
    )
    for level, shapes in found.get("true_loop", {}).items():
        yield Table(
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
