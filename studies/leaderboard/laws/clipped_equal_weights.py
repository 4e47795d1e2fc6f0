"""Clipped-optimal with equal weights: all drifts alike, and the weight of the force fixed.

Authors: mrwork. Reference: Dyke, Spencer, Sain, Carlson, Smart Mater. Struct. 5, 1996, 565-575.
"""

import mrwork as mr
from studies.leaderboard.entries import Motions, Rng


def design(
    building: mr.Building, damper: mr.Device, motions: Motions, hardware: mr.Hardware, rng: Rng
) -> mr.ControlLaw:
    problem = mr.control.DesignProblem(building=building, devices=[damper], sample_time=hardware.sample_time)
    return mr.control.design_law("clipped_optimal", problem, {"drifts": 1.0, "control_weight": 1e-12})
