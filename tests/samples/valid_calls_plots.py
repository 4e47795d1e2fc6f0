"""Valid calls of figures, for tests that make them wrong."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from plotted_results import RESULTS, calibration
from wrong_arguments import Calls, ValidCall, call

import mrwork as mr
from mrwork import plots


def _exploring() -> ValidCall:
    return call(mr.explore, model="bingham", test=None, theta=mr.damper("bingham").nominal, command=None)


def plots_calls(_: Path) -> Calls:
    """Every figure, into axes that are no one's."""
    axes = Figure().subplots()
    return {
        **({} if find_spec("ipywidgets") is None else {"explore": _exploring}),
        "histories": lambda: call(
            plots.histories, result=RESULTS["Fit"](), ax=axes, test="0.7 A", signal="drift", data=False
        ),
        "loops": lambda: call(
            plots.loops,
            result=RESULTS["History"](),
            ax=axes,
            over="velocity",
            test=None,
            device=1,
            data=False,
        ),
        "residuals": lambda: call(
            plots.residuals, result=RESULTS["Prediction"](), ax=axes, over="velocity", test=0, data=False
        ),
        "commands": lambda: call(
            plots.commands, result=RESULTS["History"](), ax=axes, test=None, device=0, data=False
        ),
        "laws": lambda: call(plots.laws, result=RESULTS["Fit"](), ax=axes, parameters=("f_c",), data=False),
        "profiles": lambda: call(
            plots.profiles, result=RESULTS["Profiles"](), ax=axes, parameters=("k_w",), data=False
        ),
        "posterior": lambda: call(
            plots.posterior, result=RESULTS["Draws"](), ax=axes, parameters=("k_w",), data=False
        ),
        "bands": lambda: call(
            plots.bands,
            result=RESULTS["Prediction"](),
            ax=axes,
            calibration=calibration(),
            over="time",
            test=None,
            level=0.9,
            data=False,
        ),
        "spectra": lambda: call(
            plots.spectra,
            result=RESULTS["GroundMotion"](),
            ax=axes,
            quantity="displacement",
            periods=np.array([0.5, 1.0]),
            damping=0.02,
            data=False,
        ),
        "storey_profiles": lambda: call(
            plots.storey_profiles,
            result=RESULTS["Responses"](),
            ax=axes,
            quantity="peak_drift",
            motion=1,
            rows=(0, "candidate 2"),
            data=False,
        ),
        "energies": lambda: call(
            plots.energies, result=RESULTS["StudyResults"](), ax=axes, motion=0, rows=(0, 1), data=False
        ),
        "fronts": lambda: call(plots.fronts, result=RESULTS["Front"](), ax=axes, law=None, data=False),
    }


ROOMS = (plots_calls,)
