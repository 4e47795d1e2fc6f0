"""Designs of sliding-mode laws."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.control.designs.problem import Design, DesignProblem
from mrwork.control.sliding import SlidingGains, SlidingSurface, optimal_surface, sliding_gains
from mrwork.keys import check_keys, key

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class _SurfaceSettings:
    """A sliding surface of least energy of the building, with gains for ground motions of a given peak."""

    peak_acceleration: float = key("peak acceleration of the ground motions", unit="m/s2", above=0.0)
    largest_force: float = key("largest force of each damper", unit="N", above=0.0)
    frequency: float = key(
        "highest frequency at which the ground reaches its peak acceleration",
        unit="Hz",
        default=5.0,
        above=0.0,
    )
    margin: float = key("switching force over the disturbance", default=1.2, above=1.0)
    bandwidth: float = key(
        "bandwidth inside the boundary layer; below that of the driver", unit="1/s", default=100.0, above=0.0
    )

    def __post_init__(self) -> None:
        check_keys(self)

    def _surface(self, problem: DesignProblem) -> tuple[SlidingSurface, SlidingGains]:
        surface = optimal_surface(problem.plant)
        gains = sliding_gains(
            surface,
            peak_acceleration=self.peak_acceleration,
            largest_force=self.largest_force,
            frequency=self.frequency,
            margin=self.margin,
            bandwidth=self.bandwidth,
        )
        return surface, gains


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingSettings(_SurfaceSettings):
    """A sliding mode with a boundary layer."""

    def design(self, problem: DesignProblem) -> Design:
        """Surface and gains."""
        surface, gains = self._surface(problem)
        return Design(gains={**_pushed_down(surface, gains), "switching": gains.switching})


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptiveSlidingSettings(_SurfaceSettings):
    """A sliding mode whose gain adapts."""

    def design(self, problem: DesignProblem) -> Design:
        """Surface and gains."""
        surface, gains = self._surface(problem)
        adapted = {"adaptation": gains.adaptation, "floor": gains.floor, "ceiling": gains.ceiling}
        return Design(gains={**_pushed_down(surface, gains), **adapted})


@dataclass(frozen=True, slots=True, kw_only=True)
class SuperTwistingSettings(_SurfaceSettings):
    """A second-order sliding mode."""

    def design(self, problem: DesignProblem) -> Design:
        """Surface and gains."""
        surface, gains = self._surface(problem)
        return Design(
            gains={
                "surface": surface.S,
                "drift": surface.drift,
                "push": problem.each(1.0),
                "root_gain": gains.proportional,
                "integral_gain": gains.integral,
            }
        )


def _pushed_down(surface: SlidingSurface, gains: SlidingGains) -> dict[str, Floats]:
    # In the loop the force decreases sigma, hence the sign.
    return {"gain": surface.drift, "surface": -surface.S, "boundary": gains.boundary}
