"""Drawing of what a study or a tuning has: lines of rows, profiles over the height, energies, fragilities, a front."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike

from mrwork.base.numbers import significant
from mrwork.base.units import STANDARD_GRAVITY
from mrwork.base.values import Floats
from mrwork.closed_loop.evaluation import criterion
from mrwork.plots import style
from mrwork.plots.style import DisplayUnit
from mrwork.study.fragilities import Fragilities, Fragility
from mrwork.study.results import BuildingFacts, StudyResults
from mrwork.tuning.results import Front

_SMALL_BINS = 350
MARKERS = ("o", "s", "^", "D", "v", "P")
_DOTTED, _DASHED = (0, (1.2, 1.6)), (0, (5, 2))
ENERGY_PARTS = {"Dampers": style.MODEL, "Structure": style.BAND_EDGE, "Still moving": style.DATA}
"""Where the input energy is at the end of a motion, with the tones."""


@dataclass(frozen=True, slots=True)
class Stroke:
    """Colour, pattern, width [pt] and marker of the lines of a row."""

    colour: str
    pattern: str | tuple[int, tuple[float, ...]] = "-"
    width: float = 1.4
    marker: str = "o"


def strokes(
    results: StudyResults | Fragilities, coloured: Collection[int] | None = None
) -> tuple[Stroke, ...]:
    """The stroke of each row: dark tones and grey for references, a hue for each of six others, thin grey for more.

    Of the others those in `coloured` have hues, in its order; by default the first.
    """
    references = {
        "uncontrolled": Stroke(colour=style.DATA, pattern=_DOTTED, width=1.7),
        "passive_off": Stroke(colour=style.FAINT_INK, pattern=_DASHED, width=1.3),
        "best_passive": Stroke(colour=style.INK, width=1.6),
    }
    kinds = [
        each.kind for each in (results.rows if isinstance(results, StudyResults) else results.rows.values())
    ]
    rows = range(len(kinds)) if coloured is None else coloured
    others = [row for row in rows if kinds[row] not in references]
    named = (Stroke(hue, marker=marker) for hue, marker in zip(style.HUES, MARKERS, strict=True))
    own = dict(zip(others, named, strict=False))
    return tuple(references.get(kind) or own.get(number, _OTHER) for number, kind in enumerate(kinds))


_OTHER = Stroke(colour=style.DATA, width=0.6, marker="")


def energy_parts(numbers: Mapping[str, Any]) -> tuple[float, float, float]:
    """The energy of each of `ENERGY_PARTS` at the end of a run, of which these are the quantities [J].

    What is not in the devices and does not move is in the structure: its damping, and its storeys that yield.
    """
    devices = np.sum(numbers["device_energy"])
    if "element_energy" in numbers:
        # The elements of `Responses` are the passive devices and the storeys that yield.
        devices += np.sum(numbers["element_energy"]) - np.nansum(numbers["storey_energy"])
    moving = numbers["kinetic_energy"] + numbers["strain_energy"]
    return float(devices), float(numbers["input_energy"] - devices - moving), float(moving)


def add_energy_bars(axes: Axes, names: Sequence[str], parts: ArrayLike) -> None:
    """A bar for each of the names, the first on top, of its `ENERGY_PARTS` [J] one behind the other."""
    rising = np.reshape(parts, (len(names), len(ENERGY_PARTS)))[::-1]
    unit = style.energy_unit(float(np.abs(rising).sum(axis=1).max(initial=0.0)))
    rising = rising * unit.factor
    ends = np.zeros(len(names))
    for amounts, (label, tone) in zip(rising.T, ENERGY_PARTS.items(), strict=True):
        axes.barh(range(len(names)), amounts, left=ends, height=0.62, color=tone, label=label)
        ends = ends + amounts
    axes.set_yticks(range(len(names)), names[::-1])
    axes.set_xlim(0.0, 1.02 * float(ends.max(initial=0.0)) or 1.0)
    axes.set_xlabel(f"Energy ({unit.symbol})")


def add_height_line(axes: Axes, values: Floats, stroke: Stroke, label: str) -> None:
    """Line of a quantity of storeys or floors, shape (n,), over their numbers from 1."""
    axes.plot(
        values,
        np.arange(1, len(values) + 1),
        color=stroke.colour,
        linestyle=stroke.pattern,
        linewidth=stroke.width,
        marker=stroke.marker,
        markersize=3.2,
        label=label,
    )


def name_heights(axes: Axes, names: Sequence[str], *, numbers: bool = False) -> None:
    """Names of storeys or floors at their numbers on the ordinate, or these numbers alone."""
    # Of many floors only every second, fifth or tenth is labelled.
    room = 8 if numbers else 14
    step = next(step for step in (1, 2, 5, 10, 20) if len(names) <= room * step or step == 20)
    places = [n for n in range(1, len(names) + 1) if step == 1 or n % step == 0]
    axes.set_yticks(places, [str(n) if numbers else short(names[n - 1], 13) for n in places])
    axes.set_ylim(0.6, len(names) + 0.4)


def add_building(axes: Axes, facts: BuildingFacts, dampers: Sequence[int] = ()) -> None:
    """Floors with their masses, storeys with their stiffnesses, dampers as braces in their storeys, from 0."""
    axes.set_axis_off()
    n_storeys = len(facts.stiffnesses)
    every = max(1, -(-n_storeys // 8))
    write = partial(axes.text, fontsize=style.SMALL_TEXT_SIZE, va="center")
    for number, (mass, stiffness) in enumerate(zip(facts.masses, facts.stiffnesses, strict=True)):
        for side in (0.0, 1.0):
            axes.plot([side, side], [number, number + 1], color=style.INK, linewidth=1.3)
        axes.add_patch(Rectangle((0.0, number + 0.94), 1.0, 0.12, facecolor=style.FAINT_INK, linewidth=0))
        if number % every == every // 2:
            write(1.08, number + 1.0, f"{significant(1e-3 * mass, 3)} t")
            write(-0.08, number + 0.5, f"{significant(1e-6 * stiffness, 3)} kN/mm", ha="right")
    for bottom in dampers:
        axes.plot([0.0, 1.0], [bottom, bottom + 0.94], color=style.MODEL, linewidth=1.6)
        body = Rectangle(
            (0.36, bottom + 0.34), 0.28, 0.26, facecolor=style.PAGE, edgecolor=style.MODEL, zorder=3
        )
        axes.add_patch(body)
    axes.plot([-0.25, 1.25], [0.0, 0.0], color=style.INK, linewidth=1.6)
    axes.set_xlim(-1.1, 1.9)
    axes.set_ylim(-0.15, n_storeys + 0.3)


def short(text: str, most: int) -> str:
    """A label of at most `most` characters."""
    return text if len(text) <= most else f"{text[: most - 1]}…"


def add_energies(axes: Axes, time: Floats, given: Floats, devices: Floats, moving: Floats) -> str:
    """Name of the ordinate; draws the energy that was given, cumulative over time, above its `ENERGY_PARTS` [J]."""
    unit = style.energy_unit(float(np.abs(given).max(initial=0.0)))
    parts = (devices, given - devices - moving, moving)
    every = slice(None, None, max(1, len(time) // _SMALL_BINS))
    time, given, shown = time[every], given * unit.factor, [each[every] * unit.factor for each in parts]
    axes.stackplot(time, *shown, colors=[*ENERGY_PARTS.values()], labels=[*ENERGY_PARTS], linewidth=0.0)
    axes.plot(time, given[every], color=style.INK, linewidth=0.9, label="Input")
    # An actuator may supply energy; the energy that it takes up is then negative.
    axes.set_ylim(0.0, 1.05 * max(float(given.max()), float((shown[0] + shown[1]).max()), 1e-9))
    axes.margins(x=0.0)
    return f"Energy ({unit.symbol})"


def add_front(axes: Axes, front: Front) -> None:
    """Points of a front over its first two objectives, joined on the training motions."""
    first, second = front.objectives[:2]
    for label, colour, marker, points in (
        ("training", style.FAINT_INK, "o-", [each.train for each in front.points]),
        ("test", style.MODEL, "o", [each.test for each in front.points if each.test is not None]),
    ):
        if points:
            drawn = np.array(sorted(((each[first], each[second]) for each in points), key=itemgetter(0))).T
            axes.plot(*drawn, marker, markersize=4, color=colour, label=label)
    axes.set_xlabel(f"{criterion(first).title} over i = 0")
    axes.set_ylabel(f"{criterion(second).title} over i = 0")


# Shares of the records in an incremental dynamic analysis, and how far beyond the limit responses are drawn.
_SHARES, _BEYOND = (0.16, 0.5, 0.84), 3.0
_CURVE_POINTS = 120


def response_unit(found: Fragilities) -> DisplayUnit:
    """The unit in which the criterion of a limit is drawn: per cent of a drift ratio."""
    symbol = "%" if found.in_percent else found.unit.removesuffix("1").replace("2", "²")
    return DisplayUnit(symbol=symbol, factor=100.0 if found.in_percent else 1.0)


def add_ida(axes: Axes, found: Fragilities, one: Fragility, stroke: Stroke) -> None:
    """Intensity [g] over the response, a line for each record, with 16, 50 and 84 % of the records and the limit."""
    unit, levels = response_unit(found), np.concatenate([[0.0], one.levels]) / STANDARD_GRAVITY
    limit = unit.factor * found.limit
    responses = unit.factor * np.pad(one.responses, ((0, 0), (1, 0)))
    axes.axvline(limit, color=style.RESIDUAL, linestyle=style.DASHED, linewidth=1.0, label="limit")
    for number, line in enumerate(responses):
        known = np.isfinite(line)
        label = "a record" if number == 0 else f"_{one.crossings[number].record}"
        axes.plot(line[known], levels[known], color=style.DATA, linewidth=0.6, label=label)
    whole = ~np.isnan(responses).any(axis=0)
    for share, width in zip(_SHARES, (1.1, 1.9, 1.1), strict=True):
        at = np.quantile(responses[:, whole], share, axis=0, method="inverted_cdf")
        known = np.isfinite(at)
        label = "16, 50, 84 % of them" if share == _SHARES[0] else f"_{100.0 * share:.0f} %"
        axes.plot(at[known], levels[whole][known], color=stroke.colour, linewidth=width, label=label)
    every = np.concatenate([each.responses for each in found.rows.values()])
    largest = unit.factor * float(every[np.isfinite(every)].max(initial=0.0))
    axes.set_xlim(0.0, min(max(largest, 1.1 * limit), _BEYOND * limit))
    axes.set_ylim(0.0, 1.02 * float(levels[-1]))


def add_fragility(axes: Axes, one: Fragility, stroke: Stroke) -> None:
    """Probability that the limit is reached over intensity [g]: curve, shares at the levels, band of the median."""
    levels = one.levels / STANDARD_GRAVITY
    over = np.linspace(0.0, 1.02 * float(levels[-1]), _CURVE_POINTS)[1:]
    axes.plot(
        over,
        [one.probability(STANDARD_GRAVITY * float(each)) for each in over],
        color=stroke.colour,
        linestyle=stroke.pattern,
        linewidth=stroke.width,
        label=one.label,
    )
    axes.plot(
        levels, one.crossed, linestyle="none", marker=stroke.marker, markersize=3.6, color=stroke.colour
    )
    if not one.bound:
        ends = np.minimum(np.array(one.band) / STANDARD_GRAVITY, over[-1])
        axes.plot(ends, [0.5, 0.5], color=stroke.colour, linewidth=4.0, alpha=0.35, solid_capstyle="butt")
    axes.set_xlim(0.0, float(over[-1]))
    axes.set_ylim(-0.02, 1.02)
