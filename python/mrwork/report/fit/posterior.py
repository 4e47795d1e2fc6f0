"""The section on the posterior: marginal and pairwise distributions of the parameters, and convergence of the draws."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mrwork.base.numbers import format_fixed, significant
from mrwork.base.values import Floats
from mrwork.plots import style
from mrwork.plots.canvas import name_above, plain_ticks, small_axes
from mrwork.plots.of_fits import posterior
from mrwork.report.section import Group, Section, panel
from mrwork.runs.load import StoredRun
from mrwork.uncertainty.posterior.draws import LARGEST_RHAT, LEAST_ESS, Draws

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
    for parameter in draws.varied:
        anchor, chain = parameter.name.replace(".", "-").replace("_", "-"), draws.chain(parameter.name)
        made = f"Draws of {parameter.name} in the order in which they were made"
        traces.append(panel(f"trace-{anchor}", "", _trace_figure(parameter.name, chain), made))
        ranked = f"Ranks of the draws of {parameter.name} in four groups of walkers"
        note = (
            f"ESS {format_fixed(parameter.ess_bulk, 0)}, of the tails {format_fixed(parameter.ess_tail, 0)}"
        )
        note += f", R-hat {format_fixed(parameter.rhat, 3)}" if math.isfinite(parameter.rhat) else ""
        ranks.append(
            panel(f"rank-{anchor}", "", _rank_figure(parameter.name, chain, parameter.ess_bulk), ranked, note)
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
    """Quantiles of the walkers over the steps kept, and two of them, of draws (n_walkers, n_kept)."""
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
