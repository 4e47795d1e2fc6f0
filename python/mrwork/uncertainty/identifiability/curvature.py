"""The squared misfit about many sets of parameters at once: its value, slope and curvature, simulated in lanes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.identification.linearisation import linearised
from mrwork.identification.objective import Objective
from mrwork.uncertainty.identifiability.scale import Scale

# Numbers that the residuals of one batch may hold at once.
_NUMBERS = 2**24

# Residuals (n_residuals,) and their derivative (n_residuals, n_free) per unit of the free parameters, at each row of
# theta (n_batch, n_params).
Linearise = Callable[[NDArray[np.float64]], Iterable[tuple[NDArray[np.float64], NDArray[np.float64]]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scaled:
    """The free parameters of a box in coordinates of their own: logarithms, or multiples of their scale.

    `theta` has the values of those that are not free; arrays have shape (n_free,). `spring` are the places of a
    stiffness and of the displacement at which it bears nothing, if both are free: their product offsets the force, so a
    stiffness can change its sign only if the displacement does too, through infinity.
    """

    theta: NDArray[np.float64]
    free: tuple[int, ...]
    log: NDArray[np.bool_]
    size: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    spring: tuple[int, int] | None = None

    @classmethod
    def of(cls, box: Box, scale: Scale, theta: NDArray[np.float64]) -> Scaled:
        """Coordinates of the free parameters of `box`, about `theta`, shape (n_params,)."""
        free = np.array(box.free, dtype=int)
        log = np.array(box.log)[free]
        size = np.where(log, 1.0, scale.size[free])
        bounds = (np.array(each)[free] for each in (box.lower, box.upper))
        lower, upper = (np.where(log, np.log(np.where(log, each, 1.0)), each / size) for each in bounds)
        return cls(
            theta=theta, free=box.free, log=log, size=size, lower=lower, upper=upper, spring=_spring(box)
        )

    def position(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Coordinates, shape (..., n_free), of parameters, shape (..., n_params), pulled into the box."""
        value = theta[..., np.array(self.free, dtype=int)]
        own = np.where(self.log, np.log(np.where(self.log, value, 1.0)), value / self.size)
        return np.asarray(np.clip(own, self.lower, self.upper))

    def values(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values of the free parameters, shape (..., n_free)."""
        return np.asarray(np.where(self.log, np.exp(np.where(self.log, position, 0.0)), position * self.size))

    def parameters(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """All parameters, shape (..., n_params)."""
        theta = np.broadcast_to(self.theta, (*position.shape[:-1], self.theta.size)).copy()
        theta[..., np.array(self.free, dtype=int)] = self.values(position)
        return theta

    def moved(
        self, position: NDArray[np.float64], step: NDArray[np.float64], held: int | None
    ) -> NDArray[np.float64]:
        """The position after a step, inside the box; a spring takes it in stiffness and offset, unless x0 is held."""
        there = position + step
        if self.spring is not None and held != self.spring[1]:
            stiffness, free = self.spring
            if there[stiffness] != 0.0:
                offset = position[stiffness] * there[free] + position[free] * step[stiffness]
                there[free] = offset / there[stiffness]
        return np.asarray(np.clip(there, self.lower, self.upper))

    def slope(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivative of each free parameter with respect to its coordinate, shape (..., n_free)."""
        return np.asarray(np.where(self.log, self.values(position), self.size))


def _spring(box: Box) -> tuple[int, int] | None:
    free = [box.names[index] for index in box.free]
    pairs = [(name, "x0") for name in ("k1", "k0", "k") if name in box.names and "x0" in box.names][:1]
    both = [(free.index(name), free.index(rest)) for name, rest in pairs if name in free and rest in free]
    return both[0] if both else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Curvature:
    """Squared misfit S of rows, (n_rows,), half its gradient, (n_rows, n_free), and J'J, (n_rows, n_free, n_free)."""

    squared: NDArray[np.float64]
    gradient: NDArray[np.float64]
    normal: NDArray[np.float64]


def curvature(linearise: Linearise, scaled: Scaled, position: NDArray[np.float64]) -> Curvature:
    """Curvature at each row of `position`, shape (n_rows, n_free); where a simulation failed S is infinite."""
    squared, gradient, normal = [], [], []
    for (residuals, jacobian), slope in zip(
        linearise(scaled.parameters(position)), scaled.slope(position), strict=True
    ):
        own = jacobian * slope
        squared.append(float(residuals @ residuals))
        gradient.append(own.T @ residuals)
        normal.append(own.T @ own)
    # Residuals of one are those of a simulation that failed.
    total = np.array(squared)
    return Curvature(
        squared=np.where(total >= residuals.size, np.inf, total),
        gradient=np.array(gradient),
        normal=np.array(normal),
    )


def linearise(objective: Objective, columns: Sequence[int]) -> Linearise:
    """Residuals and exact derivatives with respect to columns of theta, a few rows at a time."""
    rows = max(1, _NUMBERS // ((len(columns) + 1) * objective.n_time))

    def in_chunks(theta: NDArray[np.float64]) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        for first in range(0, len(theta), rows):
            residuals, jacobian = linearised(objective, theta[first : first + rows], columns)
            for own, slope in zip(residuals, jacobian, strict=True):
                yield own, slope.T

    return in_chunks
