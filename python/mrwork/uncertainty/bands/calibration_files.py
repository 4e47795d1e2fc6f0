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
from mrwork.identification.fit_file import addition_content, fit_from_json, read_addition
from mrwork.records import DamperTest, Observation
from mrwork.records.likeness import RecordedMotion, alike_groups
from mrwork.store.codec import digest_of, parse_document, read_document, record_of
from mrwork.store.input_file import finite_numbers, is_there, make_stored_kind, read_arrays, text_of
from mrwork.store.output_file import write_files
from mrwork.store.run_folder import CALIBRATION, FOLDS, PREDICTIONS
from mrwork.uncertainty.bands.conformal import Calibration, LeftOutCoverage
from mrwork.uncertainty.bands.prediction import Prediction

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


def read_bands(place: Path, fit: Fit) -> StoredBands | None:
    """The bands of the run folder of a fit at `place`, `None` where there are none."""
    covered = read_document(_Coverage, place / CALIBRATION, name="calibration", verb="calibrate")
    if covered is None:
        return None
    calibration, predictions = read_calibration(place, fit), read_predictions(place)
    known = {motion.test for motion in calibration.motions}
    strange = [each.test.label for each in predictions if each.test.label not in known]
    if strange:
        raise RecordError(
            f"{place / PREDICTIONS} has {strange[0]}, which {CALIBRATION} beside it does not have; "
            f"run `mrwork calibrate {place}` again"
        )
    strange = [row.test for row in covered.coverage if row.test not in known]
    if strange:
        raise RecordError(
            f"{place / CALIBRATION} has the coverage of '{strange[0]}', which is none of its tests; "
            f"run `mrwork calibrate {place}` again"
        )
    return StoredBands(calibration=calibration, coverage=covered.coverage, predictions=predictions)


def write_bands(
    place: Path,
    calibration: Calibration,
    coverage: Sequence[LeftOutCoverage],
    predictions: Sequence[Prediction],
    fit: Fit,
) -> None:
    """Write `calibration.json` and `predictions.npz` into the run folder of a fit at `place`."""
    document = asdict(calibration) | {
        "scores": [[float(f"{value:.{_DIGITS}g}") for value in scores] for scores in calibration.scores],
        "coverage": [asdict(row) for row in coverage],
    }
    contents = {CALIBRATION: addition_content(document, fit), PREDICTIONS: predictions_content(predictions)}
    write_files(place, contents)


def stored_calibration(place: Path, fit: Fit) -> Calibration | None:
    """The calibration of the run folder of a fit at `place`, if it has one."""
    return read_addition(Calibration, place / CALIBRATION, fit, name="calibration", verb=f"calibrate {place}")


def read_calibration(place: Path, fit: Fit) -> Calibration:
    """The calibration of the run folder of a fit at `place`."""
    calibration = stored_calibration(place, fit)
    if calibration is None:
        raise RecordError(
            f"{place} has no calibrated bands; run `mrwork calibrate {place}` with tests the fit has not seen"
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


def read_predictions(
    place: Path, name: str = PREDICTIONS, *, of: str = "calibrate"
) -> tuple[Prediction, ...]:
    """The predictions in a file of the run folder at `place`, which this verb has written; none without the file."""
    path = place / name
    kind = make_stored_kind(f"{of} {place}", name="the predictions")
    if not is_there(path, kind):
        return ()
    arrays = read_arrays(path, kind)
    text = str(arrays.get("facts", "null"))
    verb = f"{of} {place}"
    stated = record_of(
        tuple[_Facts, ...],
        parse_document(text, origin=str(path), verb=verb),
        origin=str(path),
        name="list of predictions",
        verb=verb,
    )
    try:
        return tuple(_prediction(facts, number, arrays) for number, facts in enumerate(stated))
    except (ValueError, TypeError) as reason:
        raise RecordError(f"{path} is damaged ({reason}); {kind.remedy}") from None


def _prediction(facts: _Facts, number: int, arrays: Mapping[str, NDArray[Any]]) -> Prediction:
    channels = {
        channel: freeze_samples(finite_numbers(arrays, f"{channel}_{number}"))
        for channel in (*_CHANNELS, *_COMMANDS, "model")
        if channel not in _COMMANDS or f"{channel}_{number}" in arrays
    }
    model_force = channels.pop("model")
    size = model_force.size
    for name, samples in {**channels, "model": model_force}.items():
        if samples.shape != (size,):
            raise ValueError(f"{name} of {facts.name} is not {size} numbers")
    if not facts.n_settle < size:
        raise ValueError(f"{facts.n_settle} of {size} samples of {facts.name} are not compared")
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


def stored_fold(place: Path, name: str) -> Fit | None:
    """The fit of that name in a run folder, from which a calibration resumes; `None` where it is not there."""
    path, kind = place / name, make_stored_kind("calibrate", name="the fit of a fold")
    return fit_from_json(text_of(path, kind), origin=str(path)) if is_there(path, kind) else None
