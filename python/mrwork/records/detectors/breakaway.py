"""Detector of stiction: the breakaway force of a damper from rest."""

from __future__ import annotations

from typing import Final

import numpy as np

from mrwork.records.checks import mean_over_travel, samples_at_rest
from mrwork.records.damper_test import DamperTest, Finding, Measured
from mrwork.records.motion import Smoother, motion_of

_LEAST_REST: Final = 0.25
# The start ends at this fraction of the peak-to-peak stroke; least overshoot, relative to the half range.
_START: Final = 0.05
_SHARE: Final = 0.05
_SIGNIFICANT: Final = 4.0


def breakaway_overshoot(test: DamperTest) -> Measured | None:
    """Excess of the force at the first movement over all later forces [N]; `None` if there is no rest before.

    Forces are relative to their mean over the distance travelled. The standard error is the noise of the force.
    """
    motion = motion_of(test.displacement, test.dt)
    rest = samples_at_rest(test.displacement)
    if rest * test.dt * motion.frequency < _LEAST_REST:
        return None
    moved = np.abs(test.displacement - test.displacement[0]) > _START * np.ptp(test.displacement)
    started = int(np.argmax(moved))
    force = np.abs(test.force - mean_over_travel(test.force, motion.velocity))
    smoother = Smoother(window=5, dt=test.dt)
    noise = smoother.noise(test.force - smoother.smooth(test.force))
    first = slice(max(rest - 2, 0), started + 1)
    overshoot = float(force[first].max() - force[started + 1 :].max())
    return Measured(value=overshoot, standard_error=noise * float(np.sqrt(2.0)), unit="N")


def breakaway_finding(test: DamperTest) -> tuple[Finding, ...]:
    """Note a breakaway force above all later forces by at least 5 % of the half range."""
    overshoot = breakaway_overshoot(test)
    if overshoot is None or overshoot.standard_error is None:
        return ()
    half_range = 0.5 * float(np.ptp(np.percentile(test.force, [0.5, 99.5])))
    if overshoot.value < max(_SHARE * half_range, _SIGNIFICANT * overshoot.standard_error):
        return ()
    message = (
        f"the damper broke away from rest with {overshoot.value:.3g} N more than any later force: stiction, "
        "which the models do not include; --repair rest removes the start"
    )
    return (Finding(code="breakaway", severity="note", message=message, measured=overshoot),)
