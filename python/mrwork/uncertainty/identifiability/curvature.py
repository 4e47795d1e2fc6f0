"""Scaled coordinates of the free parameters, and the squared misfit with its gradient and curvature in them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec
from mrwork.identification.objective import Objective, linearised
from mrwork.identification.search_ranges import search_box
from mrwork.records import DamperTest
from mrwork.uncertainty.identifiability.judgement import ParameterScale
from mrwork.values import holds_arrays

# A value smaller than this share of the nominal one counts as zero.
_NEGLIGIBLE = 0.01
# Largest number of residual entries in one batch.
_LARGEST_BATCH = 2**24

# Residuals (n_residuals,) and their derivative (n_residuals, n_free) with respect to the free parameters, at each row
# of theta (n_batch, n_params).
Linearise = Callable[[NDArray[np.float64]], Iterable[tuple[NDArray[np.float64], NDArray[np.float64]]]]


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """Size of a relevant change of each parameter, shape (n_params,): its value, or half its range where `of_range`.

    The size of a parameter with a logarithmic scale is its value. Other parameters may be zero; their size is half the
    range derived from the scales of the records, where this is larger. `ranges` are the ranges so derived, within
    the admissible ones of `box`; `theta` are the values, shape (n_params,).
    """

    box: Box
    ranges: Box
    theta: NDArray[np.float64]
    size: NDArray[np.float64]
    of_range: NDArray[np.bool_]

    @classmethod
    def of(
        cls, spec: DamperSpec, box: Box, tests: tuple[DamperTest, ...], theta: NDArray[np.float64]
    ) -> Scale:
        """Scales at `theta`, shape (n_params,)."""
        ranges = scaled_ranges(spec, box, tests, theta)
        half = 0.5 * (np.array(ranges.upper) - np.array(ranges.lower))
        size = np.abs(theta)
        of_range = ~np.array(box.log) & (half > size)
        return cls(
            box=box, ranges=ranges, theta=theta, size=np.where(of_range, half, size), of_range=of_range
        )

    def of_parameter(self, spec: DamperSpec, index: int, derivative: NDArray[np.float64]) -> ParameterScale:
        """Scale of one parameter of the model, with the derivative of the residuals by it, shape (n_residuals,)."""
        return ParameterScale(
            name=spec.names[index],
            unit=spec.parameters[index].unit,
            value=float(self.theta[index]),
            size=float(self.size[index]),
            of_range=bool(self.of_range[index]),
            lower=self.ranges.lower[index],
            upper=self.ranges.upper[index],
            log=self.box.log[index],
            bounds=(self.box.lower[index], self.box.upper[index]),
            sensitivity=float(np.linalg.norm(derivative)),
        )


def scaled_ranges(
    spec: DamperSpec, box: Box, tests: tuple[DamperTest, ...], theta: NDArray[np.float64]
) -> Box:
    """The box narrowed to the scales of the records; where these give no range, to the size of the value.

    Where the value is negligible beside the nominal one, such as a share at its bound of zero, to the nominal size.
    """
    searched = search_box(spec, box, tests)
    own = {}
    for index, name in enumerate(box.names):
        as_wide = searched.lower[index] == box.lower[index] and searched.upper[index] == box.upper[index]
        size, typical = abs(float(theta[index])), abs(spec.parameters[index].nominal)
        size = size if size > _NEGLIGIBLE * typical else typical
        if as_wide and not box.log[index] and size > 0.0:
            own[name] = (max(box.lower[index], -size), min(box.upper[index], size))
    return searched.with_bounds({name: pair for name, pair in own.items() if pair[0] < pair[1]})


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class Scaled:
    """Scaled coordinates of the free parameters of a box: logarithms, or multiples of their size.

    `theta` has the values of parameters that are not free; arrays have shape (n_free,). `spring` has the indices of the
    accumulator's stiffness k and free length x0, if both are free: k x0 offsets the force, so k can change its sign
    only if x0 does too, through infinity.
    """

    theta: NDArray[np.float64]
    free: tuple[int, ...]
    log: NDArray[np.bool_]
    size: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    spring: tuple[int, int] | None = None

    @classmethod
    def of(cls, spec: DamperSpec, box: Box, scale: Scale, theta: NDArray[np.float64]) -> Scaled:
        """Coordinates of the free parameters of `box`, about `theta`, shape (n_params,)."""
        free = np.array(box.free, dtype=int)
        log = np.array(box.log)[free]
        size = np.where(log, 1.0, scale.size[free])
        bounds = (np.array(each)[free] for each in (box.lower, box.upper))
        lower, upper = (np.where(log, np.log(np.where(log, each, 1.0)), each / size) for each in bounds)
        spring = None
        if spec.spring_indices is not None and set(spec.spring_indices) <= set(box.free):
            spring = (box.free.index(spec.spring_indices[0]), box.free.index(spec.spring_indices[1]))
        return cls(theta=theta, free=box.free, log=log, size=size, lower=lower, upper=upper, spring=spring)

    def position(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Coordinates, shape (..., n_free), of parameters, shape (..., n_params), clipped to the box."""
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
        """Position after a step, clipped to the box; the step of a spring is one in k and k x0, unless x0 is held."""
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


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class Curvature:
    """Squared misfit S of rows, (n_rows,), half its gradient, (n_rows, n_free), and J'J, (n_rows, n_free, n_free)."""

    squared: NDArray[np.float64]
    gradient: NDArray[np.float64]
    normal: NDArray[np.float64]


def curvature(linearise: Linearise, scaled: Scaled, position: NDArray[np.float64]) -> Curvature:
    """Curvature at each row of `position`, shape (n_rows, n_free); S is infinite where a simulation failed."""
    squared, gradient, normal = [], [], []
    for (residuals, jacobian), slope in zip(
        linearise(scaled.parameters(position)), scaled.slope(position), strict=True
    ):
        own = jacobian * slope
        squared.append(float(residuals @ residuals))
        gradient.append(own.T @ residuals)
        normal.append(own.T @ own)
    # All residuals of a failed simulation are 1.
    total = np.array(squared)
    return Curvature(
        squared=np.where(total >= residuals.size, np.inf, total),
        gradient=np.array(gradient),
        normal=np.array(normal),
    )


def linearise(objective: Objective, columns: Sequence[int]) -> Linearise:
    """Residuals and exact derivatives with respect to columns of theta, in batches of limited size."""
    rows = max(1, _LARGEST_BATCH // ((len(columns) + 1) * objective.n_time))

    def in_chunks(theta: NDArray[np.float64]) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        for first in range(0, len(theta), rows):
            residuals, jacobian = linearised(objective, theta[first : first + rows], columns)
            for own, slope in zip(residuals, jacobian, strict=True):
                yield own, slope.T

    return in_chunks
