"""Samples of a record: complete rows with a uniform step, without spikes, and the part that is used and compared."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, replace
from math import ceil
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import Count, checked
from mrwork.base.numbers import counted
from mrwork.base.remark import ONCE, Measured, Remark, RemarkKind
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.command import Command, sample_runs
from mrwork.errors import RecordError, SettingError
from mrwork.files.grid import JITTER, Grid, grid
from mrwork.records.damper_test import DamperTest

FEWEST_SAMPLES: Final = 10
# Limits far beyond any damper test; arithmetic on larger values could overflow.
_LARGEST: Final = 1e12
_SHORTEST_STEP: Final = 1e-7
MOST_IN_GAPS: Final = 0.5
"""A record with a larger share of its time in gaps is none, but bursts."""
# Share of rows that repeat the time of the row before, from which on the clock is slower than the samples.
_OFTEN: Final = 0.2


@array_dataclass()
class Signals:
    """Channels in SI on one time base, each of shape (n_time,); `commands` vary.

    `spiky` and `missing` are the samples that no sensor gave, in spikes and in gaps.
    """

    time: Floats
    displacement: Floats
    force: Floats
    velocity: Floats | None = None
    commands: tuple[Command, ...] = ()
    spiky: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((), dtype=np.bool_))
    missing: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((), dtype=np.bool_))

    @property
    def dt(self) -> float:
        """Mean step [s]."""
        return float(self.time[-1] - self.time[0]) / (self.time.size - 1)

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
        measured: dict[str, Any] = {name: channel[chosen] for name, channel in self.measured.items()}
        commands = tuple(Command(np.asarray(values)[chosen], unit) for values, unit in self.commands)
        return Signals(time=self.time[chosen], **measured, commands=commands)


_DROPPED: Final = RemarkKind(
    "nan_rows_dropped", "dropped incomplete rows: {start} at the start, {end} at the end", verbs=ONCE
)


def complete_rows(
    signals: Signals, remarks: list[Remark], *, source: str, locate: Callable[[int], str]
) -> Signals:
    """Drop incomplete rows (NaN) at either end, with a remark; what is left must have a time that increases."""
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
            f"{source}: {locate(row)} has no value for {missing}{more}; fill in the values, delete the rows, or take a "
            "part without them (--from, --until)"
        )
    if last - first < complete.size:
        remarks.append(_DROPPED.remark(start=first, end=complete.size - last))
    wrong = first + grid(signals.time[first:last]).falls
    if wrong.size == 0:
        return signals.rows(slice(first, last))
    row = int(wrong[0])
    now, before = signals.time[row], signals.time[row - 1]
    more = f" (as do {wrong.size - 1} more rows)" if wrong.size > 1 else ""
    if wrong.size > _OFTEN * (last - first) and now >= before:
        instants = np.unique(signals.time[first:last])
        if np.all(np.diff(signals.time[first:last]) >= 0.0) and instants.size > 1:
            rate = (last - first) / instants.size / float(np.median(np.diff(instants)))
            raise RecordError(
                f"{source}: {locate(row)}: the time {now:g} s repeats that of the row before{more}, as of a "
                f"clock that is slower than the samples; if these are uniform, give their rate, about {rate:.4g} Hz, "
                f"as in --column time={rate:.4g}Hz"
            )
    if now >= before:
        raise RecordError(
            f"{source}: {locate(row)}: the time {now:g} s repeats the time of the row before{more}; "
            "write the time with more digits or delete the repeated rows"
        )
    raise RecordError(
        f"{source}: {locate(row)}: the time runs backwards, from {before:g} s to {now:g} s{more}; read each sweep as a "
        f"test of its own, as {source}#1, or take the first one (--until {before:g})"
    )


# Samples of the longest spike, and largest share of a record in spikes; what takes longer may be part of the test.
_LONGEST_SPIKE: Final = 5
_MOST_IN_SPIKES: Final = 0.02
_FEWEST_WITH_SPIKES: Final = 50
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
    if (
        reach == 0.0
        or samples.size < _FEWEST_WITH_SPIKES
        or np.count_nonzero(far) > _MOST_IN_SPIKES * samples.size
    ):
        return is_spike
    for first, last in sample_runs(far):
        leaps = np.abs(np.diff(samples[max(first - 1, 0) : last + 1]))
        there = first == 0 or leaps[0] > reach
        back = last == samples.size or leaps[-1] > reach
        is_spike[first:last] = last - first <= _LONGEST_SPIKE and there and back
    return is_spike


_SEARCHED: Final = {"displacement": "m", "velocity": "m/s", "force": "N"}
_SPIKES: Final = RemarkKind(
    "spikes",
    "the {0} has spikes to {value:.4g} {1} in {samples} at {at:.6g} s; they were bridged by straight lines, and are "
    "neither compared nor part of the tested ranges",
    "check the channel of the {0}",
)


def without_spikes(signals: Signals, remarks: list[Remark]) -> Signals:
    """Signals with straight lines across the spikes, except in commands, each channel with a remark."""
    bridged = np.zeros(signals.time.size, dtype=np.bool_)
    bridges: dict[str, Any] = {}
    for name, samples in signals.measured.items():
        spiky = spikes_of(samples)
        if not spiky.any():
            continue
        largest = float(samples[spiky][np.argmax(np.abs(samples[spiky]))])
        count = np.count_nonzero(spiky)
        remarks.append(
            _SPIKES.remark(
                name,
                unit := _SEARCHED[name],
                measured=Measured(largest, unit),
                samples="a sample" if count == 1 else f"{count} samples, the first",
                at=signals.time[spiky][0],
            )
        )
        bridges[name] = np.interp(signals.time, signals.time[~spiky], samples[~spiky])
        bridged |= spiky
    return replace(signals, **bridges, spiky=bridged, missing=np.zeros_like(bridged))


_ROUNDED_TIMES: Final = RemarkKind(
    "time_rounded",
    "times are rounded, with steps of {least:.4g} to {most:.4g} ms; taken as uniform every {dt:.6g} ms ({rate:.6g} "
    "Hz), by regression on the number of the sample",
    verbs=ONCE,
)
_GAPS: Final = RemarkKind(
    "gaps",
    "{gaps} of {value:.4g} s after {at:.6g} s ({steps:.0f} steps) was bridged by interpolation, and is not compared",
    "fit a part without it (--from, --until)",
)
_RATE: Final = RemarkKind(
    "rate_changes",
    "the sampling rate is {first:.4g} Hz, and {changes}; resampled every {dt:.6g} ms by {rule}, of which the instants "
    "of samples are compared",
    verbs=ONCE,
)
_RESAMPLED: Final = RemarkKind(
    "resampled",
    "time steps differ from their median of {median:.4g} ms by up to {share:.3g} %; resampled every {dt:.6g} ms by {0}",
    verbs=ONCE,
)


def uniform_step(signals: Signals, remarks: list[Remark], *, source: str) -> Signals:
    """Put signals on a uniform grid, with remarks.

    Steps that differ from the median by more than 1e-3 of it are resampled to about that step, or to the shortest of a
    record with several rates; stepped commands are held, others linear. Times that are uniform but for rounding are not
    resampled, because their samples were taken uniformly.
    """
    time = signals.time
    times = grid(time)
    steps, median = times.steps, times.median
    duration = float(time[-1] - time[0])
    if median < _SHORTEST_STEP:
        raise RecordError(
            f"{source}: the time step is {median:.3g} s, below any rig's; check the unit of the time"
        )
    if times.regular.all():
        return signals
    if times.uniform is not None:
        signals = replace(signals, time=times.uniform)
        least, most, dt = 1e3 * steps.min(), 1e3 * steps.max(), signals.dt
        remarks.append(_ROUNDED_TIMES.remark(least=least, most=most, dt=1e3 * dt, rate=1.0 / dt))
        return signals

    rates = times.rates
    step = min(each for _, each in rates)
    n_uniform, gaps = round(duration / step) + 1, times.gaps
    if times.share_in_gaps > MOST_IN_GAPS:
        raise RecordError(
            f"{source}: {time.size} samples of {1e3 * median:.4g} ms leave most of {duration:.4g} s empty "
            f"(largest gap {steps.max():.4g} s after {time[int(np.argmax(steps))]:.4g} s); "
            f"read each burst as a test of its own, as {source}#1, or take one (--from, --until)"
        )
    if gaps.size:
        longest = int(gaps[np.argmax(steps[gaps])])
        gap = Measured(float(steps[longest]), "s")
        count = "a gap" if gaps.size == 1 else f"{gaps.size} gaps, the longest"
        remarks.append(_GAPS.remark(measured=gap, gaps=count, at=time[longest], steps=gap.value / median))
    even = np.linspace(time[0], time[-1], n_uniform)
    dt = duration / (n_uniform - 1)
    rule = "local cubics" if times.is_uneven or len(rates) > 1 else "cubic spline"
    if len(rates) > 1:
        changes = [f"from {time[row]:.6g} s on {1.0 / each:.4g} Hz" for row, each in rates[1:]]
        remarks.append(
            _RATE.remark(first=1.0 / rates[0][1], changes=", ".join(changes), dt=1e3 * dt, rule=rule)
        )
    else:
        share = 100.0 * float(np.max(np.abs(steps - median))) / median
        remarks.append(_RESAMPLED.remark(rule, median=1e3 * median, share=share, dt=1e3 * dt))
    before = np.clip(np.searchsorted(time, even, side="right") - 1, 0, time.size - 2)
    # A sample of the grid lies between two of the record; next to one of them, it is measured.
    beside = np.minimum(even - time[before], time[before + 1] - even) > JITTER * median
    missing = beside & np.isin(before, gaps)
    measured = {
        name: _between(times, channel, even, missing, is_motion=name == "displacement")
        for name, channel in signals.measured.items()
    }
    commands = tuple(command.resampled(time, even) for command in signals.commands)
    # Where the rate is lower, what lies between its samples is no sample.
    slower = np.zeros(time.size - 1, dtype=np.bool_)
    for (first, each), last in zip(rates, [*(row for row, _ in rates[1:]), time.size], strict=True):
        slower[first:last] = each > (1.0 + JITTER) * step
    unmeasured = slower[before] & (np.minimum(even - time[before], time[before + 1] - even) > 0.25 * dt)
    return Signals(
        time=even,
        **measured,
        commands=commands,
        spiky=signals.spiky[before] | signals.spiky[before + 1] | unmeasured,
        missing=missing,
    )


def _between(
    times: Grid, channel: Floats, at: Floats, missing: NDArray[np.bool_], *, is_motion: bool
) -> Floats:
    """A channel at other times: by a spline in each part of one rate, and by PCHIP, which does not overshoot, in gaps.

    Of uneven samples, or fewer than are wanted, a spline follows the noise: a motion then follows from local cubics,
    and another channel of uneven samples is straight between them.
    """
    from scipy.interpolate import CubicSpline, PchipInterpolator  # slow to load, and rarely needed

    time, dt = times.time, float(at[1] - at[0])
    values = np.asarray(PchipInterpolator(time, channel)(at), dtype=np.float64)
    gaps = {*(times.gaps + 1).tolist()}
    ends = sorted({*gaps, *(row for row, _ in times.rates[1:])})
    for part in np.split(np.arange(time.size), ends):
        # A part of one rate ends where the next begins, one before a gap with its last sample.
        last = int(part[-1]) + (0 if part[-1] + 1 in {*gaps, time.size} else 1)
        inside = (at >= time[part[0]]) & (at <= time[last]) & ~missing
        if part.size < FEWEST_SAMPLES or not inside.any():
            continue
        of_part = grid(time[part])
        if is_motion and (of_part.is_uneven or of_part.median > 1.5 * dt):
            values[inside] = local_cubics(time[part], channel[part], at[inside])
        elif of_part.is_uneven:
            values[inside] = np.interp(at[inside], time, channel)
        else:
            values[inside] = CubicSpline(time[part], channel[part])(at[inside])
    return values


# Samples to either side of local cubics that are tried; six beside their own determine one.
_SIDES: Final = (3, 4, 6, 8, 12, 16, 24, 32, 48, 64)


def local_cubics(time: Floats, samples: Floats, at: Floats) -> Floats:
    """Values of cubics that are fitted locally to uneven samples, shape (n_at,), with tricube weights.

    Over so many samples that each is best told by its neighbours (W. S. Cleveland, Journal of the American Statistical
    Association 74, 1979, 829-836).
    """
    sides = [side for side in _SIDES if 2 * side + 1 <= time.size]
    errors = [
        float(np.mean((_cubics(time, samples, time, side, without_own=True) - samples) ** 2))
        for side in sides
    ]
    return _cubics(time, samples, at, sides[int(np.argmin(errors))], without_own=False)


def _cubics(time: Floats, samples: Floats, at: Floats, side: int, *, without_own: bool) -> Floats:
    nearest = np.clip(np.searchsorted(time, at), side, time.size - 1 - side)
    rows = nearest[:, None] + np.arange(-side, side + 1)
    away = time[rows] - at[:, None]
    reach = np.abs(away).max(axis=1, keepdims=True) * (1.0 + JITTER)
    ratio = away / reach
    root = (1.0 - np.abs(ratio) ** 3) ** 1.5
    if without_own:
        root[away == 0.0] = 0.0
    design = root[:, :, None] * ratio[:, :, None] ** np.arange(4.0)
    normal = np.einsum("nij,nik->njk", design, design)
    told = np.einsum("nij,ni->nj", design, root * samples[rows])
    return np.asarray(np.linalg.solve(normal, told[:, :, None])[:, 0, 0])


# Samples from turn to turn up to which strokes at constant speed are told from sines, of which fewer than six in ten
# steps change so little: the curvature of a sine of 50 samples a stroke is 0.06 of its largest step.
_PER_STROKE: Final = 50
_STRAIGHT, _UNCHANGED = 0.8, 0.05
# Steps between two samples of a straight stroke: a force that turns over in a sample is resolved to 0.1 % of it.
_BETWEEN: Final = 8


def straight_strokes(signals: Signals) -> Signals | None:
    """Samples of strokes at constant speed with steps between them, which alone are not compared; else `None`.

    Of a loop of twenty samples a stroke a smooth curve rounds the turns, which the force of a damper follows.
    """
    if signals.velocity is not None or signals.spiky.any() or signals.missing.any():
        return None
    steps = np.diff(signals.displacement)
    moving = np.abs(steps[steps != 0.0])
    turns = np.flatnonzero(np.diff(np.sign(steps[steps != 0.0])) != 0.0)
    # A coarse channel stands still between its steps.
    if (
        moving.size < _STRAIGHT * steps.size
        or turns.size < 2
        or float(np.median(np.diff(turns))) > _PER_STROKE
    ):
        return None
    if np.mean(np.abs(np.diff(steps)) < _UNCHANGED * np.median(moving)) < _STRAIGHT:
        return None
    time = signals.time
    fine = np.interp(np.arange((time.size - 1) * _BETWEEN + 1) / _BETWEEN, np.arange(time.size), time)
    displacement, force = (np.interp(fine, time, each) for each in (signals.displacement, signals.force))
    between = np.ones(fine.size, dtype=np.bool_)
    between[::_BETWEEN] = False
    return Signals(
        time=fine,
        displacement=displacement,
        force=force,
        velocity=np.gradient(displacement, fine),
        commands=tuple(command.resampled(time, fine) for command in signals.commands),
        spiky=between,
        missing=np.zeros_like(between),
    )


def settling_samples(displacement: Floats) -> int:
    """Number of samples until the damper has travelled half its peak-to-peak stroke.

    By then its hysteresis has lost the memory of the motion before the record.
    """
    travel = np.cumsum(np.abs(np.diff(displacement, prepend=displacement[0])))
    return int(np.searchsorted(travel, np.ptp(displacement) / 2))


def uncompared_spans(signals: Signals, velocity: Floats) -> tuple[tuple[int, int], ...]:
    """Spans of samples, first and beyond the last, that are not compared: in spikes, in gaps and after these.

    After a gap the damper must travel as far as it could have in it, at most half its peak-to-peak stroke, until its
    force no longer depends on the unknown motion. `velocity`: smoothed, shape (n_time,).
    """
    displacement, left_out = signals.displacement, signals.spiky | signals.missing
    travel = np.cumsum(np.abs(np.diff(displacement, prepend=displacement[0])))
    fastest = float(np.abs(velocity).max())
    for first, last in sample_runs(signals.missing):
        unknown = min(0.5 * float(np.ptp(displacement)), (last - first + 1) * signals.dt * fastest)
        left_out[first : int(np.searchsorted(travel, travel[last - 1] + unknown))] = True
    return sample_runs(left_out)


def spans_with(
    spans: tuple[tuple[int, int], ...], left_out: NDArray[np.bool_]
) -> tuple[tuple[int, int], ...]:
    """Spans of samples together with other samples that are left out, shape (n_time,)."""
    chosen = left_out.copy()
    for first, last in spans:
        chosen[first:last] = True
    return sample_runs(chosen)


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


def count_samples_from(test: DamperTest, settle: float) -> DamperTest:
    """Return the test with the first `settle` seconds simulated but not compared."""
    n_settle = ceil(settle / test.dt - 1e-9)
    if settle < 0 or test.n_time - n_settle < FEWEST_SAMPLES:
        raise SettingError(
            f"{test.label}: --settle is {settle:g} s of a record of {test.dt * test.n_time:g} s; "
            f"give 0 or more, and leave at least {FEWEST_SAMPLES} samples"
        )
    return replace(test, n_settle=n_settle)
