"""Conformal prediction bands: calibrated on tests that the fit has not seen, and their measured coverage.

On another excitation the error is mostly model error, which no noise model predicts. The bands rest on the errors on
other tests that the fit has not seen: the scaled error of the next test is assumed exchangeable with them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError, SettingError
from mrwork.summary import Summarised, Summary, rounded
from mrwork.uncertainty.bands.band import Band, BandScore, next_test_quantile, pooled_quantile, score
from mrwork.uncertainty.bands.cycle import cycle_band, cycles_of, errors_over_cycles
from mrwork.uncertainty.bands.prediction import Prediction, has_regular_cycles

# Bins of the phase for the mean error; level at which variants of the shape are compared, and tests it takes.
_BINS = 24
_COMPARED_AT = 0.9
_LEAST_TO_CHOOSE = 4
LEVELS = (0.5, 0.9, 0.95)

# Largest number of evenly spaced samples of each test.
_SAMPLES = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """Scale and bias of the errors over a test.

    The scale of an error is `deviation (level + slope steepness) + floor` [N], with the standard deviation of the
    model's force. `bias` [deviations], shape (n_bins,), is the mean error over the phase of periodic tests, the
    systematic model error; empty where it is left out.
    """

    level: float = 1.0
    slope: float = 0.0
    floor: float = 0.0
    bias: tuple[float, ...] = ()

    def scale(self, deviation: float, steepness: NDArray[np.float64]) -> NDArray[np.float64]:
        """Scale of the error [N], shape of `steepness`."""
        return np.asarray(deviation * (self.level + self.slope * steepness) + self.floor)

    def bias_at(self, phase: NDArray[np.float64]) -> NDArray[np.float64]:
        """Mean error [deviations], shape of `phase`."""
        if not self.bias:
            return np.zeros_like(phase)
        centres = -np.pi + (np.arange(_BINS) + 0.5) * 2.0 * np.pi / _BINS
        return np.asarray(np.interp(phase, centres, self.bias, period=2.0 * np.pi))

    def of(self, prediction: Prediction) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Expected measured force and the scale of the error about it [N], shape (n_counted,)."""
        deviation = prediction.deviation
        centre = prediction.force
        if has_regular_cycles(prediction.test):
            centre = centre + deviation * self.bias_at(prediction.phase)
        return centre, self.scale(deviation, prediction.steepness)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Calibration(Summarised):
    """Calibration of prediction bands from the errors on several tests.

    `scores` are the errors of each test in its scale; `tests` are their names; `held_out` describes how the tests were
    kept from the fit.
    """

    shape: Shape
    scores: tuple[NDArray[np.float64], ...]
    tests: tuple[str, ...]
    held_out: str

    def band(self, prediction: Prediction, level: float) -> Band:
        """Prediction band of the force, shape (n_counted,).

        Raises
        ------
        SettingError
            Where the level is not between 0 and 1.
        """
        centre, scale = self.shape.of(prediction)
        half = next_test_quantile(self.scores, level) * scale
        return Band.about(centre, half, level=level, basis=self.basis)

    @property
    def basis(self) -> str:
        """Origin of the band, in words."""
        n_tests = len(self.tests)
        if n_tests == 1:
            return f"calibrated on one test {self.held_out}, which is little evidence for the next"
        return f"calibrated on {n_tests} tests {self.held_out}"

    def _summary(self) -> Summary:
        shape = self.shape
        return Summary(
            title=f"Calibration of prediction bands on {len(self.tests)} tests",
            facts=(
                ("held out", self.held_out),
                (
                    "scale of an error",
                    f"deviation x ({shape.level:.3g} + {shape.slope:.3g} steepness) + {shape.floor:.3g} N",
                ),
                ("mean error over the cycle", "removed" if self.shape.bias else "not removed"),
            ),
            columns=("test", "median score", "90 % score"),
            rows=[
                (test, *(rounded(float(np.quantile(np.abs(scores), share)), 3) for share in (0.5, 0.9)))
                for test, scores in zip(self.tests, self.scores, strict=True)
            ],
        )


def calibrate(predictions: Sequence[Prediction], *, held_out: str) -> Calibration:
    """Calibrate bands on tests that the fit has not seen.

    The scale of the error is proportional to the force of the test, with or without a constant and a term that grows
    with the steepness of the force; the error has zero mean or a mean over the cycle. The variant with the least
    interval score is chosen by leave-one-out cross-validation over the tests.

    Parameters
    ----------
    predictions
        Predictions of the tests, at least one.
    held_out
        How the tests were kept from the fit, such as "the fit has not seen".

    Raises
    ------
    SettingError
        Where no test is given.
    """
    if not predictions:
        raise SettingError(
            "a band is calibrated on tests that the fit has not seen, none was given; name at least one"
        )
    errors = [_Errors.of(prediction) for prediction in predictions]
    periodic = all(has_regular_cycles(prediction.test) for prediction in predictions)
    variants = [
        _Variant(steep=steep, floored=floored, biased=biased)
        for biased in ((False, True) if periodic else (False,))
        for floored in (False, True)
        for steep in (False, True)
    ]
    if len(predictions) < _LEAST_TO_CHOOSE:
        variants = variants[:1]
    best = min(variants, key=lambda variant: _left_out_score(errors, variant))
    return _calibrated(errors, best, held_out)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Variant:
    """Terms of a shape in addition to its level."""

    steep: bool
    floored: bool
    biased: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class _Errors:
    """Errors of one test [N] with steepness and phase, shape (n,), at evenly spaced samples.

    `deviation` and `measured` are the standard deviations of the model's and the measured force [N].
    """

    name: str
    deviation: float
    measured: float
    error: NDArray[np.float64]
    steepness: NDArray[np.float64]
    phase: NDArray[np.float64]

    @classmethod
    def of(cls, prediction: Prediction) -> _Errors:
        every = slice(None, None, max(1, prediction.force.size // _SAMPLES))
        return cls(
            name=prediction.test.label,
            deviation=prediction.deviation,
            measured=float(np.std(prediction.measured)),
            error=prediction.residual[every],
            steepness=prediction.steepness[every],
            phase=prediction.phase[every],
        )

    def over_phase(self) -> NDArray[np.float64]:
        """Mean error in each bin of the phase [deviations], shape (n_bins,)."""
        index = np.minimum(((self.phase + np.pi) / (2.0 * np.pi) * _BINS).astype(int), _BINS - 1)
        count = np.bincount(index, minlength=_BINS)
        total = np.bincount(index, weights=self.error / self.deviation, minlength=_BINS)
        return np.asarray(total / np.maximum(count, 1))

    def scores(self, shape: Shape) -> NDArray[np.float64]:
        """Absolute errors about the bias, in the scale of the shape."""
        about = self.error - self.deviation * shape.bias_at(self.phase)
        return np.asarray(np.abs(about) / shape.scale(self.deviation, self.steepness))


def _left_out_score(errors: Sequence[_Errors], variant: _Variant) -> float:
    """Sum over tests of the interval score of the band calibrated on the others, per deviation of the force."""
    if len(errors) == 1:
        return 0.0
    total = 0.0
    for index, test in enumerate(errors):
        calibration = _calibrated([*errors[:index], *errors[index + 1 :]], variant, "")
        shape = calibration.shape
        centre = test.deviation * shape.bias_at(test.phase)
        half = pooled_quantile(calibration.scores, _COMPARED_AT) * shape.scale(test.deviation, test.steepness)
        band = Band.about(centre, half, level=_COMPARED_AT)
        total += score(band, test.error, per=test.measured).interval_score
    return total


def _calibrated(errors: Sequence[_Errors], variant: _Variant, held_out: str) -> Calibration:
    plain = _scale(errors, variant)
    curves = (
        np.array([test.over_phase() for test in errors]) if variant.biased else np.empty((len(errors), 0))
    )
    total = curves.sum(axis=0)
    # The bias for the score of a test excludes its own error, as it will for the next test.
    others = (total - curves) / max(len(errors) - 1, 1)
    return Calibration(
        shape=replace(plain, bias=tuple(total / len(errors))),
        scores=tuple(
            test.scores(replace(plain, bias=tuple(bias))) for test, bias in zip(errors, others, strict=True)
        ),
        tests=tuple(test.name for test in errors),
        held_out=held_out,
    )


def _scale(errors: Sequence[_Errors], variant: _Variant) -> Shape:
    """Shape by non-negative least squares on the absolute errors, relative to each test's force."""
    if not (variant.steep or variant.floored):
        return Shape()
    # Slow to load, and not needed to read a calibration.
    from scipy.optimize import nnls

    rows, sizes = [], []
    for test in errors:
        per = 1.0 / (test.measured * np.sqrt(test.error.size))
        columns = [
            np.full_like(test.error, test.deviation),
            test.deviation * test.steepness * variant.steep,
            np.full_like(test.error, float(variant.floored)),
        ]
        rows.append(per * np.stack(columns, axis=1))
        sizes.append(per * np.abs(test.error))
    # The floor is in newtons, the others are ratios: columns of equal norm for the solver.
    design = np.concatenate(rows)
    norm = np.maximum(np.linalg.norm(design, axis=0), 1e-300)
    level, slope, floor = nnls(design / norm, np.concatenate(sizes))[0] / norm
    shape = Shape(level=float(level), slope=float(slope), floor=float(floor))
    # With steepness alone the band would have no width where the force is constant.
    return shape if level + floor > 0.0 else Shape()


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOutCoverage:
    """Score of the force's band on one test left out, per deviation of the measured force, at one level.

    `cycles_inside` is the share of cycles whose dissipated energy lies in the energy band; NaN without whole cycles.
    """

    test: str
    level: float
    samples: BandScore
    cycles_inside: float


def measured_coverage(
    predictions: Sequence[Prediction], levels: Sequence[float] = LEVELS
) -> tuple[LeftOutCoverage, ...]:
    """Coverage of each test by bands calibrated on the others, at each level.

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
                    test=prediction.test.label,
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
