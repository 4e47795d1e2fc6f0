"""Passive-off: no command.

Authors: mrwork. Reference: Dyke, Spencer, Sain, Carlson, Smart Mater. Struct. 5, 1996, 565-575.
"""

from collections.abc import Sequence

import numpy as np

import mrwork as mr


def design(
    building: mr.Building,
    damper: mr.Device,
    motions: Sequence[mr.GroundMotion],
    hardware: mr.Hardware,
    rng: np.random.Generator,
) -> mr.ControlLaw:
    return mr.ControlLaw(name="passive", gains={"command": [0.0]})
