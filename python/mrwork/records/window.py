"""Samples of a record: complete rows with a uniform step, without spikes, and the part that is used and compared."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from math import ceil
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import Count, checked
from mrwork.base.numbers import counted
from mrwork.base.values import Floats, array_dataclass, freeze_samples
from mrwork.dampers.command import Command, levels_of_command
from mrwork.dampers.laws import MOST_DEGREE, CommandLaw
from mrwork.errors import RecordError, SettingError
from mrwork.files.rounded_times import rounded_grid
from mrwork.records.damper_test import DamperTest, fields_of_commands
from mrwork.records.finding import ONCE, Finding, FindingKind, Measured
from mrwork.records.motion import runs_of, spectrum

FEWEST_SAMPLES: Final = 10
# Limits far beyond any damper test; arithmetic on larger values could overflow.
_LARGEST: Final = 1e12
_SHORTEST_STEP: Final = 1e-7
# Times no further apart than this repeat [s]; slopes between them would overflow.
_SAME: Final = 1e-12
_JITTER: Final = 1e-3
_GAP_STEPS: Final = 3.0


@array_dataclass()
class Signals:
    """Channels in SI on one time base, each of shape (n_time,); `commands` vary."""

    time: Floats
    displacement: Floats
    force: Floats
    velocity: Floats | None = None
    commands: tuple[Command, ...] = ()

    @property
    def measured(self) -> dict[str, Floats]:
        """Samples of displacement, force and velocity, where that was measured."""
        channels = {"displacement": self.displacement, "force": self.force}
        return channels if self.velocity is None else {**channels, "velocity": self.velocity}

    @property
    def channels(self) -> dict[str, Floats]:
        """Samples of every channel, the time and the commands included."""
        commands = {command.quantity: np.asarray(command.values) for command in self.commands}
        return {"time": self.time, **self.measured, **commands}

    def rows(self, chosen: slice) -> Signals:
        """The chosen samples of every channel."""
        return Signals(
            time=self.time[chosen],
            **{name: channel[chosen] for name, channel in self.measured.items()},
            commands=tuple(Command(np.asarray(values)[chosen], unit) for values, unit in self.commands),
        )


_DROPPED: Final = FindingKind(
    "nan_rows_dropped", "dropped incomplete rows: {start} at the start, {end} at the end", verbs=ONCE
)


def complete_rows(
    signals: Signals, *, source: str, locate: Callable[[int], str]
) -> tuple[Signals, int, tuple[Finding, ...]]:
    """Drop incomplete rows (NaN) at either end: the signals, the file row at which they start, and findings."""
    for name, channel in signals.channels.items():
        absurd = np.abs(channel) > _LARGEST
        if absurd.any():
            row = int(np.argmax(absurd))
            raise RecordError(
                f"{source}: {locate(row)}: the {name} is {channel[row]:g} in SI units, beyond any test; "
                "correct the value or its unit"
            )
        if np.isnan(channel).all():
            raise RecordError(f"{source}: the {name} has no value at all; fill the column or leave it out")
    complete = np.logical_and.reduce([np.isfinite(channel) for channel in signals.channels.values()])
    n_time = int(np.count_nonzero(complete))
    if n_time < FEWEST_SAMPLES:
        held = counted(n_time, "complete sample")
        raise RecordError(f"{source}: has {held}; a test needs at least {FEWEST_SAMPLES}")
    first = int(np.argmax(complete))
    last = complete.size - int(np.argmax(complete[::-1]))
    holes = np.flatnonzero(~complete[first:last])
    if holes.size:
        row = first + int(holes[0])
        missing = ", ".join(name for name, channel in signals.channels.items() if np.isnan(channel[row]))
        more = f", and {holes.size - 1} more rows are incomplete" if holes.size > 1 else ""
        raise RecordError(
            f"{source}: {locate(row)} has no value for {missing}{more}; fill in the values or delete the rows"
        )
    if last - first == complete.size:
        return signals, first, ()
    return signals.rows(slice(first, last)), first, (_DROPPED.found(start=first, end=complete.size - last),)


def check_time(time: Floats, *, source: str, locate: Callable[[int], str]) -> None:
    """Check that time increases."""
    wrong = np.flatnonzero(np.diff(time) <= _SAME)
    if wrong.size == 0:
        return
    row = int(wrong[0]) + 1
    now, before = time[row], time[row - 1]
    more = f" (as do {wrong.size - 1} more rows)" if wrong.size > 1 else ""
    if now >= before:
        raise RecordError(
            f"{source}: {locate(row)}: the time {now:g} s repeats the time of the row before{more}; "
            "write the time with more digits or delete the repeated rows"
        )
    raise RecordError(
        f"{source}: {locate(row)}: the time runs backwards, from {before:g} s to {now:g} s{more}; "
        "sort the rows or split the file into its tests"
    )


# Samples of the longest spike, and largest share of a record in spikes; what takes longer may be part of the test.
_LONGEST_SPIKE: Final = 5
_MOST: Final = 0.02
_FEWEST: Final = 50
# Percentiles within which a channel lies without its spikes, and the distance beyond, and the leap there and back
# between two samples, of a spike, in ranges between these percentiles. A sine reaches 0.001 beyond.
_WITHIN: Final = (2.0, 98.0)
_BEYOND: Final = 0.5


def spikes_of(samples: Floats) -> NDArray[np.bool_]:
    """Samples of a channel that lie in a spike, shape (n_time,).

    A spike is at most five samples long and lies beyond the range of the other samples by half of that range; the
    channel leaps by as much from one sample to the next, there and back.
    """
    is_spike = np.zeros(samples.size, dtype=np.bool_)
    low, high = np.percentile(samples, _WITHIN)
    reach = _BEYOND * (high - low)
    far = (samples < low - reach) | (samples > high + reach)
    if reach == 0.0 or samples.size < _FEWEST or np.count_nonzero(far) > _MOST * samples.size:
        return is_spike
    for first, last in runs_of(far):
        leaps = np.abs(np.diff(samples[max(first - 1, 0) : last + 1]))
        there = first == 0 or leaps[0] > reach
        back = last == samples.size or leaps[-1] > reach
        is_spike[first:last] = last - first <= _LONGEST_SPIKE and there and back
    return is_spike


_SEARCHED: Final = {"displacement": "m", "velocity": "m/s", "force": "N"}
_SPIKES: Final = FindingKind(
    "spikes",
    "the {0} has spikes to {value:.4g} {1} in {samples} at {at:.6g} s; they were bridged by straight lines, and are "
    "neither compared nor part of the tested ranges",
    "check the channel of the {0}",
)


def without_spikes(signals: Signals) -> tuple[Signals, NDArray[np.bool_], tuple[Finding, ...]]:
    """Signals with straight lines across the spikes, except in commands, and which samples these are."""
    bridged = np.zeros(signals.time.size, dtype=np.bool_)
    bridges: dict[str, Any] = {}
    findings = []
    for name, samples in signals.measured.items():
        spiky = spikes_of(samples)
        if not spiky.any():
            continue
        line = np.interp(signals.time, signals.time[~spiky], samples[~spiky])
        largest = float(samples[spiky][np.argmax(np.abs(samples[spiky]))])
        count = np.count_nonzero(spiky)
        findings.append(
            _SPIKES.found(
                name,
                unit := _SEARCHED[name],
                measured=Measured(largest, unit),
                samples="a sample" if count == 1 else f"{count} samples, the first",
                at=signals.time[spiky][0],
            )
        )
        bridges[name] = line
        bridged |= spiky
    return replace(signals, **bridges), bridged, tuple(findings)


@array_dataclass()
class UniformSamples:
    """Signals on a uniform grid of step `dt` [s].

    `spiky` and `missing` are the samples that no sensor gave, in spikes and in gaps, shape (n_time,).
    """

    signals: Signals
    dt: float
    spiky: NDArray[np.bool_]
    missing: NDArray[np.bool_]
    findings: tuple[Finding, ...] = ()


_ROUNDED_TIMES: Final = FindingKind(
    "time_rounded",
    "times are rounded, with steps of {least:.4g} to {most:.4g} ms; taken as uniform every {dt:.6g} ms ({rate:.6g} "
    "Hz), by regression on the number of the sample",
    verbs=ONCE,
)
_GAPS: Final = FindingKind(
    "gaps",
    "{gaps} of {value:.4g} s after {at:.6g} s ({steps:.0f} steps) was bridged by interpolation, and is not compared",
    "fit a part without it (--from, --until)",
)
_RESAMPLED: Final = FindingKind(
    "resampled",
    "time steps differ from their median of {median:.4g} ms by up to {share:.3g} %; resampled every {dt:.6g} ms by {0} "
    "interpolation",
    verbs=ONCE,
)


def uniform_step(signals: Signals, spiky: NDArray[np.bool_], *, source: str) -> UniformSamples:
    """Put signals, of which the `spiky` samples were bridged, shape (n_time,), on a uniform grid.

    Steps that differ from the median by more than 1e-3 of it are resampled to about that step: by a cubic spline, or by
    PCHIP, which does not overshoot, if there are gaps; stepped commands are held, others linear. Times that are uniform
    but for rounding are not resampled, because their samples were taken uniformly.
    """
    time = signals.time
    steps = np.diff(time)
    median = float(np.median(steps))
    duration = float(time[-1] - time[0])
    if median < _SHORTEST_STEP:
        raise RecordError(
            f"{source}: the time step is {median:.3g} s, below any rig's; check the unit of the time"
        )
    mean, none = duration / (time.size - 1), np.zeros_like(spiky)
    deviation = float(np.max(np.abs(steps - median)))
    if deviation <= _JITTER * median + 2.0 * np.spacing(np.max(np.abs(time))):
        return UniformSamples(signals=signals, dt=mean, spiky=spiky, missing=none)
    uniform = rounded_grid(time)
    if uniform is not None:
        dt = float(uniform[-1] - uniform[0]) / (time.size - 1)
        rounded = _ROUNDED_TIMES.found(
            least=1e3 * steps.min(), most=1e3 * steps.max(), dt=1e3 * dt, rate=1.0 / dt
        )
        uniform_signals = replace(signals, time=uniform)
        return UniformSamples(signals=uniform_signals, dt=dt, spiky=spiky, missing=none, findings=(rounded,))

    n_uniform = round(duration / median) + 1
    gaps = np.flatnonzero(steps > _GAP_STEPS * median)
    if n_uniform > 2 * time.size:
        raise RecordError(
            f"{source}: {time.size} samples of {1e3 * median:.4g} ms leave most of {duration:.4g} s empty "
            f"(largest gap {steps.max():.4g} s after {time[int(np.argmax(steps))]:.4g} s); "
            "cut out one continuous part"
        )
    findings: list[Finding] = []
    if gaps.size:
        longest = int(gaps[np.argmax(steps[gaps])])
        gap = Measured(float(steps[longest]), "s")
        count = "a gap" if gaps.size == 1 else f"{gaps.size} gaps, the longest"
        findings.append(_GAPS.found(measured=gap, gaps=count, at=time[longest], steps=gap.value / median))
    grid = np.linspace(time[0], time[-1], n_uniform)
    dt = duration / (n_uniform - 1)
    rule = "PCHIP" if gaps.size else "cubic spline"
    share = 100.0 * deviation / median
    findings.append(_RESAMPLED.found(rule, median=1e3 * median, share=share, dt=1e3 * dt))
    from scipy.interpolate import CubicSpline, PchipInterpolator  # slow to load, and rarely needed

    interpolator = PchipInterpolator if gaps.size else CubicSpline
    measured = {
        name: np.asarray(interpolator(time, channel)(grid), dtype=np.float64)
        for name, channel in signals.measured.items()
    }
    commands = tuple(command.resampled(time, grid) for command in signals.commands)
    before = np.clip(np.searchsorted(time, grid, side="right") - 1, 0, time.size - 2)
    # A sample of the grid lies between two of the record; next to one of them, it is measured.
    beside = np.minimum(grid - time[before], time[before + 1] - grid) > _JITTER * median
    missing = beside & (steps > _GAP_STEPS * median)[before]
    return UniformSamples(
        signals=Signals(time=grid, **measured, commands=commands),
        dt=dt,
        spiky=spiky[before] | spiky[before + 1],
        missing=missing,
        findings=tuple(findings),
    )


def settling_samples(displacement: Floats) -> int:
    """Number of samples until the damper has travelled half its peak-to-peak stroke.

    By then its hysteresis has lost the memory of the motion before the record.
    """
    travel = np.cumsum(np.abs(np.diff(displacement, prepend=displacement[0])))
    return int(np.searchsorted(travel, np.ptp(displacement) / 2))


def uncompared_spans(
    displacement: Floats, velocity: Floats, spiky: NDArray[np.bool_], missing: NDArray[np.bool_], dt: float
) -> tuple[tuple[int, int], ...]:
    """Spans of samples, first and beyond the last, that are not compared: in spikes, in gaps and after these.

    After a gap the damper must travel as far as it could have in it, at most half its peak-to-peak stroke, until its
    force no longer depends on the unknown motion. Arrays have shape (n_time,).
    """
    left_out = spiky | missing
    travel = np.cumsum(np.abs(np.diff(displacement, prepend=displacement[0])))
    fastest = float(np.abs(velocity).max())
    for first, last in runs_of(missing):
        unknown = min(0.5 * float(np.ptp(displacement)), (last - first + 1) * dt * fastest)
        left_out[first : int(np.searchsorted(travel, travel[last - 1] + unknown))] = True
    return runs_of(left_out)


def spans_with(
    spans: tuple[tuple[int, int], ...], left_out: NDArray[np.bool_]
) -> tuple[tuple[int, int], ...]:
    """Spans of samples together with other samples that are left out, shape (n_time,)."""
    chosen = left_out.copy()
    for first, last in spans:
        chosen[first:last] = True
    return runs_of(chosen)


@checked
def cut(
    test: DamperTest, *, start: float | None = None, end: float | None = None, every: Count = 1
) -> DamperTest:
    """Return a test with every `every`-th of its samples from `start` to `end` [s, in the time of the record].

    Raises
    ------
    SettingError
        If fewer than 10 samples would remain.
    """

    def sample_at(instant: float) -> int:
        sample = (instant - test.start_time) / test.dt - 1e-9
        return ceil(min(max(sample, 0.0), float(test.n_time)))

    first = 0 if start is None else sample_at(start)
    last = test.n_time if end is None else sample_at(end)
    n_kept = len(range(first, last, every))
    if n_kept < FEWEST_SAMPLES:
        raise SettingError(
            f"{test.label}: {n_kept} samples would remain of a record from "
            f"{test.time[0]:g} to {test.time[-1]:g} s; keep at least {FEWEST_SAMPLES}"
        )
    shorter = test.part(first, last, every)
    return replace(shorter, n_settle=settling_samples(shorter.displacement))


# Cycles for a settled loop, and samples per cycle that resolve its knees.
_EXCERPT_CYCLES = 3
_EXCERPT_PER_CYCLE = 400
# Longest step of an excerpt from the middle [s]: with longer ones a stiff loop wants more than the most sub-steps, a
# wall at which local minimisations stop.
_LONGEST_STEP = 0.04
# A motion whose band edge exceeds this multiple of its dominant frequency is not cyclic. It is only decimated, to this
# number of samples per period of the band edge.
_CYCLIC_BAND = 5.0
_PER_FASTEST = 40
# The shortest part of a record of a varying command, in periods of its dominant frequency; places where a part is
# looked for, in its own length; the shares that it has of the range of the motion, and of the time at each level.
_VARIED_CYCLES = 6
_PLACES = 8
_MOTION_SHARE = 0.8
_LEVEL_SHARE = 0.5
# Most stretches of such a record, the fewest, and the share of its time in the record that each level has in each.
_STRETCHES = range(6, 2, -1)
_STRETCH_SHARE = 0.1


def excerpt(test: DamperTest) -> DamperTest:
    """The first cycles of a cyclic test, decimated to a resolution that shows the loop, sufficient for a search.

    A motion of a wide band keeps its length, and so does a test whose command varies.
    """
    motion = spectrum(test.displacement, test.dt)
    if motion.dominant <= 0.0:
        return test
    thin = max(1, int(1.0 / (motion.dominant * test.dt * _EXCERPT_PER_CYCLE)))
    if motion.band_edge > _CYCLIC_BAND * motion.dominant:
        return _thinned(test, max(1, int(1.0 / (motion.band_edge * test.dt * _PER_FASTEST))))
    if test.has_varying_command:
        return _thinned(test, thin)
    return cut(test, end=test.start_time + _excerpt_seconds(test, motion.dominant), every=thin)


def _thinned(test: DamperTest, every: int) -> DamperTest:
    """Every `every`-th sample, with the mean of a varying command until the next: the coil lags behind both alike."""
    starts = np.arange(0, test.n_time, every)
    lengths = np.diff(starts, append=test.n_time)
    means = [
        Command(freeze_samples(np.add.reduceat(values, starts) / lengths), unit)
        for values, unit in test.commands
        if isinstance(values, np.ndarray)
    ]
    return replace(cut(test, every=every), **fields_of_commands(means))


def varied_excerpt(test: DamperTest) -> DamperTest:
    """The shortest part of an `excerpt`, or the whole, that shows what the whole record of a varying command does.

    It has every level of the command, for half of its share of the time, and most of the range of the motion.
    """
    whole = excerpt(test)
    levels = [_at_levels(command) for command, _ in whole.commands if isinstance(command, np.ndarray)]
    dominant = spectrum(whole.displacement, whole.dt).dominant
    if not levels or dominant <= 0.0:
        return whole
    length = ceil(_VARIED_CYCLES / (dominant * whole.dt))
    while 2 * length <= whole.n_time:
        for first in range(0, whole.n_time - length + 1, max(length // _PLACES, 1)):
            part = slice(first, first + length)
            if _shows_motion(whole, part) and all(_shows_levels(level, part) for level in levels):
                shortest = whole.part(part.start, part.stop)
                return replace(shortest, n_settle=settling_samples(shortest.displacement))
        length *= 2
    return whole


def stretches_of(test: DamperTest) -> tuple[DamperTest, ...]:
    """Stretches of a record of a varying command, three to six, each of which shows what a cubic law needs.

    These are all levels of the command, or what is next to each of four of them. Each stretch is simulated from rest
    while the damper travels half its stroke before it, and compared from there on. A record of which there are fewer,
    or of a constant command, stays whole.
    """
    levels = [
        _at_levels(command, MOST_DEGREE) for command, _ in test.commands if isinstance(command, np.ndarray)
    ]
    travel = np.cumsum(np.abs(np.diff(test.displacement, prepend=test.displacement[0])))
    for count in _STRETCHES if levels else ():
        ends = np.linspace(test.n_settle, test.n_time, count + 1).astype(int).tolist()
        spans = list(pairwise(ends))
        if not all(_shows_levels(level, slice(*span), _STRETCH_SHARE) for level in levels for span in spans):
            continue
        parts = []
        for start, end in spans:
            before = travel[start] - 0.5 * float(np.ptp(test.displacement[start:end]))
            first = int(np.searchsorted(travel, before)) if start > test.n_settle else 0
            name = f"{test.name} from {test.time[start]:.4g} to {test.time[end - 1]:.4g} s"
            part = replace(test.part(first, end), name=name, path="", sha256="", n_settle=start - first)
            parts.append(part)
        return tuple(parts)
    return (test,)


def _at_levels(command: Floats, degree: int | None = None) -> NDArray[np.intp]:
    """Number of the nearest level of each sample of a command, (n_time,), among as many as a `degree` needs."""
    every = levels_of_command(command)
    levels = np.array(CommandLaw(degree).at_commands(every, logarithms=True).nodes or every)
    return np.searchsorted(0.5 * (levels[:-1] + levels[1:]), command)


def _shows_levels(at_level: NDArray[np.intp], part: slice, share: float = _LEVEL_SHARE) -> bool:
    whole, portion = (np.bincount(bins, minlength=at_level.max() + 1) for bins in (at_level, at_level[part]))
    return bool(np.all(portion / portion.sum() >= share * whole / whole.sum()))


def _shows_motion(test: DamperTest, part: slice) -> bool:
    motion = (test.displacement, test.velocity)
    return all(float(np.ptp(signal[part])) >= _MOTION_SHARE * float(np.ptp(signal)) for signal in motion)


def _excerpt_seconds(test: DamperTest, frequency: float) -> float:
    return (test.n_time - test.n_counted) * test.dt + _EXCERPT_CYCLES / frequency


def middle_excerpt(test: DamperTest, *, per_cycle: int) -> DamperTest:
    """As many cycles from the middle of a cyclic test, with `per_cycle` samples, slow ones in steps of 0.04 s.

    They represent a drifting force better than the first ones. Another motion, and a test whose command varies, is
    treated as by `excerpt`.
    """
    motion = spectrum(test.displacement, test.dt)
    is_cyclic = motion.dominant > 0.0 and motion.band_edge <= _CYCLIC_BAND * motion.dominant
    if not is_cyclic or test.has_varying_command:
        return excerpt(test)
    length = _excerpt_seconds(test, motion.dominant)
    start = test.start_time + max(0.0, (test.n_time * test.dt - length) / 2.0)
    thin = max(1, int(min(1.0 / (motion.dominant * per_cycle), _LONGEST_STEP) / test.dt))
    return cut(test, start=start, end=start + length, every=thin)


def count_samples_from(test: DamperTest, settle: float) -> DamperTest:
    """Return the test with the first `settle` seconds simulated but not compared."""
    n_settle = ceil(settle / test.dt - 1e-9)
    if settle < 0 or test.n_time - n_settle < FEWEST_SAMPLES:
        raise SettingError(
            f"{test.label}: --settle is {settle:g} s of a record of {test.dt * test.n_time:g} s; "
            f"give 0 or more, and leave at least {FEWEST_SAMPLES} samples"
        )
    return replace(test, n_settle=n_settle)
