"""Part of a record that is used: cutting, decimation, and the initial samples that are not compared."""

from __future__ import annotations

from dataclasses import replace
from math import ceil

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import Count, checked
from mrwork.errors import SettingError
from mrwork.records.command_signal import levels_of_command
from mrwork.records.damper_test import DamperTest
from mrwork.records.motion import spectrum

_FEWEST = 10


def settling_samples(displacement: NDArray[np.float64]) -> int:
    """Number of samples until the damper has travelled half its peak-to-peak stroke.

    The hysteresis of a damper loses the memory of its initial state within a yield displacement, a small part of the
    stroke of any useful test. Before that, the force depends on the motion before the record.
    """
    travel = np.cumsum(np.abs(np.diff(displacement, prepend=displacement[0])))
    return int(np.searchsorted(travel, np.ptp(displacement) / 2))


def uncompared_spans(
    displacement: NDArray[np.float64],
    velocity: NDArray[np.float64],
    spiky: NDArray[np.bool_],
    missing: NDArray[np.bool_],
    dt: float,
) -> tuple[tuple[int, int], ...]:
    """Spans of samples, first and beyond the last, that are not compared: in spikes, in gaps and after these.

    After a gap the damper must travel as far as it could have in the gap, at most half its peak-to-peak stroke, until
    its force no longer depends on the motion that is not known.

    `displacement`, `velocity`, `spiky`, `missing`: shape (n_time,): motion [m, m/s], and samples that were interpolated
    in spikes and in gaps. `dt`: time step [s].
    """
    left_out = spiky | missing
    travel = np.cumsum(np.abs(np.diff(displacement, prepend=displacement[0])))
    fastest = float(np.abs(velocity).max())
    for first, last in _runs(missing):
        unknown = min(0.5 * float(np.ptp(displacement)), (last - first + 1) * dt * fastest)
        left_out[first : int(np.searchsorted(travel, travel[last - 1] + unknown))] = True
    return _runs(left_out)


def spans_with(
    spans: tuple[tuple[int, int], ...], left_out: NDArray[np.bool_]
) -> tuple[tuple[int, int], ...]:
    """Spans of samples together with other samples that are left out, shape (n_time,)."""
    if not left_out.any():
        return spans
    chosen = left_out.copy()
    for first, last in spans:
        chosen[first:last] = True
    return _runs(chosen)


def _runs(chosen: NDArray[np.bool_]) -> tuple[tuple[int, int], ...]:
    """First sample, and sample beyond the last, of each run of chosen samples."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]])))
    return tuple((int(first), int(last)) for first, last in zip(edges[::2], edges[1::2], strict=True))


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
        place = (instant - test.start_time) / test.dt - 1e-9
        return ceil(min(max(place, 0.0), float(test.n_time)))

    first = 0 if start is None else sample_at(start)
    last = test.n_time if end is None else sample_at(end)
    n_kept = len(range(first, last, every))
    if n_kept < _FEWEST:
        raise SettingError(
            f"{test.label}: {n_kept} samples would remain of a record from "
            f"{test.time[0]:g} to {test.time[-1]:g} s; keep at least {_FEWEST}"
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


def excerpt(test: DamperTest) -> DamperTest:
    """Return the first cycles of a cyclic test, decimated to a resolution that shows the loop.

    This is sufficient for a search, since further cycles add little information. A motion whose band extends beyond a
    few times its dominant frequency keeps its length, and so does a test whose command varies.
    """
    motion = spectrum(test.displacement, test.dt)
    if motion.dominant <= 0.0:
        return test
    thin = max(1, int(1.0 / (motion.dominant * test.dt * _EXCERPT_PER_CYCLE)))
    if motion.band_edge > _CYCLIC_BAND * motion.dominant:
        return cut(test, every=max(1, int(1.0 / (motion.band_edge * test.dt * _PER_FASTEST))))
    if test.has_varying_command:
        return cut(test, every=thin)
    return cut(test, end=test.start_time + _excerpt_seconds(test, motion.dominant), every=thin)


def varied_excerpt(test: DamperTest) -> DamperTest:
    """Return the shortest part of an `excerpt` that shows what the whole record of a varying command does.

    It has every level of the command, for half of its share of the time or more, and most of the largest displacement
    and velocity. It is at most half of the record, else the whole one.
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
            if _shows_motion(whole, part) and all(_shows_levels(each, part) for each in levels):
                found = whole.part(part.start, part.stop)
                return replace(found, n_settle=settling_samples(found.displacement))
        length *= 2
    return whole


def _at_levels(command: NDArray[np.float64]) -> NDArray[np.intp]:
    """Number of the level that is nearest to each sample of a command, shape (n_time,)."""
    levels = np.array(levels_of_command(command))
    return np.searchsorted(0.5 * (levels[:-1] + levels[1:]), command)


def _shows_levels(at_level: NDArray[np.intp], part: slice) -> bool:
    whole, own = (np.bincount(each, minlength=at_level.max() + 1) for each in (at_level, at_level[part]))
    return bool(np.all(own / own.sum() >= _LEVEL_SHARE * whole / whole.sum()))


def _shows_motion(test: DamperTest, part: slice) -> bool:
    return all(
        float(np.ptp(signal[part])) >= _MOTION_SHARE * float(np.ptp(signal))
        for signal in (test.displacement, test.velocity)
    )


def _excerpt_seconds(test: DamperTest, frequency: float) -> float:
    return (test.n_time - test.n_counted) * test.dt + _EXCERPT_CYCLES / frequency


def middle_excerpt(test: DamperTest, *, per_cycle: int) -> DamperTest:
    """Return as many cycles from the middle of a cyclic test, decimated to `per_cycle` samples, slow ones to 0.04 s.

    They represent a record whose force drifts better than the first ones, which contain the start-up. Another motion
    is treated as by `excerpt`.
    """
    motion = spectrum(test.displacement, test.dt)
    if motion.dominant <= 0.0 or motion.band_edge > _CYCLIC_BAND * motion.dominant:
        return excerpt(test)
    length = _excerpt_seconds(test, motion.dominant)
    start = test.start_time + max(0.0, (test.n_time * test.dt - length) / 2.0)
    thin = max(1, int(min(1.0 / (motion.dominant * per_cycle), _LONGEST_STEP) / test.dt))
    return cut(test, start=start, end=start + length, every=thin)


def counted_from(test: DamperTest, settle: float) -> DamperTest:
    """Return the test with the first `settle` seconds simulated but not compared."""
    n_settle = ceil(settle / test.dt - 1e-9)
    if settle < 0 or test.n_time - n_settle < _FEWEST:
        raise SettingError(
            f"{test.label}: --settle is {settle:g} s of a record of {test.dt * test.n_time:g} s; "
            f"give 0 or more, and leave at least {_FEWEST} samples"
        )
    return replace(test, n_settle=n_settle)
