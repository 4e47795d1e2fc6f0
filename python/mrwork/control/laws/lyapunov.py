"""Lyapunov functions of a building, the vectors by which laws decrease them, and the settings of these laws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from mrwork.base.arguments import Threads, checked
from mrwork.base.keys import key, positive
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass
from mrwork.control.laws.law_problem import Design, DesignProblem, Span
from mrwork.control.laws.weights import CostWeights
from mrwork.control.linear.lqr import Regulator, Weights, regulators_of_costs
from mrwork.control.linear.plant import Plant
from mrwork.control.linear.riccati import attempt_each, lyapunov_solutions, only, solve_together
from mrwork.errors import SettingError


@array_dataclass(repr=False)
class LyapunovFunction(Summarised):
    """`V = s'P s / 2` with `V' = -s'Q_P s / 2 + sigma f`, `sigma = vectors @ s`; `weight` is Q_P.

    `vectors` are B'P, shape (n_devices, 2n): a device force decreases V faster if it is opposite in sign to sigma.
    """

    P: Floats
    weight: Floats
    vectors: Floats

    def value(self, state: ArrayLike) -> Floats:
        """V of each state, shape (n_time,) for states of shape (n_time, 2n); in J for the weight `plant.energy`."""
        states = np.asarray(state, dtype=np.float64)
        if states.ndim != 2 or states.shape[1] != len(self.P):
            raise SettingError(
                f"`state` has shape {states.shape}; give (n_time, {len(self.P)}), such as `History.state`"
            )
        return np.asarray(0.5 * np.einsum("ti,ij,tj->t", states, self.P, states))


@checked
def lyapunov_function(plant: Plant) -> LyapunovFunction:
    """Solve `A'P + P A = -Q_P` (Jansen & Dyke, J. Eng. Mech. 126(8), 2000, 795-803).

    Q_P is `plant.energy` [1/s], which is independent of the units of the coordinates. The paper leaves the choice open.

    Raises
    ------
    SettingError
        If a mode of the building without control is undamped.
    """
    return only(_lyapunov_functions(plant, [plant.energy], threads=1))


def _lyapunov_functions(
    plant: Plant, weights: Sequence[Floats], *, threads: Threads = 0
) -> list[LyapunovFunction | SettingError]:
    """The Lyapunov function of each weight Q_P, or the reason why none exists, by one call of the compiled solver."""
    A_z = np.linalg.solve(plant.scaling, plant.A @ plant.scaling)
    decay = -float(np.max(np.linalg.eigvals(A_z).real))
    noise = 1e-9 * float(np.linalg.norm(A_z, 2))
    if decay <= noise:
        # Of an undamped mode it is rounding, which differs between machines.
        undamped = SettingError(
            f"{plant.building.name} has a mode that decays at {decay if decay < -noise else 0.0:.2g} 1/s without "
            "control; a Lyapunov function needs damping in every mode"
        )
        return [undamped for _ in weights]
    solutions = lyapunov_solutions(plant.A, np.array(weights), scaling=plant.scaling, threads=threads)

    def function(row: int) -> LyapunovFunction:
        solutions.check(row)
        P = solutions.P[row]
        return LyapunovFunction(P=P, weight=weights[row], vectors=plant.B.T @ P)

    return attempt_each(function, range(len(weights)))


@checked
class LyapunovSettings(CostWeights):
    """A Lyapunov function; without weights of outputs or states its weight is the energy of the building.

    Weights of accelerations act on the accelerations without device forces: `V' = -s'Q_P s / 2 + sigma f` holds for any
    Q_P of the state alone.
    """

    weighed_by_default: ClassVar[Mapping[str, float]] = {"drifts": 1.0}

    @classmethod
    def solved(
        cls, problem: DesignProblem, many: Sequence[Self]
    ) -> Sequence[LyapunovFunction | Regulator | SettingError]:
        """What has the weight of the state of each, `vectors`: a Lyapunov function, all by one call of the solver."""
        weights = attempt_each(lambda settings: settings.weigh_outputs(problem).Q, many)
        return solve_together(lambda sound: _lyapunov_functions(problem.plant, sound), weights)

    def design_of(self, problem: DesignProblem, solution: LyapunovFunction | Regulator) -> Design:
        """The weight of the state, B'P, shape (n_devices, 2n)."""
        return Design(gains={"weight": solution.vectors})

    def certificate(self, problem: DesignProblem) -> str:
        """The Lyapunov function of the building."""
        return (
            "V = s'P s / 2 is a Lyapunov function of the building without device forces, and the law sends a command "
            "where that lowers the rate of V; a damper that resists motion keeps the energy of the building bounded"
        )


@checked
class ProportionalSettings(LyapunovSettings):
    """The smooth law kappa sigma G; with a control weight, sigma comes from a regulator with the same weights."""

    slope: float = key(
        "kappa [A or V, per unit of sigma G]; G is the slope of the force of a device with all its dampers",
        above=0.0,
        span=Span(
            lower=1e-3,
            upper=1e4,
            of=(("command", 2.0), ("force", -1.0), ("rate", -1.0), ("energy", 1.0), ("cost", -1.0)),
        ),
    )
    control_weight: Weights | None = positive(
        "R of that regulator; of the forces of devices with all their dampers",
        unit="1/N2",
        matrix=True,
        span=Span(lower=1e-6, upper=10.0, of=(("cost", 1.0), ("force", -2.0)), free=False),
    )

    @classmethod
    def solved(
        cls, problem: DesignProblem, many: Sequence[Self]
    ) -> Sequence[LyapunovFunction | Regulator | SettingError]:
        """A regulator of each with a control weight, a Lyapunov function of each without."""
        weighed = [(item, item.control_weight) for item in many if item.control_weight is not None]
        costs = attempt_each(lambda pair: (pair[0].weigh_outputs(problem), pair[1]), weighed)
        regulated = iter(regulators_of_costs(problem.plant, costs))
        free = iter(LyapunovSettings.solved(problem, [item for item in many if item.control_weight is None]))
        return [next(free if item.control_weight is None else regulated) for item in many]

    def design_of(self, problem: DesignProblem, solution: LyapunovFunction | Regulator) -> Design:
        """The weight of the state, and the slope of each device."""
        return Design(gains={"weight": solution.vectors, "slope": problem.each(self.slope)})
