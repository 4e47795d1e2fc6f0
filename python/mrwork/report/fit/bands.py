"""Bands: the section on the prediction band of another measurement, and the parameter band of the model force."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import get_args

import numpy as np

from mrwork.base.numbers import percent, significant
from mrwork.base.values import Floats
from mrwork.drawing.of_bands import Banded, cycle_figure, error_figure, loop_figure
from mrwork.drawing.of_tests import (
    Comparison,
    Motion,
    common_force_unit,
)
from mrwork.drawing.style import DisplayUnit
from mrwork.errors import RecordError, SettingError, SimulationError
from mrwork.identification.fit import Fit
from mrwork.identification.problem import Problem
from mrwork.identification.residual import ObservedTest
from mrwork.records import DamperTest
from mrwork.report.fit.coverage import (
    ABSENT,
    MAIN_LEVEL,
    conditions_in_words,
    coverage_groups,
    coverage_summary,
)
from mrwork.report.section import Group, Panel, Section, SectionKind, panel
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
