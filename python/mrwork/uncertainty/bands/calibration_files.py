"""The files of calibrated bands: the calibration, the predictions that it rests on, and the fits of the folds."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import Positive, Whole
from mrwork.base.summary import Summarised, Summary
from mrwork.base.units import CommandUnit
from mrwork.base.values import freeze_samples
from mrwork.errors import RecordError
from mrwork.identification.fit import Fit
from mrwork.records import DamperTest, Observation
from mrwork.records.likeness import RecordedMotion, alike_groups
from mrwork.store.codec import built, digest_of, json_document
from mrwork.store.run_folder import CALIBRATION, FOLDS, PREDICTIONS, RunFolder
from mrwork.store.run_writer import add_to_run
from mrwork.uncertainty.bands.conformal import Calibration, LeftOutCoverage
from mrwork.uncertainty.bands.prediction import Prediction

_VERB = "calibrate"
# Significant digits of a stored score; the errors that it is compared with are not known more precisely.
_DIGITS = 5
_CHANNELS = ("displacement", "velocity", "force")
# A constant command is a fact, one that varies a channel.
_COMMANDS = ("current", "voltage", "command")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class StoredBands(Summarised):
    """A calibration, the coverage of each of its tests by the others, and the tests as they were predicted."""

    calibration: Calibration
    coverage: tuple[LeftOutCoverage, ...]
    predictions: tuple[Prediction, ...]

    def _summary(self) -> Summary:
        calibration = self.calibration._summary()
        return replace(
            calibration, facts=(*calibration.facts, ("tests with predictions", str(len(self.predictions))))
        )

    def others(self, prediction: Prediction) -> list[Prediction]:
        """The predictions of the tests that are not alike to one of them."""
        groups = alike_groups([RecordedMotion.of(each.test) for each in self.predictions])
        number = [each is prediction for each in self.predictions].index(True)
        alike = next(members for members in groups if number in members)
        return [each for index, each in enumerate(self.predictions) if index not in alike]

    def row(self, prediction: Prediction, level: float) -> LeftOutCoverage | None:
        """Coverage of one test at one level."""
        name = prediction.test.label
        return next((each for each in self.coverage if each.test == name and each.level == level), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Coverage:
    coverage: tuple[LeftOutCoverage, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Facts:
    """Entry of a test in the file of predictions; its channels are separate arrays."""

    name: str
    path: str
    sha256: str
    dt: Positive
    start_time: float
    n_settle: Whole
    velocity_source: Literal["measured", "derived"]
    amplitude: float | None
    frequency: float | None
    synthetic: bool
    current: float | None
    voltage: float | None
    observation: Observation
    uncompared: tuple[tuple[Whole, Whole], ...] = ()
    command: float | None = None
    command_unit: CommandUnit | None = None


_FACTS = tuple(each.name for each in fields(_Facts) if each.name not in (*_COMMANDS, "observation"))


def read_bands(run: RunFolder) -> StoredBands | None:
    """The bands of the run folder of a fit, `None` where there are none."""
    calibration, covered = stored_calibration(run), run.read(_Coverage, CALIBRATION, verb=_VERB)
    if calibration is None or covered is None:
        return None
    return StoredBands(calibration=calibration, coverage=covered.coverage, predictions=read_predictions(run))


def write_bands(
    place: Path,
    calibration: Calibration,
    coverage: Sequence[LeftOutCoverage],
    predictions: Sequence[Prediction],
) -> None:
    """Write `calibration.json` and `predictions.npz` into the run folder of a fit at `place`."""
    document = asdict(calibration) | {
        "scores": [[float(f"{value:.{_DIGITS}g}") for value in scores] for scores in calibration.scores],
        "coverage": [asdict(row) for row in coverage],
    }
    contents = {
        CALIBRATION: json_document(document).encode(),
        PREDICTIONS: predictions_content(predictions),
    }
    add_to_run(place, contents)


def stored_calibration(run: RunFolder) -> Calibration | None:
    """The calibration of the run folder of a fit, if it has one."""
    return run.read(Calibration, CALIBRATION, verb=_VERB)


def read_calibration(run: RunFolder) -> Calibration:
    """The calibration of the run folder of a fit."""
    calibration = stored_calibration(run)
    if calibration is None:
        raise RecordError(
            f"{run.path} has no calibrated bands; run `mrwork calibrate {run.path}` with tests the fit has not seen"
        )
    return calibration


def predictions_content(predictions: Sequence[Prediction]) -> bytes:
    """The file `predictions.npz` of a run folder, in single precision, which is enough for figures."""
    facts = [
        {fact: getattr(each.test, fact) for fact in _FACTS}
        | {name: None if name in _channels(each.test) else getattr(each.test, name) for name in _COMMANDS}
        | {"observation": asdict(each.test.observation)}
        for each in predictions
    ]
    arrays = {
        f"{channel}_{number}": getattr(each.test, channel).astype(np.float32)
        for number, each in enumerate(predictions)
        for channel in _channels(each.test)
    } | {f"model_{number}": each.model_force.astype(np.float32) for number, each in enumerate(predictions)}
    content = io.BytesIO()
    np.savez_compressed(content, facts=np.array(json.dumps(facts)), **arrays)
    return content.getvalue()


def _channels(test: DamperTest) -> tuple[str, ...]:
    varying = (name for name in _COMMANDS if isinstance(getattr(test, name), np.ndarray))
    return (*_CHANNELS, *varying)


def read_predictions(run: RunFolder, name: str = PREDICTIONS, *, verb: str = _VERB) -> tuple[Prediction, ...]:
    """The predictions in a file of a run folder, which this verb has written; none without the file."""
    arrays = run.arrays(name, verb=verb)
    if arrays is None:
        return ()
    with run.explained(name):
        stated = built(tuple[_Facts, ...], json.loads(str(arrays["facts"])))
        return tuple(_prediction(facts, number, arrays) for number, facts in enumerate(stated))


def _prediction(facts: _Facts, number: int, arrays: Mapping[str, NDArray[Any]]) -> Prediction:
    channels = {
        channel: freeze_samples(arrays[f"{channel}_{number}"].astype(np.float64))
        for channel in (*_CHANNELS, *_COMMANDS, "model")
        if channel not in _COMMANDS or f"{channel}_{number}" in arrays
    }
    model_force = channels.pop("model")
    stated = {each.name: getattr(facts, each.name) for each in fields(facts)}
    return Prediction(test=DamperTest(**stated | channels), model_force=model_force)


def name_of_fold(fit: Fit, tests: tuple[DamperTest, ...]) -> str:
    """Name in a run folder of the fit of cross-validation to these tests."""
    seen = [
        digest_of(
            *(test.dt, test.displacement, test.velocity, test.force),
            *(command for command, _ in test.commands if isinstance(command, np.ndarray)),
        )
        for test in tests
    ]
    return f"{FOLDS}/{digest_of(fit.model, fit.theta, seen)[:16]}.json"


def stored_fold(run: RunFolder, name: str) -> Fit | None:
    """The fit of that name in a run folder, from which a calibration resumes; `None` where it is not there."""
    return run.read(Fit, name, verb=_VERB)
