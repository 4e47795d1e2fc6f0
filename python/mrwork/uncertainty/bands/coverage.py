"""How much of the tests left out lay inside their bands: measured, each test banded by the others alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError, SettingError
from mrwork.uncertainty.bands.band import BandScore, score
from mrwork.uncertainty.bands.conformal import calibrate
from mrwork.uncertainty.bands.cycle import cycle_band, cycles_of, errors_over_cycles
from mrwork.uncertainty.bands.prediction import Prediction

LEVELS = (0.5, 0.9, 0.95)


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOutCoverage:
    """One test left out, at one level: how the force's band did, per deviation of the measured force, and its cycles.

    `cycles_inside` is the share of its cycles whose dissipated energy lies inside its own band; NaN where there is no
    whole cycle.
    """

    test: str
    level: float
    samples: BandScore
    cycles_inside: float


def measured_coverage(
    predictions: Sequence[Prediction], levels: Sequence[float] = LEVELS
) -> tuple[LeftOutCoverage, ...]:
    """Coverage of each test by bands calibrated on the others, level by level.

    Raises
    ------
    SettingError
        Where there are fewer than two tests.
    """
    if len(predictions) < 2:
        raise SettingError(
            f"coverage is measured on tests that the calibration does not know, {len(predictions)} was given in all; "
            "give at least two"
        )
    energy = [_energy_errors(prediction) for prediction in predictions]
    rows = []
    for index, prediction in enumerate(predictions):
        others = [*predictions[:index], *predictions[index + 1 :]]
        scores = [each for each in (*energy[:index], *energy[index + 1 :]) if each.size]
        calibration = calibrate(others, held_out="")
        deviation = float(np.std(prediction.measured))
        for level in levels:
            inside = float("nan")
            if energy[index].size and scores:
                band = cycle_band(prediction, "energy", scores, level)
                inside = score(band, cycles_of(prediction.test, prediction.test.force).energy).coverage
            rows.append(
                LeftOutCoverage(
                    test=prediction.test.path or prediction.test.name,
                    level=level,
                    samples=score(calibration.band(prediction, level), prediction.measured, per=deviation),
                    cycles_inside=inside,
                )
            )
    return tuple(rows)


def _energy_errors(prediction: Prediction) -> NDArray[np.float64]:
    try:
        return errors_over_cycles(prediction, "energy")
    except RecordError:
        return np.empty(0)
