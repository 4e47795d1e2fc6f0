"""Predictions of several tests by one fit, with the bands of a calibration: what `mrwork predict` shows and keeps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from operator import attrgetter
from typing import Annotated, Any, ClassVar, overload
from warnings import warn

import numpy as np

from mrwork.base.arguments import Level, checked
from mrwork.base.hints import Within
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary, named
from mrwork.base.table import Column, Table, as_json
from mrwork.dampers.spec import LAW_BEYOND, worst_laws
from mrwork.dampers.tested_range import outside_remark, worst_of
from mrwork.errors import MrworkWarning
from mrwork.identification.fit import Fit, FitQuality, FitSpread
from mrwork.identification.minimise.driver_lag import unfitted_lag
from mrwork.identification.problem import ignored_commands
from mrwork.identification.residual import estimated_in_words, refuse_free, unestimated_effects
from mrwork.records import DamperTest, Likeness
from mrwork.records.likeness import likenesses_in_words
from mrwork.records.observation import Observe, Observing
from mrwork.uncertainty.bands.band import Band, BandScore, score
from mrwork.uncertainty.bands.conformal import Calibration
from mrwork.uncertainty.bands.prediction import Prediction, predict_test, with_others

_TOO_NARROW = RemarkKind(
    "band_too_narrow",
    "the {level:g} % band holds {value:.0f} % of {0}, by chance at least {least:.0f} % ({short} of {tests} tests are "
    "held less than by chance): errors there are larger than in the tests of the calibration",
    "calibrate on tests of such motions, too",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PredictedTest:
    """A prediction and its errors, the tests that it is alike to, and its band with its score.

    `other_condition` is the test of the fit with its motion but another force, `used` the test of the calibration that
    it is alike to. The `band` is `None` farther beyond the tests than the model was tried.
    """

    prediction: Prediction
    quality: FitQuality
    other_condition: Likeness | None
    used: Likeness | None
    band: Band | None
    score: BandScore | None

    @property
    def is_held_out(self) -> bool:
        """Whether neither the fit nor the calibration has seen the test."""
        return self.prediction.seen is None and self.used is None


# What the predictions have in their table and in JSON; the last ones only where bands were asked for.
_COLUMNS = (
    Column("file", "file", of=attrgetter("prediction.test.label")),
    Column("fit_percent", of=attrgetter("quality.fit_percent")),
    Column("", "fit", "%", of=attrgetter("quality.fit_in_words")),
    Column("nrmse", "NRMSE", shown=lambda value: f"{value:.4f}", of=attrgetter("quality.nrmse")),
    Column("rmse_n", "RMSE", "N", shown=lambda value: f"{value:.2f}", of=attrgetter("quality.rmse_n")),
    Column("error_norms", of=attrgetter("quality.error_norms")),
    Column("n_time", "samples", of=attrgetter("quality.n_time")),
    Column("settle_seconds", of=attrgetter("quality.settle_seconds")),
    Column("substeps", "sub-steps", of=attrgetter("quality.substeps")),
    Column("seen", of=attrgetter("prediction.seen")),
    Column("other_condition"),
    Column("estimated", of=attrgetter("quality.estimated")),
    Column("outside_tested_range", of=lambda row: list(row.prediction.outside.names)),
    Column("remarks", of=lambda row: list(map(asdict, row.prediction.outside.remarks))),
    Column(
        "sets_apart_percent", of=lambda row: row.prediction.sets_apart and row.prediction.sets_apart.percent
    ),
)
_OF_BANDS = (
    Column("", "+-", "N", of=lambda row: "none" if row.band is None else row.band.half_width_in_words),
    Column(
        "coverage_percent",
        "inside",
        "%",
        shown=lambda value: "" if value is None else f"{value:.1f}",
        of=lambda row: row.score and 100.0 * row.score.coverage,
    ),
    Column("mean_width_n", of=lambda row: row.score and row.score.width),
    Column("interval_score", of=lambda row: row.score and row.score.interval_score),
    Column("basis", of=lambda row: row.band and row.band.basis),
    Column("calibrated_on", of=attrgetter("used")),
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Predictions(Summarised):
    """Predictions of tests by a fit, each with its band where a `calibration` and a `level` are given.

    `basis` is the origin of the bands in words, empty without any. `remarks` are what the command, the observation, the
    tested ranges and the calibration say against them.
    """

    _made_by: ClassVar[str] = "mr.predict(fit, tests)"

    fit: Fit
    rows: tuple[PredictedTest, ...]
    observe: Observing
    level: float | None = None
    basis: str = ""
    remarks: tuple[Remark, ...] = ()

    @classmethod
    def of(
        cls,
        fit: Fit,
        tests: Sequence[DamperTest],
        *,
        observe: Observe | None = None,
        substep_factor: Annotated[int, Within(least=1, most=256)] = 1,
        calibration: Calibration | None = None,
        level: Level | None = None,
    ) -> Predictions:
        """Simulate every test, as `predict` does.

        Parameters
        ----------
        substep_factor
            Multiply the integration steps by N = 2, 4, ... to check that the result does not change.
        level
            Also give the half width and the coverage of the prediction band of this level, such as 0.9; needs a
            calibration.
        """
        observing = fit.settings.observing if observe is None else Observing.of(observe)
        # What the fit has weighed is decided.
        if observing != fit.settings.observing:
            refuse_free(observing, "a prediction")
        predictions = [
            with_others(predict_test(fit, test, observing, substep_factor), fit, observing) for test in tests
        ]
        return cls.about(fit, predictions, observe=observing, calibration=calibration, level=level)

    @classmethod
    def about(
        cls,
        fit: Fit,
        predictions: Sequence[Prediction],
        *,
        observe: Observing,
        calibration: Calibration | None,
        level: float | None,
    ) -> Predictions:
        """Predictions that were made already, with the bands of a calibration."""
        banded = calibration if level is not None else None
        rows = []
        for prediction in predictions:
            band = banded.band(prediction, level or 0.0) if banded is not None else None
            rows.append(
                PredictedTest(
                    prediction=prediction,
                    quality=prediction.quality,
                    other_condition=fit.other_condition(prediction.test),
                    used=None if calibration is None else calibration.knows(prediction.test),
                    band=band,
                    score=None if band is None else score(band, prediction.measured),
                )
            )
        basis = "" if banded is None else banded.basis
        made = cls(fit=fit, rows=tuple(rows), observe=observe, level=level, basis=basis)
        return replace(made, remarks=(*made._about_motions(), *made._about_bands(banded)))

    @property
    def predictions(self) -> tuple[Prediction, ...]:
        """The predicted tests with their forces."""
        return tuple(row.prediction for row in self.rows)

    @property
    def held_out(self) -> tuple[Prediction, ...]:
        """Predictions of tests that neither the fit nor the calibration has seen."""
        return tuple(row.prediction for row in self.rows if row.is_held_out)

    @property
    def spread(self) -> FitSpread:
        """Median and worst fit of the predicted tests, seen or not."""
        return spread_of(self.predictions)

    @property
    def spread_unseen(self) -> FitSpread | None:
        """Median and worst of the tests that the fit has not seen; `None` where these are none or all."""
        unseen = [prediction for prediction in self.predictions if prediction.seen is None]
        return spread_of(unseen) if 0 < len(unseen) < len(self.predictions) else None

    def _about_motions(self) -> Iterator[Remark]:
        """What the command, the observation and the tested ranges of the fit say against the predictions."""
        cases = [(prediction.test.label, prediction.outside) for prediction in self.predictions]
        tests = [prediction.test for prediction in self.predictions]
        # Before the tested ranges: a lag that is missing is not the fault of the motion.
        fit, unseen = self.fit, [each.test for each in self.predictions if each.seen is None]
        yield from unfitted_lag(fit.spec, np.array(fit.theta), unseen, fit.settings)
        yield from unestimated_effects(self.fit.settings.observing, self.observe)
        yield from ignored_commands(self.fit.spec, tests)
        for exceedance, label, count in worst_of(cases):
            files = f"; outside on {count} of {len(tests)} files" if len(tests) > 1 else ""
            yield outside_remark(exceedance, f", {label}{files}")
        limits = worst_laws(limit for _, outside in cases for limit in outside.laws)
        yield from (limit.remark(LAW_BEYOND) for limit in limits)
        yield from (row.other_condition.condition for row in self.rows if row.other_condition)

    @property
    def coverage(self) -> tuple[float, ...]:
        """Share of the samples in its band, of each test with a band that neither fit nor calibration has seen."""
        return tuple(row.score.coverage for row in self.rows if row.is_held_out and row.score)

    def _about_bands(self, calibration: Calibration | None) -> Iterator[Remark]:
        """Predictions without a band, of another kind than the calibration, and held by less than chance leaves."""
        if calibration is None or self.level is None:
            return
        found = (*map(calibration.test_to_run, self.predictions), calibration.new_kind(self.predictions))
        yield from filter(None, found)
        judged = [
            (row.score.coverage, row.prediction, row.band)
            for row in self.rows
            if row.is_held_out and row.band and row.score
        ]
        shares = [
            (share, calibration.least_by_chance(prediction, band, len(judged)), prediction.test.label)
            for share, prediction, band in judged
        ]
        if short := [share for share in shares if share[0] < share[1]]:
            coverage, least, label = min(short)
            numbers = {"level": 100.0 * self.level, "least": 100.0 * least}
            counts = {"short": len(short), "tests": len(shares)}
            yield _TOO_NARROW.remark(label, measured=Measured(100.0 * coverage, "%"), **numbers, **counts)

    @property
    def sets_apart(self) -> str:
        """The test on which sets of laws are farthest apart, and on how many they reach the end of the tests."""
        apart = [
            (prediction.test.label, prediction.sets_apart)
            for prediction in self.predictions
            if prediction.sets_apart is not None
        ]
        if not apart:
            return ""
        label, worst = max(apart, key=lambda pair: pair[1].percent)
        files = f"; the farthest of {len(apart)} files" if len(apart) > 1 else ""
        return f"{worst.in_words}, {label}{files}"

    def document(self) -> dict[str, Any]:
        """What `mrwork predict --json` prints."""
        several = self.spread if len(self.predictions) > 1 else None
        spreads = {"spread": several, "spread_unseen": self.spread_unseen}
        return {
            "model": self.fit.model,
            "files": [as_json(self._columns, row) for row in self.rows],
            "observe": self.observe.words,
            "remarks": list(map(asdict, self.remarks)),
            **{name: asdict(spread) for name, spread in spreads.items() if spread is not None},
            **{name: text for name, text in named(self, "sets_apart", "basis").items() if text},
        }

    @property
    def _columns(self) -> tuple[Column, ...]:
        return (*_COLUMNS, *(_OF_BANDS if self.basis else ()))

    def _summary(self) -> Summary:
        notes = [self.spread.in_words] if len(self.predictions) > 1 else []
        if each := self.observe.of_each:
            notes.append(f"Estimated from the measured force of each test: {estimated_in_words(each)}.")
        notes += [f"{self.sets_apart}."] if self.sets_apart else []
        if self.basis:
            notes.append(f"Bands of {100.0 * (self.level or 0.0):g} %, {self.basis}.")
        if seen := [prediction.seen for prediction in self.predictions if prediction.seen is not None]:
            notes.append(f"Seen by the fit: {likenesses_in_words(seen)}.")
        notes += [] if self.spread_unseen is None else [f"Not seen by the fit: {self.spread_unseen.in_words}"]
        if self.basis and (used := [row.used for row in self.rows if row.used is not None]):
            notes.append(f"Used for the calibration of the bands: {likenesses_in_words(used)}.")
        return Summary(
            title=f"Predictions by a fit of {self.fit.model}",
            remarks=self.remarks,
            tables=[Table.of(self._columns, self.rows)],
            notes=notes,
        )


def spread_of(predictions: Sequence[Prediction]) -> FitSpread:
    """Median and worst of the fits of these tests."""
    return FitSpread.of(
        [prediction.test.name for prediction in predictions],
        [prediction.fit_percent for prediction in predictions],
    )


@overload
def predict(fit: Fit, test: DamperTest, *, observe: Observe | None = None) -> Prediction: ...
@overload
def predict(
    fit: Fit,
    test: Sequence[DamperTest],
    *,
    observe: Observe | None = None,
    calibration: Calibration | None = None,
    level: Level | None = None,
) -> Predictions: ...
@checked
def predict(
    fit: Fit,
    test: DamperTest | Sequence[DamperTest],
    *,
    observe: Observe | None = None,
    calibration: Calibration | None = None,
    level: Level | None = None,
) -> Prediction | Predictions:
    """Simulate a fitted damper on tests, with the observation model of the test, or else of the fit.

    Where the fit has `others`, sets of laws that predict nearly as well, the prediction says how far they are apart
    where the tests of the fit end.

    Parameters
    ----------
    test
        A test, or several, whose predictions are then a table.
    observe
        Observation model of tests that have none of their own, as in `mr.identify`; by default as in the fit.
    calibration, level
        Of several tests: the calibration of bands, and the level of the band that each is compared with.

    Raises
    ------
    SimulationError
        Where the simulation diverges or cannot be resolved.

    Warns
    -----
    MrworkWarning
        Where the command of the test varies and no parameter of the model follows it.

    Examples
    --------
    >>> import mrwork as mr
    >>> fit = mr.identify("bingham", mr.synthetic_test("spencer1997"))  # doctest: +SKIP
    >>> mr.predict(fit, mr.synthetic_test("spencer1997_slow"))  # doctest: +SKIP
    """
    tests = (test,) if isinstance(test, DamperTest) else tuple(test)
    for remark in ignored_commands(fit.spec, tests):
        # Of the line that calls `predict`.
        warn(remark.message, MrworkWarning, stacklevel=3)
    predictions = Predictions.of(fit, tests, observe=observe, calibration=calibration, level=level)
    return predictions.predictions[0] if isinstance(test, DamperTest) else predictions
