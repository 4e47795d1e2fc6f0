"""Time base of a test: complete rows, increasing time, uniform step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError
from mrwork.files.named_columns import rounded_grid
from mrwork.records.command_signal import resampled_command
from mrwork.records.damper_test import Finding
from mrwork.values import holds_arrays

FEWEST_SAMPLES: Final = 10
# Limits far beyond any damper test; arithmetic on larger values could overflow.
_LARGEST: Final = 1e12
_SHORTEST_STEP: Final = 1e-7
# Times no further apart than this repeat [s]; slopes between them would overflow.
_SAME: Final = 1e-12
_JITTER: Final = 1e-3
_GAP_STEPS: Final = 3.0


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class Signals:
    """Channels in SI on one time base, each of shape (n_time,); `None` for a channel that was not measured.

    `current`, `voltage` and `command`, of another unit, are the commands that vary.
    """

    time: NDArray[np.float64]
    displacement: NDArray[np.float64]
    force: NDArray[np.float64]
    velocity: NDArray[np.float64] | None = None
    current: NDArray[np.float64] | None = None
    voltage: NDArray[np.float64] | None = None
    command: NDArray[np.float64] | None = None

    def channels(self) -> tuple[tuple[str, NDArray[np.float64]], ...]:
        """Name and samples of every channel that exists."""
        named = ((each.name, getattr(self, each.name)) for each in fields(self))
        return tuple((name, channel) for name, channel in named if channel is not None)

    @property
    def has_commands(self) -> bool:
        """Whether a command varies."""
        return any(sent is not None for sent in (self.current, self.voltage, self.command))

    def through(self, change: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> Signals:
        """Signals with the same change applied to every channel."""
        return replace(self, **{name: change(channel) for name, channel in self.channels()})


def complete_rows(
    signals: Signals, *, source: str, locate: Callable[[int], str]
) -> tuple[Signals, int, tuple[Finding, ...]]:
    """Drop rows at either end in which a channel is missing (NaN).

    Return the complete signals, the file row at which they start, and findings on dropped rows.
    """
    for name, channel in signals.channels():
        absurd = np.abs(channel) > _LARGEST
        if absurd.any():
            row = int(np.argmax(absurd))
            raise RecordError(
                f"{source}: {locate(row)}: the {name} is {channel[row]:g} in SI units, beyond any test; "
                "correct the value or its unit"
            )
        if np.isnan(channel).all():
            raise RecordError(f"{source}: the {name} has no value at all; fill the column or leave it out")
    complete = np.logical_and.reduce([np.isfinite(channel) for _, channel in signals.channels()])
    n_time = int(np.count_nonzero(complete))
    if n_time < FEWEST_SAMPLES:
        held = f"{n_time} complete samples" if n_time != 1 else "1 complete sample"
        raise RecordError(f"{source}: has {held}; a test needs at least {FEWEST_SAMPLES}")
    first = int(np.argmax(complete))
    last = complete.size - int(np.argmax(complete[::-1]))
    holes = np.flatnonzero(~complete[first:last])
    if holes.size:
        row = first + int(holes[0])
        missing = ", ".join(name for name, channel in signals.channels() if np.isnan(channel[row]))
        more = f", and {holes.size - 1} more rows are incomplete" if holes.size > 1 else ""
        raise RecordError(
            f"{source}: {locate(row)} has no value for {missing}{more}; fill in the values or delete the rows"
        )
    if last - first == complete.size:
        return signals, first, ()
    finding = Finding(
        code="nan_rows_dropped",
        severity="note",
        message=f"dropped incomplete rows: {first} at the start, {complete.size - last} at the end",
    )
    return signals.through(lambda channel: channel[first:last]), first, (finding,)


def check_time(time: NDArray[np.float64], *, source: str, locate: Callable[[int], str]) -> None:
    """Check that time increases."""
    wrong = np.flatnonzero(np.diff(time) <= _SAME)
    if wrong.size == 0:
        return
    row = int(wrong[0]) + 1
    now, before = time[row], time[row - 1]
    more = f" (as do {wrong.size - 1} more rows)" if wrong.size > 1 else ""
    if now >= before:
        raise RecordError(
            f"{source}: {locate(row)}: the time {now:g} s repeats that of the row before{more}; "
            "write the time with more digits or delete the repeated rows"
        )
    raise RecordError(
        f"{source}: {locate(row)}: the time runs backwards, from {before:g} s to {now:g} s{more}; "
        "sort the rows or split the file into its tests"
    )


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class UniformSamples:
    """Signals on a uniform grid of step `dt` [s].

    `spiky` and `missing` are the samples that no sensor gave, in spikes and in gaps, shape (n_time,).
    """

    signals: Signals
    dt: float
    spiky: NDArray[np.bool_]
    missing: NDArray[np.bool_]
    findings: tuple[Finding, ...] = ()


def uniform_step(signals: Signals, spiky: NDArray[np.bool_], *, source: str) -> UniformSamples:
    """Put signals, of which the `spiky` samples were bridged, shape (n_time,), on a uniform grid.

    If a step differs from the median by more than 1e-3 of it, the record is resampled to about the median step,
    keeping the first and the last sample: by a cubic spline, or by PCHIP, which does not overshoot, if there are
    gaps. A command that changes in steps is held between its samples, another one is interpolated linearly. Times that
    are uniform except for rounding to few digits are not resampled, because their samples were taken uniformly.
    """
    time = signals.time
    steps = np.diff(time)
    median = float(np.median(steps))
    duration = float(time[-1] - time[0])
    if median < _SHORTEST_STEP:
        raise RecordError(
            f"{source}: the time step is {median:.3g} s, below any rig's; check the unit of the time"
        )
    mean = duration / (time.size - 1)
    deviation = float(np.max(np.abs(steps - median)))
    if deviation <= _JITTER * median + 2.0 * np.spacing(np.max(np.abs(time))):
        return UniformSamples(signals=signals, dt=mean, spiky=spiky, missing=np.zeros_like(spiky))
    uniform = rounded_grid(time)
    if uniform is not None:
        dt = float(uniform[-1] - uniform[0]) / (time.size - 1)
        rounded = Finding(
            code="time_rounded",
            severity="note",
            message=f"times are rounded, with steps of {1e3 * steps.min():.4g} to {1e3 * steps.max():.4g} ms; taken "
            f"as uniform every {1e3 * dt:.6g} ms ({1.0 / dt:.6g} Hz), by regression on the number of the sample",
        )
        return UniformSamples(
            signals=replace(signals, time=uniform),
            dt=dt,
            spiky=spiky,
            missing=np.zeros_like(spiky),
            findings=(rounded,),
        )

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
        count = "a gap" if gaps.size == 1 else f"{gaps.size} gaps, the longest"
        findings.append(
            Finding.warning(
                "gaps",
                f"{count} of {steps[longest]:.4g} s after {time[longest]:.6g} s "
                f"({steps[longest] / median:.0f} steps) was bridged by interpolation, and is not compared",
                action="fit a part without it (--from, --until)",
            )
        )
    grid = np.linspace(time[0], time[-1], n_uniform)
    dt = duration / (n_uniform - 1)
    rule = "PCHIP" if gaps.size else "cubic spline"
    findings.append(
        Finding(
            code="resampled",
            severity="note",
            message=f"time steps differ from their median of {1e3 * median:.4g} ms by up to "
            f"{100 * deviation / median:.3g} %; resampled every {1e3 * dt:.6g} ms by {rule} interpolation",
        )
    )
    from scipy.interpolate import CubicSpline, PchipInterpolator  # slow to load, and rarely needed

    interpolator = PchipInterpolator if gaps.size else CubicSpline
    motion = replace(signals, current=None, voltage=None, command=None).through(
        lambda channel: np.asarray(interpolator(time, channel)(grid), dtype=np.float64)
    )
    current, voltage, command = (
        None if sent is None else resampled_command(time, sent, grid)
        for sent in (signals.current, signals.voltage, signals.command)
    )
    before = np.clip(np.searchsorted(time, grid, side="right") - 1, 0, time.size - 2)
    # A sample of the grid has neighbours in the record; next to one of them, it is that.
    beside = np.minimum(grid - time[before], time[before + 1] - grid) > _JITTER * median
    missing = beside & (steps > _GAP_STEPS * median)[before]
    return UniformSamples(
        signals=replace(motion, time=grid, current=current, voltage=voltage, command=command),
        dt=dt,
        spiky=spiky[before] | spiky[before + 1],
        missing=missing,
        findings=tuple(findings),
    )
