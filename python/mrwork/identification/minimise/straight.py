"""Coordinates of least-squares steps: straight in the parameters in which the force of a model is linear.

The misfit is quadratic in such parameters, whatever their scale. In the logarithm of a force, or in the free length of
a spring, whose force is a product, its valleys bend, and steps along them are short for ever. The logarithm also takes
the slope away from a force near zero, which then stays there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec

# A step keeps this share of a positive parameter: what falls to zero at once takes all slopes away.
_LEAST_SHARE = 0.1
# Share of its value, and of its range, within which a parameter is on a bound.
_ON_BOUND = 1e-12
# Factors on rates and shapes that are far from them, and the most points that are far.
_FAR = (30.0, 1e3)
_MOST_LIMITS = 16
_A_LITTLE = 0.3


@dataclass(frozen=True)
class Straight:
    """Points of the free parameters of a model: logarithms of what is positive and no force, the others as they are.

    Instead of the free length of a spring a point has the force of the spring at zero stroke, save where the length is
    `held`.
    """

    spec: DamperSpec
    box: Box

    @cached_property
    def _free(self) -> NDArray[np.intp]:
        return np.array(self.box.free, dtype=np.intp)

    @cached_property
    def _bounds(self) -> tuple[Floats, Floats]:
        return np.array(self.box.lower)[self._free], np.array(self.box.upper)[self._free]

    @cached_property
    def _positive(self) -> NDArray[np.bool_]:
        return np.array(self.box.log, dtype=np.bool_)[self._free]

    @cached_property
    def _scales_with_force(self) -> NDArray[np.bool_]:
        forces = {parameter.name for parameter in self.spec.parameters if parameter.scales_with_force}
        return np.array([name in forces for name in self.box.free_names], dtype=np.bool_)

    @cached_property
    def _log(self) -> NDArray[np.bool_]:
        return self._positive & ~self._scales_with_force

    @cached_property
    def _spring(self) -> tuple[int, int] | None:
        """Columns of stiffness and free length, where both are free."""
        indices = self.spec.spring_indices
        if indices is None or not set(indices) <= set(self.box.free):
            return None
        stiffness, length = (self.box.free.index(index) for index in indices)
        return stiffness, length

    @cached_property
    def of_force(self) -> NDArray[np.bool_]:
        """Which coordinates are forces, or scale with the force."""
        of_force = self._scales_with_force.copy()
        if self._spring is not None:
            of_force[self._spring[1]] = True
        return of_force

    def limits(self, theta: Floats, random: np.random.Generator) -> Floats:
        """Points far from one, (n_params,), towards the limits of the model, (n_points, n_params), inside the box.

        Some logarithmic coordinates are far smaller and others far larger, in any combination: there a loop is a
        spring, a dashpot or dry friction. All are then moved a little at random.
        """
        columns = self._free[self._log]
        ways = [each for each in product((-1, 0, 1), repeat=len(columns)) if any(each)]
        if not ways:
            return np.empty((0, len(theta)))

        def moved(points: Floats, powers: Floats) -> Floats:
            points[:, columns] *= np.exp(powers)
            return np.clip(points, self.box.lower, self.box.upper)

        powers = np.concatenate([np.array(ways) * np.log(factor) for factor in _FAR])
        # On a bound, other ways lead to the same point.
        points = np.unique(moved(np.tile(theta, (len(powers), 1)), powers), axis=0)
        points = random.permutation(points[np.any(points != theta, axis=1)])[:_MOST_LIMITS]
        return moved(points, _A_LITTLE * random.standard_normal((len(points), len(columns))))

    def far_down(self, theta: Floats, steps: Floats) -> tuple[NDArray[np.bool_], Floats]:
        """Which steps, (n_rows, n_free), take a positive force too far down at once, and the ones it takes."""
        positive = self._positive & ~self._log
        least = np.where(positive, (_LEAST_SHARE - 1.0) * theta[:, self._free], -np.inf)
        down = steps < least
        return down, np.where(down, least, 0.0)

    def outward(self, theta: Floats, gradient: Floats) -> NDArray[np.bool_]:
        """Which free parameters are on a bound that the misfit falls across, from its gradient by them, same shape."""
        value = theta[:, self._free]
        lower, upper = self._bounds
        near = _ON_BOUND * np.where(self._positive, np.abs(value), upper - lower)
        return ((value <= lower + near) & (gradient > 0.0)) | ((value >= upper - near) & (gradient < 0.0))

    def slope(self, theta: Floats, held: NDArray[np.bool_]) -> Floats:
        """Derivatives of the free parameters by the coordinates of the point, (n_rows, n_free, n_free)."""
        value = theta[:, self._free]
        slope = np.where(self._log, value, 1.0)[:, :, None] * np.eye(value.shape[1])
        if self._spring is not None:
            stiffness, length = self._spring
            turned = ~held[:, length]
            by_force = 1.0 / _not_zero(value[:, stiffness])
            slope[turned, length, length] = by_force[turned]
            slope[turned, length, stiffness] = -(value[:, length] * by_force)[turned]
        return slope

    def after(self, theta: Floats, held: NDArray[np.bool_], steps: Floats) -> Floats:
        """Parameters after steps, (n_rows, n_steps, n_params) from (n_rows, n_steps, n_free), inside the box."""
        value = theta[:, None, self._free]
        lower, upper = self._bounds
        with np.errstate(over="ignore"):
            moved = np.where(self._log, value * np.exp(np.where(self._log, steps, 0.0)), value + steps)
        moved = np.where(self._positive, np.maximum(moved, _LEAST_SHARE * value), moved)
        if self._spring is not None:
            stiffness, length = self._spring
            force = value[..., stiffness] * value[..., length] + steps[..., length]
            moved[..., length] = np.where(
                held[:, None, length], value[..., length], force / _not_zero(moved[..., stiffness])
            )
        after = np.repeat(theta[:, None], steps.shape[1], axis=1)
        after[..., self._free] = np.clip(moved, lower, upper)
        return after


def _not_zero(stiffness: Floats) -> Floats:
    return np.where(stiffness == 0.0, np.finfo(float).tiny, stiffness)
