"""Figures of motions, buildings, runs and tunings."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from numpy.typing import ArrayLike

from mrwork.base.keys import check_known
from mrwork.base.values import Floats
from mrwork.buildings.matrices import Building
from mrwork.buildings.yielding import Pushover
from mrwork.closed_loop.evaluation import criterion
from mrwork.closed_loop.responses import History, Responses, own_axis, run_quantities, unit_of
from mrwork.dampers.design.sizing import SizeFront
from mrwork.errors import SettingError
from mrwork.motions.ground_motion import GroundMotion
from mrwork.motions.spectrum import ResponseSpectrum, response_spectrum
from mrwork.motions.targets import LEAST_RATIO, RANGE, SuiteCheck
from mrwork.plots import style
from mrwork.plots.canvas import draw_points, small_axes, vertical_grid
from mrwork.plots.sheet import (
    GivenAxes,
    Panels,
    axes_for,
    chosen,
    figure,
    finished,
    panels_for,
    shown_unit_of,
)
from mrwork.plots.study_drawing import (
    MARKERS,
    Stroke,
    add_building,
    add_energies,
    add_energy_bars,
    add_fragility,
    add_front,
    add_height_line,
    add_ida,
    energy_parts,
    name_heights,
    response_unit,
    strokes,
)
from mrwork.plots.style import with_unit
from mrwork.study.fragilities import Fragilities
from mrwork.study.results import BuildingFacts, StudyResults
from mrwork.tuning.judging import TunedStudy
from mrwork.tuning.results import Front, TuningResults

SpectrumQuantity = Literal[
    "pseudo_acceleration", "pseudo_velocity", "acceleration", "velocity", "displacement"
]

_UNITS: dict[SpectrumQuantity, str] = {
    "pseudo_acceleration": "m/s^2", "pseudo_velocity": "m/s", "acceleration": "m/s^2", "velocity": "m/s",
    "displacement": "m",
}  # fmt: skip
# Periods of most buildings [s].
_PERIODS = (0.05, 4.0, 120)


@figure
def spectra(
    result: GroundMotion | ResponseSpectrum,
    ax: Axes | None = None,
    *,
    quantity: SpectrumQuantity = "pseudo_acceleration",
    periods: ArrayLike | None = None,
    damping: float | None = None,
    legend: bool = True,
) -> Axes:
    """Response spectrum over the period; several motions are drawn one after the other into the same axes.

    Parameters
    ----------
    result
        A motion, or a spectrum of one.
    ax, legend
        As in `histories`.
    quantity
        Ordinate.
    periods, damping
        Of the spectrum of a motion [s, 1]; by default from 0.05 to 4 s at 5 % damping.

    Raises
    ------
    SettingError
        As `mr.response_spectrum`; also if periods or damping are given for a spectrum, which has its own.

    Examples
    --------
    >>> import mrwork as mr
    >>> axes = mr.synthetic_motion(duration=5.0).plot.spectra(quantity="displacement")
    >>> axes.get_ylabel()
    'Displacement (mm)'
    """
    if isinstance(result, GroundMotion):
        label = result.name
        shares = np.geomspace(*_PERIODS) if periods is None else periods
        spectrum = response_spectrum(result, shares, damping=0.05 if damping is None else damping)
    elif periods is None and damping is None:
        label, spectrum = f"{100.0 * result.damping:g} % damping", result
    else:
        raise SettingError("a spectrum has its own periods and damping; leave both out, or give the motion")
    axes, values = axes_for(ax), getattr(spectrum, quantity)
    unit = shown_unit_of(_UNITS[quantity], float(values.max()))
    colour = style.hue(len(axes.get_lines()))
    axes.plot(spectrum.periods, values * unit.factor, color=colour, linewidth=1.4, label=label)
    axes.set_ylim(bottom=0.0)
    ordinate = with_unit(quantity.replace("_", "-").capitalize(), unit.symbol)
    return finished(axes, "Period (s)", ordinate, legend=legend)


@figure
def suite_spectra(result: SuiteCheck, ax: Axes | None = None, *, legend: bool = True) -> Axes:
    """Pseudo-acceleration of the motions of a suite with their mean, its target, and 90 % of the target.

    The range of periods within which the mean counts is shaded.

    Parameters
    ----------
    result
        The suite beside its target, of `mr.motions.check_suite`.
    ax, legend
        As in `histories`.

    Examples
    --------
    >>> import mrwork as mr
    >>> target = mr.motions.en_1998_spectrum(2.0, "B")
    >>> check = mr.motions.check_suite(mr.motions.suite("firm", 3, rng=0), target, period=0.8)
    >>> drawn = mr.plots.drawn_data(check.plot.suite_spectra())
    >>> mean = drawn[drawn["curve"] == "Mean"]
    """
    target = result.target.acceleration(result.periods)
    axes = axes_for(ax)
    axes.axvspan(*(end * result.period for end in RANGE), color=style.WINDOW, zorder=0)
    for number, (name, spectrum) in enumerate(zip(result.names, result.spectra, strict=True)):
        label = None if number else "Motions"
        axes.plot(result.periods, spectrum, color=style.DATA, linewidth=0.6, label=label, gid=name)
    for values, colour, pattern, width, label in (
        (result.mean, style.MODEL, "-", 1.6, "Mean"),
        (target, style.INK, "-", 1.4, result.target.name),
        (LEAST_RATIO * target, style.INK, style.DASHED, 1.0, f"{100.0 * LEAST_RATIO:g} % of it"),
    ):
        axes.plot(result.periods, values, color=colour, linestyle=pattern, linewidth=width, label=label)
    axes.set_ylim(bottom=0.0)
    return finished(axes, "Period (s)", with_unit("Pseudo-acceleration", "m/s^2"), legend=legend)


@figure
def building(result: Building, ax: Axes | None = None) -> Axes:
    """Floors of a frame with their masses, and storeys with their stiffnesses.

    Parameters
    ----------
    result
        The building: a chain of floors, each on the spring of its storey.
    ax
        As in `histories`.

    Raises
    ------
    SettingError
        If the building is no such chain.

    Examples
    --------
    >>> import mrwork as mr
    >>> axes = mr.building("uts").plot.building()
    """
    facts = BuildingFacts.of(result)
    if len(facts.stiffnesses) != len(facts.masses):
        raise SettingError(
            f"{result.name} is no chain of floors, each on the spring of its storey; its modes are in its `repr`"
        )
    axes = axes_for(ax)
    add_building(axes, facts)
    return axes


@figure
def pushover(result: Pushover, ax: Axes | None = None, *, legend: bool = True) -> Axes:
    """Base shear over the displacement of the roof of a frame that is pushed.

    Parameters
    ----------
    result
        The frame that was pushed, of `mr.buildings.pushover`.
    ax, legend
        As in `histories`.

    Examples
    --------
    >>> import mrwork as mr
    >>> frame = mr.buildings.with_storeys_that_yield(mr.building("uts"), yield_drift=0.005)
    >>> axes = mr.buildings.pushover(frame, steps=10).plot.pushover()
    >>> axes.get_ylabel()
    'Base shear (kN)'
    """
    axes, unit = axes_for(ax), shown_unit_of("N", float(result.base_shear.max()))
    axes.plot(1e3 * result.roof, unit.factor * result.base_shear, color=style.MODEL, label=result.pattern)
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    return finished(
        axes, "Displacement of the roof (mm)", with_unit("Base shear", unit.symbol), legend=legend
    )


# Bars that fit into a figure.
_MOST_BARS = 60


@figure
def storey_profiles(
    result: Responses | StudyResults,
    ax: Axes | None = None,
    *,
    quantity: str = "peak_drift",
    motion: str | int | None = None,
    rows: Sequence[str | int] = (),
    legend: bool = True,
) -> Axes:
    """A quantity of storeys or floors over the height, a line for each row or candidate that finished.

    Parameters
    ----------
    result
        Runs of a batch, of which the first draw is shown, or of a study, also where `mr.load` has read it.
    ax, legend
        As in `histories`.
    quantity
        Quantity of a run that storeys or floors have, such as "peak_drift" or "peak_acceleration".
    motion
        Name or number of the ground motion, by default the first.
    rows
        Labels or numbers of rows of a study, or numbers of candidates; by default all. More than eight are drawn in
        tones from light to dark.

    Raises
    ------
    SettingError
        If there is no motion or row of this number, or none of the runs finished.
    UnknownNameError
        If there is none of this name, or storeys and floors have no such quantity.

    Examples
    --------
    >>> import mrwork as mr
    >>> responses = mr.simulate_loop(frame, dampers, law, motions)  # doctest: +SKIP
    >>> axes = responses.plot.storey_profiles(rows=[0, 5])  # doctest: +SKIP
    """
    known = [each.name for each in run_quantities() if each.axis in ("storey", "floor")]
    check_known(quantity, known, f"storeys and floors have no quantity {quantity!r}", otherwise="they have")
    runs = _runs(result, motion, rows)
    values = np.array([each.numbers[quantity] for each in runs])
    (axis,), si_unit = own_axis(quantity), unit_of(quantity)
    if isinstance(result, StudyResults):
        names = result.floor_names if axis == "floor" else result.storey_names
    else:
        names = tuple(f"{axis} {number}" for number in range(1, 1 + values.shape[1]))
    axes, unit = axes_for(ax), shown_unit_of(si_unit, float(values.max()))
    for each, line in zip(runs, values, strict=True):
        add_height_line(axes, line * unit.factor, each.stroke, each.label)
    axes.set_xlim(left=0.0)
    name_heights(axes, names)
    return finished(
        axes,
        with_unit(quantity.replace("_", " ").capitalize(), unit.symbol),
        "",
        legend=legend and len(runs) <= len(style.HUES),
    )


@figure
def energies(
    result: Responses | StudyResults | History,
    ax: Axes | None = None,
    *,
    motion: str | int | None = None,
    rows: Sequence[str | int] = (),
    legend: bool = True,
) -> Axes:
    """Input energy and its distribution: a bar for each run at the end of the motion, or the course of one run.

    Of a history, what dampers and structure have not dissipated is still moving: kinetic and strain energy; all
    elements of its building count as dampers, storeys that yield among them.

    Parameters
    ----------
    result, ax, motion, rows, legend
        As in `storey_profiles`; also the history of a run, which has neither motions nor rows.

    Raises
    ------
    SettingError
        As `storey_profiles`; also for more than sixty bars.

    Examples
    --------
    >>> import mrwork as mr
    >>> axes = mr.run_study(study).plot.energies()  # doctest: +SKIP
    """
    if isinstance(result, History):
        return _course(result, ax, legend=legend)
    runs = _runs(result, motion, rows)
    parts = np.array([energy_parts(each.numbers) for each in runs])
    if len(runs) > _MOST_BARS:
        raise SettingError(
            f"there are {len(runs)} runs, and {_MOST_BARS} bars can be read; choose some by `rows`"
        )
    axes = axes_for(ax, rows=len(runs))
    add_energy_bars(axes, [each.label for each in runs], parts)
    if ax is None:
        vertical_grid(axes)
    return finished(axes, axes.get_xlabel(), axes.get_ylabel(), legend=legend)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    """A run that finished: its label, its quantities and the stroke of its line."""

    label: str
    numbers: Mapping[str, Any]
    stroke: Stroke


def _runs(
    result: Responses | StudyResults, motion: str | int | None, rows: Sequence[str | int]
) -> list[_Run]:
    """The runs of these rows or candidates under a motion that finished."""
    if isinstance(result, StudyResults):
        place = chosen(motion, [each.name for each in result.motions], "motion")
        labels = [each.label for each in result.rows]
        numbers = {row: result.runs[row, place].numbers for row in result.finished_rows(place)}
    else:
        n_candidates, n_motions, n_draws = result.shape
        names = result.motions if len(result.motions) == n_motions else [str(n) for n in range(n_motions)]
        place = chosen(motion, names, "motion")
        labels = [f"candidate {number}" for number in range(n_candidates)]
        at = [(number * n_motions + place) * n_draws for number in range(n_candidates)]
        numbers = {
            number: {name: values[run] for name, values in result.numbers.items()}
            for number, run in enumerate(at)
            if np.isfinite(result.energy_error[run])
        }
    asked = [chosen(row, labels, "row") for row in rows] or list(range(len(labels)))
    if isinstance(result, StudyResults):
        of_row = dict(enumerate(strokes(result, asked)))
    else:
        of_row = {row: _stroke(number, len(asked)) for number, row in enumerate(asked)}
    finished = [
        _Run(label=labels[row], numbers=numbers[row], stroke=of_row[row]) for row in asked if row in numbers
    ]
    if not finished:
        raise SettingError("none of these runs finished, and there is nothing to draw; see `outcome`")
    return finished


def _stroke(number: int, count: int) -> Stroke:
    """A hue for each of a few candidates; of many a tone, and thin lines."""
    if count <= len(style.HUES):
        return Stroke(style.hue(number), marker=MARKERS[number])
    return Stroke(to_hex(style.TONES(number / (count - 1))), width=0.6)


def _course(history: History, ax: Axes | None, *, legend: bool) -> Axes:
    numbers: Mapping[str, Floats] = history.numbers
    devices = numbers["device_energy"].sum(axis=1) + numbers["element_energy"].sum(axis=1)
    damping, given = numbers["damping_energy"], numbers["input_energy"]
    moving = given - devices - damping
    axes = axes_for(ax)
    ordinate = add_energies(axes, history.time, given, devices, moving)
    return finished(axes, "Time (s)", ordinate, legend=legend)


@figure
def fronts(
    result: Front | TuningResults | TunedStudy | SizeFront,
    ax: Axes | None = None,
    *,
    law: str | int | None = None,
    legend: bool = True,
) -> Axes:
    """Points of a front: the first two objectives of a law, or volume and dynamic range of dampers.

    Parameters
    ----------
    result
        A front, or a tuning with fronts.
    ax, legend
        As in `histories`.
    law
        Label or number of the front of a tuning, by default the first.

    Raises
    ------
    SettingError
        If a tuning has no front, or not that of this law.

    Examples
    --------
    >>> import mrwork as mr
    >>> axes = mr.tune(study).plot.fronts()  # doctest: +SKIP
    """
    if isinstance(result, SizeFront):
        return _designs(result, ax)
    if isinstance(result, TunedStudy):
        result = result.tuned
    if isinstance(result, TuningResults):
        if not result.fronts:
            raise SettingError(
                f"the tuning {result.title!r} has no front; give two `objectives` or more in its table [[tune]]"
            )
        result = result.fronts[chosen(law, [each.label for each in result.fronts], "law")]
    axes = axes_for(ax)
    add_front(axes, result)
    return finished(axes, axes.get_xlabel(), axes.get_ylabel(), legend=legend)


def _designs(front: SizeFront, ax: Axes | None) -> Axes:
    axes = axes_for(ax)
    volume = [1e3 * each.envelope_volume for each in front.designs]
    dynamic_range = [each.dynamic_range for each in front.designs]
    draw_points(axes, volume, dynamic_range, size=4.5, colour=style.MODEL)
    return finished(axes, "Volume (l)", with_unit("Dynamic range", "1"))


# Panels of incremental dynamic analyses that can be read.
_MOST_PANELS = 6


@figure
def ida(result: Fragilities, ax: GivenAxes = None, *, rows: Sequence[str | int] = ()) -> Panels:
    """Incremental dynamic analysis: intensity over the criterion of the limit, a panel for each arrangement.

    A thin line for each record, thick ones below which 16, 50 and 84 % of the records lie, and the limit dashed. A line
    ends where the record's run diverged or could not be resolved.

    Parameters
    ----------
    result
        What `mr.fragility` has found, of a study with records at several levels.
    ax
        Axes to draw into, as many as there are panels; by default those of a new figure.
    rows
        Labels or numbers of arrangements; by default the first six.

    Raises
    ------
    SettingError
        If there are not as many axes as panels.
    UnknownNameError
        If there is no arrangement of this name.

    Examples
    --------
    >>> import mrwork as mr
    >>> found = mr.fragility(results, limit={"peak_drift_ratio": "1 %"})  # doctest: +SKIP
    >>> panels = found.plot.ida(rows=["uncontrolled", "Passive-on"])  # doctest: +SKIP
    """
    unit, of_row, labels = response_unit(result), strokes(result), [*result.rows]
    drawn = [chosen(row, labels, "arrangement") for row in rows] or [*range(len(labels))][:_MOST_PANELS]
    panels = panels_for(ax, len(drawn), "ida")
    for axes, row in zip(panels, drawn, strict=True):
        one = result[labels[row]]
        add_ida(axes, result, one, of_row[row])
        axes.set(
            xlabel=with_unit(criterion(result.criterion).title, unit.symbol), ylabel=f"{one.measure} (g)"
        )
        axes.set_title(one.label, loc="left", fontsize="small")
    return panels


@figure
def fragility(
    result: Fragilities,
    ax: Axes | None = None,
    *,
    rows: Sequence[str | int] = (),
    legend: bool = True,
) -> Axes:
    """Probability that the limit is reached over intensity: the lognormal curve of each arrangement.

    Points are the shares of the records at each level, the bar at one half is the band of the median.

    Parameters
    ----------
    result
        What `mr.fragility` has found.
    ax, legend
        As in `histories`.
    rows
        As in `ida`; by default all.

    Raises
    ------
    UnknownNameError
        If there is no arrangement of this name.

    Examples
    --------
    >>> import mrwork as mr
    >>> axes = mr.fragility(results, limit={"peak_drift_ratio": "1 %"}).plot.fragility()  # doctest: +SKIP
    """
    axes, labels, of_row = axes_for(ax), [*result.rows], strokes(result)
    for row in [chosen(each, labels, "arrangement") for each in rows] or range(len(labels)):
        add_fragility(axes, result[labels[row]], of_row[row])
    ordinate = f"Probability ({result.title} ≥ {result.limit_value})"
    return finished(axes, f"{result[labels[0]].measure} (g)", ordinate, legend=legend)


@style.drawn_in_style()
def building_html(building: Building) -> str:
    """The drawing of a chain of floors, for a notebook."""
    figure, axes = small_axes()
    add_building(axes, BuildingFacts.of(building))
    written = io.StringIO()
    figure.savefig(written, format="svg")
    return written.getvalue().partition("<!DOCTYPE")[2].partition(">")[2]
