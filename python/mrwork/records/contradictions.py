"""Detectors of channels that contradict each other or themselves: they stand still, jump, drift, or repeat a part.

A measured velocity contradicts the displacement where it differs from its derivative. One that is noisier is not used,
nor is one that is late by its making: computed as a difference of the displacement, or held over several samples.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import permutations, product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.units import FACTORS
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import RecordError
from mrwork.records.checks import held_samples
from mrwork.records.damper_test import DamperTest, Finding, Measured, VelocitySource
from mrwork.records.motion import Smoother, SmoothMotion, regular_cycles, runs_of

_MAD_TO_DEVIATION: Final = 1.4826
# Beyond this share of the range to either side of its middle a channel is on that side.
_SIDE: Final = 0.25
# A channel of white noise spans 9 standard deviations in 1e5 samples, and does not go 5 to either side. It never stands
# still with more than this share of its range.
_STILL_NOISE: Final = 10.0
_STILL: Final = 0.005
# The other channel takes this share of a period at least to get to its other side.
_SHORTEST_SWING: Final = 0.15
# What rounding leaves of a channel that stands still, as a share of its range.
_ROUNDING: Final = 1e-6


def still_findings(test: DamperTest, motion: SmoothMotion) -> Iterator[Finding]:
    """Warn of a displacement or a force that stands still while the other goes to either side of its range and back.

    A damper held at rest keeps the sign of its force, whatever its command does; one that moves to and fro has a force
    of either sign, which may be constant on one way.
    """
    smoothed = {
        "displacement": (test.displacement, motion.displacement),
        "force": (test.force, motion.smoother.smooth(test.force)),
    }
    for name, other, code, least_swings in (
        ("displacement", "force", "displacement_still", 1),
        ("force", "displacement", "force_still", 2),
    ):
        spans = _still_spans(*smoothed[name], *smoothed[other], motion, least_swings)
        if not spans:
            continue
        seconds = test.dt * sum(last - first for first, last in spans)
        begin = test.start_time + test.dt * spans[0][0]
        message = (
            f"the {name} stands still for {seconds:.3g} s, first from {begin:.3g} s on, while the {other} goes from "
            f"one side to the other{' and back' if least_swings > 1 else ''}"
        )
        action = f"check the sensor of the {name} and its cable, or omit that part (--from, --until)"
        yield Finding.warning(code, message, action=action, measured=Measured(seconds, "s"))


def _still_spans(
    raw: Floats, smooth: Floats, raw_moving: Floats, moving: Floats, motion: SmoothMotion, least_swings: int
) -> list[tuple[int, int]]:
    """Spans of samples, first and beyond the last, in which `moving` changes sides and the other stands still."""
    low, high = np.percentile(moving, [1.0, 99.0])
    if high - low <= 2.0 * _STILL_NOISE * _noise(raw_moving, moving):
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
    noise = _noise(raw, smooth) * motion.smoother.noise_gain(0)
    stroke = float(np.ptp(smooth))
    least = max(min(_STILL_NOISE * noise, _STILL * stroke), _ROUNDING * stroke)
    padded = np.append(smooth, smooth[-1])
    ranges = (np.maximum.reduceat(padded, swings.ravel()) - np.minimum.reduceat(padded, swings.ravel()))[::2]
    shortest = _SHORTEST_SWING / (motion.frequency * motion.smoother.dt)
    runs = (run for run in runs_of(ranges <= least) if run[1] - run[0] >= least_swings)
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


def _noise(raw: Floats, smooth: Floats) -> float:
    """Standard deviation of what smoothing took away; the median passes over jumps."""
    return _MAD_TO_DEVIATION * float(np.median(np.abs(raw - smooth)))


# A jump exceeds the steps before and after it by this multiple of the noise of that difference, of the largest other
# steps, and of the stroke. Half of the path of a staircase is jumps, and that is how it was driven.
_JUMP_NOISE: Final = 10.0
_JUMP_STEPS: Final = 2.0
_JUMP: Final = 0.02
_OF_THE_PATH: Final = 0.5
_PLACES_OF_PATH: Final = 200


def jump_finding(test: DamperTest, _: SmoothMotion) -> Iterator[Finding]:
    """Warn of a displacement that jumps within a sample between parts that move smoothly, as of a sensor that slips."""
    displacement = test.displacement
    steps = np.diff(displacement)
    if steps.size < 3:
        return
    beyond = np.abs(steps[1:-1] - 0.5 * (steps[:-2] + steps[2:]))
    noise = _MAD_TO_DEVIATION * float(np.median(beyond))
    usual = float(np.percentile(np.abs(steps), 99.0))
    least = max(_JUMP_NOISE * noise, _JUMP_STEPS * usual, _JUMP * float(np.ptp(displacement)))
    # The steps beside a jump differ from theirs by half of it.
    padded = np.pad(beyond, 1)
    jumps = 1 + np.flatnonzero((beyond > least) & (beyond >= padded[:-2]) & (beyond > padded[2:]))
    for first, last in test.uncompared:
        jumps = jumps[(jumps + 1 < first) | (jumps >= last)]
    every = max(displacement.size // _PLACES_OF_PATH, 1)
    path = float(np.abs(np.diff(displacement[::every])).sum())
    if jumps.size == 0 or np.abs(steps[jumps]).sum() > _OF_THE_PATH * path:
        return
    largest = int(jumps[np.argmax(np.abs(steps[jumps]))])
    size = float(abs(steps[largest]))
    others = f" and {jumps.size - 1} times more" if jumps.size > 1 else ""
    message = (
        f"the displacement jumps by {1e3 * size:.3g} mm within a sample of {1e3 * test.dt:.3g} ms, at "
        f"{test.start_time + test.dt * largest:.4g} s{others}: that is {size / test.dt:.3g} m/s, and "
        f"{usual / test.dt:.3g} m/s is the most elsewhere"
    )
    action = "check its sensor for slip and the record for a cut, and use the part before or after (--from, --until)"
    yield Finding.warning("displacement_jumps", message, action=action, measured=Measured(size, "m"))


# A drift moves the displacement by this multiple of what its stroke would be without; beyond the other it is a ramp.
_DRIFT: Final = 0.25
_RAMP: Final = 60.0
_FEWEST_CYCLES: Final = 3
# Residual of the force without the drift, relative to that with it, below which the drift is none of the damper.
_BETTER: Final = 0.8
# Hysteresis and width of the force about the reversal, in peak velocities.
_HYSTERESIS: Final = (0.0, 0.1, 0.2, 0.4)
_WIDTHS: Final = (0.03, 0.1, 0.3)
_MOST_SAMPLES: Final = 2000


def drift_of_displacement_finding(test: DamperTest, motion: SmoothMotion) -> Iterator[Finding]:
    """Warn of a displacement channel that drifts [m/s], as the force does not.

    The displacement, or the centre of its cycles where it has regular ones, moves on steadily. A damper that is driven
    so reverses its force where the recorded velocity is zero; a channel that drifts has that velocity shifted by its
    drift.
    """
    time = test.dt * np.arange(test.n_time)
    drift, level = (float(each) for each in np.polyfit(time, motion.displacement, 1))
    cycles = regular_cycles(motion.displacement - drift * time)
    if len(cycles) >= _FEWEST_CYCLES:
        at = np.array([time[cycle].mean() for cycle in cycles])
        centre = np.array([motion.displacement[cycle].mean() for cycle in cycles])
        drift, level = (float(each) for each in np.polyfit(at, centre, 1))
    stroke = max(np.ptp(motion.displacement - drift * time), np.finfo(float).tiny)
    seconds = test.n_time * test.dt
    if not _DRIFT < abs(drift) * seconds / stroke < _RAMP:
        return
    kept = slice(None, None, max(test.n_time // _MOST_SAMPLES, 1))
    recorded, moved = motion.displacement[kept], motion.velocity[kept]
    centred = recorded - level - drift * time[kept]
    as_recorded = _least_residual(test.force[kept], recorded, moved, centred)
    without = _least_residual(test.force[kept], centred, moved - drift, centred)
    if without >= _BETTER * as_recorded:
        return
    message = (
        f"the displacement drifts by {1e3 * drift:+.3g} mm/s, {1e3 * drift * seconds:+.3g} mm over the record, and the "
        "force reverses as if the damper did not"
    )
    action = "check the sensor, its zero and its fastening, and subtract the drift"
    yield Finding.warning("displacement_drifts", message, action=action, measured=Measured(drift, "m/s"))


def _least_residual(force: Floats, displacement: Floats, velocity: Floats, centred: Floats) -> float:
    """Least residual of f0 + k x + c v + f tanh((v + h w x) / s) over hysteresis h and width s, with w from both."""
    peak = float(np.percentile(np.abs(velocity), 99.0))
    quadrature = peak * centred / float(np.percentile(np.abs(centred), 99.0))
    linear = (np.ones_like(force), displacement, velocity)
    return min(
        float(np.linalg.norm(force - columns @ np.linalg.lstsq(columns, force, rcond=None)[0]))
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


def repeated_part(test: DamperTest, motion: SmoothMotion) -> Iterator[Finding]:
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
    if copied < _COPIED * test.n_time or lag * test.dt * motion.frequency < _LONGER_THAN_PERIODIC:
        return
    seconds = copied * test.dt
    message = (
        f"the last {seconds:.3g} s are a copy of what was recorded {lag * test.dt:.4g} s before, to the last digit, "
        "and count twice"
    )
    action = "use the record up to there (--until)"
    yield Finding.warning("part_repeated", message, action=action, measured=Measured(seconds, "s"))


_MISFIT: Final = 0.10
_NOISE_SHARE: Final = 0.5
_PHASE: Final = 0.02
# What a column late by several samples loses of its regression coefficient on the derivative, at most.
_SAME_MOTION: Final = 0.5
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
OFF_BY_CLOCK: Final = "time_factor"
# Steps of a clock that is slow or fast by a thousand, and the units that were confused, by the ratio of the velocity to
# the derivative: damper tests are sampled at 20 Hz to 50 kHz.
_SLOW_CLOCK: Final = 0.05
_FAST_CLOCK: Final = 2e-5
_CLOCKS: Final = {1e3: ("ms", "s"), 1e6: ("us", "s"), 1e-3: ("s", "ms"), 1e-6: ("s", "us")}


def refuse_velocity(test: DamperTest) -> None:
    """Refuse a test whose velocity is a known factor times the derivative of the displacement."""
    for finding in test.findings:
        if finding.code in (OFF_BY_FACTOR, OFF_BY_CLOCK):
            refusal = RecordError(f"{test.label}: {finding.message}")
            refusal.of_columns = True
            raise refusal


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
    return (Finding.note("velocity_noisy", message, measured=Measured(own, "m/s")),)


# A difference lies within the last digits of both channels at this share of the samples at least, and within this share
# of the distance from the central difference. Its steps are the recorded ones or, where these vary, their mean, with a
# gain near one, because times that are rounded do not tell it better.
_WITHIN_DIGITS: Final = 0.99
_NEARER: Final = 0.5
_SLACK: Final = 1.001
_SLACK_OF_GAIN: Final = 1.1
_GAIN: Final = 0.01
_UNIFORM: Final = 1e-6
_MOST_DIGITS: Final = 8
_SINGLE: Final = 2.0**-24
_INCH: Final = FACTORS["displacement"]["in"]


def late_by_making(time: Floats, displacement: Floats, velocity: Floats) -> tuple[Finding, ...]:
    """Note a velocity column that is held while the displacement is not, or a difference of the displacement column."""
    held = held_samples(velocity)
    if held > 1 and held_samples(displacement) == 1:
        lag, code, does = 0.5 * (held - 1), "velocity_held", "lags in the mean"
        what = f"has a new value in one of {held} samples, the displacement in each"
    elif lag := _lag_of_difference(time, displacement, velocity):
        kind, does = ("backward", "lags") if lag > 0.0 else ("forward", "leads")
        code, what = "velocity_difference", f"is the {kind} difference of the displacement, to the last digit"
    else:
        return ()
    late = Measured(lag * float(np.mean(np.diff(time))), "s")
    message = (
        f"the velocity {what}, and {does} by {1e3 * abs(late.value):.3g} ms ({abs(lag):g} samples); it is not used, "
        "and the velocity is derived from the displacement as if none were given; --keep-velocity keeps the column"
    )
    return (Finding.note(code, message, measured=late),)


def _lag_of_difference(time: Floats, displacement: Floats, velocity: Floats) -> float:
    """Lag, in samples, of a velocity column that is a difference of the displacement column, as both are written.

    It is 0.5 for backward and -0.5 for forward differences, and 0 for any other column: a measured velocity has noise
    of its own, and does not repeat that of the displacement. Where the last digits hide half a sample it is 0, too.
    """
    recorded, changes = np.diff(time), np.diff(displacement)
    mean = np.full_like(recorded, np.mean(recorded))
    is_uniform = np.ptp(recorded) <= _UNIFORM * mean[0]
    for lag, column in ((0.5, velocity[1:]), (-0.5, velocity[:-1])):
        for steps, free_gain in ((recorded, False), *(() if is_uniform else ((mean, True),))):
            difference = changes / steps
            power = float(difference @ difference)
            gain = float(column @ difference) / max(power, np.finfo(float).tiny)
            if abs(abs(gain) - 1.0) > _GAIN:
                continue
            difference *= gain if free_gain else np.sign(gain)
            central = 0.5 * (difference[1:] + difference[:-1])
            inner = slice(None, -1) if lag > 0.0 else slice(1, None)
            left = np.abs(column - difference)
            if np.sum(left[inner] ** 2) >= _NEARER**2 * np.sum((column[inner] - central) ** 2):
                continue
            rounding = _half_digit(displacement)
            allowed = _half_digit(column) + (rounding[1:] + rounding[:-1]) / steps
            if np.mean(left <= (_SLACK_OF_GAIN if free_gain else _SLACK) * allowed) >= _WITHIN_DIGITS:
                return lag
    return 0.0


def _half_digit(samples: Floats) -> Floats:
    """Half a unit of the last digit of each sample, in SI or inches, with a fixed number of decimals or of digits.

    Samples with more than 8 digits are taken for numbers of single precision at least.
    """
    half = _SINGLE * np.abs(samples)
    for unit in (1.0, _INCH):
        written = samples / unit
        size = np.maximum(np.abs(written), np.finfo(float).tiny)
        decades = np.floor(np.log10(size * (1.0 + 1e-12)))
        for decade in (decades, np.full_like(decades, decades.max())):
            for digits in range(_MOST_DIGITS):
                step = 10.0 ** (decade - digits)
                rest = np.abs(written - step * np.rint(written / step))
                if np.mean(rest <= 8.0 * np.finfo(float).eps * size) >= _WITHIN_DIGITS:
                    half = np.maximum(half, 0.5 * unit * step)
                    break
    return half


def velocity_agrees(
    velocity: Floats,
    displacement: Floats,
    motion: SmoothMotion,
    uncompared: Sequence[tuple[int, int]] = (),
    *,
    late: tuple[Finding, ...] = (),
) -> tuple[Floats, VelocitySource, tuple[Finding, ...]]:
    """Compare a measured velocity with the derivative of the displacement; return the one to use.

    Both are smoothed alike, and the difference expected from their noise is subtracted, up to half of the signal.
    A velocity that agrees after a change of sign gets that sign. Other differences are only reported, with the delay or
    the factor that explains them; tests with the factor of two units are refused by `refuse_velocity` where they are
    fitted or predicted. A velocity of the same motion that is far noisier than the derivative is replaced by it, and so
    is one that is `late` by its making, unless the derivative loses more by smoothing than that costs.

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
        turned, source, opposite = velocity_agrees(-velocity, displacement, motion, uncompared, late=late)
        return turned, source, (Finding.note("velocity_sign_flipped", message), *opposite)
    factor = comparison.factor()
    if abs(factor) > _SMALLEST_FACTOR and abs(factor - 1.0) > _MISFIT:
        rescaled = _compare_velocities(velocity / factor, displacement, motion, kept)
        if rescaled.misfit(rescaled.measured) <= _MISFIT:
            return velocity, "measured", (_off_by(factor, smoother.dt),)

    delayed = comparison.delay(motion.acceleration[kept], smoother)
    delay = delayed.value
    time = smoother.dt * np.arange(velocity.size)[kept]
    delay_explains = comparison.misfit(np.interp(time + delay, time, measured)) < 0.5 * difference
    replaced: tuple[Finding, ...] = ()
    if difference <= _MISFIT:
        noise = smoother.noise((displacement - motion.displacement)[kept])
        replaced = noisy_velocity(smoother.noise((velocity - smoother.smooth(velocity))[kept]), noise, motion)
    if late and not replaced and abs(factor - 1.0) < _SAME_MOTION:
        central, counts = np.gradient(displacement, smoother.dt), np.zeros_like(displacement)
        counts[kept] = 1.0
        # The difference of a first or last sample has no neighbour, and is what its author put there.
        counts[[0, -1]] = 0.0
        lost, costs = (counts @ (each - central) ** 2 for each in (motion.velocity, velocity))
        replaced = late if lost < costs else ()
    if replaced:
        return motion.velocity, "derived", replaced
    if difference <= _MISFIT:
        half_sample = 0.4 < delay / smoother.dt < 0.6
        if not delay_explains or not (half_sample or 2.0 * np.pi * motion.frequency * abs(delay) >= _PHASE):
            return velocity, "measured", ()
        message = f"the velocity {_shift(delay, smoother.dt)}"
        if half_sample:
            message += ", as backward differences do"
        return velocity, "measured", (Finding.note("velocity_late", message, measured=delayed),)

    if delay_explains:
        message = f"the velocity {_shift(delay, smoother.dt)}, a difference of {100 * difference:.0f} % (rms)"
        return velocity, "measured", (_inconsistent(message, _CHECK, delayed),)
    message = f"the velocity differs from the displacement's derivative by {100 * difference:.0f} % (rms)"
    return velocity, "measured", (_inconsistent(message, "check that both columns belong to this test"),)


_CHECK: Final = "check both, or derive the velocity from the displacement by --repair velocity"


def _off_by(factor: float, dt: float) -> Finding:
    """Finding of a velocity that is a factor times the derivative at steps `dt` [s], with its explanation if known."""
    times = f"the velocity is {factor:.4g} times the displacement's derivative"
    measured = Measured(factor, "")
    size = abs(factor)
    for ratio, (own, taken) in _CLOCKS.items():
        clock_is_off = dt >= _SLOW_CLOCK if ratio > 1.0 else dt <= _FAST_CLOCK
        if clock_is_off and abs(size / ratio - 1.0) <= _OF_UNITS:
            message = (
                f"{times}, and its steps are {dt:.4g} s, as where a time in {own} is taken for one in {taken}"
            )
            action = f"give the unit of the time, as in --column time=COLUMN:{own}; if the time is right, the unit of "
            action += "the velocity or the displacement is not"
            return Finding.warning(OFF_BY_CLOCK, message, action=action, measured=measured)
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
        return Measured(late, "s", standard_error=error)


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
    expected = min(float(noise**2), _NOISE_SHARE**2 * power)
    return _VelocityMisfit(measured=measured, derivative=derivative, power=power, expected=expected)


def _shift(delay: float, dt: float) -> str:
    late = "lags" if delay > 0.0 else "leads"
    return (
        f"{late} the displacement's derivative by {1e3 * abs(delay):.3g} ms ({abs(delay) / dt:.2f} samples)"
    )
