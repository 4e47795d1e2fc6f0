"""Residuals: the section on what the tests of `uncertainty.residual_tests` say, and the figures of one test."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import NormalDist

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator

from mrwork.base.numbers import format_fixed, percent, shortest
from mrwork.base.table import Column, Table
from mrwork.plots import style
from mrwork.plots.canvas import column_axes, draw_points, finish, finish_signed, legend
from mrwork.plots.of_tests import residuals
from mrwork.report.fit.figures import name_of
from mrwork.report.section import Group, Panel, Section, panel
from mrwork.uncertainty.bands.prediction import Prediction, mean_cycle
from mrwork.uncertainty.residual_tests import (
    LAGS,
    LEVEL,
    WINDOWS,
    Excess,
    ResidualTests,
    autocorrelation,
    residual_tests,
)

# Share of the mean square from which on the residuals are called the model's error.
_MOST_BY_NOISE = 0.5
_QUANTILES = 120
_LEAST_LAGS = 40
_LINE_POINTS = 300


def residual_section(predictions: Sequence[Prediction]) -> Section:
    """Tests of the residuals of all tests; the figures of the worst test stand beside it."""
    by_test = [residual_tests(prediction.test, prediction.residual) for prediction in predictions]
    correlated = sum(not of_test.is_white for of_test in by_test)
    repeating = [
        of_test.repeating for of_test in by_test if not of_test.is_white and np.isfinite(of_test.repeating)
    ]
    places = _places(by_test)
    findings = list(places)
    if correlated:
        parts = [f"correlated on {_in_words(correlated, len(by_test))}"]
        if repeating:
            share = float(np.median(repeating))
            most = "more than 99" if 0.99 < share < 1.0 else percent(share, 0)
            parts.append(f"{most} % of their mean square repeats in every cycle")
        findings.insert(0, "; ".join(parts))
        first = (
            "Residuals are correlated from sample to sample: standard errors and bands that count every sample as "
            "independent are too narrow; prediction bands are calibrated on tests that the fit has not seen. "
            f"{_origin(repeating)}"
        )
    elif places:
        first = (
            "The autocorrelation of the residuals is that of white noise, but they are larger at times than at others: "
            "a better model could remove a part of them."
        )
    else:
        constant = all(of_test.has_constant_variance for of_test in by_test)
        first = (
            "These tests do not distinguish the residuals from white noise: they show no error that a better model "
            f"could remove{', and the standard errors in the table of parameters hold' if constant else ''}."
        )
    return Section(
        title="Residuals",
        summary=f"{'; those '.join(findings) or 'consistent with white noise'}.",
        groups=(
            Group(prose=(first, *places.values(), _variance(by_test)), table=_table(predictions, by_test)),
        ),
    )


def _places(by_test: Sequence[ResidualTests]) -> dict[str, str]:
    """Where white noise is rejected because the residuals are larger than elsewhere, with what that means."""
    kinds = (
        (
            "after steps of the command",
            [of_test.after_steps for of_test in by_test],
            "After steps of the command the model does not follow it as the damper does: look at its lag, its laws and "
            "at the times of the recorded command.",
        ),
        (
            "at reversals of the motion",
            [of_test.at_reversals for of_test in by_test],
            "At reversals of the motion the force of the model does not change sides as the damper's does.",
        ),
    )
    places = {}
    for where, excesses, meaning in kinds:
        if ratios := [excess.ratio for excess in excesses if excess.is_found]:
            times = f"{shortest(max(ratios), 2)} times as large as elsewhere"
            several = f"up to {times} on {_in_words(len(ratios), len(by_test))}"
            places[f"{where} are {several if len(by_test) > 1 else times}"] = meaning
    return places


def _variance(by_test: Sequence[ResidualTests]) -> str:
    varying = sum(not of_test.has_constant_variance for of_test in by_test)
    if varying == 0:
        return "The tests show no dependence of their variance on speed or stroke."
    return (
        f"On {_in_words(varying, len(by_test))} their variance depends on speed and stroke: a band of constant width "
        "is too wide in one part of the cycle and too narrow in another."
    )


def _in_words(count: int, total: int) -> str:
    if total == 1:
        return "this test"
    return f"all {total} tests" if count == total else f"{count} of {total} tests"


def _probability(p: float) -> str:
    return "< 0.001" if p < 0.001 else format_fixed(p, 3 if p < 0.1 else 2)


def _origin(repeating: Sequence[float]) -> str:
    """Sentence on whether the residuals are mostly model error, from the share that repeats in every cycle."""
    if not repeating:
        return "Model error and correlated noise cannot be distinguished without repeated cycles."
    if float(np.median(repeating)) > _MOST_BY_NOISE:
        return (
            "What repeats from cycle to cycle is error of the model, not noise. Longer records of the same motion do "
            "not reduce it; another model may."
        )
    return (
        "Most of the residual does not repeat from cycle to cycle, so is not a systematic error of the model."
    )


def _table(predictions: Sequence[Prediction], by_test: Sequence[ResidualTests]) -> Table:
    return Table.of(
        (
            Column("", "test", of=lambda row: name_of(row[0].test)),
            Column("", "lag-1 autocorr.", of=lambda row: format_fixed(row[1].lag_one, 3)),
            Column("", "Ljung-Box p", of=lambda row: _probability(row[1].ljung_box_p)),
            Column(
                "",
                "effective samples",
                of=lambda row: f"{format_fixed(row[1].n_effective, 0)} of {format_fixed(row[1].n_time, 0)}",
            ),
            Column("", "repeats each cycle", "%", of=lambda row: percent(row[1].repeating)),
            Column("", "RMS after steps / elsewhere", of=lambda row: _ratio(row[1].after_steps)),
            Column("", "RMS at reversals / elsewhere", of=lambda row: _ratio(row[1].at_reversals)),
            Column("", "Breusch-Pagan p", of=lambda row: _probability(row[1].breusch_pagan_p)),
            Column("", "RMS fast / slow", of=lambda row: format_fixed(row[1].fast_to_slow, 2)),
            Column("", "excess kurtosis", of=lambda row: format_fixed(row[1].excess, 1)),
        ),
        zip(predictions, by_test, strict=True),
        label="Tests of the residuals",
        note=f"Ljung-Box p: probability that white noise shows at least this autocorrelation over {LAGS} lags. "
        "RMS after steps of the command, and at reversals of the motion: ratio of the RMS residuals there to that "
        f"elsewhere, in windows of {', '.join(map(str, WINDOWS))} samples, of those that differ most; "
        "p: probability that white noise shows at least this difference of ranks. "
        "Breusch-Pagan p: probability that noise of constant variance shows at least this dependence of the squared "
        f"residuals on speed and stroke, counting the effective samples. Below {LEVEL:g} the text reports a "
        "dependence. RMS fast / slow: ratio of the RMS residuals in the faster and the slower half of the samples. "
        "Excess kurtosis is 0 for normal residuals.",
    )


def _ratio(excess: Excess) -> str:
    if np.isnan(excess.p):
        return format_fixed(None, 2)
    p = _probability(excess.p)
    return f"{format_fixed(excess.ratio, 2)} (p {p if p.startswith('<') else f'= {p}'})"


def residual_panels(prediction: Prediction, unit: str) -> tuple[Panel, ...]:
    """Autocorrelation, normal quantiles and course over the cycle of the residual of a test."""
    name = name_of(prediction.test)
    over_cycle, axes = column_axes()
    residuals(prediction, axes, over="phase", unit=unit)
    finish(axes)
    axes.set_xlim(-180, 180)
    axes.xaxis.set_major_locator(FixedLocator([-180, -90, 0, 90, 180]))
    return (
        panel(
            "residual-lag",
            "Autocorrelation of the residual",
            autocorrelation_figure(prediction),
            f"Autocorrelation of the residual against lag, with the limits of white noise, test {name}",
            "White noise stays in the band from the first lag on. A peak at one cycle shows an error that repeats.",
        ),
        panel(
            "residual-normal",
            "Normal quantiles of the residual",
            quantile_figure(prediction),
            f"Quantiles of the residual against quantiles of a normal distribution, test {name}",
            "Normally distributed residuals lie on the line; ends that leave it show more or fewer large errors than "
            "a normal distribution has.",
        ),
        panel(
            "residual-phase",
            "Residual over the cycle",
            over_cycle,
            f"Residual against the phase of the motion, with its mean, test {name}",
            "0° is full extension, ±180° full compression, 90° the largest outward velocity. Where the mean differs "
            "from zero, the model makes the same error in each cycle.",
        ),
    )


def autocorrelation_figure(prediction: Prediction) -> Figure:
    """Autocorrelation over a cycle and a half, with the band that holds 95 % of white noise."""
    test, residual = prediction.test, prediction.residual
    cycle = mean_cycle(test)
    lags = int(min(max(1.5 * cycle, _LEAST_LAGS), residual.size // 2))
    rho = autocorrelation(residual, lags)
    drawn = np.unique(np.linspace(0, lags, _LINE_POINTS).astype(int))
    limit = 1.96 / np.sqrt(residual.size)
    figure, axes = column_axes()
    axes.axhspan(-limit, limit, color=style.BAND, linewidth=0, label="95 % of white noise")
    axes.plot(drawn * test.dt, rho[drawn], color=style.RESIDUAL, linewidth=1.4, label="residual")
    if cycle < lags:
        axes.axvline(cycle * test.dt, color=style.FAINT_INK, linewidth=0.9, linestyle=style.DOTTED)
        axes.annotate(
            "one cycle",
            (cycle * test.dt, 1.1),
            xytext=(-4, 0),
            textcoords="offset points",
            ha="right",
            va="top",
            fontsize=style.SMALL_TEXT_SIZE,
        )
    axes.set_ylim(min(-0.25, float(rho.min()) - 0.08), 1.12)
    axes.set_xlim(0.0, lags * test.dt)
    finish_signed(axes, "Autocorrelation", "Lag (s)")
    legend(axes)
    return figure


def quantile_figure(prediction: Prediction) -> Figure:
    """Sorted residuals over their standard deviation, against normal quantiles."""
    normal = NormalDist()
    residual = np.sort(prediction.residual)
    share = (np.arange(residual.size) + 0.5) / residual.size
    ends = [normal.inv_cdf(share[0]), normal.inv_cdf(share[-1])]
    below = [normal.cdf(value) for value in np.linspace(ends[0], ends[1], _QUANTILES)]
    drawn = np.unique(np.searchsorted(share, below).clip(0, residual.size - 1))
    expected = [normal.inv_cdf(value) for value in share[drawn]]
    standardised = (residual[drawn] - residual.mean()) / (float(np.std(residual)) or 1.0)
    figure, axes = column_axes()
    axes.plot(ends, ends, color=style.FAINT_INK, linewidth=1.0, label="normal")
    draw_points(axes, expected, standardised, size=3.2, colour=style.RESIDUAL, label="residual")
    finish_signed(axes, "Residual / standard deviation", "Normal quantile")
    legend(axes)
    return figure
