"""Profiles of the likelihood as small multiples: one panel per parameter, the threshold, and ends that stay open."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator
from numpy.typing import NDArray

from mrwork.report import style
from mrwork.report.numbers import shortest
from mrwork.uncertainty.identifiability.profile import Profile, Profiles

_COLUMNS = 4
# Inches: four panels are as wide as two columns of the report.
_WIDTH, _HEIGHT = style.PANEL_WIDTH / 2.0, 2.2
# Of the threshold, the top of every panel.
_TOP = 1.8
_LINE_POINTS = 200
# An axis is logarithmic from this ratio of its ends on: then there are two powers of ten to write at it.
_DECADES = 30.0
# Tick labels from so many characters on are long; half of one takes this share of the width.
_LONG, _LABEL_SHARE = 4, 0.08
# An open side is drawn until the ratio has come to this share of where it levels off, and half as far again.
_LEVEL, _FURTHER = 0.9, 1.5


def profiles_figure(profiles: Profiles) -> Figure:
    """Likelihood ratio against each parameter; dashed the threshold, shaded the interval, an arrow where it is open."""
    count = len(profiles.profiles)
    columns = min(_COLUMNS, count)
    rows = -(-count // columns)
    with style.drawn_in_style():
        figure = Figure(figsize=(columns * _WIDTH, rows * _HEIGHT), layout="constrained")
        for number, profile in enumerate(profiles.profiles):
            axes = figure.add_subplot(rows, columns, number + 1)
            draw_profile(axes, profile, profiles.threshold)
            if number % columns:
                axes.tick_params(labelleft=False)
            else:
                axes.set_ylabel("Likelihood ratio")
    return figure


def draw_profile(axes: Axes, profile: Profile, threshold: float) -> None:
    """One parameter: the line through the points of its profile, the threshold, the interval or its open ends."""
    left, right = _span(profile)
    line, ratio = _line(profile, left, right)
    inner = [profile.lower is not None, profile.upper is not None]
    axes.axvspan(
        profile.lower if profile.lower is not None else left,
        profile.upper if profile.upper is not None else right,
        color=style.WINDOW,
        linewidth=0,
        zorder=-1,
    )
    axes.axhline(threshold, color=style.RESIDUAL, linewidth=1.0, linestyle=(0, (4, 3)))
    axes.plot(line, ratio, color=style.MODEL, linewidth=1.4)
    drawn = [
        (value, each)
        for value, each in zip(profile.values, profile.ratio, strict=True)
        if left <= value <= right and each <= _TOP * threshold
    ]
    axes.plot(
        *np.array(drawn).T, linestyle="none", marker="o", markersize=3.5, color=style.MODEL, clip_on=False
    )
    axes.axvline(profile.estimate, color=style.DATA, linewidth=0.8)
    if profile.log and right > _DECADES * left > 0.0:
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(numticks=4))
        axes.xaxis.set_minor_locator(NullLocator())
    else:
        axes.xaxis.set_major_locator(MaxNLocator(nbins=3, steps=[1, 2, 2.5, 5, 10]))
        # A long number centred on the right edge would be cut there.
        inside = right - _LABEL_SHARE * (right - left)
        axes.xaxis.set_major_formatter(
            FuncFormatter(
                lambda value, _: _tick(value) if value < inside or len(_tick(value)) < _LONG else ""
            )
        )
    axes.set_xlim(left, right)
    axes.set_ylim(0.0, _TOP * threshold)
    axes.yaxis.set_major_locator(MaxNLocator(nbins=4, integer=True))
    for closed, way in zip(inner, (-1, 1), strict=True):
        if not closed:
            _mark_open(axes, way)
    unit = f" ({profile.unit})" if profile.unit not in ("", "1") else ""
    axes.set_title(f"{profile.name}{unit}", loc="left", pad=6)


def _tick(value: float) -> str:
    """A number as a tick label; powers of ten in mathematics, whose digits every font has."""
    text = f"{value:.4g}"
    if "e" not in text:
        return shortest(value)
    mantissa, _, power = text.partition("e")
    return rf"${mantissa} \times 10^{{{int(power)}}}$"


def _mark_open(axes: Axes, way: int) -> None:
    """An arrow that leaves the panel on the side where the interval has no end."""
    edge = 1.0 if way > 0 else 0.0
    axes.annotate(
        "",
        xy=(edge, 0.93),
        xytext=(edge - 0.14 * way, 0.93),
        xycoords="axes fraction",
        arrowprops={"arrowstyle": "->", "color": style.RESIDUAL, "linewidth": 1.3},
    )
    axes.text(
        edge - 0.17 * way,
        0.93,
        "open",
        transform=axes.transAxes,
        ha="right" if way > 0 else "left",
        va="center",
        color=style.RESIDUAL,
        fontsize=style.SMALL_TEXT_SIZE,
    )


def _span(profile: Profile) -> tuple[float, float]:
    """From where to where a profile is drawn."""
    own = np.log if profile.log else np.asarray
    position = np.asarray(own(np.array(profile.values)))
    ratio = np.array(profile.ratio)
    centre = int(profile.values.index(profile.estimate))
    ends = []
    for way, limit in ((-1, profile.lower), (1, profile.upper)):
        side = slice(centre, None, 1) if way > 0 else slice(centre, None, -1)
        distance, height = np.abs(position[side] - position[centre]), ratio[side]
        if limit is not None:
            reach = 1.25 * abs(float(own(np.array(limit))) - position[centre])
        else:
            levelled = int(np.argmax(height >= _LEVEL * height.max()))
            reach = _FURTHER * distance[levelled] or distance[-1]
        ends.append(float(min(reach, distance[-1]) if limit is None else reach))
    widest = max(ends)
    if widest == 0.0:
        widest = 0.01 if profile.log else 0.01 * abs(profile.estimate) or 1.0
    low, high = (
        position[centre] + way * max(end, 0.05 * widest) for way, end in zip((-1, 1), ends, strict=True)
    )
    return (float(np.exp(low)), float(np.exp(high))) if profile.log else (float(low), float(high))


def _line(profile: Profile, left: float, right: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A smooth line through the points: straight pieces of the signed root are parabolas of the ratio."""
    values, ratio = np.array(profile.values), np.array(profile.ratio)
    if values.size < 2:
        return values, ratio
    position = np.log(values) if profile.log else values
    signed = np.sqrt(ratio) * np.sign(values - profile.estimate)
    ends = np.log([left, right]) if profile.log else np.array([left, right])
    grid = np.linspace(max(ends[0], position[0]), min(ends[1], position[-1]), _LINE_POINTS)
    from scipy.interpolate import PchipInterpolator

    drawn = np.asarray(PchipInterpolator(position, signed)(grid)) ** 2
    return np.exp(grid) if profile.log else grid, drawn
