"""On the rig of chapter 7 noise alone makes laws send current at rest; a dead zone of their command ends it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import mrwork as mr
from mrwork.control import DesignProblem, design_law
from studies.chapter_7.virtual_rig import FRAME, HARDWARE, rd_1005_3

STILL = replace(mr.synthetic_motion(duration=3.0), acceleration=np.zeros(301))
# The offset of the damper moves the frame at first.
SETTLED = 1500


@pytest.mark.parametrize(
    "name", ["lyapunov", "maximum_energy_dissipation", "lyapunov_direct", "mixed_skyhook"]
)
def test_a_dead_zone_makes_the_current_at_rest_zero(name: str) -> None:
    damper = rd_1005_3()
    law = design_law(name, DesignProblem(building=FRAME, devices=[damper], sample_time=1e-3, delay=1e-3))

    def at_rest(law: mr.ControlLaw) -> float:
        found = mr.simulate_loop(FRAME, [damper], law, [STILL], HARDWARE, histories=True)
        assert found.histories is not None
        return float(found.histories[0].command[SETTLED:].mean())

    assert at_rest(law) > 0.15
    # Five times the noise of the estimated velocity.
    assert at_rest(replace(law, dead_zone=5e-3)) == 0.0
