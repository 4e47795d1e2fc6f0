"""Identify magnetorheological dampers from test records, and control structures with them.

Nothing heavy is loaded until it is used: `import mrwork` costs little more than the interpreter.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mrwork._rust import __version__ as __version__
    from mrwork.buildings.building import Building
    from mrwork.buildings.published import building
    from mrwork.closed_loop.devices import Device
    from mrwork.closed_loop.hardware import Hardware
    from mrwork.closed_loop.responses import Responses
    from mrwork.closed_loop.simulate import simulate_loop
    from mrwork.control.laws import ControlLaw
    from mrwork.dampers.coordinates import Box
    from mrwork.dampers.spec import DamperSpec, damper, damper_models
    from mrwork.errors import MrworkError
    from mrwork.identification.fit import Fit
    from mrwork.identification.identify import identify
    from mrwork.identification.warm_start import start_from
    from mrwork.motions import GroundMotion, read_motion, read_motions, response_spectrum, synthetic_motion
    from mrwork.records import DamperTest, read_damper_test, read_damper_tests
    from mrwork.simulate import Loading, simulate_force
    from mrwork.store import Journal
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
    "Box": "mrwork.dampers.coordinates",
    "Building": "mrwork.buildings.building",
    "Calibration": "mrwork.uncertainty.bands.conformal",
    "Choice": "mrwork.uncertainty.choice.comparison",
    "ControlLaw": "mrwork.control.laws",
    "DamperSpec": "mrwork.dampers.spec",
    "DamperTest": "mrwork.records",
    "Device": "mrwork.closed_loop.devices",
    "Draws": "mrwork.uncertainty.posterior.draws",
    "Fit": "mrwork.identification.fit",
    "GroundMotion": "mrwork.motions",
    "Hardware": "mrwork.closed_loop.hardware",
    "Journal": "mrwork.store",
    "Loading": "mrwork.simulate",
    "MrworkError": "mrwork.errors",
    "Prediction": "mrwork.uncertainty.bands.prediction",
    "Responses": "mrwork.closed_loop.responses",
    "building": "mrwork.buildings.published",
    "calibrate": "mrwork.uncertainty.bands.conformal",
    "choose_model": "mrwork.uncertainty.choice.choose",
    "damper": "mrwork.dampers.spec",
    "dampers": "mrwork.dampers.spec",
    "identifiability_of": "mrwork.uncertainty.identifiability.verdicts",
    "identify": "mrwork.identification.identify",
    "plan_next_test": "mrwork.uncertainty.planning.plan",
    "predict_test": "mrwork.uncertainty.bands.prediction",
    "profile_likelihood": "mrwork.uncertainty.identifiability.profiling",
    "read_damper_test": "mrwork.records",
    "read_damper_tests": "mrwork.records",
    "read_motion": "mrwork.motions",
    "read_motions": "mrwork.motions",
    "response_spectrum": "mrwork.motions",
    "sample_posterior": "mrwork.uncertainty.posterior.sample",
    "simulate_force": "mrwork.simulate",
    "simulate_loop": "mrwork.closed_loop.simulate",
    "start_from": "mrwork.identification.warm_start",
    "synthetic_motion": "mrwork.motions",
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
