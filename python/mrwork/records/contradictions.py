"""Detectors of channels that contradict each other or themselves: they stand still, jump, drift, or repeat a part.

A measured velocity contradicts the displacement where its integral does. One that is noisier than the derivative is not
used, nor is one that is late by its making: computed as a difference of the displacement, or held over several samples.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import permutations, product
from typing import Final

import numpy as np

from mrwork.base.remark import OF_FILES, Measured, Remark, RemarkKind
from mrwork.base.units import FACTORS
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.command import sample_runs
from mrwork.errors import RecordError
from mrwork.files.grid import last_digit
from mrwork.records.checks import half_range, held_samples
from mrwork.records.damper_test import DamperTest, VelocitySource
from mrwork.records.motion import Differentiator, SmoothMotion, fit_residual, regular_cycles, robust_deviation

# Beyond this share of the range to either side of its middle a channel is on that side.
_SIDE: Final = 0.25
# A channel of white noise spans 9 standard deviations in 1e5 samples, and does not go 5 to either side. It never stands
# still with more than this share of its range.
_STILL_NOISE: Final = 10.0
_STILL: Final = 0.005
# The other channel takes this share of a period at least to get to its other side.
_SHORTEST_SWING: Final = 0.15
# What rounding leaves of a channel that stands still, as a share of its range.
_STANDS_STILL: Final = 1e-6
_STANDS: Final = "the {0} stands still for {value:.3g} s, first from {begin:.3g} s on, while the"
_STILL_CURE: Final = "check the sensor of the {0} and its cable, or omit that part (--from, --until)"
_STILL_KINDS: Final = {
    "displacement": RemarkKind(
        "displacement_still", f"{_STANDS} force goes from one side to the other", _STILL_CURE
    ),
    "force": RemarkKind(
        "force_still", f"{_STANDS} displacement goes from one side to the other and back", _STILL_CURE
    ),
}


def still_remarks(test: DamperTest, motion: SmoothMotion) -> Iterator[Remark]:
    """Warn of a displacement or a force that stands still while the other goes to either side of its range and back.

    A damper held at rest keeps the sign of its force, whatever its command does; one that moves to and fro has a force
    of either sign, which may be constant on one way.
    """
    # A force that moves while the displacement stands still has windows of its own.
    of_force = Differentiator.of(test.force, test.dt)
    smoothed = {
        "displacement": (test.displacement, motion.displacement, motion.differentiator.noise_gain(0)),
        "force": (test.force, of_force.smooth(test.force), of_force.noise_gain(0)),
    }
    shortest = _SHORTEST_SWING / (motion.frequency * test.dt)
    for name, other, least_swings in (("displacement", "force", 1), ("force", "displacement", 2)):
        if spans := _still_spans(smoothed[name], smoothed[other], shortest, least_swings):
            seconds = Measured(test.dt * sum(last - first for first, last in spans), "s")
            begin = test.start_time + test.dt * spans[0][0]
            yield _STILL_KINDS[name].remark(name, measured=seconds, begin=begin)


def _still_spans(
    still: tuple[Floats, Floats, float], other: tuple[Floats, Floats, float], shortest: float, at_least: int
) -> list[tuple[int, int]]:
    """Spans of samples, first and beyond the last, in which a channel stands still and the other one changes sides.

    Of each: the samples, the smoothed ones, and what smoothing leaves of noise. `shortest`: samples of a span.
    """
    (raw, smooth, gain), (raw_moving, moving, _) = still, other
    low, high = np.percentile(moving, [1.0, 99.0])
    if high - low <= 2.0 * _STILL_NOISE * robust_deviation(raw_moving - moving):
        return []
    beyond = (moving - 0.5 * (low + high)) / (high - low)
    decided = np.flatnonzero(np.abs(beyond) > _SIDE)
    changes = np.flatnonzero(np.diff(np.sign(beyond[decided])))
    if not changes.size:
        return []
    # From the last quarter of the time on one side to the first quarter of that on the other.
    first, last = decided[np.append(0, changes + 1)], decided[np.append(changes, -1)]
    within = (last - first) // 4
    swings = np.stack([(last - within)[:-1], (first + within)[1:] + 1], axis=1)
    noise = robust_deviation(raw - smooth) * gain
    stroke = float(np.ptp(smooth))
    least = max(min(_STILL_NOISE * noise, _STILL * stroke), _STANDS_STILL * stroke)
    padded = np.append(smooth, smooth[-1])
    ranges = (np.maximum.reduceat(padded, swings.ravel()) - np.minimum.reduceat(padded, swings.ravel()))[::2]
    runs = (run for run in sample_runs(ranges <= least) if run[1] - run[0] >= at_least)
    return [
        _widen_span(smooth, begin, end, least)
        for begin, end in ((int(swings[first, 0]), int(swings[last - 1, 1])) for first, last in runs)
        if end - begin >= shortest and np.ptp(smooth[begin:end]) <= 2.0 * least
    ]


def _widen_span(smooth: Floats, begin: int, end: int, least: float) -> tuple[int, int]:
    """The span in which a channel that stands still from `begin` to `end` does so."""
    left = np.flatnonzero(np.abs(smooth - np.median(smooth[begin:end])) > least)
    before, after = left[left < begin], left[left >= end]
    return int(before[-1]) + 1 if before.size else 0, int(after[0]) if after.size else smooth.size


# A jump exceeds the steps before and after it by this multiple of the noise of that difference, of the largest other
# steps, and of the stroke. Half of the path of a staircase is jumps, and that is how it was driven.
_JUMP_NOISE: Final = 10.0
_JUMP_STEPS: Final = 2.0
_JUMP: Final = 0.02
_OF_THE_PATH: Final = 0.5
_PLACES_OF_PATH: Final = 200
_JUMPS: Final = RemarkKind(
    "displacement_jumps",
    "the displacement jumps by {size:.3g} mm within a sample of {step:.3g} ms, at {at:.4g} s{others}: that is "
    "{speed:.3g} m/s, and {usual:.3g} m/s is the most elsewhere",
    "check its sensor for slip and the record for a cut, and use the part before or after (--from, --until)",
)


def jump_remark(test: DamperTest, _: SmoothMotion) -> Iterator[Remark]:
    """Warn of a displacement that jumps within a sample between parts that move smoothly, as of a sensor that slips."""
    displacement = test.displacement
    steps = np.diff(displacement)
    if steps.size < 3:
        return
    beyond = np.abs(steps[1:-1] - 0.5 * (steps[:-2] + steps[2:]))
    noise = robust_deviation(beyond)
    usual = float(np.percentile(np.abs(steps), 99.0))
    least = max(_JUMP_NOISE * noise, _JUMP_STEPS * usual, _JUMP * float(np.ptp(displacement)))
    # The steps beside a jump differ from theirs by half of it.
    padded = np.pad(beyond, 1)
    jumps = 1 + np.flatnonzero((beyond > least) & (beyond >= padded[:-2]) & (beyond > padded[2:]))
    for first, last in test.uncompared:
        jumps = jumps[(jumps + 1 < first) | (jumps >= last)]
    every = max(displacement.size // _PLACES_OF_PATH, 1)
    travel = float(np.abs(np.diff(displacement[::every])).sum())
    if jumps.size == 0 or np.abs(steps[jumps]).sum() > _OF_THE_PATH * travel:
        return
    largest = int(jumps[np.argmax(np.abs(steps[jumps]))])
    size = float(abs(steps[largest]))
    yield _JUMPS.remark(
        measured=Measured(size, "m"),
        size=1e3 * size,
        step=1e3 * test.dt,
        at=test.start_time + test.dt * largest,
        others=f" and {jumps.size - 1} times more" if jumps.size > 1 else "",
        speed=size / test.dt,
        usual=usual / test.dt,
    )


# A drift moves the displacement by this multiple of what its stroke would be without; beyond the other it is a ramp.
_DRIFT: Final = 0.25
_RAMP: Final = 60.0
_FEWEST_CYCLES: Final = 3
# Ratio of the residuals of the force without the drift and with it, below which the damper did not drift.
_BETTER: Final = 0.8
# Hysteresis and width of the force about the reversal, in peak velocities.
_HYSTERESIS: Final = (0.0, 0.1, 0.2, 0.4)
_WIDTHS: Final = (0.03, 0.1, 0.3)
_MOST_SAMPLES: Final = 2000
_DRIFTS: Final = RemarkKind(
    "displacement_drifts",
    "the displacement drifts by {drift:+.3g} mm/s, {whole:+.3g} mm over the record, and the force reverses as if the "
    "damper did not",
    "check the sensor, its zero and its fastening, and subtract the drift",
)


def drift_of_displacement_remark(test: DamperTest, motion: SmoothMotion) -> Iterator[Remark]:
    """Warn of a displacement channel that drifts [m/s], as the force does not.

    The displacement, or the centre of its cycles where it has regular ones, moves on steadily. A damper that is driven
    so reverses its force where the recorded velocity is zero; a channel that drifts has that velocity shifted by its
    drift.
    """
    time = test.dt * np.arange(test.n_time)
    drift, level = (float(coefficient) for coefficient in np.polyfit(time, motion.displacement, 1))
    cycles = regular_cycles(motion.displacement - drift * time)
    if len(cycles) >= _FEWEST_CYCLES:
        at = np.array([time[cycle].mean() for cycle in cycles])
        centre = np.array([motion.displacement[cycle].mean() for cycle in cycles])
        drift, level = (float(coefficient) for coefficient in np.polyfit(at, centre, 1))
    stroke = max(np.ptp(motion.displacement - drift * time), np.finfo(float).tiny)
    seconds = test.n_time * test.dt
    if not _DRIFT < abs(drift) * seconds / stroke < _RAMP:
        return
    samples = slice(None, None, max(test.n_time // _MOST_SAMPLES, 1))
    recorded, moved = motion.displacement[samples], motion.velocity[samples]
    centred = recorded - level - drift * time[samples]
    as_recorded = _least_residual(test.force[samples], recorded, moved, centred)
    without = _least_residual(test.force[samples], centred, moved - drift, centred)
    if without < _BETTER * as_recorded:
        yield _DRIFTS.remark(measured=Measured(drift, "m/s"), drift=1e3 * drift, whole=1e3 * drift * seconds)


def _least_residual(force: Floats, displacement: Floats, velocity: Floats, centred: Floats) -> float:
    """Least residual of f0 + k x + c v + f tanh((v + h w x) / s) over hysteresis h and width s, with w from both."""
    peak = float(np.percentile(np.abs(velocity), 99.0))
    quadrature = peak * centred / float(np.percentile(np.abs(centred), 99.0))
    linear = (np.ones_like(force), displacement, velocity)
    return min(
        float(np.linalg.norm(fit_residual(columns, force)))
        for hysteresis, width in product(_HYSTERESIS, _WIDTHS)
        for columns in [
            np.stack((*linear, np.tanh((velocity + hysteresis * quadrature) / (width * peak))), axis=1)
        ]
    )


# Samples at the end that are looked for, and the least share of a record that is a copy.
_LOOKED_FOR: Final = 50
_COPIED: Final = 0.05
# A simulated record without noise repeats itself in every period.
_LONGER_THAN_PERIODIC: Final = 1.5
_REPEATED: Final = RemarkKind(
    "part_repeated",
    "the last {value:.3g} s are a copy of what was recorded {before:.4g} s before, to the last digit, and count twice",
    "use the record up to there (--until)",
)


def repeated_part(test: DamperTest, motion: SmoothMotion) -> Iterator[Remark]:
    """Warn of a record whose end is a copy of an earlier part, to the last digit."""
    if test.n_time < 2 * _LOOKED_FOR:
        return
    end = test.n_time - _LOOKED_FOR
    offset = test.force[:end].tobytes().rfind(test.force[end:].tobytes())
    lag, rest = divmod(offset, test.force.itemsize)
    lag = end - lag
    if offset < 0 or rest or np.unique(test.force[end:]).size < _LOOKED_FOR // 2:
        return
    same = (test.force[lag:] == test.force[:-lag]) & (test.displacement[lag:] == test.displacement[:-lag])
    copied = int(np.argmin(np.append(same[::-1], False)))
    if copied >= _COPIED * test.n_time and lag * test.dt * motion.frequency >= _LONGER_THAN_PERIODIC:
        yield _REPEATED.remark(measured=Measured(copied * test.dt, "s"), before=lag * test.dt)


_MISFIT: Final = 0.10
_NOISE_SHARE: Final = 0.5
_PHASE: Final = 0.02
# What a column late by several samples loses of its regression coefficient on the derivative, at most.
_SAME_MOTION: Final = 0.5
_SMALLEST_FACTOR: Final = 1e-9
# Ratios of the units of a velocity: the unit of its readings, and that which they were taken for; none of cars.
_CONFUSED: Final = {
    FACTORS["velocity"][taken] / FACTORS["velocity"][unit]: (unit, taken)
    for unit, taken in permutations(("m/s", "cm/s", "mm/s", "in/s", "ft/s"), 2)
}
# Relative difference within which a factor is such a ratio: rigs are calibrated to a few per cent.
_OF_UNITS: Final = 0.04
# A velocity is not used whose noise exceeds this share of its rms value, and this multiple of the noise of the
# derivative. Parameters then are several standard errors off; measured velocities of rigs have up to 1.1 %.
_NOISY: Final = 0.015
_NOISIER: Final = 2.0
# Share of a record at rest, which is less than its noise.
_RESTS: Final = 0.1

# Steps of a clock that is slow or fast by a thousand, and the units that were confused, by the ratio of the velocity to
# the derivative: damper tests are sampled at 20 Hz to 50 kHz.
_SLOW_CLOCK: Final = 0.05
_FAST_CLOCK: Final = 2e-5
_CLOCKS: Final = {1e3: ("ms", "s"), 1e6: ("us", "s"), 1e-3: ("s", "ms"), 1e-6: ("s", "us")}
_TIMES: Final = "the velocity is {value:.4g} times the displacement's derivative"
# All other verbs refuse these two.
_OFF_BY_CLOCK: Final = RemarkKind(
    "time_factor",
    f"{_TIMES}, and its steps are {{dt:.4g}} s, as where a time in {{0}} is taken for one in {{1}}",
    "give the unit of the time, as in --column time=COLUMN:{0}; if the time is right, the unit of the velocity or the "
    "displacement is not",
    verbs=("check",),
)
_OFF_BY_UNIT: Final = RemarkKind(
    "velocity_factor",
    f"{_TIMES}, as where {{0}} are taken for {{1}}",
    "correct the column, or derive the velocity from the displacement by --repair velocity",
    verbs=("check",),
    cured_by="velocity",
)
_CHECK: Final = "check both, or derive the velocity from the displacement by --repair velocity"
_OFF_BY_FACTOR: Final = RemarkKind(
    "velocity_unit_unclear",
    f"{_TIMES}, so one of the two is not in its stated unit",
    _CHECK,
    cured_by="velocity",
)
_SHIFTED: Final = "the velocity {0} the displacement's derivative by {late:.3g} ms ({samples:.2f} samples)"
_LATE: Final = RemarkKind("velocity_late", f"{_SHIFTED}{{1}}", cured_by="velocity")
_FAR_LATE: Final = RemarkKind(
    "velocity_far_late",
    f"{_SHIFTED}, a difference of {{difference:.0f}} % (rms)",
    _CHECK,
    cured_by="velocity",
)
_DIFFERS: Final = RemarkKind(
    "velocity_inconsistent",
    "the velocity differs from the displacement by {difference:.0f} % (rms): over spans of {span:.3g} ms it is "
    "{own:.3g} mm/s in the mean (rms), and the displacement moves by {travelled:.3g} mm/s",
    "check that both columns belong to this test",
    cured_by="velocity",
)
_TURNED: Final = RemarkKind(
    "velocity_sign_flipped",
    "the velocity had the opposite sign of the displacement's derivative; it was multiplied by -1",
)
_DERIVED_INSTEAD: Final = (
    "it is not used, and the velocity is derived from the displacement as if none were given; --keep-velocity keeps "
    "the column"
)
_NOISY_VELOCITY: Final = RemarkKind(
    "velocity_noisy",
    "the velocity has a noise of {own:.3g} mm/s, {share:.2g} % of its standard deviation, and the derivative of the "
    "displacement {derived:.2g} mm/s; {0}",
)
_LATE_BY_MAKING: Final = f"{{late:.3g}} ms ({{samples:g}} samples); {_DERIVED_INSTEAD}"
_HELD_VELOCITY: Final = RemarkKind(
    "velocity_held",
    "the velocity has a new value in one of {held} samples, the displacement in each, and lags in the mean by "
    f"{_LATE_BY_MAKING}",
)
_DIFFERENCE: Final = RemarkKind(
    "velocity_difference",
    f"the velocity follows the {{0}} difference of the displacement, and {{1}} by {_LATE_BY_MAKING}",
)


def refuse_velocity(test: DamperTest) -> None:
    """Refuse a test whose velocity is a known factor times the derivative of the displacement."""
    for remark in test.remarks:
        if remark.code in (_OFF_BY_UNIT.code, _OFF_BY_CLOCK.code):
            refusal = RecordError(f"{test.label}: {remark.message}")
            refusal.of_columns = True
            raise refusal


# A difference is nearer to a one-sided one than to the central one by this factor, and has a gain near one. Its steps
# are the recorded ones or, where these are rounded, their mean.
_NEARER: Final = 0.25
_GAIN: Final = 0.01


def late_by_making(time: Floats, displacement: Floats, velocity: Floats) -> tuple[Remark, ...]:
    """Note a velocity column that is held while the displacement is not, or a difference of the displacement column."""
    step = float(np.mean(np.diff(time)))
    held = held_samples(velocity)
    if held > 1 and held_samples(displacement) == 1:
        lag = 0.5 * (held - 1)
        late = Measured(lag * step, "s")
        return (_HELD_VELOCITY.remark(measured=late, held=held, late=1e3 * late.value, samples=lag),)
    if lag := _lag_of_difference(time, displacement, velocity):
        words = ("backward", "lags") if lag > 0.0 else ("forward", "leads")
        late = Measured(lag * step, "s")
        numbers = {"late": 1e3 * abs(late.value), "samples": abs(lag)}
        return (_DIFFERENCE.remark(*words, measured=late, **numbers),)
    return ()


def _lag_of_difference(time: Floats, displacement: Floats, velocity: Floats) -> float:
    """Lag, in samples, of a velocity column that is a difference of the displacement column: 0.5 of a backward one.

    It is 0 for any other column: the noise of a measured velocity does not repeat the displacement's.
    """
    recorded = np.diff(time)
    for lag, column in ((0.5, velocity[1:]), (-0.5, velocity[:-1])):
        for steps in (recorded, np.mean(recorded)):
            difference = np.diff(displacement) / steps
            gain = float(column @ difference) / max(float(difference @ difference), np.finfo(float).tiny)
            if abs(abs(gain) - 1.0) > _GAIN:
                continue
            central = 0.5 * (difference[1:] + difference[:-1])
            inner = slice(None, -1) if lag > 0.0 else slice(1, None)
            left, from_central = column - gain * difference, column[inner] - gain * central
            if np.sum(left[inner] ** 2) < _NEARER**2 * np.sum(from_central**2):
                return lag
    return 0.0


def velocity_agrees(
    velocity: Floats,
    displacement: Floats,
    motion: SmoothMotion,
    uncompared: Sequence[tuple[int, int]] = (),
    *,
    late: tuple[Remark, ...] = (),
    keep: bool = False,
) -> tuple[Floats, VelocitySource, tuple[Remark, ...]]:
    """Compare a measured velocity with the displacement; return the one to use.

    Its integrals over spans of half the window of the differentiator are compared with the steps of the displacement:
    no derivative is involved, so that a difference is none of smoothing. The difference expected from noise is
    subtracted, up to half of the signal. A velocity that agrees after a change of sign gets that sign. Other
    differences are only reported, with the delay or the factor that explains them; tests with the factor of two units
    are refused by `refuse_velocity` where they are fitted or predicted. Unless it is to be kept, a velocity of the same
    motion that is far noisier than the derivative is replaced by it, and so is one that is `late` by its making.

    `velocity`, `displacement`: shape (n_time,) [m/s, m]. `motion`: smoothed motion. A delay below 0.02 rad at its
    dominant frequency is reported only if it is the half sample of backward differences, which degrades fits of loops
    with sharp knees. `uncompared`: spans of samples, first and beyond the last, that were interpolated
    or are beside corners.
    """
    differentiator = motion.differentiator
    comparison = _compare_velocities(velocity, displacement, motion, uncompared)
    measured = comparison.measured
    difference = comparison.misfit(measured)
    if comparison.misfit(-measured) <= _MISFIT:
        turned, source, opposite = velocity_agrees(
            -velocity, displacement, motion, uncompared, late=late, keep=keep
        )
        return turned, source, (_TURNED.remark(), *opposite)
    factor = comparison.factor()
    if abs(factor) > _SMALLEST_FACTOR and abs(factor - 1.0) > _MISFIT:
        rescaled = _compare_velocities(velocity / factor, displacement, motion, uncompared)
        if rescaled.misfit(rescaled.measured) <= _MISFIT:
            return velocity, "measured", (_off_by(factor, differentiator.dt),)

    delayed = comparison.delay(differentiator)
    delay = delayed.value
    samples = delay / differentiator.dt
    lags = "lags" if delay > 0.0 else "leads"
    shift = {"late": 1e3 * abs(delay), "samples": abs(samples)}
    time = differentiator.dt * comparison.at
    delay_explains = comparison.misfit(np.interp(time + delay, time, measured)) < 0.5 * difference
    noise, derived, spread = comparison.own, comparison.derived, float(np.std(motion.velocity))
    # Differences of quantised readings are noisier than the derivative, and bias the parameters.
    noisy: tuple[Remark, ...] = ()
    # At rest, noise makes a loop forget its force.
    harms = noise > _NOISY * spread or np.mean(np.abs(motion.velocity) < noise) > _RESTS
    if difference <= _MISFIT and harms and noise > _NOISIER * derived:
        numbers = {"own": 1e3 * noise, "share": 100.0 * noise / spread, "derived": 1e3 * derived}
        done = "it is kept, as asked" if keep else _DERIVED_INSTEAD
        noisy = (_NOISY_VELOCITY.remark(done, measured=Measured(noise, "m/s"), **numbers),)
    if not keep and (replaced := noisy or (late if abs(factor - 1.0) < _SAME_MOTION else ())):
        return motion.velocity, "derived", replaced
    if difference <= _MISFIT:
        half_sample = 0.4 < samples < 0.6
        if not delay_explains or not (half_sample or 2.0 * np.pi * motion.frequency * abs(delay) >= _PHASE):
            return velocity, "measured", noisy
        by_making = ", as backward differences do" if half_sample else ""
        return velocity, "measured", (*noisy, _LATE.remark(lags, by_making, measured=delayed, **shift))
    if delay_explains:
        remark = _FAR_LATE.remark(lags, measured=delayed, difference=100.0 * difference, **shift)
    else:
        remark = _DIFFERS.remark(
            difference=100.0 * difference,
            span=1e3 * differentiator.dt * (differentiator.window // 2),
            own=1e3 * float(np.sqrt(np.mean(measured**2))),
            travelled=1e3 * float(np.sqrt(comparison.power)),
        )
    return velocity, "measured", (remark,)


def _off_by(factor: float, dt: float) -> Remark:
    """Remark of a velocity that is a factor times the derivative at steps `dt` [s], with its explanation if known."""
    measured = Measured(factor, "")
    size = abs(factor)
    for ratio, units in _CLOCKS.items():
        clock_is_off = dt >= _SLOW_CLOCK if ratio > 1.0 else dt <= _FAST_CLOCK
        if clock_is_off and abs(size / ratio - 1.0) <= _OF_UNITS:
            return _OFF_BY_CLOCK.remark(*units, measured=measured, dt=dt)
    nearest = min(_CONFUSED, key=lambda ratio: abs(np.log(size / ratio)))
    if abs(size / nearest - 1.0) > _OF_UNITS:
        return _OFF_BY_FACTOR.remark(measured=measured)
    return _OFF_BY_UNIT.remark(*_CONFUSED[nearest], measured=measured)


@array_dataclass()
class _VelocityMisfit:
    """Means over spans about samples `at`: of the `measured` velocity, of the `acceleration`, and `travelled`.

    The last is the change of the displacement by the length of the span, with its mean square `power`. Noise of the
    `own` velocity, and of the `derived` one; `expected` is the mean square difference from noise.
    """

    at: Floats
    measured: Floats
    travelled: Floats
    acceleration: Floats
    power: float
    own: float
    derived: float
    expected: float

    def misfit(self, candidate: Floats) -> float:
        """Rms difference in excess of noise, relative to the velocity."""
        beyond_noise = float(np.mean((candidate - self.travelled) ** 2)) - self.expected
        return float(np.sqrt(max(beyond_noise, 0.0) / self.power))

    def factor(self) -> float:
        """Regression coefficient of the velocity on that of the displacement."""
        return float(np.mean(self.measured * self.travelled)) / self.power

    def delay(self, differentiator: Differentiator) -> Measured:
        """Delay [s] by regression on the acceleration, to first order; a window counts as one sample."""
        power = float(np.mean(self.acceleration**2))
        late = -float(np.mean((self.measured - self.travelled) * self.acceleration)) / power
        left = float(np.mean((self.measured - self.travelled + late * self.acceleration) ** 2))
        n_independent = max(self.acceleration.size / differentiator.window, 1.0)
        error = float(np.sqrt(left / (power * n_independent)))
        return Measured(late, "s", standard_error=error)


# Percentiles of what a filter removes from a velocity; leaps of a few samples are beyond.
_WITHOUT_LEAPS: Final = (1.0, 99.0)


def _compare_velocities(
    velocity: Floats, displacement: Floats, motion: SmoothMotion, uncompared: Sequence[tuple[int, int]]
) -> _VelocityMisfit:
    differentiator = motion.differentiator
    span = differentiator.window // 2
    sound, outside = np.ones(velocity.size - span, dtype=np.bool_), np.ones(velocity.size, dtype=np.bool_)
    # A span with a sample that is interpolated, or beside a corner, says nothing.
    for first, last in uncompared:
        sound[max(first - span - 1, 0) : last + 1] = False
        outside[first:last] = False
    starts = np.flatnonzero(sound) if np.count_nonzero(sound) > span else np.arange(sound.size)

    def means(rate: Floats) -> Floats:
        """Integrals of cubics through four samples, over each span and divided by it."""
        steps = (
            np.convolve(np.pad(rate, 1, "reflect", reflect_type="odd"), [-1.0, 13.0, 13.0, -1.0], "valid")
            / 24.0
        )
        whole = np.append(0.0, np.cumsum(steps))
        return np.asarray((whole[span:] - whole[:-span])[starts] / span)

    travelled = (displacement[span:] - displacement[:-span])[starts] / (span * differentiator.dt)
    power = float(np.mean(travelled**2))
    removed = (velocity - differentiator.smooth(velocity))[outside if outside.any() else ...]
    own = differentiator.noise(removed.clip(*np.percentile(removed, _WITHOUT_LEAPS)))
    read = differentiator.noise(displacement - motion.displacement)
    noise = np.hypot(np.sqrt(2.0) * read / (span * differentiator.dt), own / np.sqrt(span))
    return _VelocityMisfit(
        at=np.asarray(starts + 0.5 * span, dtype=np.float64),
        measured=means(velocity),
        travelled=travelled,
        acceleration=means(motion.acceleration),
        power=power,
        own=own,
        derived=read * differentiator.noise_gain(1),
        # Limits the allowance for noise, so that a signal of mostly noise does not count as correct.
        expected=min(float(noise**2), _NOISE_SHARE**2 * power),
    )


_CENTRED: Final = RemarkKind(
    "force_centred",
    "the force was centred: its mean is zero to rounding, and the cycles are not whole, so that it has an offset of "
    "{value:+.3g} N, {share:.2g} % of its half range",
    "take it off by --repair offset, or give the force as it was measured",
    verbs=OF_FILES,
    cured_by="offset",
)
# Means of rounded numbers are zero within so many standard errors of rounding; offsets below this share of the half
# range are those of a few noisy cycles.
_ZERO, _NO_OFFSET = 4.0, 0.01


def centred_remark(test: DamperTest, motion: SmoothMotion) -> Iterator[Remark]:
    """Warn of a force whose mean over cycles that are not whole was subtracted, as its mean of zero shows."""
    force, cycles = test.force, regular_cycles(motion.displacement)
    if not cycles:
        return
    offset = float(force[cycles[0].start : cycles[-1].stop].mean())
    largest, half = float(np.abs(force).max()), half_range(force)
    of_rounding = float(np.median(last_digit(force))) / np.sqrt(12.0 * force.size)
    # Rounding of sums of doubles.
    zero = _ZERO * max(of_rounding, np.finfo(np.float64).eps * np.sqrt(force.size) * largest)
    if abs(float(force.mean())) <= zero and abs(offset) > _NO_OFFSET * half:
        yield _CENTRED.remark(measured=Measured(offset, "N"), share=100.0 * abs(offset) / half)
