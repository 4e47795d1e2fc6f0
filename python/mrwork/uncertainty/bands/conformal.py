"""Prediction bands calibrated on tests that the fit has not seen: conformal over tests.

A formula for noise knows nothing of another excitation, because there the error is the model's. What does know is how
far the model was off on other tests that it had not seen: the scaled error of the next test is taken to be one more of
theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError
from mrwork.summary import Summarised, Summary, rounded
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

    The scale of an error is `deviation (level + slope steepness) + floor` [N], the deviation that of the model's force.
    `bias` [deviations], shape (n_bins,), is the mean error over the phase of tests whose cycles are alike, the model's
    discrepancy; empty where it is left out.
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
        return np.asarray(np.interp(phase, _bin_centres(), self.bias, period=2.0 * np.pi))

    def of(self, prediction: Prediction) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Where the measured force is expected, and the scale of its error about that [N], shape (n_counted,)."""
        deviation = prediction.deviation
        centre = prediction.force
        if has_regular_cycles(prediction.test):
            centre = centre + deviation * self.bias_at(prediction.phase)
        return centre, self.scale(deviation, prediction.steepness)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Calibration(Summarised):
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
                ("mean error over the cycle", "taken out" if self.shape.bias else "left in"),
            ),
            columns=("test", "median score", "90 % score"),
            rows=[
                (test, *(rounded(float(np.quantile(np.abs(scores), share)), 3) for share in (0.5, 0.9)))
                for test, scores in zip(self.tests, self.scores, strict=True)
            ],
        )


def calibrate(predictions: Sequence[Prediction], *, held_out: str) -> Calibration:
    """Calibrate bands on tests that the fit has not seen.

    An error is taken to be in proportion to the force of its test, or partly the same in all tests; to grow with the
    steepness of the force, or not; to have a mean over the cycle, or none. Which of these is decided on the tests
    themselves, each predicted from the others: the least interval score wins.

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
    """What a shape may have beside a level."""

    steep: bool
    floored: bool
    biased: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class _Errors:
    """Errors of one test [N] with what they may depend on, shape (n,), at evenly spaced samples.

    `deviation` is that of the model's force, `measured` that of the measured one [N].
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
            name=prediction.test.path or prediction.test.name,
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
        """Size of the errors about the bias, in the scale of the shape."""
        about = self.error - self.deviation * shape.bias_at(self.phase)
        return np.asarray(np.abs(about) / shape.scale(self.deviation, self.steepness))


def _left_out_score(errors: Sequence[_Errors], variant: _Variant) -> float:
    """Sum of the interval scores of each test's band, calibrated on the others, per deviation of its force."""
    if len(errors) == 1:
        return 0.0
    total = 0.0
    for index, test in enumerate(errors):
        calibration = _calibrated([*errors[:index], *errors[index + 1 :]], variant, "")
        shape = calibration.shape
        centre = test.deviation * shape.bias_at(test.phase)
        half = pooled_quantile(calibration.scores, _JUDGED_AT) * shape.scale(test.deviation, test.steepness)
        band = Band(kind="prediction", level=_JUDGED_AT, lower=centre - half, upper=centre + half, basis="")
        total += score(band, test.error, per=test.measured).interval_score
    return total


def _calibrated(errors: Sequence[_Errors], variant: _Variant, held_out: str) -> Calibration:
    plain = _scale(errors, variant)
    curves = (
        np.array([test.over_phase() for test in errors]) if variant.biased else np.empty((len(errors), 0))
    )
    total = curves.sum(axis=0)
    # A test's own error is left out of the mean that its score is taken from, as it will be for the next test.
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
    """The size of errors as a sum of what the variant has, none of it negative, relative to each test's force."""
    if not (variant.steep or variant.floored):
        return Shape()
    # Slow to load, and whoever reads a calibration does not need it.
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
    # The floor is in newtons, the others are shares: columns of like size for the solver.
    design = np.concatenate(rows)
    norm = np.maximum(np.linalg.norm(design, axis=0), 1e-300)
    level, slope, floor = nnls(design / norm, np.concatenate(sizes))[0] / norm
    shape = Shape(level=float(level), slope=float(slope), floor=float(floor))
    # Where all of it is steepness, the band would have no width at all where the force is flat.
    return shape if level + floor > 0.0 else Shape()


def _bin_centres() -> NDArray[np.float64]:
    return -np.pi + (np.arange(_BINS) + 0.5) * 2.0 * np.pi / _BINS
