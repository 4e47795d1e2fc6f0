"""Recognise tests of one motion at one command: repeated runs, and raw, smoothed or cut versions of one record.

A fit that has seen one of them has seen the other: its error there says nothing about its error on other motions. A
hash recognises identical files only, so displacements and commands are compared. Where the force is another one, the
damper was in another condition, which the fit has not seen.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Final

import numpy as np

from mrwork.base.arguments import NotNegative, Positive
from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.command import CommandValues, command_range
from mrwork.records.damper_test import DamperTest
from mrwork.records.motion import regular_cycles, spectrum

# Samples of a cycle, and most samples of a motion that is not periodic.
_PER_CYCLE: Final = 32
_MOST: Final = 2048
_INT16: Final = 32767.0
# Relative differences within which lengths of a cycle, amplitudes and commands are those of one setting of a rig. A
# moving average over a quarter of a period takes 10 % of the amplitude.
_PERIOD: Final = 0.01
_AMPLITUDE: Final = 0.1
_COMMAND: Final = 0.02
# Smallest difference of commands that counts [A, V].
_LEAST_COMMAND: Final = 0.005
# Relative change of the force's deviation, and shift of its mean in deviations, that runs of one condition have; and
# the change per that of the amplitude of displacement, as of a record that was smoothed.
_CONDITION: Final = 0.1
_SMOOTHED: Final = 2.0
# Difference of the force's deviation beyond which tests of unknown command are not taken for one command.
_FORCE: Final = 0.2
# Least correlation of displacements: a sine and a triangle have 0.993; smoothed versions of a random motion have lost
# its fastest part.
_PERIODIC: Final = 0.995
_IRREGULAR: Final = 0.98
# Share of a motion that the other must contain, and most cycles that are compared.
_SHARE: Final = 0.5
_CYCLES: Final = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedMotion:
    """Motion and command of a test, in the resolution that recognises them.

    `shape` is the displacement about its mean per `half_stroke` [m], in steps of `step` [s]: of the mean cycle of a
    periodic motion at constant command, of the (first part of the) record of any other; as base64 of 16-bit integers.
    `current` [A] and `voltage` [V] are constant, or the largest of a varying command, whose shape is in `commands`.
    `force` is the standard deviation of the force [N]; `force_shape` is the force about `force_mean` per `half_force`
    [N], as the displacement.
    """

    _made_by: ClassVar[str] = "mr.read_damper_test(path)"

    test: str
    sha256: str
    current: float | None
    voltage: float | None
    periodic: bool
    step: Positive
    half_stroke: NotNegative
    shape: str = field(repr=False)
    force: NotNegative
    force_mean: float
    half_force: NotNegative
    force_shape: str = field(repr=False)
    commands: tuple[str, ...] = field(default=(), repr=False)
    command: float | None = None
    command_unit: CommandUnit | None = None

    @classmethod
    def of(cls, test: DamperTest) -> RecordedMotion:
        """The motion and command of a test from its sample `n_settle` on."""
        # The motion is the same with and without an observation model.
        settled = slice(test.n_settle, None)
        displacement = test.displacement[settled]
        cycles = () if test.has_varying_command else regular_cycles(displacement)
        n_each = 1
        force = test.force[settled]
        if cycles:
            samples, means = _mean_cycle(displacement, cycles), _means_of_cycle(force, cycles)
            step = test.dt * (cycles[-1].stop - cycles[0].start) / (len(cycles) * samples.size)
        else:
            # A 32nd of a period: of the dominant frequency, or of a quarter of the band edge.
            band = spectrum(displacement, test.dt)
            n_each = max(1, int(1.0 / (max(band.dominant, 0.25 * band.band_edge) * test.dt * _PER_CYCLE)))
            samples, means = _means(displacement, n_each), _means(force, n_each)
            step = test.dt * n_each
        half_stroke, shape = _encode_samples(samples)
        half_force, force_shape = _encode_samples(means)
        varying = [command[settled] for command, _ in test.commands if isinstance(command, np.ndarray)]
        return cls(
            test=test.label,
            sha256=test.sha256,
            current=_largest(test.current),
            voltage=_largest(test.voltage),
            command=_largest(test.command),
            command_unit=test.command_unit,
            periodic=bool(cycles),
            step=step,
            half_stroke=half_stroke,
            shape=shape,
            force=float(np.std(force)),
            force_mean=float(means.mean()),
            half_force=half_force,
            force_shape=force_shape,
            commands=tuple(_encode_samples(_means(command, n_each))[1] for command in varying),
        )

    @property
    def displacement(self) -> Floats:
        """The displacement about its mean [m], shape (n_samples,)."""
        return self.half_stroke * _decode_samples(self.shape)

    @property
    def _force(self) -> Floats:
        return self.force_mean + self.half_force * _decode_samples(self.force_shape)

    def same_command(self, other: RecordedMotion) -> bool:
        """Whether the commands are equal; where one is unknown, whether the forces are of one size.

        Of varying commands, the largest values are compared here and the shapes with the motion.
        """
        known = self._same_known_command(other)
        alike = abs(self.force - other.force) <= _FORCE * max(self.force, other.force)
        return alike if known is None else known

    def _same_known_command(self, other: RecordedMotion) -> bool | None:
        """Whether the commands are equal; `None` where one is unknown."""
        if len(self.commands) != len(other.commands):
            return False
        known = [
            abs(one - another) <= _COMMAND * max(abs(one), abs(another)) + _LEAST_COMMAND
            for one, another in (
                (self.current, other.current),
                (self.voltage, other.voltage),
                (self.command, other.command if other.command_unit == self.command_unit else None),
            )
            if one is not None and another is not None
        ]
        return all(known) if known else None

    def _align_with(self, seen: RecordedMotion) -> _Alignment | None:
        """Motion and force aligned with the part of another test that contains most of the motion; `None` if none."""
        mine, other = (
            np.stack([each.displacement, each._force, *map(_decode_samples, each.commands)])
            for each in (self, seen)
        )
        if self.periodic and seen.periodic:
            periods = self.step * _PER_CYCLE, seen.step * _PER_CYCLE
            if abs(periods[0] - periods[1]) > _PERIOD * max(periods):
                return None
            # In phases of the cycle, whose lengths may differ a little.
            return _find_pattern(mine, np.tile(other, 2), least=1.0, limit=_PERIODIC)
        step = max(self.step, seen.step)
        if self.periodic:
            pattern = _at(np.tile(mine, 2), self.step, step)
            return _find_pattern(pattern, _at(other, seen.step, step), least=1.0, limit=_PERIODIC)
        own = _at(mine, self.step, step)
        if seen.periodic:
            n_cycles = int(_SHARE * self.displacement.size * self.step / (seen.step * _PER_CYCLE))
            cycles = np.tile(other, max(1, min(n_cycles, _CYCLES)))
            alignment = _find_pattern(_at(cycles, seen.step, step), own, least=1.0, limit=_PERIODIC)
            return None if alignment is None else replace(alignment, one=alignment.other, other=alignment.one)
        record = _at(other, seen.step, step)
        least = _SHARE
        if seen.displacement.size == _MOST:
            # Of a longer motion only the first part is kept.
            least *= min(1.0, record.shape[1] / own.shape[1])
        return _find_pattern(own, record, least=least, limit=_IRREGULAR)


@array_dataclass()
class _Alignment:
    """Correlation of two motions, and what overlaps: displacement, force and commands of each, shape (n, n_samples)."""

    correlation: float
    one: Floats
    other: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Likeness:
    """A test and another of the same motion at the same command; `correlation` is that of their displacements.

    `force_ratio` is the standard deviation of the force per that of the other test, `force_shift` the mean of the force
    less that of the other times this ratio [N], `None` where not known; `same_force` is whether runs of one condition
    may differ so. Where the command of one of them is unknown, `known_command` is false.
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
        """Description in words."""
        return self._alike("motion and command")

    @property
    def condition_in_words(self) -> str:
        """Difference of the force and its possible causes, in words."""
        ratio, shift = self.force_ratio or 1.0, self.force_shift or 0.0
        # At unknown commands that may be the reason.
        shared, command = ("motion and command", "") if self.known_command else ("motion", "command, ")
        return (
            f"{self._alike(shared)}, but its force is that of the other times {ratio:.2f} {shift:+.3g} N: another "
            f"condition: {command}temperature, pressure, pre-load? It counts as held out"
        )

    def _alike(self, shared: str) -> str:
        return f"{self.test} has the {shared} of {self.like} (correlation of displacements {self.correlation:.4f})"


def likenesses_in_words(likenesses: Sequence[Likeness]) -> str:
    """The first few of several likenesses."""
    more = f", and {len(likenesses) - 3} more alike" if len(likenesses) > 3 else ""
    return "; ".join(each.in_words for each in likenesses[:3]) + more


def likeness(test: RecordedMotion, seen: RecordedMotion) -> Likeness | None:
    """Likeness of two tests with the same motion and command, whole or for the greater part; `None` if they differ."""
    if test.sha256 and test.sha256 == seen.sha256:
        return Likeness(test=test.test, like=seen.test, correlation=1.0)
    return motion_likeness(test, seen) if test.same_command(seen) else None


def motion_likeness(test: RecordedMotion, seen: RecordedMotion) -> Likeness | None:
    """Likeness of two tests with the same motion, unless their commands are known to differ; `None` if unlike."""
    known = test._same_known_command(seen)
    alignment = None if known is False else test._align_with(seen)
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
        known_command=known is True,
        force_ratio=ratio,
        force_shift=shift,
        same_force=abs(np.log(max(ratio, 1e-3))) <= _CONDITION + _SMOOTHED * smoothing
        and abs(shift) <= _CONDITION * max(deviation, float(np.std(force))),
    )


def likest(test: RecordedMotion, seen: Sequence[RecordedMotion]) -> Likeness | None:
    """The closest of several tests that a test is like."""
    return _closest(likeness(test, other) for other in seen)


def likest_of_same_force(test: RecordedMotion, seen: Sequence[RecordedMotion]) -> Likeness | None:
    """The closest of several tests that a test is like in its force, too."""
    return _closest(each for other in seen if (each := likeness(test, other)) and each.same_force)


def likest_of_other_force(test: RecordedMotion, seen: Sequence[RecordedMotion]) -> Likeness | None:
    """The closest of several tests that a test is like in its motion, and unlike in its force."""
    return _closest(each for other in seen if (each := motion_likeness(test, other)) and not each.same_force)


def _closest(likenesses: Iterable[Likeness | None]) -> Likeness | None:
    return max(filter(None, likenesses), key=lambda each: each.correlation, default=None)


def alike_groups(motions: Sequence[RecordedMotion]) -> list[list[int]]:
    """Indices of tests in groups of those that are alike, directly or through others; each group in order."""
    group = list(range(len(motions)))
    for index, one in enumerate(motions):
        for other in range(index):
            if group[other] != group[index] and (
                likeness(one, motions[other]) or likeness(motions[other], one)
            ):
                kept, joined = sorted((group[other], group[index]))
                group = [kept if each == joined else each for each in group]
    return [[index for index, each in enumerate(group) if each == first] for first in sorted(set(group))]


def _mean_cycle(displacement: Floats, cycles: Sequence[slice]) -> Floats:
    phase = (np.arange(_PER_CYCLE) + 0.5) / _PER_CYCLE
    place = np.array([cycle.start + phase * (cycle.stop - cycle.start) for cycle in cycles])
    return np.asarray(np.interp(place, np.arange(displacement.size), displacement).mean(axis=0))


def _means_of_cycle(force: Floats, cycles: Sequence[slice]) -> Floats:
    """Means over the parts of a cycle; single samples of a force that steps at reversals would miss its mean."""
    edges = np.arange(_PER_CYCLE + 1) / _PER_CYCLE
    place = np.array([cycle.start + edges * (cycle.stop - cycle.start) for cycle in cycles])
    total = np.concatenate([[0.0], np.cumsum(force)])
    sums = np.diff(np.interp(place, np.arange(total.size), total), axis=1)
    return np.asarray((sums / np.diff(place, axis=1)).mean(axis=0))


def _means(samples: Floats, n_each: int) -> Floats:
    """Means over `n_each` samples each, of the first part of a long record."""
    n_means = min(samples.size // n_each, _MOST)
    return np.asarray(samples[: n_means * n_each].reshape(n_means, n_each).mean(axis=1))


def _encode_samples(samples: Floats) -> tuple[float, str]:
    """Largest distance from the mean, and the samples about their mean in its unit as text."""
    about = samples - samples.mean()
    largest = max(float(np.max(np.abs(about))), 1e-12)
    return largest, base64.b64encode(np.round(_INT16 * about / largest).astype("<i2").tobytes()).decode()


def _decode_samples(text: str) -> Floats:
    return np.frombuffer(base64.b64decode(text, validate=True), dtype="<i2").astype(np.float64) / _INT16


def _largest(command: CommandValues | None) -> float | None:
    return None if command is None else command_range(command)[1]


def _at(channels: Floats, step: float, wanted: float) -> Floats:
    """Channels, shape (n, n_samples), in steps of `step` at steps of `wanted`."""
    if step == wanted:
        return channels
    n_samples = channels.shape[1]
    place = np.arange(int((n_samples - 1) * step / wanted) + 1) * wanted / step
    return np.stack([np.interp(place, np.arange(n_samples), each) for each in channels])


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
    # The shifts of `_correlations` are those with enough overlap.
    shift = n_least - n_pattern + best
    first, last = max(0, shift), min(n_record, shift + n_pattern)
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
    mean_p, mean_r = (each[inside] / count for each in (sums(pattern, spread), sums(ones, record)))
    # Rounding of the transform, relative to the whole.
    floor = 1e-9 * (float(pattern @ pattern) + float(record @ record)) / count + 1e-300
    var_p = np.maximum(sums(pattern**2, spread)[inside] / count - mean_p**2, floor)
    var_r = np.maximum(sums(ones, record**2)[inside] / count - mean_r**2, floor)
    correlation = (sums(pattern, record)[inside] / count - mean_p * mean_r) / np.sqrt(var_p * var_r)
    equal = np.abs(np.sqrt(var_p) - np.sqrt(var_r)) <= _AMPLITUDE * np.sqrt(np.maximum(var_p, var_r))
    return np.where(equal, correlation, 0.0)
