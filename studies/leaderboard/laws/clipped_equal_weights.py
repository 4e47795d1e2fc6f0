"""Clipped-optimal with equal weights: all drifts alike, and the weight of the force fixed.

Authors: mrwork. Reference: Dyke, Spencer, Sain, Carlson, Smart Mater. Struct. 5, 1996, 565-575.
"""

from typing import Any

import mrwork as mr


def design(building: Any, damper: Any, motions: Any, hardware: Any, rng: Any) -> Any:
    problem = mr.control.DesignProblem(building=building, devices=[damper], sample_time=hardware.sample_time)
    return mr.control.design_law("clipped_optimal", problem, {"drifts": 1.0, "control_weight": 1e-12})
