"""Tests kept for test: how well a fit predicts them, in the run folder of the fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from mrwork.base.summary import Summarised, Summary
from mrwork.errors import SettingError
from mrwork.identification.fit import Fit
from mrwork.identification.fit_file import addition_content, read_addition
from mrwork.identification.result import FitSpread
from mrwork.records import DamperTest
from mrwork.records.rig_table import Use
from mrwork.store.codec import OrInfinite, Related, finite
from mrwork.store.output_file import write_files
from mrwork.store.run_folder import HELD_OUT, HELD_OUT_FORCES
from mrwork.uncertainty.bands.calibration_files import predictions_content, read_predictions
from mrwork.uncertainty.bands.prediction import Prediction, folds_of


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOutTest:
    """A predicted test by its name: fit [%], RMSE [N], what of it lies outside the tested ranges.

    `inside` is the share of its samples in the calibrated 90 % band, `None` without one.
    """

    name: str
    fit_percent: float
    rmse_n: OrInfinite
    outside: tuple[str, ...] = ()
    inside: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class HeldOutTests(Summarised, Related):
    """Tests that neither a fit nor its calibration has seen, as the fit predicts them.

    `drawn` are the predictions of the worst and the median test.
    """

    _made_by = "mrwork predict RUN TESTS"

    tests: tuple[HeldOutTest, ...]
    drawn: tuple[Prediction, ...] = ()

    def disagreement(self) -> str:
        """A file without tests."""
        return "" if self.tests else "it has no tests"

    @property
    def spread(self) -> FitSpread:
        """Median and worst."""
        return FitSpread.of([each.name for each in self.tests], [each.fit_percent for each in self.tests])

    def _summary(self) -> Summary:
        return Summary(
            title=f"Held-out {self.spread.in_words}",
            columns=("test", "fit %", "RMSE [N]"),
            rows=[(each.name, f"{each.fit_percent:.2f}", f"{each.rmse_n:.4g}") for each in self.tests],
        )


def median_place(count: int) -> int:
    """Place of the test that stands for the median of so many, the worst first; of two it is the other."""
    return min(max(1, (count - 1) // 2), count - 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Document:
    tests: tuple[HeldOutTest, ...]


def write_held_out(
    place: Path, fit: Fit, tests: Sequence[HeldOutTest], predictions: Sequence[Prediction]
) -> None:
    """Write the tests, one for each of the predictions, into the run folder of a fit."""
    order = sorted(range(len(tests)), key=lambda number: tests[number].fit_percent)
    drawn = dict.fromkeys((order[0], order[median_place(len(order))]))
    contents = {
        HELD_OUT: addition_content(finite(asdict(_Document(tests=tuple(tests)))), fit),
        HELD_OUT_FORCES: predictions_content([predictions[number] for number in drawn]),
    }
    write_files(place, contents)


def read_held_out(place: Path, fit: Fit) -> HeldOutTests | None:
    """The tests of the run folder of a fit at `place`, `None` where none were predicted."""
    document = read_addition(_Document, place / HELD_OUT, fit, name="list of held-out tests", verb="predict")
    if document is None:
        return None
    return HeldOutTests(tests=document.tests, drawn=read_predictions(place, HELD_OUT_FORCES, of="predict"))


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
