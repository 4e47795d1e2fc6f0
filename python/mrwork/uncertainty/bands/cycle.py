"""What a cycle of a test comes to: energy, equivalent stiffness and damping; and bands for these."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError
from mrwork.records import DamperTest
from mrwork.records.cycles import whole_cycles
from mrwork.uncertainty.bands.prediction import Prediction

CycleQuantity = Literal["energy", "stiffness", "damping"]
QUANTITIES: tuple[CycleQuantity, ...] = get_args(CycleQuantity)
UNITS: dict[CycleQuantity, str] = {"energy": "J", "stiffness": "N/m", "damping": "N s/m"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Cycles:
    """Whole cycles of one force: dissipated energy [J], equivalent stiffness [N/m] and damping [N s/m], (n_cycles,).

    Stiffness and damping are those of the spring and dashpot nearest to the loop in least squares.
    """

    energy: NDArray[np.float64]
    stiffness: NDArray[np.float64]
    damping: NDArray[np.float64]

    def quantity(self, name: CycleQuantity) -> NDArray[np.float64]:
        """One of the three."""
        return {"energy": self.energy, "stiffness": self.stiffness, "damping": self.damping}[name]


def cycles_of(test: DamperTest, force: NDArray[np.float64]) -> Cycles:
    """The cycles of a test that count, with this force [N], shape (n_time,).

    Raises
    ------
    RecordError
        Where the record has no whole cycle.
    """
    first = test.n_settle
    rows = [
        _cycle(test.displacement[samples], test.velocity[samples], force[samples], test.dt)
        for samples in whole_cycles(test.displacement)
        if samples.start >= first
    ]
    if not rows:
        raise RecordError(
            f"{test.path or test.name}: there is no whole cycle; give a longer test for energy per cycle"
        )
    energy, stiffness, damping = np.array(rows).T
    return Cycles(energy=energy, stiffness=stiffness, damping=damping)


def scales_of(prediction: Prediction) -> dict[CycleQuantity, float]:
    """The natural size of an error in each quantity: that of a loop as wide as the force deviates."""
    counted = prediction.test.counted
    x = float(np.std(prediction.test.displacement[counted]))
    v = float(np.std(prediction.test.velocity[counted]))
    force = prediction.deviation
    return {"energy": 2.0 * np.pi * force * x, "stiffness": force / x, "damping": force / v}


def errors_over_cycles(
    predictions: Sequence[Prediction], name: CycleQuantity
) -> tuple[NDArray[np.float64], ...]:
    """Size of the error in each cycle of each test, in the natural size, sorted: scores for a calibration."""
    result = []
    for prediction in predictions:
        measured = cycles_of(prediction.test, prediction.test.force).quantity(name)
        model = cycles_of(prediction.test, prediction.model_force).quantity(name)
        result.append(np.sort(np.abs(measured - model) / scales_of(prediction)[name]))
    return tuple(result)


def _cycle(
    x: NDArray[np.float64], v: NDArray[np.float64], force: NDArray[np.float64], dt: float
) -> tuple[float, float, float]:
    design = np.stack([x - x.mean(), v, np.ones_like(x)], axis=1)
    stiffness, damping, _ = np.linalg.lstsq(design, force, rcond=None)[0]
    # A whole cycle: the rectangle rule is exact to the order of the trapezoid.
    return float(force @ v) * dt, float(stiffness), float(damping)
