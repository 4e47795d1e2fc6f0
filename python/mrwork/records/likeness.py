"""Recognise tests of one motion at one command: repeated runs, and raw, smoothed or cut versions of one record.

A fit that has seen one of them has seen the other: its error there says nothing about its error on other motions. A
hash recognises identical files only, so displacements and commands are compared. Where the force is another one, the
damper was in another condition, which the fit has not seen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import floor, log2, log10
from typing import ClassVar, Final, Literal

import numpy as np

from mrwork.base.arguments import NotNegative, Positive
from mrwork.base.remark import Remark, RemarkKind
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.command import command_range
from mrwork.records.damper_test import DamperTest
from mrwork.records.motion import regular_cycles, spectrum

# Least number of samples in a period of a periodic motion and of any other, and most of the latter; periods of a
# periodic motion.
_PER_CYCLE: Final = {True: 64, False: 32}
_MOST_SAMPLES: Final = 2048
_CYCLES: Final = 2
_DIGITS: Final = 3
# Relative differences within which periods, amplitudes and commands are of one setting of a rig. A moving average
# over a quarter of a period takes 10 % of the amplitude.
_PERIOD: Final = 0.01
_AMPLITUDE: Final = 0.1
_COMMAND: Final = 0.02
# Smallest difference of commands that counts [A, V].
_LEAST_COMMAND: Final = 0.005
# Relative change of the force's deviation, and shift of its mean in deviations, that runs of one condition have; and
# the change per change of the amplitude of displacement, as of a record that was smoothed.
_CONDITION: Final = 0.1
_SMOOTHED: Final = 2.0
# Difference of the force's deviation beyond which tests of unknown command are not taken for one command.
_FORCE: Final = 0.2
# Least correlation of displacements, and share of a motion that the other must contain. Of a periodic motion: a sine
# and a triangle have 0.993. Smoothed versions of any other have lost its fastest part.
_LEAST: Final = {True: (0.995, 0.9), False: (0.98, 0.5)}
# Least share of its whole stroke that a motion has in what it shares with another.
_STROKE: Final = 0.8
_CONDITION_DIFFERS: Final = RemarkKind(
    "condition_differs",
    "{force}: another condition: {command}temperature, pressure, pre-load? It counts as held out",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedMotion:
    """Motion, force and command of a test, in the resolution that recognises them.

    `displacement` [mm] and `force` [N] are means over `step` [s], a power of two: of two cycles of a periodic motion at
    constant command, whose mean `period` [s] is then known, of the (first part of the) record of any other. `levels`
    are constant commands by unit, or the largest of a varying one, see `commands`; `deviation` is the
    standard deviation of the force [N].
    """

    _made_by: ClassVar[str] = "mr.read_damper_test(path)"

    test: str
    sha256: str
    levels: Mapping[str, float]
    period: float | None
    step: Positive
    deviation: NotNegative
    displacement: tuple[float, ...] = field(repr=False)
    force: tuple[float, ...] = field(repr=False)
    commands: tuple[tuple[float, ...], ...] = field(default=(), repr=False)

    @classmethod
    def of(cls, test: DamperTest) -> RecordedMotion:
        """The motion and command of a test from its sample `n_settle` on."""
        # The motion is the same with and without an observation model.
        settled = slice(test.n_settle, None)
        displacement, force = test.displacement[settled], test.force[settled]
        varying = [command[settled] for command, _ in test.commands if isinstance(command, np.ndarray)]
        band = spectrum(displacement, test.dt)
        # A motion may start slowly.
        for start in (0, displacement.size // 2):
            if cycles := () if varying else regular_cycles(displacement[start:]):
                part = slice(start + cycles[0].start, start + cycles[:_CYCLES][-1].stop)
                period = shortest = test.dt * (cycles[-1].stop - cycles[0].start) / len(cycles)
                break
        else:
            part, period = slice(None), None
            shortest = 1.0 / max(band.dominant, 0.25 * band.band_edge)
        step = 2.0 ** floor(log2(shortest / _PER_CYCLE[bool(cycles)]))

        def means(samples: Floats) -> tuple[float, ...]:
            return _rounded(_means(samples[part], step / test.dt))

        return cls(
            test=test.label,
            sha256=test.sha256,
            levels={unit: command_range(values)[1] for values, unit in test.commands},
            period=period,
            step=step,
            deviation=float(np.std(force)),
            displacement=means(1e3 * displacement),
            force=means(force),
            commands=tuple(means(command) for command in varying),
        )

    def _same_known_command(self, other: RecordedMotion) -> bool | None:
        """Whether the commands are equal; `None` where one is unknown.

        Of varying commands, the largest values are compared here and the shapes with the motion.
        """
        if len(self.commands) != len(other.commands):
            return False
        matches = [
            abs(level - another) <= _COMMAND * max(abs(level), abs(another)) + _LEAST_COMMAND
            for unit, level in self.levels.items()
            if (another := other.levels.get(unit)) is not None
        ]
        return all(matches) if matches else None

    def _align_with(self, seen: RecordedMotion) -> _Alignment | None:
        """Motion and force aligned with the part of another test that contains most of the motion; `None` if none."""
        step = max(self.step, seen.step)
        mine, other = (
            np.array([motion.displacement, motion.force, *motion.commands])[:, :: round(step / motion.step)]
            for motion in (self, seen)
        )
        limit, least = _LEAST[self.period is not None]
        if seen.period is not None:
            if self.period is None:
                # A record without two cycles of its own may be a part of a periodic one.
                limit, whole = _LEAST[True]
                least = max(least, whole * other.shape[1] / mine.shape[1])
            elif abs(self.period / seen.period - 1.0) > _PERIOD:
                return None
        elif len(seen.displacement) == _MOST_SAMPLES:
            # Of a longer motion only the first part is kept.
            least *= min(1.0, other.shape[1] / mine.shape[1])
        return _find_pattern(mine, other, least=least, limit=limit)


@array_dataclass()
class _Alignment:
    """Correlation of two motions, and what overlaps: displacement, force and commands of each, shape (n, n_samples)."""

    correlation: float
    one: Floats
    other: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Likeness:
    """A test and another of the same motion at the same command; `correlation` is of their displacements.

    The force is `force_ratio` times the other in its standard deviation, and then differs by `force_shift` [N] in its
    mean, `None` where not known; `same_force` is whether runs of one condition may differ so. Where the command of one
    of them is unknown, `known_command` is false.
    """

    _made_by: ClassVar[str] = "fit.seen(test)"

    test: str
    like: str
    correlation: float
    force_ratio: float | None = None
    force_shift: float | None = None
    same_force: bool = True
    known_command: bool = True

    @property
    def in_words(self) -> str:
        """Sentence on the two tests of equal motion and command, without its stop."""
        return self._alike("motion and command")

    @property
    def condition(self) -> Remark:
        """The note of a test whose force differs from that of a test of the fit."""
        # At unknown commands that may be the reason.
        command = "" if self.known_command else "command, "
        return _CONDITION_DIFFERS.remark(self.test, self.like, force=self.force_in_words, command=command)

    @property
    def force_in_words(self) -> str:
        """Sentence on two tests of equal motion whose forces differ by a factor and a shift, without its stop."""
        ratio, shift = self.force_ratio or 1.0, self.force_shift or 0.0
        shared = "motion and command" if self.known_command else "motion"
        return f"{self._alike(shared)}, but its force is that of the other times {ratio:.2f} {shift:+.3g} N"

    def _alike(self, shared: str) -> str:
        return f"{self.test} has the {shared} of {self.like} (correlation of displacements {self.correlation:.4f})"


def likenesses_in_words(likenesses: Sequence[Likeness]) -> str:
    """The first few of several likenesses."""
    more = f", and {len(likenesses) - 3} more alike" if len(likenesses) > 3 else ""
    return "; ".join(likeness.in_words for likeness in likenesses[:3]) + more


def likeness(test: RecordedMotion, seen: RecordedMotion) -> Likeness | None:
    """Likeness of two tests with the same motion and command, whole or for the greater part; `None` if they differ."""
    if test.sha256 and test.sha256 == seen.sha256:
        return Likeness(test=test.test, like=seen.test, correlation=1.0)
    # Where a command is unknown, the forces are to be of one size.
    alike = abs(test.deviation - seen.deviation) <= _FORCE * max(test.deviation, seen.deviation)
    return motion_likeness(test, seen) if alike or test._same_known_command(seen) else None


def motion_likeness(test: RecordedMotion, seen: RecordedMotion) -> Likeness | None:
    """Likeness of two tests with the same motion, unless their commands are known to differ; `None` if unlike."""
    matches = test._same_known_command(seen)
    alignment = None if matches is False else test._align_with(seen)
    if alignment is None:
        return None
    (stroke, force), (other_stroke, other_force) = alignment.one[:2], alignment.other[:2]
    deviation = max(float(np.std(other_force)), np.finfo(np.float64).tiny)
    ratio = float(np.std(force)) / deviation
    shift = float(np.mean(force) - ratio * np.mean(other_force))
    smoothing = abs(float(np.std(stroke) / np.std(other_stroke)) - 1.0)
    return Likeness(
        test=test.test,
        like=seen.test,
        correlation=alignment.correlation,
        known_command=matches is True,
        force_ratio=ratio,
        force_shift=shift,
        same_force=abs(np.log(max(ratio, 1e-3))) <= _CONDITION + _SMOOTHED * smoothing
        and abs(shift) <= _CONDITION * max(deviation, float(np.std(force))),
    )


def likest(
    test: RecordedMotion, seen: Sequence[RecordedMotion], *, force: Literal["any", "same", "other"] = "any"
) -> Likeness | None:
    """The closest of several tests that a test is like: with any force, in its force too, or unlike in its force."""
    compare = motion_likeness if force == "other" else likeness
    pairs = (pair for other in seen if (pair := compare(test, other)))
    wanted = (pair for pair in pairs if force == "any" or pair.same_force == (force == "same"))
    return max(wanted, key=lambda pair: pair.correlation, default=None)


def alike_groups(motions: Sequence[RecordedMotion]) -> list[list[int]]:
    """Indices of tests in groups of those that are alike, directly or through others; each group in order."""
    group = list(range(len(motions)))
    for index, motion in enumerate(motions):
        for earlier in range(index):
            if group[earlier] != group[index] and (
                likeness(motion, motions[earlier]) or likeness(motions[earlier], motion)
            ):
                kept, joined = sorted((group[earlier], group[index]))
                group = [kept if label == joined else label for label in group]
    return [[index for index, label in enumerate(group) if label == first] for first in sorted(set(group))]


def _means(samples: Floats, n_each: float) -> Floats:
    """Means over `n_each` samples each, of the first part of a long record."""
    edges = n_each * np.arange(min(int(samples.size / n_each), _MOST_SAMPLES) + 1)
    total = np.concatenate([[0.0], np.cumsum(samples)])
    return np.asarray(np.diff(np.interp(edges, np.arange(total.size), total)) / n_each)


def _rounded(samples: Floats) -> tuple[float, ...]:
    decimals = _DIGITS - 1 - floor(log10(max(float(np.abs(samples).max(initial=0.0)), 1e-12)))
    return tuple(np.round(samples, decimals).tolist())


def _find_pattern(pattern: Floats, record: Floats, *, least: float, limit: float) -> _Alignment | None:
    """A pattern where it correlates best with a record, over all shifts; `None` below the limit.

    Both have displacement, force and any commands, shape (n, n_samples); the least correlation counts, not the force's.
    A share `least` of the pattern must lie within the record, with the same amplitude.
    """
    n_pattern, n_record = pattern.shape[1], record.shape[1]
    n_least = max(3, int(np.ceil(least * n_pattern)))
    if min(n_pattern, n_record) < n_least or len(pattern) != len(record):
        return None
    compared = [row for row in range(len(pattern)) if row != _FORCE_ROW]
    correlations = np.min([_correlations(pattern[row], record[row], n_least) for row in compared], axis=0)
    best = int(np.argmax(correlations))
    if correlations[best] < limit:
        return None
    # `_correlations` has the shifts with enough overlap.
    shift = n_least - n_pattern + best
    first, last = max(0, shift), min(n_record, shift + n_pattern)
    # Ramps of one speed are equal for a part of their stroke.
    if np.ptp(pattern[0, first - shift : last - shift]) < _STROKE * np.ptp(pattern[0]):
        return None
    return _Alignment(
        correlation=min(float(correlations[best]), 1.0),
        one=pattern[:, first - shift : last - shift],
        other=record[:, first:last],
    )


_FORCE_ROW: Final = 1


def _correlations(pattern: Floats, record: Floats, n_least: int) -> Floats:
    """Correlation over the overlap at each shift, 0 where amplitudes differ; sums by the Fourier transform."""
    n_pattern, n_record = pattern.size, record.size
    size = 1 << int(n_pattern + n_record - 1).bit_length()

    def sums(one: Floats, other: Floats) -> Floats:
        """Sums of products over the overlap, shifts -(n_pattern - 1) to n_record - 1 of the pattern."""
        product = np.fft.irfft(np.conj(np.fft.rfft(one, size)) * np.fft.rfft(other, size), size)
        return np.concatenate([product[size - n_pattern + 1 :], product[:n_record]])

    ones, spread = np.ones(n_pattern), np.ones(n_record)
    shift = np.arange(1 - n_pattern, n_record)
    count = np.minimum(n_record, shift + n_pattern) - np.maximum(0, shift)
    inside = count >= n_least
    count = count[inside]
    mean_p, mean_r = (total[inside] / count for total in (sums(pattern, spread), sums(ones, record)))
    # Rounding of the transform, relative to the whole.
    floor = 1e-9 * (float(pattern @ pattern) + float(record @ record)) / count + 1e-300
    var_p = np.maximum(sums(pattern**2, spread)[inside] / count - mean_p**2, floor)
    var_r = np.maximum(sums(ones, record**2)[inside] / count - mean_r**2, floor)
    correlation = (sums(pattern, record)[inside] / count - mean_p * mean_r) / np.sqrt(var_p * var_r)
    equal = np.abs(np.sqrt(var_p) - np.sqrt(var_r)) <= _AMPLITUDE * np.sqrt(np.maximum(var_p, var_r))
    return np.where(equal, correlation, 0.0)
