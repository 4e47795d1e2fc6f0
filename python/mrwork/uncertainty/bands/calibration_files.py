"""The files of calibrated bands: the calibration, the predictions that it rests on, and the fits of the folds."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork.base.numbers import format_fixed, percent
from mrwork.base.progress import OnProgress, Progress
from mrwork.base.summary import Summarised, Summary, named
from mrwork.base.table import Table
from mrwork.base.values import Floats, freeze_samples
from mrwork.errors import MrworkError, RecordError
from mrwork.identification.commands import are_determined
from mrwork.identification.fit import Fit
from mrwork.identification.fit_file import OpenedRun, fit_content
from mrwork.identification.settings import Fold
from mrwork.records import DamperTest
from mrwork.records.likeness import RecordedMotion, alike_groups
from mrwork.store.codec import built, digest_of, json_document, plain
from mrwork.store.long_call import LongCall
from mrwork.store.run_folder import CALIBRATION, FOLDS, PREDICTIONS, RunFolder
from mrwork.store.run_writer import add_to_run
from mrwork.uncertainty.bands.conformal import (
    LEVEL,
    LEVELS,
    Calibration,
    LeftOutCoverage,
    calibrate,
    measured_coverage,
)
from mrwork.uncertainty.bands.prediction import (
    Prediction,
    extremes_of,
    folds_of,
    predict_beyond,
    predict_left_out,
    rests_of,
)


def _thousandths(value: float) -> str:
    return format_fixed(value, 3)


_VERB = "calibrate"
# Fields of the scores that are errors.
_ERRORS = ("about_mean", "about_force")
# Significant digits of a stored score; the errors that it is compared with are not known more precisely.
_DIGITS = 5


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class StoredBands(Summarised):
    """A calibration with the coverage of each of its tests by the others, and the tests as they were predicted."""

    calibration: Calibration
    predictions: tuple[Prediction, ...]

    @classmethod
    def of(
        cls, predictions: Sequence[Prediction], *, held_out: str, beyond: Sequence[Prediction] = ()
    ) -> StoredBands:
        """Calibrate on predictions of held-out tests, and measure the coverage of each by the others."""
        calibration = calibrate(predictions, held_out=held_out, beyond=beyond)
        coverage = measured_coverage(predictions) if len(calibration.tests) > 1 else ()
        return cls(
            calibration=replace(calibration, coverage=coverage),
            predictions=tuple(prediction for prediction in predictions if prediction.seen is None),
        )

    def document(self) -> dict[str, Any]:
        """What `mrwork calibrate --json` prints: `coverage_percent` is the mean at `level`, none of a single test."""
        calibration = self.calibration
        shares = [entry.samples.coverage for entry in calibration.coverage if entry.level == LEVEL]
        return {
            "level": LEVEL,
            "coverage_percent": 100.0 * float(np.mean(shares)) if shares else None,
            "tests": calibration.tests,
            "held_out": calibration.held_out,
            "seen": [asdict(likeness) for likeness in calibration.seen],
            "shape": asdict(calibration.shape),
            "reach": [named(test_reach, "quantity", "below", "severity") for test_reach in calibration.reach],
            "coverage": [asdict(entry) for entry in calibration.coverage],
        }

    def _summary(self) -> Summary:
        calibration = self.calibration._summary()
        return replace(
            calibration,
            facts=(*calibration.facts, ("tests with predictions", str(len(self.predictions)))),
            tables=[self._coverage_table] if self.calibration.coverage else [],
        )

    @property
    def by_test(self) -> dict[str, dict[float, LeftOutCoverage]]:
        """The coverage of each test at every level."""
        by_test: dict[str, dict[float, LeftOutCoverage]] = {}
        for entry in self.calibration.coverage:
            by_test.setdefault(entry.test, {})[entry.level] = entry
        return by_test

    @property
    def _coverage_table(self) -> Table:
        """The share of samples of each test in the bands of the others, its score, and their means."""
        of_tests = self.by_test.values()
        names = {prediction.test.label: prediction.test.name for prediction in self.predictions}
        columns: list[tuple[list[float], Callable[[float], str]]] = [
            *(([of_test[level].samples.coverage for of_test in of_tests], percent) for level in LEVELS),
            ([of_test[LEVEL].cycles_inside for of_test in of_tests], percent),
            ([of_test[LEVEL].samples.width for of_test in of_tests], _thousandths),
            ([of_test[LEVEL].samples.interval_score for of_test in of_tests], _thousandths),
        ]
        return Table(
            title="Coverage of tests left out",
            columns=(
                "test",
                *(f"in {100 * level:.0f} % [%]" for level in LEVELS),
                *("cycles in 90 % [%]", "width of 90 %", "score of 90 %"),
            ),
            rows=[
                (names.get(label, label), *(shown(values[number]) for values, shown in columns))
                for number, label in enumerate(self.by_test)
            ],
            foot=("mean", *(shown(float(np.mean(values))) for values, shown in columns)),
            note="The band of each test is calibrated on the others only. A cycle is inside where its dissipated "
            "energy lies in the 90 % band of the energy; the cycles of one test are alike, so nearly all or nearly "
            "none are. Width and interval score are in standard deviations of the test's force. The score is the mean "
            "width plus twenty times the mean distance of samples outside; lower is better.",
        )

    def others(self, prediction: Prediction) -> list[Prediction]:
        """The predictions of the tests that are not alike to one of them."""
        groups = alike_groups([RecordedMotion.of(prediction.test) for prediction in self.predictions])
        number = [other is prediction for other in self.predictions].index(True)
        alike = next(members for members in groups if number in members)
        return [prediction for index, prediction in enumerate(self.predictions) if index not in alike]


def read_bands(run: RunFolder) -> StoredBands | None:
    """The bands of the run folder of a fit, `None` where there are none."""
    calibration = stored_calibration(run)
    if calibration is None:
        return None
    return StoredBands(calibration=calibration, predictions=read_predictions(run))


def write_bands(path: Path, bands: StoredBands) -> None:
    """Write `calibration.json` and `predictions.npz` into the run folder of a fit at `place`."""
    calibration = bands.calibration
    document = asdict(calibration) | {
        "scores": asdict(calibration.scores)
        | {name: _rounded(scores) for name, scores in named(calibration.scores, *_ERRORS).items()},
        "reach": [
            asdict(test_reach) | {"scores": _rounded(test_reach.scores)} for test_reach in calibration.reach
        ],
    }
    contents = {
        CALIBRATION: json_document(document).encode(),
        PREDICTIONS: predictions_content(bands.predictions),
    }
    add_to_run(path, contents)


def _rounded(scores: Sequence[Floats]) -> list[list[float]]:
    return [[float(f"{score:.{_DIGITS}g}") for score in of_test] for of_test in scores]


def stored_calibration(run: RunFolder) -> Calibration | None:
    """The calibration of the run folder of a fit, if it has one."""
    return run.read(Calibration, CALIBRATION, verb=_VERB)


def read_calibration(run: RunFolder) -> Calibration:
    """The calibration of the run folder of a fit; refused where `mrwork calibrate` has not written one."""
    calibration = stored_calibration(run)
    if calibration is None:
        raise RecordError(
            f"{run.path} has no calibrated bands; run `mrwork calibrate {run.path}`, which leaves out each test in "
            "turn, or give it tests that the fit has not seen"
        )
    return calibration


# What checks found, and the record before repairs, is not kept.
_DROPPED = {"remarks": (), "original": None}


def predictions_content(predictions: Sequence[Prediction]) -> bytes:
    """The file `predictions.npz` of a run folder: facts of each test, and its arrays in single precision."""
    facts, arrays = [], dict[str, Any]()
    for number, prediction in enumerate(predictions):
        values = {
            field.name: getattr(prediction.test, field.name) for field in fields(prediction.test)
        } | _DROPPED
        values |= {"model": prediction.model_force, "substeps": prediction.substeps}
        channels = {name for name, value in values.items() if isinstance(value, np.ndarray)}
        arrays |= {f"{name}_{number}": values[name].astype(np.float32) for name in channels}
        facts.append({name: value for name, value in values.items() if name not in channels})
    content = io.BytesIO()
    np.savez_compressed(content, facts=np.array(json.dumps(plain(facts))), **arrays)
    return content.getvalue()


def read_predictions(run: RunFolder, name: str = PREDICTIONS, *, verb: str = _VERB) -> tuple[Prediction, ...]:
    """The predictions in a file of a run folder, which this verb has written; none without the file."""
    content = run.content(name, verb=verb)
    if content is None:
        return ()
    with run.explained(name, verb=verb), np.load(io.BytesIO(content), allow_pickle=False) as stored:
        arrays = dict(stored)
        stated = json.loads(str(arrays["facts"]))
        return tuple(_prediction(facts, number, arrays) for number, facts in enumerate(stated))


def _prediction(facts: dict[str, Any], number: int, arrays: Mapping[str, NDArray[Any]]) -> Prediction:
    names = (*(field.name for field in fields(DamperTest)), "model")
    channels = {name: arrays[key].tolist() for name in names if (key := f"{name}_{number}") in arrays}
    return Prediction(
        test=built(DamperTest, facts | channels),
        model_force=freeze_samples(np.array(channels["model"])),
        substeps=facts["substeps"],
    )


def cross_validated(
    opened: OpenedRun, leave_out: Fold = "test", *, threads: int, on_progress: OnProgress
) -> tuple[tuple[Prediction, ...], tuple[Prediction, ...]]:
    """Predictions of the tests of a run, each by a fit to the others, which is kept in the run for another call.

    Extreme tests are also predicted, beyond the others, see `predict_beyond`.

    Parameters
    ----------
    leave_out
        Without files: tests that are left out together: each test alone, all of one motion, or all at one command.

    Raises
    ------
    SettingError
        Where a test cannot be simulated by the fit to the others, or none is predicted.
    """
    # What identifies is slow to load, and reading a run does not need it.
    from mrwork.identification.batch import FitBatch, FitTask

    folds = folds_of(opened.tests, leave_out)
    rests = rests_of(opened.tests, [*folds, *extremes_of(opened.tests)])
    names = [_name_of_fold(opened.fit, rest) for rest in rests]
    stored = {name: opened.run.read(Fit, name, verb=_VERB) for name in names}
    fits = {name: fit for name, fit in stored.items() if fit is not None}
    missing = [
        number
        for number, name in enumerate(names)
        if name not in (*fits, *names[:number]) and are_determined(opened.fit.spec, rests[number])
    ]
    settings, call = opened.fit.settings.again, LongCall[None](on_progress=on_progress)
    if effects := opened.fit.effect_values:
        # What all tests have told of them the others are to tell.
        settings = settings.with_effects(dict.fromkeys(effects))

    def report(number: int, within: Progress | None) -> None:
        fold = f"{leave_out} {missing[number] + 1} of {len(rests)}"
        said = () if within is None else within.said
        call.report(Progress(stage="folds", said=(fold, *said), share=number / len(missing)))

    batch = FitBatch(
        tasks=[FitTask(spec=opened.fit.spec, tests=rests[number], settings=settings) for number in missing],
        threads=threads,
        on_progress=report,
        on_fit=lambda number, fit: add_to_run(opened.run.path, {names[missing[number]]: fit_content(fit)}),
    )
    for task_number, number in enumerate(missing):
        # The others may not determine what the extreme tests do.
        with nullcontext() if number < len(folds) else suppress(MrworkError):
            fits[names[number]] = batch.fit(task_number)

    def fit_to(rest: tuple[DamperTest, ...]) -> Fit | None:
        return fits.get(_name_of_fold(opened.fit, rest))

    return predict_left_out(opened.tests, leave_out, fit_to), predict_beyond(opened.tests, fit_to)


# Number of the way in which folds are fitted: fits of another way are made again.
_FOLDS_OF = 2


def _name_of_fold(fit: Fit, tests: tuple[DamperTest, ...]) -> str:
    seen = [
        digest_of(
            *(test.dt, test.displacement, test.velocity, test.force),
            *(command for command, _ in test.commands if isinstance(command, np.ndarray)),
        )
        for test in tests
    ]
    return f"{FOLDS}/{digest_of(_FOLDS_OF, fit.model, fit.theta, seen)[:16]}.json"
