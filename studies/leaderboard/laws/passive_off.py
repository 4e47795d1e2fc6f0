"""Passive-off: no command.

Authors: mrwork. Reference: Dyke, Spencer, Sain, Carlson, Smart Mater. Struct. 5, 1996, 565-575.
"""

import mrwork as mr
from studies.leaderboard.entries import Motions, Rng


def design(
    building: mr.Building, damper: mr.Device, motions: Motions, hardware: mr.Hardware, rng: Rng
) -> mr.ControlLaw:
    return mr.ControlLaw(name="passive", gains={"command": [0.0]})
