"""Figures of ground motions and of buildings."""

from __future__ import annotations

import io
from functools import partial
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike

from mrwork.base.numbers import significant
from mrwork.buildings.plane_building import Building
from mrwork.buildings.yielding import Pushover
from mrwork.errors import SettingError
from mrwork.motions.ground_motion import GroundMotion
from mrwork.motions.spectrum import ResponseSpectrum, response_spectrum
from mrwork.motions.targets import LEAST_RATIO, RANGE, SuiteCheck
from mrwork.plots import style
from mrwork.plots.canvas import small_axes
from mrwork.plots.sheet import Ax, Legend, axes_for, figure, finished, shown_unit_of
from mrwork.plots.style import with_unit
from mrwork.study.results import BuildingFacts, StudyResults

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
    ax: Ax = None,
    *,
    quantity: SpectrumQuantity = "pseudo_acceleration",
    periods: ArrayLike | None = None,
    damping: float | None = None,
    legend: Legend = True,
) -> Axes:
    """Response spectrum over the period; several motions are drawn one after the other into the same axes.

    Parameters
    ----------
    result
        A motion, or a spectrum of one.
    quantity
        Ordinate.
    periods, damping
        Of the spectrum of a motion [s, 1]; by default from 0.05 to 4 s at 5 % damping.

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
def suite_spectra(result: SuiteCheck, ax: Ax = None, *, legend: Legend = True) -> Axes:
    """Pseudo-acceleration of the motions of a suite with their mean, its target, and 90 % of the target.

    The range of periods within which the mean counts is shaded.

    Parameters
    ----------
    result
        The suite beside its target, of `mr.motions.check_suite`.

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
def building(result: Building | StudyResults, ax: Ax = None) -> Axes:
    """Floors of a frame with their masses, storeys with their stiffnesses, and the dampers of a study.

    Parameters
    ----------
    result
        The building, or a study of one: a chain of floors, each on the spring of its storey.

    Examples
    --------
    >>> import mrwork as mr
    >>> axes = mr.building("uts").plot.building()
    """
    facts = result.building if isinstance(result, StudyResults) else BuildingFacts.of(result)
    if len(facts.stiffnesses) != len(facts.masses):
        raise SettingError(
            f"{facts.name} is no chain of floors, each on the spring of its storey; its modes are in its `repr`"
        )
    axes, dampers = axes_for(ax), list(facts.passive_storeys)
    if isinstance(result, StudyResults):
        dampers += [damper.storey for damper in result.dampers]
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
    return axes


@style.drawn_in_style()
def building_html(result: Building) -> str:
    """The drawing of a chain of floors, for a notebook."""
    figure, axes = small_axes()
    building(result, axes)
    written = io.StringIO()
    figure.savefig(written, format="svg")
    return written.getvalue().partition("<!DOCTYPE")[2].partition(">")[2]


@figure
def pushover(result: Pushover, ax: Ax = None, *, legend: Legend = True) -> Axes:
    """Base shear over the displacement of the roof of a frame that is pushed.

    Parameters
    ----------
    result
        The frame that was pushed, of `mr.buildings.pushover`.

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
