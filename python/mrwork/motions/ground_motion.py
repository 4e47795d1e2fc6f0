"""Ground motion: horizontal acceleration of the ground, sampled uniformly."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import AnyNumbers, May, checked
from mrwork.errors import RecordError
from mrwork.keys import SMALLEST
from mrwork.summary import Summarised, Summary
from mrwork.values import holds_arrays, keep_arrays


@checked
@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class GroundMotion(Summarised):
    """Ground acceleration [m/s^2], shape (n_time,), every `dt` [s], linear between samples.

    `source` states its origin; `changes` lists the processing since, in order. `groups` name what it has in common with
    others, such as its soil; tables of a study have the score of each group.

    Raises
    ------
    RecordError
        If there are fewer than two samples, a value is not finite, or the step is not positive.
    """

    _made_by: ClassVar[str] = "mr.read_motion(path)"

    name: str
    dt: Annotated[float, May.BE_INFINITE, May.BE_NAN]
    acceleration: AnyNumbers
    source: str = ""
    changes: tuple[str, ...] = ()
    groups: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        keep_arrays(self, "acceleration")
        if self.acceleration.ndim != 1 or self.acceleration.size < 2:
            raise RecordError(
                f"ground motion {self.name}: a record of {self.acceleration.size} samples; give two or more"
            )
        if not np.isfinite(self.acceleration).all():
            first = int(np.flatnonzero(~np.isfinite(self.acceleration))[0])
            raise RecordError(f"ground motion {self.name}: sample {first} is not a finite number")
        if not (np.isfinite(self.dt) and self.dt >= SMALLEST):
            raise RecordError(f"ground motion {self.name}: its step is {self.dt} s; give a positive number")

    @property
    def n_time(self) -> int:
        """Number of samples."""
        return self.acceleration.size

    @property
    def peak(self) -> float:
        """Peak ground acceleration [m/s^2]."""
        return float(np.abs(self.acceleration).max())

    @property
    def duration(self) -> float:
        """Time from the first sample to the last [s]."""
        return self.dt * (self.acceleration.size - 1)

    @property
    def time(self) -> NDArray[np.float64]:
        """Times of the samples [s], shape (n_time,), the first at zero."""
        return self.dt * np.arange(self.n_time, dtype=np.float64)

    @property
    def velocity(self) -> NDArray[np.float64]:
        """Ground velocity [m/s], shape (n_time,), from rest: exact integral of the piecewise linear acceleration."""
        a = self.acceleration
        return np.concatenate(([0.0], np.cumsum(0.5 * self.dt * (a[:-1] + a[1:]))))

    @property
    def displacement(self) -> NDArray[np.float64]:
        """Ground displacement [m], shape (n_time,), from rest at zero, integrated exactly as `velocity`.

        Records do not preserve the baseline, so it drifts unless the motion was corrected (`baseline_corrected`).
        """
        a, h = self.acceleration, self.dt
        steps = h * self.velocity[:-1] + h * h * (2.0 * a[:-1] + a[1:]) / 6.0
        return np.concatenate(([0.0], np.cumsum(steps)))

    def _summary(self) -> Summary:
        return Summary(
            title=f"Ground motion {self.name}",
            facts=(
                ("peak", f"{self.peak:.4g} m/s^2"),
                ("duration", f"{self.duration:.5g} s, {self.n_time} samples every {self.dt:.6g} s"),
                ("source", self.source),
                ("changes", "; ".join(self.changes) or "none"),
            ),
        )


def changed(motion: GroundMotion, acceleration: NDArray[np.float64], dt: float, change: str) -> GroundMotion:
    """Return the motion with other samples and one more entry in `changes`."""
    return replace(motion, acceleration=acceleration, dt=dt, changes=(*motion.changes, change))
