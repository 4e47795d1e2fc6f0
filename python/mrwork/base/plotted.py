"""Figures of results by their attribute `plot`: `fit.plot.loops()` is `mr.plots.loops(fit)`.

Figures know every result and load Matplotlib, so they stand above all: they are named here alone, for checkers of
types, too, and loaded when one is asked for. A class for each kind of result lists the figures that take it, in
`plots/of_fits` and `plots/of_studies`, which load what their wing needs; `tests/plots` checks the lists against the
annotations of the functions.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    pass


PlotsT = TypeVar("PlotsT")


def plots_of(result: object, name: str) -> PlotsT:  # type: ignore[type-var] # the attribute says which class it is
    """The figures of a result by the name of their class in `mrwork.plots`."""
    made: PlotsT = getattr(import_module("mrwork.plots"), name)(result)
    return made
