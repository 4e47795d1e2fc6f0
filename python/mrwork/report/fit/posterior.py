"""The section on the posterior: marginal and pairwise distributions of the parameters, and convergence of the draws."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullLocator

from mrwork.base.numbers import format_fixed, rounded_to, significant
from mrwork.base.values import Floats
from mrwork.report import style
from mrwork.report.canvas import axes_between, name_small_axes, plain_ticks, small_axes
from mrwork.report.figures import Comparison
from mrwork.report.fit.parameters import quarter, shown_unit
from mrwork.report.section import Absent, Group, Section, SectionKind, panel
from mrwork.runs.load import StoredRun
from mrwork.uncertainty.posterior.draws import LARGEST_RHAT, LEAST_ESS, Draws, DrawsStatus

_ENDED: dict[DrawsStatus, str] = {
    "converged": "converged after",
    "not_converged": "not converged after",
    "interrupted": "interrupted after",
}
_POINTS = 120
_GROUPS = 4
_RANK_BINS = 16
_GROUP_COLOURS = (style.MODEL, style.RESIDUAL, style.FAINT_INK, style.PARAMETER_BAND)
# Of the corner: inches of a panel, cells of a density and their smoothing.
_SIDE, _EDGE, _BELOW = 1.35, 0.85, 0.65
_CELLS = 32
_SMOOTH = 1.2


def _section(run: StoredRun, _: Sequence[Comparison]) -> Section | None:
    """Table, trace, ranks and corner of the draws of a run."""
    draws = run.draws
    if draws is None:
        return None
    estimates = {each.name: each.value for each in run.fit.estimates}
    corner = panel(
        "corner",
        "",
        corner_figure(draws, estimates),
        f"Densities of {len(draws.varied)} parameters, alone and in pairs",
    )
    traces, ranks = [], []
    for each in draws.varied:
        anchor, chain = each.name.replace(".", "-").replace("_", "-"), draws.chain(each.name)
        made = f"Draws of {each.name} in the order in which they were made"
        shown = rounded_to(quarter(each.median, each.lower, each.upper))
        span = f"median {shown(each.median)}, {shown(each.lower)} to {shown(each.upper)}"
        remark = each.reason or each.remark
        note = f"{span} {shown_unit(each.unit)}".rstrip() + (f"; {remark}" if remark else "")
        traces.append(panel(f"trace-{anchor}", "", trace_figure(each.name, chain), made, note))
        ranked = f"Ranks of the draws of {each.name} in four groups of walkers"
        note = f"ESS {format_fixed(each.ess_bulk, 0)}, of the tails {format_fixed(each.ess_tail, 0)}"
        note += f", R-hat {format_fixed(each.rhat, 3)}" if math.isfinite(each.rhat) else ""
        ranks.append(panel(f"rank-{anchor}", "", rank_figure(each.name, chain, each.ess_bulk), ranked, note))
    return Section(
        anchor="posterior",
        title="Posterior",
        summary=f"{_ENDED[draws.status]} {draws.n_steps} steps, {format_fixed(len(draws.theta), 0)} draws.",
        groups=(
            Group(prose=_prose(draws)),
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
                    "grey; below, the median and the 95 % interval of all draws. A stationary chain looks the same "
                    "from left to right; a drift means that sampling stopped too early.",
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
        draws.verdict,
        f"{draws.n_steps} steps, one of {draws.thinning} kept after the burn-in; the diagnostics refer to the draws "
        f"kept. Required: an effective sample size (ESS) of {LEAST_ESS:g} and an R-hat below {LARGEST_RHAT:g}.",
        f"{counted}The intervals of the parameters hold if the model is right. They do not bound the error of the "
        "force on another test; calibrated prediction bands do.",
    )


@style.drawn_in_style()
def trace_figure(name: str, chain: Floats) -> Figure:
    """Quantiles of the walkers over the steps kept, and two of them, of draws (n_walkers, n_kept)."""
    kept = np.unique(np.linspace(0, chain.shape[1] - 1, _POINTS).astype(int))
    lower, median, upper = np.quantile(chain[:, kept], [0.05, 0.5, 0.95], axis=0)
    figure, axes = small_axes(labelled=True)
    axes.fill_between(kept, lower, upper, color=style.BAND, linewidth=0)
    for walker in chain[[0, -1]]:
        axes.plot(kept, walker[kept], color=style.DATA, linewidth=0.6)
    axes.plot(kept, median, color=style.MODEL, linewidth=1.3)
    axes.set_xlim(0, max(int(kept[-1]), 1))
    _finish(axes, name, "Draw")
    return figure


@style.drawn_in_style()
def rank_figure(name: str, chain: Floats, ess: float) -> Figure:
    """Share of each sixteenth of the ranks in four groups of walkers, draws of shape (n_walkers, n_kept)."""
    from scipy.stats import rankdata

    rank = rankdata(chain).reshape(chain.shape) / chain.size
    groups = np.array_split(rank, _GROUPS)
    # A group has a quarter of the effective draws; its counts scatter like those of independent draws.
    spread = 1.96 * np.sqrt(_RANK_BINS / max(ess / _GROUPS, 1.0))
    figure, axes = small_axes(labelled=True)
    axes.axhspan(1.0 - spread, 1.0 + spread, color=style.BAND, linewidth=0)
    for group, colour in zip(groups, _GROUP_COLOURS, strict=True):
        count, edges = np.histogram(group, bins=_RANK_BINS, range=(0.0, 1.0))
        axes.stairs(count * _RANK_BINS / group.size, edges, color=colour, linewidth=1.1, baseline=None)
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 2.0)
    _finish(axes, name, "Rank")
    return figure


@style.drawn_in_style()
def corner_figure(draws: Draws, fitted: Mapping[str, float]) -> Figure:
    """Density of every parameter on the diagonal, of every pair below it; a cross where the fit is."""
    names = [each.name for each in draws.varied]
    count = len(names)
    size = count * _SIDE + _EDGE
    figure = Figure(figsize=(size, size - _EDGE + _BELOW + 0.1))
    panels = {}
    for row, column in np.argwhere(np.tri(count)).tolist():
        left, bottom = _EDGE + column * _SIDE, _BELOW + (count - 1 - row) * _SIDE
        panels[row, column] = axes_between(
            figure, left=left, right=left + _SIDE - 0.1, bottom=bottom, top=bottom + _SIDE - 0.1
        )
    add_corner(panels, draws, names, fitted)
    for (row, column), axes in panels.items():
        label_corner(axes, names[column] if row == count - 1 else "", names[row] if column == 0 < row else "")
    return figure


def add_corner(
    panels: Mapping[tuple[int, int], Axes],
    draws: Draws,
    names: Sequence[str],
    fitted: Mapping[str, float],
) -> None:
    """Densities of these parameters and their pairs, in axes by row and column of the lower triangle."""
    values = [draws.chain(name).reshape(-1) for name in names]
    # Single outliers would compress the rest.
    spans = [tuple(np.quantile(each, [0.002, 0.998]).tolist()) for each in values]
    for (row, column), axes in panels.items():
        if row == column:
            _density(axes, values[row], spans[row], fitted.get(names[row]))
        else:
            at = (fitted.get(names[column]), fitted.get(names[row]))
            _pair(axes, values[column], values[row], spans[column], spans[row], at)


def _density(axes: Axes, values: Floats, span: tuple[float, float], fitted: float | None) -> None:
    count, edges = np.histogram(values, bins=_CELLS, range=span)
    axes.stairs(count, edges, fill=True, color=style.BAND_EDGE)
    if fitted is not None:
        axes.axvline(fitted, color=style.RESIDUAL, linewidth=1.0)
    axes.set_xlim(*span)
    axes.set_ylim(0.0, 1.08 * count.max())
    axes.yaxis.set_major_locator(NullLocator())


def _pair(
    axes: Axes,
    first: Floats,
    second: Floats,
    across: tuple[float, float],
    up: tuple[float, float],
    fitted: tuple[float | None, float | None],
) -> None:
    from scipy.ndimage import gaussian_filter

    count, x, y = np.histogram2d(first, second, bins=_CELLS, range=(across, up))
    smooth = gaussian_filter(count, _SMOOTH)
    ordered = np.sort(smooth.ravel())[::-1]
    held = np.cumsum(ordered) / ordered.sum()
    levels = [float(ordered[np.searchsorted(held, share)]) for share in (0.9, 0.5)]
    if levels[0] < levels[1] < ordered[0]:
        centres = (0.5 * (x[:-1] + x[1:]), 0.5 * (y[:-1] + y[1:]))
        colours = ListedColormap([style.BAND, style.BAND_EDGE])
        axes.contourf(*centres, smooth.T, levels=[*levels, ordered[0] * 1.01], cmap=colours)
    if fitted[0] is not None and fitted[1] is not None:
        axes.plot(fitted[0], fitted[1], marker="+", markersize=8, markeredgewidth=1.2, color=style.RESIDUAL)
    axes.set_xlim(*across)
    axes.set_ylim(*up)


def label_corner(axes: Axes, below: str, left: str) -> None:
    """Names below and left of axes of a corner, where they are not empty, with few ticks."""
    axes.grid(False)
    axes.tick_params(labelbottom=bool(below), labelleft=bool(left))
    axes.set(xlabel=style.symbol_text(below), ylabel=style.symbol_text(left))
    for axis, name in ((axes.xaxis, below), (axes.yaxis, left)):
        if name:
            axis.set_major_locator(MaxNLocator(nbins=2, steps=[1, 2, 4, 5, 10], prune="both"))
    plain_ticks(axes, 4, "x")
    plain_ticks(axes, 4, "y")


def _finish(axes: Axes, name: str, abscissa: str) -> None:
    name_small_axes(axes, style.symbol_text(name), abscissa)
    axes.yaxis.set_major_locator(MaxNLocator(nbins=3, steps=[1, 2, 2.5, 5, 10]))
    plain_ticks(axes, 5, "y")


POSTERIOR = SectionKind(
    make=_section,
    absent=Absent(
        title="Posterior",
        command="mrwork sample RUN",
        description="samples the posterior of the parameters: credible intervals, and pairs that the data cannot "
        "distinguish.",
    ),
)
