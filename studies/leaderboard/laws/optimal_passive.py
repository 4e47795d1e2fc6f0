"""Optimal passive: the best constant command on the training motions.

Authors: mrwork. Reference: none. It is the reference of the ratios of this table, too.
"""

import mrwork as mr
from studies.leaderboard.best_constant import best_constant
from studies.leaderboard.entries import Motions, Rng


def design(
    building: mr.Building, damper: mr.Device, motions: Motions, hardware: mr.Hardware, rng: Rng
) -> mr.ControlLaw:
    return best_constant(building, damper, motions, hardware)
