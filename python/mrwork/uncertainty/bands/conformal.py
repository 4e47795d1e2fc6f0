"""Conformal prediction bands: calibrated on tests that the fit has not seen, and their measured coverage.

On another excitation the error is mostly model error, which no noise model predicts. The bands rest on the errors on
other tests that the fit has not seen: the scaled error of the next test is assumed exchangeable with them.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import ClassVar

import numpy as np

from mrwork.base.arguments import Count, Level, Positive, Whole, checked
from mrwork.base.remark import Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import Column, Table
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.command import CommandValues
from mrwork.dampers.law_sets import is_untested
from mrwork.dampers.tested_range import Exceedance, OperatingQuantity
from mrwork.errors import SettingError
from mrwork.identification.covariance import effective_samples
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
)
from mrwork.uncertainty.bands.error_shape import (
    CalibrationScores,
    ErrorGroup,
    ErrorShape,
    best_variant,
    best_variants_without_each,
    calibrate_shape,
)
from mrwork.uncertainty.bands.prediction import Prediction

LEVELS = (0.5, 0.9, 0.95)
# That of the coverage and the interval score that stand for a calibration.
LEVEL = 0.9

# Probability by which chance leaves less of any test in its band, and tests of a calibration that tell of its scatter.
_BY_CHANCE = 0.01
_LEAST_TO_SCATTER = 4

# Demands that drive a model; its force and power follow from them.
_DRIVEN = ("stroke", "velocity", "frequency", "command")
# Share by which a prediction may be farther beyond the tests than the tests that were left out for that.
_FARTHER = 0.05
# Times that small half cycles may be smaller than those of the calibration, where the band is as much wider.
_SMALLER = 1.5
# Factor between the slowest and the fastest cycles of a motion up to which it is of one frequency.
_ONE_FREQUENCY = 1.1
_NO_BAND = RemarkKind("band_missing", "no band for {0}: {why}", "test {test}, and fit it or calibrate on it")
_NEW_MOTION = RemarkKind(
    "motion_of_new_kind",
    "in {count} of {predictions} tests the motion {0}, unlike in the calibration: their bands are about the force of "
    "the model, not about a mean cycle",
    "calibrate on such a motion, too, to know its errors",
)
_SEEN = RemarkKind("tests_seen", "not used, because the fit has seen them: {0}")
_COUNT_AS_ONE = RemarkKind(
    "tests_count_as_one", "{given} tests count as {counted}: some have the same motion and command"
)


@array_dataclass(repr=False)
class Reach:
    """How far beyond its tests the model was tried: up to `severity` times their range of a quantity, or below it.

    `severities` are of each of the `tests` that were left out for that, and `scores` the errors there, by fits without
    such tests, in the scale of the calibration.
    """

    quantity: OperatingQuantity
    below: bool
    tests: tuple[str, ...]
    severities: tuple[Positive, ...]
    scores: tuple[Floats, ...]

    @property
    def severity(self) -> float:
        """How far the farthest test was beyond the others in the quantity."""
        return max(self.severities)

    def tests_as_far(self, exceedance: Exceedance) -> set[str]:
        """The tests that are as far beyond the others in this quantity as an exceedance, or nearly so."""
        pairs = zip(self.tests, self.severities, strict=True)
        return {test for test, severity in pairs if exceedance.severity <= (1.0 + _FARTHER) * severity}

    @property
    def side(self) -> tuple[OperatingQuantity, bool]:
        """Quantity and direction, as `exceeded_side` an exceedance."""
        return self.quantity, self.below

    @property
    def in_words(self) -> str:
        """Text such as "velocity up to a factor of 1.5"."""
        return f"{self.quantity} {'down' if self.below else 'up'} to a factor of {self.severity:.2g}"

    @classmethod
    def of(cls, predictions: Sequence[Prediction], shape: ErrorShape) -> tuple[Reach, ...]:
        """Reach in each quantity in which predictions are beyond the tests of their fits."""
        reached = defaultdict[tuple[OperatingQuantity, bool], list[tuple[str, float, Floats]]](list)
        about_force = replace(shape, bias=())
        for prediction in predictions:
            for exceedance in driven(prediction.outside):
                if not exceedance.between and np.isfinite(exceedance.severity):
                    reached[exceeded_side(exceedance)].append(
                        (
                            prediction.test.label,
                            exceedance.severity,
                            ErrorGroup.of([prediction]).scores(about_force)[0],
                        )
                    )
        return tuple(
            cls(quantity=quantity, below=below, tests=tests, severities=severities, scores=scores)
            for (quantity, below), rows in reached.items()
            for tests, severities, scores in [zip(*rows, strict=True)]
        )


def _least_by_binomial(prediction: Prediction, band: Band, chance: float) -> float:
    """Share of independent samples in a band; cycles of a motion that repeats err alike, and count as one."""
    import scipy  # slow to load

    inside = (prediction.measured >= band.lower) & (prediction.measured <= band.upper)
    n = max(round(effective_samples([inside - np.mean(inside)]) / max(prediction.n_cycles, 1)), 1)
    return float(np.searchsorted(scipy.special.bdtr(np.arange(n + 1), n, band.level), chance)) / n


def _at_compared(command: CommandValues | None, test: DamperTest) -> CommandValues | None:
    return command[test.counted] if isinstance(command, np.ndarray) else command


def exceeded_side(exceedance: Exceedance) -> tuple[OperatingQuantity, bool]:
    """Quantity of an exceedance, and whether it is below the tests; a command is only known where it was tested."""
    return exceedance.quantity, exceedance.below and exceedance.quantity != "command"


def driven(outside: Outside) -> tuple[Exceedance, ...]:
    """Exceedances of motion and command, without force and power, which follow from them."""
    return tuple(exceedance for exceedance in outside.exceedances if exceedance.quantity in _DRIVEN)


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOutCoverage:
    """Score of a band on one test left out, per deviation of its force, and the share of cycles in the energy band."""

    test: str
    level: Level
    samples: BandScore
    cycles_inside: float


@array_dataclass(repr=False)
class Calibration(Summarised):
    """Calibration of prediction bands from the errors on several tests.

    `scores` are the errors of each test in its scale; `tests` are their names; `held_out` describes how the tests were
    kept from the fit. Tests that are alike, such as the raw and the smoothed version of one record, count as one:
    otherwise each would be predicted by its like. `n_repeating` of them have a motion that repeats. `motions` recognise
    all tests of the calibration; `seen` are tests that were given but not used, because the fit has seen their motion
    at their command. `tested` are the ranges of the tests of the calibration, and `reach` is how far beyond its tests
    the model was tried. `coverage` is that of each test by the others, where it was measured.
    """

    _made_by: ClassVar[str] = "mr.calibrate(predictions, held_out=...)"

    shape: ErrorShape
    scores: CalibrationScores
    tests: tuple[str, ...]
    n_repeating: Whole
    held_out: str
    motions: tuple[RecordedMotion, ...] = ()
    seen: tuple[Likeness, ...] = ()
    tested: OperatingRange
    reach: tuple[Reach, ...] = ()
    coverage: tuple[LeftOutCoverage, ...] = ()

    @checked
    def knows(self, test: DamperTest) -> Likeness | None:
        """The test of the calibration that a test is, or whose motion and command it has; `None` where it is new."""
        return likest(RecordedMotion.of(test), self.motions)

    @checked
    def beyond(self, prediction: Prediction) -> tuple[Exceedance, ...]:
        """What of the motion and the command is outside the tests of the fit and of the calibration."""
        outside = driven(prediction.outside)
        exceeded = self.tested.exceeded_by(range_of_test(prediction.test, self.tested.command_unit))
        farther = {exceeded_side(exceedance): exceedance for exceedance in exceeded}
        pairs = [
            (exceedance, farther[exceeded_side(exceedance)])
            for exceedance in outside
            if exceeded_side(exceedance) in farther
        ]
        return tuple(min(pair, key=lambda exceedance: exceedance.severity) for pair in pairs)

    @checked
    def untested(self, prediction: Prediction) -> tuple[Exceedance, ...]:
        """What is farther beyond the tests than the model was tried, where no band is known.

        Several quantities are, each of which was tried, if no test that was left out is so far beyond in all of them. A
        motion that repeats is beyond in every cycle, and others, which are for moments, do not tell of it. In small
        half cycles of one that does not the band is wider, by their size; they count from 1.5 times smaller ones on.
        """
        beyond, tried = self.beyond(prediction), {reach.side: reach for reach in self.reach}
        if not prediction.n_cycles:
            beyond = tuple(
                exceedance
                for exceedance in beyond
                if exceeded_side(exceedance) != ("stroke", True) or exceedance.severity > _SMALLER
            )
        elif not self.n_repeating:
            return beyond
        as_far = [
            set[str]() if exceedance.between or reach is None else reach.tests_as_far(exceedance)
            for exceedance in beyond
            for reach in [tried.get(exceeded_side(exceedance))]
        ]
        if all(as_far):
            return beyond if beyond and not set.intersection(*as_far) else ()
        return tuple(exceedance for exceedance, tests in zip(beyond, as_far, strict=True) if not tests)

    @checked
    def test_to_run(self, prediction: Prediction) -> Remark | None:
        """Why a prediction has no band, and the test that it takes; `None` where it has one."""
        untested = self.untested(prediction)
        if not untested:
            return None
        test = prediction.test
        demand = range_of_test(test, self.tested.command_unit)
        at, (slowest, fastest) = "", demand.frequency or (0.0, 0.0)
        if fastest > _ONE_FREQUENCY * slowest:
            at = f" from {slowest:.3g} to {fastest:.3g} Hz"
        elif fastest:
            at = f" at {0.5 * (slowest + fastest):.3g} Hz"
        motion = "" if prediction.n_cycles else "a motion like it, of "
        command = f" and {test.command_in_words}" if test.commands else ""
        return _NO_BAND.remark(
            *(test.label, *(exceedance.quantity for exceedance in untested)),
            why="; ".join(exceedance.in_words for exceedance in untested),
            test=f"{motion}{1e3 * demand.stroke:.3g} mm{at}{command}",
        )

    @checked
    def band(self, prediction: Prediction, level: Level) -> Band | None:
        """Prediction band of the force, shape (n_counted,); `None` where the prediction is `untested`.

        A band beyond the tests is as wide as the errors that fits without such tests have made, if these are larger.
        There, and at commands between the tested ones, it contains the bands about other sets of laws that predict
        nearly as well.
        """
        if self.untested(prediction):
            return None
        centre, scale = self.shape.of(prediction)
        beyond, basis, test = self.beyond(prediction), self.basis, prediction.test
        sides = {exceeded_side(exceedance) for exceedance in beyond}
        farther = [reach_of_test for reach_of_test in self.reach if reach_of_test.side in sides]
        wider = self.shape.wider(prediction)
        command = test.command_in(self.tested.command_unit)
        multiple = self.scores.multiple(
            level, periodic=prediction.n_cycles > 0, command=_at_compared(command, test)
        )
        most = max((next_test_quantile(reach.scores, level) for reach in farther), default=0.0)
        half = scale * np.maximum(multiple, most / wider)
        faster = self.shape.faster(prediction)
        if wider.max() > faster:
            basis += f"; in shorter half cycles than theirs up to {wider.max():.2g} times as wide"
        elif faster > 1.0:
            basis += f"; {faster:.2g} times as wide, as the rms velocity is that of the fastest of them"
        between = is_untested(self.tested, command)
        open_to_laws = np.broadcast_to(between | bool(farther), (test.n_time,))[test.counted]
        if farther:
            names = ", ".join(dict.fromkeys(reach.quantity for reach in farther))
            basis += f"; beyond the tests in {names}, widened by the errors of fits without such tests"
        elif open_to_laws.any() and len(prediction.other_forces):
            basis += "; between the tested commands, widened by other laws that predict nearly as well"
        others = [other[test.counted] - prediction.force for other in prediction.other_forces]
        apart = np.where(open_to_laws, [np.zeros_like(centre), *others], 0.0)
        return Band(
            level=level,
            lower=centre - half + np.min(apart, axis=0),
            upper=centre + half + np.max(apart, axis=0),
            basis=basis,
        )

    @checked
    def least_by_chance(self, prediction: Prediction, band: Band, among: Count = 1) -> float:
        """Share of a test that its band holds at least, but for one in a hundred of such tests.

        It is that of the binomial distribution of the independent samples of the test, or what the tests of the
        calibration leave for a further one by how each of them is held by the band of the others, if that is less. Of
        several tests, `among` so many, none has less in 99 of a hundred calls.
        """
        import scipy  # slow to load

        chance = _BY_CHANCE / among
        if len(self.tests) < _LEAST_TO_SCATTER:
            return 0.0
        held = self.scores.held_by_others(band.level, periodic=prediction.n_cycles > 0)
        deviation = float(np.std(held, ddof=1) * np.sqrt(1.0 + 1.0 / len(held)))
        of_next = float(np.mean(held) + scipy.special.stdtrit(len(held) - 1, chance) * deviation)
        return max(min(of_next, _least_by_binomial(prediction, band, chance)), 0.0)

    @property
    def basis(self) -> str:
        """Origin of the band, in words."""
        n_tests = len(self.tests)
        if n_tests == 1:
            return f"calibrated on one test {self.held_out}, which is little evidence for the next"
        repeating = {0: "no motion of which repeats", n_tests: "of motions that repeat"}
        kinds = repeating.get(self.n_repeating, f"{self.n_repeating} of them of motions that repeat")
        return f"calibrated on {n_tests} tests {self.held_out}, {kinds}"

    @checked
    def new_kind(self, predictions: Sequence[Prediction]) -> Remark | None:
        """The warning of motions that do not repeat, or do, unlike all of the calibration; `None` without any."""
        repeats = self.n_repeating > 0
        count = sum((prediction.n_cycles > 0) != repeats for prediction in predictions)
        if self.n_repeating not in (0, len(self.tests)) or not count:
            return None
        repeat = "does not repeat" if repeats else "repeats"
        return _NEW_MOTION.remark(repeat, count=count, predictions=len(predictions))

    @property
    def reach_in_words(self) -> str:
        """How far beyond the tests bands are known, in words."""
        return ", ".join(reach_of_test.in_words for reach_of_test in self.reach) or "nowhere"

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Tests that were given but not used, and tests that count as one."""
        given, counted = len(self.motions), len(self.tests)
        seen = (_SEEN.remark(likenesses_in_words(self.seen)),) if self.seen else ()
        return (*seen, *([_COUNT_AS_ONE.remark(given=given, counted=counted)] if given > counted else ()))

    def _summary(self) -> Summary:
        shape = self.shape
        columns = (
            Column("", "test", of=itemgetter(0)),
            Column("", "median score", shown=3, of=lambda row: float(np.median(row[1]))),
            Column("", "90 % score", shown=3, of=lambda row: float(np.quantile(row[1], 0.9))),
        )
        return Summary(
            title=f"Calibration of prediction bands on {len(self.tests)} tests",
            facts=(
                ("held out", self.held_out),
                (
                    "scale of an error",
                    f"deviation x ({shape.level:.3g} + {shape.slope:.3g} steepness) + {shape.floor:.3g} N",
                ),
                ("mean error over the cycle", "removed" if self.shape.bias else "not removed"),
                ("known beyond the tests", self.reach_in_words),
            ),
            remarks=self.remarks,
            tables=[Table.of(columns, zip(self.tests, self.scores.about_mean, strict=True))],
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
    tested = range_of_tests([member.test for members in groups for member in members])
    errors = [ErrorGroup.of(members, tested.command_unit) for members in groups]
    shape, scores = calibrate_shape(best_variant(errors), errors)
    return Calibration(
        shape=shape,
        scores=scores,
        tests=tuple(" with ".join(member.test.label for member in members) for members in groups),
        n_repeating=sum(group.periodic for group in errors),
        held_out=held_out,
        motions=motions,
        seen=seen,
        tested=tested,
        reach=Reach.of(beyond, shape),
    )


def _select_held_out(
    predictions: Sequence[Prediction],
) -> tuple[list[list[Prediction]], tuple[RecordedMotion, ...], tuple[Likeness, ...]]:
    """Predictions of held-out tests in groups of alike tests, their motions, and the likeness of the seen tests."""
    unseen = [prediction for prediction in predictions if prediction.seen is None]
    motions = tuple(RecordedMotion.of(prediction.test) for prediction in unseen)
    groups = [[unseen[index] for index in members] for members in alike_groups(motions)]
    return (
        groups,
        motions,
        tuple(prediction.seen for prediction in predictions if prediction.seen is not None),
    )


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
    energy = [[energy_errors(member) for member in members] for members in groups]
    unit = range_of_tests([member.test for members in groups for member in members]).command_unit
    errors_of = [ErrorGroup.of(members, unit) for members in groups]
    rows = []
    for index, (members, variant) in enumerate(
        zip(groups, best_variants_without_each(errors_of), strict=True)
    ):
        shape, scores = calibrate_shape(variant, [*errors_of[:index], *errors_of[index + 1 :]])
        others = [np.concatenate(errors) for number, errors in enumerate(energy) if number != index]
        others = [other for other in others if other.size]
        for prediction, errors in zip(members, energy[index], strict=True):
            centre, scale = shape.of(prediction)
            command = _at_compared(prediction.test.command_in(unit), prediction.test)
            multiples = [
                scores.multiple(level, periodic=errors_of[index].periodic, command=command)
                for level in levels
            ]
            deviation = float(np.std(prediction.measured))
            for level, multiple in zip(levels, multiples, strict=True):
                inside = float("nan")
                if errors.size and others:
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
