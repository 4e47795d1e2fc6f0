"""Sliding-mode laws."""

# `key` is a dataclass field with notes.

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
    """A sliding surface on which the energy of the building is least, held against motions of a stated size."""

    peak_acceleration: float = key("of the ground motions to be held", unit="m/s2", above=0.0)
    largest_force: float = key("of each damper", unit="N", above=0.0)
    frequency: float = key(
        "the highest at which the ground still has its peak", unit="Hz", default=5.0, above=0.0
    )
    margin: float = key("of the switching force over what it holds", default=1.2, above=1.0)
    bandwidth: float = key(
        "inside the boundary layer; below the driver's", unit="1/s", default=100.0, above=0.0
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
    # The loop signs the surface so that the force pushes it down.
    return {"gain": surface.drift, "surface": -surface.S, "boundary": gains.boundary}
