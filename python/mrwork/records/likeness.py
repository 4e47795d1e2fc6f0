"""Recognise tests of one motion at one command: repeated runs, and raw, smoothed or cut versions of one record.

A fit that has seen one of them has seen the other: its error there says nothing about its error on other motions. A
hash recognises identical files only, so displacements and commands are compared.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import NotNegative, Positive, checked
from mrwork.records.command_signal import Command, command_range
from mrwork.records.damper_test import DamperTest
from mrwork.records.motion import regular_cycles, spectrum
from mrwork.store.record import Related

Array = NDArray[np.float64]

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
class RecordedMotion(Related):
    """Motion and command of a test, in the resolution that recognises them.

    `shape` is the displacement about its mean per `half_stroke` [m], in steps of `step` [s]: of the mean cycle of a
    periodic motion at constant command, of the (first part of the) record of any other; as base64 of 16-bit integers.
    `current` [A] and `voltage` [V] are constant, or the largest of a varying command, whose shape is in `commands`.
    `force` is the standard deviation of the force [N].
    """

    _made_by: ClassVar[str] = "mr.records.RecordedMotion.of(test)"

    test: str
    sha256: str
    current: float | None
    voltage: float | None
    periodic: bool
    step: Positive
    half_stroke: NotNegative
    shape: str = field(repr=False)
    force: NotNegative
    commands: tuple[str, ...] = field(default=(), repr=False)

    @classmethod
    @checked
    def of(cls, test: DamperTest) -> RecordedMotion:
        """The motion and command of a test from its sample `n_settle` on."""
        # The motion is the same with and without an observation model.
        settled = slice(test.n_settle, None)
        displacement = test.displacement[settled]
        cycles = () if test.has_varying_command else regular_cycles(displacement)
        n_each = 1
        if cycles:
            samples = _mean_cycle(displacement, cycles)
            step = test.dt * (cycles[-1].stop - cycles[0].start) / (len(cycles) * samples.size)
        else:
            n_each = _samples_of_a_mean(displacement, test.dt)
            samples = _means(displacement, n_each)
            step = test.dt * n_each
        half_stroke, shape = _encoded(samples)
        varying = [command[settled] for command, _ in test.commands if isinstance(command, np.ndarray)]
        return cls(
            test=test.label,
            sha256=test.sha256,
            current=_largest(test.current),
            voltage=_largest(test.voltage),
            periodic=bool(cycles),
            step=step,
            half_stroke=half_stroke,
            shape=shape,
            force=float(np.std(test.force[settled])),
            commands=tuple(_encoded(_means(command, n_each))[1] for command in varying),
        )

    def disagreement(self) -> str:
        """Whether the shapes of motion and commands can be read."""
        for text in (self.shape, *self.commands):
            if not _decoded(text).size:
                return f"the motion of {self.test} has no samples"
        return ""

    @property
    def displacement(self) -> Array:
        """The displacement about its mean [m], shape (n_samples,)."""
        return self.half_stroke * _decoded(self.shape)

    @checked
    def same_command(self, other: RecordedMotion) -> bool:
        """Whether the commands are equal; where one is unknown, whether the forces are of one size.

        Of varying commands, the largest values are compared here and the shapes with the motion.
        """
        if len(self.commands) != len(other.commands):
            return False
        known = [
            abs(one - another) <= _COMMAND * max(abs(one), abs(another)) + _LEAST_COMMAND
            for one, another in ((self.current, other.current), (self.voltage, other.voltage))
            if one is not None and another is not None
        ]
        if known:
            return all(known)
        return abs(self.force - other.force) <= _FORCE * max(self.force, other.force)

    @checked
    def correlation(self, seen: RecordedMotion) -> float | None:
        """Correlation of this motion with the part of another that contains it, or most of it; `None` without one."""
        if self.periodic and seen.periodic:
            periods = self.step * _PER_CYCLE, seen.step * _PER_CYCLE
            if abs(periods[0] - periods[1]) > _PERIOD * max(periods):
                return None
            # In phases of the cycle, whose lengths may differ a little.
            pair = self.displacement, np.tile(seen.displacement, 2)
            return _contained([pair], least=1.0, limit=_PERIODIC)
        step = max(self.step, seen.step)
        if self.periodic:
            own = _at(np.tile(self.displacement, 2), self.step, step)
            pair = own, _at(seen.displacement, seen.step, step)
            return _contained([pair], least=1.0, limit=_PERIODIC)
        own = _at(self.displacement, self.step, step)
        if seen.periodic:
            n_cycles = int(_SHARE * self.displacement.size * self.step / (seen.step * _PER_CYCLE))
            cycles = np.tile(seen.displacement, max(1, min(n_cycles, _CYCLES)))
            pair = _at(cycles, seen.step, step), own
            return _contained([pair], least=1.0, limit=_PERIODIC)
        pairs = [(own, _at(seen.displacement, seen.step, step))]
        for mine, other in zip(self.commands, seen.commands, strict=True):
            pairs.append((_at(_decoded(mine), self.step, step), _at(_decoded(other), seen.step, step)))
        least = _SHARE
        if seen.displacement.size == _MOST:
            # Of a longer motion only the first part is kept.
            least *= min(1.0, pairs[0][1].size / own.size)
        return _contained(pairs, least=least, limit=_IRREGULAR)


@dataclass(frozen=True, slots=True, kw_only=True)
class Likeness:
    """A test and another of the same motion at the same command; `correlation` is that of their displacements."""

    _made_by: ClassVar[str] = "fit.seen(test)"

    test: str
    like: str
    correlation: float

    @property
    def in_words(self) -> str:
        """Description in words."""
        return (
            f"{self.test} has the motion and command of {self.like} (correlation of displacements "
            f"{self.correlation:.4f})"
        )


def likenesses_in_words(found: Sequence[Likeness]) -> str:
    """The first few of several likenesses."""
    more = f", and {len(found) - 3} more alike" if len(found) > 3 else ""
    return "; ".join(each.in_words for each in found[:3]) + more


def likeness(test: RecordedMotion, seen: RecordedMotion) -> Likeness | None:
    """Whether a test has the motion and command of another one, wholly or for the greater part."""
    if test.sha256 and test.sha256 == seen.sha256:
        correlation: float | None = 1.0
    elif test.same_command(seen):
        correlation = test.correlation(seen)
    else:
        return None
    return None if correlation is None else Likeness(test=test.test, like=seen.test, correlation=correlation)


def likest(test: RecordedMotion, seen: Sequence[RecordedMotion]) -> Likeness | None:
    """The closest of several tests that a test is like."""
    found = [each for each in (likeness(test, other) for other in seen) if each is not None]
    return max(found, key=lambda each: each.correlation, default=None)


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


def _mean_cycle(displacement: Array, cycles: Sequence[slice]) -> Array:
    phase = (np.arange(_PER_CYCLE) + 0.5) / _PER_CYCLE
    place = np.array([cycle.start + phase * (cycle.stop - cycle.start) for cycle in cycles])
    return np.asarray(np.interp(place, np.arange(displacement.size), displacement).mean(axis=0))


def _samples_of_a_mean(displacement: Array, dt: float) -> int:
    """Number of samples in a 32nd of a period: of the dominant frequency, or of a quarter of the band edge."""
    band = spectrum(displacement, dt)
    return max(1, int(1.0 / (max(band.dominant, 0.25 * band.band_edge) * dt * _PER_CYCLE)))


def _means(samples: Array, n_each: int) -> Array:
    """Means over `n_each` samples each, of the first part of a long record."""
    n_means = min(samples.size // n_each, _MOST)
    return np.asarray(samples[: n_means * n_each].reshape(n_means, n_each).mean(axis=1))


def _encoded(samples: Array) -> tuple[float, str]:
    """Largest distance from the mean, and the samples about their mean in its unit as text."""
    about = samples - samples.mean()
    largest = max(float(np.max(np.abs(about))), 1e-12)
    return largest, base64.b64encode(np.round(_INT16 * about / largest).astype("<i2").tobytes()).decode()


def _decoded(text: str) -> Array:
    return np.frombuffer(base64.b64decode(text, validate=True), dtype="<i2").astype(np.float64) / _INT16


def _largest(command: Command | None) -> float | None:
    return None if command is None else command_range(command)[1]


def _at(samples: Array, step: float, wanted: float) -> Array:
    """Samples in steps of `step` at steps of `wanted`."""
    if step == wanted:
        return samples
    place = np.arange(int((samples.size - 1) * step / wanted) + 1) * wanted / step
    return np.asarray(np.interp(place, np.arange(samples.size), samples))


def _contained(pairs: Sequence[tuple[Array, Array]], *, least: float, limit: float) -> float | None:
    """Largest correlation of a pattern with a record, over all shifts; `None` below the limit.

    Of several patterns with their records, such as displacement and command, the least correlation at one shift counts.
    A share `least` of a pattern must lie within the record, with the same amplitude.
    """
    n_pattern, n_record = (min(each.size for each in side) for side in zip(*pairs, strict=True))
    n_least = max(3, int(np.ceil(least * n_pattern)))
    if min(n_pattern, n_record) < n_least:
        return None
    found = np.min(
        [_correlations(one[:n_pattern], other[:n_record], n_least) for one, other in pairs], axis=0
    )
    best = float(found.max())
    return min(best, 1.0) if best >= limit else None


def _correlations(pattern: Array, record: Array, n_least: int) -> Array:
    """Correlation over the overlap at each shift, 0 where amplitudes differ; sums by the Fourier transform."""
    n_pattern, n_record = pattern.size, record.size
    size = 1 << int(n_pattern + n_record - 1).bit_length()

    def sums(one: Array, other: Array) -> Array:
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
