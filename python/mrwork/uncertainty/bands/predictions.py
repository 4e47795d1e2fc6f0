"""Predictions of several tests by one fit, with the bands of a calibration: what `mrwork predict` shows and keeps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any, ClassVar, overload
from warnings import warn

from mrwork.base.arguments import Level, checked
from mrwork.base.hints import Within
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary, named
from mrwork.base.table import Table
from mrwork.dampers.spec import LAW_BEYOND, worst_laws
from mrwork.dampers.tested_range import outside_remark, worst_of
from mrwork.errors import MrworkWarning
from mrwork.identification.fit import Fit, FitSpread
from mrwork.identification.problem import ignored_commands
from mrwork.identification.residual import estimated_in_words, refuse_free, unestimated_effects
from mrwork.records import DamperTest, Likeness
from mrwork.records.likeness import likenesses_in_words
from mrwork.records.observation import as_words, effects_of_each
from mrwork.uncertainty.bands.band import Band, BandScore, score
from mrwork.uncertainty.bands.conformal import Calibration
from mrwork.uncertainty.bands.prediction import Prediction, predict_test, with_others

_TOO_NARROW = RemarkKind(
    "band_too_narrow",
    "the {level:g} % band holds {value:.0f} % of {0}, by chance at least {least:.0f} % ({short} of {tests} tests are "
    "held less than by chance): errors there are larger than in the tests of the calibration",
    "calibrate on tests of such motions, too",
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Predictions(Summarised):
    """Predictions of tests by a fit, each with its band where a `calibration` and a `level` are given.

    `used` are the tests of the calibration that the predicted ones are alike to, `None` for others; `bands` have
    their scores against the measured force beside them, and are `None` farther beyond the tests than the model was
    tried. `remarks` are what the command, the observation, the tested ranges and the calibration say against them.
    """

    _made_by: ClassVar[str] = "mr.predict(fit, tests)"

    fit: Fit
    predictions: tuple[Prediction, ...]
    observe: Sequence[str]
    used: tuple[Likeness | None, ...]
    bands: tuple[tuple[Band, BandScore] | None, ...] = ()
    level: float | None = None
    basis: str = ""
    remarks: tuple[Remark, ...] = ()

    @classmethod
    def of(
        cls,
        fit: Fit,
        tests: Sequence[DamperTest],
        *,
        observe: str | Sequence[str] | None = None,
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
        words = fit.settings.observe if observe is None else as_words(observe)
        # What the fit has weighed is decided.
        if words != fit.settings.observe:
            refuse_free(words, "a prediction")
        predictions = [
            with_others(predict_test(fit, test, words, substep_factor), fit, words) for test in tests
        ]
        return cls.about(fit, predictions, observe=words, calibration=calibration, level=level)

    @classmethod
    def about(
        cls,
        fit: Fit,
        predictions: Sequence[Prediction],
        *,
        observe: Sequence[str],
        calibration: Calibration | None,
        level: float | None,
    ) -> Predictions:
        """Predictions that were made already, with the bands of a calibration."""
        bands: tuple[tuple[Band, BandScore] | None, ...] = ()
        if calibration is not None and level is not None:
            of_tests = [calibration.band(prediction, level) for prediction in predictions]
            bands = tuple(
                None if band is None else (band, score(band, prediction.measured))
                for band, prediction in zip(of_tests, predictions, strict=True)
            )
        made = cls(
            fit=fit,
            predictions=tuple(predictions),
            observe=observe,
            used=tuple(
                None if calibration is None else calibration.knows(prediction.test)
                for prediction in predictions
            ),
            bands=bands,
            level=level,
            basis=calibration.basis if calibration is not None and bands else "",
        )
        return replace(made, remarks=(*made._about_motions(), *made._about_bands(calibration)))

    @property
    def held_out(self) -> tuple[Prediction, ...]:
        """Predictions of tests that neither the fit nor the calibration has seen."""
        pairs = zip(self.predictions, self.used, strict=True)
        return tuple(prediction for prediction, used in pairs if prediction.seen is None and used is None)

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
        yield from unestimated_effects(self.fit.settings.observe, self.observe)
        yield from ignored_commands(self.fit.spec, tests)
        for exceedance, label, count in worst_of(cases):
            files = f"; outside on {count} of {len(tests)} files" if len(tests) > 1 else ""
            yield outside_remark(exceedance, f", {label}{files}")
        limits = worst_laws(limit for _, outside in cases for limit in outside.laws)
        yield from (limit.remark(LAW_BEYOND) for limit in limits)
        yield from (condition.condition for condition in map(self.fit.other_condition, tests) if condition)

    @property
    def _held_out_bands(self) -> Iterator[tuple[Prediction, Band, float]]:
        """Each test with a band that neither fit nor calibration has seen, and the share of it in the band."""
        for prediction, used, pair in zip(self.predictions, self.used, self.bands, strict=False):
            if prediction.seen is None and used is None and pair is not None:
                yield prediction, pair[0], pair[1].coverage

    @property
    def coverage(self) -> tuple[float, ...]:
        """Share of the samples in its band, of each test with a band that neither fit nor calibration has seen."""
        return tuple(coverage for _, _, coverage in self._held_out_bands)

    def _about_bands(self, calibration: Calibration | None) -> Iterator[Remark]:
        """Predictions without a band, of another kind than the calibration, and held by less than chance leaves."""
        if calibration is None or self.level is None:
            return
        found = (*map(calibration.test_to_run, self.predictions), calibration.new_kind(self.predictions))
        yield from filter(None, found)
        shares = [
            (coverage, calibration.least_by_chance(prediction, band), prediction.test.label)
            for prediction, band, coverage in self._held_out_bands
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
            "files": [self._file(number) for number in range(len(self.predictions))],
            "observe": self.observe,
            "remarks": list(map(asdict, self.remarks)),
            **{name: asdict(spread) for name, spread in spreads.items() if spread is not None},
            **{name: text for name, text in named(self, "sets_apart", "basis").items() if text},
        }

    def _file(self, number: int) -> dict[str, Any]:
        """What `document` has of a prediction: quality, likeness to seen tests, and the band where there is one."""
        each, used, quality = self.predictions[number], self.used[number], self.predictions[number].quality
        condition = self.fit.other_condition(each.test)
        entry = {
            "file": each.test.label,
            **named(quality, "fit_percent", "nrmse", "rmse_n"),
            "error_norms": asdict(quality.error_norms),
            **named(quality, "n_time", "settle_seconds", "substeps"),
            "seen": None if each.seen is None else asdict(each.seen),
            "other_condition": None if condition is None else asdict(condition),
            "estimated": asdict(quality.estimated) if effects_of_each(self.observe) else None,
            "outside_tested_range": list(each.outside.names) if each.outside.known else None,
            "remarks": list(map(asdict, each.outside.remarks)),
            "sets_apart_percent": None if each.sets_apart is None else each.sets_apart.percent,
        }
        if not self.bands:
            return entry
        pair = self.bands[number]
        if pair is None:
            nothing = dict.fromkeys(("coverage_percent", "mean_width_n", "interval_score", "band"))
            return entry | nothing
        band, scored = pair
        return entry | {
            "coverage_percent": 100.0 * scored.coverage,
            "mean_width_n": scored.width,
            "interval_score": scored.interval_score,
            "band": {
                "level": band.level,
                "half_width_n": 0.5 * scored.width,
                "inside": scored.coverage,
                "basis": band.basis,
                "calibrated_on": None if used is None else asdict(used),
            },
        }

    def _summary(self) -> Summary:
        heads = ("file", "fit %", "NRMSE", "RMSE [N]", "samples", "sub-steps", "+- [N]", "inside %")
        rows = []
        for number, prediction in enumerate(self.predictions):
            quality = prediction.quality
            band = ("", "")
            if self.bands:
                pair = self.bands[number]
                band = ("none", "")
                if pair is not None:
                    band = (pair[0].half_width_in_words, f"{100.0 * pair[1].coverage:.1f}")
            rows.append(
                (
                    *(prediction.test.label, f"{quality.fit_percent:.2f}", f"{quality.nrmse:.4f}"),
                    *(f"{quality.rmse_n:.2f}", str(quality.n_time), str(quality.substeps), *band),
                )
            )
        notes = [self.spread.in_words] if len(self.predictions) > 1 else []
        if each := effects_of_each(self.observe):
            notes.append(f"Estimated from the measured force of each test: {estimated_in_words(each)}.")
        notes += [f"{self.sets_apart}."] if self.sets_apart else []
        if self.bands:
            notes.append(f"Bands of {100.0 * (self.level or 0.0):g} %, {self.basis}.")
        if seen := [prediction.seen for prediction in self.predictions if prediction.seen is not None]:
            notes.append(f"Seen by the fit: {likenesses_in_words(seen)}.")
        notes += [] if self.spread_unseen is None else [f"Not seen by the fit: {self.spread_unseen.in_words}"]
        if self.bands and (used := [likeness for likeness in self.used if likeness is not None]):
            notes.append(f"Used for the calibration of the bands: {likenesses_in_words(used)}.")
        return Summary(
            title=f"Predictions by a fit of {self.fit.model}",
            remarks=self.remarks,
            tables=[Table(columns=heads, rows=rows)],
            notes=notes,
        )


def spread_of(predictions: Sequence[Prediction]) -> FitSpread:
    """Median and worst of the fits of these tests."""
    return FitSpread.of(
        [prediction.test.name for prediction in predictions],
        [prediction.fit_percent for prediction in predictions],
    )


@overload
def predict(
    fit: Fit,
    test: DamperTest,
    *,
    observe: str | Sequence[str] | None = None,
) -> Prediction: ...
@overload
def predict(
    fit: Fit,
    test: Sequence[DamperTest],
    *,
    observe: str | Sequence[str] | None = None,
    calibration: Calibration | None = None,
    level: Level | None = None,
) -> Predictions: ...
@checked
def predict(
    fit: Fit,
    test: DamperTest | Sequence[DamperTest],
    *,
    observe: str | Sequence[str] | None = None,
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
