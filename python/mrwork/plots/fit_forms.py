"""The figures of tests, fits and what is known about them as methods, see `plotted`."""

from __future__ import annotations

from mrwork.base.plotted import Plots, short
from mrwork.plots import of_fits, of_time


class TestPlots(Plots):
    """Figures of a damper test."""

    __test__ = False  # no test of pytest

    histories = short(of_time.histories)
    loops = short(of_time.loops)
    commands = short(of_time.commands)


class PredictionPlots(TestPlots):
    """Figures of a prediction: those of its test, and of the force of the model beside it."""

    residuals = short(of_time.residuals)
    bands = short(of_fits.bands)


class FitPlots(TestPlots):
    """Figures of a fit: those of its tests, and of its model."""

    residuals = short(of_time.residuals)
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
