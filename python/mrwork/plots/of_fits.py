"""Figures of laws, profiles, posterior and bands."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator
from numpy.typing import NDArray

from mrwork.base import numbers
from mrwork.base.arguments import Level
from mrwork.base.values import Floats
from mrwork.dampers.spec import law_values
from mrwork.errors import SettingError
from mrwork.identification.fit import Fit
from mrwork.plots import style
from mrwork.plots.canvas import draw_points, include_zero, plain_ticks
from mrwork.plots.of_tests import Abscissa, axis_name, axis_values, data_label
from mrwork.plots.samples import even_samples
from mrwork.plots.sheet import (
    PANEL,
    Ax,
    GivenAxes,
    Legend,
    Panels,
    all_chosen,
    axes_for,
    chosen_number,
    figure,
    finished,
    panels_for,
)
from mrwork.plots.style import with_unit
from mrwork.records.motion import whole_cycles
from mrwork.runs.load import StoredRun
from mrwork.uncertainty.bands.band import Band
from mrwork.uncertainty.bands.conformal import Calibration, calibrate
from mrwork.uncertainty.bands.prediction import Prediction
from mrwork.uncertainty.identifiability.profile import Profile, Profiles, likelihood_threshold
from mrwork.uncertainty.posterior.draws import Draws

_COMMANDS = 101


@figure
def laws(result: Fit | StoredRun, ax: GivenAxes = None, *, parameters: Sequence[str] = ()) -> Panels:
    """Each parameter that follows the command, over the commands of the tests.

    Points are fits to the tests at one command alone, with their standard errors, where `mr.identify` has made these.

    Parameters
    ----------
    result
        A fit with current laws.
    ax
        Axes to draw into, one for each parameter; by default a new figure's.
    parameters
        Parameters of the plain model; by default all that follow the command.

    Examples
    --------
    >>> import mrwork as mr
    >>> laws = {"f_c": "linear"}
    >>> tests = [mr.synthetic_test(name) for name in ("rd1005_0a", "rd1005_1a")]  # doctest: +SKIP
    >>> mr.identify(mr.damper("bingham").with_current_laws(laws), tests).plot.laws()  # doctest: +SKIP
    """
    fit = result.fit if isinstance(result, StoredRun) else result
    spec = fit.spec
    if spec.command_unit is None:
        raise SettingError(
            f"no parameter of the fit of {fit.model} follows the command; identify "
            "`mr.damper(model).with_current_laws(laws)` from tests at several commands"
        )
    # Where the tested commands are not known, from 0 to 1.
    commands = np.linspace(*(fit.tested.command or (0.0, 1.0)), _COMMANDS)
    curves = [*law_values(spec, np.array(fit.theta), commands)]
    asked = all_chosen(
        parameters, (parameter.name for parameter, _ in curves), "parameter that follows the command"
    )
    panels = panels_for(ax, len(asked), "laws")
    for axes, number in zip(panels, asked, strict=True):
        parameter, along = curves[number]
        axes.plot(commands, along, color=style.MODEL, linewidth=1.4)
        alone = (
            (single.command, estimate) for single in fit.single_commands for estimate in single.estimates
        )
        points = np.array(
            [
                (
                    command,
                    estimate.value,
                    np.nan if estimate.standard_error is None else estimate.standard_error,
                )
                for command, estimate in alone
                if estimate.name == parameter.name and not estimate.state
            ]
        ).T
        if points.size:
            axes.errorbar(
                *points, fmt="o", color=style.INK, markersize=3.2, elinewidth=0.9, label="one command"
            )
        include_zero(axes, np.concatenate([along, *points[1:2]]))
        ordinate = with_unit(style.symbol_text(parameter.name), parameter.unit)
        finished(axes, f"Command ({spec.command_unit})", ordinate)
    return panels


# Top of every panel, relative to the threshold.
_TOP = 1.8
_LINE_POINTS = 200
# From this ratio of its ends on an axis is logarithmic, as it then has at least two powers of ten.
_DECADES = 30.0
# Tick labels of at least this number of characters are long; half of one takes this share of the width.
_LONG, _LABEL_SHARE = 4, 0.08
# An open side is drawn to 1.5 times the distance at which the ratio reaches 0.9 of its final value.
_REACHED, _FURTHER = 0.9, 1.5


@figure
def profiles(
    result: Profiles | Profile | StoredRun, ax: GivenAxes = None, *, parameters: Sequence[str] = ()
) -> Panels:
    """Likelihood ratio over each parameter: threshold dashed, interval shaded, an arrow where it is open.

    Parameters
    ----------
    result
        Profiles, one of them, or a run that holds them.
    ax
        As in `laws`.
    parameters
        Parameters to draw; by default all that were profiled.

    Examples
    --------
    >>> import mrwork as mr
    >>> profiles = mr.profile(fit, tests)  # doctest: +SKIP
    >>> figure = profiles.plot.profiles()[0].figure  # doctest: +SKIP
    """
    if isinstance(result, StoredRun):
        if result.profiles is None:
            raise _absent(result, "profile likelihoods", "intervals", "draw `mr.profile(fit, tests)`")
        result = result.profiles
    several = (result,) if isinstance(result, Profile) else result.profiles
    asked = all_chosen(parameters, (profile.name for profile in several), "profiled parameter")
    panels = panels_for(ax, len(asked), "profiles")
    for axes, profile in zip(panels, (several[number] for number in asked), strict=True):
        _draw_profile(axes, profile, likelihood_threshold(profile.interval.level))
        finished(axes, with_unit(style.symbol_text(profile.name), profile.unit), "Likelihood ratio")
    return panels


def _draw_profile(axes: Axes, profile: Profile, threshold: float) -> None:
    left, right = _span(profile)
    line, ratio = _line(profile, left, right)
    axes.axvspan(
        profile.interval.lower if profile.interval.lower is not None else left,
        profile.interval.upper if profile.interval.upper is not None else right,
        color=style.WINDOW,
        linewidth=0,
        zorder=-1,
    )
    axes.axhline(threshold, color=style.RESIDUAL, linewidth=1.0, linestyle=style.DASHED)
    axes.plot(line, ratio, color=style.MODEL, linewidth=1.4)
    drawn = [
        (value, height)
        for value, height in zip(profile.values, profile.ratio, strict=True)
        if left <= value <= right and height <= _TOP * threshold
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
    for end, way in ((profile.interval.lower, -1), (profile.interval.upper, 1)):
        if end is None:
            # An arrow that leaves the panel where the interval is open.
            edge, colour = (1.0 if way > 0 else 0.0), style.RESIDUAL
            axes.annotate(
                "open",
                xy=(edge, 0.93),
                xytext=(edge - 0.17 * way, 0.93),
                xycoords="axes fraction",
                ha="right" if way > 0 else "left",
                va="center",
                color=colour,
                fontsize=style.SMALL_TEXT_SIZE,
                arrowprops={
                    "arrowstyle": "->",
                    "color": colour,
                    "linewidth": 1.3,
                    "shrinkA": 1,
                    "shrinkB": 0,
                },
            )


def _tick(value: float) -> str:
    text = f"{value:.4g}"
    if "e" not in text:
        return numbers.shortest(value)
    mantissa, _, power = text.partition("e")
    return mantissa + numbers.power_of_ten(int(power))


def _span(profile: Profile) -> tuple[float, float]:
    scale = np.log if profile.log else np.asarray
    position = np.asarray(scale(np.array(profile.values)))
    ratio = np.array(profile.ratio)
    centre = int(profile.values.index(profile.estimate))
    ends = []
    for way, limit in ((-1, profile.interval.lower), (1, profile.interval.upper)):
        side = slice(centre, None, 1) if way > 0 else slice(centre, None, -1)
        distance, height = np.abs(position[side] - position[centre]), ratio[side]
        if limit is not None:
            ends.append(1.25 * abs(float(scale(np.array(limit))) - float(position[centre])))
        else:
            levelled = int(np.argmax(height >= _REACHED * height.max()))
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


# Cells of a density, and their smoothing.
_CELLS, _SMOOTH = 32, 1.2
# Size of a panel where there are several [in].
_CORNER = (1.7, 1.7)


@figure
def posterior(result: Draws | StoredRun, ax: GivenAxes = None, *, parameters: Sequence[str] = ()) -> Panels:
    """Densities of the parameters on the diagonal, and of their pairs below it: dark holds 50 %, light 90 %.

    Parameters
    ----------
    result
        Draws, or a run that holds them; a run also marks its fit.
    ax
        Axes to draw into, shape (n_parameters, n_parameters), one alone for a single parameter; by default a new
        figure's. Axes above the diagonal are switched off.
    parameters
        Parameters to draw; by default all that varied.

    Examples
    --------
    >>> import mrwork as mr
    >>> draws = mr.sample(fit, tests)  # doctest: +SKIP
    >>> corner = draws.plot.posterior(parameters=["k_w", "rho"])  # doctest: +SKIP
    """
    fitted: dict[str, float] = {}
    if isinstance(result, StoredRun):
        fitted = {estimate.name: estimate.value for estimate in result.fit.estimates}
        if result.draws is None:
            raise _absent(result, "posterior", "intervals --posterior", "draw `mr.sample(fit, tests)`")
        result = result.draws
    asked = all_chosen(parameters, (summary.name for summary in result.varied), "parameter that varied")
    drawn = [result.varied[number] for number in asked]
    names = [summary.name for summary in drawn]
    count = len(names)
    size = _CORNER if count > 1 else PANEL
    panels = panels_for(ax, count**2, "posterior", columns=count, size=size).reshape(count, count)
    for axes in panels[np.triu_indices(count, 1)]:
        axes.set_axis_off()
    values = [result.chain(name).reshape(-1) for name in names]
    # Single outliers would compress the rest.
    spans = [tuple(np.quantile(value, [0.002, 0.998]).tolist()) for value in values]
    labels = [with_unit(style.symbol_text(summary.name), summary.unit) for summary in drawn]
    for row, column in np.argwhere(np.tri(len(names))).tolist():
        axes, at = panels[row, column], (fitted.get(names[column]), fitted.get(names[row]))
        if row == column:
            _density(axes, values[row], spans[row], at[0])
        else:
            _pair(axes, values[column], values[row], spans[column], spans[row], at)
        below, left = labels[column] * (row == len(names) - 1), labels[row] * (column == 0 < row)
        axes.grid(False)
        axes.tick_params(labelbottom=bool(below), labelleft=bool(left))
        axes.set(xlabel=below, ylabel=left)
        for axis, name in ((axes.xaxis, below), (axes.yaxis, left)):
            if name:
                axis.set_major_locator(MaxNLocator(nbins=2, steps=[1, 2, 4, 5, 10], prune="both"))
        plain_ticks(axes, 4, "x")
        plain_ticks(axes, 4, "y")
    return panels


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


_BAND_POINTS, _FORCE_POINTS, _ASPECT = 260, 130, 1.4


@figure
def bands(
    result: Prediction | StoredRun,
    ax: Ax = None,
    *,
    calibration: Calibration | None = None,
    over: Abscissa = "time",
    test: str | int | None = None,
    level: Level = 0.9,
    unit: str | None = None,
    legend: Legend = True,
) -> Axes:
    """Measured force, model and prediction band over the cycle in the middle of a test.

    Parameters
    ----------
    result
        A prediction, with its `calibration`; or a run with calibrated bands, of which a test that was held out is drawn
        with the band that the others give.
    unit
        As in `histories`.
    calibration
        Calibration of the band of a prediction.
    over
        The abscissa.
    test
        Name or number of the test of a run, by default the first.
    level
        Nominal coverage.

    Examples
    --------
    >>> import mrwork as mr
    >>> calibration = mr.calibrate([mr.predict(fit, other)], held_out="by hand")  # doctest: +SKIP
    >>> axes = mr.predict(fit, next_test).plot.bands(calibration=calibration)  # doctest: +SKIP
    """
    prediction, band = _predict_with_band(result, calibration, test, level)
    shown = style.force_unit(float(np.abs(prediction.measured).max()), unit)
    axes = axes_for(ax)
    record = prediction.test
    cycles = whole_cycles(record.displacement[record.counted])
    # The whole cycle in the middle of the samples that count; all of them where there is none.
    middle = cycles[len(cycles) // 2] if cycles else slice(0, prediction.force.size - 1)
    samples = slice(middle.start, middle.stop + 1)
    across = axis_values(record, over)[0][record.counted][samples]
    measured, model, lower, upper = (
        force[samples] * shown.factor
        for force in (prediction.measured, prediction.force, band.lower, band.upper)
    )
    label = f"{100 * band.level:.0f} % prediction"
    if over == "time":
        drawn = np.unique(np.linspace(0, across.size - 1, min(across.size, _BAND_POINTS)).astype(np.intp))
        ends = lower[drawn], upper[drawn]
        axes.fill_between(across[drawn], *ends, color=style.BAND, linewidth=0.0, label=label, zorder=1.0)
        for end in ends:
            axes.plot(across[drawn], end, color=style.BAND_EDGE, linewidth=0.9, linestyle=style.DASHED)
    else:
        drawn = _along(across, upper)
        _fill_loop(axes, across[drawn], lower[drawn], upper[drawn], label)
    line = _along(across, model)
    axes.plot(across[line], model[line], color=style.MODEL, linewidth=1.2, label="model", zorder=2.3)
    drawn = even_samples(across, measured, _FORCE_POINTS, aspect=_ASPECT)
    points = across[drawn], measured[drawn]
    draw_points(axes, *points, size=2.6, colour=style.INK, label=data_label(record), zorder=2.2)
    return finished(axes, axis_name(over), f"Force ({shown.symbol})", legend=legend)


def _predict_with_band(
    result: Prediction | StoredRun, calibration: Calibration | None, test: str | int | None, level: float
) -> tuple[Prediction, Band]:
    """A prediction and its band; one of a run is left out of the calibration of its own band."""
    if isinstance(result, Prediction):
        if calibration is None:
            raise SettingError(
                "a prediction has no band by itself; give `calibration`, made by `mr.calibrate(predictions, "
                "held_out=...)`"
            )
        return result, _known_band(calibration, result, level)
    if result.bands is None:
        raise _absent(result, "calibrated band", "calibrate", "draw a prediction with its `calibration`")
    predictions = result.bands.predictions
    prediction = predictions[
        chosen_number(test, [prediction.test.name for prediction in predictions], "test")
    ]
    others = result.bands.others(prediction) if calibration is None and len(predictions) > 1 else []
    used = calibration or result.bands.calibration
    if others:
        used = calibrate(others, held_out=used.held_out)
    return prediction, _known_band(used, prediction, level)


def _known_band(calibration: Calibration, prediction: Prediction, level: float) -> Band:
    band = calibration.band(prediction, level)
    if band is None:
        raise SettingError(str(calibration.test_to_run(prediction)))
    return band


def _fill_loop(axes: Axes, across: Floats, lower: Floats, upper: Floats, label: str) -> None:
    """A band along the loop: a polygon between each two samples, all of one colour."""
    first = np.arange(across.size - 1)
    # All polygons have the same orientation: overlaps of opposite ones would leave holes.
    rising = across[:-1] <= across[1:]
    left, right = np.where(rising, first, first + 1), np.where(rising, first + 1, first)
    corners = [(left, lower), (right, lower), (right, upper), (left, upper), (left, lower)]
    vertices = np.stack([np.stack([across[at], end[at]], axis=-1) for at, end in corners], axis=1)
    codes = np.tile(np.array([Path.MOVETO, *[Path.LINETO] * 3, Path.CLOSEPOLY], dtype=np.uint8), len(left))
    outline = Path(vertices.reshape(-1, 2), codes)
    patch = PathPatch(outline, facecolor=style.BAND, edgecolor=style.BAND, linewidth=0.6, label=label)
    axes.add_patch(patch)


def _along(across: Floats, up: Floats) -> NDArray[np.intp]:
    """Samples at equal steps along a line, with its end, so that a loop closes."""
    return np.union1d(even_samples(across, up, _BAND_POINTS, aspect=_ASPECT), [across.size - 1])


def _absent(run: StoredRun, what: str, verb: str, otherwise: str) -> SettingError:
    add = f"add it with `mrwork {verb} {run.place}`"
    return SettingError(f"the run {run.place} has no {what}; {add}, or {otherwise}")
