"""Figures over all rows of a study: storey profiles and energies; and the line style of each row."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mrwork.closed_loop.responses import axis_of
from mrwork.report import style
from mrwork.report.canvas import column_axes, room_for
from mrwork.study.results import StudyResults

_LEFT_OF_NAMES = 0.95
_KEY_LINE = 0.178
_KEY_FONT = style.SMALL_TEXT_SIZE
_BAR = 0.30
_TONES = {"damping": style.BAND_EDGE, "devices": style.MODEL, "left": style.RULE}
# They differ in lightness, too, as those of `style` do.
_HUES = (style.MODEL, style.RESIDUAL, "#3c8d5a", "#8a5aa8", "#c79a1e", "#3aa0b8", "#a83c5c", "#6b6b2a")
_PATTERNS = ("-", (0, (5, 1.6)), (0, (1.2, 1.4)))
_DOTTED, _DASHED = (0, (1.2, 1.6)), (0, (5, 2))


@dataclass(frozen=True, slots=True, kw_only=True)
class Stroke:
    """Colour, pattern and width [pt] of the lines of a row."""

    colour: str
    pattern: str | tuple[int, tuple[float, ...]]
    width: float = 1.4


def strokes(results: StudyResults) -> tuple[Stroke, ...]:
    """The stroke of each row: grey without dampers, dark for i = 0, a hue for each other row."""
    found: list[Stroke] = []
    number = 0
    for row in results.rows:
        if row.kind == "uncontrolled":
            found.append(Stroke(colour=style.DATA, pattern=_DOTTED, width=1.7))
        elif row.kind == "passive_off":
            found.append(Stroke(colour=style.INK, pattern=_DASHED, width=1.3))
        else:
            pattern = _PATTERNS[(number // len(_HUES)) % len(_PATTERNS)]
            found.append(Stroke(colour=_HUES[number % len(_HUES)], pattern=pattern))
            number += 1
    return tuple(found)


@style.drawn_in_style()
def profile_figure(results: StudyResults, motion: int, quantity: str, rows: Collection[int]) -> Figure:
    """A quantity of storeys or floors, peak drift or acceleration, over the height, a line for each of the rows."""
    drift = axis_of(quantity) == "storey"
    names = results.storey_names if drift else results.floor_names
    factor, label = (1e3, "mm") if drift else (1.0, "m/s²")
    shown = [row for row in results.finished(motion) if row in rows]
    key_lines = (len(shown) + 1) // 2
    figure, axes = column_axes(
        left=_LEFT_OF_NAMES,
        top=0.12 + _KEY_LINE * key_lines,
        height=2.1 + _KEY_LINE * key_lines + min(0.19 * len(names), 4.0),
    )
    heights = np.arange(1, len(names) + 1)
    of_row = strokes(results)
    for row in shown:
        stroke = of_row[row]
        axes.plot(
            getattr(results.runs[row, motion], quantity) * factor,
            heights,
            color=stroke.colour,
            linestyle=stroke.pattern,
            linewidth=stroke.width,
            marker="o",
            markersize=3.2,
            label=results.rows[row].label,
        )
    axes.set_xlim(left=0.0)
    axes.set_xlabel(f"Peak {'drift' if drift else 'acceleration'} ({label})")
    _name_heights(axes, names)
    _key(axes)
    return figure


@style.drawn_in_style()
def energy_figure(results: StudyResults, motion: int, rows: Collection[int]) -> Figure:
    """Distribution of the input energy at the end of the motion, a bar for each of the rows."""
    shown = [row for row in results.finished(motion) if row in rows]
    names = [short(results.rows[row].label, 29) for row in reversed(shown)]
    figure, axes = column_axes(left=room_for(names), top=0.42, height=0.95 + _BAR * len(shown))
    largest = 0.0
    for place, row in enumerate(reversed(shown)):
        run = results.runs[row, motion]
        start = 0.0
        parts = (
            ("devices", "Dampers", float(np.sum(run.device_energy))),
            ("damping", "Structure", run.damping_energy),
            ("left", "Still moving", run.kinetic_energy + run.strain_energy),
        )
        for name, label, amount in parts:
            axes.barh(
                place,
                amount,
                left=start,
                height=0.62,
                color=_TONES[name],
                label=label if place == 0 else None,
            )
            start += amount
        largest = max(largest, start)
    axes.set_yticks(range(len(shown)), names)
    axes.set_xlim(0.0, 1.02 * largest or 1.0)
    axes.set_xlabel("Energy (J)")
    axes.grid(visible=False, axis="y")
    axes.grid(visible=True, axis="x")
    axes.xaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10]))
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderpad=0.2)
    return figure


def _name_heights(axes: Axes, names: Sequence[str]) -> None:
    # Of many floors only every second, fifth or tenth is labelled.
    step = next(step for step in (1, 2, 5, 10, 20) if len(names) <= 14 * step or step == 20)
    places = [n for n in range(1, len(names) + 1) if step == 1 or n % step == 0]
    axes.set_yticks(places, [short(names[n - 1], 13) for n in places])
    axes.set_ylim(0.6, len(names) + 0.4)


def _key(axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    axes.legend(
        handles,
        [short(label, 29) for label in labels],
        loc="lower left",
        bbox_to_anchor=(-0.16, 1.01, 1.16, 0.2),
        mode="expand",
        ncols=2,
        borderpad=0.2,
        labelspacing=0.22,
        fontsize=_KEY_FONT,
    )


def short(text: str, most: int) -> str:
    """A label of at most `most` characters."""
    return text if len(text) <= most else f"{text[: most - 1]}…"
