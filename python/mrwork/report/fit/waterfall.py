"""The waterfall of starts: where each descent of the search ended, best first."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mrwork.identification.fit import Fit
from mrwork.identification.multistart import Multistart
from mrwork.report import numbers, style
from mrwork.report.fit.canvas import column_axes
from mrwork.report.fit.section import Panel, panel
from mrwork.report.panels import finish, logarithmic

# A misfit so many times the least is drawn on a logarithmic axis.
_WIDE = 3.0


def waterfall_panel(fit: Fit) -> Panel | None:
    """The misfits at which the descents ended; none for a search that is no descent."""
    ends = np.array([end for end in fit.trace.ends if np.isfinite(end)])
    if ends.size == 0:
        return None
    reached = int(np.count_nonzero(ends <= (1.0 + _closeness(fit)) * ends[0]))
    return panel(
        "starts",
        "Where the descents ended",
        waterfall_figure(ends, reached),
        f"NRMSE at which each of {ends.size} descents ended, best first; {reached} reached the least",
        _note(ends.size, reached),
    )


def waterfall_figure(ends: np.ndarray[tuple[int], np.dtype[np.float64]], reached: int) -> Figure:
    """Misfits in order, shape (n_descents,); the first `reached` are the least misfit."""
    rank = np.arange(1, ends.size + 1)
    with style.drawn_in_style():
        figure, axes = column_axes()
        axes.plot(rank, ends, color=style.RULE, linewidth=1.2, zorder=1)
        for part, colour in ((slice(None, reached), style.MODEL), (slice(reached, None), style.DATA)):
            axes.plot(rank[part], ends[part], linestyle="none", marker="o", markersize=5.5, color=colour)
        finish(axes, "NRMSE")
        if ends[0] > 0.0 and ends[-1] > _WIDE * ends[0]:
            logarithmic(axes, ends)
        else:
            axes.set_ylim(0.0, 1.12 * ends[-1])
        axes.set_xlim(0.4, ends.size + 0.6)
        axes.xaxis.set_major_locator(MaxNLocator(nbins=8, integer=True))
        axes.set_xlabel("Descent, best first")
    return figure


def _note(count: int, reached: int) -> str:
    if count == 1:
        return "One descent tells nothing of other minima."
    share = f"{reached} of {count} descents ended at the least misfit (blue)."
    if reached == 1:
        return f"{share} Nothing confirms that it is the lowest there is: run again with another seed."
    if reached == count:
        return f"{share} No other minimum was met."
    return f"{share} The others ended in other minima or on the way."


def _closeness(fit: Fit) -> float:
    search = fit.settings.search
    return search.closeness if isinstance(search, Multistart) else Multistart().closeness


def descents_in_words(fit: Fit) -> str:
    """How many descents there were and how many reached the least misfit; nothing for another search."""
    ends = [end for end in fit.trace.ends if np.isfinite(end)]
    if not ends:
        return ""
    reached = sum(end <= (1.0 + _closeness(fit)) * ends[0] for end in ends)
    return f"{numbers.fixed(len(ends), 0)}, {numbers.fixed(reached, 0)} at the least misfit"
