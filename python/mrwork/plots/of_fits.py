"""Figures of laws, profiles, posterior and bands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, TypeVar

import numpy as np
from matplotlib.axes import Axes

from mrwork.base.arguments import Level
from mrwork.errors import SettingError
from mrwork.identification.fit import Fit
from mrwork.plots import style
from mrwork.plots.canvas import draw_points
from mrwork.plots.fit_drawing import add_corner, add_law, add_profile, label_corner, laws_of, with_unit
from mrwork.plots.of_bands import add_bands
from mrwork.plots.of_tests import axis_name
from mrwork.plots.sheet import (
    GivenAxes,
    Panels,
    axes_for,
    chosen,
    figure,
    finished,
    panels_for,
    triangle_for,
)
from mrwork.runs.load import StoredRun
from mrwork.uncertainty.bands.band import Band
from mrwork.uncertainty.bands.conformal import Calibration, calibrate
from mrwork.uncertainty.bands.prediction import Prediction
from mrwork.uncertainty.identifiability.profile import Profile, Profiles, likelihood_threshold
from mrwork.uncertainty.posterior.draws import Draws

T = TypeVar("T")
# Level of the threshold that a single profile shows.
_LEVEL = 0.95


@figure
def laws(result: Fit | StoredRun, ax: GivenAxes = None, *, parameters: Sequence[str] = ()) -> Panels:
    """Each parameter that follows the command, over the commands of the tests; marks are at the ends of the range.

    Parameters
    ----------
    result
        A fit with current laws.
    ax
        Axes to draw into, one for each parameter; by default those of a new figure.
    parameters
        Parameters of the plain model; by default all that follow the command.

    Raises
    ------
    SettingError
        If no parameter of the fit follows the command, or there are not as many axes as parameters.
    UnknownNameError
        If a parameter does not follow the command.

    Examples
    --------
    >>> import mrwork as mr
    >>> laws = {"f_c": "linear"}
    >>> tests = [mr.synthetic_test(name) for name in ("rd1005_0a", "rd1005_1a")]  # doctest: +SKIP
    >>> mr.identify(mr.damper("bingham").with_current_laws(laws), tests).plot.laws()  # doctest: +SKIP
    """
    fit = result.fit if isinstance(result, StoredRun) else result
    spec = fit.spec
    if spec.current is None:
        raise SettingError(
            f"no parameter of the fit of {fit.model} follows the command; identify "
            "`mr.damper(model).with_current_laws(laws)` from tests at several commands"
        )
    known = {law.parameter.name: law for law in laws_of(fit)}
    drawn = _choose(parameters, known, "parameter that follows the command")
    panels = panels_for(ax, len(drawn), "laws")
    for axes, law in zip(panels, drawn, strict=True):
        add_law(axes, law)
        draw_points(axes, law.commands[[0, -1]], law.values[[0, -1]], size=3.5, colour=style.MODEL)
        ordinate = with_unit(style.symbol_text(law.parameter.name), law.parameter.unit)
        finished(axes, f"Command ({spec.current.unit})", ordinate)
    return panels


@figure
def profiles(
    result: Profiles | Profile | StoredRun,
    ax: GivenAxes = None,
    *,
    parameters: Sequence[str] = (),
) -> Panels:
    """Likelihood ratio over each parameter: threshold dashed, interval shaded, an arrow where it is open.

    Parameters
    ----------
    result
        Profiles, or a run that holds them. The threshold of a single one is that of 95 %.
    ax
        As in `laws`.
    parameters
        Parameters to draw; by default all that were profiled.

    Raises
    ------
    SettingError
        If the run has no profiles, or there are not as many axes as parameters.
    UnknownNameError
        If a parameter was not profiled.

    Examples
    --------
    >>> import mrwork as mr
    >>> profiles = mr.profile(fit, tests)  # doctest: +SKIP
    >>> figure = profiles.plot.profiles()[0].figure  # doctest: +SKIP
    """
    if isinstance(result, StoredRun):
        if result.profiles is None:
            raise _absent(result, "profile likelihoods", "profile", "draw those of `mr.profile(fit, tests)`")
        result = result.profiles
    several = (result,) if isinstance(result, Profile) else result.profiles
    drawn = _choose(parameters, {each.name: each for each in several}, "profiled parameter")
    threshold = likelihood_threshold(_LEVEL) if isinstance(result, Profile) else result.threshold
    panels = panels_for(ax, len(drawn), "profiles")
    for axes, profile in zip(panels, drawn, strict=True):
        add_profile(axes, profile, threshold)
        finished(axes, with_unit(style.symbol_text(profile.name), profile.unit), "Likelihood ratio")
    return panels


@figure
def posterior(result: Draws | StoredRun, ax: GivenAxes = None, *, parameters: Sequence[str] = ()) -> Panels:
    """Densities of the parameters on the diagonal, and of their pairs below it: dark holds 50 %, light 90 %.

    Parameters
    ----------
    result
        Draws, or a run that holds them; a run also marks its fit.
    ax
        Axes to draw into, shape (n_parameters, n_parameters), one alone for a single parameter; by default those of a
        new figure. Axes above the diagonal are switched off.
    parameters
        Parameters to draw; by default all that varied.

    Raises
    ------
    SettingError
        If the run has no draws, or there are not as many axes as densities.
    UnknownNameError
        If a parameter did not vary.

    Examples
    --------
    >>> import mrwork as mr
    >>> draws = mr.sample(fit, tests)  # doctest: +SKIP
    >>> corner = draws.plot.posterior(parameters=["k_w", "rho"])  # doctest: +SKIP
    """
    fitted: dict[str, float] = {}
    if isinstance(result, StoredRun):
        fitted = {each.name: each.value for each in result.fit.estimates}
        if result.draws is None:
            raise _absent(result, "posterior", "sample", "draw that of `mr.sample(fit, tests)`")
        result = result.draws
    drawn = _choose(parameters, {each.name: each for each in result.varied}, "parameter that varied")
    names = [each.name for each in drawn]
    panels = triangle_for(ax, len(names), "posterior")
    lower = {(row, column): panels[row, column] for row, column in np.argwhere(np.tri(len(names))).tolist()}
    add_corner(lower, result, names, fitted)
    for (row, column), axes in lower.items():
        below, left = (with_unit(each.name, each.unit) for each in (drawn[column], drawn[row]))
        label_corner(axes, below if row == len(names) - 1 else "", left if column == 0 < row else "")
    return panels


@figure
def bands(
    result: Prediction | StoredRun,
    ax: Axes | None = None,
    *,
    calibration: Calibration | None = None,
    over: Literal["time", "displacement", "velocity"] = "time",
    test: str | int | None = None,
    level: Level = 0.9,
    legend: bool = True,
) -> Axes:
    """Measured force, model and prediction band over the cycle in the middle of a test.

    Parameters
    ----------
    result
        A prediction, with its `calibration`; or a run with calibrated bands, of which a test that was held out is drawn
        with the band that the others give.
    ax, legend
        As in `histories`.
    calibration
        Calibration of the band of a prediction.
    over
        The abscissa.
    test
        Name or number of the test of a run, by default the first.
    level
        Nominal coverage.

    Raises
    ------
    SettingError
        If there is no calibration, or no such test.

    Examples
    --------
    >>> import mrwork as mr
    >>> calibration = mr.calibrate([mr.predict(fit, other)], held_out="by hand")  # doctest: +SKIP
    >>> axes = mr.predict(fit, next_test).plot.bands(calibration=calibration)  # doctest: +SKIP
    """
    prediction, band = _predict_with_band(result, calibration, test, level)
    axes = axes_for(ax)
    unit = style.force_unit(float(np.abs(prediction.measured).max()))
    add_bands(axes, prediction, band, unit, None if over == "time" else over)
    return finished(axes, axis_name(over), f"Force ({unit.symbol})", legend=legend)


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
        return result, calibration.band(result, level)
    if result.bands is None:
        raise _absent(result, "calibrated band", "calibrate", "draw a prediction with its `calibration`")
    predictions = result.bands.predictions
    prediction = predictions[chosen(test, [each.test.name for each in predictions], "test")]
    others = result.bands.others(prediction) if calibration is None and len(predictions) > 1 else []
    used = calibration or result.bands.calibration
    if others:
        used = calibrate(others, held_out=used.held_out)
    return prediction, used.band(prediction, level)


def _absent(run: StoredRun, what: str, verb: str, otherwise: str) -> SettingError:
    return SettingError(
        f"the run {run.place} has no {what}; add it with `mrwork {verb} {run.place}`, or {otherwise}"
    )


def _choose(asked: Sequence[str], known: Mapping[str, T], what: str) -> list[T]:
    """Those of these names, or all."""
    return [list(known.values())[chosen(name, list(known), what)] for name in asked or known]
