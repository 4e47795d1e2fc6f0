"""The study's figures: error traces with their spread, errors against current, costs, reconstructed loops."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, MaxNLocator, NullLocator, StrMethodFormatter

from mrwork.identification import free_run
from mrwork.report import SMALL, WIDE, blank, finish, finish_loop, style, tested_points
from studies.chapter_4.decay import at_budget, evaluations_to
from studies.chapter_4.findings import QUANTILES, Comparison, Trial
from studies.chapter_4.search_cells import Floats
from studies.chapter_4.search_settings import COARSE, EFFICIENT, SEARCHES, STANDARD, SWARM, Model

_BUDGETS = 120

COLOURS = {STANDARD: style.INK, COARSE: style.DATA, EFFICIENT: style.MODEL, SWARM: style.RESIDUAL}
# At these the percentages of a logarithmic axis are written.
_TICKS = (1, 2, 3, 5, 7, 10, 15, 20, 30, 50, 70, 100)


def generation_figure(trial: Trial) -> Figure:
    """Least error against generation: median over the runs and the band of nine in ten."""
    with style.drawn_in_style():
        figure, axes = blank(SMALL)
        for search in SEARCHES:
            best = trial.runs[search].best
            _band(axes, np.arange(best.shape[1]), best, search)
        _finish_trace(axes, trial, "Generation")
    return figure


def simulation_figure(trial: Trial) -> Figure:
    """The same against simulations spent."""
    with style.drawn_in_style():
        figure, axes = blank(SMALL)
        for search in SEARCHES:
            runs = trial.runs[search]
            # Where every run still goes on.
            budgets = np.linspace(runs.evaluations[:, 0].max(), runs.evaluations[:, -1].min(), _BUDGETS)
            _band(axes, budgets / 1e3, at_budget(runs, budgets[:, None]).T, search)
        _finish_trace(axes, trial, "Simulations (thousands)")
    return figure


def error_figure(comparison: Comparison, model: Model) -> Figure:
    """Table 4.2 as a figure: mean error and standard deviation against current."""
    trials = comparison.of(model)
    currents = comparison.tests.currents
    aside = 0.012 * float(np.ptp(currents) or 1.0)
    with style.drawn_in_style():
        figure, axes = blank(WIDE)
        for place, search in enumerate(SEARCHES):
            final = 100.0 * np.array([trial.runs[search].final for trial in trials])
            axes.errorbar(
                currents + (place - 1.5) * aside,
                final.mean(axis=1),
                yerr=final.std(axis=1, ddof=1),
                color=COLOURS[search],
                marker="o",
                markersize=3.5,
                linewidth=1.2,
                elinewidth=1.0,
                capsize=2.5,
                label=search,
            )
        # Room for the legend above the lines.
        axes.set_ylim(0.0, 1.35 * axes.get_ylim()[1])
        axes.legend(loc="upper left", bbox_to_anchor=(0.03, 1.0), ncols=2)
        finish(axes, "Error after the last generation (% NRMSE)", "Current (A)")
    return figure


def reaching_figure(comparison: Comparison, model: Model) -> Figure:
    """Share of the runs at all currents that are at their 95 % error level, against simulations spent."""
    with style.drawn_in_style():
        figure, axes = blank(WIDE)
        for search in SEARCHES:
            cost = np.concatenate(
                [evaluations_to(trial.runs[search], trial.level) for trial in comparison.of(model)]
            )
            reached = np.sort(cost[np.isfinite(cost)])
            end = max(float(trial.runs[search].evaluations[:, -1].max()) for trial in comparison.of(model))
            share = 100.0 * np.arange(reached.size + 1) / cost.size
            axes.step(
                np.concatenate([[0.0], reached, [end]]) / 1e3,
                np.append(share, share[-1]),
                where="post",
                color=COLOURS[search],
                linewidth=1.3,
                label=search,
            )
        axes.set_ylim(0.0, 100.0)
        axes.set_xlim(left=0.0)
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.03))
        finish(axes, "Runs below the 95 % error level (%)", "Simulations (thousands)")
    return figure


def loop_figure(trial: Trial, search: str, *, over_velocity: bool) -> Figure:
    """One cycle as it was tested, and as the best and the median run of a search reconstruct it."""
    runs, test = trial.runs[search], trial.test
    box = trial.model.box(test)
    ranked = runs.ranked
    with style.drawn_in_style():
        figure, axes = blank(SMALL)
        axes.grid(True, axis="both")
        abscissa = 1e3 * (test.velocity if over_velocity else test.displacement)
        cycle = _last_cycle(test.n_time, test.frequency, test.dt)
        tested_points(axes, abscissa, test.force, cycle)
        for place, colour in ((ranked[len(ranked) // 2], style.RESIDUAL), (ranked[0], style.MODEL)):
            force, _ = free_run(trial.model.spec, np.asarray(box.theta_from_unit(runs.unit[place])), test)
            axes.plot(abscissa[cycle], force[cycle], color=colour, linewidth=1.1)
        finish_loop(axes, over_velocity=over_velocity)
    return figure


def _band(axes: Axes, abscissa: Floats, misfit: Floats, search: str) -> None:
    low, middle, high = 100.0 * np.quantile(misfit, QUANTILES, axis=0)
    # A fourth band would hide the others.
    if search != COARSE:
        axes.fill_between(abscissa, low, high, color=COLOURS[search], alpha=0.15, linewidth=0)
    axes.plot(abscissa, middle, color=COLOURS[search], linewidth=1.3)


def _finish_trace(axes: Axes, trial: Trial, abscissa: str) -> None:
    axes.axhline(100.0 * trial.level, color=style.FAINT_INK, linewidth=1.2, linestyle=(0, (1.2, 1.8)))
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    axes.yaxis.set_major_locator(FixedLocator([tick for tick in _TICKS if low <= tick <= high]))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.set_ylim(low, high)
    axes.set_title("Least error (% NRMSE)", loc="left", pad=7)
    axes.set_xlabel(abscissa)
    axes.set_xlim(left=0.0)
    axes.xaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10]))


def _last_cycle(n_time: int, frequency: float | None, dt: float) -> slice:
    """One period at the end of the record, closed."""
    period = round(1.0 / ((frequency or 1.0) * dt))
    return slice(max(0, n_time - 1 - period), n_time)
