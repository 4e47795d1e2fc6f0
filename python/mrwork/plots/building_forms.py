"""The figures of motions, closed loops, studies and fronts as methods, see `plotted`."""

from __future__ import annotations

from mrwork.base.plotted import Plots, short
from mrwork.plots import of_studies, of_time


class HistoryPlots(Plots):
    """Figures of the history of a closed loop."""

    histories = short(of_time.histories)
    loops = short(of_time.loops)
    commands = short(of_time.commands)
    energies = short(of_studies.energies)


class ResponsesPlots(Plots):
    """Figures of runs of closed loops: a batch, or a study."""

    storey_profiles = short(of_studies.storey_profiles)
    energies = short(of_studies.energies)


class MotionPlots(Plots):
    """Figures of a ground motion."""

    histories = short(of_time.histories)
    spectra = short(of_studies.spectra)


class SpectrumPlots(Plots):
    """Figures of a response spectrum."""

    spectra = short(of_studies.spectra)


class FrontPlots(Plots):
    """Figures of Pareto fronts."""

    fronts = short(of_studies.fronts)
