"""Clipped-optimal, tuned: the best of 128 random weights on the training motions.

Authors: mrwork. Reference: Dyke, Spencer, Sain, Carlson, Smart Mater. Struct. 5, 1996, 565-575. Drawn are the
weights of floor accelerations, floor velocities and the rate of the damper's elongation, and that of the force.
Their ranges were moved once after a first table, to surround what studies/robust_control found by tuning.
"""

import numpy as np

import mrwork as mr
from studies.leaderboard.best_constant import training_scores
from studies.leaderboard.entries import Motions, Rng

N_PARAMS = 4


def design(
    building: mr.Building, damper: mr.Device, motions: Motions, hardware: mr.Hardware, rng: Rng
) -> mr.ControlLaw:
    problem = mr.control.DesignProblem(building=building, devices=[damper], sample_time=hardware.sample_time)
    settings = [
        mr.control.RegulatorSettings(
            drifts=1.0,
            accelerations=10.0 ** rng.uniform(-11.0, -5.0),
            velocities=10.0 ** rng.uniform(-9.0, -4.0),
            rates=10.0 ** rng.uniform(-6.0, 0.0),
            control_weight=10.0 ** rng.uniform(-16.0, -10.0),
        )
        for _ in range(128)
    ]
    candidates = mr.control.design_candidates("clipped_optimal", problem, settings)
    assert candidates.law is not None
    scores = training_scores(candidates.law, building, damper, motions, hardware)
    best = settings[candidates.designed[int(np.argmin(scores))]]
    return mr.control.design_law("clipped_optimal", problem, best)
