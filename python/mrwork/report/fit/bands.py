"""The section on bands: what the parameters leave open, and where a measurement of another test will lie."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mrwork.identification.fit import Fit
from mrwork.report import figures
from mrwork.report.comparison import Comparison
from mrwork.report.fit.band_figures import (
    Banded,
    displacement_loop,
    error_figure,
    time_figure,
    velocity_loop,
)
from mrwork.report.fit.coverage import JUDGED, conditions_in_words
from mrwork.report.fit.cycle_panels import cycle_panels
from mrwork.report.fit.parameter_draws import ParameterDraws, drawn_forces
from mrwork.report.fit.phrases import percent
from mrwork.report.fit.section import Group, Section, panel
from mrwork.report.style import DisplayUnit
from mrwork.uncertainty.bands.band import parameter_band, score
from mrwork.uncertainty.bands.calibration_files import StoredBands
from mrwork.uncertainty.bands.conformal import calibrate
from mrwork.uncertainty.bands.prediction import Prediction

# Tests of the fit, and tests left out, that are drawn.
_OWN, _LEFT_OUT = 1, 6


def band_section(
    fit: Fit, comparisons: Sequence[Comparison], draws: ParameterDraws | None, bands: StoredBands | None
) -> Section | None:
    """Bands about a test of the fit and about tests left out; `None` where there are neither draws nor calibration."""
    if draws is None and bands is None:
        return None
    unit = figures.common_force_unit(comparisons)
    groups = [Group(prose=_prose(draws, bands))]
    worst = sorted(comparisons, key=lambda comparison: -comparison.quality.nrmse)[:_OWN]
    for number, each in enumerate(worst, start=1):
        groups += _own_groups(number, fit, each, draws, bands, unit)
    if bands is not None and len(bands.predictions) > 1:
        for number, prediction in enumerate(_chosen(bands), start=1):
            groups += _left_out_groups(number, prediction, bands, unit)
    return Section(anchor="bands", title="Bands", summary=_summary(draws, bands), groups=tuple(groups))


def _summary(draws: ParameterDraws | None, bands: StoredBands | None) -> str:
    if bands is None:
        return "Bands: of the parameters only, none for predictions yet."
    return f"Bands: {bands.calibration.basis}."


def _prose(draws: ParameterDraws | None, bands: StoredBands | None) -> tuple[str, ...]:
    first = (
        "Two different things are drawn. The parameter band (orange, narrow) holds the model's own force for the "
        "parameters that the data allow; it shrinks with more data, and no measurement need lie in it. The prediction "
        "band (light, dashed edges) is to hold the given share of what would be measured."
    )
    if bands is None:
        second = (
            "There is no prediction band yet: `mrwork calibrate RUN TESTS` makes one from tests that the fit has not "
            "seen."
        )
    else:
        names = [conditions_in_words(each.test) for each in bands.predictions] or list(
            bands.calibration.tests
        )
        second = (
            f"The prediction band is {bands.calibration.basis}: {'; '.join(names)}. It holds for excitations and "
            "commands such as these, not beyond."
        )
    return first, second


def _own_groups(
    number: int,
    fit: Fit,
    comparison: Comparison,
    draws: ParameterDraws | None,
    bands: StoredBands | None,
    unit: DisplayUnit,
) -> tuple[Group, Group]:
    prediction = Prediction(test=comparison.test, model_force=comparison.model_force)
    forces = None if draws is None else drawn_forces(fit, draws, comparison.test)
    banded = Banded(
        prediction=prediction,
        predicted=None if bands is None else bands.calibration.band(prediction, JUDGED),
        parameters=None if forces is None else parameter_band(forces[:, comparison.test.counted], JUDGED),
    )
    said = []
    for band in (banded.parameters, banded.predicted):
        if band is not None:
            share = percent(score(band, prediction.measured).coverage)
            said.append(f"{share} % of its samples lie in the 90 % {band.kind} band ({band.basis})")
    origin = "" if draws is None else f" Parameters were drawn from {draws.origin}."
    text = (
        f"The fit knows this test: {'; '.join(said)}. That says nothing of a test it does not know.{origin}"
    )
    errors = [] if bands is None else list(bands.predictions)
    whole = Group(
        title=f"A test of the fit: {comparison.test.name}",
        synthetic=comparison.test.synthetic,
        prose=(text,) if said else (),
        panels=(
            panel(
                f"b{number}-time",
                "Force over one cycle",
                time_figure(banded, unit),
                f"Force over one cycle of test {comparison.test.name} with its bands",
            ),
            panel(
                f"b{number}-error",
                "The same less the model's force",
                error_figure(banded, unit),
                f"Force less the model's over one cycle of test {comparison.test.name} with its bands",
            ),
        ),
    )
    return whole, Group(panels=cycle_panels(f"b{number}", prediction, errors, forces), layout="small")


def _left_out_groups(
    number: int, prediction: Prediction, bands: StoredBands, unit: DisplayUnit
) -> tuple[Group, Group]:
    others = [each for each in bands.predictions if each is not prediction]
    band = calibrate(others, held_out=bands.calibration.held_out).band(prediction, JUDGED)
    banded = Banded(prediction=prediction, predicted=band)
    name = prediction.test.name + (" (synthetic)" if prediction.test.synthetic else "")
    row = bands.row(prediction, JUDGED)
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
        prose=(f"The band is {band.basis}; this one is not among them.",),
        panels=(
            panel(
                f"l{number}-displacement",
                "Force against displacement",
                displacement_loop(banded, unit),
                f"Force against displacement of test {name}, one cycle, with the 90 % prediction band",
                inside,
            ),
            panel(
                f"l{number}-velocity",
                "Force against velocity",
                velocity_loop(banded, unit),
                f"Force against velocity of test {name}, one cycle, with the 90 % prediction band",
                inside,
            ),
        ),
    )
    return whole, Group(panels=cycle_panels(f"l{number}", prediction, others, None), layout="small")


def _chosen(bands: StoredBands) -> list[Prediction]:
    """All, or as many as are drawn: from the worst covered to the best."""

    def covered(prediction: Prediction) -> float:
        row = bands.row(prediction, JUDGED)
        return 0.0 if row is None else row.samples.coverage

    ordered = sorted(bands.predictions, key=covered)
    if len(ordered) <= _LEFT_OUT:
        return list(bands.predictions)
    chosen = np.linspace(0, len(ordered) - 1, _LEFT_OUT).round().astype(int)
    return [ordered[index] for index in chosen]
