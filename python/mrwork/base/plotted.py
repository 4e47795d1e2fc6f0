"""The attribute `plot` of results: `fit.plot.loops()` is `mr.plots.loops(fit)`.

Figures know every result and load Matplotlib, so they stand above all, and the package itself gives results this
attribute. `plotted.pyi` says what editors and checkers of types see.
"""


class Plotted:
    """A result with figures, its attribute `plot`."""

    __slots__ = ()
