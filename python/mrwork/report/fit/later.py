"""Sections of a fit's page on what later verbs add: held-out tests, bands, a choice, profiles, posterior, next test."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import get_args

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mrwork.base.numbers import format_fixed, percent, significant
from mrwork.base.summary import list_names
from mrwork.base.values import Floats
from mrwork.plots import style
from mrwork.plots.canvas import (
    SMALL_WIDTH,
    column_axes,
    finish_signed,
    grid_of_axes,
    name_above,
    plain_ticks,
    room_for,
    small_axes,
)
from mrwork.plots.of_fits import bands as draw_bands
from mrwork.plots.of_fits import posterior
from mrwork.plots.of_fits import profiles as draw_profiles
from mrwork.plots.of_tests import Motion
from mrwork.report.fit.agreement import excitation
from mrwork.report.fit.figures import name_of
from mrwork.report.section import Group, Panel, Section, panel
from mrwork.runs.load import StoredRun
from mrwork.uncertainty.bands.calibration_files import StoredBands
from mrwork.uncertainty.bands.conformal import LEVEL, LEVELS, LeftOutCoverage, calibrate
from mrwork.uncertainty.bands.predictions import Predictions
from mrwork.uncertainty.choice.ranking import Ranking
from mrwork.uncertainty.identifiability.profile import Profiles
from mrwork.uncertainty.planning import Plan
from mrwork.uncertainty.posterior.draws import LARGEST_RHAT, LEAST_ESS, Draws

# What later verbs add: the attribute of a run, the title of the section, the command, and what it does.
_LATER = (
    (
        "held_out",
        "Held-out tests",
        "mrwork predict RUN TESTS",
        "predicts tests that the fit has not seen: the evidence of how well it predicts.",
    ),
    (
        "bands",
        "Prediction bands",
        "mrwork calibrate RUN TESTS",
        "calibrates prediction bands from the errors of the fit on tests that it has not seen; without TESTS the run's "
        "own tests are left out in turn.",
    ),
    (
        "ranking",
        "Choice of model or laws",
        "mrwork identify TESTS --model all",
        "compares models on tests that their fits have not seen, and writes a run folder of its own; --law auto also "
        "chooses which parameters follow the command, and by which law.",
    ),
    (
        "profiles",
        "Profile likelihood",
        "mrwork intervals RUN",
        "computes an interval of each parameter by profile likelihood, open where the data set no bound.",
    ),
    (
        "draws",
        "Posterior",
        "mrwork intervals RUN --posterior",
        "samples the posterior of the parameters: credible intervals, and pairs that the data cannot distinguish.",
    ),
    (
        "plan",
        "Next test",
        "mrwork plan RUN",
        "ranks candidates for the next test by how much each would narrow a band.",
    ),
)


def absent_section(run: StoredRun) -> Section | None:
    """The commands that add what this run has not."""
    absent = [(title, command, does) for part, title, command, does in _LATER if getattr(run, part) is None]
    if not absent:
        return None
    prose = "RUN is the folder of this page. A command that takes RUN adds its section to the page."
    facts = tuple((title, f"`{command}` {does}") for title, command, does in absent)
    return Section(
        title="Not in this report yet",
        summary=f"{', '.join(title[:1].lower() + title[1:] for title, *_ in absent)}.",
        groups=(Group(prose=(prose,), facts=facts),),
    )


def held_out_section(held_out: Predictions) -> Section:
    """A table of the held-out tests of every prediction."""
    prose = (
        "Neither the fit nor its calibration has seen these tests; one that is predicted again counts once."
    )
    return Section(
        title="Held-out tests",
        summary=f"{held_out.spread.in_words}.",
        groups=(Group(summary=held_out._summary(), prose=(prose,)),),
    )


# The range of the mean coverage that counts as nominal at each level.
_NOMINAL = {0.5: (0.35, 0.65), LEVEL: (0.8, 0.97), 0.95: (0.87, 0.99)}
# Fewer tests than this are weak evidence for the next.
_FEW_TESTS = 5
# Tests left out that are drawn.
_LEFT_OUT = 3


def bands_section(bands: StoredBands, unit: str) -> Section:
    """Coverage of tests left out, and bands around those that are covered least, in a unit of force."""
    conditions = [
        (prediction.test.name, ", ".join(excitation(prediction.test))) for prediction in bands.predictions
    ]
    names = [f"{name} ({condition})" if condition else name for name, condition in conditions]
    prose = (
        "The prediction band (light blue) should contain the stated share of a measurement. It is "
        f"{bands.calibration.basis}: {'; '.join(names or bands.calibration.tests)}. It is valid for excitations and "
        f"commands like these; known beyond them: {bands.calibration.reach_in_words}.",
        _on_coverage([*bands.by_test.values()]),
    )
    return Section(
        title="Prediction bands",
        summary=coverage_summary(bands),
        groups=(Group(summary=bands._summary(), prose=prose, panels=_left_out_panels(bands, unit)),),
    )


def coverage_summary(bands: StoredBands, held_out: Predictions | None = None) -> str:
    """What the 90 % bands hold of tests kept for test, or else left out, a sentence; of few tests the extremes."""
    shares = [] if held_out is None else [*held_out.coverage]
    tests = "kept for test"
    if not shares:
        shares, tests = [by_level[LEVEL].samples.coverage for by_level in bands.by_test.values()], "left out"
    if not shares:
        return "calibrated on one test, so their coverage is not known."
    span = f"{percent(min(shares), 0)} to {percent(max(shares), 0)} % of the samples of {len(shares)} tests {tests}"
    if len(shares) < _FEW_TESTS:
        return f"the 90 % bands contain {span}: too few tests to rely on."
    return f"the 90 % bands contain {span}, {percent(float(np.mean(shares)), 0)} % on average."


def _on_coverage(tests: Sequence[Mapping[float, LeftOutCoverage]]) -> str:
    """What the coverage of the tests by the bands of every level says about them, beside the summary."""
    if not tests:
        return "A single test cannot be left out of its own calibration. Give `mrwork calibrate` more tests."
    means = {
        level: float(np.mean([by_level[level].samples.coverage for by_level in tests])) for level in LEVELS
    }
    narrow = [f"{100 * level:g} %" for level, (least, _) in _NOMINAL.items() if means[level] < least]
    wide = [f"{100 * level:g} %" for level, (_, most) in _NOMINAL.items() if means[level] > most]
    too_narrow = "too narrow: the errors of these tests differ more than a few tests can show"
    verdicts = (narrow, too_narrow), (wide, "wider than necessary for tests like these")
    texts = [f"The {list_names(levels)} bands are {words}." for levels, words in verdicts if levels]
    if len(tests) < _FEW_TESTS:
        texts.append(f"{len(tests)} tests are too few to tell whether the bands have their nominal coverage.")
    elif not texts:
        texts.append(f"On average over {len(tests)} tests the bands have about their nominal coverage.")
    return " ".join(texts)


def _left_out_panels(bands: StoredBands, unit: str) -> tuple[Panel, ...]:
    shares = {label: by_level[LEVEL].samples.coverage for label, by_level in bands.by_test.items()}
    predictions = [
        prediction
        for prediction in bands.predictions
        if prediction.test.label in shares and bands.others(prediction)
    ]
    panels = []
    for number, prediction in enumerate(
        sorted(predictions, key=lambda prediction: shares[prediction.test.label])[:_LEFT_OUT], 1
    ):
        test = prediction.test
        calibration = calibrate(bands.others(prediction), held_out=bands.calibration.held_out)
        name = name_of(test)
        for over in get_args(Motion):
            figure, axes = column_axes()
            axes.grid(True, axis="both")
            draw_bands(prediction, axes, calibration=calibration, over=over, level=LEVEL, unit=unit)
            finish_signed(axes)
            words = f"Force against {over} of test {name}, one cycle, with the 90 % prediction band"
            held = f"Inside the 90 % band: {percent(shares[test.label])} % of the samples of the whole test."
            panels.append(panel(f"l{number}-{over}", name, figure, words, held))
    return tuple(panels)


_ROW = 0.27
_AROUND = 1.35
# Width beside the names.
_WIDTH = 3.0
# Range [points] below the best that is drawn to scale; worse models are marked at the edge with their number.
_RANGE = 40.0


def ranking_section(ranking: Ranking) -> Section:
    """The sentence, the table and, of models, the figure of a choice, and how its numbers are defined."""
    chosen, of_laws = ranking.chosen_standing, ranking.unit is not None
    provisionally = " provisionally" if chosen.verdict == "provisional" else ""
    panels = []
    if not of_laws:
        predicted = sum(standing.left_out_percent is not None for standing in ranking.standings)
        what = f"Left-out fit of {predicted} models with its standard error; {chosen.title} is chosen{provisionally}"
        note = f"Mean and standard error over {ranking.held_out}."
        panels.append(panel("ranking", "Left-out fit of the models", ranking_figure(ranking), what, note))
    return Section(
        title=f"Choice of {'current laws' if of_laws else 'model'}",
        summary=f"{chosen.in_words}{provisionally} of {len(ranking.standings)} "
        f"{'sets of laws' if of_laws else 'families'}, left-out fit {chosen.left_out_in_words} %.",
        groups=(Group(summary=ranking._summary(), points=ranking.definitions, panels=tuple(panels)),),
    )


def ranking_figure(ranking: Ranking) -> Figure:
    """Left-out fit of every family that has one, best on top, with the number of its parameters."""
    predicted = [standing for standing in ranking.standings if standing.left_out_percent is not None]
    percents = np.array([standing.left_out_percent for standing in predicted], dtype=np.float64)
    errors = np.array([standing.left_out_error or 0.0 for standing in predicted])
    names = [f"{standing.title}, {standing.n_params}" for standing in predicted]
    figure, (axes,) = grid_of_axes(1, 1, (_WIDTH + room_for(names), _AROUND + _ROW * len(predicted)))
    least = float(np.maximum(percents, percents[0] - _RANGE).min())
    margin = 0.06 * max(float(percents[0]) - least, 1.0)
    edge = least - margin
    note = partial(axes.annotate, textcoords="offset points", fontsize=style.SMALL_TEXT_SIZE)
    axes.set_yticks(np.arange(len(predicted)), names)
    labels = axes.get_yticklabels()
    for row, (standing, reached, label) in enumerate(zip(predicted, percents.tolist(), labels, strict=True)):
        label.set_fontweight("bold" if standing.is_chosen else "normal")
        is_good = standing.is_chosen or standing.verdict == "as good"
        colour = style.MODEL if is_good else style.DATA
        if reached < edge:
            axes.plot([edge], [row], marker="<", color=colour, markersize=6, linestyle="none")
            note(f"{format_fixed(reached, 0)} %", (edge, row), xytext=(8, 0), va="center")
            continue
        axes.errorbar(
            reached,
            row,
            xerr=standing.left_out_error,
            fmt="o",
            color=colour,
            markerfacecolor=colour if standing.verdict != "as good" else "white",
            markersize=8.0 if standing.is_chosen else 6.0,
            elinewidth=1.2,
        )
        if is_good:
            note(standing.verdict, (reached, row), xytext=(0, 6), ha="center")
    axes.set_ylim(len(predicted) - 0.4, -0.6)
    axes.set_xlim(edge - margin, min(float((percents + errors).max()) + margin, 100.5))
    axes.grid(visible=True, axis="x")
    axes.xaxis.set_major_locator(MaxNLocator(nbins=7, steps=[1, 2, 2.5, 5, 10]))
    axes.set_xlabel("Left-out fit (%), standard error")
    name_above(axes, "Model, free parameters")
    return figure


_COLUMNS, _HEIGHT = 4, 2.2


def profiles_section(profiles: Profiles) -> Section:
    """Intervals and a figure for each profiled parameter."""
    open_ended = [profile.name for profile in profiles.profiles if profile.interval.is_open]
    count = len(profiles.profiles)
    ends_in_words = f"open for {', '.join(open_ended)}" if open_ended else "closed for every parameter"
    what = f"Likelihood ratio over each of {count} parameters"
    drawn = panel("profiles", "", profiles_figure(profiles), what)
    return Section(
        title="Profile likelihood",
        summary=f"{100 * profiles.level:g} % intervals of {count} parameters, {ends_in_words}.",
        groups=(
            Group(
                title="Likelihood ratio",
                summary=profiles._summary(),
                prose=(
                    "Each panel holds one parameter at values around its estimate and fits all others again. The line "
                    "is the likelihood ratio; the values below the dashed threshold form the "
                    f"{100 * profiles.level:g} % interval (shaded). Where the line does not reach the threshold, the "
                    "data do not bound the parameter on that side.",
                ),
                panels=(drawn,),
                layout="whole",
            ),
        ),
    )


def profiles_figure(profiles: Profiles) -> Figure:
    """Likelihood ratio against each parameter."""
    figure, panels = grid_of_axes(len(profiles.profiles), _COLUMNS, (SMALL_WIDTH, _HEIGHT))
    draw_profiles(profiles, panels)
    return figure


_POINTS = 120
_GROUPS = 4
_RANK_BINS = 16
# Inches of a panel of the corner and of the margins for names; gaps as a share of a panel.
_SIDE, _EDGE, _GAP = 1.35, 0.85, 0.08


def posterior_section(draws: Draws, run: StoredRun) -> Section:
    """Table, trace, ranks and corner of the draws of a run."""
    what = f"Densities of {len(draws.varied)} parameters, alone and in pairs"
    count = len(draws.varied)
    size = count * _SIDE + _EDGE
    figure = Figure(figsize=(size, size))
    within = {"left": _EDGE / size, "right": 0.99, "bottom": _EDGE / size, "top": 0.99}
    gaps = {"hspace": _GAP, "wspace": _GAP}
    posterior(run, np.ravel(figure.subplots(count, count, squeeze=False, gridspec_kw=within | gaps)))
    corner = panel("corner", "", figure, what)
    traces, ranks = [], []
    for summary in draws.varied:
        anchor, chain = summary.name.replace(".", "-").replace("_", "-"), draws.chain(summary.name)
        made = f"Draws of {summary.name} in the order in which they were made"
        traces.append(panel(f"trace-{anchor}", "", _trace_figure(summary.name, chain), made))
        ranked = f"Ranks of the draws of {summary.name} in four groups of walkers"
        note = f"ESS {format_fixed(summary.ess_bulk, 0)}, of the tails {format_fixed(summary.ess_tail, 0)}"
        note += f", R-hat {format_fixed(summary.rhat, 3)}" if math.isfinite(summary.rhat) else ""
        ranks.append(
            panel(f"rank-{anchor}", "", _rank_figure(summary.name, chain, summary.ess_bulk), ranked, note)
        )
    return Section(
        title="Posterior",
        summary=f"{draws.status.replace('_', ' ')} after {draws.n_steps} steps, "
        f"{format_fixed(len(draws.theta), 0)} draws.",
        groups=(
            Group(summary=draws._summary(), prose=_prose(draws)),
            Group(
                title="Parameters in pairs",
                prose=(
                    "The dark region holds 50 % of the draws, the light one 90 %; a cross marks the fit. A narrow, "
                    "inclined region shows that the data determine a combination of the two parameters: report both "
                    "together.",
                ),
                panels=(corner,),
                layout="whole",
            ),
            Group(
                title="Trace",
                prose=(
                    "Median (line) and 5 to 95 % range (band) of all walkers at each draw, with two single walkers in "
                    "grey. A stationary chain looks the same from left to right; a drift means that sampling stopped "
                    "too early.",
                ),
                panels=tuple(traces),
                layout="small",
            ),
            Group(
                title="Ranks",
                prose=(
                    "All draws are ranked together; each line counts the ranks of one of four groups of walkers. Where "
                    "the groups sample the same distribution, 95 % of the counts lie in the band.",
                ),
                panels=tuple(ranks),
                layout="small",
            ),
        ),
    )


def _prose(draws: Draws) -> tuple[str, ...]:
    counted = (
        f"The noise model is {draws.noise_model}. To allow for autocorrelation, the log-likelihood is multiplied by "
        f"{significant(draws.temper, 2)}, the share of effective samples. "
        if draws.temper < 1.0
        else f"The noise model is {draws.noise_model}; every sample counts in full. "
    )
    return (
        f"{draws.n_steps} steps, one of {draws.thinning} kept after the burn-in; the diagnostics refer to the draws "
        f"kept. Required: an effective sample size (ESS) of {LEAST_ESS:g} and an R-hat below {LARGEST_RHAT:g}.",
        f"{counted}The intervals of the parameters hold if the model is right. They do not bound the error of the "
        "force on another test; calibrated prediction bands do.",
    )


def _trace_figure(name: str, chain: Floats) -> Figure:
    steps = np.unique(np.linspace(0, chain.shape[1] - 1, _POINTS).astype(int))
    lower, median, upper = np.quantile(chain[:, steps], [0.05, 0.5, 0.95], axis=0)
    figure, axes = small_axes()
    axes.fill_between(steps, lower, upper, color=style.BAND, linewidth=0)
    for walker in chain[[0, -1]]:
        axes.plot(steps, walker[steps], color=style.DATA, linewidth=0.6)
    axes.plot(steps, median, color=style.MODEL, linewidth=1.3)
    axes.set_xlim(0, max(int(steps[-1]), 1))
    _finish(axes, name, "Draw")
    return figure


def _rank_figure(name: str, chain: Floats, ess: float) -> Figure:
    """Share of each sixteenth of the ranks in four groups of walkers, draws of shape (n_walkers, n_kept)."""
    from scipy.stats import rankdata

    rank = rankdata(chain).reshape(chain.shape) / chain.size
    groups = np.array_split(rank, _GROUPS)
    # A group has a quarter of the effective draws; its counts scatter like counts of independent draws.
    spread = 1.96 * np.sqrt(_RANK_BINS / max(ess / _GROUPS, 1.0))
    figure, axes = small_axes()
    axes.axhspan(1.0 - spread, 1.0 + spread, color=style.BAND, linewidth=0)
    for group, colour in zip(groups, style.HUES, strict=False):
        count, edges = np.histogram(group, bins=_RANK_BINS, range=(0.0, 1.0))
        axes.stairs(count * _RANK_BINS / group.size, edges, color=colour, linewidth=1.1, baseline=None)
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 2.0)
    _finish(axes, name, "Rank")
    return figure


def _finish(axes: Axes, name: str, abscissa: str) -> None:
    name_above(axes, style.symbol_text(name), abscissa)
    axes.yaxis.set_major_locator(MaxNLocator(nbins=3, steps=[1, 2, 2.5, 5, 10]))
    plain_ticks(axes, 5, "y")


_MAP_COLUMNS = 3
_MAP_WIDTH, _MAP_HEIGHT = 3.6, 3.0
# From white to the blue of the models: the darker, the larger the reduction.
_MAP = LinearSegmentedColormap.from_list("gain", [style.PAGE, style.MODEL])
# Where a cell is darker, its number is white.
_DARK = 0.7


def plan_section(plan: Plan) -> Section:
    """The best candidates, and the map of all of them."""
    name = plan.gains[0].candidate.in_words(plan.command_unit)
    what = f"Variance reduction by each of {len(plan.gains)} tests, best {name}"
    drawn = panel("plan", "", plan_figure(plan), what)
    return Section(
        title="Next test",
        summary=f"{name}, of {len(plan.gains)} candidates.",
        groups=(
            Group(
                summary=plan._summary(),
                prose=(
                    "This assumes that the model is valid there; a test in which it is not shows the error of the "
                    "model instead.",
                ),
            ),
            Group(title="All candidates", panels=(drawn,), layout="whole"),
        ),
    )


def plan_figure(plan: Plan) -> Figure:
    """Variance reduction [%] at each amplitude and frequency; the best is framed, other places are blank."""
    commands = sorted({gain.candidate.command for gain in plan.gains}, key=lambda command: command or 0.0)
    most = max(gain.gain for gain in plan.gains)
    width = max(_MAP_WIDTH, style.PANEL_WIDTH / len(commands))
    figure, maps = grid_of_axes(len(commands), _MAP_COLUMNS, (width, _MAP_HEIGHT))
    for axes, command in zip(maps, commands, strict=True):
        gains = [gain for gain in plan.gains if gain.candidate.command == command]
        amplitudes = sorted({gain.candidate.amplitude for gain in gains})
        frequencies = sorted({gain.candidate.frequency for gain in gains})
        table = np.full((len(amplitudes), len(frequencies)), np.nan)
        for gain in gains:
            row = amplitudes.index(gain.candidate.amplitude)
            column, is_best = frequencies.index(gain.candidate.frequency), gain is plan.gains[0]
            table[row, column] = gain.gain
            axes.text(
                column,
                row,
                f"{100.0 * gain.gain:.0f}",
                ha="center",
                va="center",
                fontsize=style.SMALL_TEXT_SIZE,
                fontweight="bold" if is_best else "normal",
                color=style.PAGE if gain.gain > _DARK * most else style.INK,
            )
            if is_best:
                across, up = 0.5 * np.array([[-1, 1, 1, -1, -1], [-1, -1, 1, 1, -1]])
                axes.plot(column + across, row + up, color=style.RESIDUAL, linewidth=2.0, clip_on=False)
        places = range(len(frequencies)), range(len(amplitudes))
        axes.pcolormesh(*places, table, cmap=_MAP, vmin=0.0, vmax=max(most, 1e-12))
        axes.grid(visible=False)
        axes.set_xticks(places[0], [f"{value:.3g}" for value in frequencies])
        axes.set_yticks(places[1], [f"{1e3 * value:.3g}" for value in amplitudes])
        axes.set_xlabel("Frequency (Hz)")
        axes.set_ylabel("Amplitude (mm)")
        title = "Variance reduction (%)"
        name_above(axes, title if command is None else f"{title}, {command:g} {plan.command_unit}")
    return figure
