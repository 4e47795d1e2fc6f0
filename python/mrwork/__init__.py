"""Identify magnetorheological dampers from test records, and control structures with them.

Nothing heavy is loaded until it is used: `import mrwork` costs little more than the interpreter.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mrwork._rust import __version__ as __version__
    from mrwork.coordinates import Box
    from mrwork.errors import MrworkError
    from mrwork.identification.fit import Fit
    from mrwork.identification.identify import identify
    from mrwork.identification.warm_start import start_from
    from mrwork.journal import Journal
    from mrwork.records import DamperTest, read_damper_test, read_damper_tests
    from mrwork.simulate import Loading, simulate_force
    from mrwork.spec import DamperSpec, damper, dampers
    from mrwork.synthetic import synthetic_test
    from mrwork.uncertainty.bands.conformal import Calibration, calibrate
    from mrwork.uncertainty.bands.prediction import Prediction, predict_test
    from mrwork.uncertainty.choice.choose import choose_model
    from mrwork.uncertainty.choice.comparison import Choice
    from mrwork.uncertainty.identifiability.profiling import profile_likelihood
    from mrwork.uncertainty.identifiability.verdicts import identifiability_of
    from mrwork.uncertainty.planning.plan import plan_next_test
    from mrwork.uncertainty.posterior.draws import Draws
    from mrwork.uncertainty.posterior.sample import sample_posterior

_HOME = {
    "Box": "mrwork.coordinates",
    "Calibration": "mrwork.uncertainty.bands.conformal",
    "Choice": "mrwork.uncertainty.choice.comparison",
    "DamperSpec": "mrwork.spec",
    "DamperTest": "mrwork.records",
    "Draws": "mrwork.uncertainty.posterior.draws",
    "Fit": "mrwork.identification.fit",
    "Journal": "mrwork.journal",
    "Loading": "mrwork.simulate",
    "MrworkError": "mrwork.errors",
    "Prediction": "mrwork.uncertainty.bands.prediction",
    "calibrate": "mrwork.uncertainty.bands.conformal",
    "choose_model": "mrwork.uncertainty.choice.choose",
    "damper": "mrwork.spec",
    "dampers": "mrwork.spec",
    "identifiability_of": "mrwork.uncertainty.identifiability.verdicts",
    "identify": "mrwork.identification.identify",
    "plan_next_test": "mrwork.uncertainty.planning.plan",
    "predict_test": "mrwork.uncertainty.bands.prediction",
    "profile_likelihood": "mrwork.uncertainty.identifiability.profiling",
    "read_damper_test": "mrwork.records",
    "read_damper_tests": "mrwork.records",
    "sample_posterior": "mrwork.uncertainty.posterior.sample",
    "simulate_force": "mrwork.simulate",
    "start_from": "mrwork.identification.warm_start",
    "synthetic_test": "mrwork.synthetic",
    "__version__": "mrwork._rust",
}

__all__ = [*_HOME]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        message = f"module 'mrwork' has no attribute {name!r}"
        raise AttributeError(message)
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
