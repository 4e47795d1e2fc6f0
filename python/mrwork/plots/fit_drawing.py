"""Drawing of what a fit has: laws, profiles of the likelihood, a corner of draws, and points of a residual."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

from mrwork.base import numbers
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.parameters import ParamSpec
from mrwork.dampers.spec import law_values
from mrwork.identification.fit import Fit
from mrwork.plots import style
from mrwork.plots.canvas import draw_points, include_zero, plain_ticks
from mrwork.plots.of_tests import scattered_samples
from mrwork.uncertainty.identifiability.profile import Profile
from mrwork.uncertainty.posterior.draws import Draws

_COMMANDS = 101
# Top of every panel, relative to the threshold.
TOP = 1.8
_LINE_POINTS = 200
# From this ratio of its ends on an axis is logarithmic, as it then has at least two powers of ten.
_DECADES = 30.0
# Tick labels of at least this number of characters are long; half of one takes this share of the width.
_LONG, _LABEL_SHARE = 4, 0.08
# An open side is drawn to 1.5 times the distance at which the ratio reaches 0.9 of its final value.
_LEVEL, _FURTHER = 0.9, 1.5
_CELLS = 32
_SMOOTH = 1.2
# Of the figures.
_POINTS = 350
_BINS = 24


def shown_unit(unit: str) -> str:
    """A unit with no-break spaces and raised powers; empty for a dimensionless quantity."""
    if unit in {"", "-", "1"}:
        return ""
    return unit.replace(" ", "\N{NO-BREAK SPACE}").replace("^2", "²").replace("^3", "³")


def with_unit(name: str, unit: str) -> str:
    """A name for an axis, with its unit in parentheses if it has one."""
    shown = shown_unit(unit)
    return f"{name} ({shown})" if shown else name


@array_dataclass()
class Law:
    """A parameter that follows the command: values at commands over the tested range, shape (n_commands,)."""

    parameter: ParamSpec
    commands: Floats
    values: Floats


def laws_of(fit: Fit) -> list[Law]:
    """The law of each parameter that follows the command, from 0 to 1 where the tested commands are not known."""
    if fit.spec.current is None:
        return []
    commands = np.linspace(*(fit.tested.command or (0.0, 1.0)), _COMMANDS)
    found = law_values(fit.spec, np.array(fit.theta), commands)
    return [Law(parameter=parameter, commands=commands, values=values) for parameter, values in found]


def add_law(axes: Axes, law: Law) -> None:
    """Line of a law, with zero in the range of the ordinate unless that would hide how it varies."""
    axes.plot(law.commands, law.values, color=style.MODEL, linewidth=1.4)
    include_zero(axes, law.values)


def add_profile(axes: Axes, profile: Profile, threshold: float) -> None:
    """Profile of one parameter: a line through its points, the threshold, the interval or its open ends."""
    left, right = _span(profile)
    line, ratio = _line(profile, left, right)
    axes.axvspan(
        profile.lower if profile.lower is not None else left,
        profile.upper if profile.upper is not None else right,
        color=style.WINDOW,
        linewidth=0,
        zorder=-1,
    )
    axes.axhline(threshold, color=style.RESIDUAL, linewidth=1.0, linestyle=style.DASHED)
    axes.plot(line, ratio, color=style.MODEL, linewidth=1.4)
    drawn = [
        (value, each)
        for value, each in zip(profile.values, profile.ratio, strict=True)
        if left <= value <= right and each <= TOP * threshold
    ]
    axes.plot(
        *np.array(drawn).T, linestyle="none", marker="o", markersize=3.5, color=style.MODEL, clip_on=False
    )
    axes.axvline(profile.estimate, color=style.DATA, linewidth=0.8)
    if profile.log and right > _DECADES * left > 0.0:
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(numticks=4))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: _tick(value)))
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
    axes.set_ylim(0.0, TOP * threshold)
    axes.yaxis.set_major_locator(MaxNLocator(nbins=4, integer=True))
    for end, way in ((profile.lower, -1), (profile.upper, 1)):
        if end is None:
            _mark_open(axes, way)


def _tick(value: float) -> str:
    """A number as a tick label."""
    text = f"{value:.4g}"
    if "e" not in text:
        return numbers.shortest(value)
    mantissa, _, power = text.partition("e")
    return mantissa + numbers.power_of_ten(int(power))


def _mark_open(axes: Axes, way: int) -> None:
    """An arrow that leaves the panel on the side where the interval is open."""
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
    """The ends of the abscissa."""
    own = np.log if profile.log else np.asarray
    position = np.asarray(own(np.array(profile.values)))
    ratio = np.array(profile.ratio)
    centre = int(profile.values.index(profile.estimate))
    ends = []
    for way, limit in ((-1, profile.lower), (1, profile.upper)):
        side = slice(centre, None, 1) if way > 0 else slice(centre, None, -1)
        distance, height = np.abs(position[side] - position[centre]), ratio[side]
        if limit is not None:
            ends.append(1.25 * abs(float(own(np.array(limit))) - float(position[centre])))
        else:
            levelled = int(np.argmax(height >= _LEVEL * height.max()))
            ends.append(float(min(_FURTHER * distance[levelled] or distance[-1], distance[-1])))
    widest = max(ends)
    if widest == 0.0:
        widest = 0.01 if profile.log else 0.01 * abs(profile.estimate) or 1.0
    low, high = (
        position[centre] + way * max(end, 0.05 * widest) for way, end in zip((-1, 1), ends, strict=True)
    )
    return (float(np.exp(low)), float(np.exp(high))) if profile.log else (float(low), float(high))


def _line(profile: Profile, left: float, right: float) -> tuple[Floats, Floats]:
    """A smooth line through the points, interpolated in the signed root of the ratio."""
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


def add_corner(
    panels: Mapping[tuple[int, int], Axes], draws: Draws, names: Sequence[str], fitted: Mapping[str, float]
) -> None:
    """Densities of these parameters and their pairs, in axes by row and column of the lower triangle."""
    values = [draws.chain(name).reshape(-1) for name in names]
    # Single outliers would compress the rest.
    spans = [tuple(np.quantile(each, [0.002, 0.998]).tolist()) for each in values]
    for (row, column), axes in panels.items():
        if row == column:
            _density(axes, values[row], spans[row], fitted.get(names[row]))
        else:
            at = (fitted.get(names[column]), fitted.get(names[row]))
            _pair(axes, values[column], values[row], spans[column], spans[row], at)


def _density(axes: Axes, values: Floats, span: tuple[float, float], fitted: float | None) -> None:
    count, edges = np.histogram(values, bins=_CELLS, range=span)
    axes.stairs(count, edges, fill=True, color=style.BAND_EDGE)
    if fitted is not None:
        axes.axvline(fitted, color=style.RESIDUAL, linewidth=1.0)
    axes.set_xlim(*span)
    axes.set_ylim(0.0, 1.08 * count.max())
    axes.yaxis.set_major_locator(NullLocator())


def _pair(
    axes: Axes,
    first: Floats,
    second: Floats,
    across: tuple[float, float],
    up: tuple[float, float],
    fitted: tuple[float | None, float | None],
) -> None:
    from scipy.ndimage import gaussian_filter

    count, x, y = np.histogram2d(first, second, bins=_CELLS, range=(across, up))
    smooth = gaussian_filter(count, _SMOOTH)
    ordered = np.sort(smooth.ravel())[::-1]
    held = np.cumsum(ordered) / ordered.sum()
    levels = [float(ordered[np.searchsorted(held, share)]) for share in (0.9, 0.5)]
    if levels[0] < levels[1] < ordered[0]:
        centres = (0.5 * (x[:-1] + x[1:]), 0.5 * (y[:-1] + y[1:]))
        colours = ListedColormap([style.BAND, style.BAND_EDGE])
        axes.contourf(*centres, smooth.T, levels=[*levels, ordered[0] * 1.01], cmap=colours)
    if fitted[0] is not None and fitted[1] is not None:
        axes.plot(fitted[0], fitted[1], marker="+", markersize=8, markeredgewidth=1.2, color=style.RESIDUAL)
    axes.set_xlim(*across)
    axes.set_ylim(*up)


def label_corner(axes: Axes, below: str, left: str) -> None:
    """Names below and left of axes of a corner, where they are not empty, with few ticks."""
    axes.grid(False)
    axes.tick_params(labelbottom=bool(below), labelleft=bool(left))
    axes.set(xlabel=style.symbol_text(below), ylabel=style.symbol_text(left))
    for axis, name in ((axes.xaxis, below), (axes.yaxis, left)):
        if name:
            axis.set_major_locator(MaxNLocator(nbins=2, steps=[1, 2, 4, 5, 10], prune="both"))
    plain_ticks(axes, 4, "x")
    plain_ticks(axes, 4, "y")


def add_residual_points(axes: Axes, abscissa: Floats, residual: Floats) -> None:
    """Points of a residual over an abscissa, both of shape (n,), and its mean in equal bins."""
    drawn = scattered_samples(abscissa, residual, _POINTS)
    draw_points(axes, abscissa[drawn], residual[drawn], size=2.6, label="residual")
    axes.plot(*_means(abscissa, residual), color=style.RESIDUAL, linewidth=1.8, label="mean")


def _means(abscissa: Floats, residual: Floats) -> tuple[Floats, Floats]:
    """Mean residual in equal bins of the abscissa that have samples."""
    edges = np.linspace(abscissa.min(), abscissa.max(), _BINS + 1)
    index = np.clip(np.searchsorted(edges, abscissa, side="right") - 1, 0, _BINS - 1)
    count = np.bincount(index, minlength=_BINS)
    total = np.bincount(index, weights=residual, minlength=_BINS)
    filled = count > 0
    return 0.5 * (edges[:-1] + edges[1:])[filled], total[filled] / count[filled]
