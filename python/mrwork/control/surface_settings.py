"""Settings of the sliding-mode laws, and their designs."""

# `key` is a dataclass field with notes.

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import checked
from mrwork.control.design_problem import Design, DesignProblem
from mrwork.control.setting_base import LawSettings, Span, attempted
from mrwork.control.sliding import SlidingGains, SlidingSurface, optimal_surface, sliding_gains
from mrwork.errors import SettingError
from mrwork.keys import key

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class _SurfaceSettings(LawSettings):
    """A sliding surface of least energy of the building, with gains for ground motions of a given peak."""

    peak_acceleration: float = key(
        "peak acceleration of the ground motions",
        unit="m/s2",
        above=0.0,
        span=Span(lower=0.01, upper=10.0, of=(("ground", 1.0),)),
    )
    largest_force: float = key(
        "largest force of each device with all its dampers",
        unit="N",
        above=0.0,
        span=Span(lower=0.1, upper=10.0, start=1.0, of=(("force", 1.0),), free=False),
    )
    frequency: float = key(
        "highest frequency at which the ground reaches its peak acceleration",
        unit="Hz",
        default=5.0,
        above=0.0,
        span=Span(lower=0.2, upper=20.0, free=False),
    )
    margin: float = key("switching force over the disturbance", default=1.2, above=1.0)
    bandwidth: float = key(
        "bandwidth inside the boundary layer; below that of the driver",
        unit="1/s",
        default=100.0,
        above=0.0,
        span=Span(lower=10.0, upper=180.0),
    )

    def design(self, problem: DesignProblem) -> Design:
        """Surface and gains."""
        return self.of_surface(problem, optimal_surface(problem.plant))

    @classmethod
    def designs(cls, problem: DesignProblem, many: Sequence[Self]) -> list[Design | SettingError]:
        """The designs of many settings, which share the surface: it is that of the building."""
        try:
            surface = optimal_surface(problem.plant)
        except SettingError as reason:
            return [reason for _ in many]
        return attempted(lambda settings: settings.of_surface(problem, surface), many)

    @abstractmethod
    def of_surface(self, problem: DesignProblem, surface: SlidingSurface) -> Design:
        """Surface and gains as those of the law."""

    def gains(self, surface: SlidingSurface) -> SlidingGains:
        """The gains of the laws on this surface."""
        return sliding_gains(
            surface,
            peak_acceleration=self.peak_acceleration,
            largest_force=self.largest_force,
            frequency=self.frequency,
            margin=self.margin,
            bandwidth=self.bandwidth,
        )


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingSettings(_SurfaceSettings):
    """A sliding mode with a boundary layer."""

    def of_surface(self, problem: DesignProblem, surface: SlidingSurface) -> Design:
        """Surface and gains."""
        gains = self.gains(surface)
        return Design(gains={**_pushed_down(surface, gains), "switching": gains.switching})


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptiveSlidingSettings(_SurfaceSettings):
    """A sliding mode whose gain adapts."""

    def of_surface(self, problem: DesignProblem, surface: SlidingSurface) -> Design:
        """Surface and gains."""
        gains = self.gains(surface)
        adapted = {"adaptation": gains.adaptation, "floor": gains.floor, "ceiling": gains.ceiling}
        return Design(gains={**_pushed_down(surface, gains), **adapted})


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class SuperTwistingSettings(_SurfaceSettings):
    """A second-order sliding mode."""

    def of_surface(self, problem: DesignProblem, surface: SlidingSurface) -> Design:
        """Surface and gains."""
        gains = self.gains(surface)
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
