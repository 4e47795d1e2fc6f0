"""Times and accelerations of a file as a motion on one step."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mrwork.base.values import Floats
from mrwork.errors import RecordError
from mrwork.files.named_columns import rounded_grid
from mrwork.motions.ground_motion import GroundMotion

# Steps that differ by less, relative to their median, count as equal.
_JITTER = 1e-3
# A last sample of zero this long after the others [s], and in steps, is padding and not part of the record.
_PADDING = 1.0
_PADDING_STEPS = 20.0
# A longer step within a record [s], and in steps, is a gap; the last may be longer.
_GAP = 0.25
_GAP_STEPS = 10.0


def motion_of_columns(
    time: Floats, acceleration: Floats, *, name: str, source: str, where: Callable[[int], str]
) -> GroundMotion:
    """Build a motion from times [s] and accelerations [m/s^2], shape (n_time,); `where` names a row in messages.

    Steps that are equal up to jitter or rounding are taken as uniform; otherwise the record is resampled linearly.
    """
    for values, what in ((time, "time"), (acceleration, "acceleration")):
        if not np.isfinite(values).all():
            row = int(np.flatnonzero(~np.isfinite(values))[0])
            raise RecordError(
                f"{where(row)}: the {what} is no finite number; correct the value or delete the row"
            )
    if time.size < 2:
        raise RecordError(f"{where(0)}: the record has {time.size} rows; give two or more")
    wrong = np.flatnonzero(np.diff(time) <= 0.0)
    if wrong.size:
        row = int(wrong[0]) + 1
        raise RecordError(
            f"{where(row)}: time goes from {time[row - 1]:g} to {time[row]:g} s; sort the rows, and write times with "
            "digits enough to differ"
        )
    padding, last, others = "", time[-1] - time[-2], np.diff(time[:-1]).max(initial=0.0)
    if time.size > 3 and acceleration[-1] == 0.0 and last > max(_PADDING, _PADDING_STEPS * others):
        padding = f"last point dropped: zero at {time[-1]:g} s, {last:g} s behind the others, is padding"
        time, acceleration = time[:-1], acceleration[:-1]
    dt, acceleration, change = _on_one_step(time, acceleration, where)
    changes = tuple(filter(None, (padding, change)))
    return GroundMotion(name=name, dt=dt, acceleration=acceleration, source=source, changes=changes)


def _on_one_step(
    time: Floats, acceleration: Floats, where: Callable[[int], str]
) -> tuple[float, Floats, str]:
    """Step [s], samples, and a description of the change."""
    steps = np.diff(time)
    median = float(np.median(steps))
    # In a long record, times written with few digits differ in the last digit.
    regular = np.abs(steps - median) <= _JITTER * median + 2.0 * np.spacing(np.abs(time).max())
    if regular.all():
        return float(time[-1] - time[0]) / steps.size, acceleration, ""
    uniform = rounded_grid(time)
    if uniform is not None:
        dt = float(uniform[-1] - uniform[0]) / steps.size
        return dt, acceleration, f"times written to {np.ptp(steps):.3g} s taken as uniform, every {dt:.6g} s"
    if not regular.any():
        raise RecordError(f"{where(0)}: no two times have a common step; check the column of times")
    dt = float(steps[regular].mean())
    # Regular steps are taken as equal, so that their samples are kept and not interpolated.
    knots = np.concatenate(([0.0], np.cumsum(np.where(regular, dt, steps))))
    n_time = int(np.floor(knots[-1] / dt + 1e-6)) + 1
    place = int(np.argmax(steps))
    is_gap = place < steps.size - 1 and steps[place] > max(_GAP_STEPS * dt, _GAP)
    if n_time > 2 * time.size or is_gap:
        raise RecordError(
            f"{where(place + 1)}: a gap of {steps[place]:.4g} s before it, and steps of {dt:.4g} s elsewhere; cut out "
            "one continuous part"
        )
    odd = steps[~regular] - dt
    worst = odd[np.argmax(np.abs(odd))]
    change = f"resampled every {dt:.6g} s, straight between; steps that differ: {odd.size}, by up to {worst:+.4g} s"
    return dt, np.interp(dt * np.arange(n_time), knots, acceleration), change
