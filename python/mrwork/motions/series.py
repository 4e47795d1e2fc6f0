"""Ground motions of columns: which column is the acceleration, and its samples on one step."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Final

import numpy as np

from mrwork.base.units import factor_of
from mrwork.base.values import Floats
from mrwork.errors import RecordError
from mrwork.files.grid import grid
from mrwork.files.named_columns import words_and_unit
from mrwork.files.roles import Role, Series
from mrwork.motions.ground_motion import GroundMotion

# "ground_accel_mps2", "Acc (g)", "a_mps2", "xg_ddot"; "acc 1" of a matrix, and no "a1", which is of a floor.
_ACCELERATION: Final = re.compile(
    r"((ground|road)[\s_-]*)?(a|acc|accel|acceleration|ag|a_g|xg_ddot)(\s\d{1,2})?", re.IGNORECASE
)


def _unit_in(name: str) -> str:
    """The unit of a column's name, as of ``Acc (cm/s^2)`` or ``EW [g]``; ``a_g`` is often not in g."""
    unit = words_and_unit(name)[1]
    return unit if factor_of(unit, "acceleration") is not None and name.strip().casefold() != "a_g" else ""


def _is_acceleration(name: str) -> bool:
    stem = words_and_unit(name)[0] if _unit_in(name) else name.strip()
    return _ACCELERATION.fullmatch(stem.rstrip(" _-,:")) is not None


ACCELERATION: Final = Role(
    noun="acceleration",
    quantity="acceleration",
    is_called=_is_acceleration,
    unit_in=_unit_in,
    example="g",
    elsewhere={
        "displacement": "a ground motion is an acceleration; give heights of a road as "
        'road = "{file}" in [[motion]], or to mr.motions.read_road, and of an earthquake the acceleration',
        "force": 'a ground motion is an acceleration; give forces on floors as force = "{file}" in [[motion]]',
    },
)

# A last sample of zero this long after the others [s], and in steps, is padding and not part of the record.
_PADDING = 1.0
_PADDING_STEPS = 20.0
# A longer step within a record [s], and in steps, is a gap; the last may be longer.
_GAP = 0.25
_GAP_STEPS = 10.0


def motion_of_series(series: Series, *, name: str, source: str) -> GroundMotion:
    """The motion of one column of accelerations; steps that are not equal are resampled linearly."""
    acceleration = series.samples[0]
    if series.along is None:
        assert series.dt is not None
        return GroundMotion(name=name, dt=series.dt, acceleration=acceleration, source=source)
    time = series.along
    padding, last, others = "", time[-1] - time[-2], np.diff(time[:-1]).max(initial=0.0)
    if time.size > 3 and acceleration[-1] == 0.0 and last > max(_PADDING, _PADDING_STEPS * others):
        padding = f"last point dropped: zero at {time[-1]:g} s, {last:g} s behind the others, is padding"
        series = replace(series, along=time[:-1], samples=series.samples[:, :-1])
    dt, samples, change = on_one_step(series)
    # Records of one step often begin after it.
    begins = abs(time[0]) > 1.5 * dt
    counted = f"times begin at {time[0]:g} s in the file, and are counted from 0 s" if begins else ""
    changes = tuple(filter(None, (padding, change, counted)))
    return GroundMotion(name=name, dt=dt, acceleration=samples[0], source=source, changes=changes)


def on_one_step(series: Series) -> tuple[float, Floats, str]:
    """Step [s] of a series with times, its samples every step, and a description of the change.

    Steps that are equal up to jitter or rounding are taken as uniform; otherwise the samples are joined by lines.
    """
    assert series.along is not None
    times = grid(series.along)
    if times.uniform is not None:
        rounding = f"times written to {np.ptp(times.steps):.3g} s taken as uniform, every {times.step:.6g} s"
        return times.step, series.samples, "" if times.regular.all() else rounding
    steps, regular = times.steps, times.regular
    if not regular.any():
        raise RecordError(f"{series.where(0)}: no two times have a common step; check the column of times")
    dt = float(steps[regular].mean())
    # Regular steps are taken as equal, so that their samples are kept and not interpolated.
    knots = np.concatenate(([0.0], np.cumsum(np.where(regular, dt, steps))))
    n_time = int(np.floor(knots[-1] / dt + 1e-6)) + 1
    line = int(np.argmax(steps))
    is_gap = line < steps.size - 1 and steps[line] > max(_GAP_STEPS * dt, _GAP)
    if n_time > 2 * knots.size or is_gap:
        raise RecordError(
            f"{series.where(line + 1)}: a gap of {steps[line]:.4g} s before it, and steps of {dt:.4g} s elsewhere; cut "
            "out one continuous part"
        )
    odd = steps[~regular] - dt
    worst = odd[np.argmax(np.abs(odd))]
    change = f"resampled every {dt:.6g} s, straight between; steps that differ: {odd.size}, by up to {worst:+.4g} s"
    at = dt * np.arange(n_time)
    return dt, np.array([np.interp(at, knots, samples) for samples in series.samples]), change
