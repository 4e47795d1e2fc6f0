"""Detectors of a measured velocity that differs from the derivative of the displacement, or is noisier."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.units import FACTORS
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import RecordError
from mrwork.records.damper_test import DamperTest, Finding, Measured, VelocitySource
from mrwork.records.motion import Smoother, SmoothMotion

_MISFIT: Final = 0.10
_NOISE: Final = 0.5
_PHASE: Final = 0.02
_SMALLEST_FACTOR: Final = 1e-9
# Ratios of the units of a velocity: the unit of its readings, and that which they were taken for.
_CONFUSED: Final = {
    factor / own: (unit, taken)
    for (unit, own), (taken, factor) in permutations(FACTORS["velocity"].items(), 2)
}
# Relative difference within which a factor is such a ratio: rigs are calibrated to a few per cent.
_OF_UNITS: Final = 0.04
# A velocity is not used whose noise exceeds this share of its rms value, and this multiple of the noise of the
# derivative. Parameters then are several standard errors off; measured velocities of rigs have up to 1.1 %.
_NOISY: Final = 0.015
_NOISIER: Final = 2.0

_Kept = slice | NDArray[np.intp]

OFF_BY_FACTOR: Final = "velocity_factor"


def refuse_velocity(test: DamperTest) -> None:
    """Refuse a test whose velocity is a known factor times the derivative of the displacement."""
    for finding in test.findings:
        if finding.code == OFF_BY_FACTOR:
            raise RecordError(f"{test.label}: {finding.message}")


def noisy_velocity(own: float, noise: float, motion: SmoothMotion) -> tuple[Finding, ...]:
    """Note a velocity that is noisier than the derivative of the displacement, which replaces it then.

    Differences of quantised readings are, and bias the parameters. Noise: `own` [m/s], and `noise` of the displacement
    [m].
    """
    derived = noise * motion.smoother.noise_gain(1)
    spread = float(np.std(motion.velocity))
    if own <= max(_NOISY * spread, _NOISIER * derived):
        return ()
    message = (
        f"the velocity has a noise of {1e3 * own:.3g} mm/s, {100 * own / spread:.2g} % of its standard deviation, and "
        f"the derivative of the displacement {1e3 * derived:.2g} mm/s; it is not used, and the velocity is derived "
        "from the displacement as if none were given"
    )
    return (Finding.note("velocity_noisy", message, measured=Measured(value=own, unit="m/s")),)


def velocity_agrees(
    velocity: Floats,
    displacement: Floats,
    motion: SmoothMotion,
    uncompared: Sequence[tuple[int, int]] = (),
) -> tuple[Floats, VelocitySource, tuple[Finding, ...]]:
    """Compare a measured velocity with the derivative of the displacement; return the one to use.

    Both are smoothed alike, and the difference expected from their noise is subtracted, up to half of the signal.
    A velocity that agrees after a change of sign gets that sign. Other differences are only reported, with the delay or
    the factor that explains them; tests with the factor of two units are refused by `refuse_velocity` where they are
    fitted or predicted. A velocity of the same motion that is far noisier than the derivative is replaced by it.

    `velocity`, `displacement`: shape (n_time,) [m/s, m]. `motion`: smoothed motion. A delay below 0.02 rad at its
    dominant frequency is reported only if it is the half sample of backward differences, which degrades fits of loops
    with sharp knees. `uncompared`: spans of samples, first and beyond the last, that were interpolated.
    """
    smoother = motion.smoother
    kept = _select_unsmoothed(velocity.size, uncompared, smoother.window // 2)
    comparison = _compare_velocities(velocity, displacement, motion, kept)
    measured = comparison.measured
    difference = comparison.misfit(measured)
    if comparison.misfit(-measured) <= _MISFIT:
        message = (
            "the velocity had the opposite sign of the displacement's derivative; it was multiplied by -1"
        )
        turned, source, opposite = velocity_agrees(-velocity, displacement, motion, uncompared)
        return turned, source, (Finding.note("velocity_sign_flipped", message), *opposite)
    factor = comparison.factor()
    if abs(factor) > _SMALLEST_FACTOR and abs(factor - 1.0) > _MISFIT:
        rescaled = _compare_velocities(velocity / factor, displacement, motion, kept)
        if rescaled.misfit(rescaled.measured) <= _MISFIT:
            return velocity, "measured", (_off_by(factor),)

    late = comparison.delay(motion.acceleration[kept], smoother)
    delay = late.value
    time = smoother.dt * np.arange(velocity.size)[kept]
    delay_explains = comparison.misfit(np.interp(time + delay, time, measured)) < 0.5 * difference
    if difference <= _MISFIT:
        noise = smoother.noise((displacement - motion.displacement)[kept])
        noisy = noisy_velocity(smoother.noise((velocity - smoother.smooth(velocity))[kept]), noise, motion)
        if noisy:
            return motion.velocity, "derived", noisy
        half_sample = 0.4 < delay / smoother.dt < 0.6
        if not delay_explains or not (half_sample or 2.0 * np.pi * motion.frequency * abs(delay) >= _PHASE):
            return velocity, "measured", ()
        message = f"the velocity {_shift(delay, smoother.dt)}"
        if half_sample:
            message += ", as backward differences do"
        return velocity, "measured", (Finding.note("velocity_late", message, measured=late),)

    if delay_explains:
        message = f"the velocity {_shift(delay, smoother.dt)}, a difference of {100 * difference:.0f} % (rms)"
        return velocity, "measured", (_inconsistent(message, _CHECK, late),)
    message = f"the velocity differs from the displacement's derivative by {100 * difference:.0f} % (rms)"
    return velocity, "measured", (_inconsistent(message, "check that both columns belong to this test"),)


_CHECK: Final = "check both, or derive the velocity from the displacement by --repair velocity"


def _off_by(factor: float) -> Finding:
    """Finding of a velocity that is a factor times the derivative, with the explanation of a known factor."""
    times = f"the velocity is {factor:.4g} times the displacement's derivative"
    measured = Measured(value=factor, unit="")
    size = abs(factor)
    nearest = min(_CONFUSED, key=lambda ratio: abs(np.log(size / ratio)))
    if abs(size / nearest - 1.0) > _OF_UNITS:
        return _inconsistent(f"{times}, so one of the two is not in its stated unit", _CHECK, measured)
    explained = "as where {} are taken for {}".format(*_CONFUSED[nearest])
    action = "correct the column, or derive the velocity from the displacement by --repair velocity"
    return Finding.warning(OFF_BY_FACTOR, f"{times}, {explained}", action=action, measured=measured)


def _inconsistent(message: str, action: str, measured: Measured | None = None) -> Finding:
    return Finding.warning("velocity_inconsistent", message, action=action, measured=measured)


@array_dataclass()
class _VelocityMisfit:
    """Smoothed velocity, derivative with its mean square `power`, and mean square difference `expected` from noise."""

    measured: Floats
    derivative: Floats
    power: float
    expected: float

    def misfit(self, candidate: Floats) -> float:
        """Rms difference in excess of noise, relative to the derivative."""
        beyond_noise = float(np.mean((candidate - self.derivative) ** 2)) - self.expected
        return float(np.sqrt(max(beyond_noise, 0.0) / self.power))

    def factor(self) -> float:
        """Regression coefficient of the velocity on the derivative."""
        return float(np.mean(self.measured * self.derivative)) / self.power

    def delay(self, acceleration: Floats, smoother: Smoother) -> Measured:
        """Delay [s] by regression on the acceleration, to first order; a window counts as one sample."""
        power = float(np.mean(acceleration**2))
        late = -float(np.mean((self.measured - self.derivative) * acceleration)) / power
        left = float(np.mean((self.measured - self.derivative + late * acceleration) ** 2))
        n_independent = max(acceleration.size / smoother.window, 1.0)
        error = float(np.sqrt(left / (power * n_independent)))
        return Measured(value=late, standard_error=error, unit="s")


def _select_unsmoothed(n_time: int, uncompared: Sequence[tuple[int, int]], reach: int) -> _Kept:
    """Index of the samples that no interpolated one is smoothed into, by a filter with this reach to either side."""
    if not uncompared:
        return slice(None)
    given = np.ones(n_time, dtype=np.bool_)
    for first, last in uncompared:
        given[max(first - reach, 0) : last + reach] = False
    return np.flatnonzero(given) if np.count_nonzero(given) > reach else slice(None)


def _compare_velocities(
    velocity: Floats, displacement: Floats, motion: SmoothMotion, kept: _Kept
) -> _VelocityMisfit:
    smoother, derivative = motion.smoother, motion.velocity[kept]
    smooth = smoother.smooth(velocity)
    measured = smooth[kept]
    power = float(np.mean(derivative**2))
    noise = np.hypot(
        smoother.noise((displacement - motion.displacement)[kept]) * smoother.noise_gain(1),
        smoother.noise((velocity - smooth)[kept]) * smoother.noise_gain(0),
    )
    # Limits the allowance for noise, so that a signal of mostly noise does not count as correct.
    expected = min(float(noise**2), _NOISE**2 * power)
    return _VelocityMisfit(measured=measured, derivative=derivative, power=power, expected=expected)


def _shift(delay: float, dt: float) -> str:
    late = "lags" if delay > 0.0 else "leads"
    return (
        f"{late} the displacement's derivative by {1e3 * abs(delay):.3g} ms ({abs(delay) / dt:.2f} samples)"
    )
