"""The figures of a result as its methods: `fit.plot.loops()` is `mr.plots.loops(fit)`.

A class for each kind of result lists the figures that take it; `tests/plots` checks the lists against the annotations
of the functions.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar, cast

from mrwork.plots import of_buildings, of_fits, of_fronts, of_motions, of_time

P = ParamSpec("P")
ReturnT = TypeVar("ReturnT")


def _short(
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


class TestPlots(Plots):
    """Figures of a damper test."""

    __test__ = False  # no test of pytest

    histories = _short(of_time.histories)
    loops = _short(of_time.loops)
    commands = _short(of_time.commands)


class PredictionPlots(Plots):
    """Figures of a prediction."""

    histories = _short(of_time.histories)
    loops = _short(of_time.loops)
    residuals = _short(of_time.residuals)
    commands = _short(of_time.commands)
    bands = _short(of_fits.bands)


class FitPlots(Plots):
    """Figures of a fit."""

    histories = _short(of_time.histories)
    loops = _short(of_time.loops)
    residuals = _short(of_time.residuals)
    commands = _short(of_time.commands)
    laws = _short(of_fits.laws)


class RunPlots(FitPlots):
    """Figures of a run folder: those of its fit, and of what later verbs have added."""

    profiles = _short(of_fits.profiles)
    posterior = _short(of_fits.posterior)
    bands = _short(of_fits.bands)


class DrawsPlots(Plots):
    """Figures of draws."""

    posterior = _short(of_fits.posterior)


class ProfilesPlots(Plots):
    """Figures of profile likelihoods."""

    profiles = _short(of_fits.profiles)


class HistoryPlots(Plots):
    """Figures of the history of a closed loop."""

    histories = _short(of_time.histories)
    loops = _short(of_time.loops)
    commands = _short(of_time.commands)
    energies = _short(of_buildings.energies)


class ResponsesPlots(Plots):
    """Figures of runs of closed loops: a batch, or a study."""

    storey_profiles = _short(of_buildings.storey_profiles)
    energies = _short(of_buildings.energies)


class MotionPlots(Plots):
    """Figures of a ground motion."""

    histories = _short(of_time.histories)
    spectra = _short(of_motions.spectra)


class SpectrumPlots(Plots):
    """Figures of a response spectrum."""

    spectra = _short(of_motions.spectra)


class FrontPlots(Plots):
    """Figures of Pareto fronts."""

    fronts = _short(of_fronts.fronts)
