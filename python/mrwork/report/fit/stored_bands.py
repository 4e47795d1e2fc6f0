"""What `mrwork calibrate` left in a run directory: the calibration, what it covered, the predictions it rests on."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from mrwork.report.calibration_json import read_calibration
from mrwork.report.fit.predictions import read_predictions
from mrwork.report.fit_json import record_from_json
from mrwork.report.run_directory import CALIBRATION
from mrwork.uncertainty.bands.conformal import Calibration
from mrwork.uncertainty.bands.coverage import LeftOutCoverage
from mrwork.uncertainty.bands.prediction import Prediction


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StoredBands:
    """A calibration, the coverage of each of its tests by the others, and the tests as they were predicted."""

    calibration: Calibration
    coverage: tuple[LeftOutCoverage, ...]
    predictions: tuple[Prediction, ...]

    def row(self, prediction: Prediction, level: float) -> LeftOutCoverage | None:
        """What was measured of one test at one level."""
        name = prediction.test.path or prediction.test.name
        return next((each for each in self.coverage if each.test == name and each.level == level), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Covered:
    coverage: tuple[LeftOutCoverage, ...]


def read_bands(place: Path) -> StoredBands | None:
    """The bands of a run directory, `None` where there are none.

    Raises
    ------
    RecordError
        Where they are damaged.
    """
    path = place / CALIBRATION
    if not path.is_file():
        return None
    text = path.read_text(encoding="utf-8")
    covered = record_from_json(_Covered, text, origin=str(path), name="calibration", verb="calibrate")
    return StoredBands(
        calibration=read_calibration(place),
        coverage=covered.coverage,
        predictions=read_predictions(place),
    )
