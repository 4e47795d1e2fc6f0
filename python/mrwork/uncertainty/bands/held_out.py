"""Tests kept for test: how well a fit predicts them, in the run folder of the fit."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mrwork.identification.fit import Fit
from mrwork.records import DamperTest
from mrwork.records.rig_table import Use
from mrwork.store.codec import json_document
from mrwork.store.run_folder import HELD_OUT, HELD_OUT_FORCES, RunFolder
from mrwork.store.run_writer import add_to_run, adding
from mrwork.uncertainty.bands.calibration_files import (
    predictions_content,
    read_predictions,
    stored_calibration,
)
from mrwork.uncertainty.bands.conformal import LEVEL, Calibration
from mrwork.uncertainty.bands.prediction import Prediction, fold_groups, with_others
from mrwork.uncertainty.bands.predictions import Predictions


def median_place(count: int) -> int:
    """Place of the test that stands for the median of so many, the worst first; of two it is the other."""
    return min(max(1, (count - 1) // 2), count - 1)


def _is_same(one: DamperTest, other: DamperTest) -> bool:
    """Whether two tests are of one record, whatever its name, its format and what was cut or repaired."""
    if one.sha256 and one.sha256 == other.sha256:
        return True
    pairs = ((one.displacement, other.displacement), (one.force, other.force))
    return one.n_time == other.n_time and all(
        np.allclose(array, another, rtol=0.0, atol=_ROUNDED_BY_FORMATS * float(np.std(array)))
        for array, another in pairs
    )


# Share of the deviation of a channel within which formats round it: another run differs by its noise.
_ROUNDED_BY_FORMATS = 1e-3


def write_held_out(run: RunFolder, fit: Fit, predictions: Sequence[Prediction]) -> None:
    """Write predicted tests into the run folder of a fit, beside those that it has; of the same the last counts."""
    merged: list[Prediction] = []
    for prediction in (*read_predictions(run, HELD_OUT_FORCES, verb=_VERB), *predictions):
        merged = [*(other for other in merged if not _is_same(other.test, prediction.test)), prediction]
    contents = {
        HELD_OUT: json_document(_held_out(fit, merged, None).document()).encode(),
        HELD_OUT_FORCES: predictions_content(merged),
    }
    add_to_run(run.path, contents)


def _held_out(fit: Fit, predictions: Sequence[Prediction], calibration: Calibration | None) -> Predictions:
    """Predictions of held-out tests that were read from a file, which has nothing of the fit."""
    observing = fit.settings.observing
    judged = [
        with_others(replace(each, outside=fit.outside(each.test, each.model_force)), fit, observing)
        for each in predictions
    ]
    return Predictions.about(fit, judged, observe=observing, calibration=calibration, level=LEVEL)


def keep_held_out(path: Path, predictions: Predictions) -> bool:
    """Write the predictions of held-out tests into a run folder that can be written; whether there were any."""
    if not predictions.held_out or not os.access(path, os.W_OK):
        return False
    with adding(path, HELD_OUT):
        write_held_out(RunFolder.open(path), predictions.fit, predictions.held_out)
    return True


def read_held_out(run: RunFolder, fit: Fit) -> Predictions | None:
    """The predictions in the run folder of a fit of tests that its calibration has not seen; `None` without any."""
    calibration = stored_calibration(run)
    unseen = [
        prediction
        for prediction in read_predictions(run, HELD_OUT_FORCES, verb=_VERB)
        if calibration is None or not calibration.knows(prediction.test)
    ]
    return _held_out(fit, unseen, calibration) if unseen else None


_VERB = "predict"


def uses_of(tests: Sequence[DamperTest]) -> tuple[Use, ...]:
    """What each test is best used for: whole motions at all their commands are kept for test and for calibration.

    The extremes of stroke, speed and frequency are fitted, so that the others lie between them; of the others one in
    three is kept for test and one in three for calibration, of a single one for test. Tests that are alike share
    their use. With fewer than two motions, or with extremes only, every test is fitted. Of the tests whose command
    varies the fastest motion is fitted: they alone show the lag of the driver.
    """
    folds = fold_groups(tests, "motion")
    speeds = [float(np.abs(test.velocity).max()) for test in tests]
    strokes = [float(np.ptp(test.displacement)) for test in tests]
    speed, stroke = (
        np.array([max(peaks[index] for index in fold) for fold in folds]) for peaks in (speeds, strokes)
    )
    extremes: set[int] = set()
    for values in (-stroke, stroke, speed, -speed, speed / stroke, -speed / stroke):
        most = int(np.argmax(values))
        if not any(values[extreme] >= values[most] - _ALIKE * abs(values[most]) for extreme in extremes):
            extremes.add(most)
    varying = [
        number for number, fold in enumerate(folds) if any(tests[index].has_varying_command for index in fold)
    ]
    if varying and not extremes & {*varying}:
        extremes.add(max(varying, key=lambda number: float(speed[number])))
    between = sorted(set(range(len(folds))) - extremes, key=lambda fold: float(speed[fold]))
    # Of one or two motions the first is for test.
    offset = 1 if len(between) < _THIRDS else 0
    fold_uses: dict[int, Use] = {
        number: use
        for turn, number in enumerate(between, start=offset)
        if (use := _IN_TURN[turn % _THIRDS]) is not None
    }
    uses: dict[int, Use] = {
        index: fold_uses.get(number, "fit") for number, fold in enumerate(folds) for index in fold
    }
    return tuple(uses[index] for index in range(len(tests)))


# Share within which a motion that is fitted already has the extreme.
_ALIKE = 0.1
_IN_TURN: tuple[Use | None, ...] = (None, "test", "calibration")
_THIRDS = len(_IN_TURN)
