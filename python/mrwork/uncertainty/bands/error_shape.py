"""Scale and mean of the errors of predictions: which terms they have is chosen by tests that are left out.

Cross-validation of a calibration leaves out every test, and within that every other one: with n tests n(n - 1)/2
calibrations of each variant of the shape. What these share is found once for each group of tests: its part of the
normal equations, and its mean error over the cycle.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np

from mrwork.base.arguments import NotNegative
from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.command import CommandValues, command_level
from mrwork.dampers.tested_range import least_stroke
from mrwork.uncertainty.bands.band import next_test_quantile, pooled_quantile
from mrwork.uncertainty.bands.prediction import Prediction, are_one_motion, motion_of

# Bins of the phase for the mean error; level at which variants of the shape are compared, and groups that takes.
_BINS = 24
_COMPARED_AT = 0.9
_LEAST_TO_CHOOSE = 4
# Largest number of evenly spaced samples of each test.
_SAMPLES = 1000
# Times that errors are larger, at most, in half cycles shorter, or of a motion faster, than those of the calibration.
_MOST_WIDER = 3.0
# Tests at a command that tell of the errors there.
_LEAST_AT_COMMAND = 3
_CENTRES = -np.pi + (np.arange(_BINS) + 0.5) * 2.0 * np.pi / _BINS


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorShape:
    """Scale of the errors of a test, `deviation (level + slope steepness) + floor` [N], of the model's force.

    Half cycles below the `shortest` [m] of the calibration leave the model in another state than the damper: there and
    in the next ones it is larger by the ratio of their strokes, up to three times, unless the motion repeats. So it is
    throughout a motion whose small half cycles are smaller, or whose rms velocity is larger than `speed` [m/s], that of
    the fastest test where none repeats, else 0. `bias` [deviations], shape (n_bins,) or empty, is the mean error over
    the phase of periodic tests.
    """

    level: NotNegative = 1.0
    slope: NotNegative = 0.0
    floor: NotNegative = 0.0
    bias: tuple[float, ...] = ()
    shortest: NotNegative = 0.0
    speed: NotNegative = 0.0

    def of(self, prediction: Prediction) -> tuple[Floats, Floats]:
        """Expected measured force and the scale of the error about it [N], shape (n_counted,)."""
        centre = prediction.force
        if self.bias and prediction.n_cycles:
            centre = centre + prediction.deviation * _over_cycle(prediction.phase, self.bias)
        scale = self.scale(prediction.deviation, prediction.steepness)
        return centre, scale * self.wider(prediction)

    def scale(self, deviation: Floats | float, steepness: Floats) -> Floats:
        """Scale of the error [N] at samples of this steepness; `deviation` [N] is that of the model's force."""
        return np.asarray(deviation * (self.level + self.slope * steepness) + self.floor)

    def wider(self, prediction: Prediction) -> Floats:
        """Factor of the scale by which motion is faster or smaller than in the calibration, shape (n_counted,)."""
        throughout = max(self.faster(prediction), self.smaller(prediction))
        # Of a damper that rests there is none.
        strokes = np.maximum(prediction.half_cycles, np.finfo(float).tiny)
        return throughout * np.clip(self.shortest / strokes, 1.0, _MOST_WIDER)

    def faster(self, prediction: Prediction) -> float:
        """Rms velocity per that of the fastest test of the calibration, from 1 to 3."""
        return float(np.clip(prediction.speed / self.speed, 1.0, _MOST_WIDER)) if self.speed else 1.0

    def smaller(self, prediction: Prediction) -> float:
        """Shortest stroke of the calibration per that of small half cycles, from 1 to 3; 1 if the motion repeats."""
        if prediction.n_cycles:
            return 1.0
        stroke = 2.0 * max(least_stroke(prediction.test.displacement), np.finfo(float).tiny)
        return float(np.clip(self.shortest / stroke, 1.0, _MOST_WIDER))


def _over_cycle(phase: Floats, bias: Sequence[float]) -> Floats:
    return np.interp(phase, _CENTRES, bias, period=2.0 * np.pi)


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """Terms of a shape in addition to its level."""

    steep: bool = False
    floored: bool = False
    biased: bool = False


PLAIN = Variant()


def _variants(*, biased: bool) -> list[Variant]:
    return [
        Variant(steep=steep, floored=floored, biased=with_bias)
        for with_bias, floored, steep in product((False, True) if biased else (False,), *[(False, True)] * 2)
    ]


@array_dataclass()
class ErrorGroup:
    """Errors of a test, or of tests that are alike, at evenly spaced samples.

    Arrays have shape (n_samples,): `error` [N], `deviation` and `measured`, the standard deviations of the model's and
    the measured force [N]; half cycles up to the `shortest` [m] make a fifth of the travel; `speed` [m/s] is the rms
    velocity; `command` is the constant one, `None` if it varies or is unknown; `motion` are stroke [m] and length of a
    cycle [s]. `normal` and `right` are of the least squares for the terms of the scale, and `curve`,
    (n_bins,), is the mean error over the cycle [deviations].
    """

    error: Floats
    steepness: Floats
    phase: Floats
    deviation: Floats
    measured: Floats
    periodic: bool
    shortest: float
    speed: float
    command: float | None
    motion: tuple[float, float]
    normal: Floats
    right: Floats
    curve: Floats

    @classmethod
    def of(cls, members: Sequence[Prediction], unit: CommandUnit | None = None) -> ErrorGroup:
        """Sample the errors of the predictions of alike tests, with their command in this unit."""
        command = members[0].test.command_in(unit)
        columns = []
        for member in members:
            every = slice(None, None, max(1, member.force.size // _SAMPLES))
            rows = [member.residual[every], member.steepness[every], member.phase[every]]
            constant = [np.full(rows[0].size, value) for value in (member.deviation, np.std(member.measured))]
            columns.append(np.array([*rows, *constant]))
        error, steepness, phase, deviation, measured = np.concatenate(columns, axis=1)
        terms = np.stack([deviation, deviation * steepness, np.ones_like(error)])
        weight = 1.0 / error.size / measured**2
        index = np.minimum(((phase + np.pi) / (2.0 * np.pi) * _BINS).astype(int), _BINS - 1)
        total = np.bincount(index, weights=error / deviation, minlength=_BINS)
        return cls(
            error=error,
            steepness=steepness,
            phase=phase,
            deviation=deviation,
            measured=measured,
            periodic=all(member.n_cycles for member in members),
            shortest=2.0 * min(least_stroke(member.test.displacement) for member in members),
            speed=max(member.speed for member in members),
            command=command_level(command, unit) if unit and isinstance(command, float) else None,
            motion=motion_of(members[0].test),
            normal=terms * weight @ terms.T,
            right=terms @ (weight * np.abs(error)),
            curve=total / np.maximum(np.bincount(index, minlength=_BINS), 1),
        )

    def scores(self, shape: ErrorShape) -> tuple[Floats, Floats]:
        """Absolute errors in the scale of a shape, about its mean over the cycle, and that scale [N]."""
        error, scale = self.error, shape.scale(self.deviation, self.steepness)
        if shape.bias and self.periodic:
            error = error - self.deviation * _over_cycle(self.phase, shape.bias)
        return np.abs(error) / scale, scale


@array_dataclass()
class CalibrationScores:
    """Absolute errors of each test in a scale: about the mean over the cycle of the others, or the model's force.

    Tests whose motion does not repeat have no such mean, and all their error is about the model's force. `commands` are
    those of the tests, `None` where one varies or is unknown; empty if none is known.
    """

    about_mean: tuple[Floats, ...]
    about_force: tuple[Floats, ...]
    commands: tuple[float | None, ...] = ()

    def of(self, *, periodic: bool) -> tuple[Floats, ...]:
        """Those that stand for the errors of a test whose motion repeats, or does not."""
        return self.about_mean if periodic else self.about_force

    def multiple(self, level: float, *, periodic: bool, command: CommandValues | None) -> Floats:
        """Half width of the band of a further test at this command, in the scale of its errors.

        It is the `next_test_quantile` of all tests, or what the tests at this command need, at least three, if that is
        more; it is linear between tested commands. (Quantiles of classes: Vovk, Gammerman and Shafer, 2005, ch. 4.5.)
        """
        scores = self.of(periodic=periodic)
        of_all = next_test_quantile(scores, level)
        at_command = defaultdict[float, list[Floats]](list)
        for own_command, own in zip(self.commands, scores, strict=False):
            if own_command is not None:
                at_command[own_command].append(own)
        if command is None or not at_command:
            return np.array(of_all)
        tested = sorted(at_command)
        needed = [
            of_all
            if len(at_command[each]) < _LEAST_AT_COMMAND
            else max(of_all, pooled_quantile(at_command[each], level))
            for each in tested
        ]
        return np.asarray(np.interp(np.asarray(command), tested, needed))

    def held_by_others(self, level: float, *, periodic: bool) -> list[float]:
        """Share of the errors of each test in the band of the others."""
        held = []
        for index, own in enumerate(self.of(periodic=periodic)):
            others = CalibrationScores(
                about_mean=self.about_mean[:index] + self.about_mean[index + 1 :],
                about_force=self.about_force[:index] + self.about_force[index + 1 :],
                commands=self.commands[:index] + self.commands[index + 1 :],
            )
            command = self.commands[index] if self.commands else None
            held.append(float(np.mean(own <= others.multiple(level, periodic=periodic, command=command))))
        return held


def calibrate_shape(variant: Variant, groups: Sequence[ErrorGroup]) -> tuple[ErrorShape, CalibrationScores]:
    """Shape fitted to groups of tests, and their errors in its scale."""
    shape = replace(
        _fit_scale(variant, groups),
        shortest=min(group.shortest for group in groups),
        speed=0.0 if any(group.periodic for group in groups) else max(group.speed for group in groups),
    )
    about_force = tuple(group.scores(shape)[0] for group in groups)
    about_mean = about_force
    if variant.biased:
        total = np.sum([group.curve for group in groups], axis=0)
        others = [(total - group.curve) / max(len(groups) - 1, 1) for group in groups]
        biased = [replace(shape, bias=tuple(bias.tolist())) for bias in others]
        about_mean = tuple(group.scores(own)[0] for group, own in zip(groups, biased, strict=True))
        shape = replace(shape, bias=tuple((total / len(groups)).tolist()))
    commands = tuple(group.command for group in groups)
    return shape, CalibrationScores(about_mean=about_mean, about_force=about_force, commands=commands)


def best_variant(groups: Sequence[ErrorGroup]) -> Variant:
    """The variant with the least interval score of each group by the calibration without it."""
    if len(groups) < _LEAST_TO_CHOOSE:
        return PLAIN
    return min(
        _variants(biased=_tell_of_cycles(groups)),
        key=lambda variant: sum(
            _scores_left_out(variant, groups, (index,))[0] for index in range(len(groups))
        ),
    )


def best_variants_without_each(groups: Sequence[ErrorGroup]) -> list[Variant]:
    """For each group, the variant that `best_variant` would choose without it."""
    n = len(groups)
    if n - 1 < _LEAST_TO_CHOOSE:
        return [PLAIN] * n
    irregular = {index for index, group in enumerate(groups) if not group.periodic}
    regular = [group for group in groups if group.periodic]
    variants = _variants(biased=len(irregular) <= 1 and _tell_of_cycles(regular))
    totals = np.zeros((len(variants), n))
    for number, variant in enumerate(variants):
        for pair in combinations(range(n), 2):
            if variant.biased and not irregular <= set(pair):
                continue
            # The score of either is part of the choice without the other.
            totals[number, pair] += _scores_left_out(variant, groups, pair)[::-1]
        if variant.biased:
            totals[number, [not irregular <= {index} for index in range(n)]] = np.inf
    return [variants[int(best)] for best in np.argmin(totals, axis=0)]


def _tell_of_cycles(groups: Sequence[ErrorGroup]) -> bool:
    """Whether the mean error over a cycle of other motions follows from groups: from so many motions that repeat.

    It is alike at all commands, so that tests of one motion tell nothing of another.
    """
    motions = list[tuple[float, float]]()
    for group in groups:
        if not any(are_one_motion(group.motion, other) for other in motions):
            motions.append(group.motion)
    return all(group.periodic for group in groups) and len(motions) >= _LEAST_TO_CHOOSE


def _scores_left_out(variant: Variant, groups: Sequence[ErrorGroup], without: tuple[int, ...]) -> list[float]:
    """Interval score of each group left out, per deviation of the force, by the calibration on the others."""
    shape, scores = calibrate_shape(
        variant, [group for index, group in enumerate(groups) if index not in without]
    )
    result = []
    for index in without:
        half = pooled_quantile(scores.of(periodic=groups[index].periodic), _COMPARED_AT)
        own, scale = groups[index].scores(shape)
        width = (2.0 * half + 2.0 / (1.0 - _COMPARED_AT) * np.maximum(own - half, 0.0)) * scale
        result.append(float(np.mean(width / groups[index].measured)))
    return result


def _fit_scale(variant: Variant, groups: Sequence[ErrorGroup]) -> ErrorShape:
    """Shape by non-negative least squares on the absolute errors, relative to each test's force."""
    if not (variant.steep or variant.floored):
        return ErrorShape()
    chosen = np.flatnonzero([True, variant.steep, variant.floored])
    normal = np.sum([group.normal for group in groups], axis=0)[np.ix_(chosen, chosen)]
    right = np.sum([group.right for group in groups], axis=0)[chosen]
    values = np.zeros(3)
    values[chosen] = _non_negative(normal, right)
    shape = ErrorShape(level=float(values[0]), slope=float(values[1]), floor=float(values[2]))
    # With steepness alone the band would have no width where the force is constant.
    return shape if shape.level + shape.floor > 0.0 else ErrorShape()


def _non_negative(normal: Floats, right: Floats) -> Floats:
    """Minimum of x' N x / 2 - r' x over x >= 0."""
    from scipy.optimize import nnls  # slow to load

    # The floor is in newtons, the others are ratios: unknowns of equal size for the solver.
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    values, vectors = np.linalg.eigh(normal / np.outer(size, size))
    root = np.sqrt(np.maximum(values, 1e-12 * values[-1]))
    return np.asarray(nnls((vectors * root).T, vectors.T @ (right / size) / root)[0] / size)
