"""Detector of a measured velocity that differs from the derivative of the displacement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.records.damper_test import Finding, Measured
from mrwork.records.motion import Smoother, SmoothMotion
from mrwork.values import holds_arrays

_MISFIT: Final = 0.10
_NOISE: Final = 0.5
_PHASE: Final = 0.02
_SMALLEST_FACTOR: Final = 1e-9


def velocity_agrees(
    velocity: NDArray[np.float64],
    displacement: NDArray[np.float64],
    motion: SmoothMotion,
) -> tuple[NDArray[np.float64], tuple[Finding, ...]]:
    """Compare a measured velocity with the derivative of the displacement.

    Both are smoothed alike, and the difference expected from their noise is subtracted, up to half of the signal. A
    velocity that agrees after a change of sign gets that sign; other differences are only reported, with the delay or
    the factor that explains them.

    Parameters
    ----------
    velocity, displacement
        Shape (n_time,) [m/s, m].
    motion
        Smoothed motion. A delay below 0.02 rad at its dominant frequency is reported only if it is the half sample of
        backward differences, which degrades fits of loops with sharp knees.
    """
    smoother = motion.smoother
    comparison = _compared(velocity, displacement, motion)
    measured = comparison.measured
    difference = comparison.misfit(measured)
    if comparison.misfit(-measured) <= _MISFIT:
        message = (
            "the velocity had the opposite sign of the displacement's derivative; it was multiplied by -1"
        )
        return -velocity, (Finding.note("velocity_sign_flipped", message),)

    late = comparison.delay(motion.acceleration, smoother)
    delay = late.value
    time = smoother.dt * np.arange(velocity.size)
    delay_explains = comparison.misfit(np.interp(time + delay, time, measured)) < 0.5 * difference
    if difference <= _MISFIT:
        half_sample = 0.4 < delay / smoother.dt < 0.6
        if not delay_explains or not (half_sample or 2.0 * np.pi * motion.frequency * abs(delay) >= _PHASE):
            return velocity, ()
        message = f"the velocity {_shift(delay, smoother.dt)}"
        if half_sample:
            message += ", as backward differences do"
        return velocity, (Finding.note("velocity_late", message, measured=late),)

    factor = comparison.factor()
    explained: Measured | None = None
    action = "check both, or derive the velocity from the displacement by --repair velocity"
    if delay_explains:
        explained = late
        message = f"the velocity {_shift(delay, smoother.dt)}, a difference of {100 * difference:.0f} % (rms)"
    elif abs(factor) > _SMALLEST_FACTOR and comparison.misfit(measured / factor) <= _MISFIT:
        explained = Measured(value=factor, unit="")
        message = (
            f"the velocity is {factor:.4g} times the displacement's derivative, "
            "so one of the two is not in its stated unit"
        )
    else:
        message = f"the velocity differs from the displacement's derivative by {100 * difference:.0f} % (rms)"
        action = "check that both columns belong to this test"
    finding = Finding.warning("velocity_inconsistent", message, action=action, measured=explained)
    return velocity, (finding,)


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class _VelocityMisfit:
    """Smoothed velocity, derivative with its mean square `power`, and mean square difference `expected` from noise."""

    measured: NDArray[np.float64]
    derivative: NDArray[np.float64]
    power: float
    expected: float

    def misfit(self, candidate: NDArray[np.float64]) -> float:
        """Rms difference in excess of noise, relative to the derivative."""
        beyond_noise = float(np.mean((candidate - self.derivative) ** 2)) - self.expected
        return float(np.sqrt(max(beyond_noise, 0.0) / self.power))

    def factor(self) -> float:
        """Regression coefficient of the velocity on the derivative."""
        return float(np.mean(self.measured * self.derivative)) / self.power

    def delay(self, acceleration: NDArray[np.float64], smoother: Smoother) -> Measured:
        """Delay [s] from a regression on the acceleration, to first order.

        The standard error counts one independent sample per window of the smoother.
        """
        power = float(np.mean(acceleration**2))
        late = -float(np.mean((self.measured - self.derivative) * acceleration)) / power
        left = float(np.mean((self.measured - self.derivative + late * acceleration) ** 2))
        n_independent = max(acceleration.size / smoother.window, 1.0)
        error = float(np.sqrt(left / (power * n_independent)))
        return Measured(value=late, standard_error=error, unit="s")


def _compared(
    velocity: NDArray[np.float64], displacement: NDArray[np.float64], motion: SmoothMotion
) -> _VelocityMisfit:
    smoother, derivative = motion.smoother, motion.velocity
    measured = smoother.smooth(velocity)
    power = float(np.mean(derivative**2))
    noise = np.hypot(
        smoother.noise(displacement - motion.displacement) * smoother.noise_gain(1),
        smoother.noise(velocity - measured) * smoother.noise_gain(0),
    )
    # Limits the allowance for noise, so that a signal of mostly noise does not count as correct.
    expected = min(float(noise**2), _NOISE**2 * power)
    return _VelocityMisfit(measured=measured, derivative=derivative, power=power, expected=expected)


def _shift(delay: float, dt: float) -> str:
    late = "lags" if delay > 0.0 else "leads"
    return (
        f"{late} the displacement's derivative by {1e3 * abs(delay):.3g} ms ({abs(delay) / dt:.2f} samples)"
    )
