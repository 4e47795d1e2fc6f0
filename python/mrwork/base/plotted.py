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
    from mrwork.plots.of_fits import DrawsPlots as DrawsPlots
    from mrwork.plots.of_fits import FitPlots as FitPlots
    from mrwork.plots.of_fits import PredictionPlots as PredictionPlots
    from mrwork.plots.of_fits import ProfilesPlots as ProfilesPlots
    from mrwork.plots.of_fits import RunPlots as RunPlots
    from mrwork.plots.of_fits import TestPlots as TestPlots
    from mrwork.plots.of_studies import BuildingPlots as BuildingPlots
    from mrwork.plots.of_studies import FragilityPlots as FragilityPlots
    from mrwork.plots.of_studies import FrontPlots as FrontPlots
    from mrwork.plots.of_studies import HistoryPlots as HistoryPlots
    from mrwork.plots.of_studies import MotionPlots as MotionPlots
    from mrwork.plots.of_studies import PushoverPlots as PushoverPlots
    from mrwork.plots.of_studies import ResponsesPlots as ResponsesPlots
    from mrwork.plots.of_studies import SpectrumPlots as SpectrumPlots
    from mrwork.plots.of_studies import SuitePlots as SuitePlots


PlotsT = TypeVar("PlotsT")


def plots_of(result: object, name: str) -> PlotsT:  # type: ignore[type-var] # the attribute says which class it is
    """The figures of a result by the name of their class below `mrwork.plots`."""
    module, _, kind = name.partition(".")
    made: PlotsT = getattr(import_module(f"mrwork.plots.{module}"), kind)(result)
    return made
