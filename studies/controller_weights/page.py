"""The page of the study: tables, and scores over the size of R."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from mrwork.report import numbers, style
from studies.controller_weights.tables import tables
from studies.former.page import level_panels, write_level_page

_TONES = (style.INK, style.MODEL, style.RESIDUAL, style.PARAMETER_BAND, style.DATA, style.BAND_EDGE)
_DASHES = ("-", "--")


def write_page(found: dict[str, Any], path: Path) -> None:
    """Write the tables, the words on wishes out of reach, and a figure for each level."""
    write_level_page(
        path,
        title="Weights by convex design",
        subject="Limits on rms responses and a budget of force become LQR weights; one number more is scanned in the "
        "true loop",
        panels=level_panels(
            "scan",
            "Score over the size of R",
            "Score of each shape of weights over the size of R, with the best constant current,",
            {f"{level} g": shapes for level, shapes in found.get("true_loop", {}).items()},
            scan_figure,
        ),
        tables=tables(found),
        notes={f"A wish out of reach: {name}": wish["words"] for name, wish in found["unreachable"].items()},
    )


def scan_figure(shapes: dict[str, Any]) -> Figure:
    """A line for each shape over R; equal drift weights over R times 1e12, for no design tells their R."""
    with style.drawn_in_style():
        figure = Figure(figsize=(7.0, 4.0), layout="constrained")
        axes = figure.add_subplot()
        scanned = {name: row for name, row in shapes.items() if "scan" in row}
        for number, (name, row) in enumerate(scanned.items()):
            tone, dash = _TONES[number % len(_TONES)], _DASHES[number // len(_TONES)]
            equal = row["as_designed"] is None
            sizes = [float(each) * (1e12 if equal else 1.0) for each in row["scan"]]
            label = f"{name}, R x 1e12" if equal else name
            axes.plot(
                sizes,
                list(row["scan"].values()),
                marker="o",
                linestyle=dash,
                color=tone,
                markersize=3,
                label=label,
            )
        constant = shapes["best constant current"]["training"]
        axes.axhline(constant, color=style.RULE, linewidth=1.0)
        axes.text(
            0.01,
            constant,
            "best constant current",
            transform=axes.get_yaxis_transform(),
            va="bottom",
            fontsize=7,
        )
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(lambda value, _: numbers.shortest(value))
        axes.set_xlabel("R over R as designed")
        axes.set_ylabel("score, four records")
        axes.legend(fontsize=7)
    return figure
