"""Optimal passive: the best constant command on the training motions.

Authors: mrwork. Reference: none. It is the reference of the ratios of this table, too.
"""

from collections.abc import Sequence

import numpy as np

import mrwork as mr
from studies.leaderboard.best_constant import best_constant


def design(
    building: mr.Building,
    damper: mr.Device,
    motions: Sequence[mr.GroundMotion],
    hardware: mr.Hardware,
    rng: np.random.Generator,
) -> mr.ControlLaw:
    return best_constant(building, damper, motions, hardware)
