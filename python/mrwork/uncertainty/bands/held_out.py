"""Tests kept for test: how well a fit predicts them, in the run folder of the fit."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from mrwork.base.summary import Summarised, Summary
from mrwork.errors import SettingError
from mrwork.identification.fit import Fit, FitSpread
from mrwork.records import DamperTest
from mrwork.records.rig_table import Use
from mrwork.store.codec import json_document
from mrwork.store.run_folder import HELD_OUT, HELD_OUT_FORCES, RunFolder
from mrwork.store.run_writer import add_to_run, adding
from mrwork.uncertainty.bands.band import score
from mrwork.uncertainty.bands.calibration_files import (
    predictions_content,
    read_predictions,
    stored_calibration,
)
from mrwork.uncertainty.bands.conformal import Calibration
from mrwork.uncertainty.bands.prediction import Prediction, folds_of
from mrwork.uncertainty.bands.predictions import Predictions


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOutTest:
    """A predicted test by its name: fit [%], RMSE [N], what of it lies outside the tested ranges.

    `inside` is the share of its samples in the calibrated 90 % band, `None` without one.
    """

    name: str
    fit_percent: float
    rmse_n: float
    outside: tuple[str, ...] = ()
    inside: float | None = None

    @classmethod
    def of(cls, prediction: Prediction, fit: Fit, calibration: Calibration | None = None) -> HeldOutTest:
        """A test as a fit predicts it, with its share in the band of a calibration."""
        band = None if calibration is None else calibration.band(prediction, _LEVEL)
        return cls(
            name=prediction.test.name,
            fit_percent=prediction.fit_percent,
            rmse_n=prediction.rmse_n,
            outside=fit.outside(prediction.test, prediction.model_force).names,
            inside=None if band is None else score(band, prediction.measured).coverage,
        )


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class HeldOutTests(Summarised):
    """Tests that neither a fit nor its calibration has seen, and the prediction of each."""

    _made_by = "mrwork predict RUN TESTS"

    tests: tuple[HeldOutTest, ...]
    predictions: tuple[Prediction, ...]

    @property
    def spread(self) -> FitSpread:
        """Median and worst."""
        return FitSpread.of([each.name for each in self.tests], [each.fit_percent for each in self.tests])

    def _summary(self) -> Summary:
        return Summary(
            title=f"Held-out {self.spread.in_words}",
            columns=("test", "fit %", "RMSE [N]", "in 90 % band [%]", "outside the tested ranges in"),
            rows=[
                (
                    *(each.name, f"{each.fit_percent:.2f}", f"{each.rmse_n:.4g}"),
                    "-" if each.inside is None else f"{100.0 * each.inside:.1f}",
                    ", ".join(each.outside),
                )
                for each in self.tests
            ],
        )


def median_place(count: int) -> int:
    """Place of the test that stands for the median of so many, the worst first; of two it is the other."""
    return min(max(1, (count - 1) // 2), count - 1)


def _is_same(one: DamperTest, other: DamperTest) -> bool:
    """Whether two tests are of one record, whatever its name, its format and what was cut or repaired."""
    if one.sha256 and one.sha256 == other.sha256:
        return True
    pairs = ((one.displacement, other.displacement), (one.force, other.force))
    return one.n_time == other.n_time and all(
        np.allclose(own, another, rtol=0.0, atol=_SAME * float(np.std(own))) for own, another in pairs
    )


# Share of the deviation of a channel within which formats round it: another run differs by its noise.
_SAME = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class _Document:
    tests: tuple[HeldOutTest, ...]


def write_held_out(run: RunFolder, fit: Fit, predictions: Sequence[Prediction]) -> None:
    """Write predicted tests into the run folder of a fit, beside those that it has; of the same the last counts."""
    merged: list[Prediction] = []
    for each in (*read_predictions(run, HELD_OUT_FORCES, verb=_VERB), *predictions):
        merged = [*(other for other in merged if not _is_same(other.test, each.test)), each]
    document = _Document(tests=tuple(HeldOutTest.of(each, fit) for each in merged))
    contents = {
        HELD_OUT: json_document(asdict(document)).encode(),
        HELD_OUT_FORCES: predictions_content(merged),
    }
    add_to_run(run.path, contents)


def keep_held_out(place: Path, predictions: Predictions) -> bool:
    """Write the predictions of held-out tests into a run folder that can be written; whether there were any."""
    if not predictions.held_out or not os.access(place, os.W_OK):
        return False
    with adding(place, HELD_OUT):
        write_held_out(RunFolder.open(place), predictions.fit, predictions.held_out)
    return True


def read_held_out(run: RunFolder, fit: Fit) -> HeldOutTests | None:
    """The tests of the run folder of a fit, without those of its calibration; `None` without any."""
    calibration = stored_calibration(run)
    kept = tuple(
        each
        for each in read_predictions(run, HELD_OUT_FORCES, verb=_VERB)
        if calibration is None or not calibration.knows(each.test)
    )
    tests = tuple(HeldOutTest.of(each, fit, calibration) for each in kept)
    return HeldOutTests(tests=tests, predictions=kept) if kept else None


_VERB = "predict"
# Level of the band whose coverage is told of each test.
_LEVEL = 0.9


def uses_of(tests: Sequence[DamperTest]) -> tuple[Use, ...]:
    """What each test is best used for: whole motions at all their commands are kept for test and for calibration.

    The extremes of stroke, speed and frequency are fitted, so that the others lie between them; of the others one in
    three is kept for test and one in three for calibration, of a single one for test. Tests that are alike share
    their use. With fewer than two motions, or with extremes only, every test is fitted.
    """
    try:
        folds = folds_of(tests, "motion")
    except SettingError:
        return tuple("fit" for _ in tests)
    speeds = [float(np.abs(test.velocity).max()) for test in tests]
    strokes = [float(np.ptp(test.displacement)) for test in tests]
    speed, stroke = (
        np.array([max(own[index] for index in fold) for fold in folds]) for own in (speeds, strokes)
    )
    extremes: set[int] = set()
    for values in (-stroke, stroke, speed, -speed, speed / stroke, -speed / stroke):
        most = int(np.argmax(values))
        if not any(values[each] >= values[most] - _ALIKE * abs(values[most]) for each in extremes):
            extremes.add(most)
    between = sorted(set(range(len(folds))) - extremes, key=lambda fold: float(speed[fold]))
    # Of one or two motions the first is for test.
    offset = 1 if len(between) < _THIRDS else 0
    kept: dict[int, Use] = {
        fold: use
        for place, fold in enumerate(between, start=offset)
        if (use := _IN_TURN[place % _THIRDS]) is not None
    }
    own: dict[int, Use] = {
        index: kept.get(number, "fit") for number, fold in enumerate(folds) for index in fold
    }
    return tuple(own[index] for index in range(len(tests)))


# Share within which an extreme is that of a motion which is fitted already.
_ALIKE = 0.1
_IN_TURN: tuple[Use | None, ...] = (None, "test", "calibration")
_THIRDS = len(_IN_TURN)
