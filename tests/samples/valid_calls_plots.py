"""Valid calls of figures, for tests that make them wrong."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from plotted_results import RESULTS, calibration
from wrong_arguments import Calls, call

import mrwork as mr
from mrwork import plots


def plots_calls(_: Path) -> Calls:
    """Every figure, into axes that are no one's."""
    axes = Figure().subplots()
    if find_spec("ipywidgets"):
        yield call(mr.explore, model="bingham", test=None, theta=mr.damper("bingham").nominal, command=None)
    yield call(plots.histories, result=RESULTS["Fit"](), ax=axes, test="0.7 A", signal="drift", data=False)
    yield call(
        plots.loops, result=RESULTS["History"](), ax=axes, over="velocity", test=None, device=1, data=False
    )
    yield call(plots.residuals, result=RESULTS["Prediction"](), ax=axes, over="velocity", test=0, data=False)
    yield call(plots.commands, result=RESULTS["History"](), ax=axes, test=None, device=0, data=False)
    yield call(plots.laws, result=RESULTS["Fit"](), ax=axes, parameters=("f_c",), data=False)
    yield call(plots.profiles, result=RESULTS["Profiles"](), ax=axes, parameters=("k_w",), data=False)
    yield call(plots.posterior, result=RESULTS["Draws"](), ax=axes, parameters=("k_w",), data=False)
    yield call(
        plots.bands,
        result=RESULTS["Prediction"](),
        ax=axes,
        calibration=calibration(),
        over="time",
        test=None,
        level=0.9,
        data=False,
    )
    yield call(
        plots.spectra,
        result=RESULTS["GroundMotion"](),
        ax=axes,
        quantity="displacement",
        periods=np.array([0.5, 1.0]),
        damping=0.02,
        data=False,
    )
    yield call(
        plots.storey_profiles,
        result=RESULTS["Responses"](),
        ax=axes,
        quantity="peak_drift",
        motion=1,
        rows=(0, "candidate 2"),
        data=False,
    )
    yield call(plots.energies, result=RESULTS["StudyResults"](), ax=axes, motion=0, rows=(0, 1), data=False)
    yield call(plots.fronts, result=RESULTS["Front"](), ax=axes, law=None, data=False)


ROOMS = (plots_calls,)
