"""Findings over whole cycles: a moving mass (force in phase with the acceleration) and drift from cycle to cycle."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.records.checks import half_range, mean_over_travel
from mrwork.records.damper_test import DamperTest, Finding, Measured
from mrwork.records.motion import SmoothMotion, whole_cycles

_FEWEST_FOR_MASS: Final = 2
_SIGNIFICANT: Final = 4.0
# Inertia below this fraction of the half range of the force is negligible.
_SHARE_OF_RANGE: Final = 0.02


def moving_mass(test: DamperTest, motion: SmoothMotion) -> Measured | None:
    """Lower bound of the mass between load cell and damper [kg], or `None` if it is not significant.

    Over whole cycles, viscous and friction forces have no component in phase with the acceleration; springs and
    hysteresis have one in opposite phase. A remaining component in phase,

        m = int (F - mean F) a dt / int a^2 dt > 0,

    is inertia, so that the mass is at least m. A force that leads the displacement has the same effect. The standard
    error is that of the mean over the cycles. A varying command changes the force within cycles and hides the mass.
    """
    if test.has_varying_command:
        return None
    spans = whole_cycles(motion.displacement)
    if len(spans) < _FEWEST_FOR_MASS:
        return None
    masses = np.array([_in_phase(test.force[span], motion.acceleration[span]) for span in spans])
    mass = float(masses.mean())
    error = float(masses.std(ddof=1) / np.sqrt(masses.size))
    peak = float(np.percentile(np.abs(motion.acceleration), 99.5))
    if mass < _SIGNIFICANT * error or mass * peak < _SHARE_OF_RANGE * half_range(test.force):
        return None
    return Measured(value=mass, standard_error=error, unit="kg")


def mass_finding(test: DamperTest, motion: SmoothMotion) -> tuple[Finding, ...]:
    """Warn of a significant moving mass."""
    mass = moving_mass(test, motion)
    if mass is None:
        return ()
    message = (
        f"the force has a component in phase with the acceleration: a mass of {mass.value:.3g} +- "
        f"{mass.standard_error:.1g} kg or more between load cell and damper, or a force that leads the displacement"
    )
    return (Finding.warning("moving_mass", message, action="subtract it by --repair mass", measured=mass),)


def _in_phase(force: NDArray[np.float64], acceleration: NDArray[np.float64]) -> float:
    varying = acceleration - acceleration.mean()
    return float((force - force.mean()) @ varying / (varying @ varying))


_FEWEST_FOR_DRIFT: Final = 5
# Relative variation below which stroke and duration count as constant; durations are also rounded to samples.
_STEADY: Final = 0.01
# Correlation of stroke and cycle number above which a drift cannot be separated from the stroke.
_COLLINEAR: Final = 0.9
_LEAST_DRIFT: Final = 0.03


def loop_drift(test: DamperTest, motion: SmoothMotion) -> Measured | None:
    """Relative change of the dissipative force from the first cycle to the last, or `None` if it cannot be estimated.

    The force of a cycle is its dissipated energy per distance travelled, int F v dt / int |v| dt. Its logarithm is
    regressed on the cycle number and, if the stroke varies, on the logarithm of the stroke. The estimate needs five
    cycles of equal duration whose stroke does not change steadily, at a constant command.
    """
    if test.has_varying_command:
        return None
    spans = whole_cycles(motion.displacement)
    if len(spans) < _FEWEST_FOR_DRIFT:
        return None
    duration = np.array([span.stop - span.start for span in spans])
    if np.std(duration) > _STEADY * np.mean(duration) + 1.0:
        return None
    force = test.force - mean_over_travel(test.force, motion.velocity)
    # Cycles without stroke or with negative work have no logarithm.
    tiny = np.finfo(np.float64).tiny
    stroke = np.array([np.ptp(motion.displacement[span]) for span in spans])
    travel = np.array([np.abs(motion.velocity[span]).sum() for span in spans])
    work = np.array([force[span] @ motion.velocity[span] for span in spans])
    if np.any(work <= 0.0) or np.any(stroke <= tiny):
        return None
    logarithm = np.log(work / travel)
    progress = np.linspace(0.0, 1.0, len(spans))
    columns = [progress, np.ones_like(progress)]
    if np.std(np.log(stroke)) > _STEADY:
        if abs(np.corrcoef(progress, np.log(stroke))[0, 1]) > _COLLINEAR:
            return None
        columns.append(np.log(stroke))
    design = np.stack(columns, axis=1)
    coefficients = np.linalg.lstsq(design, logarithm, rcond=None)[0]
    left = logarithm - design @ coefficients
    variance = float(left @ left) / (len(spans) - design.shape[1])
    error = float(np.sqrt(variance * np.linalg.pinv(design.T @ design)[0, 0]))
    change = float(np.expm1(coefficients[0]))
    return Measured(value=change, standard_error=error * (1.0 + change), unit="")


def drift_finding(test: DamperTest, motion: SmoothMotion) -> tuple[Finding, ...]:
    """Warn of a drift above 3 % and four standard errors."""
    drift = loop_drift(test, motion)
    if drift is None or drift.standard_error is None:
        return ()
    if abs(drift.value) < max(_LEAST_DRIFT, _SIGNIFICANT * drift.standard_error):
        return ()
    likely = "as in a damper that heats up" if drift.value < 0.0 else "as in one that settles in"
    message = (
        f"at equal stroke the dissipative force changes by {100 * drift.value:+.1f} +- "
        f"{100 * drift.standard_error:.1f} % from the first cycle to the last, {likely}"
    )
    action = "fit a part of the record (--from, --until)"
    return (Finding.warning("loop_drift", message, action=action, measured=drift),)
