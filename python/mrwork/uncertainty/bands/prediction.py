"""A model's force on a test that it was not fitted to, with what of it tells where the error will be large."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.spec import DamperSpec
from mrwork.identification.nuisance import NuisanceName
from mrwork.identification.result import free_run
from mrwork.records import DamperTest
from mrwork.records.motion import whole_cycles
from mrwork.summary import Summarised, Summary

# Of a cycle, to both sides: small errors in time show where the force changes over so much of it.
_REACH = 0.02


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Prediction(Summarised):
    """A test and the model's force on it [N], shape (n_time,), as the rig would have recorded it.

    All properties are of the samples that count, shape (n_counted,).
    """

    test: DamperTest
    model_force: NDArray[np.float64]

    @property
    def force(self) -> NDArray[np.float64]:
        """The model's force [N]."""
        return self.model_force[self.test.counted]

    @property
    def measured(self) -> NDArray[np.float64]:
        """The measured force [N]."""
        return self.test.force[self.test.counted]

    @property
    def residual(self) -> NDArray[np.float64]:
        """Measured less model force [N]."""
        return self.measured - self.force

    @property
    def deviation(self) -> float:
        """Standard deviation of the model's force [N], the scale of its errors: known before anything is measured."""
        return float(np.std(self.force))

    @property
    def steepness(self) -> NDArray[np.float64]:
        """Change of the model's force over 4 % of a cycle, per deviation."""
        reach = max(1, round(_REACH * mean_cycle(self.test)))
        padded = np.pad(self.force, reach, mode="edge")
        return np.asarray(np.abs(padded[2 * reach :] - padded[: -2 * reach]) / self.deviation)

    @property
    def phase(self) -> NDArray[np.float64]:
        """Where in its cycle the motion is, -pi to pi: the angle of displacement and velocity, each per its peak."""
        x = self.test.displacement[self.test.counted]
        v = self.test.velocity[self.test.counted]
        x = x - 0.5 * (x.max() + x.min())
        return np.asarray(np.arctan2(v / np.max(np.abs(v)), x / np.max(np.abs(x))))

    def _summary(self) -> Summary:
        error = float(np.sqrt(np.mean(self.residual**2)))
        return Summary(
            title=f"Prediction of {self.test.name}",
            facts=(
                ("fit", f"{100.0 * (1.0 - error / float(np.std(self.measured))):.2f} %"),
                ("error", f"{error:.4g} N rms, at most {float(np.abs(self.residual).max()):.4g} N"),
                ("samples", f"{self.force.size} compared of {self.test.n_time}"),
            ),
        )


def predict_test(
    spec: DamperSpec,
    theta: NDArray[np.float64],
    test: DamperTest,
    *,
    nuisances: tuple[NuisanceName, ...] = (),
) -> Prediction:
    """Simulate a test with parameters `theta`, shape (n_params,); what it raises is as for `judge`."""
    force, _ = free_run(spec, theta, test, nuisances=nuisances)
    return Prediction(test=test, model_force=force)


def mean_cycle(test: DamperTest) -> float:
    """Samples from one pass upwards through the middle of the stroke to the next, on average; all where it is one."""
    cycles = whole_cycles(test.displacement)
    return (cycles[-1].stop - cycles[0].start) / len(cycles) if cycles else float(test.n_time)


def has_regular_cycles(test: DamperTest) -> bool:
    """Whether the motion repeats itself: cycles alike within 5 % in length and 20 % in stroke."""
    x = test.displacement[test.counted]
    cycles = whole_cycles(x)
    if len(cycles) < 2:
        return False
    lengths = np.array([cycle.stop - cycle.start for cycle in cycles])
    strokes = np.array([np.ptp(x[cycle]) for cycle in cycles])
    # A cycle may be off by a sample at each end, however short it is.
    return bool(np.ptp(lengths) <= 0.05 * lengths.mean() + 2 and np.ptp(strokes) <= 0.2 * strokes.mean())
