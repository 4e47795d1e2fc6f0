"""Bands: the section on the prediction band of another measurement, and the parameter band of the model force."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import get_args

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from mrwork.base.numbers import percent, significant
from mrwork.base.values import Floats
from mrwork.errors import RecordError, SettingError, SimulationError
from mrwork.identification.fit import Fit
from mrwork.identification.problem import Problem
from mrwork.identification.residual import ObservedTest
from mrwork.records import DamperTest
from mrwork.records.motion import whole_cycles
from mrwork.report import style
from mrwork.report.canvas import column_axes, draw_points, finish_signed, legend, name_small_axes, small_axes
from mrwork.report.figures import Comparison, Motion, axis_values, common_force_unit, data_label, even_samples
from mrwork.report.fit.coverage import (
    ABSENT,
    MAIN_LEVEL,
    conditions_in_words,
    coverage_groups,
    coverage_summary,
)
from mrwork.report.section import Group, Panel, Section, SectionKind, panel
from mrwork.report.style import DisplayUnit
from mrwork.runs.load import StoredRun
from mrwork.uncertainty.bands.band import (
    QUANTITIES,
    Band,
    CycleQuantity,
    cycle_band,
    cycles_of,
    errors_over_cycles,
    parameter_band,
    score,
    simulate_draws,
)
from mrwork.uncertainty.bands.calibration_files import StoredBands
from mrwork.uncertainty.bands.conformal import calibrate
from mrwork.uncertainty.bands.prediction import Prediction
from mrwork.uncertainty.noise import noise_model
from mrwork.uncertainty.posterior.draws import Draws
from mrwork.uncertainty.posterior.laplace import first_walkers
from mrwork.uncertainty.posterior.target import Target

# Tests left out that are drawn; draws of the parameters.
_LEFT_OUT = 3
_DRAWS = 200

_QUANTITIES: dict[CycleQuantity, tuple[str, float]] = {
    "energy": ("Energy per cycle (J)", 1.0),
    "stiffness": ("Stiffness (N/mm)", 1e-3),
    "damping": ("Damping (N s/mm)", 1e-3),
}


_ParameterDraws = tuple[Floats, str]
"""Parameters, shape (n_draws, n_params), and the distribution they are drawn from, in words."""


def _section(run: StoredRun, comparisons: Sequence[Comparison]) -> Section | None:
    """Coverage of tests left out, and bands around some of them; `None` without calibration."""
    bands = run.bands
    if bands is None:
        return None
    unit = common_force_unit(comparisons)
    groups = [*coverage_groups(bands), Group(prose=_prose(bands))]
    if len(bands.predictions) > 1:
        for number, prediction in enumerate(filter(bands.others, _choose_predictions(bands)), start=1):
            groups += _left_out_groups(number, prediction, bands, unit)
    return Section(
        anchor="bands", title="Prediction bands", summary=coverage_summary(bands), groups=tuple(groups)
    )


def _prose(bands: StoredBands) -> tuple[str, ...]:
    names = [conditions_in_words(each.test) for each in bands.predictions] or bands.calibration.tests
    return (
        f"The prediction band (light blue) should contain the stated share of a measurement. It is "
        f"{bands.calibration.basis}: {'; '.join(names)}. It is valid for excitations and commands like these, not "
        "beyond them. In the small figures, points are measured cycles, dashes those of the model, and bars the bands.",
        *bands.calibration.remarks,
    )


def band_panels(run: StoredRun, comparisons: Sequence[Comparison], number: int) -> tuple[Panel, ...]:
    """The error of the model over a cycle of a fitted test with the bands that exist; none without any."""
    comparison, bands = comparisons[number], run.bands
    draws = (
        None
        if run.draws is None and bands is None
        else _parameter_draws(run.fit, [each.test for each in comparisons], run.draws)
    )
    if draws is None and bands is None:
        return ()
    prediction = Prediction(test=comparison.test, model_force=comparison.model_force)
    forces = None if draws is None else _drawn_forces(run.fit, draws[0], comparison.test)
    banded = Banded(
        prediction=prediction,
        predicted=None if bands is None else bands.calibration.band(prediction, MAIN_LEVEL),
        parameters=None if forces is None else parameter_band(forces[:, comparison.test.counted], MAIN_LEVEL),
    )
    shares = [
        f"{percent(score(band, prediction.measured).coverage)} % of its samples lie in the 90 % {band.kind} band"
        for band in (banded.parameters, banded.predicted)
        if band is not None
    ]
    drawn = "" if draws is None else f" Parameters were drawn from {draws[1]}."
    return (
        panel(
            "worst-error",
            "Force minus model force over one cycle",
            error_figure(banded, common_force_unit(comparisons)),
            f"Force minus model force over one cycle of test {comparison.test.name} with its bands",
            f"This test was fitted; {'; '.join(shares)}. The parameter band (orange) contains the model force for the "
            f"parameters that the data allow, and need not contain a measurement.{drawn}",
        ),
    )


def _left_out_groups(
    number: int, prediction: Prediction, bands: StoredBands, unit: DisplayUnit
) -> tuple[Group, Group]:
    band = calibrate(bands.others(prediction), held_out=bands.calibration.held_out).band(
        prediction, MAIN_LEVEL
    )
    banded = Banded(prediction=prediction, predicted=band)
    name = prediction.test.name + (" (synthetic)" if prediction.test.synthetic else "")
    row = bands.row(prediction, MAIN_LEVEL)
    share = score(band, prediction.measured).coverage if row is None else row.samples.coverage
    cycles = (
        f", and {percent(row.cycles_inside, 0)} % of its cycles by their energy"
        if row is not None and np.isfinite(row.cycles_inside)
        else ""
    )
    inside = f"Inside the 90 % band: {percent(share)} % of the samples of the whole test{cycles}."
    whole = Group(
        title=f"A test left out: {prediction.test.name}",
        synthetic=prediction.test.synthetic,
        prose=(f"Band {band.basis}; this test is excluded from its calibration.",),
        panels=tuple(
            panel(
                f"l{number}-{over}",
                f"Force against {over}",
                loop_figure(banded, unit, over),
                f"Force against {over} of test {name}, one cycle, with the 90 % prediction band",
                inside,
            )
            for over in get_args(Motion)
        ),
    )
    return whole, Group(
        panels=_cycle_panels(f"l{number}", prediction, bands.others(prediction)), layout="small"
    )


def _choose_predictions(bands: StoredBands) -> list[Prediction]:
    """All tests, or as many as are drawn, spread from the least covered to the best covered."""

    def find_coverage(prediction: Prediction) -> float:
        row = bands.row(prediction, MAIN_LEVEL)
        return 0.0 if row is None else row.samples.coverage

    ordered = sorted(bands.predictions, key=find_coverage)
    if len(ordered) <= _LEFT_OUT:
        return list(bands.predictions)
    return [ordered[index] for index in np.linspace(0, len(ordered) - 1, _LEFT_OUT).round().astype(int)]


def _cycle_panels(identifier: str, prediction: Prediction, others: Sequence[Prediction]) -> tuple[Panel, ...]:
    """Energy, stiffness and damping of each cycle; none where the test has no whole cycle."""
    test = prediction.test
    try:
        measured, model = cycles_of(test, test.force), cycles_of(test, prediction.model_force)
    except RecordError:
        return ()
    panels = []
    for name in QUANTITIES:
        title, factor = _QUANTITIES[name]
        bands: list[Band] = []
        scores = []
        for each in others:
            with suppress(RecordError):
                scores.append(errors_over_cycles(each, name))
        if scores := [each for each in scores if each.size]:
            bands.append(cycle_band(prediction, name, scores, MAIN_LEVEL))
        values = measured[name]
        figure = cycle_figure(title, values, model[name], bands, factor)
        kinds = " and ".join(band.kind for band in bands) or "no"
        panels.append(
            panel(
                f"{identifier}-{name}",
                "",
                figure,
                f"{title} of each cycle of test {test.name} with {kinds} band, mean "
                f"{significant(float(values.mean()) * factor, 3)}",
            )
        )
    return tuple(panels)


def _parameter_draws(fit: Fit, tests: Sequence[DamperTest], stored: Draws | None) -> _ParameterDraws | None:
    """Draws of the parameters of a fit; `None` where its tests do not determine an ellipsoid."""
    if stored is not None:
        theta = stored.theta
        chosen = np.linspace(0, len(theta) - 1, min(_DRAWS, len(theta))).astype(int)
        return theta[chosen], "the posterior"
    problem = Problem.of_fit(fit, tuple(tests))
    form, start = problem.form, problem.inside(fit.theta)
    try:
        target = Target.of(
            form, problem.objective, noise_model("iid"), start=start, priors={}, tempering=None
        )
        position = first_walkers(target, start, _DRAWS, np.random.default_rng(0))
    except (SettingError, np.linalg.LinAlgError):
        return None
    values = np.asarray(target.space.values(position)[0])[:, : target.space.n_params]
    return np.asarray(form.to_model(values)), "the Fisher ellipsoid about the fit"


def _drawn_forces(fit: Fit, theta: Floats, test: DamperTest) -> Floats | None:
    """Forces of the draws on a test [N], shape (n_draws, n_time), with nuisance parameters removed as in the fit.

    `None` where too many of them cannot be simulated.
    """
    try:
        forces = simulate_draws(fit.spec, theta, test)
    except SimulationError:
        return None
    if not fit.nuisances:
        return forces
    observed = ObservedTest.of(fit.spec, test, fit.nuisances)
    return np.array([observed.with_nuisance(force)[0] for force in forces])


BANDS = SectionKind(make=_section, absent=ABSENT)


_POINTS = 130
_BAND_POINTS = 260
_ASPECT = 1.4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Banded:
    """A test with the model force and the bands around it, over the samples that count; a band may be missing."""

    prediction: Prediction
    predicted: Band | None = None
    parameters: Band | None = None


def add_bands(axes: Axes, banded: Banded, unit: DisplayUnit, over: Motion | None = None) -> None:
    """Force over one cycle with the bands that exist, over time or along the loop over displacement or velocity."""
    samples, test = middle_cycle(banded.prediction), banded.prediction.test
    across = (test.time if over is None else axis_values(test, over)[0])[test.counted][samples]
    if over is None:
        _fill_over(axes, across, banded, samples, unit, np.zeros(across.size))
    elif banded.predicted is not None:
        _fill_loop(axes, across, banded.predicted, samples, unit)
    _draw_lines(axes, across, banded, samples, unit)


@style.drawn_in_style()
def error_figure(banded: Banded, unit: DisplayUnit) -> Figure:
    """Force minus model force over one cycle from the middle of the record, with the bands that exist."""
    samples, test = middle_cycle(banded.prediction), banded.prediction.test
    time = test.time[test.counted][samples]
    # Four entries of the legend need a second line.
    figure, axes = column_axes(top=0.56)
    residual = banded.prediction.residual[samples]
    ends = [end for band in (banded.predicted, banded.parameters) if band for end in (band.lower, band.upper)]
    largest = max(
        float(np.abs(end - banded.prediction.force).max()) for end in [*ends, banded.prediction.measured]
    )
    unit = style.residual_unit(largest, unit)
    _fill_over(axes, time, banded, samples, unit, banded.prediction.force[samples])
    drawn = _thin(time.size)
    axes.plot(
        time[drawn],
        residual[drawn] * unit.factor,
        color=style.INK,
        linewidth=1.0,
        label=data_label(test),
    )
    finish_signed(axes, f"Force minus model ({unit.symbol})", "Time (s)")
    axes.set_xlim(float(time[0]), float(time[-1]))
    legend(axes, columns=2)
    return figure


@style.drawn_in_style()
def cycle_figure(title: str, measured: Floats, model: Floats, bands: Sequence[Band], factor: float) -> Figure:
    """A quantity of each cycle, shape (n_cycles,), times `factor`, with its bands: bars, narrower for parameters."""
    number = np.arange(1, measured.size + 1)
    figure, axes = small_axes(labelled=True)
    for band in bands:
        lower, upper = band.lower * factor, band.upper * factor
        wide = band.kind == "prediction"
        axes.bar(
            number,
            upper - lower,
            bottom=lower,
            width=0.84 if wide else 0.4,
            color=style.BAND if wide else style.PARAMETER_BAND,
            edgecolor=style.BAND_EDGE if wide else style.PARAMETER_BAND,
            linewidth=0.7,
        )
    axes.plot(number, model * factor, linestyle="none", marker="_", markersize=9, color=style.MODEL)
    draw_points(axes, number, measured * factor, size=3.6, colour=style.INK)
    name_small_axes(axes, title, "Cycle")
    axes.use_sticky_edges = False
    axes.autoscale_view()
    axes.set_xlim(0.3, measured.size + 0.7)
    axes.xaxis.set_major_locator(MaxNLocator(nbins=4, integer=True))
    return figure


def middle_cycle(prediction: Prediction) -> slice:
    """The whole cycle in the middle of the samples that count; all of them where there is none."""
    cycles = whole_cycles(prediction.test.displacement[prediction.test.counted])
    if not cycles:
        return slice(0, prediction.force.size)
    chosen = cycles[len(cycles) // 2]
    return slice(chosen.start, chosen.stop + 1)


@style.drawn_in_style()
def loop_figure(banded: Banded, unit: DisplayUnit, over: Motion) -> Figure:
    """Force over displacement or velocity, one cycle, with its prediction band."""
    figure, axes = column_axes()
    axes.grid(True, axis="both")
    add_bands(axes, banded, unit, over)
    finish_signed(axes, f"Force ({unit.symbol})", axis_values(banded.prediction.test, over)[1])
    legend(axes)
    return figure


def _fill_over(
    axes: Axes, time: Floats, banded: Banded, samples: slice, unit: DisplayUnit, origin: Floats
) -> None:
    """Bands over time, less `origin` [N]."""
    drawn = _thin(time.size)
    for band, colour, width, zorder in (
        (banded.predicted, style.BAND, 0.0, 1.0),
        (banded.parameters, style.PARAMETER_BAND, 0.8, 2.1),
    ):
        if band is None:
            continue
        lower, upper = ((end[samples] - origin)[drawn] * unit.factor for end in (band.lower, band.upper))
        label = _legend_label(band)
        axes.fill_between(
            time[drawn], lower, upper, color=colour, linewidth=width, label=label, zorder=zorder
        )
        for end in (lower, upper) if band is banded.predicted else ():
            axes.plot(time[drawn], end, color=style.BAND_EDGE, linewidth=0.9, linestyle=style.DASHED)


def _fill_loop(axes: Axes, across: Floats, band: Band, samples: slice, unit: DisplayUnit) -> None:
    """A band along the loop: a polygon between each two samples, all of one colour."""
    drawn = _along(across, band.upper[samples])
    lower, upper = (end[samples][drawn] * unit.factor for end in (band.lower, band.upper))
    x = across[drawn]
    # All polygons have the same orientation: overlaps of opposite ones would leave holes.
    left = np.where(x[:-1] <= x[1:], np.arange(x.size - 1), np.arange(1, x.size))
    right = np.where(x[:-1] <= x[1:], np.arange(1, x.size), np.arange(x.size - 1))
    corners = [(left, lower), (right, lower), (right, upper), (left, upper), (left, lower)]
    vertices = np.stack([np.stack([x[at], end[at]], axis=-1) for at, end in corners], axis=1)
    codes = np.tile(
        np.array([Path.MOVETO, Path.LINETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY], dtype=np.uint8),
        len(left),
    )
    axes.add_patch(
        PathPatch(
            Path(vertices.reshape(-1, 2), codes),
            facecolor=style.BAND,
            edgecolor=style.BAND,
            linewidth=0.6,
            label=_legend_label(band),
        )
    )


def _draw_lines(axes: Axes, across: Floats, banded: Banded, samples: slice, unit: DisplayUnit) -> None:
    measured = banded.prediction.measured[samples] * unit.factor
    model = banded.prediction.force[samples] * unit.factor
    line = _along(across, model)
    axes.plot(across[line], model[line], color=style.MODEL, linewidth=1.2, label="model", zorder=2.3)
    drawn = even_samples(across, measured, _POINTS, aspect=_ASPECT)
    label = data_label(banded.prediction.test)
    draw_points(axes, across[drawn], measured[drawn], size=2.6, colour=style.INK, label=label, zorder=2.2)


def _along(across: Floats, up: Floats) -> NDArray[np.intp]:
    """Samples at equal steps along a line, with its end, so that a loop closes."""
    return np.union1d(even_samples(across, up, _BAND_POINTS, aspect=_ASPECT), [across.size - 1])


def _legend_label(band: Band) -> str:
    return f"{100 * band.level:.0f} % {'prediction' if band.kind == 'prediction' else 'parameters'}"


def _thin(count: int) -> NDArray[np.intp]:
    return np.unique(np.linspace(0, count - 1, min(count, _BAND_POINTS)).astype(np.intp))
