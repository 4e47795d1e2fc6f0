"""Settings of the predictive rollout, a law that tries commands on its own model of the loop."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from mrwork.base.arguments import checked
from mrwork.base.keys import key, optional, positive
from mrwork.base.values import Floats
from mrwork.buildings.groups import commands_of
from mrwork.buildings.plane_building import Building
from mrwork.buildings.yielding import elastic_frame, with_factors
from mrwork.control.laws.control_law import LoopModel
from mrwork.control.laws.law_problem import Design, DesignProblem, LawSettings, Span
from mrwork.errors import InvalidSettingError

Forecast = Literal["autoregressive", "zero"]
Model = Literal["elastic", "building"]

LEVELS = (0.0, 0.08, 0.213, 0.426, 1.0)
"""Commands that are tried beside the base alone, as shares of the largest."""
_TAILS = (0.4, 2.0)
_FORGETTING, _COVARIANCE = 0.998, 100.0
# Seconds over which forces are compared, and the share of the mass whose inertia force at the reference
# acceleration counts.
_COMPARED, _COUNTED = 5.0, 0.04
# Peak rate of a device over the peak rate of a first mode at the reference drift.
_RATE = 3.0
_MOST_READINGS = 64


@checked
class RolloutSettings(LawSettings):
    """Commands that are tried on the law's own model of building and dampers, under a forecast of the ground motion.

    The model is the building with its dampers for which the law is designed, at the delay of the loop. All dampers take
    the command of the same number. Where base, drift or acceleration are left out, a study takes the best constant
    command of its training motions, and the mean peaks of drift and acceleration under it: peaks of the elastic frame
    for an elastic model, of the building itself for `model = "building"`.
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
        "weight of the peaks over the weight of the mean squares",
        default=1.0,
        least=0.0,
        span=Span(lower=0.2, upper=5.0, start=1.0, free=False),
    )
    energy_weight: float = key(
        "weight of the energy at the horizon, over the energy of the lowest storey at the reference drift",
        default=0.3,
        least=0.0,
        span=Span(lower=0.05, upper=2.0, start=0.3, free=False),
    )
    residual_weight: float = key(
        "weight of the square of the largest drift that storeys which yield keep at the horizon, over the square of "
        "the reference drift",
        default=0.0,
        least=0.0,
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
    order: int = key("readings that the forecast combines", default=4, least=1, most=_MOST_READINGS)
    model: Model = key(
        "building of the law: elastic, by its matrices alone, or the building with storeys that yield, passive "
        "elements and P-delta",
        default="elastic",
    )
    believed_stiffness: float = positive(
        "stiffness that the law believes, over the stiffness of the building", default=1.0
    )
    believed_yield_drift: float = positive(
        "yield drifts that the law believes, over the yield drifts of the building", default=1.0
    )
    believed_post_yield: float = positive(
        "post-yield ratio that the law believes, over the ratio of the building", default=1.0
    )
    shear_offsets: bool = key(
        "whether what measured accelerations and forces say beyond the model goes into the trials as constant forces",
        default=False,
    )
    adaptation: float = key(
        "rate at which yield drifts of the model follow the measured shears of storeys that yield; 0 for none, 10 "
        "where yield drifts are uncertain",
        unit="1/s",
        default=0.0,
        least=0.0,
    )
    adaptation_least: float = positive("least factor of an adapted yield drift", default=0.6, most=1.0)
    adaptation_most: float = key("largest factor of an adapted yield drift", default=1.6, least=1.0)
    decision: float = positive(
        "time from one decision to the next, a whole number of samples", unit="s", default=0.01
    )
    step: float | None = positive(
        "longest step of the model; by default 2.5 ms, or finer where the dampers are stiff", unit="s"
    )

    def design(self, problem: DesignProblem) -> Design:
        """Gains and tables of the prediction: commands to try, weights over the reference peaks, and timing."""
        base, drift, acceleration = self._references(problem)
        building = self._believed(problem)
        samples = round(self.decision / problem.sample_time)
        if samples < 1 or abs(samples * problem.sample_time - self.decision) > 1e-6 * problem.sample_time:
            raise InvalidSettingError(
                "decision",
                f"decision is {self.decision:g} s, which is not a whole number of samples of "
                f"{problem.sample_time:g} s; give a multiple of them",
            )
        if self.residual_weight and not any(element.in_stiffness for element in building.elements):
            raise InvalidSettingError(
                "residual_weight",
                "residual_weight has no effect where no storey of the law's model yields; leave it out, or set "
                "`model` to 'building' for a frame that yields",
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
                "residual_weight": np.array([self.residual_weight / drift**2]),
            },
            tables={
                "timing": np.array([self.decision, self.step or 0.0, problem.delay, rate, first * rate]),
                "forecast": np.array([order, _FORGETTING, _COVARIANCE]),
                "correction": np.array([_COMPARED, _COUNTED * building.reference_mass]),
                "shears": np.array(
                    [float(self.shear_offsets), self.adaptation, self.adaptation_least, self.adaptation_most]
                ),
            },
        )

    def loop_model(self, problem: DesignProblem) -> LoopModel:
        """The building that the law believes in, with every device of the problem."""
        return LoopModel(building=self._believed(problem), devices=problem.all_devices)

    def notes(self, problem: DesignProblem, design: Design) -> tuple[str, ...]:
        """Which frame the references are of, where it yields and the study has found them."""
        frame = problem.building
        if None not in (self.base, self.drift, self.acceleration) or elastic_frame(frame) is frame:
            return ()
        which = "elastic frame" if self.model == "elastic" else "frame that yields"
        return (f"Base command and reference peaks belong to the {which}, as its model does.",)

    def _believed(self, problem: DesignProblem) -> Building:
        """The building of the model."""
        believed = with_factors(
            problem.building,
            stiffness=self.believed_stiffness,
            yield_drift=self.believed_yield_drift,
            post_yield=self.believed_post_yield,
        )
        if not (believed.elements or believed.loads.any()):
            return believed
        if self.model == "elastic":
            return replace(believed, elements=(), loads=np.empty(0))
        # The matrices have all of the others.
        return replace(
            believed, elements=tuple(element for element in believed.elements if not element.is_linear)
        )

    def _references(self, problem: DesignProblem) -> tuple[Floats, float, float]:
        """Base command of each device, reference drift and acceleration: given, or else from the problem."""
        settings = {"base": self.base, "drift": self.drift, "acceleration": self.acceleration}
        missing = [name for name, value in settings.items() if value is None]
        if missing and problem.reference_peaks is None:
            raise InvalidSettingError(
                missing[0],
                f"predictive_rollout has no {missing[0]}, and the problem no training motions to take it from; give it",
            )
        base = commands_of(problem.devices, self.base or 0.0, "base")
        drift, acceleration = self.drift, self.acceleration
        if missing and problem.reference_peaks is not None:
            peaks = problem.reference_peaks(self.model == "elastic")
            drift, acceleration = drift or peaks.drift, acceleration or peaks.acceleration
            if self.base is None:
                # A limited problem has smaller largest commands than that under which the reference was found.
                base = np.minimum(peaks.commands, [device.largest_command for device in problem.devices])
        return base, float(drift or 1.0), float(acceleration or 1.0)
