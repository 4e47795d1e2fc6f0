"""The figures of tests, fits and what is known about them as methods, see `plotted`."""

from __future__ import annotations

from mrwork.plots import of_fits, of_time
from mrwork.plotted import Plots, short


class TestPlots(Plots):
    """Figures of a damper test."""

    __test__ = False  # no test of pytest

    histories = short(of_time.histories)
    loops = short(of_time.loops)
    commands = short(of_time.commands)


class PredictionPlots(Plots):
    """Figures of a prediction."""

    histories = short(of_time.histories)
    loops = short(of_time.loops)
    residuals = short(of_time.residuals)
    commands = short(of_time.commands)
    bands = short(of_fits.bands)


class FitPlots(Plots):
    """Figures of a fit."""

    histories = short(of_time.histories)
    loops = short(of_time.loops)
    residuals = short(of_time.residuals)
    commands = short(of_time.commands)
    laws = short(of_fits.laws)


class RunPlots(FitPlots):
    """Figures of a run folder: those of its fit, and of what later verbs have added."""

    profiles = short(of_fits.profiles)
    posterior = short(of_fits.posterior)
    bands = short(of_fits.bands)


class DrawsPlots(Plots):
    """Figures of draws."""

    posterior = short(of_fits.posterior)


class ProfilesPlots(Plots):
    """Figures of profile likelihoods."""

    profiles = short(of_fits.profiles)
