"""The section on the search: convergence of the misfit, minima of the local minimisations, and cost."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from mrwork.base import numbers
from mrwork.base.values import Floats
from mrwork.identification.fit import Fit, SearchTrace
from mrwork.identification.minimise.race import same_minimum
from mrwork.plots import style
from mrwork.plots.canvas import column_axes, draw_points, finish, finish_signed, legend, logarithmic
from mrwork.report.section import Group, Panel, Section, panel

# Ratio of the largest to the least misfit from which the axis of the local minimisations is logarithmic.
_WIDE = 3.0
_NO_BREAK_SPACE = "\N{NO-BREAK SPACE}"


def search_section(fit: Fit) -> Section:
    """The convergence of the search, the misfits of its local minimisations, its results and its cost."""
    reached = "refined to" if fit.refinement_steps else "best fit"
    ends, best = _local_minimisations(fit)
    course = panel(
        "search",
        "Misfit during the search",
        convergence_figure(fit.trace, fit.nrmse if fit.refinement_steps else None),
        f"NRMSE of the best and of the median candidate against simulated candidates, "
        f"{len(fit.trace.evaluations)} generations or iterations, {reached} {numbers.significant(fit.nrmse, 3)}",
    )
    facts = (
        ("Search ended", fit.trace.ended),
        ("Generations or iterations", numbers.format_fixed(len(fit.trace.evaluations), 0)),
        ("Simulated candidates", numbers.format_fixed(fit.evaluations, 0)),
        ("Duration", f"{numbers.significant(fit.seconds, 3)} s"),
    )
    text = f"; {best} of {ends.size} local minimisations ended at the least misfit" if ends.size else ""
    return Section(
        title="Search",
        summary=f"{fit.status_in_words}{text}.",
        groups=(Group(panels=tuple(filter(None, (course, waterfall_panel(fit)))), facts=facts),),
    )


def convergence_figure(trace: SearchTrace, refined: float | None = None) -> Figure:
    """Best and median NRMSE of the population against evaluations; a dotted line marks the refined misfit."""
    figure, axes = column_axes()
    evaluations = np.asarray(trace.evaluations, dtype=np.float64)
    best, median = _positive(trace.best), _positive(trace.median)
    line = partial(axes.plot, evaluations, marker="o" if evaluations.size < 2 else "", markersize=4)
    line(median, color=style.DATA, linewidth=1.5, label="median")
    line(best, color=style.MODEL, linewidth=1.7, label="best")
    shown = [best[np.isfinite(best)], median[np.isfinite(median)]]
    if refined is not None and np.isfinite(refined) and refined > 0:
        axes.axhline(refined, color=style.RESIDUAL, linewidth=1.2, linestyle=style.DOTTED, label="refined")
        shown.append(np.asarray([refined]))
    finish(axes, "NRMSE", "Simulated candidates")
    axes.set_xlim(0, 1.04 * float(evaluations.max(initial=1)))
    axes.xaxis.set_major_locator(MaxNLocator(nbins=5, integer=True))
    axes.xaxis.set_major_formatter(FuncFormatter(_count))
    logarithmic(axes, np.concatenate(shown))
    if evaluations.size == 0:
        axes.text(0.5, 0.5, "no generation was finished", transform=axes.transAxes, ha="center")
    legend(axes)
    return figure


def waterfall_panel(fit: Fit) -> Panel | None:
    """Final misfits of the local minimisations in order; `None` for a search without local minimisations."""
    ends, reached = _local_minimisations(fit)
    if ends.size == 0:
        return None
    rank = np.arange(1, ends.size + 1)
    figure, axes = column_axes()
    axes.plot(rank, ends, color=style.RULE, linewidth=1.2, zorder=1)
    for part, colour in ((slice(None, reached), style.MODEL), (slice(reached, None), style.DATA)):
        draw_points(axes, rank[part], ends[part], size=5.5, colour=colour)
    finish_signed(axes, "NRMSE", "Local minimisation, best first")
    if ends[0] > 0.0 and ends[-1] > _WIDE * ends[0]:
        logarithmic(axes, ends)
    else:
        axes.set_ylim(0.0, 1.12 * ends[-1])
    axes.set_xlim(0.4, ends.size + 0.6)
    axes.xaxis.set_major_locator(MaxNLocator(nbins=8, integer=True))
    words = f"Final NRMSE of each of {ends.size} local minimisations, best first; {reached} reached the least"
    title = "Final misfit of each local minimisation"
    return panel("starts", title, figure, words, _note(ends.size, reached))


def _local_minimisations(fit: Fit) -> tuple[Floats, int]:
    """Final misfits of the local minimisations, best first, and the number that reached the least misfit."""
    ends = np.array([end for end in fit.trace.ends if np.isfinite(end)])
    return ends, int(np.count_nonzero(ends <= same_minimum(ends[0]))) if ends.size else 0


def _note(count: int, reached: int) -> str:
    if count == 1:
        return "A single local minimisation cannot show whether there are other minima."
    share = f"{reached} of {count} local minimisations ended at the least misfit (blue)."
    if reached == 1:
        return f"{share} No other local minimisation confirms it as the global minimum."
    if reached == count:
        return f"{share} No other minimum was found."
    return f"{share} The others ended in other minima, or before they had converged."


def _positive(values: Sequence[float]) -> Floats:
    """Misfits that a logarithmic axis can show; the others leave a gap."""
    misfits = np.asarray(values, dtype=np.float64)
    return np.where(np.isfinite(misfits) & (misfits > 0), misfits, np.nan)


def _count(value: float, _: int | None) -> str:
    # The figure font has the wide no-break space, but not the narrow one.
    text = f"{value:,.0f}"
    return text.replace(",", _NO_BREAK_SPACE if value >= 1e4 else "")
