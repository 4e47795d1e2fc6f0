"""Weights of outputs and states in the cost of a regulator or in a Lyapunov function."""

# `key` is a dataclass field with notes.
# ruff: noqa: RUF009

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from mrwork.control.design.wishes import WeightWishes
from mrwork.control.design_problem import DesignProblem
from mrwork.control.plant import (
    Outputs,
    Plant,
    accelerations,
    deformation_rates,
    displacements,
    drifts,
    relative_velocities,
    stacked,
    velocities,
)
from mrwork.control.setting_base import Magnitude, Magnitudes, Span
from mrwork.errors import InvalidSettingError
from mrwork.keys import key
from mrwork.values import holds_arrays

Floats = NDArray[np.float64]
Rows = tuple[tuple[float, ...], ...]
"""A matrix, row by row."""
Weights = float | tuple[float, ...] | Rows
"""One weight for all entries, a weight for each, or a symmetric matrix."""

_SMALLEST = 1e-9


def weight_matrix(name: str, given: ArrayLike, size: int, each: str) -> Floats:
    """A weight as a symmetric positive semidefinite matrix, shape (size, size).

    Parameters
    ----------
    name
        Name of the weight in messages.
    given
        One number for all entries, one for each, shape (size,), or a matrix.
    each
        What the entries belong to, such as "storeys"; for messages.
    """
    try:
        value = np.asarray(given, dtype=np.float64)
    except ValueError:
        raise InvalidSettingError(
            name, f"{name} has rows of different lengths; give {size} rows of {size}"
        ) from None
    if value.ndim == 0:
        value = np.full(size, float(value))
    matrix = np.diag(value) if value.ndim == 1 else value
    if matrix.shape != (size, size):
        count = f"{size} {each}" if size > 1 else f"1 {each.removesuffix('s')}"
        found = (
            f"{value.size} weight{'s' if value.size > 1 else ''}"
            if value.ndim == 1
            else f"shape {value.shape}"
        )
        raise InvalidSettingError(
            name,
            f"{name} has {found}, and there {'are' if size > 1 else 'is'} {count}; give one for each, or one for all, "
            f"or a symmetric {size} x {size} matrix",
        )
    if not np.isfinite(matrix).all():
        raise InvalidSettingError(name, f"{name} holds a value that is not a finite number")
    scale = np.sqrt(np.abs(np.diag(matrix)))
    # Checked with a unit diagonal, since the rows of a weight may have different units.
    divisor = np.where(scale > 0.0, scale, 1.0)
    scaled = matrix / np.outer(divisor, divisor)
    asymmetry = np.abs(scaled - scaled.T)
    if not np.all(asymmetry <= _SMALLEST * np.maximum(1.0, np.abs(scaled))):
        row, column = np.unravel_index(int(asymmetry.argmax()), asymmetry.shape)
        raise InvalidSettingError(
            name,
            f"{name} is not symmetric: row {row + 1}, column {column + 1} is {matrix[row, column]:g} and row "
            f"{column + 1}, column {row + 1} is {matrix[column, row]:g}; give a symmetric matrix",
        )
    smallest = float(np.linalg.eigvalsh(0.5 * (scaled + scaled.T))[0])
    if smallest < -_SMALLEST:
        raise InvalidSettingError(
            name,
            f"{name} is not positive semidefinite: with a unit diagonal its smallest eigenvalue is {smallest:.3g}; "
            "give weights that are not negative, and a matrix without negative eigenvalues",
        )
    return 0.5 * (matrix + matrix.T)


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class Weighed:
    """What the weights add up to over a state s and device forces f: `s'Q s + 2 s'N f + f'S f`.

    Outputs y = C s + D f with weight W add `Q = C'W C`, `N = C'W D`, `S = D'W D`; N and S are zero unless accelerations
    are weighed.
    """

    _made_by: ClassVar[str] = "the `weighed` of mr.control.RegulatorSettings"

    Q: Floats
    N: Floats
    S: Floats


def weighed_outputs(outputs: Outputs, weights: Floats) -> Weighed:
    """What a weight W of outputs, shape (n_outputs, n_outputs), adds to a cost."""
    C, D = outputs.C, outputs.D
    return Weighed(Q=C.T @ weights @ C, N=C.T @ weights @ D, S=D.T @ weights @ D)


def weighed_state(plant: Plant, weights: Floats) -> Weighed:
    """What a weight Q of the state, shape (2n, 2n), adds to a cost."""
    n_devices = plant.n_devices
    return Weighed(Q=weights, N=np.zeros((len(weights), n_devices)), S=np.zeros((n_devices, n_devices)))


def each_weight(says: str, of: Magnitude | None = None, *, free: bool = False) -> Any:
    """Declare the key of a weight: one number, one for each, or a matrix.

    A search looks for the weight of a quantity of magnitude `of` where its cost is comparable to that of the weights
    that are held.
    """
    span = None if of is None else Span(lower=1e-4, upper=1e2, of=(("cost", 1.0), (of, -2.0)), free=free)
    return key(says, default=None, least=0.0, matrix=True, span=span)


@dataclass(frozen=True, slots=True, kw_only=True)
class CostWeights:
    """Weights of outputs and state; what several of them add to the cost is summed.

    Each weight is one number for all floors, storeys, devices or states, one for each, or a symmetric matrix; without
    any, the energy of the building is weighed.
    """

    accelerations: Weights | None = each_weight(
        "weights of absolute floor accelerations [(s2/m)2]", "acceleration", free=True
    )
    drifts: Weights | None = each_weight("weights of drifts [1/m2]", "drift")
    displacements: Weights | None = each_weight("weights of floor displacements [1/m2]", "displacement")
    velocities: Weights | None = each_weight("weights of floor velocities [(s/m)2]", "velocity", free=True)
    relative_velocities: Weights | None = each_weight(
        "weights of the rates of drifts, velocities of storeys between their ends [(s/m)2]", "rate"
    )
    rates: Weights | None = each_weight(
        "weights of the rates of the devices' elongations [(s/m)2]; alone they ask for the force of dashpots",
        "rate",
        free=True,
    )
    state_weight: Weights | None = each_weight(
        "weights of the state: displacements, then velocities of the coordinates; Q, or Q_P of a Lyapunov function"
    )
    energy: float | None = key("weight of twice the energy of the building [1/J]", default=None, above=0.0)
    designed: WeightWishes | None = key(
        "weights designed from limits on rms responses and a budget of force, instead of any others",
        default=None,
    )

    def weighed(self, plant: Plant) -> Weighed:
        """The sum of what the weights add to the cost."""
        if self.designed is not None:
            return self._designed(self.designed, plant)
        given: list[tuple[Outputs, Floats]] = []
        for name, make, each in _OUTPUTS:
            weights = getattr(self, name)
            if weights is not None:
                outputs = make(plant)
                given.append((outputs, weight_matrix(name, weights, len(outputs.names), each)))
        parts = []
        if given:
            W = scipy.linalg.block_diag(*(weights for _, weights in given))
            parts.append(weighed_outputs(stacked(*(outputs for outputs, _ in given)), W))
        if self.state_weight is not None:
            Q = weight_matrix("state_weight", self.state_weight, 2 * plant.n_coordinates, "states")
            parts.append(weighed_state(plant, Q))
        if not parts:
            return weighed_state(plant, (self.energy or 1.0) * plant.energy)
        if self.energy is not None:
            first = next(name for name in self._names() if getattr(self, name) is not None)
            raise InvalidSettingError(
                "energy", f"the law weighs the energy, or outputs such as {first}; keep one"
            )
        return Weighed(
            Q=_sum([part.Q for part in parts]),
            N=_sum([part.N for part in parts]),
            S=_sum([part.S for part in parts]),
        )

    def _designed(self, wishes: WeightWishes, plant: Plant) -> Weighed:
        """What designed weights add, scaled such that the mean control weight is 1 as designed."""
        self.check_designed_alone()
        if wishes.sampled:
            raise InvalidSettingError(
                "designed",
                "a sampled design gives the gain of a wanted force, and this law takes weights; leave sampled out",
            )
        found = wishes.design(plant)
        scale = 1.0 / float(found.control_weight.mean())
        S = found.R - np.diag(found.control_weight)
        return Weighed(Q=scale * found.Q, N=scale * found.N, S=scale * S)

    @property
    def sampled(self) -> bool:
        """Whether the weights are those of a design in discrete time, which gives a gain instead."""
        return self.designed is not None and self.designed.sampled

    def check_designed_alone(self) -> None:
        """Refuse other weights besides designed ones."""
        for name in (*self._names(), "energy"):
            if getattr(self, name) is not None:
                raise InvalidSettingError("designed", f"the law has designed weights, and {name}; keep one")

    def notes(self, problem: DesignProblem) -> tuple[str, ...]:
        """What designed weights reach, and how they are to be used."""
        return () if self.designed is None else self.designed.in_words(problem)

    @classmethod
    def cost(cls, held: Mapping[str, float], magnitudes: Magnitudes) -> float:
        """What weights that are held add up to at these magnitudes; those of single floors are averaged."""
        if "designed" in held:
            # Of these weights R is 1 as designed.
            return magnitudes.force**2
        costs = 0.0
        for name, value in (held or {"energy": 1.0}).items():
            if name in _MAGNITUDES:
                entries = np.asarray(value, dtype=np.float64)
                weight = float(np.trace(entries) / len(entries) if entries.ndim == 2 else entries.mean())
                size = float(getattr(magnitudes, _MAGNITUDES[name]))
                costs += weight * (size if name == "energy" else size**2)
        return costs or magnitudes.energy

    def _names(self) -> tuple[str, ...]:
        return (*(name for name, _, _ in _OUTPUTS), "state_weight")


def _sum(parts: Sequence[Floats]) -> Floats:
    return np.asarray(sum(parts[1:], start=parts[0]))


_OUTPUTS = (
    ("accelerations", accelerations, "floors"),
    ("drifts", drifts, "storeys"),
    ("displacements", displacements, "floors"),
    ("velocities", velocities, "floors"),
    ("relative_velocities", relative_velocities, "storeys"),
    ("rates", deformation_rates, "devices"),
)
"""Settings of outputs, the outputs, and what they belong to."""
_MAGNITUDES: Mapping[str, Magnitude] = {
    "accelerations": "acceleration",
    "drifts": "drift",
    "displacements": "displacement",
    "velocities": "velocity",
    "relative_velocities": "rate",
    "rates": "rate",
    "energy": "energy",
}
"""Magnitude of what each weight belongs to."""
