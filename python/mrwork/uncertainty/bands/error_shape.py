"""Scale and mean of the errors of predictions: which terms they have is chosen by tests that are left out.

Cross-validation of a calibration leaves out every test, and within that every other one: with n tests n(n - 1)/2
calibrations of each variant of the shape. What these share is computed once: normal equations and mean errors of each
group of tests, of which sums over groups are taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import NotNegative
from mrwork.base.values import Floats
from mrwork.uncertainty.bands.band import weighted_quantile
from mrwork.uncertainty.bands.prediction import Prediction, has_regular_cycles

# Bins of the phase for the mean error; level at which variants of the shape are compared, and groups that takes.
_BINS = 24
_COMPARED_AT = 0.9
_LEAST_TO_CHOOSE = 4
# Largest number of evenly spaced samples of each test.
_SAMPLES = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorShape:
    """Scale of the errors of a test, `deviation (level + slope steepness) + floor` [N], of the model's force.

    `bias` [deviations], shape (n_bins,) or empty, is the mean error over the phase of periodic tests.
    """

    level: NotNegative = 1.0
    slope: NotNegative = 0.0
    floor: NotNegative = 0.0
    bias: tuple[float, ...] = ()

    def scale(self, deviation: Floats | float, steepness: Floats) -> Floats:
        """Scale of the error [N], shape of `steepness`."""
        return np.asarray(deviation * (self.level + self.slope * steepness) + self.floor)

    def of(self, prediction: Prediction) -> tuple[Floats, Floats]:
        """Expected measured force and the scale of the error about it [N], shape (n_counted,)."""
        deviation = prediction.deviation
        centre = prediction.force
        if self.bias and has_regular_cycles(prediction.test):
            mean = np.interp(prediction.phase, _CENTRES, self.bias, period=2.0 * np.pi)
            centre = centre + deviation * mean
        return centre, self.scale(deviation, prediction.steepness)


_CENTRES = -np.pi + (np.arange(_BINS) + 0.5) * 2.0 * np.pi / _BINS


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


@dataclass(slots=True, kw_only=True)
class ErrorTable:
    """Errors of all groups of tests, at evenly spaced samples; a group is one test, or tests that are alike.

    Arrays have shape (n_samples,): `error` [N], `deviation` and `measured`, the standard deviations of the model's and
    the measured force [N], and the group of each sample, all samples of a group in a row.
    """

    error: Floats
    steepness: Floats
    phase: Floats
    deviation: Floats
    measured: Floats
    group: NDArray[np.intp]
    periodic: NDArray[np.bool_]
    _slices: list[slice] = field(init=False)
    _share: Floats = field(init=False)
    _normal: Floats = field(init=False)
    _right: Floats = field(init=False)
    _curves: Floats = field(init=False)
    _place: tuple[NDArray[np.intp], NDArray[np.intp], Floats] = field(init=False)

    @classmethod
    def of(cls, groups: Sequence[Sequence[Prediction]]) -> ErrorTable:
        """Sample the errors of the predictions of each group."""
        columns: list[tuple[NDArray[Any], ...]] = []
        for number, members in enumerate(groups):
            for member in members:
                every = even_samples(member)
                error = member.residual[every]
                constant = (member.deviation, np.std(member.measured), number)
                same = (np.full(error.size, value) for value in constant)
                columns.append((error, member.steepness[every], member.phase[every], *same))
        error, steepness, phase, deviation, measured, group = map(np.concatenate, zip(*columns, strict=True))
        return cls(
            error=error,
            steepness=steepness,
            phase=phase,
            deviation=deviation,
            measured=measured,
            group=group,
            periodic=np.array(
                [all(has_regular_cycles(member.test) for member in members) for members in groups]
            ),
        )

    def __post_init__(self) -> None:
        sizes = np.bincount(self.group)
        ends = np.cumsum(sizes)
        self._slices = [slice(int(end - size), int(end)) for size, end in zip(sizes, ends, strict=True)]
        self._share = 1.0 / sizes[self.group]
        columns = np.stack([self.deviation, self.deviation * self.steepness, np.ones_like(self.error)])
        weight = self._share / self.measured**2
        size = np.abs(self.error)
        self._normal = np.array([columns[:, cut] * weight[cut] @ columns[:, cut].T for cut in self._slices])
        self._right = np.array([columns[:, cut] @ (weight[cut] * size[cut]) for cut in self._slices])
        index = np.minimum(((self.phase + np.pi) / (2.0 * np.pi) * _BINS).astype(int), _BINS - 1)
        shape = (len(sizes), _BINS)
        cell = self.group * _BINS + index
        count = np.bincount(cell, minlength=shape[0] * shape[1])
        total = np.bincount(cell, weights=self.error / self.deviation, minlength=count.size)
        self._curves = (total / np.maximum(count, 1)).reshape(shape)
        # Linear interpolation between the centres of two bins, over the end of the cycle too.
        position = (self.phase + np.pi) / (2.0 * np.pi) * _BINS - 0.5
        before = np.floor(position).astype(np.intp)
        self._place = before % _BINS, (before + 1) % _BINS, position - before

    @property
    def n_groups(self) -> int:
        """Number of groups."""
        return len(self._slices)

    def calibrate(self, variant: Variant, without: Sequence[int] = ()) -> tuple[ErrorShape, list[Floats]]:
        """Shape fitted without some groups, and the absolute errors of each other group in its scale."""
        shape, scores, _ = self._fit_shape(variant, without)
        return shape, [scores[cut] for index, cut in enumerate(self._slices) if index not in without]

    def best_variant(self) -> Variant:
        """The variant with the least interval score of each group by the calibration without it."""
        if self.n_groups < _LEAST_TO_CHOOSE:
            return PLAIN
        variants = _variants(biased=bool(self.periodic.all()))
        alone = [(index,) for index in range(self.n_groups)]
        return min(
            variants, key=lambda variant: sum(self._scores_left_out(variant, without)[0] for without in alone)
        )

    def best_variants_without_each(self) -> list[Variant]:
        """For each group, the variant that `best_variant` would choose without it."""
        n = self.n_groups
        if n - 1 < _LEAST_TO_CHOOSE:
            return [PLAIN] * n
        irregular = set(np.flatnonzero(~self.periodic).tolist())
        variants = _variants(biased=len(irregular) <= 1)
        totals = np.zeros((len(variants), n))
        for number, variant in enumerate(variants):
            for pair in combinations(range(n), 2):
                if variant.biased and not irregular <= set(pair):
                    continue
                # The score of either is part of the choice without the other.
                totals[number, pair] += self._scores_left_out(variant, pair)[::-1]
            if variant.biased:
                totals[number, [not irregular <= {index} for index in range(n)]] = np.inf
        return [variants[int(best)] for best in np.argmin(totals, axis=0)]

    def _scores_left_out(self, variant: Variant, without: tuple[int, ...]) -> list[float]:
        """Interval score of each group left out, per deviation of the force, by the calibration on the others."""
        _, scores, scale = self._fit_shape(variant, without)
        half = weighted_quantile(scores, self._weights(without), _COMPARED_AT)
        result = []
        for index in without:
            cut = self._slices[index]
            outside = np.maximum(scores[cut] - half, 0.0)
            width = (2.0 * half + 2.0 / (1.0 - _COMPARED_AT) * outside) * scale[cut]
            result.append(float(np.mean(width / self.measured[cut])))
        return result

    def _weights(self, without: Sequence[int]) -> Floats:
        weights = self._share / (self.n_groups - len(without))
        for index in without:
            weights[self._slices[index]] = 0.0
        return weights

    def _fit_shape(self, variant: Variant, without: Sequence[int]) -> tuple[ErrorShape, Floats, Floats]:
        """Shape fitted without some groups; absolute errors in its scale, and the scale [N], of all samples."""
        inside = np.ones(self.n_groups, dtype=bool)
        inside[list(without)] = False
        n_inside = int(np.count_nonzero(inside))
        shape = self._scale(variant, inside)
        scale = shape.scale(self.deviation, self.steepness)
        about = self.error
        if variant.biased:
            total = self._curves[inside].sum(axis=0)
            shape = replace(shape, bias=tuple(total / n_inside))
            others = np.where(
                inside[:, np.newaxis], (total - self._curves) / max(n_inside - 1, 1), total / n_inside
            )
            before, after, share = self._place
            bias = (1.0 - share) * others[self.group, before] + share * others[self.group, after]
            about = about - self.deviation * bias
        return shape, np.abs(about) / scale, scale

    def _scale(self, variant: Variant, inside: NDArray[np.bool_]) -> ErrorShape:
        """Shape by non-negative least squares on the absolute errors, relative to each test's force."""
        if not (variant.steep or variant.floored):
            return ErrorShape()
        chosen = np.flatnonzero([True, variant.steep, variant.floored])
        normal = self._normal[inside].sum(axis=0)[np.ix_(chosen, chosen)]
        right = self._right[inside].sum(axis=0)[chosen]
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


def even_samples(prediction: Prediction) -> slice:
    """Evenly spaced samples of a prediction, of which there are not too many."""
    return slice(None, None, max(1, prediction.force.size // _SAMPLES))
