"""The section on profile likelihoods: intervals of single parameters, which may be open."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

from mrwork.base import numbers
from mrwork.base.numbers import shortest
from mrwork.base.table import Table, TableColumn, page_table
from mrwork.base.values import Floats
from mrwork.report import style
from mrwork.report.canvas import SMALL_WIDTH, grid_of_axes, plain_ticks, small_axes
from mrwork.report.figures import Comparison
from mrwork.report.fit.parameters import shown_unit, with_unit
from mrwork.report.section import Absent, Group, Panel, Section, SectionKind, panel
from mrwork.runs.load import StoredRun
from mrwork.uncertainty.identifiability.profile import Profile, Profiles

_COLUMNS, _HEIGHT = 4, 2.2
# Top of every panel, relative to the threshold.
_TOP = 1.8
_LINE_POINTS = 200
# From this ratio of its ends on an axis is logarithmic, as it then has at least two powers of ten.
_DECADES = 30.0
# Tick labels of at least this number of characters are long; half of one takes this share of the width.
_LONG, _LABEL_SHARE = 4, 0.08
# An open side is drawn to 1.5 times the distance at which the ratio reaches 0.9 of its final value.
_LEVEL, _FURTHER = 0.9, 1.5


def _section(run: StoredRun, _: Sequence[Comparison]) -> Section | None:
    """Intervals and a figure for each profiled parameter."""
    profiles = run.profiles
    if profiles is None:
        return None
    open_ended = [each.name for each in profiles.profiles if each.lower is None or each.upper is None]
    count = len(profiles.profiles)
    ends_in_words = f"open for {', '.join(open_ended)}" if open_ended else "closed for every parameter"
    return Section(
        anchor="profiles",
        title="Profile likelihood",
        summary=f"Profile likelihood: {100 * profiles.level:g} % intervals of {count} parameters, {ends_in_words}.",
        groups=(
            Group(
                prose=_prose(profiles),
                table=_table(profiles),
                panels=tuple(_panel(profile, profiles.threshold) for profile in profiles.profiles),
                layout="small",
            ),
        ),
    )


def _prose(profiles: Profiles) -> tuple[str, ...]:
    text = (
        "Each figure holds one parameter at values around its estimate and fits all others again. The line is the "
        f"likelihood ratio; the values below the dashed threshold form the {100 * profiles.level:g} % interval "
        "(shaded). Where the line does not reach the threshold, the data do not bound the parameter on that side."
    )
    remark = f"{profiles.remark[0].upper()}{profiles.remark[1:]}." if profiles.remark else ""
    cut = "Profiling was interrupted: ends may be missing." if profiles.status == "interrupted" else ""
    return tuple(filter(None, (text, remark, cut)))


def _table(profiles: Profiles) -> Table:
    # The one verdict on a parameter is in the section on identifiability.
    return page_table(
        "Intervals by profile likelihood",
        (
            TableColumn(heading="parameter", cell=lambda each: each.name),
            TableColumn(heading="estimate", cell=lambda each: numbers.significant(each.estimate, 5)),
            TableColumn(heading="from", cell=lambda each: _end(each.lower)),
            TableColumn(heading="to", cell=lambda each: _end(each.upper)),
            TableColumn(heading="unit", cell=lambda each: shown_unit(each.unit), words=True),
            TableColumn(heading="remark", cell=lambda each: each.reason, words=True),
        ),
        profiles.profiles,
    )


def _end(value: float | None) -> str:
    return "open" if value is None else numbers.significant(value, 4)


@style.drawn_in_style()
def _panel(profile: Profile, threshold: float) -> Panel:
    figure, axes = small_axes()
    add_profile(axes, profile, threshold)
    _add_title(axes, profile)
    if axes.get_xscale() == "linear":
        axes.xaxis.set_major_locator(MaxNLocator(nbins=2, steps=[1, 2, 4, 5, 10]))
        plain_ticks(axes, 5)
    interval = f"interval {_end(profile.lower)} to {_end(profile.upper)}"
    return panel(
        f"profile-{profile.name.replace('.', '-')}",
        "",
        figure,
        f"Likelihood ratio over {profile.name}, {interval}",
    )


@style.drawn_in_style()
def profiles_figure(profiles: Profiles) -> Figure:
    """Likelihood ratio against each parameter: threshold dashed, interval shaded, an arrow where it is open."""
    figure, panels = grid_of_axes(len(profiles.profiles), _COLUMNS, (SMALL_WIDTH, _HEIGHT))
    for number, (axes, profile) in enumerate(zip(panels, profiles.profiles, strict=True)):
        add_profile(axes, profile, profiles.threshold)
        _add_title(axes, profile)
        if number % _COLUMNS:
            axes.tick_params(labelleft=False)
        else:
            axes.set_ylabel("Likelihood ratio")
    return figure


def add_profile(axes: Axes, profile: Profile, threshold: float) -> None:
    """Profile of one parameter: a line through its points, the threshold, the interval or its open ends."""
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
    axes.axhline(threshold, color=style.RESIDUAL, linewidth=1.0, linestyle=style.DASHED)
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
    axes.set_ylim(0.0, _TOP * threshold)
    axes.yaxis.set_major_locator(MaxNLocator(nbins=4, integer=True))
    for closed, way in zip(inner, (-1, 1), strict=True):
        if not closed:
            _mark_open(axes, way)


def _add_title(axes: Axes, profile: Profile) -> None:
    axes.set_title(with_unit(style.symbol_text(profile.name), profile.unit), loc="left", pad=6)


def _tick(value: float) -> str:
    """A number as a tick label."""
    text = f"{value:.4g}"
    if "e" not in text:
        return shortest(value)
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


PROFILES = SectionKind(
    make=_section,
    absent=Absent(
        title="Profile likelihood",
        command="mrwork profile RUN",
        description="computes an interval of each parameter by profile likelihood, open where the data set no bound.",
    ),
)
