"""Figures of results by their attribute `plot`: `fit.plot.loops()` is `mr.plots.loops(fit)`.

Figures know every result and load Matplotlib, so they stand above all: they are named here alone, for checkers of
types, too, and loaded when one is asked for. A class for each kind of result lists the figures that take it, in
`plots/fit_forms` and `plots/building_forms`, which load what their wing needs; `tests/plots` checks the lists against
the annotations of the functions.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from importlib import import_module
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar, cast

if TYPE_CHECKING:
    from mrwork.plots import DrawsPlots as DrawsPlots
    from mrwork.plots import FitPlots as FitPlots
    from mrwork.plots import FrontPlots as FrontPlots
    from mrwork.plots import HistoryPlots as HistoryPlots
    from mrwork.plots import MotionPlots as MotionPlots
    from mrwork.plots import PredictionPlots as PredictionPlots
    from mrwork.plots import ProfilesPlots as ProfilesPlots
    from mrwork.plots import ResponsesPlots as ResponsesPlots
    from mrwork.plots import RunPlots as RunPlots
    from mrwork.plots import SpectrumPlots as SpectrumPlots
    from mrwork.plots import TestPlots as TestPlots

P = ParamSpec("P")
ReturnT = TypeVar("ReturnT")


def plots_of(result: object, name: str) -> Any:
    """The figures of a result by the name of their class in `mrwork.plots`."""
    return getattr(import_module("mrwork.plots"), name)(result)


def short(
    function: Callable[Concatenate[Any, P], ReturnT],
) -> Callable[Concatenate[Any, P], ReturnT]:
    """The function as a method of `Plots`, with the result in the place of the object."""

    @wraps(function)
    def method(plots: Plots, *args: P.args, **named: P.kwargs) -> ReturnT:
        return function(plots.result, *args, **named)

    return cast("Callable[Concatenate[Any, P], ReturnT]", method)


class Plots:
    """Figures of one result."""

    __slots__ = ("result",)

    def __init__(self, result: object) -> None:
        self.result = result

    def __repr__(self) -> str:
        names = ", ".join(name for name in dir(self) if not name.startswith("_") and name != "result")
        return f"Figures of a {type(self.result).__name__}: {names}"
