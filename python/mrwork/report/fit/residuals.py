"""The section on residuals: whether what the model leaves is noise, and what follows if it is not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from mrwork.report import figures, numbers
from mrwork.report.comparison import Comparison
from mrwork.report.fit.phrases import most_of, percent, probability, tests_of
from mrwork.report.fit.residual_figures import (
    autocorrelation_figure,
    displacement_figure,
    phase_figure,
    quantile_figure,
    velocity_figure,
)
from mrwork.report.fit.residual_tests import LAGS, LEVEL, ResidualTests, residual_tests
from mrwork.report.fit.section import Group, Panel, Section, Table, panel, table

# Figures of more tests than this make a page that nobody reads: then those of the worst are drawn.
_DRAWN = 2
# Share of the mean square from which on the residuals are called the model's error.
_MOST = 0.5


def residual_section(comparisons: Sequence[Comparison]) -> Section:
    """Tests of the residuals of all tests, with figures of the worst fitted."""
    found = [residual_tests(comparison) for comparison in comparisons]
    worst = sorted(range(len(comparisons)), key=lambda index: -comparisons[index].quality.nrmse)[:_DRAWN]
    drawn = [
        Group(
            title=comparisons[index].test.name,
            synthetic=comparisons[index].test.synthetic,
            panels=_panels(index + 1, comparisons[index], found[index], comparisons),
        )
        for index in sorted(worst)
    ]
    return Section(
        anchor="residuals",
        title="Residuals",
        summary=_summary(found),
        groups=(
            Group(prose=_prose(found), table=_table(comparisons, found)),
            *(
                (Group(prose=(f"Drawn are the {_DRAWN} tests that the model fits worst.",)),)
                if len(comparisons) > _DRAWN
                else ()
            ),
            *drawn,
        ),
    )


def _summary(found: Sequence[ResidualTests]) -> str:
    coloured = sum(not each.is_white for each in found)
    if coloured == 0:
        return "Residuals: nothing speaks against white noise."
    repeating = _repeating(found)
    said = f"Residuals: correlated on {tests_of(coloured, len(found))}"
    if not repeating:
        return f"{said}."
    return f"{said}; {most_of(float(np.median(repeating)))} % of their mean square comes back in every cycle."


def _repeating(found: Sequence[ResidualTests]) -> list[float]:
    """What repeats of the residuals that are not noise, where that is known."""
    return [each.repeating for each in found if not each.is_white and np.isfinite(each.repeating)]


def _prose(found: Sequence[ResidualTests]) -> tuple[str, ...]:
    coloured = sum(not each.is_white for each in found)
    uneven = sum(not each.is_even for each in found)
    if coloured == 0:
        first = (
            "The residuals are what independent noise would be, as far as these tests can tell: nothing is left that a "
            "better model could be seen to take, and the standard errors among the parameters hold."
        )
    else:
        first = (
            f"On {tests_of(coloured, len(found))} neighbouring residuals are alike, which independent noise is not. "
            "Standard errors and bands that count every sample as independent are then too narrow; bands that hold are "
            f"calibrated on tests that the fit has not seen. {_origin(_repeating(found))}"
        )
    if uneven == 0:
        second = "Their size does not depend on speed or stroke as far as these samples tell."
    else:
        second = (
            f"On {tests_of(uneven, len(found))} their size depends on speed and stroke: a band of one width is too "
            "wide in one part of the cycle and too narrow in another."
        )
    return first, second


def _origin(repeating: Sequence[float]) -> str:
    """Whether it is the model that errs, as far as cycles tell."""
    if not repeating:
        return "Whether it is the model that errs or noise that remembers cannot be told without cycles that repeat."
    low, high = most_of(min(repeating)), most_of(max(repeating))
    span = low if low == high else f"between {low} and {high}"
    text = f"From cycle to cycle {span} % of their mean square stays the same"
    if float(np.median(repeating)) > _MOST:
        return (
            f"{text}: that is error of the model, not noise. Longer records of the same motion do not reduce it, "
            "another model may."
        )
    return f"{text}: most of what is left is no error that the model makes in each cycle."


def _table(comparisons: Sequence[Comparison], found: Sequence[ResidualTests]) -> Table:
    return table(
        label="Tests of the residuals",
        columns=(
            "Test",
            "Lag-1 autocorr.",
            "Ljung-Box p",
            "Independent samples",
            "Same every cycle (%)",
            "Even size p",
            "RMS fast / slow",
            "Excess kurtosis",
        ),
        rows=tuple(
            (
                comparison.test.name,
                numbers.fixed(each.lag_one, 3),
                probability(each.white_p),
                f"{numbers.fixed(each.n_effective, 0)} of {numbers.fixed(each.n_time, 0)}",
                percent(each.repeating),
                probability(each.even_p),
                numbers.fixed(each.fast_to_slow, 2),
                numbers.fixed(each.excess, 1),
            )
            for comparison, each in zip(comparisons, found, strict=True)
        ),
        note=f"Ljung-Box: probability of so much autocorrelation over {LAGS} lags in white noise. Even size: "
        "probability of squared residuals that depend so much on speed and stroke in noise of one size (Breusch-Pagan, "
        f"counting the independent samples only). Below {LEVEL:g} the text speaks of a dependence. RMS fast / slow: "
        "residuals in the faster half of the samples over those in the slower half. Excess kurtosis is 0 for "
        "normal residuals.",
    )


def _panels(
    number: int, comparison: Comparison, found: ResidualTests, comparisons: Sequence[Comparison]
) -> tuple[Panel, ...]:
    unit = figures.common_force_unit(comparisons)
    name = comparison.test.name + (" (synthetic)" if comparison.test.synthetic else "")

    def of(suffix: str, title: str, figure: Figure, what: str, note: str = "") -> Panel:
        return panel(f"r{number}-{suffix}", title, figure, f"{what}, test {name}", note)

    return (
        of(
            "lag",
            "Autocorrelation of the residual",
            autocorrelation_figure(comparison),
            "Autocorrelation of the residual against lag, with the limits of white noise",
            "Noise would stay in the band from the first lag on. A peak at one cycle is error that comes back."
            if not found.is_white
            else "The residual stays where noise would.",
        ),
        of(
            "normal",
            "Normal quantiles",
            quantile_figure(comparison),
            "Quantiles of the residual against those of a normal distribution",
            "On the line the residuals are normal; ends that bend away from it are large errors, more or fewer "
            "than normal ones would have.",
        ),
        of(
            "phase",
            "Residual over the cycle",
            phase_figure(comparison, unit),
            "Residual against the phase of the motion, with its mean",
            "0° is full extension, ±180° full compression, 90° the fastest outward. Where the mean leaves zero "
            "the model errs in the same way each cycle.",
        ),
        of(
            "displacement",
            "Residual over displacement",
            displacement_figure(comparison, unit),
            "Residual against displacement, with its mean",
        ),
        of(
            "velocity",
            "Residual over velocity",
            velocity_figure(comparison, unit),
            "Residual against velocity, with its mean",
        ),
    )
