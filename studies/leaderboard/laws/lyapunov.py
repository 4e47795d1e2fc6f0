"""Lyapunov: the largest command where it takes energy from the frame, else none.

Authors: mrwork. Reference: Jansen, Dyke, J. Eng. Mech. 126(8), 2000, 795-803; the weight is the energy of the frame.
"""

from typing import Any

import mrwork as mr


def design(building: Any, damper: Any, motions: Any, hardware: Any, rng: Any) -> Any:
    problem = mr.control.DesignProblem(building=building, devices=[damper], sample_time=hardware.sample_time)
    return mr.control.design_law("lyapunov", problem, {})
