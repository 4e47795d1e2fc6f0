"""Settings of the predictive rollout, a law that tries commands on its own model of the loop."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from mrwork.base.arguments import checked
from mrwork.base.keys import key, optional, positive
from mrwork.base.values import Floats
from mrwork.buildings.groups import commands_of
from mrwork.control.laws.law_problem import Design, DesignProblem, LawSettings, Span
from mrwork.errors import InvalidSettingError

Forecast = Literal["autoregressive", "zero"]

LEVELS = (0.0, 0.08, 0.213, 0.426, 1.0)
"""Commands that are tried beside the base alone, as shares of the largest."""
_TAILS = (0.4, 2.0)
_FORGETTING, _COVARIANCE = 0.998, 100.0
# Seconds over which forces are compared, and the share of the mass whose inertia force at the reference
# acceleration counts.
_COMPARED, _COUNTED = 5.0, 0.04
# Peak rate of a device over that of a first mode at the reference drift.
_RATE = 3.0
_MOST = 64


@checked
class RolloutSettings(LawSettings):
    """Commands that are tried on the law's own model of building and dampers, under a forecast of the ground motion.

    The model is the building with its dampers for which the law is designed, at the delay of the loop. All dampers take
    the command of the same number. Where base, drift or acceleration are left out, a study takes the best constant
    command of its training motions, and the mean peaks of drift and acceleration under it.
    """

    chooses_levels: ClassVar[bool] = True

    base: float | tuple[float, ...] | None = optional(
        "command that follows every tried one in the prediction, or one for each [[damper]]; it wins ties",
        unit="A or V",
        least=0.0,
        span=Span(lower=0.0, upper=1.0, of=(("command", 1.0),), scale="linear"),
    )
    drift: float | None = positive(
        "reference drift D",
        unit="m",
        span=Span(
            lower=0.3,
            upper=3.0,
            start=1.0,
            of=(("constant_drift", 1.0),),
            free=False,
            held="only the ratio of acceleration to it matters; free acceleration",
        ),
    )
    acceleration: float | None = positive(
        "reference acceleration A",
        unit="m/s2",
        span=Span(lower=0.5, upper=2.0, start=1.0, of=(("constant_acceleration", 1.0),)),
    )
    levels: float = positive(
        "factor of the tried commands, which are 0, 0.08, 0.213, 0.426 and 1 of the largest",
        default=1.0,
        most=1.0,
        span=Span(lower=0.2, upper=1.0, start=1.0, scale="linear", free=False),
    )
    horizon: float = positive(
        "time that a prediction covers, at most 1 s",
        unit="s",
        default=0.24,
        most=1.0,
        span=Span(lower=0.1, upper=0.4, start=0.24, scale="linear"),
    )
    peak_weight: float = key(
        "weight of the peaks over that of the mean squares",
        default=1.0,
        least=0.0,
        span=Span(lower=0.2, upper=5.0, start=1.0, free=False),
    )
    energy_weight: float = key(
        "weight of the energy at the horizon, over that of the lowest storey at the reference drift",
        default=0.3,
        least=0.0,
        span=Span(lower=0.05, upper=2.0, start=0.3, free=False),
    )
    force_correction: float = key(
        "share of the error of the model force that the measured force corrects, from 0 to 1",
        default=0.0,
        least=0.0,
        most=1.0,
        span=Span(lower=0.0, upper=1.0, start=0.0, scale="linear", free=False),
    )
    forecast: Forecast = key(
        "ground acceleration of the prediction: autoregressive, from its sensor, or zero",
        default="autoregressive",
    )
    order: int = key("readings that the forecast combines", default=4, least=1, most=_MOST)
    decision: float = positive(
        "time from one decision to the next, a whole number of samples", unit="s", default=0.01
    )
    step: float | None = positive(
        "longest step of the model; by default 2.5 ms, or finer where the dampers are stiff", unit="s"
    )

    def design(self, problem: DesignProblem) -> Design:
        """The numbers of the prediction."""
        base, drift, acceleration = self._references(problem)
        building = problem.building
        samples = round(self.decision / problem.sample_time)
        if samples < 1 or abs(samples * problem.sample_time - self.decision) > 1e-6 * problem.sample_time:
            raise InvalidSettingError(
                "decision",
                f"decision is {self.decision:g} s, which is not a whole number of samples of "
                f"{problem.sample_time:g} s; give a multiple of them",
            )
        row = building.drifts[0]
        # Of a shear frame, the stiffness of its lowest storey.
        stiffness = 1.0 / float(row @ np.linalg.solve(building.stiffness, row))
        first = 2.0 * np.pi * float(building.frequencies[0])
        rate = _RATE * first * drift
        order = self.order if self.forecast == "autoregressive" else 0
        commands = np.array([[device.largest_command] for device in problem.devices])
        return Design(
            gains={
                "base": base,
                "tails": np.minimum(base[:, None] * _TAILS, commands),
                "levels": self.levels * np.array(LEVELS) * commands,
                "drift_weight": np.array([drift**-2]),
                "acceleration_weight": np.array([acceleration**-2]),
                "peak_weight": np.array([self.peak_weight]),
                "energy_weight": np.array([self.energy_weight / (stiffness * drift**2)]),
                "horizon": np.array([self.horizon]),
                "force_correction": np.array([self.force_correction]),
            },
            tables={
                "timing": np.array([self.decision, self.step or 0.0, problem.delay, rate, first * rate]),
                "forecast": np.array([order, _FORGETTING, _COVARIANCE]),
                "correction": np.array([_COMPARED, _COUNTED * building.total_mass]),
            },
        )

    def _references(self, problem: DesignProblem) -> tuple[Floats, float, float]:
        """Base command of each device, reference drift and acceleration: those given, else those of the problem."""
        given = {"base": self.base, "drift": self.drift, "acceleration": self.acceleration}
        missing = [name for name, value in given.items() if value is None]
        if missing and problem.reference_peaks is None:
            raise InvalidSettingError(
                missing[0],
                f"predictive_rollout has no {missing[0]}, and the problem no training motions to take it from; give it",
            )
        known = problem.reference_peaks() if missing and problem.reference_peaks is not None else None
        base = commands_of(problem.devices, self.base or 0.0, "base")
        if known is None:
            return base, float(self.drift or 1.0), float(self.acceleration or 1.0)
        if self.base is None:
            # A limited problem has smaller largest commands than that under which the reference was found.
            base = np.minimum(known.commands, [each.largest_command for each in problem.devices])
        return (
            base,
            known.drift if self.drift is None else self.drift,
            known.acceleration if self.acceleration is None else self.acceleration,
        )
