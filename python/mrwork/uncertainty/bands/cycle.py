"""Energy, equivalent stiffness and equivalent damping of the cycles of a test, and prediction bands of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError
from mrwork.records import DamperTest
from mrwork.records.motion import whole_cycles
from mrwork.uncertainty.bands.band import Band, next_test_quantile
from mrwork.uncertainty.bands.prediction import Prediction
from mrwork.values import holds_arrays

CycleQuantity = Literal["energy", "stiffness", "damping"]
QUANTITIES: tuple[CycleQuantity, ...] = get_args(CycleQuantity)


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class Cycles:
    """Whole cycles: dissipated energy [J], equivalent stiffness [N/m] and damping [N s/m], shape (n_cycles,).

    Stiffness and damping are those of the spring and dashpot that fit the loop by least squares.
    """

    energy: NDArray[np.float64]
    stiffness: NDArray[np.float64]
    damping: NDArray[np.float64]

    def quantity(self, name: CycleQuantity) -> NDArray[np.float64]:
        """One of the three quantities."""
        return {"energy": self.energy, "stiffness": self.stiffness, "damping": self.damping}[name]


def cycles_of(test: DamperTest, force: NDArray[np.float64]) -> Cycles:
    """Counted cycles of a test with this force [N], shape (n_time,).

    Raises
    ------
    RecordError
        Where the record has no whole cycle.
    """
    first = test.n_settle
    rows = [
        _cycle(test.displacement[samples], test.velocity[samples], force[samples], test.dt)
        for samples in whole_cycles(test.displacement)
        if samples.start >= first and not _is_interpolated(samples, test)
    ]
    if not rows:
        raise RecordError(f"{test.label}: there is no whole cycle; give a longer test for energy per cycle")
    energy, stiffness, damping = np.array(rows).T
    return Cycles(energy=energy, stiffness=stiffness, damping=damping)


def _is_interpolated(samples: slice, test: DamperTest) -> bool:
    """Whether one of the samples lies in a span that is not compared."""
    return any(first < samples.stop and samples.start < last for first, last in test.uncompared)


def scales_of(prediction: Prediction) -> dict[CycleQuantity, float]:
    """Scale of the error of each quantity, from the standard deviations of force and motion."""
    counted = prediction.test.counted
    x = float(np.std(prediction.test.displacement[counted]))
    v = float(np.std(prediction.test.velocity[counted]))
    force = prediction.deviation
    return {"energy": 2.0 * np.pi * force * x, "stiffness": force / x, "damping": force / v}


def errors_over_cycles(prediction: Prediction, name: CycleQuantity) -> NDArray[np.float64]:
    """Absolute error of each cycle of a test in its scale, shape (n_cycles,)."""
    measured = cycles_of(prediction.test, prediction.test.force).quantity(name)
    model = cycles_of(prediction.test, prediction.model_force).quantity(name)
    return np.asarray(np.abs(measured - model) / scales_of(prediction)[name])


def cycle_band(
    prediction: Prediction, name: CycleQuantity, scores: Sequence[NDArray[np.float64]], level: float
) -> Band:
    """Prediction band of a quantity, shape (n_cycles,), from the errors of the cycles of other tests.

    Parameters
    ----------
    scores
        `errors_over_cycles` of each test, none of which the fit has seen.
    """
    model = cycles_of(prediction.test, prediction.model_force).quantity(name)
    half = next_test_quantile(scores, level) * scales_of(prediction)[name]
    basis = f"calibrated on the cycles of {len(scores)} tests"
    return Band.about(model, half, level=level, basis=basis)


def _cycle(
    x: NDArray[np.float64], v: NDArray[np.float64], force: NDArray[np.float64], dt: float
) -> tuple[float, float, float]:
    design = np.stack([x - x.mean(), v, np.ones_like(x)], axis=1)
    stiffness, damping, _ = np.linalg.lstsq(design, force, rcond=None)[0]
    # Over a whole cycle the rectangle rule is as accurate as the trapezoidal rule.
    return float(force @ v) * dt, float(stiffness), float(damping)
