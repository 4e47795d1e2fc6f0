"""Valid calls of figures, for tests that make them wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from plotted_results import RESULTS, calibration
from wrong_arguments import Calls, calls_with

from mrwork import plots


def plots_calls(_: Path) -> Calls:
    """Every figure, into axes that are no one's."""
    axes = Figure().subplots()
    values = {
        **{"ax": axes, "data": False, "test": None, "signal": "drift", "over": "velocity", "device": 1},
        "motion": 1,
        **{"parameters": ("k_w",), "calibration": calibration(), "level": 0.9, "law": None, "damping": 0.02},
        **{"periods": np.array([0.5, 1.0]), "rows": (0, 1)},
    }
    for figure, result, own in (
        (plots.histories, "Fit", {"test": "0.7 A"}),
        (plots.loops, "History", {}),
        (plots.residuals, "Prediction", {"test": 0}),
        (plots.commands, "History", {"device": 0}),
        (plots.laws, "Fit", {"parameters": ("f_c",)}),
        (plots.profiles, "Profiles", {}),
        (plots.posterior, "Draws", {}),
        (plots.bands, "Prediction", {"over": "time"}),
        (plots.spectra, "GroundMotion", {"quantity": "displacement"}),
        (plots.storey_profiles, "Responses", {"quantity": "peak_drift", "rows": (0, "candidate 2")}),
        (plots.energies, "StudyResults", {"motion": 0}),
        (plots.fronts, "Front", {}),
        (plots.ida, "Fragilities", {"rows": (0,)}),
        (plots.fragility, "Fragilities", {"rows": (0, "Passive-off")}),
    ):
        yield from calls_with({**values, "result": RESULTS[result](), **own}, figure)


ROOMS = (plots_calls,)
