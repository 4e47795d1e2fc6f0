"""One measured test beside the force a model gives for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError
from mrwork.identification.fit import FitQuality
from mrwork.records.damper_test import DamperTest
from mrwork.values import holds_arrays


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """A test, the free-run `model_force` [N] on its samples, shape (n_time,), and how well they agree."""

    test: DamperTest
    model_force: NDArray[np.float64]
    quality: FitQuality

    def __post_init__(self) -> None:
        expected = (self.test.n_time,)
        if self.model_force.shape != expected:
            raise SettingError(
                f"`model_force` has shape {self.model_force.shape}, test {self.test.name!r} has {expected}; "
                "simulate the model on the samples of that test"
            )

    @property
    def residual(self) -> NDArray[np.float64]:
        """Measured minus model force [N], shape (n_time,)."""
        return self.test.force - self.model_force

    @property
    def data_label(self) -> str:
        """Name of the data in a legend; synthetic data are never called measured."""
        return "synthetic" if self.test.synthetic else "measured"
