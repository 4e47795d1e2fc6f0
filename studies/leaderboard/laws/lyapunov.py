"""Lyapunov: the largest command where it takes energy from the frame, else none.

Authors: mrwork. Reference: Jansen, Dyke, J. Eng. Mech. 126(8), 2000, 795-803; the weight is the energy of the frame.
"""

import mrwork as mr
from studies.leaderboard.entries import Motions, Rng


def design(
    building: mr.Building, damper: mr.Device, motions: Motions, hardware: mr.Hardware, rng: Rng
) -> mr.ControlLaw:
    problem = mr.control.DesignProblem(building=building, devices=[damper], sample_time=hardware.sample_time)
    return mr.control.design_law("lyapunov", problem, {})
