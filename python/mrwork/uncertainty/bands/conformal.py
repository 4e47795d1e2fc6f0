"""Conformal prediction bands: calibrated on tests that the fit has not seen, and their measured coverage.

On another excitation the error is mostly model error, which no noise model predicts. The bands rest on the errors on
other tests that the fit has not seen: the scaled error of the next test is assumed exchangeable with them.

Cross-validation of a calibration leaves out every test, and within that every other one: with n tests n(n - 1)/2
calibrations of each variant of the shape. What these share is computed once: normal equations and mean errors of each
group of tests, of which sums over groups are taken.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, product
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import Level, NotNegative, Positive, checked
from mrwork.base.numbers import format_rounded
from mrwork.base.summary import Summarised, Summary
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.tested_range import Exceedance, OperatingQuantity
from mrwork.errors import SettingError
from mrwork.records import DamperTest, Likeness, OperatingRange, Outside
from mrwork.records.damper_test import range_of_test, range_of_tests
from mrwork.records.likeness import RecordedMotion, alike_groups, likenesses_in_words, likest
from mrwork.uncertainty.bands.band import (
    Band,
    BandScore,
    energy_band,
    energy_errors,
    energy_of_cycles,
    next_test_quantile,
    score,
    weighted_quantile,
)
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
            for each in members:
                every = _even(each)
                error = each.residual[every]
                constant = (each.deviation, np.std(each.measured), number)
                same = (np.full(error.size, value) for value in constant)
                columns.append((error, each.steepness[every], each.phase[every], *same))
        error, steepness, phase, deviation, measured, group = map(np.concatenate, zip(*columns, strict=True))
        return cls(
            error=error,
            steepness=steepness,
            phase=phase,
            deviation=deviation,
            measured=measured,
            group=group,
            periodic=np.array([all(has_regular_cycles(each.test) for each in members) for members in groups]),
        )

    def __post_init__(self) -> None:
        sizes = np.bincount(self.group)
        ends = np.cumsum(sizes)
        self._slices = [slice(int(end - size), int(end)) for size, end in zip(sizes, ends, strict=True)]
        self._share = 1.0 / sizes[self.group]
        columns = np.stack([self.deviation, self.deviation * self.steepness, np.ones_like(self.error)])
        weight = self._share / self.measured**2
        size = np.abs(self.error)
        self._normal = np.array([columns[:, own] * weight[own] @ columns[:, own].T for own in self._slices])
        self._right = np.array([columns[:, own] @ (weight[own] * size[own]) for own in self._slices])
        index = np.minimum(((self.phase + np.pi) / (2.0 * np.pi) * _BINS).astype(int), _BINS - 1)
        shape = (len(sizes), _BINS)
        cell = self.group * _BINS + index
        count = np.bincount(cell, minlength=shape[0] * shape[1])
        total = np.bincount(cell, weights=self.error / self.deviation, minlength=count.size)
        self._curves = (total / np.maximum(count, 1)).reshape(shape)
        # Linear interpolation between the centres of two bins, over the end of the cycle too.
        place = (self.phase + np.pi) / (2.0 * np.pi) * _BINS - 0.5
        before = np.floor(place).astype(np.intp)
        self._place = before % _BINS, (before + 1) % _BINS, place - before

    @property
    def n_groups(self) -> int:
        """Number of groups."""
        return len(self._slices)

    def calibrate(self, variant: Variant, without: Sequence[int] = ()) -> tuple[ErrorShape, list[Floats]]:
        """Shape fitted without some groups, and the absolute errors of each other group in its scale."""
        shape, scores, _ = self._fit_shape(variant, without)
        return shape, [scores[own] for index, own in enumerate(self._slices) if index not in without]

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
            own = self._slices[index]
            outside = np.maximum(scores[own] - half, 0.0)
            width = (2.0 * half + 2.0 / (1.0 - _COMPARED_AT) * outside) * scale[own]
            result.append(float(np.mean(width / self.measured[own])))
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
    """Minimum of x' N x / 2 - r' x over x >= 0, by trying every set of positive unknowns, of which there are few."""
    # The floor is in newtons, the others are ratios: unknowns of equal size for the solver.
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled, target = normal / np.outer(size, size), right / size
    best, least = np.zeros(right.size), 0.0
    for support in product((False, True), repeat=right.size):
        free = np.flatnonzero(support)
        if free.size == 0:
            continue
        solved = np.linalg.lstsq(scaled[np.ix_(free, free)], target[free], rcond=1e-12)[0]
        value = -0.5 * float(target[free] @ solved)
        if np.all(solved >= 0.0) and value < least:
            best, least = np.zeros(right.size), value
            best[free] = solved
    return np.asarray(best / size)


LEVELS = (0.5, 0.9, 0.95)

# Demands that drive a model; its force and power follow from them.
_DRIVEN = ("stroke", "velocity", "frequency", "command")
# Share by which a prediction may be farther beyond the tests than the tests that were left out for that.
_FARTHER = 0.05


@array_dataclass(repr=False)
class Reach:
    """How far beyond its tests the model was tried: up to `severity` times their range of a quantity, or below it.

    `scores` are the errors there, by fits without such tests, of each of these tests in the scale of the calibration.
    """

    quantity: OperatingQuantity
    below: bool
    severity: Positive
    scores: tuple[Floats, ...]

    @classmethod
    def of(cls, predictions: Sequence[Prediction], shape: ErrorShape) -> tuple[Reach, ...]:
        """Reach in each quantity in which predictions are beyond the tests of their fits."""
        scores, severity = defaultdict[_Side, list[Floats]](list), dict[_Side, float]()
        for each in predictions:
            for one in driven(each.outside):
                if not one.between:
                    scores[side_of(one)].append(_scores_of(each, shape))
                    severity[side_of(one)] = max(severity.get(side_of(one), 0.0), one.severity)
        return tuple(
            cls(quantity=side[0], below=side[1], severity=severity[side], scores=tuple(own))
            for side, own in scores.items()
            if np.isfinite(severity[side])
        )


_Side = tuple[OperatingQuantity, bool]


def side_of(exceedance: Exceedance) -> _Side:
    """Quantity of an exceedance, and whether it is below the tests; a command is only known where it was tested."""
    return exceedance.quantity, exceedance.below and exceedance.quantity != "command"


def driven(outside: Outside) -> tuple[Exceedance, ...]:
    """Exceedances of motion and command, without those of the force that follows from them."""
    return tuple(each for each in outside.exceedances if each.quantity in _DRIVEN)


def _scores_of(prediction: Prediction, shape: ErrorShape) -> Floats:
    """Errors of a prediction in the scale of a calibration, at evenly spaced samples."""
    centre, scale = shape.of(prediction)
    return np.abs(prediction.measured - centre)[_even(prediction)] / scale[_even(prediction)]


def _even(prediction: Prediction) -> slice:
    return slice(None, None, max(1, prediction.force.size // _SAMPLES))


@array_dataclass(repr=False)
class Calibration(Summarised):
    """Calibration of prediction bands from the errors on several tests.

    `scores` are the errors of each test in its scale; `tests` are their names; `held_out` describes how the tests were
    kept from the fit. Tests that are alike, such as the raw and the smoothed version of one record, count as one:
    otherwise each would be predicted by its like. `motions` recognise all tests of the calibration; `seen` are tests
    that were given but not used, because the fit has seen their motion at their command. `tested` are the ranges of
    the tests of the calibration, and `reach` is how far beyond its tests the model was tried.
    """

    _made_by: ClassVar[str] = "mr.calibrate(predictions, held_out=...)"

    shape: ErrorShape
    scores: tuple[Floats, ...]
    tests: tuple[str, ...]
    held_out: str
    motions: tuple[RecordedMotion, ...] = ()
    seen: tuple[Likeness, ...] = ()
    tested: OperatingRange | None = None
    reach: tuple[Reach, ...] = ()

    @checked
    def knows(self, test: DamperTest) -> Likeness | None:
        """The test of the calibration that a test is, or whose motion and command it has; `None` where it is new."""
        return likest(RecordedMotion.of(test), self.motions)

    @checked
    def beyond(self, prediction: Prediction) -> tuple[Exceedance, ...]:
        """What of the motion and the command is outside the tests of the fit, and outside those of the calibration."""
        outside = driven(prediction.outside)
        if not outside or self.tested is None:
            return outside
        own = self.tested.exceeded_by(range_of_test(prediction.test, self.tested.command_unit))
        farther = {side_of(each): each for each in own}
        pairs = [(each, farther[side_of(each)]) for each in outside if side_of(each) in farther]
        return tuple(min(pair, key=lambda each: each.severity) for pair in pairs)

    @checked
    def untested(self, prediction: Prediction) -> tuple[Exceedance, ...]:
        """What is farther beyond the tests than the model was tried, where no band is known."""
        most = {(each.quantity, each.below): (1.0 + _FARTHER) * each.severity for each in self.reach}
        return tuple(
            each
            for each in self.beyond(prediction)
            if each.between or each.severity > most.get(side_of(each), 0.0)
        )

    @checked
    def test_to_run(self, prediction: Prediction) -> str:
        """Why a prediction has no band, and the test that it takes; empty where it has one."""
        untested = self.untested(prediction)
        if not untested:
            return ""
        test = prediction.test
        demand = range_of_test(test, None if self.tested is None else self.tested.command_unit)
        at = f" at {np.mean(demand.frequency):.3g} Hz" if demand.frequency else ""
        command = f" and {test.command_in_words}" if test.commands else ""
        why = "; ".join(each.in_words for each in untested)
        return (
            f"no band: {why}; test {1e3 * demand.stroke:.3g} mm{at}{command}, and fit it or calibrate on it"
        )

    @checked
    def band(self, prediction: Prediction, level: Level) -> Band | None:
        """Prediction band of the force, shape (n_counted,); `None` where the prediction is `untested`.

        A band beyond the tests is as wide as the errors that fits without such tests have made, if these are larger,
        and contains the bands about other sets of laws that predict nearly as well.
        """
        if self.untested(prediction):
            return None
        centre, scale = self.shape.of(prediction)
        beyond = self.beyond(prediction)
        sides = {side_of(each) for each in beyond}
        farther = [each.scores for each in self.reach if (each.quantity, each.below) in sides]
        multiple = max(next_test_quantile(scores, level) for scores in (self.scores, *farther))
        band = Band.about(centre, multiple * scale, level=level, basis=self.basis)
        if not beyond:
            return band
        names = ", ".join(one.quantity for one in beyond)
        force, counted = prediction.force, prediction.test.counted
        apart = [np.zeros_like(force), *(other[counted] - force for other in prediction.other_forces)]
        return replace(
            band,
            lower=band.lower + np.min(apart, axis=0),
            upper=band.upper + np.max(apart, axis=0),
            basis=f"{self.basis}; beyond the tests in {names}, widened by the errors of fits without such tests",
        )

    @property
    def basis(self) -> str:
        """Origin of the band, in words."""
        n_tests = len(self.tests)
        if n_tests == 1:
            return f"calibrated on one test {self.held_out}, which is little evidence for the next"
        return f"calibrated on {n_tests} tests {self.held_out}"

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on tests that were given but not used, and on tests that count as one."""
        remarks = []
        if self.seen:
            remarks.append(f"Not used, because the fit has seen them: {likenesses_in_words(self.seen)}.")
        joined = len(self.motions) - len(self.tests)
        if joined > 0:
            remarks.append(
                f"{len(self.motions)} tests count as {len(self.tests)}: some have the same motion and command."
            )
        return tuple(remarks)

    def _summary(self) -> Summary:
        shape = self.shape
        return Summary(
            title=f"Calibration of prediction bands on {len(self.tests)} tests",
            facts=(
                ("held out", self.held_out),
                (
                    "scale of an error",
                    f"deviation x ({shape.level:.3g} + {shape.slope:.3g} steepness) + {shape.floor:.3g} N",
                ),
                ("mean error over the cycle", "removed" if self.shape.bias else "not removed"),
            ),
            notes=list(self.remarks),
            columns=("test", "median score", "90 % score"),
            rows=[
                (
                    test,
                    *(format_rounded(float(np.quantile(np.abs(scores), share)), 3) for share in (0.5, 0.9)),
                )
                for test, scores in zip(self.tests, self.scores, strict=True)
            ],
        )


@checked
def calibrate(
    predictions: Sequence[Prediction], *, held_out: str, beyond: Sequence[Prediction] = ()
) -> Calibration:
    """Calibrate bands on tests that the fit has not seen.

    The scale of the error is proportional to the force of the test, with or without a constant and a term that grows
    with the steepness of the force; the error has zero mean or a mean over the cycle. The variant with the least
    interval score is chosen by leave-one-out cross-validation over the tests. Predictions of tests that the fit has
    `seen` are left out; tests that are alike count as one.

    Parameters
    ----------
    predictions
        Predictions of the tests, at least one.
    held_out
        How the tests were kept from the fit, such as "the fit has not seen".
    beyond
        Predictions of the fastest, slowest and largest tests by fits to the others, see `predict_beyond`: bands are
        known as far beyond the tests as these. Without them there is no band beyond.

    Raises
    ------
    SettingError
        Where no test is given, or the fit has seen all.
    """
    if not predictions:
        raise SettingError(
            "a band is calibrated on tests that the fit has not seen, none was given; name at least one"
        )
    groups, motions, seen = _select_held_out(predictions)
    if not groups:
        raise SettingError(
            f"a band is calibrated on tests that the fit has not seen, but {likenesses_in_words(seen)}; "
            "give tests at other motions or commands"
        )
    table = ErrorTable.of(groups)
    shape, scores = table.calibrate(table.best_variant())
    return Calibration(
        shape=shape,
        scores=tuple(scores),
        tests=tuple(" with ".join(each.test.label for each in members) for members in groups),
        held_out=held_out,
        motions=motions,
        seen=seen,
        tested=range_of_tests([each.test for members in groups for each in members]),
        reach=Reach.of(beyond, shape),
    )


def _select_held_out(
    predictions: Sequence[Prediction],
) -> tuple[list[list[Prediction]], tuple[RecordedMotion, ...], tuple[Likeness, ...]]:
    """Predictions of held-out tests in groups of alike tests, their motions, and the likeness of the seen tests."""
    unseen = [each for each in predictions if each.seen is None]
    motions = tuple(RecordedMotion.of(each.test) for each in unseen)
    groups = [[unseen[index] for index in members] for members in alike_groups(motions)]
    return groups, motions, tuple(each.seen for each in predictions if each.seen is not None)


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOutCoverage:
    """Score of a band on one test left out, per deviation of its force, and the share of cycles in the energy band."""

    test: str
    level: Level
    samples: BandScore
    cycles_inside: float


def measured_coverage(
    predictions: Sequence[Prediction], levels: Sequence[Level] = LEVELS
) -> tuple[LeftOutCoverage, ...]:
    """Coverage of each test by bands calibrated on the others, at each level; alike tests are left out together."""
    groups, _, _ = _select_held_out(predictions)
    if len(groups) < 2:
        count = f"{len(predictions)} was given in all"
        if len(predictions) > 1:
            count = f"of {len(predictions)} given, those that the fit has not seen count as {len(groups)}"
        raise SettingError(
            f"coverage is measured on tests that the calibration does not know, {count}; give at least two"
        )
    energy = [[energy_errors(each) for each in members] for members in groups]
    table = ErrorTable.of(groups)
    rows = []
    for index, (members, variant) in enumerate(zip(groups, table.best_variants_without_each(), strict=True)):
        shape, scores = table.calibrate(variant, (index,))
        others = [np.concatenate(own) for number, own in enumerate(energy) if number != index]
        others = [each for each in others if each.size]
        multiples = [next_test_quantile(scores, level) for level in levels]
        for prediction, own in zip(members, energy[index], strict=True):
            centre, scale = shape.of(prediction)
            deviation = float(np.std(prediction.measured))
            for level, multiple in zip(levels, multiples, strict=True):
                inside = float("nan")
                if own.size and others:
                    band = energy_band(prediction, others, level)
                    inside = score(band, energy_of_cycles(prediction.test, prediction.test.force)).coverage
                band = Band.about(centre, multiple * scale, level=level)
                rows.append(
                    LeftOutCoverage(
                        test=prediction.test.label,
                        level=level,
                        samples=score(band, prediction.measured, per=deviation),
                        cycles_inside=inside,
                    )
                )
    return tuple(rows)
