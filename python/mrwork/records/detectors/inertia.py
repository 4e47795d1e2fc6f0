"""Moving mass between the load cell and the damper, seen as force in phase with the acceleration."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.records.cycles import whole_cycles
from mrwork.records.damper_test import DamperTest, Finding, Measured
from mrwork.records.motion import motion_of

_FEWEST_CYCLES: Final = 2
_SIGNIFICANT: Final = 4.0
# Inertia of less than this share of the force's half range is no matter.
_SHARE: Final = 0.02


def moving_mass(test: DamperTest) -> Measured | None:
    """Least mass that the load cell must have accelerated with the damper [kg]; `None` where none is asked for.

    Over whole cycles a damper's viscous and friction forces have no part in phase with the acceleration, springs
    and hysteresis have one against it. What is left in phase,

        m = int (F - mean F) a dt / int a^2 dt > 0,

    is inertia that they do not outweigh: the mass is that or more. A force that comes early looks the same.
    The standard error is that of the mean over the cycles.
    """
    motion = motion_of(test.displacement, test.dt)
    spans = whole_cycles(motion.displacement)
    if len(spans) < _FEWEST_CYCLES:
        return None
    masses = np.array([_in_phase(test.force[span], motion.acceleration[span]) for span in spans])
    mass = float(masses.mean())
    error = float(masses.std(ddof=1) / np.sqrt(masses.size))
    half_range = 0.5 * float(np.ptp(np.percentile(test.force, [0.5, 99.5])))
    peak = float(np.percentile(np.abs(motion.acceleration), 99.5))
    if mass < _SIGNIFICANT * error or mass * peak < _SHARE * half_range:
        return None
    return Measured(value=mass, standard_error=error, unit="kg")


def mass_finding(test: DamperTest) -> tuple[Finding, ...]:
    """Warn of a moving mass that the force shows."""
    mass = moving_mass(test)
    if mass is None:
        return ()
    message = (
        f"the force has a part in phase with the acceleration, as {mass.value:.3g} +- {mass.standard_error:.1g} kg "
        "or more between load cell and damper would make, or a force that comes early; "
        "--repair mass takes it out"
    )
    return (Finding(code="moving_mass", severity="warning", message=message, measured=mass),)


def _in_phase(force: NDArray[np.float64], acceleration: NDArray[np.float64]) -> float:
    varying = acceleration - acceleration.mean()
    return float((force - force.mean()) @ varying / (varying @ varying))
