"""Passive-off: no command.

Authors: mrwork. Reference: Dyke, Spencer, Sain, Carlson, Smart Mater. Struct. 5, 1996, 565-575.
"""

from typing import Any

import mrwork as mr


def design(building: Any, damper: Any, motions: Any, hardware: Any, rng: Any) -> Any:
    return mr.ControlLaw(name="passive", gains={"command": [0.0]})
