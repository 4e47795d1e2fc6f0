"""Certificate of a weight design: rms values by Lyapunov equations, the bound of the dual, and what limits it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.control.design.limits import LimitedOutputs
from mrwork.control.design.lyapunov_equations import LyapunovEquations
from mrwork.control.design.riccati_dual import DualPoint
from mrwork.control.design.system import DesignSystem
from mrwork.errors import SettingError
from mrwork.summary import Summarised, Summary, rounded
from mrwork.values import holds_arrays

Floats = NDArray[np.float64]


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class CaseCheck(Summarised):
    """A case under two gains, by Lyapunov equations.

    `ratio` is the largest rms over its limit under the regulator of the case itself, which knows the state of the soil
    and of the driver, `forces` [N] its rms forces. `law_ratio` and `law_forces` are those of the one gain of the law on
    the state of the building; infinite if the loop is not stable.
    """

    name: str
    ratio: float
    forces: Floats
    law_ratio: float
    law_forces: Floats


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class WeightCertificate(Summarised):
    """What the weights reach, checked by Lyapunov equations, over a lower bound that no linear law passes.

    Parameters
    ----------
    names, units, limits
        The limited outputs.
    rms
        Of each output under the regulators of the weights, the root of the mean square over the cases.
    forces, budgets
        Rms wanted force of each device likewise, and its budget [N].
    ratio
        The largest rms over its limit.
    bound
        Least ratio of any linear law within the budget, from the dual.
    gap
        ratio / bound - 1.
    violation
        The largest excess of an output over `bound` times its limit, and of a force over its budget, relative.
    program_ratio
        Ratio of the semidefinite program before the refinement; `None` if it was not solved, or for modes only.
    cases
        Every case.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    limits: Floats
    rms: Floats
    forces: Floats
    budgets: Floats
    ratio: float
    bound: float
    gap: float
    violation: float
    program_ratio: float | None
    cases: tuple[CaseCheck, ...]

    @property
    def law_ratio(self) -> float:
        """The ratio under the gain of the law alone: root of the mean square over the cases."""
        return float(np.sqrt(np.mean([each.law_ratio**2 for each in self.cases])))

    @property
    def law_force(self) -> float:
        """The largest rms force over its budget under the gain of the law alone, likewise."""
        forces = np.sqrt(np.mean([each.law_forces**2 for each in self.cases], axis=0))
        return float(np.max(forces / self.budgets))

    @property
    def law_in_words(self) -> str:
        """What the gain of the law alone reaches, and with how much of the budget."""
        return f"ratio {self.law_ratio:.4g} with {self.law_force:.4g} of the budget, from the building's state only"

    def _summary(self) -> Summary:
        program = "" if self.program_ratio is None else f", {self.program_ratio:.6g} by the program"
        return Summary(
            title="Certificate of a weight design",
            facts=(
                ("ratio", f"{self.ratio:.6g}, at least {self.bound:.6g}{program}"),
                ("violation", f"{self.violation:.1e}"),
                ("law's gain", self.law_in_words),
            ),
            columns=("output", "unit", "rms", "limit", "rms / limit"),
            rows=[
                *(
                    (name, unit, rounded(rms), rounded(limit), rounded(rms / limit))
                    for name, unit, rms, limit in zip(
                        self.names, self.units, self.rms, self.limits, strict=True
                    )
                ),
                *(
                    (
                        f"force, device {number + 1}",
                        "N",
                        rounded(force),
                        rounded(budget),
                        rounded(force / budget),
                    )
                    for number, (force, budget) in enumerate(zip(self.forces, self.budgets, strict=True))
                ),
            ],
        )


def certificate_of(
    names: Sequence[str],
    systems: Sequence[DesignSystem],
    outputs: LimitedOutputs,
    budgets: Floats,
    point: DualPoint,
    law_gain: Floats,
    program_ratio: float | None,
) -> WeightCertificate:
    """Check the gains of a dual point, and the gain of the law [N per unit of s], in every case."""
    limits = outputs.limits
    squares, forces, cases = [], [], []
    for name, system, own in zip(names, systems, point.regulated, strict=True):
        y, u = _mean_squares(system, own.gain)
        try:
            law_y, law_u = _mean_squares(system, law_gain @ system.state)
        except SettingError:
            law_y, law_u = np.full(len(limits), np.inf), np.full(len(budgets), np.inf)
        squares.append(y)
        forces.append(u)
        cases.append(
            CaseCheck(
                name=name,
                ratio=float(np.sqrt(np.max(y / limits**2))),
                forces=np.sqrt(u),
                law_ratio=float(np.sqrt(np.max(law_y / limits**2))),
                law_forces=np.sqrt(law_u),
            )
        )
    rms, force = np.sqrt(np.mean(squares, axis=0)), np.sqrt(np.mean(forces, axis=0))
    ratio, bound = float(np.max(rms / limits)), float(np.sqrt(point.value))
    return WeightCertificate(
        names=outputs.names,
        units=outputs.units,
        limits=limits,
        rms=rms,
        forces=force,
        budgets=budgets,
        ratio=ratio,
        bound=bound,
        gap=ratio / bound - 1.0,
        violation=float(max(ratio / bound - 1.0, np.max(force / budgets) - 1.0, 0.0)),
        program_ratio=program_ratio,
        cases=tuple(cases),
    )


def _mean_squares(system: DesignSystem, gain: Floats) -> tuple[Floats, Floats]:
    """Mean squares of the outputs and of the wanted forces of `u = -gain x`."""
    X = LyapunovEquations(system.A - system.B @ gain, system.step).covariance(system.noise)
    closed = system.C - system.D @ gain
    return np.einsum("ij,jk,ik->i", closed, X, closed), np.einsum("ij,jk,ik->i", gain, X, gain)
