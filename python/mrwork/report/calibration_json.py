"""The calibration of a run's bands, kept beside its fit."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from mrwork.errors import RecordError
from mrwork.report.additions import add_to_run
from mrwork.report.run_directory import CALIBRATION
from mrwork.uncertainty.bands.conformal import Calibration, Shape
from mrwork.uncertainty.bands.coverage import LeftOutCoverage

# Of a score: what the errors of the next test are compared with is not known better.
_DIGITS = 5


def write_calibration(place: Path, calibration: Calibration, coverage: Sequence[LeftOutCoverage]) -> None:
    """Write `calibration.json` into the run directory `place`.

    Raises
    ------
    OutputError
        Where it cannot be written.
    """
    document = asdict(calibration) | {
        "scores": [[float(f"{value:.{_DIGITS}g}") for value in scores] for scores in calibration.scores],
        "coverage": [asdict(row) for row in coverage],
    }
    add_to_run(place, CALIBRATION, document, {})


def read_calibration(place: Path) -> Calibration:
    """The calibration of a run directory.

    Raises
    ------
    RecordError
        Where there is none, or it is damaged.
    """
    path = place / CALIBRATION
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        return Calibration(
            shape=Shape(**(document["shape"] | {"bias": tuple(document["shape"]["bias"])})),
            scores=tuple(np.array(scores, dtype=np.float64) for scores in document["scores"]),
            tests=tuple(document["tests"]),
            held_out=document["held_out"],
        )
    except FileNotFoundError:
        raise RecordError(
            f"{place} has no calibrated bands; run `mrwork calibrate {place}` with tests the fit has not seen"
        ) from None
    except (OSError, ValueError, KeyError, TypeError) as reason:
        raise RecordError(
            f"{path} is not a calibration ({reason}); run `mrwork calibrate {place}` again"
        ) from None
