"""Prediction bands calibrated on tests that the fit has not seen: conformal over tests.

A formula for noise knows nothing of another excitation, because there the error is the model's. What does know is how
far the model was off on other tests that it had not seen: the scaled error of the next test is taken to be one more of
theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError
from mrwork.uncertainty.bands.band import Band, score
from mrwork.uncertainty.bands.prediction import Prediction, has_regular_cycles
from mrwork.uncertainty.bands.quantile import next_test_quantile, pooled_quantile

# Bins of the phase over which the mean error is taken, and the level at which the variants compete.
_BINS = 24
_JUDGED_AT = 0.9
_LEAST_TO_CHOOSE = 4
# Of each test: neighbours tell the same, and a quantile needs no more.
_SAMPLES = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """Where in a test errors are large, and which way they go.

    The scale of an error is `deviation (level + slope steepness)`. `bias` [deviations], shape (n_bins,), is the mean
    error over the phase of tests whose cycles are alike, the model's discrepancy; empty where it is left out.
    """

    level: float = 1.0
    slope: float = 0.0
    bias: tuple[float, ...] = ()

    def relative_scale(self, steepness: NDArray[np.float64]) -> NDArray[np.float64]:
        """Scale of the error [deviations], shape of `steepness`."""
        return self.level + self.slope * steepness

    def bias_at(self, phase: NDArray[np.float64]) -> NDArray[np.float64]:
        """Mean error [deviations], shape of `phase`."""
        if not self.bias:
            return np.zeros_like(phase)
        return np.asarray(np.interp(phase, _bin_centres(), self.bias, period=2.0 * np.pi))

    def of(self, prediction: Prediction) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Where the measured force is expected, and the scale of its error about that [N], shape (n_counted,)."""
        deviation = prediction.deviation
        centre = prediction.force
        if has_regular_cycles(prediction.test):
            centre = centre + deviation * self.bias_at(prediction.phase)
        return centre, deviation * self.relative_scale(prediction.steepness)


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """What the errors on some tests say of the next one.

    `scores` are the errors of each test in its scale; `tests` are their names, `held_out` says in words how the model
    came not to know them.
    """

    shape: Shape
    scores: tuple[NDArray[np.float64], ...]
    tests: tuple[str, ...]
    held_out: str

    def band(self, prediction: Prediction, level: float) -> Band:
        """The prediction band of the force, shape (n_counted,).

        Raises
        ------
        SettingError
            Where the level is not between 0 and 1.
        """
        centre, scale = self.shape.of(prediction)
        half = next_test_quantile(self.scores, level) * scale
        return Band(
            kind="prediction",
            level=level,
            lower=centre - half,
            upper=centre + half,
            basis=self.basis,
        )

    @property
    def basis(self) -> str:
        """On what the band rests, in words."""
        n_tests = len(self.tests)
        if n_tests == 1:
            return f"calibrated on one test {self.held_out}, which says little of the next"
        return f"calibrated on {n_tests} tests {self.held_out}"


def calibrate(predictions: Sequence[Prediction], *, held_out: str) -> Calibration:
    """Calibrate bands on tests that the fit has not seen.

    Errors grow with the steepness of the force, and over the cycle they have a mean. Whether these two help is decided
    on the tests themselves, each predicted from the others: the least interval score wins.

    Parameters
    ----------
    predictions
        The model on each test, at least one.
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
    variants = [(False, False), (True, False)]
    if all(has_regular_cycles(prediction.test) for prediction in predictions):
        variants += [(False, True), (True, True)]
    if len(predictions) < _LEAST_TO_CHOOSE:
        variants = variants[:1]
    best = min(variants, key=lambda variant: _left_out_score(errors, variant))
    return _calibrated(errors, best, held_out)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Errors:
    """Errors of one test [deviations] with what they may depend on, shape (n,), at evenly spaced samples."""

    name: str
    error: NDArray[np.float64]
    steepness: NDArray[np.float64]
    phase: NDArray[np.float64]

    @classmethod
    def of(cls, prediction: Prediction) -> _Errors:
        every = slice(None, None, max(1, prediction.force.size // _SAMPLES))
        return cls(
            name=prediction.test.path or prediction.test.name,
            error=(prediction.residual / prediction.deviation)[every],
            steepness=prediction.steepness[every],
            phase=prediction.phase[every],
        )

    def over_phase(self) -> NDArray[np.float64]:
        """Mean error in each bin of the phase, shape (n_bins,)."""
        index = np.minimum(((self.phase + np.pi) / (2.0 * np.pi) * _BINS).astype(int), _BINS - 1)
        count = np.bincount(index, minlength=_BINS)
        total = np.bincount(index, weights=self.error, minlength=_BINS)
        return np.asarray(total / np.maximum(count, 1))

    def scores(self, shape: Shape) -> NDArray[np.float64]:
        """Size of the errors about the bias, in the scale of the shape."""
        return np.asarray(
            np.abs(self.error - shape.bias_at(self.phase)) / shape.relative_scale(self.steepness)
        )


def _left_out_score(errors: Sequence[_Errors], variant: tuple[bool, bool]) -> float:
    """Mean interval score of each test's band, calibrated on the others, per deviation of its force."""
    if len(errors) == 1:
        return 0.0
    total = 0.0
    for index, test in enumerate(errors):
        calibration = _calibrated([*errors[:index], *errors[index + 1 :]], variant, "")
        centre = calibration.shape.bias_at(test.phase)
        half = pooled_quantile(calibration.scores, _JUDGED_AT) * calibration.shape.relative_scale(
            test.steepness
        )
        band = Band(kind="prediction", level=_JUDGED_AT, lower=centre - half, upper=centre + half, basis="")
        total += score(band, test.error).interval_score
    return total


def _calibrated(errors: Sequence[_Errors], variant: tuple[bool, bool], held_out: str) -> Calibration:
    steep, biased = variant
    level, slope = _scale(errors) if steep else (1.0, 0.0)
    curves = np.array([test.over_phase() for test in errors]) if biased else np.empty((len(errors), 0))
    total = curves.sum(axis=0)
    # A test's own error is left out of the mean that its score is taken from, as it will be for the next test.
    others = (total - curves) / max(len(errors) - 1, 1)
    return Calibration(
        shape=Shape(level=level, slope=slope, bias=tuple(total / len(errors))),
        scores=tuple(
            test.scores(Shape(level=level, slope=slope, bias=tuple(bias)))
            for test, bias in zip(errors, others, strict=True)
        ),
        tests=tuple(test.name for test in errors),
        held_out=held_out,
    )


def _scale(errors: Sequence[_Errors]) -> tuple[float, float]:
    """The size of errors as a line over the steepness, both coefficients positive, each test weighing the same."""
    # Slow to load, and whoever reads a calibration does not need it.
    from scipy.optimize import nnls

    weights = [test.error.size**-0.5 for test in errors]
    rows = [
        weight * np.stack([np.ones_like(test.steepness), test.steepness], axis=1)
        for weight, test in zip(weights, errors, strict=True)
    ]
    sizes = [weight * np.abs(test.error) for weight, test in zip(weights, errors, strict=True)]
    level, slope = nnls(np.concatenate(rows), np.concatenate(sizes))[0]
    return (float(level), float(slope)) if level > 0.0 else (1.0, 0.0)


def _bin_centres() -> NDArray[np.float64]:
    return -np.pi + (np.arange(_BINS) + 0.5) * 2.0 * np.pi / _BINS
