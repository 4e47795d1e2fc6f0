"""Figures of results, drawn into axes of yours or new ones; `drawn_data` returns the numbers of any figure as a table.

Each function is a method of the results that it takes: `mr.plots.loops(fit)` is `fit.plot.loops()`. Axes, and their
table, are in the units of their labels, results in SI. Without `ax` a function opens a figure of Matplotlib's pyplot in
the style of the pages, which is yours to save, show and close. With `ax` nothing is opened. Settings of Matplotlib are
never changed.
"""

from mrwork.base.namespace import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
