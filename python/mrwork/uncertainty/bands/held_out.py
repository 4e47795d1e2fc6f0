"""Tests kept for test: how well a fit predicts them, in the run folder of the fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from mrwork.base.summary import Summarised, Summary
from mrwork.identification.fit import Fit
from mrwork.identification.fit_file import addition_content, read_addition
from mrwork.identification.result import FitSpread
from mrwork.store.codec import OrInfinite, Related, finite
from mrwork.store.output_file import write_files
from mrwork.store.run_folder import HELD_OUT, HELD_OUT_FORCES
from mrwork.uncertainty.bands.calibration_files import predictions_content, read_predictions
from mrwork.uncertainty.bands.prediction import Prediction


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
