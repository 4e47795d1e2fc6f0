"""Figures 3.16 to 3.23 in form: four models identified from one test of the prototype damper.

The embedded test is simulated with the published Bouc-Wen parameters of Spencer et al. (1997), so that the Bouc-Wen
model is the truth, and the modified one contains it; the second test is one of the static model, which none of the four
contains.
"""

from __future__ import annotations

from typing import Any

import mrwork as mr
from mrwork.report import Table
from studies.former.command import Work
from studies.former.table import Cell, table_of

SHOWN_TEST, OTHER_TEST = "spencer1997", "rd1005_1a"
MODELS = {
    "bingham": "Bingham",
    "extended_bingham": "extended Bingham",
    "bouc_wen": "Bouc-Wen",
    "modified_bouc_wen": "modified Bouc-Wen",
}
NOISE = 8.0
"""Standard deviation of the force noise of embedded tests [N]."""


def identified(work: Work) -> dict[str, dict[str, mr.Fit]]:
    """Fits by test and model; the quick form leaves the second test and the modified Bouc-Wen model out."""
    fits: dict[str, dict[str, mr.Fit]] = {}
    for name in (SHOWN_TEST,) if work.quick else (SHOWN_TEST, OTHER_TEST):
        test, fits[name] = mr.synthetic_test(name), {}
        for model in list(MODELS)[:3] if work.quick else MODELS:
            work.say(f"{name}: {model}")
            fits[name][model] = mr.identify(model, test, rng=0, threads=work.threads)
    return fits


def figures_of(fits: dict[str, dict[str, mr.Fit]]) -> dict[str, dict[str, dict[str, float]]]:
    """Fit percentages and rms errors."""
    return {
        test: {
            model: {
                "fit_percent": fit.fit_percent,
                "rms_n": fit.rmse_n,
                "n_params": float(len(fit.theta)),
            }
            for model, fit in models.items()
        }
        for test, models in fits.items()
    }


def table(found: dict[str, Any]) -> Table:
    """A row for each model."""
    shown = next(iter(found.values()))
    columns: dict[str, Cell] = {"parameters": lambda model: f"{shown[model]['n_params']:.0f}"}
    for name, models in found.items():
        columns[f"{name}: fit [%]"] = lambda model, of=models: f"{of[model]['fit_percent']:.2f}"
        columns[f"{name}: rms error [N]"] = lambda model, of=models: f"{of[model]['rms_n']:.1f}"
    return table_of(
        "Four models on one test (figures 3.16 to 3.23 in form)",
        "model",
        ((MODELS[model], model) for model in shown),
        columns,
        note=f"Synthetic tests, {NOISE:g} N of white noise on the force, and noise on the motion, which adds to it.",
    )
