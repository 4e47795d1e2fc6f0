"""Weights among the settings of a law, of a regulator or a Lyapunov function: given ones, or designed from limits."""

# `_declare_weight` is a dataclass field with notes.
# ruff: noqa: RUF009  # see the line above

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from functools import reduce
from typing import Any, Literal

import numpy as np
import scipy

from mrwork.base.arguments import checked
from mrwork.base.keys import key, keys_of, optional, positive
from mrwork.base.numbers import of_unit
from mrwork.base.values import Floats
from mrwork.control.laws.design_ground import damper_forces, forces_in_words, ground_of, source_in_words
from mrwork.control.laws.law_problem import DesignProblem, Magnitude, Magnitudes, SolvedSettings, Span
from mrwork.control.linear.lqr import Weighed, Weights, weighed_outputs, weighed_state, weight_matrix
from mrwork.control.linear.plant import (
    Outputs,
    Plant,
    accelerations,
    deformation_rates,
    displacements,
    drifts,
    relative_velocities,
    stack_outputs,
    velocities,
)
from mrwork.control.weights.limits import RmsLimits, SemiActiveCondition, as_forces
from mrwork.control.weights.system import useful_force
from mrwork.control.weights.weight_certificate import DesignedWeights
from mrwork.control.weights.weight_solver import design_weights
from mrwork.errors import InvalidSettingError, SettingError
from mrwork.motions.spectral_density import (
    CloughPenzien,
    KanaiTajimi,
    SpectralDensity,
    fitted_spectrum,
    ground_in_words,
    with_intensity,
)


@checked
class WeightWishes(RmsLimits):
    """Weights of a law from limits on rms responses and a budget of force, see `design_weights`.

    They are scaled such that control_weight = 1 is R as designed; scan the size of R in the true loop, or with
    semi_active the budget by budget_scale. By default the ground has strength and spectrum of the training motions of
    the study, see `stationary_ground`, and the budget follows from the force of its dampers; the output states both.
    """

    budget: float | tuple[float, ...] | None = positive(
        "largest rms desired force of each device with all its dampers; by default a third of their largest force at "
        "their largest command, over their tested range, and at most a fifth of the inertia of the building",
        unit="N",
    )
    spectrum: Literal["kanai_tajimi", "clough_penzien"] = key(
        "spectrum of the ground acceleration", default="kanai_tajimi"
    )
    ground_frequency: float | None = optional(
        "frequency of the ground, by default of the training motions", unit="rad/s", least=1e-3, most=1e4
    )
    ground_damping: float | None = optional(
        "damping ratio of the ground, by default of the training motions", least=1e-4, most=1e3
    )
    intensity: float | None = positive(
        "two-sided spectral density of the bedrock, by default that with the mean square of the training motions; only "
        "the budget over its root matters",
        unit="m2/s3",
    )
    record: str | None = optional(
        "record to which the spectrum is fitted instead, relative to the study file"
    )
    semi_active: float | None = positive(
        "share b of the condition that a damper can exert the desired force, between 0 and 1; the budget decides the "
        "law then, R hardly matters"
    )

    def of_problem(self, problem: DesignProblem, budget_scale: float = 1.0) -> DesignedWeights:
        """The weights for a building with its devices, with `budget_scale` times the budget; the problem keeps them."""
        return problem._keep((self, budget_scale), lambda: self._design(problem, budget_scale))

    def _design(self, problem: DesignProblem, budget_scale: float) -> DesignedWeights:
        plant = problem.plant
        spectrum, source = self._find_ground(problem)
        ground = f"Ground: {ground_in_words(spectrum)}; {source}."
        forces, budget = self._budgets(problem, spectrum)
        if budget_scale != 1.0:
            budget = f"{budget} Times the budget_scale, {budget_scale:g}."
        designed = design_weights(
            plant.building,
            plant.attachment,
            limits={
                entry.name: value
                for entry in keys_of(RmsLimits)
                if (value := getattr(self, entry.name)) is not None
            },
            budget=(budget_scale * forces).tolist(),
            spectrum=spectrum,
            semi_active=None if self.semi_active is None else SemiActiveCondition(share=self.semi_active),
        )
        return replace(designed, origin=(ground, budget))

    def _budgets(self, problem: DesignProblem, spectrum: SpectralDensity) -> tuple[Floats, str]:
        if self.budget is not None:
            forces = as_forces(self.budget, problem.plant)
            return forces, f"Budget: {_newtons(forces)} rms, as given."
        available = damper_forces(problem, spectrum)
        if not (available.budgets > 0.0).all():
            raise InvalidSettingError(
                "budget",
                "the dampers have no force at their largest command, which would be the budget; give one",
            )
        source = f"a third of {forces_in_words(problem.whole.devices, available)}; a peak counts as three times the rms"
        useful = useful_force(problem.plant, spectrum)
        if useful < available.budgets.max():
            budgets = np.minimum(available.budgets, useful)
            return budgets, (
                f"Budget: {_newtons(budgets)} rms, a fifth of the inertia of the building under this ground, for more "
                f"is of no use; the dampers give {_newtons(available.budgets)}, {source}."
            )
        return available.budgets, f"Budget: {_newtons(available.budgets)} rms, {source}."

    def _find_ground(self, problem: DesignProblem) -> tuple[SpectralDensity, str]:
        """Spectrum of the ground, given or fitted to the record or the motions of a problem, and its origin."""
        numbers = {
            name: getattr(self, name)
            for name in ("ground_frequency", "ground_damping", "intensity")
            if getattr(self, name) is not None
        }
        if self.record is not None:
            if numbers:
                raise InvalidSettingError(
                    "record", "the spectrum is fitted to the record, or given by its numbers; keep one"
                )
            from mrwork.motions.read import read_motion

            motion = read_motion(self.record)
            return fitted_spectrum(motion, self.spectrum), f"fitted to the record {motion.name}, as asked"
        if len(numbers) == 3 or not problem.motions:
            soil = KanaiTajimi(**{name.removeprefix("ground_"): value for name, value in numbers.items()})
            firm = "firm soil of about 0.3 g, since no motion of a study is known"
            text = f"with {', '.join(numbers)} as given" if numbers else ""
            source = "as given" if len(numbers) == 3 else ", ".join(filter(None, (firm, text)))
            return soil if self.spectrum == "kanai_tajimi" else CloughPenzien(soil=soil), source
        try:
            design_ground = ground_of(problem, self.spectrum, self.ground_frequency, self.ground_damping)
        except SettingError as error:
            raise SettingError(
                f"{error}; or give designed its ground_frequency, ground_damping and intensity"
            ) from error
        spectrum, source = design_ground.spectrum, source_in_words(problem)
        if self.intensity is not None:
            spectrum = with_intensity(spectrum, self.intensity)
        if numbers:
            source += f", with {', '.join(numbers)} as given"
        if design_ground.narrow:
            source += (
                "; the motions are nearly harmonic, and the noise has their strength, not their shape: judge limits by "
                "the responses of the study"
            )
        return spectrum, source


def _newtons(forces: Floats) -> str:
    return ", ".join(dict.fromkeys(of_unit(float(force), "N") for force in forces))


def _declare_weight(says: str, unit: str = "", of: Magnitude | None = None, *, free: bool = False) -> Any:
    """Declare the key of a weight: one number, one for each, or a matrix.

    A search looks for the weight of a quantity of magnitude `of` where its cost is comparable to the cost of the
    weights that are held.
    """
    span = None if of is None else Span(lower=1e-4, upper=1e2, of=(("cost", 1.0), (of, -2.0)), free=free)
    return optional(says, unit=unit, least=0.0, matrix=True, span=span)


@dataclass(frozen=True, slots=True, kw_only=True)
class CostWeights(SolvedSettings):
    """Weights of outputs and state; what several of them add to the cost is summed.

    Each weight is one number for all floors, storeys, devices or states, one for each, or a symmetric matrix; without
    any, the energy of the building is weighed. One number for all storeys leaves isolators free to move.
    """

    accelerations: Weights | None = _declare_weight(
        "weights of absolute floor accelerations", "s4/m2", "acceleration", free=True
    )
    drifts: Weights | None = _declare_weight("weights of drifts", "1/m2", "drift")
    displacements: Weights | None = _declare_weight("weights of floor displacements", "1/m2", "displacement")
    velocities: Weights | None = _declare_weight(
        "weights of floor velocities", "s2/m2", "velocity", free=True
    )
    relative_velocities: Weights | None = _declare_weight(
        "weights of the rates of drifts, velocities of storeys between their ends", "s2/m2", "rate"
    )
    rates: Weights | None = _declare_weight(
        "weights of the velocities across the devices; alone they ask for the force of dashpots",
        "s2/m2",
        "rate",
        free=True,
    )
    state_weight: Weights | None = _declare_weight(
        "weights of the state: displacements, then velocities of the coordinates; Q, or Q_P of a Lyapunov function"
    )
    energy: float | None = positive("weight of twice the energy of the building", unit="1/J")
    designed: WeightWishes | None = optional(
        "weights designed from limits on rms responses and a budget of force, instead of any others"
    )
    budget_scale: float = positive(
        "factor of the budget of designed weights; with semi_active it is searched instead of R",
        default=1.0,
        span=Span(lower=0.1, upper=10.0, free=False),
    )

    def weigh_outputs(self, problem: DesignProblem) -> Weighed:
        """The sum of what the weights add to the cost."""
        if self.designed is not None:
            return self._weigh_designed(self.designed, problem)
        if self.budget_scale != 1.0:
            raise InvalidSettingError(
                "budget_scale",
                "budget_scale is a factor of the budget of designed weights; give designed, or leave it out",
            )
        plant = problem.plant
        pairs: list[tuple[Outputs, Floats]] = []
        for name, make, noun, _ in _OUTPUTS:
            weights = getattr(self, name)
            if weights is not None:
                outputs = make(plant)
                if noun == "storeys" and isinstance(weights, int | float):
                    pairs_of = zip(outputs.names, plant.building.isolates, strict=True)
                    outputs = outputs.select([output for output, isolates in pairs_of if not isolates])
                pairs.append((outputs, weight_matrix(name, weights, len(outputs.names), noun)))
        parts = []
        if pairs:
            W = scipy.linalg.block_diag(*(weights for _, weights in pairs))
            parts.append(weighed_outputs(stack_outputs(*(outputs for outputs, _ in pairs)), W))
        if self.state_weight is not None:
            parts.append(weighed_state(plant, self.state_weight))
        if not parts:
            return weighed_state(plant, (self.energy or 1.0) * plant.energy)
        if self.energy is not None:
            first = next(name for name in self._names() if getattr(self, name) is not None)
            raise InvalidSettingError(
                "energy", f"the law weighs the energy, or outputs such as {first}; keep one"
            )
        return Weighed(
            Q=reduce(np.add, (part.Q for part in parts)),
            N=reduce(np.add, (part.N for part in parts)),
            S=reduce(np.add, (part.S for part in parts)),
        )

    def _weigh_designed(self, wishes: WeightWishes, problem: DesignProblem) -> Weighed:
        """Cost of designed weights, scaled such that the mean control weight is 1 as designed."""
        for name in (*self._names(), "energy"):
            if getattr(self, name) is not None:
                raise InvalidSettingError("designed", f"the law has designed weights, and {name}; keep one")
        designed = wishes.of_problem(problem, self.budget_scale)
        scale = 1.0 / float(designed.control_weight.mean())
        S = designed.R - np.diag(designed.control_weight)
        return Weighed(Q=scale * designed.Q, N=scale * designed.N, S=scale * S)

    def weights(self, problem: DesignProblem) -> DesignedWeights | None:
        """The designed weights, if the law has any."""
        return None if self.designed is None else self.designed.of_problem(problem, self.budget_scale)

    @classmethod
    def weight_names(cls) -> frozenset[str]:
        """Names of the settings that are weights of outputs or states."""
        return frozenset(field.name for field in fields(CostWeights)) - {"budget_scale"}

    @classmethod
    def cost(cls, held: Mapping[str, Any], magnitudes: Magnitudes) -> float:
        """Cost of the weights among held settings at these magnitudes; weights of single floors are averaged."""
        weights = cls.weights_among(held)
        if "designed" in weights:
            # Of these weights R is 1 as designed.
            return magnitudes.force**2
        costs = 0.0
        for name, value in (weights or {"energy": 1.0}).items():
            if name in _MAGNITUDES:
                entries = np.asarray(value, dtype=np.float64)
                weight = float(np.trace(entries) / len(entries) if entries.ndim == 2 else entries.mean())
                size = float(getattr(magnitudes, _MAGNITUDES[name]))
                costs += weight * (size if name == "energy" else size**2)
        return costs or magnitudes.energy

    def _names(self) -> tuple[str, ...]:
        return (*(name for name, *_ in _OUTPUTS), "state_weight")


_OUTPUTS: tuple[tuple[str, Callable[[Plant], Outputs], str, Magnitude], ...] = (
    ("accelerations", accelerations, "floors", "acceleration"),
    ("drifts", drifts, "storeys", "drift"),
    ("displacements", displacements, "floors", "displacement"),
    ("velocities", velocities, "floors", "velocity"),
    ("relative_velocities", relative_velocities, "storeys", "rate"),
    ("rates", deformation_rates, "devices", "rate"),
)
"""Settings of outputs, the outputs, what they belong to, and its magnitude."""
_MAGNITUDES = {"energy": "energy"} | {name: magnitude for name, _, _, magnitude in _OUTPUTS}
