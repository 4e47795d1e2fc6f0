"""Laws on a Lyapunov function of the building."""

# `key` is a dataclass field with notes.

from __future__ import annotations

from dataclasses import dataclass

from mrwork.control.designs.problem import Design, DesignProblem
from mrwork.control.lqr import regulator_of_state
from mrwork.control.lyapunov import lyapunov_function
from mrwork.keys import check_keys, key


@dataclass(frozen=True, slots=True, kw_only=True)
class LyapunovSettings:
    """A Lyapunov function, whose weight is the energy of the building if not given."""

    state_weight: tuple[float, ...] | None = key(
        "diagonal of Q_P over displacements, then velocities of the coordinates", default=None, least=0.0
    )

    def __post_init__(self) -> None:
        check_keys(self)

    def design(self, problem: DesignProblem) -> Design:
        """Weight of the state."""
        return Design(gains={"weight": lyapunov_function(problem.plant, self.state_weight).vectors})


@dataclass(frozen=True, slots=True, kw_only=True)
class ProportionalSettings(LyapunovSettings):
    """The smooth law: kappa times sigma G; with a control weight sigma is that of a regulator of the energy."""

    slope: float = key("kappa [A or V, per unit of sigma G]", above=0.0)
    control_weight: float | None = key("R of that regulator [1/N2]", default=None, above=0.0)

    def design(self, problem: DesignProblem) -> Design:
        """Weight of the state, and the slope of each device."""
        plant = problem.plant
        if self.control_weight is None:
            weight = lyapunov_function(plant, self.state_weight).vectors
        else:
            state_weight = plant.energy if self.state_weight is None else self.state_weight
            weight = regulator_of_state(plant, state_weight, self.control_weight).vectors
        return Design(gains={"weight": weight, "slope": problem.each(self.slope)})
