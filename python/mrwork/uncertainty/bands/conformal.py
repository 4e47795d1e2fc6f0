"""Conformal prediction bands: calibrated on tests that the fit has not seen, and their measured coverage.

On another excitation the error is mostly model error, which no noise model predicts. The bands rest on the errors on
other tests that the fit has not seen: the scaled error of the next test is assumed exchangeable with them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import Level, checked
from mrwork.errors import RecordError, SettingError
from mrwork.records import DamperTest, Likeness, RecordedMotion
from mrwork.records.likeness import alike_groups, likenesses_in_words, likest
from mrwork.store.record import OrNan, Related
from mrwork.summary import Summarised, Summary, rounded
from mrwork.uncertainty.bands.band import Band, BandScore, next_test_quantile, score
from mrwork.uncertainty.bands.cycle import cycle_band, cycles_of, errors_over_cycles
from mrwork.uncertainty.bands.error_table import ErrorShape, ErrorTable
from mrwork.uncertainty.bands.prediction import Prediction
from mrwork.values import holds_arrays

LEVELS = (0.5, 0.9, 0.95)

BEYOND_TESTED = "the level holds only where the calibration had such tests"
"""Remark on a band outside the tested range of the fit."""


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Calibration(Summarised, Related):
    """Calibration of prediction bands from the errors on several tests.

    `scores` are the errors of each test in its scale; `tests` are their names; `held_out` describes how the tests were
    kept from the fit. Tests that are alike, such as the raw and the smoothed version of one record, count as one:
    otherwise each would be predicted by its like. `motions` recognise all tests of the calibration; `seen` are tests
    that were given but not used, because the fit has seen their motion at their command.
    """

    _made_by: ClassVar[str] = "mr.calibrate(predictions, held_out=...)"

    shape: ErrorShape
    scores: tuple[NDArray[np.float64], ...]
    tests: tuple[str, ...]
    held_out: str
    motions: tuple[RecordedMotion, ...] = ()
    seen: tuple[Likeness, ...] = ()

    def disagreement(self) -> str:
        """Whether there are errors of every test."""
        if not self.tests or len(self.scores) != len(self.tests):
            return f"it has the errors of {len(self.scores)} tests for {len(self.tests)}"
        empty = [name for name, scores in zip(self.tests, self.scores, strict=True) if not scores.size]
        return f"it has no errors of {empty[0]}" if empty else ""

    @checked
    def knows(self, test: DamperTest) -> Likeness | None:
        """The test of the calibration that a test is, or whose motion and command it has; `None` where it is new."""
        return likest(RecordedMotion.of(test), self.motions)

    @checked
    def band(self, prediction: Prediction, level: Level) -> Band:
        """Prediction band of the force, shape (n_counted,); its basis names what lies outside the tested ranges.

        Raises
        ------
        SettingError
            Where the level is not between 0 and 1.
        """
        centre, scale = self.shape.of(prediction)
        half = next_test_quantile(self.scores, level) * scale
        outside = ", ".join(prediction.outside.names)
        beyond = f"; outside the tested range of the fit in {outside}: {BEYOND_TESTED}" if outside else ""
        return Band.about(centre, half, level=level, basis=self.basis + beyond)

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
                (test, *(rounded(float(np.quantile(np.abs(scores), share)), 3) for share in (0.5, 0.9)))
                for test, scores in zip(self.tests, self.scores, strict=True)
            ],
        )


@checked
def calibrate(predictions: Sequence[Prediction], *, held_out: str) -> Calibration:
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

    Raises
    ------
    SettingError
        Where no test is given, or the fit has seen all.
    """
    if not predictions:
        raise SettingError(
            "a band is calibrated on tests that the fit has not seen, none was given; name at least one"
        )
    groups, motions, seen = _held_out(predictions)
    if not groups:
        raise SettingError(
            f"a band is calibrated on tests that the fit has not seen, but {likenesses_in_words(seen)}; "
            "give tests at other motions or commands"
        )
    table = ErrorTable.of(groups)
    shape, scores = table.calibrated(table.best_variant())
    return Calibration(
        shape=shape,
        scores=tuple(scores),
        tests=tuple(" with ".join(each.test.label for each in members) for members in groups),
        held_out=held_out,
        motions=motions,
        seen=seen,
    )


def _held_out(
    predictions: Sequence[Prediction],
) -> tuple[list[list[Prediction]], tuple[RecordedMotion, ...], tuple[Likeness, ...]]:
    """Predictions of tests that the fit has not seen, in groups of alike tests; their motions; and the others."""
    unseen = [each for each in predictions if each.seen is None]
    motions = tuple(RecordedMotion.of(each.test) for each in unseen)
    groups = [[unseen[index] for index in members] for members in alike_groups(motions)]
    return groups, motions, tuple(each.seen for each in predictions if each.seen is not None)


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOutCoverage:
    """Score of the force's band on one test left out, per deviation of the measured force, at one level.

    `cycles_inside` is the share of cycles whose dissipated energy lies in the energy band; NaN without whole cycles.
    """

    test: str
    level: Level
    samples: BandScore
    cycles_inside: OrNan


@checked
def measured_coverage(
    predictions: Sequence[Prediction], levels: Sequence[Level] = LEVELS
) -> tuple[LeftOutCoverage, ...]:
    """Coverage of each test by bands calibrated on the others, at each level; alike tests are left out together.

    Raises
    ------
    SettingError
        Where there are fewer than two tests that are not alike.
    """
    groups, _, _ = _held_out(predictions)
    if len(groups) < 2:
        count = f"{len(predictions)} was given in all"
        if len(predictions) > 1:
            count = f"of {len(predictions)} given, those that the fit has not seen count as {len(groups)}"
        raise SettingError(
            f"coverage is measured on tests that the calibration does not know, {count}; give at least two"
        )
    energy = [[_energy_errors(each) for each in members] for members in groups]
    table = ErrorTable.of(groups)
    rows = []
    for index, (members, variant) in enumerate(zip(groups, table.best_variants_without_each(), strict=True)):
        shape, scores = table.calibrated(variant, (index,))
        others = [_joined(own) for number, own in enumerate(energy) if number != index]
        others = [each for each in others if each.size]
        multiples = [next_test_quantile(scores, level) for level in levels]
        for prediction, own in zip(members, energy[index], strict=True):
            centre, scale = shape.of(prediction)
            deviation = float(np.std(prediction.measured))
            for level, multiple in zip(levels, multiples, strict=True):
                inside = float("nan")
                if own.size and others:
                    band = cycle_band(prediction, "energy", others, level)
                    inside = score(band, cycles_of(prediction.test, prediction.test.force).energy).coverage
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


def _joined(errors: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    return np.concatenate(errors) if errors else np.empty(0)


def _energy_errors(prediction: Prediction) -> NDArray[np.float64]:
    try:
        return errors_over_cycles(prediction, "energy")
    except RecordError:
        return np.empty(0)
