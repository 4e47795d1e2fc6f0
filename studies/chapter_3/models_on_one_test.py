"""Figures 3.16 to 3.23 in form: four models identified from one test of the prototype damper.

The embedded test is simulated with the published Bouc-Wen parameters of Spencer et al. (1997), so that the Bouc-Wen
model is the truth, and the modified one contains it; the second test is one of the static model, which none of the four
contains.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mrwork as mr
from mrwork.report import Table

SHOWN_TEST, OTHER_TEST = "spencer1997", "rd1005_1a"
MODELS = {
    "bingham": "Bingham",
    "extended_bingham": "extended Bingham",
    "bouc_wen": "Bouc-Wen",
    "modified_bouc_wen": "modified Bouc-Wen",
}
NOISE = 8.0
"""Standard deviation of the force noise of embedded tests [N]."""


def identified(*, quick: bool, threads: int, say: Callable[[str], None]) -> dict[str, dict[str, mr.Fit]]:
    """Fits by test and model; the quick form leaves the second test and the modified Bouc-Wen model out."""
    fits: dict[str, dict[str, mr.Fit]] = {}
    for name in (SHOWN_TEST,) if quick else (SHOWN_TEST, OTHER_TEST):
        test, fits[name] = mr.synthetic_test(name), {}
        for model in list(MODELS)[:3] if quick else MODELS:
            say(f"{name}: {model}")
            fits[name][model] = mr.identify(model, test, rng=0, threads=threads)
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
    models = list(dict.fromkeys(model for test in found.values() for model in test))
    return Table(
        title="Four models on one test (figures 3.16 to 3.23 in form)",
        columns=(
            "model",
            "parameters",
            *(f"{test}: {what}" for test in found for what in ("fit [%]", "rms error [N]")),
        ),
        rows=tuple(
            (
                MODELS[model],
                f"{next(iter(found.values()))[model]['n_params']:.0f}",
                *(
                    text
                    for test in found.values()
                    for text in (f"{test[model]['fit_percent']:.2f}", f"{test[model]['rms_n']:.1f}")
                ),
            )
            for model in models
        ),
        note=f"Synthetic tests, {NOISE:g} N of white noise on the force, and noise on the motion, which adds to it.",
    )
