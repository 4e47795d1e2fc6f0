"""Excerpts of tests on which a search is cheap: cycles of a cyclic motion, and stretches under a varying command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import ceil

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats, freeze_samples
from mrwork.dampers.command import Command, levels_of_command
from mrwork.dampers.dependence import MOST_DEGREE, Dependence
from mrwork.records.damper_test import DamperTest, command_groups, fields_of_commands
from mrwork.records.motion import spectrum
from mrwork.records.window import cut, settling_samples

# Cycles for a settled loop, and samples per cycle that resolve its knees.
_EXCERPT_CYCLES = 3
_EXCERPT_PER_CYCLE = 400
# Samples per cycle of an excerpt from the middle, for searches of laws: fits differ by 0.02 points from those with 400.
_MIDDLE_PER_CYCLE = 100
# Least range of a cycle, as a share of the largest, of a motion of which a few cycles are enough.
_SAME_RANGE = 0.9
# Cycles at either end that may have less, where cycles are taken from the middle, and the most of them, as a share.
_ENDS = 2
_MOST_ENDS = 1.0 / 3.0
# Shares of the samples between which the range of a cycle is taken.
_INNER = (0.1, 0.9)
# A record keeps so many samples, if it has them: the corners of a triangle are sharper than its frequency shows.
_FEW_SAMPLES = 1500
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

    A motion of a wide band keeps its length, and so do one whose cycles differ and a test whose command varies.
    """
    motion = spectrum(test.displacement, test.dt)
    if motion.dominant <= 0.0:
        return test
    most = max(1, test.n_time // _FEW_SAMPLES)
    thin = min(max(1, int(1.0 / (motion.dominant * test.dt * _EXCERPT_PER_CYCLE))), most)
    if motion.band_edge > _CYCLIC_BAND * motion.dominant:
        return _thinned(test, min(max(1, int(1.0 / (motion.band_edge * test.dt * _PER_FASTEST))), most))
    if test.has_varying_command:
        return _thinned(test, thin)
    if not _repeats(test, motion.dominant):
        return _thinned(test, thin)
    return cut(test, end=test.start_time + _excerpt_seconds(test, motion.dominant), every=thin)


def _repeats(test: DamperTest, frequency: float, ends: int = 0) -> bool:
    """Whether all periods of the motion have the same range of displacement and velocity, but for single samples.

    So many at each of the `ends`, where the motion begins and dies away, may have less, a third of all at most.
    """
    period = round(1.0 / (frequency * test.dt))
    count = test.n_time // period
    if count == 0:
        return False
    ranges = [
        np.ptp(np.quantile(signal[: count * period].reshape(count, period), _INNER, axis=1), axis=0)
        for signal in (test.displacement, test.velocity)
    ]
    same = np.all([each >= _SAME_RANGE * np.max(each) for each in ranges], axis=0)
    first, last = int(np.argmax(same)), int(np.argmax(same[::-1]))
    within = same[first : count - last]
    return bool(within.all() and max(first, last) <= ends and within.size >= (1.0 - _MOST_ENDS) * count)


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
    levels = np.array(Dependence(degree).at_commands(every).nodes or every)
    return np.searchsorted(0.5 * (levels[:-1] + levels[1:]), command)


def _shows_levels(at_level: NDArray[np.intp], part: slice, share: float = _LEVEL_SHARE) -> bool:
    whole, portion = (np.bincount(bins, minlength=at_level.max() + 1) for bins in (at_level, at_level[part]))
    return bool(np.all(portion / portion.sum() >= share * whole / whole.sum()))


def _shows_motion(test: DamperTest, part: slice) -> bool:
    motion = (test.displacement, test.velocity)
    return all(float(np.ptp(signal[part])) >= _MOTION_SHARE * float(np.ptp(signal)) for signal in motion)


def _excerpt_seconds(test: DamperTest, frequency: float, cycles: int = _EXCERPT_CYCLES) -> float:
    return (test.n_time - test.n_counted) * test.dt + cycles / frequency


def middle_excerpts(tests: Sequence[DamperTest]) -> tuple[DamperTest, ...]:
    """The `middle_excerpt` of each test, without the ends of its motion where another test shows smaller motions.

    Where a motion begins and dies away the loop is smaller: of the smallest motion at a command that stays.
    """
    least: dict[int, float] = {}
    groups = command_groups(tests)
    for test, group in zip(tests, groups, strict=True):
        stroke = float(np.ptp(test.displacement))
        least[group] = min(stroke, least.get(group, stroke))
    return tuple(
        middle_excerpt(
            test,
            ends=0
            if test.has_varying_command or least[group] >= _SAME_RANGE * float(np.ptp(test.displacement))
            else _ENDS,
        )
        for test, group in zip(tests, groups, strict=True)
    )


def middle_excerpt(test: DamperTest, cycles: int | None = None, ends: int = 0) -> DamperTest:
    """As many cycles from the middle of a cyclic test, with 100 samples in each, slow ones in steps of 0.04 s.

    They represent a drifting force better than the first ones. Without so many `ends` of a motion that begins and dies
    away all its cycles stay. Another motion, a test whose command varies, and one whose cycles differ otherwise, are
    treated as by `excerpt`, the last unless a number of `cycles` is given.
    """
    motion = spectrum(test.displacement, test.dt)
    is_cyclic = motion.dominant > 0.0 and motion.band_edge <= _CYCLIC_BAND * motion.dominant
    if not is_cyclic or test.has_varying_command or not (cycles or _repeats(test, motion.dominant, _ENDS)):
        return excerpt(test)
    thin = max(1, int(min(1.0 / (motion.dominant * _MIDDLE_PER_CYCLE), _LONGEST_STEP) / test.dt))
    if not cycles and not _repeats(test, motion.dominant, ends):
        return cut(test, every=thin)
    length = _excerpt_seconds(test, motion.dominant, cycles or _EXCERPT_CYCLES)
    start = test.start_time + max(0.0, (test.n_time * test.dt - length) / 2.0)
    return cut(test, start=start, end=start + length, every=thin)
